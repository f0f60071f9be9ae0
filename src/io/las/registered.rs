//! LAS and LAZ as registered formats: how `read` and `write` come to their files, and how records
//! of other formats become theirs.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::format::{FAMILY, layout};
use super::header::{CALLED, SIGNATURE};
use super::holding::las_schema;
use super::native::{fresh, lost};
use super::noted;
use super::own::{Shifted, own_form};
use super::sink::{self, LasOptions};
use super::{describe, source, waveforms};
use crate::io::convert::Projection;
use crate::io::describe::json;
use crate::io::project::Projected;
use crate::point::{GpsTime, Metadata, PointBatch, Schema, names};
use crate::stage::{ChunkSize, Format, ReadKeys, Sink, Source, WriteKeys};
use crate::{Error, Result};

/// One of the two formats of LAS records.
#[derive(Debug, Clone, Copy)]
pub struct LasFormat {
    compressed: bool,
}

/// LAS, whose records are as they are.
pub const LAS: LasFormat = LasFormat { compressed: false };
/// LAZ, whose records are compressed.
pub const LAZ: LasFormat = LasFormat { compressed: true };

impl Format for LasFormat {
    fn name(&self) -> &'static str {
        if self.compressed { "laz" } else { "las" }
    }

    fn family(&self) -> &'static str {
        FAMILY
    }

    fn about(&self) -> &'static str {
        if self.compressed { "LAS compressed by LASzip." } else { "ASPRS LAS, uncompressed." }
    }

    fn called(&self) -> &'static str {
        CALLED
    }

    fn sniff(&self, first: &[u8]) -> bool {
        first.starts_with(SIGNATURE)
    }

    fn open(&self, files: &[PathBuf], _: &ReadKeys) -> Result<Box<dyn Source>> {
        source::open(files)
    }

    fn describe(&self, path: &Path) -> Result<serde_json::Value> {
        json(&describe::describe(path)?)
    }

    fn note(&self, path: &Path) -> Result<Option<String>> {
        noted::read(path)
    }

    fn beside(&self, path: &Path) -> Option<(PathBuf, &'static str)> {
        waveforms::beside(path)
    }

    /// COPC is read as the LAZ that it is, and not written: readers of COPC refuse plain LAZ under
    /// its name.
    fn promises(&self, path: &Path) -> Option<(&'static str, PathBuf)> {
        let stem = Path::new(path.file_stem()?);
        let is_copc = stem.extension().is_some_and(|e| e.eq_ignore_ascii_case("copc"));
        let mut plain = stem.file_stem().filter(|_| is_copc && self.compressed)?.to_owned();
        plain.push(".");
        plain.push(path.extension()?);
        Some(("COPC", path.with_file_name(plain)))
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
        &["scale", "offset"]
    }

    fn chunk(
        &self,
        keys: &WriteKeys,
        schema: &Arc<Schema>,
        metadata: &Metadata,
    ) -> Result<ChunkSize> {
        let target = Target::of(keys, schema, metadata)?;
        let chunk = sink::chunk(&self.options(metadata), &target.schema)?;
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
        let Target { schema, metadata, projection } = Target::of(keys, schema, metadata)?;
        let sink = sink::create(staged, &options, &schema, &metadata)?;
        Ok(match projection {
            Some(projection) => Box::new(Projected::new(sink, projection, schema, &keys.path)),
            None => sink,
        })
    }

    fn disk_bytes(
        &self,
        keys: &WriteKeys,
        schema: &Arc<Schema>,
        metadata: &Metadata,
    ) -> Result<[u64; 2]> {
        Ok(match self.compressed {
            true => [0; 2],
            false => [Target::of(keys, schema, metadata)?.schema.stride as u64, 0],
        })
    }

    fn holds_computed(&self) -> bool {
        true
    }

    fn carries(&self, keys: &WriteKeys, schema: &Schema) -> bool {
        schema.layout.family == FAMILY && keys.scale.is_none() && keys.offset.is_none()
    }

    fn likes_time(&self) -> bool {
        self.compressed
    }

    fn wants_beside(&self) -> bool {
        true
    }

    fn checks(&self, keys: &WriteKeys, schema: &Schema) -> bool {
        schema.layout.family != FAMILY || keys.scale.is_some() || keys.offset.is_some()
    }

    fn check(&self, keys: &WriteKeys, metadata: &Metadata, records: &PointBatch) -> Result<()> {
        if let Some(projection) = Target::of(keys, records.schema(), metadata)?.projection {
            projection.project(records.records(), &mut Vec::new())?;
        }
        Ok(())
    }
}

impl LasFormat {
    fn options(&self, metadata: &Metadata) -> LasOptions {
        LasOptions { compressed: self.compressed, computed: metadata.computed.clone() }
    }
}

/// What a LAS output's records are, and how the input's become them.
struct Target {
    schema: Arc<Schema>,
    metadata: Metadata,
    projection: Option<Projection>,
}

impl Target {
    fn of(keys: &WriteKeys, schema: &Arc<Schema>, metadata: &Metadata) -> Result<Target> {
        match schema.layout.family {
            FAMILY => Target::of_las(keys, schema, metadata),
            _ => Target::of_others(keys, schema, metadata),
        }
    }

    /// LAS records stay as they are, unless another scale is asked for.
    fn of_las(keys: &WriteKeys, schema: &Arc<Schema>, metadata: &Metadata) -> Result<Target> {
        if !keys.drop.is_empty() {
            return Err(Error::pipeline("`write.drop` is for conversions between LAS and PLY")
                .help(
                    "a LAS output holds every dimension of a LAS input: leave `write.drop` out",
                ));
        }
        let mut scaled = (**schema).clone();
        for (axis, name) in names::XYZ.into_iter().enumerate() {
            if let Some(dimension) = scaled.dimensions.iter_mut().find(|d| d.name == name) {
                dimension.scale = keys.scale.map_or(dimension.scale, |scale| scale[axis]);
                dimension.origin = keys.offset.map_or(dimension.origin, |offset| offset[axis]);
            }
        }
        let metadata = metadata.clone();
        if scaled == **schema {
            return Ok(Target { schema: schema.clone(), metadata, projection: None });
        }
        let projection = Some(Projection::new(schema, &scaled, &[])?);
        Ok(Target { schema: Arc::new(scaled), metadata, projection })
    }

    fn of_others(keys: &WriteKeys, schema: &Schema, metadata: &Metadata) -> Result<Target> {
        let scale = keys.scale.ok_or_else(|| {
            let told = format!(
                "a {} scan written as LAS needs a scale for its coordinates",
                schema.layout.family
            );
            Error::pipeline(told).help(
                "give `write.scale = 0.001`, or what the scan's precision is, in its own unit",
            )
        })?;
        let (format, extra) = las_schema(schema, &keys.drop)?;
        let offset = keys.offset.unwrap_or([0.0; 3]);
        let own = Arc::new(layout(format, &extra, scale, offset));
        let mut projection = Projection::new(schema, &own, &keys.drop)?;
        number_returns(schema, &own, &keys.drop, &mut projection)?;
        let projection = Some(projection);
        // Times that are all 0, since the input has none, count nothing that were to be told.
        let is_timed = schema.find(names::GPS_TIME).is_some();
        let is_timed = is_timed && !keys.drop.iter().any(|name| name == names::GPS_TIME);
        let metadata = Metadata {
            gps_time: metadata.gps_time.or((!is_timed).then_some(GpsTime::Week)),
            pipeline: metadata.pipeline.clone(),
            note: metadata.note.clone(),
            ..fresh(&own, metadata.crs.as_deref())
        };
        Ok(Target { schema: own, metadata, projection })
    }
}

/// Points of which nothing is known of returns are the first and only one of their pulse: LAS has
/// no return 0 of 0.
fn number_returns(
    from: &Schema,
    to: &Schema,
    drop: &[String],
    projection: &mut Projection,
) -> Result<()> {
    let both = [names::RETURN_NUMBER, names::NUMBER_OF_RETURNS];
    if both.iter().any(|name| from.find(name).is_some() && !drop.iter().any(|d| d == name)) {
        return Ok(());
    }
    for field in both.iter().filter_map(|name| to.find(name)) {
        if !projection.preset(field, 1) {
            return Err(Error::internal("a number of returns does not hold 1"));
        }
    }
    Ok(())
}
