//! Writing LAS and LAZ: the input's header and records around records that are copied byte for
//! byte. What depends on the points is recomputed, all else is carried.

use std::fs::File;
use std::io::Write;
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use las::raw::header::Evlr;
use laz::laszip::{ChunkTable, ChunkTableEntry};
use laz::{LazVlr, LazVlrBuilder};

use super::credit::{count_gps_time, credit, drop_ranges, name_system};
use super::described::{Described, describe};
use super::encode::{ComputedFields, LasEncoder};
use super::extra::{DESCRIPTOR_BYTES, LONGEST_NAME, with_computed};
use super::fields::encoding;
use super::format::{format_of, record_size};
use super::header::{COMPRESSED, Header};
use super::laz::{CHUNK_POINTS, Compression};
use super::native::Native;
use super::noted;
use super::noted::WrittenNote;
use super::vlr::Vlr;
use crate::point::{ComputedDimension, Metadata, RunNote, Schema};
use crate::stage::{ChunkSize, Encode, Encoded, Sink, SinkSummary};
use crate::{Error, Result};

/// Bytes of header and records that are gathered before they are written.
const HEAD_BYTES: usize = 64 << 10;

/// What a LAS output is to be.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct LasOptions {
    /// LAZ rather than LAS.
    pub compressed: bool,
    /// Write these dimensions that stages computed: into those of the input that have their names,
    /// which overwrites them, else as extra bytes behind the record. A position that nothing was
    /// computed for gets NaN (0 in integer dimensions).
    pub computed: Vec<ComputedDimension>,
}

/// Opens a LAS or LAZ output at `staged` for records of `schema`, which is in a LAS layout.
///
/// Header and records come from `metadata` where it is that of LAS inputs, else they are made anew
/// (see [`fresh`](super::fresh)). Recomputed are the counts of points, the box, the places of
/// points, extended records and waveforms (where these are in the file), the LAZ bit and its
/// record, the bit that says that the CRS is WKT, the generating software, with `computed` the
/// record length and the descriptors of extra bytes; with `metadata.note` records say how the file
/// was made; and if the records went through stages
/// (`metadata.pipeline`), the system identifier, the ranges of extra bytes, and a record that names
/// the stages.
///
/// # Errors
///
/// A schema of another layout, records or variable length records too long for their fields, and
/// what the operating system refuses.
pub fn create(
    staged: &Path,
    options: &LasOptions,
    schema: &Arc<Schema>,
    metadata: &Metadata,
) -> Result<Box<dyn Sink>> {
    let (encoder, laszip) = encoder(options, schema)?;
    let form = LasForm { encoder: Arc::new(encoder), laszip, copc: None };
    Ok(Box::new(LasSink::open(staged, schema, metadata, form)?))
}

/// How the points of an output are stored.
pub struct LasForm {
    /// What encodes records.
    pub encoder: Arc<LasEncoder>,
    /// The laszip record, if they are compressed.
    pub laszip: Option<Vlr>,
    /// The record that makes it COPC: the first of all.
    pub copc: Option<Vlr>,
}

/// Header and records of an output of records of `schema`, but for the laszip record; and what is
/// to be told of them.
fn head(schema: &Schema, metadata: &Metadata, form: &LasForm) -> Result<(Native, Vec<String>)> {
    let (format, encoder) = (point_format(schema)?, &form.encoder);
    let carried = metadata.native.as_ref().and_then(|n| n.downcast_ref::<Native>());
    let mut notes = Vec::new();
    let mut native = match carried.filter(|native| native.fits(schema)) {
        Some(native) => native.clone(),
        None => Native::fresh(schema, metadata.crs.as_deref()),
    };
    name_system(&mut native, metadata, &mut notes)?;
    count_gps_time(&mut native.header, metadata, &mut notes);
    credit(&mut native, schema, metadata, &mut notes);
    if metadata.pipeline.is_some() {
        drop_ranges(&mut native, schema)?;
    }
    if let Some(axes) = schema.coordinates() {
        native.header.put_scale(axes.map(|d| d.scale));
        native.header.put_offset(axes.map(|d| d.origin));
    }
    if !encoder.computed.appended.is_empty() {
        describe_computed(&mut native, format, schema, &encoder.computed.appended)?;
    }
    let stride = record_length(schema, &encoder.computed)?;
    native.header.point_data_record_length = stride;
    let compressed = if form.laszip.is_some() { COMPRESSED } else { 0 };
    native.header.point_data_record_format = format | compressed;
    if let Some(copc) = &form.copc {
        native.header = native.header.resized(4, &[]);
        native.vlrs.insert(0, copc.clone());
    }
    Ok((native, notes))
}

/// The chunks of the sink that [`create`] would open.
pub fn chunk(options: &LasOptions, schema: &Schema) -> Result<ChunkSize> {
    let encoder = encoder(options, schema)?.0;
    Ok(ChunkSize { points: CHUNK_POINTS as usize, bytes: encoder.chunk_bytes() })
}

/// The encoder of records of `schema`, and the laszip record that tells how it compresses.
fn encoder(options: &LasOptions, schema: &Schema) -> Result<(LasEncoder, Option<Vlr>)> {
    let format = point_format(schema)?;
    let computed = ComputedFields::of(schema, &options.computed);
    let (mut compression, mut laszip) = (None, None);
    if options.compressed {
        let (how, record) = Compression::write(format, record_length(schema, &computed)?)?;
        (compression, laszip) = (Some(how), Some(record));
    }
    Ok((LasEncoder::new(format, schema, computed, compression), laszip))
}

fn point_format(schema: &Schema) -> Result<u8> {
    format_of(schema)
        .ok_or_else(|| Error::internal("records are to be converted to a LAS layout first"))
}

/// Bytes of a record as written.
pub fn record_length(schema: &Schema, computed: &ComputedFields) -> Result<u16> {
    u16::try_from(schema.stride + computed.appended_bytes())
        .map_err(|_| too_long("a record of point format ", format_of(schema).unwrap_or_default()))
}

fn too_long(what: &str, format: u8) -> Error {
    Error::pipeline(format!("{what}{format} would exceed 65,535 bytes, the most that LAS can say"))
        .help("drop some extra dimensions")
}

/// Adds the descriptors of computed dimensions behind those of all extra bytes before them.
fn describe_computed(
    native: &mut Native,
    format: u8,
    schema: &Schema,
    computed: &[ComputedDimension],
) -> Result<()> {
    if let Some(long) = computed.iter().find(|dimension| dimension.name.len() > LONGEST_NAME) {
        let told = format!(
            "`{}` is longer than the {LONGEST_NAME} bytes that LAS has for the name of a dimension",
            long.name
        );
        return Err(Error::pipeline(told).help("write PLY, or compute it by a shorter name"));
    }
    let extra = schema.stride - usize::from(record_size(format).unwrap_or(0));
    let known = Described::of(&native.vlrs, &native.evlrs, extra)?.descriptors;
    let all = with_computed(&known, extra, computed);
    if u16::try_from(all.len().saturating_mul(DESCRIPTOR_BYTES)).is_err() {
        return Err(too_long("the extra bytes' descriptors of point format ", format));
    }
    describe(&mut native.vlrs, &mut native.evlrs, &all);
    Ok(())
}

/// A LAS or LAZ file being written.
pub struct LasSink {
    path: PathBuf,
    file: File,
    /// Bytes written.
    at: u64,
    native: Native,
    encoder: Arc<LasEncoder>,
    /// The chunks, if the points are compressed.
    table: Option<ChunkTable>,
    /// True if chunks have as many points as they like.
    varies: bool,
    last_was_short: bool,
    points: u64,
    returns: [u64; 15],
    lo: [i64; 3],
    hi: [i64; 3],
    /// How it was made, and the byte of the first record that says it.
    note: Option<(u64, Arc<RunNote>)>,
    notes: Vec<String>,
}

impl LasSink {
    /// Opens it at `path` for records of `schema`: writes all that stands before the points.
    pub fn open(path: &Path, schema: &Schema, metadata: &Metadata, form: LasForm) -> Result<Self> {
        let (mut native, notes) = head(schema, metadata, &form)?;
        let note = metadata.note.clone().map(|note| {
            let before: usize = native.vlrs.iter().map(Vlr::len).sum();
            native.vlrs.extend(noted::records(note.draft()));
            (u64::from(native.header.header_size) + before as u64, note)
        });
        let LasForm { encoder, laszip, copc } = form;
        let (is_packed, varies) = (laszip.is_some(), copc.is_some());
        native.vlrs.extend(laszip);
        let records: usize = native.vlrs.iter().map(Vlr::len).sum();
        let start = usize::from(native.header.header_size) + records + native.gap.len();
        let (Ok(start), Ok(vlrs)) = (u32::try_from(start), u32::try_from(native.vlrs.len())) else {
            return Err(Error::pipeline("the variable length records exceed 4 GiB"));
        };
        native.header.offset_to_point_data = start;
        native.header.number_of_variable_length_records = vlrs;
        let file = File::create(path).map_err(|e| Error::io(path, "create it", e))?;
        let mut sink = LasSink {
            path: path.to_owned(),
            file,
            at: 0,
            native,
            encoder,
            table: is_packed.then(ChunkTable::default),
            varies,
            last_was_short: false,
            points: 0,
            returns: [0; 15],
            lo: [i64::MAX; 3],
            hi: [i64::MIN; 3],
            note,
            notes,
        };
        let mut head = sink.native.header.bytes()?;
        for i in 0..sink.native.vlrs.len() {
            sink.native.vlrs[i].append(&mut head)?;
            if head.len() > HEAD_BYTES {
                sink.write(&head)?;
                head.clear();
            }
        }
        head.extend_from_slice(&sink.native.gap);
        if sink.table.is_some() {
            head.extend((-1i64).to_le_bytes()); // the chunk table's place, set when it is known
        }
        sink.write(&head)?;
        Ok(sink)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.file.write_all(bytes).map_err(|e| Error::io(&self.path, "write it", e))?;
        self.at += bytes.len() as u64;
        Ok(())
    }

    /// Writes over what stands at byte `at`.
    pub fn rewrite(&self, at: u64, bytes: &[u8]) -> Result<()> {
        self.file.write_all_at(bytes, at).map_err(|e| Error::io(&self.path, "write it", e))
    }

    /// The chunk table at the end of the points, and its place in front of them.
    fn write_table(&mut self) -> Result<()> {
        let Some(table) = self.table.take() else { return Ok(()) };
        let start = u64::from(self.native.header.offset_to_point_data);
        let place = self.at;
        let vlr = LazVlrBuilder::default()
            .with_point_format(0, 0)
            .map_err(|e| Error::internal("the chunk table cannot be made").because(e))?;
        let vlr: LazVlr = match self.varies {
            true => vlr.with_variable_chunk_size().build(),
            false => vlr.with_fixed_chunk_size(CHUNK_POINTS).build(),
        };
        let mut bytes = Vec::new();
        table
            .write_to(&mut bytes, &vlr)
            .map_err(|e| Error::internal("the chunk table cannot be made").because(e))?;
        self.write(&bytes)?;
        self.rewrite(start, &place.to_le_bytes())
    }

    /// The extended records at the end of the file, first these `own` ones. Where the header says
    /// that the waveforms are one of them, it says so of its new place.
    fn write_evlrs(&mut self, own: &[Vec<u8>]) -> Result<()> {
        let evlrs = std::mem::take(&mut self.native.evlrs);
        let header = &self.native.header;
        let internal = header.encoding() & encoding::WAVEFORM_INTERNAL != 0;
        let waveforms = header.waveform_start();
        let count = evlrs.len() + own.len();
        let start = if count == 0 { 0 } else { self.at };
        let count = u32::try_from(count)
            .map_err(|_| Error::pipeline("there are more than 4,294,967,295 extended records"))?;
        own.iter().try_for_each(|bytes| self.write(bytes))?;
        for evlr in &evlrs {
            let is_waveforms = evlr.position() == waveforms || evlr.is("LASF_Spec", 65535);
            if internal && is_waveforms && self.native.header.minor() >= 3 {
                let here = self.at;
                self.native.header.start_of_waveform_data_packet_record = Some(here);
            }
            evlr.stream(|bytes| self.write(bytes))?;
        }
        self.native.header.evlr = Some(Evlr { start_of_first_evlr: start, number_of_evlrs: count });
        Ok(())
    }

    /// Counts and box; a file without points has a box of zeros.
    fn settle_header(&mut self) -> Result<()> {
        let header: &mut Header = &mut self.native.header;
        header.put_counts(self.points, &self.returns)?;
        let (scale, offset) = (header.scale(), header.offset());
        let (mut lo, mut hi) = ([0.0; 3], [0.0; 3]);
        if self.points > 0 {
            for axis in 0..3 {
                let world = |stored: i64| stored as f64 * scale[axis] + offset[axis];
                let (a, b) = (world(self.lo[axis]), world(self.hi[axis]));
                (lo[axis], hi[axis]) = (a.min(b), a.max(b));
            }
        }
        header.put_bounds(lo, hi);
        Ok(())
    }
}

impl Sink for LasSink {
    fn chunk_points(&self) -> usize {
        CHUNK_POINTS as usize
    }

    fn chunk_bytes(&self) -> u64 {
        self.encoder.chunk_bytes()
    }

    fn encoder(&self) -> Arc<dyn Encode> {
        self.encoder.clone()
    }

    fn append(&mut self, chunk: Encoded) -> Result<()> {
        if chunk.points == 0 {
            return Ok(());
        }
        if self.last_was_short && self.table.is_some() {
            return Err(Error::internal("only the last chunk may have fewer points"));
        }
        self.last_was_short = chunk.points < u64::from(CHUNK_POINTS);
        self.count(&chunk)?;
        self.put_chunk(&chunk.bytes, chunk.points)?;
        self.encoder.spare.put(chunk.bytes);
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<SinkSummary> {
        self.end_points()?;
        self.close(&[])
    }
}

impl LasSink {
    /// Counts the points of a chunk.
    pub fn count(&mut self, chunk: &Encoded) -> Result<()> {
        self.points += chunk.points;
        for (sum, count) in self.returns.iter_mut().zip(chunk.returns) {
            *sum += count;
        }
        // Refuses a count that the version cannot say as soon as it is reached.
        self.native.header.put_counts(self.points, &self.returns)?;
        for axis in 0..3 {
            self.lo[axis] = self.lo[axis].min(chunk.lo[axis]);
            self.hi[axis] = self.hi[axis].max(chunk.hi[axis]);
        }
        Ok(())
    }

    /// Writes the bytes of a chunk of so many points; the first one's place.
    pub fn put_chunk(&mut self, bytes: &[u8], points: u64) -> Result<u64> {
        let at = self.at;
        if let Some(table) = &mut self.table {
            let byte_count = bytes.len() as u64;
            table.push(ChunkTableEntry { point_count: points, byte_count });
        }
        self.write(bytes)?;
        Ok(at)
    }

    /// All points are written; the byte behind them, where extended records begin.
    pub fn end_points(&mut self) -> Result<u64> {
        self.write_table()?;
        Ok(self.at)
    }

    /// Writes the extended records, these `own` ones first, and what depends on all points.
    pub fn close(mut self, own: &[Vec<u8>]) -> Result<SinkSummary> {
        self.write_evlrs(own)?;
        self.settle_header()?;
        let header = self.native.header.bytes()?;
        self.rewrite(0, &header)?;
        if let Some((at, note)) = &self.note {
            WrittenNote { at: *at, note }.settle(&mut self.file, &self.path)?;
        }
        self.file.sync_all().map_err(|e| Error::io(&self.path, "write it to disk", e))?;
        Ok(SinkSummary { points: self.points, bytes: self.at, notes: self.notes })
    }
}
