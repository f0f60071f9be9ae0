//! Writes points to a PCD file.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use super::header::{PcdData, PcdField};
use super::names::{FORM, RECORDS};
use super::source::PcdNative;
use crate::io::rows::Encoding;
use crate::io::rows::comments::{line, lines};
use crate::io::rows::file::{Heading, RowFile};
use crate::io::rows::names::property;
use crate::io::rows::noted::NotedLines;
use crate::io::rows::plan::{RowOptions, RowPlan};
use crate::io::rows::schema::{PACKED, RowShape};
use crate::point::names::{GPS_TIME, NORMAL};
use crate::point::{Dimension, Metadata, Scalar, Schema};
use crate::stage::{OutputEncoding, Sink, WriteKeys};
use crate::{Error, Result};

/// What PCD inputs of such records say of themselves.
fn native_of(schema: &Schema, metadata: &Metadata) -> Option<Arc<PcdNative>> {
    let native = metadata.native.clone().filter(|_| schema.layout == RECORDS)?;
    native.downcast::<PcdNative>().ok()
}

/// How the records of an output are written.
///
/// # Errors
///
/// What PCD does not hold of records of `schema`.
pub(super) fn plan(keys: &WriteKeys, schema: &Schema, metadata: &Metadata) -> Result<RowPlan> {
    let native = native_of(schema, metadata);
    let encoding = match (keys.encoding, native.map(|native| native.data)) {
        (Some(OutputEncoding::Ascii), _) | (None, Some(PcdData::Ascii)) => Encoding::Ascii,
        _ => Encoding::BinaryLittleEndian,
    };
    RowPlan::new(&RowOptions::of(keys, encoding, &metadata.computed), FORM, schema)
}

/// The name of a dimension as a field.
pub(crate) fn field_name(dimension: &str) -> String {
    if let Some(axis) = NORMAL.iter().position(|name| *name == dimension) {
        return ["normal_x", "normal_y", "normal_z"][axis].to_owned();
    }
    let name = property(dimension).unwrap_or(dimension);
    let name: String = name.chars().map(|c| if c.is_ascii_graphic() { c } else { '_' }).collect();
    // A field of this name is padding.
    if name.is_empty() || name == "_" { "unnamed".to_owned() } else { name }
}

/// Where the sensor was of points whose input does not say it.
const UPRIGHT: [f64; 7] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];

/// Where the sensor was; and what is to be told if the input says it of points that were moved.
fn viewpoint(native: Option<&PcdNative>, metadata: &Metadata) -> ([f64; 7], Option<String>) {
    match native.and_then(|native| native.viewpoint) {
        Some(own) if metadata.moved && own != UPRIGHT => {
            let told = "the input's VIEWPOINT is not carried: the points were moved, and the \
                        header says 0 0 0 1 0 0 0";
            (UPRIGHT, Some(told.to_owned()))
        }
        own => (own.unwrap_or(UPRIGHT), None),
    }
}

/// What stands above the points.
struct PcdHeadings {
    comments: String,
    note: NotedLines,
    fields: Vec<PcdField>,
    viewpoint: [f64; 7],
    data: PcdData,
}

impl PcdHeadings {
    fn of(
        columns: &[Dimension],
        encoding: Encoding,
        metadata: &Metadata,
        native: Option<&PcdNative>,
        note: NotedLines,
    ) -> PcdHeadings {
        let kept = native.iter().flat_map(|native| &native.names);
        let kept: BTreeMap<&str, &String> = kept.map(|(d, name)| (d.as_str(), name)).collect();
        let mut fields = Vec::new();
        let is_binary = encoding != Encoding::Ascii;
        for column in columns {
            let own = column.name.as_str();
            let name = match kept.get(own) {
                Some(&kept) => kept.clone(),
                None => field_name(own),
            };
            // The library's own points have such a number as a float; a text could not hold all.
            let is_number = PACKED.contains(&own) && is_binary;
            let scalar = if is_number { Scalar::F32 } else { column.scalar };
            let size = scalar.size();
            fields.push(PcdField { name, scalar: Some(scalar), size, count: 1 });
        }
        let has_times = columns.iter().any(|column| column.name == GPS_TIME);
        let mut comments = lines("# ", metadata, has_times);
        comments.extend(metadata.comments.iter().map(|comment| line("# ", comment)));
        let viewpoint = viewpoint(native, metadata).0;
        let data = if is_binary { PcdData::Binary } else { PcdData::Ascii };
        PcdHeadings { comments, note, fields, viewpoint, data }
    }
}

impl Heading for PcdHeadings {
    fn text(&self, rows: u64) -> Vec<u8> {
        let each = |of: &dyn Fn(&PcdField) -> String| -> String {
            self.fields.iter().map(|field| format!(" {}", of(field))).collect()
        };
        // Blanks behind a comment bring every header of a file to one length.
        let left = " ".repeat(2 * (20 - rows.to_string().len()));
        let viewpoint: String = self.viewpoint.iter().map(|v| format!(" {v}")).collect();
        format!(
            "# .PCD v0.7 - Point Cloud Data file format{left}\n{}{}VERSION 0.7\nFIELDS{}\n\
             SIZE{}\nTYPE{}\nCOUNT{}\nWIDTH {rows}\nHEIGHT 1\nVIEWPOINT{viewpoint}\n\
             POINTS {rows}\nDATA {}\n",
            self.note.text,
            self.comments,
            each(&|field| field.name.clone()),
            each(&|field| field.size.to_string()),
            each(&|field| field.letter().to_string()),
            each(&|field| field.count.to_string()),
            self.data.word(),
        )
        .into_bytes()
    }

    fn settle(&mut self) -> Result<()> {
        self.note.settle()
    }
}

/// Creates a PCD file at `staged` for records of `schema`.
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
    let native = native_of(schema, metadata);
    let plan = plan(keys, schema, metadata)?;
    check_names(&plan)?;
    let encoding = plan.encoding;
    let (note, left_out) = NotedLines::of(metadata, "# ");
    let heading = |shape: &RowShape| {
        PcdHeadings::of(&shape.columns, encoding, metadata, native.as_deref(), note.clone())
    };
    let mut file = RowFile::create(staged, plan, heading)?;
    file.notes.extend(viewpoint(native.as_deref(), metadata).1);
    file.notes.extend(left_out);
    Ok(Box::new(file))
}

/// Refuses dimensions that would be fields of one name.
fn check_names(plan: &RowPlan) -> Result<()> {
    let columns = &plan.full.shape.columns;
    let names: Vec<String> = columns.iter().map(|column| field_name(&column.name)).collect();
    match names.iter().enumerate().find(|(n, name)| names[..*n].contains(name)) {
        None => Ok(()),
        Some((n, name)) => {
            let own = &columns[n].name;
            let told = format!("two dimensions would be the field `{name}` of PCD");
            Err(Error::pipeline(told).help(format!("`write.drop = [\"{own}\"]` leaves one out")))
        }
    }
}
