//! What an output says of itself and not of its points: in which system it is, what its times
//! count, what made it of what.

use super::crs::{self, GEO_ASCII, GEO_DOUBLES, GEO_KEYS, USER};
use super::described::{Described, describe};
use super::extra::Descriptor;
use super::fields::encoding;
use super::format::{has_gps_time, record_size};
use super::geokeys::GeoKeys;
use super::header::Header;
use super::native::Native;
use super::text::{field, split_at_room};
use super::vlr::Vlr;
use crate::Result;
use crate::io::{systems, wkt};
use crate::point::{GpsTime, Metadata, Schema};

/// User and number of the record that names the stages which the records went through.
const PIPELINE: (&str, u16) = ("pointmill", 1);
/// What the generating software is.
const SOFTWARE: &str = concat!("pointmill ", env!("CARGO_PKG_VERSION"));

/// Has the records name the reference system as the point format wants it, and the header say of
/// what kind they are; notes what is not carried of it, or not in that form.
pub fn name_system(
    native: &mut Native,
    metadata: &Metadata,
    notes: &mut Vec<String>,
) -> Result<()> {
    if metadata.moved {
        name_other_system(native, metadata)?;
    }
    if native.header.format() >= 6 {
        name_by_text(native, notes)?;
    }
    if crs::wants_bit(&native.header, &native.vlrs, &native.evlrs)? {
        native.header.put_encoding(encoding::WKT, true);
    }
    let Some(text) = &metadata.crs else { return Ok(()) };
    let there = crs::text(&native.vlrs, &native.evlrs)?.is_some();
    if let (Err(why), false) = (crs::record(text), there) {
        notes.push(format!("the CRS is not carried: {why}: {}", shortened(text)));
    }
    Ok(())
}

/// Names the system that moved points are in now, if the records name another.
fn name_other_system(native: &mut Native, metadata: &Metadata) -> Result<()> {
    let Some(text) = &metadata.crs else { return Ok(()) };
    let said = crs::text(&native.vlrs, &native.evlrs)?;
    if said.is_some_and(|said| systems::are_same(&said, text)) {
        return Ok(());
    }
    let at = native.vlrs.iter().position(|vlr| crs::is_record(&vlr.user(), vlr.record()));
    let at = at.unwrap_or(native.vlrs.len());
    native.vlrs.retain(|vlr| !crs::is_record(&vlr.user(), vlr.record()));
    native.evlrs.retain(|evlr| !crs::is_record(&evlr.user(), evlr.record()));
    // Where it is named by GeoTIFF keys: point formats 6 to 10 get WKT in their place yet.
    native.header.put_encoding(encoding::WKT, wkt::is_wkt(text));
    if let Ok(record) = crs::record(text) {
        native.vlrs.insert(at.min(native.vlrs.len()), record);
    }
    Ok(())
}

fn shortened(text: &str) -> String {
    let (shown, rest) = split_at_room(text, 100);
    format!("{shown}{}", if rest.is_empty() { "" } else { "…" })
}

/// Puts WKT in the place of GeoTIFF keys: point formats 6 to 10 must have it (LAS 1.4 R15, section
/// 3, "Coordinate Reference System Information"). Keys of which no WKT is known stay.
fn name_by_text(native: &mut Native, notes: &mut Vec<String>) -> Result<()> {
    if crs::has_wkt(&native.vlrs, &native.evlrs)? {
        return Ok(());
    }
    let Some(text) = crs::text(&native.vlrs, &native.evlrs)? else { return Ok(()) };
    let made = match GeoKeys::of(&native.vlrs) {
        Some(keys) => keys.wkt(&native.vlrs),
        // What libLAS wrote before WKT had a place.
        None => Some(text.clone()).filter(|text| wkt::is_wkt(text)),
    };
    let Some(Ok(record)) = made.map(|text| crs::record(&text)) else {
        notes.push(format!(
            "the CRS stays as GeoTIFF keys, of which no WKT is known: {}; point format {} asks \
             for WKT, and some readers will see no CRS",
            shortened(&text),
            native.header.format()
        ));
        return Ok(());
    };
    let is_keys = |vlr: &Vlr| [GEO_KEYS, GEO_DOUBLES, GEO_ASCII].iter().any(|n| vlr.is(USER, *n));
    let at = native.vlrs.iter().position(is_keys).unwrap_or(native.vlrs.len());
    native.vlrs.insert(at, record);
    native.vlrs.retain(|vlr| !is_keys(vlr));
    Ok(())
}

/// Has the header say what GPS times count.
pub fn count_gps_time(header: &mut Header, metadata: &Metadata, notes: &mut Vec<String>) {
    if !has_gps_time(header.format()) {
        return;
    }
    match metadata.gps_time {
        Some(kind) => {
            header.put_encoding(encoding::GPS_STANDARD, kind == GpsTime::AdjustedStandard)
        }
        None => notes.push(
            "GpsTime is written as seconds of the GPS week: the input does not say what it counts"
                .to_owned(),
        ),
    }
}

/// Says what made the output: always the program, and of records that went through stages what was
/// done (LAS 1.4 R15, section 2.4: the system identifier) and by which stages, in the place of what
/// an earlier run said. Nothing of it depends on when or where.
pub fn credit(native: &mut Native, schema: &Schema, metadata: &Metadata, notes: &mut Vec<String>) {
    let header = &mut native.header;
    header.generating_software = field(SOFTWARE);
    let axes = schema.coordinates();
    let moved = axes.is_some_and(|axes| {
        axes.map(|d| d.scale) != header.scale() || axes.map(|d| d.origin) != header.offset()
    });
    if let Some(pipeline) = &metadata.pipeline {
        header.system_identifier = field("EXTRACTION");
        native.vlrs.retain(|v| !v.is(PIPELINE.0, PIPELINE.1));
        match u16::try_from(pipeline.len()) {
            Ok(_) => {
                let payload = pipeline.as_bytes().to_vec();
                native.vlrs.push(Vlr::new(PIPELINE.0, PIPELINE.1, "pipeline", payload));
            }
            Err(_) => notes.push("the pipeline is too long for a record that names it".to_owned()),
        }
    } else if moved {
        header.system_identifier = field("TRANSFORMATION");
    }
}

/// Ranges of extra bytes are those of all points of the input: they do not hold for some.
pub fn drop_ranges(native: &mut Native, schema: &Schema) -> Result<()> {
    let base = usize::from(record_size(native.header.format()).unwrap_or(0));
    let known = Described::of(&native.vlrs, &native.evlrs, schema.stride.saturating_sub(base))?;
    let without: Vec<Descriptor> =
        known.descriptors.iter().map(Descriptor::without_range).collect();
    if without != known.descriptors {
        describe(&mut native.vlrs, &mut native.evlrs, &without);
    }
    Ok(())
}
