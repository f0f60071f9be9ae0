//! Changes to bytes and to lines of words, whatever they mean.

use crate::support::random::Random;

/// Numbers that overflow, wrap, divide by zero or lie just beside what does.
pub const NUMBERS: [u64; 22] = [
    0,
    1,
    2,
    3,
    0x7f,
    0x80,
    0xff,
    0x100,
    0x7fff,
    0x8000,
    0xffff,
    0x1_0000,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x1_0000_0000,
    1 << 53,
    1 << 62,
    i64::MAX as u64,
    1 << 63,
    u64::MAX - 1,
    u64::MAX,
];

/// Floats that are none, have no inverse, or cannot be told from their neighbours.
pub const FLOATS: [f64; 16] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.1,
    f64::NAN,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::MAX,
    f64::MIN,
    f64::MIN_POSITIVE,
    f64::from_bits(1),
    f64::EPSILON,
    4_294_967_296.0,
    9.3e18,
    1e-9,
];

/// A number of no more than `width` bytes: an odd one, or one near `now`.
pub fn number(random: &mut Random, now: u64, len: usize) -> u64 {
    match random.below(6) {
        0 => random.number(),
        1 => now.wrapping_add(random.below(16) as u64 + 1),
        2 => now.wrapping_sub(random.below(16) as u64 + 1),
        3 => (len as u64).wrapping_add(random.below(9) as u64).wrapping_sub(4),
        _ => random.one_of(&NUMBERS),
    }
}

/// Puts another number into the `width` bytes at `at`, as far as these are there.
pub fn put_number(random: &mut Random, data: &mut [u8], at: usize, width: usize) {
    let len = data.len();
    let Some(field) = data.get_mut(at..at.saturating_add(width)) else { return };
    let mut bytes = [0; 8];
    bytes[..width.min(8)].copy_from_slice(&field[..width.min(8)]);
    let value = number(random, u64::from_le_bytes(bytes), len).to_le_bytes();
    field[..width.min(8)].copy_from_slice(&value[..width.min(8)]);
    if random.one_in(8) {
        field.reverse();
    }
}

/// Puts another float at `at`.
pub fn put_float(random: &mut Random, data: &mut [u8], at: usize) {
    if let Some(field) = data.get_mut(at..at + 8) {
        let float = random.one_of(&FLOATS);
        field.copy_from_slice(&float.to_le_bytes());
    }
}

/// Changes bytes anywhere; `other` is another input and `words` mean something in the format.
pub fn bytes(random: &mut Random, data: &mut Vec<u8>, other: &[u8], words: &[&[u8]]) {
    if data.is_empty() {
        data.extend_from_slice(other);
    }
    let at = random.below(data.len());
    match random.below(15) {
        0 => {
            if let Some(byte) = data.get_mut(at) {
                *byte ^= 1 << random.below(8);
            }
        }
        1 => {
            if let Some(byte) = data.get_mut(at) {
                *byte = random.number() as u8;
            }
        }
        2 | 3 => {
            let width = random.one_of(&[1, 2, 4, 8]);
            put_number(random, data, at, width);
        }
        4 => put_float(random, data, at),
        5 => drop(data.drain(random.stretch(data.len()))),
        6 => {
            let copy = data[random.stretch(data.len())].to_vec();
            insert(data, at, &copy);
        }
        7 => {
            let part = &other[random.stretch(other.len())];
            insert(data, at, part);
        }
        8 => {
            let part = &other[random.stretch(other.len())];
            overwrite(data, at, part);
        }
        9 => data.truncate(at),
        10 => {
            let copy = data[random.stretch(data.len())].to_vec();
            let times = 1 + random.below(4096 / copy.len().max(1) + 1);
            insert(data, at, &copy.repeat(times));
        }
        11 if !words.is_empty() => insert(data, at, random.one_of(words)),
        13 | 14 => fill(random, data),
        12 if !words.is_empty() => overwrite(data, at, random.one_of(words)),
        _ => {
            // The beginning of one and the end of the other.
            data.truncate(at);
            data.extend_from_slice(&other[random.below(other.len())..]);
        }
    }
}

/// Fills a stretch with one byte, as a hole in a sparse copy or a worn disk reads.
pub fn fill(random: &mut Random, data: &mut [u8]) {
    let any = random.number() as u8;
    let byte = random.one_of(&[0x00, 0x00, 0xff, 0xff, any]);
    let stretch = random.stretch(data.len());
    data[stretch].fill(byte);
}

/// Inserts `part` at `at`.
pub fn insert(data: &mut Vec<u8>, at: usize, part: &[u8]) {
    let at = at.min(data.len());
    data.splice(at..at, part.iter().copied());
}

fn overwrite(data: &mut [u8], at: usize, part: &[u8]) {
    for (byte, new) in data.iter_mut().skip(at).zip(part) {
        *byte = *new;
    }
}

/// Changes lines and words of the first `len` bytes, which are text.
pub fn lines(random: &mut Random, data: &mut Vec<u8>, len: usize, other: &[u8], words: &[&[u8]]) {
    let len = len.min(data.len());
    let rest = data.split_off(len);
    let mut lines: Vec<Vec<u8>> =
        data.split_inclusive(|b| *b == b'\n').map(<[u8]>::to_vec).collect();
    let others: Vec<&[u8]> = other.split_inclusive(|b| *b == b'\n').take(400).collect();
    let at = random.below(lines.len());
    match random.below(8) {
        0 => drop(lines.drain(random.stretch(lines.len()))),
        1 => {
            let copy = lines[random.stretch(lines.len())].to_vec();
            let times = if random.one_in(8) { 1 + random.below(200) } else { 1 };
            lines.splice(at..at, copy.iter().cloned().cycle().take(times * copy.len()));
        }
        2 if !others.is_empty() => {
            let part = &others[random.stretch(others.len())];
            lines.splice(at..at, part.iter().map(|line| line.to_vec()));
        }
        3 if !lines.is_empty() => {
            let with = random.below(lines.len());
            lines.swap(at, with);
        }
        _ if lines.is_empty() => lines.extend(others.iter().map(|line| line.to_vec())),
        _ => word(random, &mut lines[at], words),
    }
    *data = lines.concat();
    data.extend(rest);
}

/// Changes a word of a line: words are letters and digits, or what stands between.
fn word(random: &mut Random, line: &mut Vec<u8>, words: &[&[u8]]) {
    let is_letter = |b: &u8| b.is_ascii_alphanumeric() || matches!(b, b'_' | b'.' | b'-');
    let runs: Vec<&[u8]> = line.chunk_by(|a, b| is_letter(a) == is_letter(b)).collect();
    let mut runs: Vec<Vec<u8>> = runs.into_iter().map(<[u8]>::to_vec).collect();
    let at = random.below(runs.len());
    let new = match random.below(4) {
        0 => number_text(random).into_bytes(),
        _ if words.is_empty() => Vec::new(),
        _ => random.one_of(words).to_vec(),
    };
    match random.below(6) {
        0 if !runs.is_empty() => drop(runs.remove(at)),
        1 => runs.insert(at, new),
        2 if !runs.is_empty() => {
            let copy = runs[at].clone();
            runs.insert(at, copy);
        }
        _ if runs.is_empty() => runs.push(new),
        _ => runs[at] = new,
    }
    *line = runs.concat();
}

/// A number as text, in one of the ways that numbers are written.
pub fn number_text(random: &mut Random) -> String {
    let whole = random.one_of(&NUMBERS);
    match random.below(6) {
        0 => format!("{}", whole as i64),
        1 => format!("{:e}", random.one_of(&FLOATS)),
        2 => format!("{}", random.one_of(&FLOATS)),
        3 => format!("{whole:#x}"),
        4 => format!("{}", random.below(20)),
        _ => format!("{whole}"),
    }
}
