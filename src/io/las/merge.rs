//! Several files as one: what they must share, and what becomes of what they do not. Nothing here
//! depends on the order of the inputs.

use std::path::{Path, PathBuf};

use super::extra::Descriptor;
use super::fields::encoding;
use super::form::{OneForm, help};
use super::format::{has_gps_time, has_waveforms, layout};
use super::found::{holding, smallest};
use super::header::Header;
use super::input::LasInput;
use super::native::Native;
use super::read::Shift;
use super::system::CrsRecords;
use super::text::field;
use super::union::{UnionRecords, described};
use super::vlr::Evlr;
use crate::error::shown;
use crate::io::steps::whole_steps;
use crate::io::systems::{remedy, told_apart};
use crate::point::{GpsTime, names};
use crate::{Error, Result};

/// Files that are to be read as one scan, taken in one by one: of each only its header is kept, and
/// of their records the union.
pub struct LasMerge {
    /// The first, with its records: the others are compared with it.
    first: LasInput,
    /// Where the first is that names a system, and how, where others need not name it.
    named: Option<(PathBuf, CrsRecords)>,
    form: OneForm,
    records: UnionRecords,
}

impl LasMerge {
    /// Begins with one file, which is in the form already.
    pub fn of(first: LasInput, form: &OneForm) -> Result<Self> {
        let (records, form) = (UnionRecords::of(&first)?, form.clone());
        let mut merge = LasMerge { records, named: None, form, first };
        merge.named = merge.naming(&merge.first)?;
        Ok(merge)
    }

    /// Adds a file, which is in the form; fails if the two cannot be one.
    pub fn add(&mut self, other: &LasInput) -> Result<()> {
        agree(&self.first, other)?;
        self.agree_on_crs(other)?;
        self.records.add(other)
    }

    /// Where the file is and its records, if it names a system.
    fn naming(&self, input: &LasInput) -> Result<Option<(PathBuf, CrsRecords)>> {
        let records = input.crs_records()?;
        let is_named = !self.form.assumes_crs || records.text()?.is_some();
        Ok(is_named.then(|| (input.path.clone(), records)))
    }

    fn agree_on_crs(&mut self, other: &LasInput) -> Result<()> {
        let Some((path, records)) = self.naming(other)? else { return Ok(()) };
        let Some((first, named)) = &self.named else {
            self.named = Some((path, records));
            return Ok(());
        };
        if named.same_system(&records)? {
            return Ok(());
        }
        let (one, two) = (named.text()?, records.text()?);
        let both = told_apart(one.as_deref(), two.as_deref());
        let error = refused(first, &other.path, format!("their CRS differ: {both}"));
        Err(error.help(remedy(one.is_none() || two.is_none())))
    }

    /// One header and one list of records for all `inputs`, which are the files taken in, and how
    /// far each must be shifted.
    pub fn finish(self, inputs: &[LasInput]) -> Result<(Native, Vec<Shift>)> {
        if inputs.len() <= 1 {
            return Ok((Native::of(&self.first), vec![Shift::default()]));
        }
        let (offset, shifts) = shifts(inputs, self.form.offset())?;
        let (vlrs, gap, evlrs) = self.records.finish()?;
        waveforms(inputs, &evlrs)?;
        external(inputs)?;
        let mut header = header(inputs);
        header.put_offset(offset);
        let native = Native { header, vlrs, gap, evlrs, waveforms: None };
        Ok((native, shifts))
    }
}

/// Refuses two files that cannot be one.
fn agree(a: &LasInput, b: &LasInput) -> Result<()> {
    let (one, two) = (&a.header, &b.header);
    if one.format() != two.format() {
        let error = differ(a, b, "point format", one.format(), two.format());
        return Err(match holding(one.format(), two.format()) {
            Some(both) => error
                .help(format!("give `read.point_format = {both}`, which has the fields of both")),
            None => error,
        });
    }
    if described(a) != described(b) {
        return Err(other_extras(a, b));
    }
    same(a, b, "record length", one.point_data_record_length, two.point_data_record_length)?;
    if one.scale() != two.scale() {
        return Err(differ(a, b, "scale", one.scale(), two.scale()).help(help(a, b)));
    }
    if has_gps_time(one.format()) && one.gps_time() != two.gps_time() {
        return Err(other_times(a, b));
    }
    Ok(())
}

fn other_times(a: &LasInput, b: &LasInput) -> Error {
    let kind = |input: &LasInput| match input.header.gps_time() {
        GpsTime::Week => "GPS week time, seconds since Sunday",
        GpsTime::AdjustedStandard => "adjusted standard GPS time, seconds since 1980 less 1e9",
    };
    let (one, two) = (shown(&a.path), shown(&b.path));
    let why = format!("their GPS time type differs: {one} has {}; {two} has {}", kind(a), kind(b));
    refuse(a, b, why).help(without_times(a.header.format()))
}

/// How files of a point format go together without their times.
fn without_times(format: u8) -> String {
    let fields = |format| layout(format, &[], [1.0; 3], [0.0; 3]);
    let own = fields(format);
    let timeless = if own.find(names::RED).is_some() { 2 } else { 0 };
    let held = fields(timeless);
    let all = own.dimensions.iter().map(|field| field.name.as_str());
    let drop: Vec<&str> = all.filter(|name| held.find(name).is_none()).collect();
    let mut help = format!(
        "no file says which week it is of, so that neither can be made of the other; without times \
         they go together: convert each by itself first, with `write.point_format = {timeless}` \
         and `write.drop = {drop:?}`"
    );
    if format >= 6 {
        // Waveforms are in one file, and stay with it.
        let is_lost = |name: &&str| *name == names::GPS_TIME || name.starts_with("Wave");
        let drop: Vec<&str> = drop.into_iter().filter(is_lost).collect();
        help += &format!(
            ". All point formats from 6 on have times, and {timeless} does not hold classes above \
             31, return numbers above 7 and fractions of a degree: where there are such values, \
             convert each file to PLY with `write.drop = {drop:?}`, and these PLY files to LAS"
        );
    }
    help
}

fn other_extras(a: &LasInput, b: &LasInput) -> Error {
    let names = |input: &LasInput| {
        let all: Vec<String> = described(input).iter().map(Descriptor::name).collect();
        if all.is_empty() { "none".to_owned() } else { all.join(", ") }
    };
    let (one, two) = (names(a), names(b));
    let why = match one == two {
        true => format!("their extra bytes, {one}, are described differently"),
        false => format!("their extra bytes differ: {one} and {two}"),
    };
    refuse(a, b, why).help(
        "`read.assume = [\"extra-bytes\"]` brings both to all extra bytes that there are: those \
         that a file lacks are 0 there, or what their description has for no data",
    )
}

fn same<T: PartialEq + std::fmt::Debug>(
    a: &LasInput,
    b: &LasInput,
    what: &str,
    one: T,
    two: T,
) -> Result<()> {
    if one == two { Ok(()) } else { Err(differ(a, b, what, one, two)) }
}

fn differ<T: std::fmt::Debug>(a: &LasInput, b: &LasInput, what: &str, one: T, two: T) -> Error {
    refuse(a, b, format!("their {what} differs: {one:?} and {two:?}"))
}

fn refuse(a: &LasInput, b: &LasInput, why: String) -> Error {
    refused(&a.path, &b.path, why)
}

fn refused(a: &Path, b: &Path, why: String) -> Error {
    let (one, two) = (shown(a), shown(b));
    Error::data(b, format!("{one} and {two} cannot be read as one scan: {why}"))
        .help("bring the files to one form first, or run them one by one")
}

/// The offset of all inputs, which is the smallest per axis where no other is wanted, and each
/// input's whole steps to it.
fn shifts(inputs: &[LasInput], wanted: Option<[f64; 3]>) -> Result<([f64; 3], Vec<Shift>)> {
    let first = &inputs[0];
    let scale = first.header.scale();
    let least = smallest(inputs.iter().map(|input| &input.header));
    let all = wanted.unwrap_or(least);
    let mut shifts = Vec::new();
    for input in inputs {
        let mut shift = [0; 3];
        for axis in 0..3 {
            let offset = input.header.offset()[axis];
            shift[axis] = whole_steps(all[axis], offset, scale[axis]).ok_or_else(|| {
                let other = inputs.iter().find(|i| i.header.offset()[axis] == all[axis]);
                let other = other.unwrap_or(first);
                let why = format!(
                    "their offsets {:?} and {offset:?} on axis {} do not differ by whole steps \
                     of {:?}, or by too many",
                    all[axis],
                    ["x", "y", "z"][axis],
                    scale[axis]
                );
                refuse(other, input, why).help(help(other, input))
            })?;
        }
        // Records that are projected move as they are.
        shifts.push(if input.own.is_some() { Shift::default() } else { Shift(shift) });
    }
    Ok((all, shifts))
}

/// Fields that all inputs share are carried; the others become neutral, the version and the date
/// the largest.
fn header(inputs: &[LasInput]) -> Header {
    let all: Vec<Header> = inputs.iter().map(|i| i.header.for_outputs()).collect();
    let headers = || all.iter();
    let first = &all[0];
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
