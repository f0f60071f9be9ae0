//! LAS and LAZ as registered formats: how `read` and `write` come to their files, and how records
//! of other formats become theirs.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::copc;
use super::format::{FAMILY, format_of};
use super::header::{CALLED, SIGNATURE};
use super::holding::las_schema;
use super::native::lost;
use super::noted;
use super::own::{Shifted, own_form};
use super::sink::{self, LasOptions};
use super::target::{Target, reshapes};
use super::{describe, source, validate, waveforms};
use crate::Result;
use crate::io::describe::json;
use crate::io::project::Projected;
use crate::point::{Metadata, PointBatch, Schema};
use crate::stage::{
    ChunkSize, Findings, Format, PointWalk, ReadKeys, Rule, Sink, Source, WriteKeys,
};

/// One of the formats of LAS records.
#[derive(Debug, Clone, Copy)]
pub struct LasFormat {
    form: Form,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    Plain,
    Compressed,
    Octree,
}

/// LAS, whose records are as they are.
pub const LAS: LasFormat = LasFormat { form: Form::Plain };
/// LAZ, whose records are compressed.
pub const LAZ: LasFormat = LasFormat { form: Form::Compressed };
/// COPC: LAZ in the chunks of an octree.
pub const COPC: LasFormat = LasFormat { form: Form::Octree };

impl Format for LasFormat {
    fn name(&self) -> &'static str {
        match self.form {
            Form::Plain => "las",
            Form::Compressed => "laz",
            Form::Octree => "copc",
        }
    }

    fn extension(&self) -> &'static str {
        if self.form == Form::Octree { copc::EXTENSION } else { self.name() }
    }

    fn family(&self) -> &'static str {
        FAMILY
    }

    fn about(&self) -> &'static str {
        match self.form {
            Form::Plain => "ASPRS LAS, uncompressed.",
            Form::Compressed => "LAS compressed by LASzip.",
            Form::Octree => "COPC 1.0: LAZ in the chunks of an octree.",
        }
    }

    fn called(&self) -> &'static str {
        CALLED
    }

    fn sniff(&self, first: &[u8]) -> bool {
        first.starts_with(SIGNATURE)
    }

    fn read_keys(&self) -> &'static [&'static str] {
        &["on_error", "box", "resolution", "scale", "offset", "point_format"]
    }

    fn open(&self, files: &[PathBuf], keys: &ReadKeys) -> Result<Box<dyn Source>> {
        source::open_with(files, keys)
    }

    fn describe(&self, path: &Path) -> Result<serde_json::Value> {
        json(&describe::describe(path)?)
    }

    fn validate(&self, path: &Path, walk: &PointWalk<'_>, findings: &mut Findings) -> Result<()> {
        validate::validate(path, self.form == Form::Octree, walk, findings)
    }

    fn rules(&self) -> Vec<&'static Rule> {
        validate::rules(self.form == Form::Octree)
    }

    fn note(&self, path: &Path) -> Result<Option<String>> {
        noted::read(path)
    }

    fn beside(&self, path: &Path) -> Option<(PathBuf, &'static str)> {
        waveforms::beside(path)
    }

    fn arranged(&self) -> Option<&'static str> {
        (self.form == Form::Octree).then(|| LAZ.name())
    }

    fn lost(&self, metadata: &Metadata) -> Vec<String> {
        lost(metadata)
    }

    fn of_one(
        &self,
        staged: &Path,
        schema: &Arc<Schema>,
        metadata: &Metadata,
        create: &dyn Fn(&Arc<Schema>) -> Result<Box<dyn Sink>>,
    ) -> Result<Box<dyn Sink>> {
        Ok(match own_form(schema, metadata)? {
            Some(own) => Box::new(Shifted::new(staged, create(&own.0)?, own)),
            None => create(schema)?,
        })
    }

    fn keys(&self) -> &'static [&'static str] {
        &["types", "scale", "offset", "point_format", "intensity"]
    }

    fn chunk(
        &self,
        keys: &WriteKeys,
        schema: &Arc<Schema>,
        metadata: &Metadata,
    ) -> Result<ChunkSize> {
        let target = self.target(keys, schema, metadata)?;
        let options = self.options(metadata);
        let chunk = match self.form {
            Form::Octree => copc::sink::chunk(&options, &target.schema)?,
            _ => sink::chunk(&options, &target.schema)?,
        };
        Ok(match target.projection {
            Some(_) => Projected::chunk(chunk, &target.schema),
            None => chunk,
        })
    }

    fn create(
        &self,
        staged: &Path,
        keys: &WriteKeys,
        schema: &Arc<Schema>,
        metadata: &Metadata,
        _whole: bool,
    ) -> Result<Box<dyn Sink>> {
        let options = self.options(metadata);
        let Target { schema, metadata, projection } = self.target(keys, schema, metadata)?;
        let sink = match self.form {
            Form::Octree => copc::sink::create(staged, &options, &schema, &metadata)?,
            _ => sink::create(staged, &options, &schema, &metadata)?,
        };
        Ok(match projection {
            Some(projection) => Box::new(Projected::new(sink, projection, schema, &keys.path)),
            None => sink,
        })
    }

    fn arranging_bytes(
        &self,
        keys: &WriteKeys,
        schema: &Arc<Schema>,
        metadata: &Metadata,
    ) -> Result<u64> {
        let target = self.target(keys, schema, metadata)?;
        copc::sink::arranging_bytes(&self.options(metadata), &target.schema)
    }

    fn disk_bytes(
        &self,
        keys: &WriteKeys,
        schema: &Arc<Schema>,
        metadata: &Metadata,
    ) -> Result<[u64; 2]> {
        Ok(match self.form {
            Form::Plain => [self.target(keys, schema, metadata)?.schema.stride as u64, 0],
            _ => [0; 2],
        })
    }

    fn holds_computed(&self) -> bool {
        true
    }

    fn carries(&self, keys: &WriteKeys, schema: &Schema) -> bool {
        schema.layout.family == FAMILY && !self.changes(keys, schema)
    }

    fn likes_time(&self) -> bool {
        self.form == Form::Compressed
    }

    fn wants_beside(&self) -> bool {
        self.form != Form::Octree
    }

    fn checks(&self, keys: &WriteKeys, schema: &Schema) -> bool {
        schema.layout.family != FAMILY || self.changes(keys, schema)
    }

    fn check(&self, keys: &WriteKeys, metadata: &Metadata, records: &PointBatch) -> Result<()> {
        if let Some(projection) = self.target(keys, records.schema(), metadata)?.projection {
            projection.project(records.records(), &mut Vec::new())?;
        }
        Ok(())
    }
}

impl LasFormat {
    fn options(&self, metadata: &Metadata) -> LasOptions {
        let compressed = self.form != Form::Plain;
        LasOptions { compressed, computed: metadata.computed.clone() }
    }

    /// The point format of records of `schema` in an output, if it is not their own.
    fn format(&self, keys: &WriteKeys, schema: &Schema) -> Result<Option<u8>> {
        let asked = keys.given_point_format();
        let format = match self.form {
            Form::Octree => Some(copc::point_format(asked, schema, &keys.drop)?),
            _ => match asked {
                None if keys.point_format.is_some() => smallest(keys, schema)?,
                asked => asked,
            },
        };
        Ok(format.filter(|format| Some(*format) != format_of(schema)))
    }

    fn target(
        &self,
        keys: &WriteKeys,
        schema: &Arc<Schema>,
        metadata: &Metadata,
    ) -> Result<Target> {
        Target::of(keys, self.format(keys, schema)?, schema, metadata)
    }

    /// True if records of LAS are not written as they come.
    fn changes(&self, keys: &WriteKeys, schema: &Schema) -> bool {
        let reforms = !matches!(self.format(keys, schema), Ok(None));
        keys.given_scale().is_some() || keys.given_offset().is_some() || reforms || reshapes(keys)
    }
}

/// The smallest point format that holds what `drop` leaves of records of LAS; None where it leaves
/// all, and for others, whose format is the smallest in any case.
fn smallest(keys: &WriteKeys, schema: &Schema) -> Result<Option<u8>> {
    if keys.drop.is_empty() || schema.layout.family != FAMILY {
        return Ok(None);
    }
    las_schema(schema, &keys.drop).map(|(format, _)| Some(format))
}
