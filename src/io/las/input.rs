//! One LAS or LAZ file as its header says it is, proven against its length.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use super::chunks::Chunks;
use super::crs;
use super::damage::Mending;
use super::described::Described;
use super::extra::{Descriptor, absent};
use super::fields::encoding;
use super::file::InputFile;
use super::format;
use super::header::Header;
use super::laz::LASZIP;
use super::noted::NOTE;
use super::records::{read_evlrs, read_vlrs};
pub use super::storage::Storage;
use super::storage::storage;
use super::system::CrsRecords;
use super::vlr::{Evlr, Vlr};
use super::waveforms::Waveforms;
use crate::Result;
use crate::error::shown;
use crate::io::origin::Origin;
use crate::point::{Dimension, Schema, Value};
use crate::report::LostPoints;
use crate::stage::OnError;

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
