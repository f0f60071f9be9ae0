//! Several files as one: what they must share, and what becomes of what they do not. Nothing here
//! depends on the order of the inputs.

use super::fields::encoding;
use super::format::{has_gps_time, has_waveforms};
use super::header::Header;
use super::input::LasInput;
use super::native::Native;
use super::read::Shift;
use super::text::{field, split_at_room};
use super::union::{UnionRecords, described};
use super::vlr::Evlr;
use crate::error::shown;
use crate::{Error, Result};

/// Offsets whose distance is this close to whole steps differ by whole steps: decimal offsets are
/// seldom exact in binary.
const WHOLE: f64 = 1e-6;

/// Files that are to be read as one scan, taken in one by one: of each only its header is kept, and
/// of their records the union.
pub struct LasMerge {
    /// The first, with its records: the others are compared with it.
    first: LasInput,
    records: UnionRecords,
}

impl LasMerge {
    /// Begins with one file.
    pub fn of(first: LasInput) -> Result<Self> {
        Ok(LasMerge { records: UnionRecords::of(&first)?, first })
    }

    /// Adds a file; fails if the two cannot be one.
    pub fn add(&mut self, other: &LasInput) -> Result<()> {
        agree(&self.first, other)?;
        self.records.add(other)
    }

    /// One header and one list of records for all `inputs`, which are the files taken in, and how
    /// far each must be shifted.
    pub fn finish(self, inputs: &[LasInput]) -> Result<(Native, Vec<Shift>)> {
        if inputs.len() <= 1 {
            return Ok((Native::of(&self.first), vec![Shift::default()]));
        }
        let (offset, shifts) = shifts(inputs)?;
        let (vlrs, gap, evlrs) = self.records.finish()?;
        waveforms(inputs, &evlrs)?;
        external(inputs)?;
        let mut header = header(inputs);
        header.put_offset(offset);
        let native = Native { header, vlrs, gap, evlrs, waveforms: None, made: false };
        Ok((native, shifts))
    }
}

/// Refuses two files that cannot be one.
fn agree(a: &LasInput, b: &LasInput) -> Result<()> {
    let (one, two) = (&a.header, &b.header);
    same(a, b, "point format", one.format(), two.format())?;
    same(a, b, "record length", one.point_data_record_length, two.point_data_record_length)?;
    same(a, b, "scale", one.scale(), two.scale())?;
    if has_gps_time(one.format()) {
        let kind = |h: &Header| match h.encoding() & encoding::GPS_STANDARD {
            0 => "GPS week time",
            _ => "adjusted standard GPS time",
        };
        same(a, b, "GPS time type", kind(one), kind(two))?;
    }
    if described(a) != described(b) {
        return Err(refuse(a, b, "their extra bytes are described differently".to_owned()));
    }
    let (one, two) = (a.crs_records()?, b.crs_records()?);
    if one.same_system(&two)? {
        return Ok(());
    }
    let (one, two) = told_apart(one.text()?, two.text()?);
    Err(refuse(a, b, format!("their CRS differ: {one} and {two}")))
}

/// Two texts of systems as a message shows them: from the beginning if that tells them apart, else
/// from shortly before they differ.
fn told_apart(one: Option<String>, two: Option<String>) -> (String, String) {
    let (Some(one), Some(two)) = (&one, &two) else {
        return (
            one.map_or("none".into(), |text| short(&text)),
            two.map_or("none".into(), |text| short(&text)),
        );
    };
    if one == two {
        let shown = format!("{}, with other parameters", short(one));
        return (short(one), shown);
    }
    if short(one) != short(two) {
        return (short(one), short(two));
    }
    let alike = one.chars().zip(two.chars()).take_while(|(a, b)| a == b).count();
    let end = |text: &str| {
        format!("…{}", short(&text.chars().skip(alike.saturating_sub(20)).collect::<String>()))
    };
    (end(one), end(two))
}

fn same<T: PartialEq + std::fmt::Debug>(
    a: &LasInput,
    b: &LasInput,
    what: &str,
    one: T,
    two: T,
) -> Result<()> {
    if one == two {
        return Ok(());
    }
    Err(refuse(a, b, format!("their {what} differs: {one:?} and {two:?}")))
}

fn refuse(a: &LasInput, b: &LasInput, why: String) -> Error {
    let (one, two) = (shown(&a.path), shown(&b.path));
    Error::data(&b.path, format!("{one} and {two} cannot be read as one scan: {why}"))
        .help("bring the files to one form first, or run them one by one")
}

fn short(text: &str) -> String {
    let (head, tail) = split_at_room(text, 60);
    if tail.is_empty() { head.to_owned() } else { format!("{head}…") }
}

/// The smallest offset of all inputs per axis, and each input's whole steps to it.
fn shifts(inputs: &[LasInput]) -> Result<([f64; 3], Vec<Shift>)> {
    let first = &inputs[0];
    let scale = first.header.scale();
    let smallest: [f64; 3] = std::array::from_fn(|axis| {
        inputs.iter().map(|i| i.header.offset()[axis]).min_by(f64::total_cmp).unwrap_or(0.0)
    });
    let mut shifts = Vec::new();
    for input in inputs {
        let mut shift = [0; 3];
        for axis in 0..3 {
            let offset = input.header.offset()[axis];
            shift[axis] = whole_steps(smallest[axis], offset, scale[axis]).ok_or_else(|| {
                let other = inputs.iter().find(|i| i.header.offset()[axis] == smallest[axis]);
                let why = format!(
                    "their offsets {:?} and {offset:?} on axis {} do not differ by whole steps \
                     of {:?}, or by too many",
                    smallest[axis],
                    ["x", "y", "z"][axis],
                    scale[axis]
                );
                refuse(other.unwrap_or(first), input, why)
            })?;
        }
        shifts.push(Shift(shift));
    }
    Ok((smallest, shifts))
}

/// The steps of `scale` from one offset to another, if they are whole and stored coordinates, which
/// are i32, can move by them.
pub fn whole_steps(from: f64, to: f64, scale: f64) -> Option<i64> {
    if from == to {
        return Some(0);
    }
    let steps = (to - from) / scale;
    let whole = steps.round();
    let rounding = 4.0 * f64::EPSILON * (from.abs().max(to.abs()) / scale).abs();
    let near = (steps - whole).abs() <= WHOLE + rounding && whole.abs() < 2f64.powi(32);
    near.then_some(whole as i64)
}

/// Fields that all inputs share are carried; the others become neutral, the version and the date
/// the largest.
fn header(inputs: &[LasInput]) -> Header {
    let headers = || inputs.iter().map(|i| &i.header);
    let first = &inputs[0].header;
    let minor = headers().map(Header::minor).max().unwrap_or(4);
    let custom = &first.padding[..];
    let custom = if headers().all(|h| h.padding == custom) { custom } else { &[] };
    let mut merged = first.resized(minor, custom);
    let alike = |same: fn(&Header, &Header) -> bool| headers().all(|h| same(h, first));
    if !alike(|a, b| a.file_source_id == b.file_source_id) {
        merged.file_source_id = 0;
    }
    if !alike(|a, b| a.guid == b.guid) {
        merged.guid = [0; 16];
    }
    if !alike(|a, b| a.system_identifier == b.system_identifier) {
        merged.system_identifier = field("MERGE");
    }
    if !alike(|a, b| a.generating_software == b.generating_software) {
        merged.generating_software = [0; 32];
    }
    if !alike(|a, b| a.waveform_start() == b.waveform_start()) {
        merged.start_of_waveform_data_packet_record = None;
    }
    merged.global_encoding = headers().fold(0, |all, h| all | h.encoding());
    let date = |h: &Header| (h.file_creation_year, h.file_creation_day_of_year);
    let latest = headers().map(date).max();
    (merged.file_creation_year, merged.file_creation_day_of_year) = latest.unwrap_or_default();
    merged
}

/// Records refer to waveforms in the one file that has the name of theirs: two files cannot be one.
fn external(inputs: &[LasInput]) -> Result<()> {
    let Some(one) = inputs.iter().find(|input| input.waveforms.is_some()) else { return Ok(()) };
    let other = inputs.iter().find(|input| input.path != one.path).unwrap_or(one);
    Err(refuse(one, other, "their waveforms are in files of their own".to_owned()))
}

/// Records refer to waveforms by their place in one block: two blocks cannot be one.
fn waveforms(inputs: &[LasInput], evlrs: &[Evlr]) -> Result<()> {
    let inside = |i: &&LasInput| {
        has_waveforms(i.header.format()) && i.header.encoding() & encoding::WAVEFORM_INTERNAL != 0
    };
    let blocks = evlrs.iter().filter(|e| e.is("LASF_Spec", 65535)).count();
    let Some(one) = inputs.iter().find(inside) else { return Ok(()) };
    let other = inputs.iter().find(|i| !inside(i));
    if blocks <= 1 && other.is_none() {
        return Ok(());
    }
    let other = other.or_else(|| inputs.iter().find(|i| i.path != one.path)).unwrap_or(one);
    Err(refuse(one, other, "each has waveforms of its own".to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_texts_are_shown_where_they_differ() {
        let long = |end: &str| Some(format!("PROJCS[\"{}\",{end}]", "name ".repeat(30)));
        let (one, two) = told_apart(long("UNIT[1]"), long("UNIT[2]"));
        assert!(
            one.starts_with('…') && one.contains("UNIT[1]") && two.contains("UNIT[2]"),
            "{one}"
        );
        assert_eq!(told_apart(None, Some("a".into())), ("none".into(), "a".into()));
        let (one, two) = told_apart(Some("Here".into()), Some("Here".into()));
        assert_ne!(one, two);
    }
}
