//! The one form that LAS inputs which differ are brought to as they are read: point format, scale,
//! offset, and the system that they are in.
//!
//! What all inputs share is left as it is, whatever is asked for: a record that need not change
//! stays the input's, byte for byte.

use std::path::PathBuf;

use super::crs;
use super::described::describe;
use super::extra::Descriptor;
use super::extras;
use super::fields::encoding;
use super::file::InputFile;
use super::format::{has_waveforms, record_size, reformed};
use super::found::{self, smallest};
use super::header::Header;
use super::input::{LasInput, extra_len};
use super::union::described;
use super::vlr::{Evlr, Vlr};
use crate::io::steps::whole_steps;
use crate::io::united::assumes_dimensions;
use crate::quantity::Setting;
use crate::stage::{Assumption, OnError, ReadKeys};
use crate::{Error, Result};

/// What inputs are brought to, where they differ.
#[derive(Debug, Clone, Default)]
pub struct OneForm {
    format: Option<u8>,
    scale: Option<[f64; 3]>,
    offset: Option<[f64; 3]>,
    crs: Option<Vlr>,
    /// The descriptors of all extra bytes, where some lack some.
    extra: Option<Vec<Descriptor>>,
    /// What is done about damage.
    pub on_error: OnError,
    /// True if inputs that name no system are in that of the others.
    pub assumes_crs: bool,
}

impl OneForm {
    /// The form that `keys` ask for, for these files: their headers are read if it depends on them.
    pub fn of(keys: &ReadKeys, paths: &[PathBuf]) -> Result<OneForm> {
        let record = keys.crs.as_ref().map(|text| crs::record(text)).transpose();
        let crs = record.map_err(|why| Error::pipeline(format!("`read.crs`: {why}")))?;
        let assumes_crs = keys.assume.contains(&Assumption::Crs);
        let on_error = keys.on_error;
        let mut form = OneForm { crs, assumes_crs, on_error, ..OneForm::default() };
        let assumes_extra =
            keys.assume.contains(&Assumption::ExtraBytes) || assumes_dimensions(keys);
        if assumes_extra && paths.len() > 1 {
            form.extra = extras::of_all(paths, on_error)?;
        }
        let places = keys.scale.is_some() || keys.offset.is_some();
        if paths.len() < 2 || !places && keys.point_format.is_none() {
            return Ok(form);
        }
        let read = |path: &PathBuf| Header::read(&InputFile::open(path)?);
        let headers = paths.iter().map(read).collect::<Result<Vec<_>>>()?;
        let first = &headers[0];
        if headers.iter().any(|header| header.format() != first.format()) {
            form.format = match keys.point_format {
                Some(Setting::Auto) => found::point_format(&headers),
                given => given.and_then(Setting::given),
            };
        }
        let smallest = smallest(headers.iter());
        let differ = |header: &Header| {
            header.scale() != first.scale() || !are_whole_steps(smallest, header, first.scale())
        };
        if places && headers.iter().any(differ) {
            let scale = match keys.scale {
                Some(Setting::Auto) => Some(found::scale(&headers, paths)?),
                Some(Setting::Given(scale)) => Some(scale),
                None => same_scale(&headers),
            };
            let is_found = [keys.scale, keys.offset].contains(&Some(Setting::Auto));
            let found = scale.filter(|_| is_found).and_then(|scale| found::offset(&headers, scale));
            let given = keys.offset.and_then(Setting::given);
            form.scale = scale;
            form.offset = scale.and(given.or(found).or(Some(smallest)));
        }
        Ok(form)
    }

    /// The offset of all inputs, where it is not simply the smallest.
    pub fn offset(&self) -> Option<[f64; 3]> {
        self.offset
    }

    /// `input` in this form: with the header that it has in it, and its own beside it where its
    /// records must change.
    pub fn bring(&self, mut input: LasInput) -> Result<LasInput> {
        self.put_crs(&mut input.vlrs, &mut input.evlrs);
        if let Some(format) = self.other_format(&input.header) {
            reformed(&input.schema(), format)?; // its names may be taken there
        }
        let formed = self.header(&input.header);
        let is_other = (formed.format(), formed.scale(), formed.offset())
            != (input.header.format(), input.header.scale(), input.header.offset());
        let has_others = self.extra.as_ref().is_some_and(|extra| *extra != described(&input));
        if let Some(extra) = self.extra.clone().filter(|_| has_others) {
            input.describe_as(extra);
        }
        if is_other || has_others {
            input.own = Some(Box::new(std::mem::replace(&mut input.header, formed)));
        }
        Ok(input)
    }

    /// The point format that records of a file with this header are brought to.
    fn other_format(&self, input: &Header) -> Option<u8> {
        self.format.filter(|format| *format != input.format())
    }

    /// The header that a file with this one has in this form.
    pub fn header(&self, input: &Header) -> Header {
        let mut header = input.clone();
        let format = self.other_format(input).unwrap_or(input.format());
        let extra = self.extra.as_ref().map(|all| all.iter().map(Descriptor::size).sum());
        let extra = extra.unwrap_or(extra_len(input));
        if format != input.format() || extra != extra_len(input) {
            let fields = usize::from(record_size(format).unwrap_or(0));
            reform(&mut header, format, fields + extra);
        }
        if let (Some(scale), Some(offset)) = (self.scale, self.offset)
            && !(header.scale() == scale && are_whole_steps(offset, &header, scale))
        {
            header.put_scale(scale);
            header.put_offset(offset);
        }
        header
    }

    /// Gives records the descriptors of all extra bytes.
    pub fn put_extra(&self, vlrs: &mut Vec<Vlr>, evlrs: &mut Vec<Evlr>) {
        if let Some(extra) = &self.extra {
            describe(vlrs, evlrs, extra);
        }
    }

    /// Gives records the system that all inputs are said to be in.
    pub fn put_crs(&self, vlrs: &mut Vec<Vlr>, evlrs: &mut Vec<Evlr>) {
        let Some(record) = &self.crs else { return };
        vlrs.retain(|vlr| !crs::is_record(&vlr.user(), vlr.record()));
        evlrs.retain(|evlr| !crs::is_record(&evlr.user(), evlr.record()));
        vlrs.push(record.clone());
    }
}

/// Makes `header` one of records of `format`, `stride` bytes long: a version of LAS that has it
/// (LAS 1.4 R15, section 2.6, and the versions before).
pub fn reform(header: &mut Header, format: u8, stride: usize) {
    let least = match format {
        0 | 1 => 0,
        2 | 3 => 2,
        4 | 5 => 3,
        _ => 4,
    };
    if header.minor() < least {
        let encoding = header.encoding();
        *header = header.resized(least, &header.padding);
        header.global_encoding = encoding;
    }
    header.point_data_record_format = format;
    header.point_data_record_length = u16::try_from(stride).unwrap_or(u16::MAX);
    if format >= 6 {
        // Section 2.4: formats 6 to 10 always say WKT.
        header.put_encoding(encoding::WKT, true);
    }
    if !has_waveforms(format) {
        header.put_encoding(encoding::WAVEFORM_INTERNAL, false);
        header.put_encoding(encoding::WAVEFORM_EXTERNAL, false);
        header.start_of_waveform_data_packet_record = None;
    }
}

fn are_whole_steps(from: [f64; 3], header: &Header, scale: [f64; 3]) -> bool {
    let offset = header.offset();
    (0..3).all(|axis| whole_steps(from[axis], offset[axis], scale[axis]).is_some())
}

/// The scale of all, if they have one.
fn same_scale(headers: &[Header]) -> Option<[f64; 3]> {
    let scale = headers[0].scale();
    headers.iter().all(|header| header.scale() == scale).then_some(scale)
}

/// What helps where the scales or offsets of two inputs differ.
pub fn help(one: &LasInput, two: &LasInput) -> String {
    let (a, b) = (one.header.scale(), two.header.scale());
    let finer: [f64; 3] = std::array::from_fn(|axis| a[axis].min(b[axis]));
    match a == b {
        true => {
            let offset = smallest([&one.header, &two.header].into_iter());
            format!(
                "give `read.offset = {offset:?}`: coordinates that are no steps from there are \
                 rounded, which is told; a finer `read.scale` rounds less"
            )
        }
        false if finer.iter().all(|scale| *scale == finer[0]) => {
            format!("give `read.scale = {:?}`, the finer of both", finer[0])
        }
        false => format!("give `read.scale = {finer:?}`, the finer of both"),
    }
}
