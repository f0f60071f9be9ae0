//! From checked keys to the code that reads and writes formats.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::kinds::{Encoding, Format, Write};
use crate::error::shown;
use crate::io::{Projected, convert, las, ply};
use crate::point::{GpsTime, Layout, Metadata, PointBatch, Schema, names};
use crate::stage::{ChunkSize, CreateSink, OpenSource, Order, Sink, Source};
use crate::{Error, Result};

/// The source that reads `files`, each of its format; all LAS and LAZ, or all PLY.
pub fn read(files: Vec<PathBuf>, formats: &[Format]) -> Box<dyn OpenSource> {
    Box::new(Files { ply: formats.first() == Some(&Format::Ply), files })
}

struct Files {
    files: Vec<PathBuf>,
    ply: bool,
}

impl OpenSource for Files {
    fn open(&self) -> Result<Box<dyn Source>> {
        if self.ply { ply::open(&self.files) } else { las::open(&self.files) }
    }

    fn paths(&self) -> Vec<PathBuf> {
        self.files.clone()
    }
}

/// So many lost records are named in a warning.
const NAMED: usize = 8;

/// The sink that writes a file of one format.
pub struct Output {
    /// The keys.
    pub write: Write,
    /// The file.
    pub path: PathBuf,
    /// Its format.
    pub format: Format,
    /// True for the output of one of several inputs: records take the form that they have there.
    pub of_one: bool,
}

impl CreateSink for Output {
    fn path(&self) -> &Path {
        &self.path
    }

    fn order(&self) -> Order {
        self.write.stage_order()
    }

    fn likes_time(&self) -> bool {
        self.format == Format::Laz && self.order() == Order::Auto
    }

    fn wants_beside(&self) -> bool {
        self.format != Format::Ply
    }

    fn wants_normals(&self) -> bool {
        !self.write.dimensions.is_empty()
    }

    fn unread(&self) -> &[String] {
        if self.format == Format::Ply { &self.write.drop } else { &[] }
    }

    fn chunk(&self, schema: &Arc<Schema>, metadata: &Metadata) -> Result<ChunkSize> {
        let chunk = match self.format {
            Format::Ply => ply::chunk(&self.ply_options(false), schema, metadata),
            Format::Las | Format::Laz => self.las_target(schema, metadata).and_then(|target| {
                let chunk = las::chunk(&self.las_options(), &target.schema)?;
                Ok(match target.projection {
                    Some(_) => Projected::chunk(chunk, &target.schema),
                    None => chunk,
                })
            }),
        };
        let chunk = chunk.map_err(|error| error.at(&self.path))?;
        Ok(if self.of_one { las::Shifted::chunk(chunk, schema) } else { chunk })
    }

    fn disk_bytes(&self, schema: &Arc<Schema>, metadata: &Metadata) -> Result<[u64; 2]> {
        match self.format {
            Format::Ply => ply::disk_bytes(&self.ply_options(false), schema, metadata),
            Format::Las => Ok([self.las_target(schema, metadata)?.schema.stride as u64, 0]),
            Format::Laz => Ok([0; 2]),
        }
    }

    fn warnings(&self, schema: &Schema, metadata: &Metadata) -> Vec<String> {
        let misnamed = self.misnamed();
        if self.format != Format::Ply || schema.layout == Layout::Ply {
            return misnamed.into_iter().collect();
        }
        let lost = las::records_beside(metadata);
        let records = (!lost.is_empty()).then(|| {
            let named = match &lost[..] {
                [first @ .., _] if first.len() >= NAMED => {
                    format!("{} and {} more", lost[..NAMED].join(", "), lost.len() - NAMED)
                }
                all => all.join(", "),
            };
            format!("variable length records of LAS; these are lost: {named}")
        });
        let waveforms = las::waveforms_of(metadata)
            .map(|file| format!("waveforms of LAS; these are lost: those in {}", shown(&file)));
        let told = |lost| format!("{}: PLY does not hold {lost}", shown(&self.path));
        misnamed.into_iter().chain(records.into_iter().chain(waveforms).map(told)).collect()
    }

    fn checks(&self, schema: &Schema) -> bool {
        let Write { scale, offset, .. } = &self.write;
        let converts = schema.layout == Layout::Ply || scale.is_some() || offset.is_some();
        self.format != Format::Ply && converts
    }

    fn check(&self, metadata: &Metadata, records: &PointBatch) -> Result<()> {
        if let Some(projection) = self.las_target(records.schema(), metadata)?.projection {
            projection.project(records.records(), &mut Vec::new())?;
        }
        Ok(())
    }

    fn create(
        &self,
        staged: &Path,
        schema: &Arc<Schema>,
        metadata: &Metadata,
        whole: bool,
    ) -> Result<Box<dyn Sink>> {
        self.open(staged, schema, metadata, whole).map_err(|error| {
            if error.path() == Some(staged) { error } else { error.at(&self.path) }
        })
    }
}

/// What a LAS output's records are, and how the input's become them.
struct Target {
    schema: Arc<Schema>,
    metadata: Metadata,
    projection: Option<convert::Projection>,
}

impl Output {
    fn open(
        &self,
        staged: &Path,
        schema: &Arc<Schema>,
        metadata: &Metadata,
        whole: bool,
    ) -> Result<Box<dyn Sink>> {
        let open = |schema: &Arc<Schema>| match self.format {
            Format::Ply => ply::create(staged, &self.ply_options(whole), schema, metadata),
            Format::Las | Format::Laz => self.las(staged, schema, metadata),
        };
        let own = if self.of_one { las::own_form(schema, metadata)? } else { None };
        Ok(match own {
            Some(own) => Box::new(las::Shifted::new(staged, open(&own.0)?, own)),
            None => open(schema)?,
        })
    }

    /// Says that the name is that of another format.
    fn misnamed(&self) -> Option<String> {
        let named = Format::of(&self.path).filter(|named| !self.of_one && *named != self.format)?;
        let [named, is] = [named, self.format].map(|format| format.extension().to_uppercase());
        Some(format!(
            "{}: this is named as {named} and becomes {is}, as `write.format` says: programs that go by \
             names will not read it",
            shown(&self.path)
        ))
    }

    fn ply_options(&self, whole: bool) -> ply::PlyOptions {
        let encoding = self.write.encoding.map(|encoding| match encoding {
            Encoding::Ascii => ply::Encoding::Ascii,
            Encoding::Binary => ply::Encoding::BinaryLittleEndian,
        });
        ply::PlyOptions {
            encoding,
            normals: self.wants_normals(),
            drop: self.write.drop.clone(),
            colors: self.write.colors,
            carry_rest: whole,
        }
    }

    fn las_options(&self) -> las::LasOptions {
        las::LasOptions { compressed: self.format == Format::Laz, normals: self.wants_normals() }
    }

    fn las(
        &self,
        staged: &Path,
        schema: &Arc<Schema>,
        metadata: &Metadata,
    ) -> Result<Box<dyn Sink>> {
        let Target { schema, metadata, projection } = self.las_target(schema, metadata)?;
        let sink = las::create(staged, &self.las_options(), &schema, &metadata)?;
        Ok(match projection {
            Some(projection) => Box::new(Projected::new(sink, projection, schema, &self.path)),
            None => sink,
        })
    }

    fn las_target(&self, schema: &Arc<Schema>, metadata: &Metadata) -> Result<Target> {
        match schema.layout {
            Layout::Las { .. } => self.las_of_las(schema, metadata),
            Layout::Ply => self.las_of_ply(schema, metadata),
        }
    }

    /// LAS records stay as they are, unless another scale is asked for.
    fn las_of_las(&self, schema: &Arc<Schema>, metadata: &Metadata) -> Result<Target> {
        if !self.write.drop.is_empty() {
            return Err(Error::pipeline("`write.drop` is for conversions between LAS and PLY")
                .help(
                    "a LAS output holds every dimension of a LAS input: leave `write.drop` out",
                ));
        }
        let mut scaled = (**schema).clone();
        for (axis, name) in names::XYZ.into_iter().enumerate() {
            if let Some(dimension) = scaled.dimensions.iter_mut().find(|d| d.name == name) {
                dimension.scale = self.write.scale.map_or(dimension.scale, |scale| scale[axis]);
                dimension.origin =
                    self.write.offset.map_or(dimension.origin, |offset| offset[axis]);
            }
        }
        let metadata = metadata.clone();
        if scaled == **schema {
            return Ok(Target { schema: schema.clone(), metadata, projection: None });
        }
        let projection = Some(convert::Projection::new(schema, &scaled, &[])?);
        Ok(Target { schema: Arc::new(scaled), metadata, projection })
    }

    fn las_of_ply(&self, schema: &Schema, metadata: &Metadata) -> Result<Target> {
        let scale = self.write.scale.ok_or_else(|| {
            Error::pipeline("a PLY scan written as LAS needs a scale for its coordinates").help(
                "give `write.scale = 0.001`, or what the scan's precision is, in its own unit",
            )
        })?;
        let (format, extra) = convert::las_schema(schema, &self.write.drop)?;
        let offset = self.write.offset.unwrap_or([0.0; 3]);
        let layout = Arc::new(las::layout(format, &extra, scale, offset));
        let mut projection = convert::Projection::new(schema, &layout, &self.write.drop)?;
        number_returns(schema, &layout, &self.write.drop, &mut projection)?;
        let projection = Some(projection);
        // Times that are all 0, since the input has none, count nothing that were to be told.
        let is_timed = schema.find(names::GPS_TIME).is_some();
        let is_timed = is_timed && !self.write.drop.iter().any(|name| name == names::GPS_TIME);
        let metadata = Metadata {
            gps_time: metadata.gps_time.or((!is_timed).then_some(GpsTime::Week)),
            pipeline: metadata.pipeline.clone(),
            ..las::fresh(&layout, metadata.crs.as_deref())
        };
        Ok(Target { schema: layout, metadata, projection })
    }
}

/// Points of which nothing is known of returns are the first and only one of their pulse: LAS has no
/// return 0 of 0.
fn number_returns(
    from: &Schema,
    to: &Schema,
    drop: &[String],
    projection: &mut convert::Projection,
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
