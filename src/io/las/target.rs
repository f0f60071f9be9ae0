//! What the records of a LAS output are, and how those of the input become them.

use std::sync::Arc;

use super::format::{FAMILY, layout, reformed};
use super::holding::las_schema;
use super::native::{Native, fresh};
use crate::io::convert::Projection;
use crate::point::{GpsTime, Metadata, Schema, names};
use crate::stage::WriteKeys;
use crate::{Error, Result};

/// The records of an output.
pub(super) struct Target {
    pub schema: Arc<Schema>,
    pub metadata: Metadata,
    pub projection: Option<Projection>,
}

impl Target {
    /// Of records of `schema`, as the keys want it; in point format `format` if that is another.
    pub fn of(
        keys: &WriteKeys,
        format: Option<u8>,
        schema: &Arc<Schema>,
        metadata: &Metadata,
    ) -> Result<Target> {
        match schema.layout.family {
            FAMILY => Target::of_las(keys, format, schema, metadata),
            _ => Target::of_others(keys, format, schema, metadata),
        }
    }

    /// LAS records stay as they are, unless another scale or point format is asked for.
    fn of_las(
        keys: &WriteKeys,
        format: Option<u8>,
        schema: &Arc<Schema>,
        metadata: &Metadata,
    ) -> Result<Target> {
        if !keys.drop.is_empty() && format.is_none() {
            let told = "`write.drop` is for conversions to another format or point format";
            return Err(Error::pipeline(told).help(
                "a LAS output holds every dimension of a LAS input: leave `write.drop` out",
            ));
        }
        let mut target = match format {
            Some(format) => reformed(schema, format)?,
            None => (**schema).clone(),
        };
        for (axis, name) in names::XYZ.into_iter().enumerate() {
            if let Some(dimension) = target.dimensions.iter_mut().find(|d| d.name == name) {
                dimension.scale = keys.scale.map_or(dimension.scale, |scale| scale[axis]);
                dimension.origin = keys.offset.map_or(dimension.origin, |offset| offset[axis]);
            }
        }
        let mut metadata = metadata.clone();
        if target == **schema {
            return Ok(Target { schema: schema.clone(), metadata, projection: None });
        }
        let native = metadata.native.as_ref().and_then(|native| native.downcast_ref::<Native>());
        if let Some(native) = native.filter(|native| format.is_some() && native.fits(schema)) {
            metadata.native = Some(Arc::new(native.clone().reformed(&target)));
        }
        let projection = Some(Projection::new(schema, &target, &keys.drop)?);
        Ok(Target { schema: Arc::new(target), metadata, projection })
    }

    fn of_others(
        keys: &WriteKeys,
        format: Option<u8>,
        schema: &Schema,
        metadata: &Metadata,
    ) -> Result<Target> {
        let scale = keys.scale.ok_or_else(|| {
            let told = format!(
                "a {} scan written as LAS needs a scale for its coordinates",
                schema.layout.family
            );
            Error::pipeline(told).help(
                "give `write.scale = 0.001`, or what the scan's precision is, in its own unit",
            )
        })?;
        let (smallest, extra) = las_schema(schema, &keys.drop)?;
        let format = format.unwrap_or(smallest);
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
