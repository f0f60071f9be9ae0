//! What a LAS file says besides its points, as outputs carry it on.

use super::crs;
use super::extra::Descriptor;
use super::file::InputFile;
use super::format::record_size;
use super::header::{Header, at, encoding};
use super::input::{EXTRA_BYTES, Input, is_carried, is_carried_extended};
use super::vlr::{Evlr, Vlr, read_evlrs, read_vlrs};
use crate::Result;
use crate::io::wkt;
use crate::point::{Layout, Metadata, Schema, names};

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
}

impl Native {
    /// Of one input, as it is.
    pub fn of(input: &Input) -> Self {
        Native {
            header: input.header.clone(),
            vlrs: input.carried_vlrs(),
            gap: input.gap.clone(),
            evlrs: input.carried_evlrs(),
        }
    }

    /// Of a file that was opened before with `header`, read again.
    ///
    /// Fails if the file is another by now.
    pub fn again(file: &InputFile, header: &Header) -> Result<Self> {
        let now = Header::read(file)?;
        if now != *header {
            return Err(file.wrong(0, "the header changed while the file was read"));
        }
        let (mut vlrs, gap, _) = read_vlrs(file, header)?;
        let mut evlrs = read_evlrs(file, header)?;
        vlrs.retain(is_carried);
        evlrs.retain(is_carried_extended);
        Ok(Native { header: now, vlrs, gap, evlrs })
    }

    /// True if it belongs to records of this schema.
    pub fn fits(&self, schema: &Schema) -> bool {
        schema.layout == Layout::Las { format: self.header.format() }
            && schema.stride == usize::from(self.header.record_length())
    }

    /// A header for points that come from no LAS file: LAS 1.4, records in `schema`'s LAS layout,
    /// its extra dimensions described, WKT carried if `crs` is WKT.
    ///
    /// The generating software is named without a version, so that outputs do not change with it.
    pub fn fresh(schema: &Schema, crs: Option<&str>) -> Self {
        let format = if let Layout::Las { format } = schema.layout { format } else { 0 };
        let length = u16::try_from(schema.stride).unwrap_or(u16::MAX);
        let mut header = Header::blank(4, format, length);
        header.put(at::SYSTEM, b"OTHER");
        header.put(at::SOFTWARE, b"pointmill");
        if let Some(axes) = schema.coordinates() {
            header.put_floats(at::SCALE, axes.map(|d| d.scale));
            header.put_floats(at::OFFSET, axes.map(|d| d.origin));
        }
        let record = crs.filter(|text| wkt::is_wkt(text)).and_then(crs::wkt_record);
        if record.is_some() || format >= 6 {
            // Section 2.4: formats 6 to 10 always say WKT.
            header.put(at::GLOBAL_ENCODING, &encoding::WKT.to_le_bytes());
        }
        let base = usize::from(record_size(format).unwrap_or(0));
        let extra = schema.dimensions.iter().filter(|d| d.offset >= base);
        let payload: Vec<u8> = extra.flat_map(|d| *Descriptor::of(d).bytes()).collect();
        let describe = !payload.is_empty() && u16::try_from(payload.len()).is_ok();
        let described =
            describe.then(|| Vlr::new(EXTRA_BYTES.0, EXTRA_BYTES.1, "Extra bytes", payload));
        let vlrs = record.into_iter().chain(described).collect();
        Native { header, vlrs, gap: Vec::new(), evlrs: Vec::new() }
    }
}

/// Metadata for points in a LAS layout that come from no LAS file (see `Native::fresh`).
pub fn fresh(schema: &Schema, crs: Option<&str>) -> Metadata {
    Metadata {
        crs: crs.map(str::to_owned),
        units: crs.map(wkt::units).unwrap_or_default(),
        comments: Vec::new(),
        native: Some(std::sync::Arc::new(Native::fresh(schema, crs))),
    }
}

/// The three dimensions that hold a normal already, if all are there.
pub fn normals_of(schema: &Schema) -> Option<[&crate::point::Dimension; 3]> {
    let [x, y, z] = names::NORMAL.map(|name| schema.find(name));
    Some([x?, y?, z?])
}
