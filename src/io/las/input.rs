//! One LAS or LAZ file as its header says it is, proven against its length.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::chunks;
use super::chunks::Chunks;
use super::crs;
use super::damage::Mending;
use super::described::Described;
use super::extra::{Descriptor, absent};
use super::fields::encoding;
use super::file::InputFile;
use super::format;
use super::header::Header;
use super::held::held;
use super::laz::{Compression, LASZIP};
use super::noted::NOTE;
use super::records::{read_evlrs, read_vlrs};
use super::system::CrsRecords;
use super::vlr::{Evlr, VLR_HEAD, Vlr};
use super::waveforms::Waveforms;
use crate::error::shown;
use crate::io::damage::advised;
use crate::io::origin::Origin;
use crate::point::{Dimension, Schema, Value};
use crate::report::{Grouped, LostPoints};
use crate::stage::OnError;
use crate::{Error, Result};

/// True for records that index the points of one file by their order: COPC's, and the LAX index of
/// LAStools. Elsewhere they would point at the wrong points.
fn is_index(user: &str, record: u16) -> bool {
    user == "copc" || (user == "LAStools" && record == 30)
}

/// True for a record that outputs carry: not one that describes how its file stores its points, or
/// was made.
pub fn is_carried(vlr: &Vlr) -> bool {
    let is_own = vlr.is(LASZIP.0, LASZIP.1) || vlr.is(NOTE.0, NOTE.1);
    !is_own && !is_index(&vlr.user(), vlr.record())
}

/// True for an extended record that outputs carry.
pub fn is_carried_extended(evlr: &Evlr) -> bool {
    !is_index(&evlr.user(), evlr.record())
}

/// How the points are stored.
#[derive(Debug, Clone)]
pub enum Storage {
    /// As they are: so many of them.
    Plain(u64),
    /// As LAZ.
    Laz(Compression, Chunks),
}

/// One LAS or LAZ file.
#[derive(Debug, Clone)]
pub struct LasInput {
    /// Its path.
    pub path: PathBuf,
    /// What the file was when it was opened.
    pub origin: Origin,
    /// Its public header block, or that of the form that its records are brought to.
    pub header: Header,
    /// Its own, where the records are brought to another form as they are read.
    pub own: Option<Box<Header>>,
    /// Its variable length records, all of them.
    pub vlrs: Vec<Vlr>,
    /// Bytes between them and the points.
    pub gap: Vec<u8>,
    /// Its extended records, all of them.
    pub evlrs: Vec<Evlr>,
    /// What describes the extra bytes.
    described: Described,
    /// What describes those of the file, where its records are brought to others.
    own_descriptors: Option<Vec<Descriptor>>,
    /// The file beside it that its records refer to for their waveforms.
    pub waveforms: Option<PathBuf>,
    /// How the points are stored.
    pub storage: Storage,
    /// What the user should know of how the points are stored.
    pub stored: Vec<String>,
    /// What the user should know, of that too.
    pub warnings: Vec<String>,
    /// What of its points is lost.
    pub lost: Vec<LostPoints>,
}

impl LasInput {
    /// Reads everything but the points of `path`; what is done about damage, `on_error` says.
    pub fn open(path: &Path, on_error: OnError) -> Result<Self> {
        let file = InputFile::open(path)?;
        let header = Header::read(&file)?;
        let mut mending = Mending::new(on_error);
        let (vlrs, gap) = read_vlrs(&file, &header, &mut mending)?;
        let evlrs = read_evlrs(&file, &header, &mut mending)?;
        let behind = evlrs.iter().map(Evlr::position).min();
        let before = mending.warnings.len();
        let storage = storage(&file, &header, &vlrs, behind, &mut mending)?;
        let stored = mending.warnings[before..].to_vec();
        let Mending { mut warnings, lost, .. } = mending;
        let path_said = |odd: String| format!("{}: {odd}", shown(path));
        warnings.extend(header.odd_scales().into_iter().chain(header.odd_counts()).map(path_said));
        let named = vlrs.iter().map(|v| (v.user(), v.record()));
        let named = named.chain(evlrs.iter().map(|v| (v.user(), v.record())));
        let indexes: BTreeSet<String> =
            named.filter(|(user, record)| is_index(user, *record)).map(|(user, _)| user).collect();
        // That of COPC is made anew for outputs that have one, and says nothing of the points.
        for user in indexes.iter().filter(|user| *user != "copc") {
            warnings.push(format!(
                "{}: outputs do not carry the spatial index ({user}), which would be wrong there",
                shown(path)
            ));
        }
        let (path, origin) = (path.to_owned(), file.origin().clone());
        let described = Described::of(&vlrs, &evlrs, extra_len(&header))?;
        let odd = described.warning.clone().into_iter().chain(wrong_bit(&header, &vlrs, &evlrs)?);
        warnings.extend(odd.map(path_said));
        let waveforms = Waveforms::of(&path, &header);
        warnings.extend(waveforms.missing.clone().map(path_said));
        Ok(LasInput {
            path,
            origin,
            header,
            own: None,
            vlrs,
            gap,
            evlrs,
            described,
            own_descriptors: None,
            waveforms: waveforms.there,
            storage,
            stored,
            warnings,
            lost,
        })
    }

    /// Opens the file again to read points; fails if it has changed.
    pub fn reopen(&self) -> Result<InputFile> {
        InputFile::reopen(&self.origin)
    }

    /// Points to read.
    pub fn points(&self) -> u64 {
        match &self.storage {
            Storage::Plain(points) => *points,
            Storage::Laz(_, chunks) => chunks.points(),
        }
    }

    /// Bytes that the table of its chunks takes.
    pub fn table_bytes(&self) -> u64 {
        match &self.storage {
            Storage::Laz(_, Chunks::Known(table)) => table.bytes(),
            _ => 0,
        }
    }

    /// Bytes behind the standard fields of a record.
    pub fn extra_len(&self) -> usize {
        extra_len(&self.header)
    }

    /// What records hold, in the form that they are brought to.
    pub fn schema(&self) -> Schema {
        self.schema_of(&self.header, self.descriptors())
    }

    /// What the file's own records hold.
    pub fn own_schema(&self) -> Schema {
        self.schema_of(self.own_header(), self.own_descriptors())
    }

    fn schema_of(&self, header: &Header, descriptors: &[Descriptor]) -> Schema {
        format::schema(
            header.format(),
            descriptors,
            extra_len(header),
            header.scale(),
            header.offset(),
        )
    }

    /// The header as it is in the file.
    pub fn own_header(&self) -> &Header {
        self.own.as_deref().unwrap_or(&self.header)
    }

    /// The descriptors of the extra bytes in the file.
    pub fn own_descriptors(&self) -> &[Descriptor] {
        self.own_descriptors.as_deref().unwrap_or(self.descriptors())
    }

    /// Has its records brought to extra bytes of these descriptors.
    pub fn describe_as(&mut self, descriptors: Vec<Descriptor>) {
        let formed = Described { descriptors, as_they_are: false, warning: None };
        let own = std::mem::replace(&mut self.described, formed);
        self.own_descriptors.get_or_insert(own.descriptors);
    }

    /// What stands in the values of its records that the file lacks, where that is not 0.
    pub fn absent(&self) -> Vec<(Dimension, Value)> {
        let start = usize::from(format::record_size(self.header.format()).unwrap_or(0));
        absent(self.own_descriptors(), self.descriptors(), start)
    }

    /// The descriptors of the extra bytes.
    pub fn descriptors(&self) -> &[Descriptor] {
        &self.described.descriptors
    }

    /// The records that outputs carry, and the extended ones.
    pub fn carried(&self) -> (Vec<Vlr>, Vec<Evlr>) {
        let mut vlrs: Vec<Vlr> = self.vlrs.iter().filter(|v| is_carried(v)).cloned().collect();
        let extended = self.evlrs.iter().filter(|v| is_carried_extended(v));
        let mut evlrs: Vec<Evlr> = extended.cloned().collect();
        self.described.carried(&mut vlrs, &mut evlrs);
        (vlrs, evlrs)
    }

    /// The same without the records, whose payloads of thousands of files would add up.
    pub fn without_records(self) -> Self {
        let described = Described::default();
        let (vlrs, gap, evlrs) = (Vec::new(), Vec::new(), Vec::new());
        LasInput { vlrs, gap, evlrs, described, own_descriptors: None, ..self }
    }

    /// The records that say in which coordinate reference system the points are.
    pub fn crs_records(&self) -> Result<CrsRecords> {
        CrsRecords::of(&self.vlrs, &self.evlrs)
    }
}

/// Bytes behind the standard fields of a record.
pub fn extra_len(header: &Header) -> usize {
    let least = format::record_size(header.format()).unwrap_or(0);
    usize::from(header.point_data_record_length.saturating_sub(least))
}

/// What is odd about a bit that says GeoTIFF keys where the system is WKT.
fn wrong_bit(header: &Header, vlrs: &[Vlr], evlrs: &[Evlr]) -> Result<Option<String>> {
    let wrong = header.encoding() & encoding::WKT == 0
        && crs::has_wkt(vlrs, evlrs)?
        && crs::wants_bit(header, vlrs, evlrs)?;
    Ok(wrong.then(|| {
        "the header does not say that the CRS is WKT, and it is: it is read, and outputs say so"
            .to_owned()
    }))
}

fn storage(
    file: &InputFile,
    header: &Header,
    vlrs: &[Vlr],
    evlrs_start: Option<u64>,
    mending: &mut Mending,
) -> Result<Storage> {
    let record = vlrs.iter().position(|v| v.is(LASZIP.0, LASZIP.1));
    if !header.compressed() {
        return plain(file, header, evlrs_start, mending).map(Storage::Plain);
    }
    let Some(record) = record else {
        return Err(file
            .wrong(
                super::fields::at::FORMAT as u64,
                "the header says LAZ and there is no record that says how",
            )
            .help("the file is damaged: LASzip writes a record 'laszip encoded'"));
    };
    let before: usize = vlrs[..record].iter().map(Vlr::len).sum();
    let at = (usize::from(header.header_size) + before + VLR_HEAD) as u64;
    let (format, stride) = (header.format(), header.point_data_record_length);
    let compression = Compression::read(file, &vlrs[record], at, format, stride)?;
    let counted = header.points();
    let held = match mending.on_error {
        OnError::Salvage => held(file, header, &compression)?.filter(|held| *held > counted),
        _ => None,
    };
    let found = chunks::uncounted(file, header, evlrs_start, &compression)?;
    match (held, found) {
        (Some(held), _) => mending.warnings.push(behind_counted(file, held - counted, counted)),
        (None, Some(bytes)) => return Err(advised(uncounted(file, bytes))),
        (None, None) => {}
    }
    let points = held.unwrap_or(counted);
    let end = behind_points(file, header, evlrs_start, u64::from(header.offset_to_point_data));
    let mut chunks = Chunks::read(file, (header, points), &compression, end, mending)?;
    check_last(file, &compression, &mut chunks, mending)?;
    Ok(Storage::Laz(compression, chunks))
}

/// How many plain points there are: those of the header, whose bytes must be there, or as many as
/// there are, if damage is mended; a warning if there are more.
fn plain(
    file: &InputFile,
    header: &Header,
    evlrs_start: Option<u64>,
    mending: &mut Mending,
) -> Result<u64> {
    let start = u64::from(header.offset_to_point_data);
    let (points, each) = (header.points(), u64::from(header.point_data_record_length));
    let held = (file.len() - start) / each;
    if points > held {
        let error = file
            .wrong(
                file.len(),
                format!(
                    "the file ends after {} of the {} points that its header claims, {each} bytes \
                     each from byte {start}",
                    Grouped(held),
                    Grouped(points)
                ),
            )
            .help("the copy or download is incomplete, or the header's count is damaged");
        mending.lose(file, start + held * each, points - held, error)?;
        return Ok(held);
    }
    let end = start + points * each;
    let behind = behind_points(file, header, evlrs_start, end) - end;
    if mending.on_error == OnError::Salvage && behind >= each {
        let more = behind / each;
        mending.warnings.push(behind_counted(file, more, points));
        return Ok(points + more);
    }
    if points == 0 && behind >= each {
        return Err(advised(uncounted(file, behind)));
    }
    if behind >= each {
        mending.warnings.push(format!(
            "{}: {} bytes behind the {} points that the header counts are not read",
            shown(file.path()),
            Grouped(behind),
            Grouped(points)
        ));
    }
    Ok(points)
}

/// What is said of points that the header does not count and that are read.
fn behind_counted(file: &InputFile, more: u64, counted: u64) -> String {
    format!(
        "{}: {} points behind the {} that the header counts are read, too",
        shown(file.path()),
        Grouped(more),
        Grouped(counted)
    )
}

/// Where the next thing behind the points begins, which end at byte `end` or later, or the file
/// ends.
fn behind_points(file: &InputFile, header: &Header, evlrs_start: Option<u64>, end: u64) -> u64 {
    // Waveform packets that are not listed as a record stand behind the points too.
    let waveforms = Some(header.waveform_start()).filter(|&at| at > 0);
    let next = evlrs_start.into_iter().chain(waveforms).filter(|&at| at >= end).min();
    next.unwrap_or(file.len()).clamp(end, file.len().max(end))
}

/// A writer that did not come to its end leaves a count of 0 in front of the points.
fn uncounted(file: &InputFile, bytes: u64) -> Error {
    let field = super::fields::at::LEGACY_POINTS as u64;
    file.wrong(field, format!("the header counts no points and {bytes} bytes of points follow it"))
        .help("what wrote the file did not finish it; repair the counts of its header first")
}

/// The table of fixed layered chunks does not say how many points the last one has; the chunk does.
fn check_last(
    file: &InputFile,
    compression: &Compression,
    chunks: &mut Chunks,
    mending: &mut Mending,
) -> Result<()> {
    let Chunks::Known(chunks) = chunks else { return Ok(()) };
    let Some(last) = chunks.last().filter(|_| compression.layers > 0) else { return Ok(()) };
    let head = match chunks::layered_head(file, last.start, last.end, compression) {
        Ok(head) => head,
        // It is lost where it is read.
        Err(error) if mending.mends(&error) => return Ok(()),
        Err(error) => return Err(advised(error)),
    };
    if head.points < last.points {
        let error = file
            .wrong(
                last.start + compression.stride as u64,
                format!(
                    "the last chunk has {} of the {} points that the header's count leaves for it",
                    head.points, last.points
                ),
            )
            .help("the header's count of points is damaged, or the file is cut off");
        mending.lose(file, last.end, last.points - head.points, error)?;
        chunks.shorten_last(head.points);
        return Ok(());
    }
    if head.points > last.points && last.whole {
        last.whole = false;
        mending.warnings.push(format!(
            "{}: {} points behind those that the header counts are not read",
            shown(file.path()),
            head.points - last.points
        ));
    }
    Ok(())
}
