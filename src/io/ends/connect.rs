//! From checked keys to sources and sinks of registered formats: what is alike for all of them.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::placed::PlacedSink;
use super::reshaped::Reshaped;
use super::settled::settled;
use crate::error::shown;
#[cfg(feature = "proj")]
use crate::io::reproject::{self, AskedSteps};
use crate::io::rows::names::meant;
use crate::io::sniff;
use crate::point::names::GPS_TIME;
use crate::point::{Metadata, PointBatch, Schema};
#[cfg(feature = "proj")]
use crate::quantity::Setting;
use crate::stage::{
    ChunkSize, CreateSink, Format, Formats, Lattice, OpenSource, Order, PointsAhead, ReadKeys,
    Sink, Source, WriteKeys,
};
use crate::{Error, Result};

/// Files that are read as one scan, all of one family of formats.
pub struct InputFiles {
    /// Where they are.
    pub files: Vec<PathBuf>,
    /// A format of the family.
    pub format: Arc<dyn Format>,
    /// How they are read.
    pub keys: ReadKeys,
    /// All formats, for what a file is that is none of these.
    pub formats: Formats,
}

impl OpenSource for InputFiles {
    fn open(&self) -> Result<Box<dyn Source>> {
        let told = |error| sniff::told(error, &*self.format, &self.formats);
        let opened = |keys: &ReadKeys| self.format.open(&self.files, keys).map_err(told);
        match &self.keys.reproject {
            None => opened(&self.keys),
            Some(to) => reprojected(to, &self.keys, opened),
        }
    }

    fn paths(&self) -> Vec<PathBuf> {
        self.files.clone()
    }

    fn family(&self) -> Option<&str> {
        Some(self.format.family())
    }

    fn keys(&self) -> Option<&ReadKeys> {
        Some(&self.keys)
    }

    fn merged(&self, other: &dyn OpenSource) -> Result<Box<dyn OpenSource>> {
        if other.family() != self.family() {
            let told = "sources are merged where all read files, and of one family of formats";
            return Err(Error::pipeline(told).help("convert some of them first"));
        }
        if other.keys() != Some(&self.keys) {
            let told = "sources that are merged are read in one way, and the keys of these differ";
            return Err(Error::pipeline(told).help(
                "give both `read` the same keys; where that does not do, convert each by itself, \
                 and merge what comes of it",
            ));
        }
        let (mut files, more) = (self.files.clone(), other.paths());
        let real = |file: &PathBuf| file.canonicalize().unwrap_or_else(|_| file.clone());
        let known: BTreeSet<PathBuf> = files.iter().map(real).collect();
        if let Some(twice) = more.iter().find(|file| known.contains(&real(file))) {
            return Err(Error::pipeline("another source reads this file, too").at(twice));
        }
        files.extend(more);
        let (format, formats) = (self.format.clone(), self.formats.clone());
        let keys = self.keys.clone();
        Ok(Box::new(InputFiles { files, format, keys, formats }))
    }
}

/// What `open` opens, in the system `to`. Scale and offset are those of the points there: inputs
/// that differ in them are read as one by steps that round nothing, where there are such.
#[cfg(feature = "proj")]
fn reprojected(
    to: &str,
    keys: &ReadKeys,
    open: impl Fn(&ReadKeys) -> Result<Box<dyn Source>>,
) -> Result<Box<dyn Source>> {
    let asked = AskedSteps { scale: keys.scale, offset: keys.offset };
    let stepped = |steps: Option<Setting<[f64; 3]>>| {
        open(&ReadKeys { scale: steps, offset: steps, ..keys.clone() })
    };
    let inner = match (stepped(None), keys.scale.or(keys.offset)) {
        (Ok(inner), _) => Ok(inner),
        // What is asked for is not about these; what they say of each other is.
        (Err(_), Some(_)) => stepped(Some(Setting::Auto))
            .map_err(|error| error.help("bring each to one scale and offset by itself first")),
        (Err(error), None) => stepped(Some(Setting::Auto)).map_err(|_| error),
    };
    reproject::reprojected(inner?, to, asked)
}

#[cfg(not(feature = "proj"))]
fn reprojected(
    _to: &str,
    _keys: &ReadKeys,
    _open: impl Fn(&ReadKeys) -> Result<Box<dyn Source>>,
) -> Result<Box<dyn Source>> {
    let told = "`read.reproject` is not in this pointmill, which was built without it";
    Err(Error::pipeline(told).help("build it with its feature `proj`, which is there by default"))
}

/// The sink that writes a file of one format.
#[derive(Clone)]
pub struct OutputFile {
    /// What it is to be.
    pub keys: WriteKeys,
    /// The order of its records.
    pub order: Order,
    /// Its format.
    pub format: Arc<dyn Format>,
    /// All formats, for what its name says and for what its records come from.
    pub formats: Formats,
    /// True for the output of one of several inputs: records take the form that they have there.
    pub of_one: bool,
}

impl CreateSink for OutputFile {
    fn path(&self) -> &Path {
        &self.keys.path
    }

    fn extension(&self) -> Option<&OsStr> {
        let format = self.formats.of(&self.keys.path);
        format.map(|format| OsStr::new(format.extension())).or(self.keys.path.extension())
    }

    fn settled(&self, ahead: &PointsAhead<'_>) -> Result<Option<Box<dyn CreateSink>>> {
        let keys = settled(&self.keys, ahead)?;
        Ok(keys.map(|keys| Box::new(OutputFile { keys, ..self.clone() }) as Box<dyn CreateSink>))
    }

    fn order(&self) -> Order {
        self.order
    }

    fn likes_time(&self) -> bool {
        self.format.likes_time() && self.order == Order::Auto
    }

    fn wants_beside(&self) -> bool {
        self.format.wants_beside()
    }

    fn computed(&self) -> &[String] {
        &self.keys.computed
    }

    fn unread(&self) -> &[String] {
        self.format.unread(&self.keys)
    }

    fn chunk(&self, schema: &Arc<Schema>, metadata: &Metadata) -> Result<ChunkSize> {
        let chunk = Reshaped::of(&self.keys, schema)
            .and_then(|asked| self.format.chunk(&asked.keys, &asked.schema, metadata));
        let chunk = chunk.map_err(|error| error.at(&self.keys.path))?;
        let chunk = if self.of_one { chunk.and_records(schema.stride) } else { chunk };
        Ok(if self.format.arranged().is_some() { PlacedSink::chunk(chunk) } else { chunk })
    }

    fn arranged(
        &self,
        lattice: &Lattice,
        schema: &Arc<Schema>,
        metadata: &Metadata,
    ) -> Result<Option<u64>> {
        if self.format.arranged().is_none() {
            return Ok(None);
        }
        if lattice.z_scale() != 1.0 {
            let told = format!(
                "{} has cubes in the unit of the coordinates, and z has another than x and y",
                self.format.name().to_uppercase()
            );
            return Err(Error::pipeline(told).help("leave `run.z_scale` out, or write LAZ"));
        }
        let asked = Reshaped::of(&self.keys, schema)?;
        self.format.arranging_bytes(&asked.keys, &asked.schema, metadata).map(Some)
    }

    fn disk_bytes(&self, schema: &Arc<Schema>, metadata: &Metadata) -> Result<[u64; 2]> {
        let asked = Reshaped::of(&self.keys, schema)?;
        self.format.disk_bytes(&asked.keys, &asked.schema, metadata)
    }

    fn carries(&self, schema: &Schema) -> bool {
        let is_reshaped = !self.keys.map.is_empty() || !self.keys.types.is_empty();
        !is_reshaped && self.format.carries(&self.keys, schema)
    }

    fn warnings(&self, schema: &Schema, metadata: &Metadata) -> Vec<String> {
        let family = self.format.family();
        let from = self.from(schema).filter(|from| from.family() != family);
        let mut lost = from.map_or(Vec::new(), |from| from.lost(metadata));
        if metadata.crs.is_some() && !self.format.holds_crs() {
            lost.push("the coordinate reference system".to_owned());
        }
        let is_dropped = self.keys.drop.iter().any(|name| meant(name, schema) == GPS_TIME);
        let has_times = schema.find(GPS_TIME).is_some() && !is_dropped;
        if has_times && metadata.gps_time.is_some() && !self.format.holds_gps_time_kind() {
            lost.push("what GPS times count".to_owned());
        }
        let path = shown(&self.keys.path);
        let told = |lost| format!("{path}: {family} does not hold {lost}");
        self.misnamed().into_iter().chain(lost.into_iter().map(told)).collect()
    }

    fn checks(&self, schema: &Schema) -> bool {
        self.format.checks(&self.keys, schema)
    }

    fn check(&self, metadata: &Metadata, records: &PointBatch) -> Result<()> {
        let asked = Reshaped::of(&self.keys, records.schema())?;
        match asked.schema {
            Cow::Borrowed(_) => self.format.check(&asked.keys, metadata, records),
            Cow::Owned(_) => self.format.check(&asked.keys, metadata, &asked.records(records)),
        }
    }

    fn reopen(&self, staged: &[PathBuf]) -> Result<Option<Box<dyn Source>>> {
        self.format.open(staged, &ReadKeys::default()).map(Some)
    }

    fn create(
        &self,
        staged: &Path,
        schema: &Arc<Schema>,
        metadata: &Metadata,
        whole: bool,
    ) -> Result<Box<dyn Sink>> {
        let create = |schema: &Arc<Schema>| {
            let asked = Reshaped::of(&self.keys, schema)?;
            self.format.create(staged, &asked.keys, &asked.schema, metadata, whole)
        };
        let created = match self.from(schema).filter(|_| self.of_one) {
            Some(from) => from.of_one(staged, schema, metadata, &create),
            None => create(schema),
        };
        let created = created.map_err(|error| of_output(error, staged, &self.keys.path))?;
        Ok(match self.format.arranged() {
            Some(_) => Box::new(PlacedSink::new(created)),
            None => created,
        })
    }
}

/// An error of creating the output that is to be at `path` and grows at `staged`.
pub(super) fn of_output(error: Error, staged: &Path, path: &Path) -> Error {
    match error.path() {
        Some(at) if at == staged => error,
        _ => error.at(path),
    }
}

impl OutputFile {
    /// A format of the files that records of `schema` come from.
    fn from(&self, schema: &Schema) -> Option<&Arc<dyn Format>> {
        self.formats.of_family(schema.layout.family).next()
    }

    /// Says that the name is that of another format.
    fn misnamed(&self) -> Option<String> {
        let named = self.formats.of(&self.keys.path).map(|named| named.name());
        let named = named.filter(|named| !self.of_one && *named != self.format.name())?;
        let [named, is] = [named, self.format.name()].map(str::to_uppercase);
        Some(format!(
            "{}: this is named as {named} and becomes {is}, as `write.format` says: programs that \
             go by names will not read it",
            shown(&self.keys.path)
        ))
    }
}
