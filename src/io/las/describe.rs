//! What a file says of itself, for people: `pointmill info`.

use std::path::Path;

use serde::Serialize;

use super::chunks::Chunks;
use super::crs;
use super::format::has_gps_time;
use super::input::{LasInput, Storage};
use super::laz::Compressor;
use super::text::text;
use crate::Result;
use crate::point::GpsTime;
use crate::stage::OnError;

/// A LAS or LAZ file as its header and records describe it; no point is read.
#[derive(Debug, Clone, Serialize)]
pub struct Description {
    /// "LAS" or "LAZ".
    pub kind: &'static str,
    /// LAS version, such as "1.4".
    pub version: String,
    /// Point data record format, 0 to 10.
    pub point_format: u8,
    /// Bytes of a record.
    pub record_length: u16,
    /// Points to read.
    pub points: u64,
    /// World units of one stored unit.
    pub scale: [f64; 3],
    /// World coordinates of stored 0.
    pub offset: [f64; 3],
    /// Smallest corner of the box that the header claims.
    pub min: [f64; 3],
    /// Largest corner of it.
    pub max: [f64; 3],
    /// Coordinate reference system as text.
    pub crs: Option<String>,
    /// Units of the coordinates in words, as far as that tells them.
    pub units: String,
    /// What GPS times count, where the records have them.
    pub gps_time: Option<&'static str>,
    /// What made the points, as the header says.
    pub system_identifier: String,
    /// What wrote the file, as the header says.
    pub generating_software: String,
    /// Day of the year and year of the header's date; 0 where it says none.
    pub creation_day: u16,
    /// See `creation_day`.
    pub creation_year: u16,
    /// Dimensions in record order.
    pub dimensions: Vec<String>,
    /// Dimensions behind the standard ones.
    pub extra_bytes: Vec<ExtraBytes>,
    /// Variable length records.
    pub vlrs: Vec<Record>,
    /// Extended variable length records.
    pub evlrs: Vec<Record>,
    /// How points are compressed: "none", "pointwise", "chunked" or "layered".
    pub compressor: &'static str,
    /// Points of a LAZ chunk, where all but the last have equally many.
    pub chunk_points: Option<u32>,
    /// LAZ chunks, where they are known.
    pub chunks: Option<u64>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// A dimension behind the standard ones.
#[derive(Debug, Clone, Serialize)]
pub struct ExtraBytes {
    /// Its name.
    pub name: String,
    /// Its type, such as "F32".
    pub scalar: String,
    /// World value = stored · scale + origin.
    pub scale: f64,
    /// See `scale`.
    pub origin: f64,
}

/// A variable length record.
#[derive(Debug, Clone, Serialize)]
pub struct Record {
    /// Who defined it.
    pub user_id: String,
    /// Its number among those of its user.
    pub record_id: u16,
    /// Bytes of its payload.
    pub length: u64,
    /// What it says it is.
    pub description: String,
}

/// Reads header and records of the LAS or LAZ file at `path`.
///
/// # Errors
///
/// As [`open`](super::open).
pub fn describe(path: &Path) -> Result<Description> {
    let input = LasInput::open(path, OnError::Fail)?;
    let (header, schema) = (&input.header, input.schema());
    let [min, max] = header.bounds();
    let (compressor, chunk_points, chunks) = storage(&input.storage);
    let first_extra = schema.stride - input.extra_len();
    Ok(Description {
        kind: if header.compressed() { "LAZ" } else { "LAS" },
        version: format!("1.{}", header.minor()),
        point_format: header.format(),
        record_length: header.point_data_record_length,
        points: input.points(),
        scale: header.scale(),
        offset: header.offset(),
        min,
        max,
        crs: crs::text(&input.vlrs, &input.evlrs)?,
        units: crs::units(&input.vlrs, &input.evlrs)?.words(),
        gps_time: has_gps_time(header.format()).then(|| match header.gps_time() {
            GpsTime::Week => "seconds of the GPS week",
            GpsTime::AdjustedStandard => "adjusted standard GPS time",
        }),
        system_identifier: text(&header.system_identifier),
        generating_software: text(&header.generating_software),
        creation_day: header.file_creation_day_of_year,
        creation_year: header.file_creation_year,
        dimensions: schema.dimensions.iter().map(|d| d.name.clone()).collect(),
        extra_bytes: schema
            .dimensions
            .iter()
            .filter(|d| d.offset >= first_extra)
            .map(|d| ExtraBytes {
                name: d.name.clone(),
                scalar: format!("{:?}", d.scalar),
                scale: d.scale,
                origin: d.origin,
            })
            .collect(),
        vlrs: records(&input),
        evlrs: extended(&input),
        compressor,
        chunk_points,
        chunks,
        warnings: input.warnings,
    })
}

fn storage(storage: &Storage) -> (&'static str, Option<u32>, Option<u64>) {
    let Storage::Laz(compression, chunks) = storage else { return ("none", None, None) };
    let compressor = match compression.compressor {
        Compressor::PointWise => "pointwise",
        Compressor::Chunked => "chunked",
        Compressor::Layered => "layered",
    };
    let count = match chunks {
        Chunks::Known(chunks) => Some(chunks.chunks()),
        Chunks::InARow { .. } => None,
    };
    let whole_file = compression.compressor == Compressor::PointWise;
    (compressor, compression.chunk_points.filter(|_| !whole_file), count)
}

fn records(input: &LasInput) -> Vec<Record> {
    let record = |v: &super::vlr::Vlr| Record {
        user_id: v.user(),
        record_id: v.record(),
        length: v.payload_len().into(),
        description: v.description(),
    };
    input.vlrs.iter().map(record).collect()
}

fn extended(input: &LasInput) -> Vec<Record> {
    let record = |v: &super::vlr::Evlr| Record {
        user_id: v.user(),
        record_id: v.record(),
        length: v.payload_len(),
        description: v.description(),
    };
    input.evlrs.iter().map(record).collect()
}
