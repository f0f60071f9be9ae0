//! Target `laz`: the compressed points of a LAZ file, of every format, version and kind of chunk. Files are
//! small and are read alone, so that there are thousands of them in a second.

use std::path::Path;

use pointmill::ErrorKind::{self, Data};
use pointmill::io::las::open;

use super::judge::{self, Judgement, Outcome, shape};
use super::{Target, las, mutate};
use crate::support::laz::points::{Kind, Maker};
use crate::support::laz::{Chunks, Recipe};
use crate::support::random::Random;

/// The target.
pub const TARGET: Target =
    Target { name: "laz", judge: target, seeds: |_| seeds(), mutate: change, at_home: false };

/// How a file that is no good is refused.
const REFUSED: &[ErrorKind] = &[Data];
/// One input of so many is read twice.
const TWICE: u32 = 4;

fn target(path: &Path, data: &[u8]) -> Judgement {
    let source = match open(&[path.to_owned()]) {
        Ok(source) => source,
        Err(error) => return judge::refused("open", &error, REFUSED),
    };
    let layout = format!("{:?}", source.schema().layout);
    // Which inputs are read twice, and without which dimensions, depends on the input alone.
    let sum = data.iter().fold(0u32, |sum, &byte| sum.rotate_left(5) ^ u32::from(byte));
    let read = if sum.is_multiple_of(TWICE) {
        judge::read_twice(&*source, REFUSED)?
    } else {
        let names: Vec<String> =
            source.schema().dimensions.iter().map(|d| d.name.clone()).collect();
        let unread = match sum % 3 {
            0 => &[][..],
            1 => &names[3..],
            _ => &names[3.max(sum as usize / 8 % names.len())..],
        };
        judge::read_without(&*source, unread, REFUSED)?
    };
    let Some(read) = read else {
        let marks = vec!["a part holds too much".to_owned()];
        return Ok(Outcome { accepted: true, marks });
    };
    let mark = match &read.error {
        Some(error) => format!("{layout}: {}", shape(error)),
        None => format!("{layout}: read, {}, {}", read.all, !source.warnings().is_empty()),
    };
    Ok(Outcome { accepted: read.error.is_none(), marks: vec![mark] })
}

/// Mostly the points; seldom what describes them.
fn change(random: &mut Random, data: &mut Vec<u8>, other: &[u8]) {
    let start = las::word::<4>(data, 96) as usize;
    match random.below(16) {
        0 => las::change(random, data, other),
        1 => mutate::bytes(random, data, other, &[]),
        2 if start < data.len() => {
            // Points cut off, and the chunk table with them.
            let left = start + random.below(data.len() - start);
            data.truncate(left);
        }
        _ if start < data.len() => {
            let mut points = data.split_off(start);
            let theirs = other.get(las::word::<4>(other, 96) as usize..).unwrap_or_default();
            points_of_a_length(random, &mut points, theirs);
            data.extend(points);
        }
        _ => mutate::bytes(random, data, other, &[]),
    }
}

/// Changes that leave all that follows where it was.
fn points_of_a_length(random: &mut Random, points: &mut [u8], other: &[u8]) {
    let at = random.below(points.len());
    match random.below(6) {
        0 | 1 => mutate::fill(random, points),
        2 => {
            let width = random.one_of(&[1, 2, 4, 8]);
            mutate::put_number(random, points, at, width);
        }
        3 => points[at] = random.number() as u8,
        4 => {
            let part = &other[random.stretch(other.len())];
            points[at..].iter_mut().zip(part).for_each(|(byte, new)| *byte = *new);
        }
        _ => points[at] ^= 1 << random.below(8),
    }
}

/// One file of each format, version and kind of chunks; wave packets, extra bytes and scanner channels are
/// among their fields.
pub fn seeds() -> Vec<Vec<u8>> {
    let mut all = Vec::new();
    for format in 0..=10u8 {
        let versions = if format < 6 { [1, 2] } else { [3, 4] };
        for version in versions {
            let mut ways =
                vec![Chunks::Fixed(50_000), Chunks::Fixed(30), Chunks::Varying(vec![1, 25])];
            if format < 6 {
                ways.push(Chunks::None);
            }
            for (i, chunks) in ways.into_iter().enumerate() {
                let recipe = Recipe { format, extra: [0, 1, 3, 2][i], version, chunks };
                let mut maker = Maker::new(&recipe, u64::from(format) + 100 * i as u64);
                let kind = [Kind::Walk, Kind::Mixed, Kind::Constant][(i + version as usize) % 3];
                all.push(recipe.bake(&maker.records(kind, 40 + i)));
            }
        }
    }
    all
}
