//! The row that holds what a record of another format holds.

use super::RowForm;
use super::names::rank;
use crate::point::names::{BLUE, GREEN, RED, XYZ};
use crate::point::{Dimension, Endian, Scalar, Schema};

/// The row that holds every dimension of `from`, little-endian: coordinates of whole numbers as
/// `f64`, exactly stored · scale + origin; bit fields each as a byte; other scaled dimensions (the
/// scan angle of point formats 6 to 10, in degrees) as `f64`; 64-bit integers as `f64` too where
/// the format has none, and a value that rounds is refused; all others in their own type. Known
/// dimensions come first, in the order of their names. That of a record of the format itself is its
/// own.
pub(crate) fn row_schema(from: &Schema, form: &RowForm) -> Schema {
    if from.layout == form.layout {
        return from.clone();
    }
    let mut sources: Vec<&Dimension> = from.dimensions.iter().collect();
    sources.sort_by_key(|d| rank(&d.name).unwrap_or(usize::MAX));
    let dimensions = sources.into_iter().map(|source| {
        let is_scaled = source.scale != 1.0 || source.origin != 0.0;
        let is_axis = XYZ.contains(&source.name.as_str());
        if form.keeps_steps && is_scaled && !source.scalar.is_float() && source.bits.is_none() {
            let stored = Dimension::new(&source.name, source.scalar, 0);
            return stored.scaled(source.scale, source.origin);
        }
        let scalar = match source.scalar {
            _ if is_scaled || is_axis && !source.scalar.is_float() => Scalar::F64,
            Scalar::U64 | Scalar::I64 if !form.holds_long => Scalar::F64,
            _ if source.bits.is_some_and(|bits| bits.width <= 8) => Scalar::U8,
            own => own,
        };
        Dimension::new(&source.name, scalar, 0)
    });
    let dimensions = dimensions.collect();
    let mut row = Schema { layout: form.layout, endian: Endian::Little, stride: 0, dimensions };
    place(&mut row, form);
    row
}

/// Fields one behind the other.
pub(crate) fn placed(
    fields: impl IntoIterator<Item = (String, Scalar)>,
) -> (Vec<Dimension>, usize) {
    let mut stride = 0;
    let mut all = Vec::new();
    for (name, scalar) in fields {
        all.push(Dimension::new(name, scalar, stride));
        stride += scalar.size();
    }
    (all, stride)
}

/// Gives each field of a row its place: one behind the other, but for colours that share a number.
pub(crate) fn place(row: &mut Schema, form: &RowForm) {
    let is_packed = form.packs_colors && packs(&row.dimensions);
    let mut packed = None;
    row.stride = 0;
    for dimension in &mut row.dimensions {
        let byte = SHARING.iter().position(|name| dimension.name == *name);
        let Some(byte) = byte.filter(|_| is_packed) else {
            dimension.offset = row.stride;
            row.stride += dimension.scalar.size();
            continue;
        };
        let start = *packed.get_or_insert(row.stride);
        dimension.offset = start + byte;
        row.stride = row.stride.max(start + 4);
    }
}

/// What the bytes of the number are, from the lowest on.
const SHARING: [&str; 4] = [BLUE, GREEN, RED, ALPHA];

/// True for three colours of 8 bits.
fn packs(dimensions: &[Dimension]) -> bool {
    let is_byte = |color| {
        let found = dimensions.iter().find(|d: &&Dimension| d.name == color);
        found.is_some_and(|d| d.scalar == Scalar::U8 && d.bits.is_none())
    };
    [RED, GREEN, BLUE].into_iter().all(is_byte)
}

/// The names of the number that colours of 8 bits share, without and with an opacity.
pub(crate) const PACKED: [&str; 2] = ["rgb", "rgba"];

/// The opacity that may stand beside colours.
pub(crate) const ALPHA: &str = "Alpha";

/// A row and what is written of it.
#[derive(Debug, Clone)]
pub(crate) struct RowShape {
    /// The fields.
    pub row: Schema,
    /// What is written, in order: the fields, colours that share a number being one.
    pub columns: Vec<Dimension>,
}

impl RowShape {
    pub fn of(row: Schema, form: &RowForm) -> RowShape {
        if !form.packs_colors || !packs(&row.dimensions) {
            return RowShape { columns: row.dimensions.clone(), row };
        }
        let byte = |name: &str| row.find(name).filter(|field| field.scalar == Scalar::U8);
        let name = PACKED[usize::from(byte(ALPHA).is_some())];
        let number = byte(BLUE).map(|blue| Dimension::new(name, Scalar::U32, blue.offset));
        let mut columns: Vec<Dimension> = Vec::new();
        for dimension in &row.dimensions {
            let shares = dimension.scalar == Scalar::U8 && SHARING.contains(&&*dimension.name);
            match &number {
                Some(number) if shares && !columns.contains(number) => columns.push(number.clone()),
                Some(_) if shares => {}
                _ => columns.push(dimension.clone()),
            }
        }
        RowShape { row, columns }
    }
}
