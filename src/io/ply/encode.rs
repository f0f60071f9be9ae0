//! How records become vertices, decided once and done on all threads.

use std::sync::atomic::{AtomicU8, Ordering};

use super::colors::{self, Depth, Recoloring, WrittenColors};
use super::header::Encoding;
use super::names::RECORDS;
use super::source::PlyNative;
use super::text;
use super::vertex::ply_schema;
use crate::io::convert::Projection;
use crate::point::{ComputedDimension, Dimension, PointBatch, Scalar, Schema, Spare, Value};
use crate::stage::{ChunkSize, Colors, Encode, Encoded};
use crate::{Error, Result};

/// How a PLY output is written.
#[derive(Debug, Clone, Default)]
pub struct PlyOptions {
    /// Text or binary; that of the input where it is PLY, else little-endian, when not said.
    pub encoding: Option<Encoding>,
    /// Writes these dimensions that stages computed, normals as `nx`, `ny` and `nz`: in place where
    /// the input has them as floating-point numbers, else behind the other properties.
    pub computed: Vec<ComputedDimension>,
    /// Dimensions that are left out.
    pub drop: Vec<String>,
    /// How many bits the colours of LAS records have; as for [`Colors::Auto`] when not said. From
    /// PLY to PLY they stay as they are, and saying it is an error.
    pub colors: Option<Colors>,
    /// Carries the other elements (faces) of a single binary input whose encoding is kept. To be
    /// set only where no vertex is removed, added or moved: it fails on a count that differs.
    pub carry_rest: bool,
    /// Has triangles behind the vertices.
    pub triangles: bool,
}

/// Records of one encoded chunk.
pub(super) const CHUNK_POINTS: usize = 65_536;

pub(super) const WIDE: u8 = 1;
pub(super) const FULL: u8 = 2;

/// How a record becomes a vertex; shared by all threads.
pub(super) struct VertexPlan {
    pub encoding: Encoding,
    /// With colours as the records have them.
    pub full: Form,
    /// With colours of 8 bits, where the records are LAS and have colours.
    pub narrow: Option<Narrow>,
    /// [`WIDE`] once the file has colours of 16 bits, so that no chunk needs to have 8, and
    /// [`FULL`] once they are known to need them, so that nobody needs to look.
    pub widened: AtomicU8,
    /// For the vertices of chunks; the thread that has written them puts them back.
    pub spare: Spare<Vec<u8>>,
}

/// One form of vertices.
pub(super) struct Form {
    /// What a vertex holds; text is printed from its little-endian form.
    pub vertex: Schema,
    /// From the records to the vertices, where they differ.
    projection: Option<Projection>,
    /// The fields of computed dimensions.
    computed: Vec<(ComputedDimension, Dimension)>,
}

/// Vertices with colours of 8 bits.
pub(super) struct Narrow {
    pub asked: Colors,
    /// Of the lower and of the upper byte of the records' colours; the vertices are alike.
    pub forms: [Form; 2],
    /// Byte offsets of the colours in a record.
    fields: Vec<usize>,
}

impl Narrow {
    fn of(options: &PlyOptions, schema: &Schema, encoding: Encoding) -> Result<Option<Narrow>> {
        let fields = colors::fields(schema, &options.drop);
        if fields.is_empty() || options.colors == Some(Colors::Sixteen) {
            return Ok(None);
        }
        let form = |place| Form::new(options, &colors::bytes_of(schema, place), encoding);
        let asked = options.colors.unwrap_or_default();
        Ok(Some(Narrow { asked, forms: [form(0)?, form(1)?], fields }))
    }

    /// The form of 8-bit vertices that loses nothing, or that was asked for.
    fn form(&self, depth: Depth) -> Option<&Form> {
        let [lower, upper] = &self.forms;
        match (self.asked, depth) {
            (Colors::Auto, Depth::Full | Depth::Mixed) => None,
            (Colors::Auto, Depth::Unscaled) => Some(lower),
            _ => Some(upper),
        }
    }

    /// The vertex with colours of 8 bits.
    pub fn vertex(&self) -> &Schema {
        &self.forms[0].vertex
    }
}

impl Form {
    fn new(options: &PlyOptions, schema: &Schema, encoding: Encoding) -> Result<Form> {
        let mut vertex = ply_schema(schema);
        vertex.endian = encoding.endian();
        vertex.dimensions.retain(|d| !options.drop.contains(&d.name));
        vertex.stride = 0;
        for dimension in &mut vertex.dimensions {
            dimension.offset = vertex.stride;
            vertex.stride += dimension.scalar.size();
        }
        // Made before computed dimensions are added: the records need not have them.
        let mut projection = Projection::new(schema, &vertex, &options.drop)?;
        let added = options.computed.iter().map(|d| Ok((*d, add_computed(&mut vertex, d)?)));
        let computed: Vec<_> = added.collect::<Result<_>>()?;
        projection.widen(vertex.stride);
        let projection = (!projection.is_copy()).then_some(projection);
        Ok(Form { vertex, projection, computed })
    }

    fn put_computed(&self, batch: &PointBatch, vertices: &mut [u8]) -> Result<()> {
        for (dimension, target) in &self.computed {
            let numbers = batch.columns.numbers(dimension, batch.len())?;
            for (vertex, number) in vertices.chunks_exact_mut(self.vertex.stride).zip(numbers) {
                let value = match number {
                    Value::Double(v) if target.scalar == Scalar::F32 => Value::Single(v as f32),
                    value => value,
                };
                if !target.put(vertex, self.vertex.endian, value) {
                    let name = dimension.name;
                    return Err(Error::pipeline(format!("the output's {name} cannot hold it")));
                }
            }
        }
        Ok(())
    }

    /// Bytes of the longest text of a vertex.
    fn text_bytes(&self) -> usize {
        self.vertex.dimensions.iter().map(|d| text::longest(d.scalar)).sum()
    }

    fn print(&self, vertices: &[u8]) -> Vec<u8> {
        let points = vertices.len() / self.vertex.stride;
        let mut text = Vec::with_capacity(points * self.text_bytes());
        for vertex in vertices.chunks_exact(self.vertex.stride) {
            for dimension in &self.vertex.dimensions {
                text::print(dimension.get(vertex, self.vertex.endian), &mut text);
                text.push(b' ');
            }
            text.pop();
            text.push(b'\n');
        }
        text
    }
}

impl VertexPlan {
    pub fn new(
        options: &PlyOptions,
        schema: &Schema,
        native: Option<&PlyNative>,
    ) -> Result<VertexPlan> {
        let encoding = options.encoding.or(native.map(|n| n.encoding)).unwrap_or({
            match (schema.layout, schema.endian) {
                (RECORDS, crate::point::Endian::Big) => Encoding::BinaryBigEndian,
                _ => Encoding::BinaryLittleEndian,
            }
        });
        if options.colors.is_some() && schema.layout == RECORDS {
            let told = "`write.colors` is for LAS inputs: from PLY to PLY colours stay as they are";
            return Err(Error::pipeline(told).help("leave it out"));
        }
        Ok(VertexPlan {
            encoding,
            full: Form::new(options, schema, encoding)?,
            narrow: Narrow::of(options, schema, encoding)?,
            widened: AtomicU8::new(0),
            spare: Spare::default(),
        })
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
            _ => self.full.vertex.stride,
        };
        self.full.vertex.stride + text + widened
    }

    /// Bytes that one vertex takes in the file at least, and in a second one that
    /// [`rewrite`](super::sink::PlySink) may write while the first is there.
    pub fn disk_bytes(&self) -> [u64; 2] {
        // A number in text has a digit and what ends it.
        let bytes = |vertex: &Schema| match self.encoding {
            Encoding::Ascii => 2 * vertex.dimensions.len() as u64,
            _ => vertex.stride as u64,
        };
        let full = bytes(&self.full.vertex);
        match &self.narrow {
            None => [full, 0],
            Some(narrow) if narrow.asked == Colors::Eight => [bytes(narrow.vertex()), 0],
            Some(narrow) => [bytes(narrow.vertex()), full],
        }
    }

    /// The most bytes that one vertex takes in the file.
    pub fn vertex_bytes(&self) -> usize {
        match self.encoding {
            Encoding::Ascii => self.full.text_bytes(),
            _ => self.full.vertex.stride,
        }
    }

    /// From vertices with colours of 8 bits, of this depth, to those with 16.
    pub fn widening(&self, depth: Depth) -> Option<Recoloring<'_>> {
        let from = self.narrow.as_ref()?.vertex();
        Some(Recoloring { encoding: self.encoding, from, to: &self.full.vertex, depth })
    }

    /// From vertices with colours of 16 bits to those with the upper 8.
    pub fn narrowing(&self) -> Option<Recoloring<'_>> {
        let to = self.narrow.as_ref()?.vertex();
        let (encoding, from, depth) = (self.encoding, &self.full.vertex, Depth::Mixed);
        Some(Recoloring { encoding, from, to, depth })
    }

    /// The form in which a chunk is written, and what its colours are; full where nobody asked.
    fn form(&self, batch: &PointBatch) -> (&Form, WrittenColors) {
        let full = |depth| (&self.full, WrittenColors { depth, wide: true });
        let Some(narrow) = &self.narrow else { return full(Depth::Full) };
        let widened = self.widened.load(Ordering::Relaxed);
        if widened == FULL {
            return full(Depth::Full);
        }
        let depth = Depth::of(batch.records(), batch.schema().stride, &narrow.fields);
        match narrow.form(depth).filter(|_| widened != WIDE) {
            Some(form) => (form, WrittenColors { depth, wide: false }),
            None => full(depth),
        }
    }
}

/// The field of a computed dimension, added if it is not there; fails on one that holds whole
/// numbers and on numbers that PLY does not have.
fn add_computed(vertex: &mut Schema, computed: &ComputedDimension) -> Result<Dimension> {
    let (name, scalar) = (computed.name, computed.scalar());
    if let Some(found) = vertex.find(name) {
        if found.scalar.is_float() || found.scalar == scalar {
            return Ok(found.clone());
        }
        let told = format!("the input's {name} holds whole numbers: what is computed does not fit");
        return Err(
            Error::pipeline(told).help(format!("`write.drop = [\"{name}\"]` leaves it out"))
        );
    }
    if matches!(scalar, Scalar::U64 | Scalar::I64) {
        let told = format!("{name} has whole numbers of 64 bits, which PLY does not hold");
        return Err(Error::pipeline(told).help("write LAS, or leave it out"));
    }
    let added = Dimension::new(name, scalar, vertex.stride);
    vertex.stride += scalar.size();
    vertex.dimensions.push(added.clone());
    Ok(added)
}

impl Encode for VertexPlan {
    fn encode(&self, batch: &PointBatch) -> Result<Encoded> {
        let mut rounded = None;
        let mut vertices = self.spare.take(Vec::new);
        let (form, written) = self.form(batch);
        if let Some(projection) = &form.projection {
            vertices.resize(batch.len() * form.vertex.stride, 0);
            let rounding = projection.project_into(batch.records(), &mut vertices)?;
            rounded = (rounding.points > 0).then_some((rounding.points, rounding.largest));
        } else {
            vertices.clear();
            vertices.extend_from_slice(batch.records());
        }
        form.put_computed(batch, &mut vertices)?;
        let bytes = match self.encoding {
            Encoding::Ascii => {
                let text = form.print(&vertices);
                self.spare.put(vertices);
                text
            }
            _ => vertices,
        };
        let points = batch.len() as u64;
        Ok(Encoded { bytes, points, rounded, form: written.code(), ..Encoded::default() })
    }
}
