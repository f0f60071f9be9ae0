//! One PCD file: its header, what a record of it is, and whether it is long enough.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::header::{PcdData, PcdField, PcdHeader};
use super::lzf::LzfMark;
use super::names::RECORDS;
use super::packed::Packed;
use crate::error::shown;
use crate::io::damage::Losses;
use crate::io::origin::Origin;
use crate::io::rows::names::heading_among;
use crate::io::rows::schema::{ALPHA, PACKED};
use crate::point::names::{BLUE, COLUMN, GREEN, RED, ROW, XYZ};
use crate::point::{Dimension, Endian, Scalar, Schema};
use crate::report::Grouped;
use crate::stage::OnError;
use crate::{Error, Result};

/// Points of one part of a binary file.
pub(super) const PART_POINTS: u64 = 1 << 17;

/// One file, its header read.
pub(super) struct PcdFile {
    pub path: PathBuf,
    pub origin: Origin,
    pub header: PcdHeader,
    /// What its packed bytes are; None for files that are not packed.
    pub packed: Option<Packed>,
    /// Cells without a point that were met so far, of each part: a part may be read again.
    pub empty: Vec<AtomicU64>,
    /// Numbers of a text that have more digits than the `float` that holds them.
    pub rounded: AtomicU64,
    /// Where packed values may be read from, once somebody has looked.
    pub marks: Mutex<Option<Arc<Vec<LzfMark>>>>,
    /// What is lost of it.
    pub losses: Losses,
    /// What its header says of the number of its points, and is not so.
    pub belied: Option<String>,
}

impl PcdFile {
    /// Reads the header, and holds it against the file's length.
    pub fn open(path: &Path, on_error: OnError) -> Result<PcdFile> {
        let (file, origin) = Origin::open(path)?;
        let length = origin.length();
        let header = PcdHeader::read(origin.reopen()?, path, length)?;
        let packed = match header.data {
            PcdData::Compressed => Some(Packed::read(&file, path, &header, length)?),
            _ => None,
        };
        let mut opened = PcdFile {
            path: path.to_owned(),
            origin,
            packed,
            header,
            empty: Vec::new(),
            rounded: AtomicU64::new(0),
            marks: Mutex::new(None),
            losses: Losses::new(on_error),
            belied: None,
        };
        let names = opened.names();
        let lacks = |axis: &&str| !names.iter().any(|name| name == axis);
        let missing: Vec<&str> = XYZ.into_iter().filter(lacks).collect();
        if !missing.is_empty() {
            let told = format!("its points have no field {}", missing.join(", ").to_lowercase());
            return Err(Error::data(path, told));
        }
        opened.count()?;
        opened.empty = (0..opened.parts()).map(|_| AtomicU64::new(0)).collect();
        Ok(opened)
    }

    /// How many parts it is read in.
    pub fn parts(&self) -> usize {
        let points = self.header.points;
        let parts = match (&self.packed, self.header.data) {
            (Some(packed), _) => packed.parts(&self.header),
            (_, PcdData::Ascii) => u64::from(points > 0),
            _ => points.div_ceil(PART_POINTS),
        };
        usize::try_from(parts).unwrap_or(usize::MAX)
    }

    /// Cells without a point that were met so far.
    pub fn empty(&self) -> u64 {
        self.empty.iter().map(|of_part| of_part.load(Ordering::Relaxed)).sum()
    }

    /// The row and the column of a cell of a grid, as records have them.
    pub fn place(&self, cell: u64) -> [u8; 8] {
        let width = self.header.width.max(1);
        let [row, column] = [(cell / width) as u32, (cell % width) as u32].map(u32::to_le_bytes);
        let mut bytes = [0; 8];
        bytes[..4].copy_from_slice(&row);
        bytes[4..].copy_from_slice(&column);
        bytes
    }

    /// True if its points are a grid.
    pub fn is_grid(&self) -> bool {
        self.header.height > 1
    }

    /// The dimensions of its numbers, padding included, in order.
    pub fn names(&self) -> Vec<String> {
        let mut taken = BTreeSet::new();
        let mut names = Vec::new();
        for field in &self.header.fields {
            for n in 0..field.count {
                let all = self.header.fields.iter().map(|field| field.name.as_str());
                let name = match heading_among(&field.name, all) {
                    _ if field.count > 1 => format!("{}_{n}", field.name),
                    Some(known) => known.to_owned(),
                    None => field.name.clone(),
                };
                let name = if taken.contains(&name) { field.name.clone() } else { name };
                let mut free = name.clone();
                let mut number = 2;
                while field.scalar.is_some() && !taken.insert(free.clone()) {
                    free = format!("{name}_{number}");
                    number += 1;
                }
                names.push(free);
            }
        }
        names
    }

    /// What a record holds, coordinates that a text calls `float` as `double` if they are to be
    /// `wide`; and where each number of a point goes, None for padding.
    pub fn schema(&self, wide: bool) -> (Schema, Vec<Option<(Scalar, usize)>>) {
        let wide = wide && self.header.data == PcdData::Ascii;
        let (mut dimensions, mut numbers, mut stride) = (Vec::new(), Vec::new(), 0);
        let mut names = self.names().into_iter();
        let has_colors = |names: &[Dimension]| names.iter().any(|d| d.name == RED);
        for field in &self.header.fields {
            for _ in 0..field.count {
                let name = names.next().unwrap_or_default();
                let Some(scalar) = field.scalar else {
                    numbers.push(None);
                    stride += field.size;
                    continue;
                };
                let widens = wide && scalar == Scalar::F32 && XYZ.contains(&name.as_str());
                let scalar = if widens { Scalar::F64 } else { scalar };
                numbers.push(Some((scalar, stride)));
                if is_packed(field) && !has_colors(&dimensions) {
                    let bytes = [BLUE, GREEN, RED, ALPHA].into_iter().enumerate();
                    let held = if field.name == PACKED[1] { 4 } else { 3 };
                    let of = |(n, name)| Dimension::new(name, Scalar::U8, stride + n);
                    dimensions.extend(bytes.take(held).map(of));
                } else {
                    dimensions.push(Dimension::new(name, scalar, stride));
                }
                stride += scalar.size();
            }
        }
        if self.is_grid() {
            for name in [ROW, COLUMN] {
                // A file that says it itself is believed.
                if !dimensions.iter().any(|d| d.name == name) {
                    dimensions.push(Dimension::new(name, Scalar::U32, stride));
                }
                stride += 4;
            }
        }
        let schema = Schema { layout: RECORDS, endian: Endian::Little, stride, dimensions };
        (schema, numbers)
    }

    /// What was found while it was read.
    pub fn warnings(&self) -> Vec<String> {
        let path = shown(&self.path);
        let empty = self.empty();
        let rounded = self.rounded.load(Ordering::Relaxed);
        let points = self.header.points;
        let of_cells = (empty > 0).then(|| {
            let (empty, points) = (Grouped(empty), Grouped(points));
            format!("{path}: {empty} of {points} cells have no point: a coordinate is NaN")
        });
        let of_digits = (rounded > 0).then(|| {
            let rounded = Grouped(rounded);
            format!(
                "{path}: {rounded} numbers of 4 bytes have more digits than these hold, and were \
                 rounded"
            )
        });
        of_cells.into_iter().chain(of_digits).collect()
    }

    /// The marks of its packed values, found by one walk.
    pub fn marks(&self) -> Result<Arc<Vec<LzfMark>>> {
        let mut known = self.marks.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(marks) = &*known {
            return Ok(marks.clone());
        }
        let Some(packed) = &self.packed else {
            return Err(Error::internal("a file that is not packed has no marks"));
        };
        let file = self.origin.reopen()?;
        let marks = Arc::new(packed.walk(file, &self.path, &self.header)?);
        *known = Some(marks.clone());
        Ok(marks)
    }
}

/// True for a number that holds colours.
fn is_packed(field: &PcdField) -> bool {
    let is_number = field.count == 1 && field.size == 4;
    PACKED.contains(&field.name.as_str()) && is_number
}
