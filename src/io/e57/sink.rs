//! Writes points to an E57 file, as one scan.
//!
//! The crate's writer wants to know types before the first point, and whether colours have 8 bits
//! or 16 is known in the end; and its point cloud borrows the file. So rows grow in a file of their
//! own, as those of PLY do, and become E57 when all are there.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use e57::{E57Writer, Extension, Record, RecordDataType, RecordName, RecordValue};
use sha2::{Digest, Sha256};

use super::fields::{OWN, TIME_STAMP};
use super::info::{NOTE, name};
use super::names::RECORDS;
use crate::io::rows::file::{Heading, RowFile};
use crate::io::rows::plan::{RowOptions, RowPlan};
use crate::io::rows::schema::RowShape;
use crate::io::rows::{Encoding, RowForm};
use crate::point::names as n;
use crate::point::{Dimension, Endian, Metadata, RunNote, Scalar, Schema, Value};
use crate::stage::{Encode, Encoded, Sink, SinkSummary, WriteKeys};
use crate::{Error, Result};

const FORM: RowForm = RowForm {
    layout: RECORDS,
    holds_long: true,
    packs_colors: false,
    keeps_steps: true,
    holds_nan: false,
};

/// Where surface normals are described, and where what has no name in E57 is.
const NORMALS: [&str; 2] = ["nor", "http://www.libe57.org/E57_NOR_surface_normals.txt"];
const EXTENSION: [&str; 2] = [OWN, "https://pointmill.org/e57"];

/// Rows read at once.
const AT_ONCE: usize = 1 << 13;

/// How the records of an output are written.
///
/// # Errors
///
/// What E57 does not hold of records of `schema`.
pub(super) fn plan(keys: &WriteKeys, schema: &Schema, metadata: &Metadata) -> Result<RowPlan> {
    let options = RowOptions::of(keys, Encoding::BinaryLittleEndian, &metadata.computed);
    RowPlan::new(&options, FORM, schema)
}

struct NoHeading;

impl Heading for NoHeading {
    fn text(&self, _: u64) -> Vec<u8> {
        Vec::new()
    }
}

/// Writes rows, and makes E57 of them.
struct E57Sink {
    rows: RowFile<NoHeading>,
    /// Where the file is to be.
    path: PathBuf,
    crs: Option<String>,
    note: Option<Arc<RunNote>>,
}

/// Creates an E57 file at `staged` for records of `schema`.
///
/// # Errors
///
/// As [`plan`], and a file that cannot be created.
pub(super) fn create(
    staged: &Path,
    keys: &WriteKeys,
    schema: &Schema,
    metadata: &Metadata,
) -> Result<Box<dyn Sink>> {
    let plan = plan(keys, schema, metadata)?;
    check_names(&prototype(&plan.full.shape))?;
    let rows = RowFile::create(&staged.with_extension("rows"), plan, |_| NoHeading)?;
    let (path, crs, note) = (staged.to_owned(), metadata.crs.clone(), metadata.note.clone());
    Ok(Box::new(E57Sink { rows, path, crs, note }))
}

/// Refuses dimensions that would be values of one name.
fn check_names(prototype: &[Record]) -> Result<()> {
    let twice = |n: &usize| prototype[..*n].iter().any(|r| r.name == prototype[*n].name);
    match (0..prototype.len()).find(twice) {
        None => Ok(()),
        Some(n) => {
            let told = format!("two dimensions would be {:?} in E57", prototype[n].name);
            Err(Error::pipeline(told).help("`write.drop` leaves one of them out"))
        }
    }
}

/// What the values of a row are in E57.
fn prototype(shape: &RowShape) -> Vec<Record> {
    let has = |names: &[&str]| names.iter().all(|name| shape.row.find(name).is_some());
    let colors = has(&[n::RED, n::GREEN, n::BLUE]);
    let is_whole = |name: &str| shape.row.find(name).is_some_and(|d| !d.scalar.is_float());
    let returns = is_whole(n::RETURN_NUMBER) && is_whole(n::NUMBER_OF_RETURNS);
    let one = |column: &Dimension| {
        let data_type = data_type(column);
        let is_integer = matches!(data_type, RecordDataType::Integer { .. });
        let name = match column.name.as_str() {
            "X" => RecordName::CartesianX,
            "Y" => RecordName::CartesianY,
            "Z" => RecordName::CartesianZ,
            n::INTENSITY => RecordName::Intensity,
            n::RED if colors => RecordName::ColorRed,
            n::GREEN if colors => RecordName::ColorGreen,
            n::BLUE if colors => RecordName::ColorBlue,
            n::ROW if is_integer => RecordName::RowIndex,
            n::COLUMN if is_integer => RecordName::ColumnIndex,
            n::NUMBER_OF_RETURNS if returns => RecordName::ReturnCount,
            n::RETURN_NUMBER if returns => {
                // Some files have 0, which is before the first.
                let data_type = RecordDataType::Integer { min: -1, max: i64::from(u16::MAX) };
                return Record { name: RecordName::ReturnIndex, data_type };
            }
            TIME_STAMP => RecordName::TimeStamp,
            other => extension(other),
        };
        Record { name, data_type }
    };
    shape.columns.iter().map(one).collect()
}

/// What dimensions are called where all of them are there.
pub(crate) fn value_names(dimensions: &[&str]) -> Vec<String> {
    let field = |name: &&str| Dimension::new(*name, Scalar::U16, 0);
    let dimensions: Vec<Dimension> = dimensions.iter().map(field).collect();
    let row = Schema { layout: RECORDS, endian: Endian::Little, stride: 2, dimensions };
    let named = prototype(&RowShape::of(row, &FORM));
    named.iter().map(|record| name(&record.name)).collect()
}

/// The name of a value that the standard does not have.
fn extension(dimension: &str) -> RecordName {
    if let Some(axis) = n::NORMAL.iter().position(|name| *name == dimension) {
        let name = ["normalX", "normalY", "normalZ"][axis].to_owned();
        return RecordName::Unknown { namespace: NORMALS[0].to_owned(), name };
    }
    let letter = |c: char| if c.is_ascii_alphanumeric() || c == '_' { c } else { '_' };
    let name: String = dimension.chars().map(letter).collect();
    let begins = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
    let name = if begins { name } else { format!("_{name}") };
    RecordName::Unknown { namespace: OWN.to_owned(), name }
}

fn data_type(column: &Dimension) -> RecordDataType {
    let (min, max) = match column.scalar {
        Scalar::F32 => return RecordDataType::Single { min: None, max: None },
        Scalar::F64 => return RecordDataType::Double { min: None, max: None },
        Scalar::U8 => (0, u8::MAX.into()),
        Scalar::I8 => (i8::MIN.into(), i8::MAX.into()),
        Scalar::U16 => (0, u16::MAX.into()),
        Scalar::I16 => (i16::MIN.into(), i16::MAX.into()),
        Scalar::U32 => (0, u32::MAX.into()),
        Scalar::I32 => (i32::MIN.into(), i32::MAX.into()),
        Scalar::U64 => (0, i64::MAX),
        Scalar::I64 => (i64::MIN, i64::MAX),
    };
    let (scale, offset) = (column.scale, column.origin);
    match (scale, offset) == (1.0, 0.0) {
        true => RecordDataType::Integer { min, max },
        false => RecordDataType::ScaledInteger { min, max, scale, offset },
    }
}

impl Sink for E57Sink {
    fn chunk_points(&self) -> usize {
        self.rows.chunk_points()
    }

    fn chunk_bytes(&self) -> u64 {
        self.rows.chunk_bytes()
    }

    fn encoder(&self) -> Arc<dyn Encode> {
        self.rows.encoder()
    }

    fn append(&mut self, chunk: Encoded) -> Result<()> {
        self.rows.append(chunk)
    }

    fn finish(mut self: Box<Self>) -> Result<SinkSummary> {
        self.rows.narrow()?;
        let summary = self.rows.finish()?;
        self.write()?;
        let rows = &self.rows.path;
        std::fs::remove_file(rows).map_err(|e| Error::io(rows, "remove it", e))?;
        let failed = |e| Error::io(&self.path, "flush", e);
        let file = File::open(&self.path).map_err(failed)?;
        file.sync_all().map_err(failed)?;
        let bytes = file.metadata().map_err(failed)?.len();
        Ok(SinkSummary { bytes, ..summary })
    }
}

impl E57Sink {
    /// Hands the rows on, some at a time, with the number of the first.
    fn each(&self, mut to: impl FnMut(&[u8]) -> Result<()>) -> Result<()> {
        let stride = self.rows.shape().row.stride;
        let path = &self.rows.path;
        let file = File::open(path).map_err(|e| Error::io(path, "read it again", e))?;
        let mut buffer = vec![0; AT_ONCE * stride];
        let (mut at, end) = (0, self.rows.points * stride as u64);
        while at < end {
            let piece = &mut buffer[..(end - at).min((AT_ONCE * stride) as u64) as usize];
            let read = file.read_exact_at(piece, at);
            read.map_err(|e| Error::io(path, "read it again", e).at_byte(at))?;
            to(piece)?;
            at += piece.len() as u64;
        }
        Ok(())
    }

    fn write(&self) -> Result<()> {
        let shape = self.rows.shape();
        let prototype = prototype(shape);
        let mut hash = Sha256::new();
        hash.update(format!("{prototype:?}"));
        self.each(|rows| {
            hash.update(rows);
            Ok(())
        })?;
        // The same points have the same names, and others have others.
        let digest = hash.finalize();
        let [file, cloud] = [0, 16].map(|start| guid(&digest[start..start + 16]));
        let failed = |cause: e57::Error| {
            Error::data(&self.path, "it cannot be written as E57").because(cause)
        };
        let mut writer = E57Writer::from_file(&self.path, &file).map_err(failed)?;
        writer.set_coordinate_metadata(self.crs.clone());
        let uses = |space: &str| {
            let mut names = prototype.iter().map(|record| &record.name);
            names.any(|name| match name {
                RecordName::Unknown { namespace, .. } => namespace == space,
                _ => false,
            })
        };
        for [space, url] in [NORMALS, EXTENSION] {
            if uses(space) {
                writer.register_extension(Extension::new(space, url)).map_err(failed)?;
            }
        }
        let mut points = writer.add_pointcloud(&cloud, prototype.clone()).map_err(failed)?;
        if let Some(note) = &self.note {
            points.set_description(Some(format!("{NOTE}{}", note.text()?)));
        }
        self.each(|rows| {
            for row in rows.chunks_exact(shape.row.stride) {
                let values = shape.columns.iter().zip(&prototype);
                let values = values.map(|(column, record)| self.value(column, record, row));
                points.add_point(values.collect::<Result<_>>()?).map_err(failed)?;
            }
            Ok(())
        })?;
        points.finalize().map_err(failed)?;
        writer.finalize().map_err(failed)
    }

    fn value(&self, column: &Dimension, record: &Record, row: &[u8]) -> Result<RecordValue> {
        let whole = match column.get(row, Endian::Little) {
            Value::Single(v) => return Ok(RecordValue::Single(v)),
            Value::Double(v) => return Ok(RecordValue::Double(v)),
            Value::Signed(v) => v,
            Value::Unsigned(v) => i64::try_from(v).map_err(|_| {
                let told = format!("{} = {v} is beyond what E57 holds", column.name);
                Error::data(&self.path, told)
                    .help(format!("`write.drop = [{:?}]` leaves the dimension out", column.name))
            })?,
        };
        Ok(match (&record.name, &record.data_type) {
            (RecordName::ReturnIndex, _) => RecordValue::Integer(whole - 1),
            (_, RecordDataType::ScaledInteger { .. }) => RecordValue::ScaledInteger(whole),
            _ => RecordValue::Integer(whole),
        })
    }
}

/// Sixteen bytes as the name that the format wants for everything.
fn guid(bytes: &[u8]) -> String {
    let hex: String = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
    let at = |from: usize, to: usize| &hex[from..to];
    format!("{{{}-{}-{}-{}-{}}}", at(0, 8), at(8, 12), at(12, 16), at(16, 20), at(20, 32))
}
