//! What a LAS file says besides its points, as outputs carry it on.

use std::path::PathBuf;

use super::crs;
use super::damage::Mending;
use super::described::{Described, EXTRA_BYTES, describe};
use super::extra::Descriptor;
use super::fields::encoding;
use super::file::InputFile;
use super::form::{OneForm, reform};
use super::format::{format_of, has_waveforms, record_size};
use super::header::Header;
use super::input::{LasInput, extra_len, is_carried, is_carried_extended};
use super::records::{read_evlrs, read_vlrs};
use super::text::field;
use super::vlr::{Evlr, Vlr};
use super::waveforms::Waveforms;
use crate::Result;
use crate::error::shown;
use crate::io::wkt;
use crate::point::{Metadata, Schema};

/// Header and records of the input, without what describes how that file stored its points.
#[derive(Debug, Clone)]
pub struct Native {
    /// The public header block.
    pub header: Header,
    /// Variable length records.
    pub vlrs: Vec<Vlr>,
    /// Bytes between the records and the points.
    pub gap: Vec<u8>,
    /// Extended variable length records.
    pub evlrs: Vec<Evlr>,
    /// The file that records refer to for their waveforms, beside the input.
    pub waveforms: Option<PathBuf>,
}

impl Native {
    /// Of one input, as it is.
    pub fn of(input: &LasInput) -> Self {
        let (vlrs, evlrs) = input.carried();
        Native {
            header: input.header.for_outputs(),
            vlrs,
            gap: input.gap.clone(),
            evlrs,
            waveforms: input.waveforms.clone(),
        }
    }

    /// Of a file that was opened before with `header`, read again and brought to `form`.
    ///
    /// Fails if the file is another by now.
    pub fn again(file: &InputFile, header: &Header, form: &OneForm) -> Result<Self> {
        let now = Header::read(file)?;
        if now.bytes()? != header.bytes()? {
            return Err(file.wrong(0, "the header changed while the file was read"));
        }
        let mut mending = Mending::new(form.on_error);
        let (mut vlrs, gap) = read_vlrs(file, header, &mut mending)?;
        let mut evlrs = read_evlrs(file, header, &mut mending)?;
        let described = Described::of(&vlrs, &evlrs, extra_len(header))?;
        vlrs.retain(is_carried);
        evlrs.retain(is_carried_extended);
        described.carried(&mut vlrs, &mut evlrs);
        form.put_extra(&mut vlrs, &mut evlrs);
        form.put_crs(&mut vlrs, &mut evlrs);
        let waveforms = Waveforms::of(file.path(), header).there;
        let header = form.header(&now).for_outputs();
        Ok(Native { header, vlrs, gap, evlrs, waveforms })
    }

    /// True if it belongs to records of this schema.
    pub fn fits(&self, schema: &Schema) -> bool {
        format_of(schema) == Some(self.header.format())
            && schema.stride == usize::from(self.header.point_data_record_length)
    }

    /// The same for records of `schema`, in whatever point format that is.
    pub fn reformed(mut self, schema: &Schema) -> Self {
        let format = format_of(schema).unwrap_or(0);
        reform(&mut self.header, format, schema.stride);
        if !has_waveforms(format) {
            self.vlrs.retain(|vlr| !is_of_waveforms(&vlr.user(), vlr.record()));
            self.evlrs.retain(|evlr| !is_of_waveforms(&evlr.user(), evlr.record()));
            self.waveforms = None;
        }
        self
    }

    /// A header for points that come from no LAS file: LAS 1.4, records in `schema`'s LAS layout,
    /// its extra dimensions described, `crs` carried if it is WKT or EPSG codes.
    pub fn fresh(schema: &Schema, crs: Option<&str>) -> Self {
        let format = format_of(schema).unwrap_or(0);
        let length = u16::try_from(schema.stride).unwrap_or(u16::MAX);
        let mut header = Header::blank(format, length);
        header.system_identifier = field("OTHER");
        if let Some(axes) = schema.coordinates() {
            header.put_scale(axes.map(|d| d.scale));
            header.put_offset(axes.map(|d| d.origin));
        }
        let record = crs.and_then(|text| crs::record(text).ok());
        if format >= 6 || crs.is_some_and(|text| record.is_some() && wkt::is_wkt(text)) {
            // Section 2.4: formats 6 to 10 always say WKT.
            header.put_encoding(encoding::WKT, true);
        }
        let base = usize::from(record_size(format).unwrap_or(0));
        let extra = schema.dimensions.iter().filter(|d| d.offset >= base);
        let descriptors: Vec<Descriptor> = extra.map(Descriptor::of).collect();
        let (mut vlrs, mut evlrs) = (record.into_iter().collect(), Vec::new());
        describe(&mut vlrs, &mut evlrs, &descriptors);
        Native { header, vlrs, gap: Vec::new(), evlrs, waveforms: None }
    }
}

/// True for the records of waveforms: what packets are like, and the packets.
fn is_of_waveforms(user: &str, record: u16) -> bool {
    user == "LASF_Spec" && matches!(record, 100..=354 | 65_535)
}

/// Metadata for points in a LAS layout that come from no LAS file (see `Native::fresh`).
pub fn fresh(schema: &Schema, crs: Option<&str>) -> Metadata {
    Metadata {
        crs: crs.map(str::to_owned),
        units: crs.map(wkt::units).unwrap_or_default(),
        native: Some(std::sync::Arc::new(Native::fresh(schema, crs))),
        ..Metadata::default()
    }
}

/// So many lost records are named.
const NAMED: usize = 8;

/// What `metadata` of LAS inputs has and an output of another format does not hold: records that
/// say more than dimensions and the coordinate reference system, and waveforms that are there.
pub fn lost(metadata: &Metadata) -> Vec<String> {
    let native = metadata.native.as_ref().and_then(|native| native.downcast_ref::<Native>());
    let Some(native) = native else { return Vec::new() };
    let name = |user: String, record: u16| {
        let crs = user == "LASF_Projection" && metadata.crs.is_some();
        let described = (user.as_str(), record) == EXTRA_BYTES;
        (!crs && !described).then(|| format!("{user} {record}"))
    };
    let vlrs = native.vlrs.iter().filter_map(|vlr| name(vlr.user(), vlr.record()));
    let evlrs = native.evlrs.iter().filter_map(|evlr| name(evlr.user(), evlr.record()));
    let lost: Vec<String> = vlrs.chain(evlrs).collect();
    let named = match &lost[..] {
        all if all.len() > NAMED => {
            format!("{} and {} more", all[..NAMED].join(", "), all.len() - NAMED)
        }
        all => all.join(", "),
    };
    let records = (!lost.is_empty())
        .then(|| format!("variable length records of LAS; these are lost: {named}"));
    let file = native.waveforms.as_deref();
    let waveforms =
        file.map(|file| format!("waveforms of LAS; these are lost: those in {}", shown(file)));
    records.into_iter().chain(waveforms).collect()
}
