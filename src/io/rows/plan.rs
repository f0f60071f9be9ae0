//! How records become rows, decided once and done on all threads.

use std::sync::atomic::{AtomicU8, Ordering};

use super::colors::{self, Depth, Recoloring, WrittenColors};
use super::print::{Printer, TextStyle};
use super::schema::{RowShape, place, row_schema};
use super::{Encoding, RowForm};
use crate::io::convert::{AskedValues, Projection, Rounding, TYPES};
use crate::point::{ComputedDimension, Dimension, PointBatch, Scalar, Schema, Spare, Value};
use crate::stage::{ChunkSize, Colors, Encode, Encoded, Retyped, WriteKeys};
use crate::{Error, ErrorKind, Result};

/// How the rows of an output are written.
#[derive(Debug, Clone)]
pub(crate) struct RowOptions {
    pub encoding: Encoding,
    /// Dimensions that stages computed and that are written, in place where the input has them as
    /// floating-point numbers, else behind the others.
    pub computed: Vec<ComputedDimension>,
    /// What was asked of values.
    pub asked: AskedValues,
    /// Types that were asked for.
    pub types: Vec<Retyped>,
    /// How many bits colours of other formats have; as for [`Colors::Auto`] when not said.
    pub colors: Option<Colors>,
    /// How texts are written.
    pub style: TextStyle,
}

impl RowOptions {
    pub fn of(keys: &WriteKeys, encoding: Encoding, computed: &[ComputedDimension]) -> Self {
        RowOptions {
            encoding,
            computed: computed.to_vec(),
            asked: AskedValues::of(keys),
            types: keys.types.clone(),
            colors: keys.colors,
            style: TextStyle::BLANKS,
        }
    }
}

/// Records of one encoded chunk.
pub(crate) const CHUNK_POINTS: usize = 65_536;

pub(super) const WIDE: u8 = 1;
pub(super) const FULL: u8 = 2;

/// How a record becomes a row; shared by all threads.
pub(crate) struct RowPlan {
    pub encoding: Encoding,
    pub form: RowForm,
    pub style: TextStyle,
    /// With colours as the records have them.
    pub full: RowKind,
    /// With colours of 8 bits, where the records are of another format and have colours of 16.
    pub narrow: Option<Narrow>,
    /// [`WIDE`] once the file has colours of 16 bits, so that no chunk needs to have 8, and
    /// [`FULL`] once they are known to need them, so that nobody needs to look.
    pub widened: AtomicU8,
    /// True if types were asked for.
    has_types: bool,
    /// For the rows of chunks; the thread that has written them puts them back.
    pub spare: Spare<Vec<u8>>,
}

/// One kind of rows.
pub(crate) struct RowKind {
    /// What a row holds; text is printed from its little-endian form.
    pub shape: RowShape,
    printers: Vec<Printer>,
    /// From the records to the rows, where they differ.
    projection: Option<Projection>,
    /// The fields of computed dimensions.
    computed: Vec<(ComputedDimension, Dimension)>,
}

/// Rows with colours of 8 bits.
pub(crate) struct Narrow {
    pub asked: Colors,
    /// Of the lower and of the upper byte of the records' colours; the rows are alike.
    pub rows: [RowKind; 2],
    /// Byte offsets of the colours in a record.
    fields: Vec<usize>,
}

impl Narrow {
    fn of(options: &RowOptions, form: &RowForm, schema: &Schema) -> Result<Option<Narrow>> {
        let fields = colors::fields(schema, form, &options.asked.drop);
        let mut types = options.types.iter();
        let typed = types.find(|retyped| colors::is_color_name(&retyped.name));
        if let (Some(typed), Some(_)) = (typed, options.colors) {
            let told = format!(
                "`write.types` has `{typed}`, and `write.colors` says the bits of colours, too"
            );
            return Err(Error::pipeline(told).help("give one of the two"));
        }
        if fields.is_empty() || typed.is_some() || options.colors == Some(Colors::Sixteen) {
            return Ok(None);
        }
        let rows = |place| RowKind::new(options, form, &colors::bytes_of(schema, place));
        let asked = options.colors.unwrap_or_default();
        Ok(Some(Narrow { asked, rows: [rows(0)?, rows(1)?], fields }))
    }

    /// The rows with 8 bits that lose nothing, or that were asked for.
    fn rows(&self, depth: Depth) -> Option<&RowKind> {
        let [lower, upper] = &self.rows;
        match (self.asked, depth) {
            (Colors::Auto, Depth::Full | Depth::Mixed) => None,
            (Colors::Auto, Depth::Unscaled) => Some(lower),
            _ => Some(upper),
        }
    }

    /// The rows with colours of 8 bits, of whichever bytes.
    fn any(&self) -> &RowKind {
        &self.rows[0]
    }
}

impl RowKind {
    fn new(options: &RowOptions, form: &RowForm, schema: &Schema) -> Result<RowKind> {
        let mut row = row_schema(schema, form);
        row.endian = options.encoding.endian();
        row.dimensions.retain(|d| !options.asked.drop.contains(&d.name));
        options.types.iter().try_for_each(|retyped| retype(&mut row, form, retyped))?;
        place(&mut row, form);
        // Made before computed dimensions are added: the records need not have them.
        let mut projection = Projection::asked(schema, &row, &options.asked)?;
        let added = options.computed.iter().map(|d| Ok((*d, add_computed(&mut row, form, d)?)));
        let computed: Vec<_> = added.collect::<Result<_>>()?;
        projection.widen(row.stride);
        let projection = (!projection.is_copy()).then_some(projection);
        let shape = RowShape::of(row, form);
        let printers = shape.columns.iter().map(|column| options.style.printer(column)).collect();
        Ok(RowKind { shape, printers, projection, computed })
    }

    fn put_computed(&self, batch: &PointBatch, rows: &mut [u8]) -> Result<()> {
        for (dimension, target) in &self.computed {
            let numbers = batch.columns.numbers(dimension, batch.len())?;
            for (row, number) in rows.chunks_exact_mut(self.shape.row.stride).zip(numbers) {
                let value = match number {
                    Value::Double(v) if target.scalar == Scalar::F32 => Value::Single(v as f32),
                    value => value,
                };
                if !target.put(row, self.shape.row.endian, value) {
                    let name = dimension.name;
                    return Err(Error::pipeline(format!("the output's {name} cannot hold it")));
                }
            }
        }
        Ok(())
    }

    /// Bytes of the longest text of a row.
    fn text_bytes(&self) -> usize {
        self.printers.iter().map(Printer::longest).sum()
    }

    /// The text of these rows, and of how many points coordinates were rounded, and by how much.
    fn print(&self, rows: &[u8], separator: u8) -> (Vec<u8>, Rounding) {
        let points = rows.len() / self.shape.row.stride;
        let mut text = Vec::with_capacity(points * self.text_bytes());
        let mut rounding = Rounding::default();
        for row in rows.chunks_exact(self.shape.row.stride) {
            let mut rounded = 0f64;
            for printer in &self.printers {
                rounded = rounded.max(printer.print(row, &mut text));
                text.push(separator);
            }
            text.pop();
            text.push(b'\n');
            rounding.points += u64::from(rounded > 0.0);
            rounding.largest = rounding.largest.max(rounded);
        }
        (text, rounding)
    }
}

impl RowPlan {
    pub fn new(options: &RowOptions, form: RowForm, schema: &Schema) -> Result<RowPlan> {
        if options.colors.is_some() && schema.layout == form.layout {
            let family = form.layout.family;
            let told = format!(
                "`write.colors` is for inputs of other formats: from {family} to {family} colours \
                 stay as they are"
            );
            return Err(Error::pipeline(told).help("leave it out"));
        }
        Ok(RowPlan {
            encoding: options.encoding,
            form,
            style: options.style,
            full: RowKind::new(options, &form, schema)?,
            narrow: Narrow::of(options, &form, schema)?,
            widened: AtomicU8::new(0),
            has_types: !options.types.is_empty(),
            spare: Spare::default(),
        })
    }

    /// What was asked for and rounds values, in words.
    pub fn rounded_to(&self) -> Option<&'static str> {
        match (self.has_types, self.style.decimals) {
            (true, None) => Some(TYPES),
            (true, Some(_)) => {
                Some("their types in the output, or the decimals that were asked for")
            }
            (false, decimals) => decimals.map(|_| "as many decimals as were asked for"),
        }
    }

    pub fn chunk(&self) -> ChunkSize {
        let bytes = (CHUNK_POINTS as u64).saturating_mul(self.bytes_per_point() as u64);
        ChunkSize { points: CHUNK_POINTS, bytes }
    }

    /// Bytes that encoding one record holds at most, those that an appended chunk is widened to
    /// included.
    fn bytes_per_point(&self) -> usize {
        let text = if self.encoding == Encoding::Ascii { self.full.text_bytes() } else { 0 };
        let widened = match (&self.narrow, self.encoding) {
            (None, _) => 0,
            (_, Encoding::Ascii) => text,
            _ => self.full.shape.row.stride,
        };
        self.full.shape.row.stride + text + widened
    }

    /// Bytes that one row takes in the file at least, and in a second one that may be written while
    /// the first is there.
    pub fn disk_bytes(&self) -> [u64; 2] {
        // A number in text has a digit and what ends it.
        let bytes = |rows: &RowKind| match self.encoding {
            Encoding::Ascii => 2 * rows.shape.columns.len() as u64,
            _ => rows.shape.row.stride as u64,
        };
        let full = bytes(&self.full);
        match &self.narrow {
            None => [full, 0],
            Some(narrow) if narrow.asked == Colors::Eight => [bytes(narrow.any()), 0],
            Some(narrow) => [bytes(narrow.any()), full],
        }
    }

    /// The most bytes that one row takes in the file.
    pub fn row_bytes(&self) -> usize {
        match self.encoding {
            Encoding::Ascii => self.full.text_bytes(),
            _ => self.full.shape.row.stride,
        }
    }

    /// The rows of a file whose colours have 16 bits if they are `wide`.
    pub fn shape(&self, wide: bool) -> &RowShape {
        let narrow = self.narrow.as_ref().filter(|_| !wide).map(Narrow::any);
        &narrow.unwrap_or(&self.full).shape
    }

    /// From rows with colours of 8 bits, of this depth, to those with 16.
    pub fn widening(&self, depth: Depth) -> Option<Recoloring<'_>> {
        self.narrow.as_ref()?;
        Some(self.recoloring(self.shape(false), self.shape(true), depth))
    }

    /// From rows with colours of 16 bits to those with the upper 8.
    pub fn narrowing(&self) -> Option<Recoloring<'_>> {
        self.narrow.as_ref()?;
        Some(self.recoloring(self.shape(true), self.shape(false), Depth::Mixed))
    }

    fn recoloring<'a>(&self, from: &'a RowShape, to: &'a RowShape, depth: Depth) -> Recoloring<'a> {
        let (encoding, separator) = (self.encoding, self.style.separator);
        Recoloring { encoding, separator, from, to, depth }
    }

    /// The rows as which a chunk is written, and what its colours are; full where nobody asked.
    fn rows(&self, batch: &PointBatch) -> (&RowKind, WrittenColors) {
        let full = |depth| (&self.full, WrittenColors { depth, wide: true });
        let Some(narrow) = &self.narrow else { return full(Depth::Full) };
        let widened = self.widened.load(Ordering::Relaxed);
        if widened == FULL {
            return full(Depth::Full);
        }
        let depth = Depth::of(batch.records(), batch.schema().stride, &narrow.fields);
        match narrow.rows(depth).filter(|_| widened != WIDE) {
            Some(rows) => (rows, WrittenColors { depth, wide: false }),
            None => full(depth),
        }
    }
}

/// Gives a field of a row another type.
fn retype(row: &mut Schema, form: &RowForm, retyped: &Retyped) -> Result<()> {
    if matches!(retyped.scalar, Scalar::U64 | Scalar::I64) && !form.holds_long {
        let family = form.layout.family;
        let told =
            format!("`write.types` has `{retyped}`, and {family} has no whole numbers of 64 bits");
        return Err(Error::pipeline(told).help("give `u32`, `i32` or `f64`"));
    }
    for field in row.dimensions.iter_mut().filter(|field| field.name == retyped.name) {
        *field = Dimension::new(&retyped.name, retyped.scalar, 0);
    }
    Ok(())
}

/// The field of a computed dimension, added if it is not there; fails on one that holds whole
/// numbers and on numbers that the format does not have.
fn add_computed(
    row: &mut Schema,
    form: &RowForm,
    computed: &ComputedDimension,
) -> Result<Dimension> {
    let (name, scalar) = (computed.name, computed.scalar());
    if let Some(found) = row.find(name) {
        if found.scalar.is_float() || found.scalar == scalar {
            return Ok(found.clone());
        }
        let told = format!("the input's {name} holds whole numbers: what is computed does not fit");
        return Err(
            Error::pipeline(told).help(format!("`write.drop = [\"{name}\"]` leaves it out"))
        );
    }
    if matches!(scalar, Scalar::U64 | Scalar::I64) && !form.holds_long {
        let family = form.layout.family;
        let told = format!("{name} has whole numbers of 64 bits, which {family} does not hold");
        return Err(Error::pipeline(told).help("write LAS, or leave it out"));
    }
    let added = Dimension::new(name, scalar, row.stride);
    row.stride += scalar.size();
    row.dimensions.push(added.clone());
    Ok(added)
}

/// Refuses a point of which a coordinate is no number, where readers would take it for none.
fn refuse_nan(batch: &PointBatch, family: &str) -> Result<()> {
    let Some(axes) = batch.schema().coordinates() else { return Ok(()) };
    if axes.iter().all(|axis| !axis.scalar.is_float()) {
        return Ok(());
    }
    for record in batch.iter() {
        let [x, y, z] = axes.map(|axis| axis.world(record, batch.schema().endian));
        if x.is_nan() || y.is_nan() || z.is_nan() {
            let told =
                format!("the point at ({x}, {y}, {z}) is none in {family}, where NaN means so");
            return Err(Error::new(ErrorKind::Data, told)
                .help("`run.nonfinite = \"drop\"` leaves such points out"));
        }
    }
    Ok(())
}

impl Encode for RowPlan {
    fn encode(&self, batch: &PointBatch) -> Result<Encoded> {
        let mut rounding = Rounding::default();
        if !self.form.holds_nan {
            refuse_nan(batch, self.form.layout.family)?;
        }
        let mut bytes = self.spare.take(Vec::new);
        let (rows, written) = self.rows(batch);
        if let Some(projection) = &rows.projection {
            bytes.resize(batch.len() * rows.shape.row.stride, 0);
            rounding = projection.project_into(batch.records(), &mut bytes)?;
        } else {
            bytes.clear();
            bytes.extend_from_slice(batch.records());
        }
        rows.put_computed(batch, &mut bytes)?;
        if self.encoding == Encoding::Ascii {
            let (text, printed) = rows.print(&bytes, self.style.separator);
            self.spare.put(std::mem::replace(&mut bytes, text));
            if printed.points > 0 {
                rounding = printed;
            }
        }
        let rounded = (rounding.points > 0).then_some((rounding.points, rounding.largest));
        let points = batch.len() as u64;
        Ok(Encoded { bytes, points, rounded, form: written.code(), ..Encoded::default() })
    }
}
