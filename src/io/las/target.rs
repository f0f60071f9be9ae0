//! What the records of a LAS output are, and how those of the input become them.

use std::sync::Arc;

use super::described::describe;
use super::format::{FAMILY, format_of, layout, reformed};
use super::holding::las_schema;
use super::native::{Native, fresh};
use super::reshaped::{refuse_types, reshaped};
use crate::io::convert::{AskedValues, Projection};
use crate::point::{GpsTime, Metadata, Schema, Value, names};
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
            FAMILY if reshapes(keys) => Target::of_reshaped(keys, format, schema, metadata),
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
        let mut target = match format {
            Some(format) => reformed(schema, format)?,
            None => (**schema).clone(),
        };
        place(keys, &mut target);
        let mut metadata = metadata.clone();
        if target == **schema {
            return Ok(Target { schema: schema.clone(), metadata, projection: None });
        }
        let native = metadata.native.as_ref().and_then(|native| native.downcast_ref::<Native>());
        if let Some(native) = native.filter(|native| format.is_some() && native.fits(schema)) {
            metadata.native = Some(Arc::new(native.clone().reformed(&target)));
        }
        let projection = Some(Projection::new(schema, &target, &[])?);
        Ok(Target { schema: Arc::new(target), metadata, projection })
    }

    /// LAS records of which dimensions have other names or types, or are left out.
    fn of_reshaped(
        keys: &WriteKeys,
        format: Option<u8>,
        schema: &Arc<Schema>,
        metadata: &Metadata,
    ) -> Result<Target> {
        let native = metadata.native.as_ref().and_then(|native| native.downcast_ref::<Native>());
        let native = native.filter(|native| native.fits(schema));
        let format = format.or(format_of(schema)).unwrap_or(0);
        let (mut target, descriptors) = reshaped(keys, format, schema, native)?;
        place(keys, &mut target);
        let projection = Projection::asked(schema, &target, &AskedValues::of(keys))?;
        let mut metadata = metadata.clone();
        if let Some(native) = native {
            let mut native = native.clone().reformed(&target);
            describe(&mut native.vlrs, &mut native.evlrs, &descriptors);
            metadata.native = Some(Arc::new(native));
        }
        let projection = Some(projection);
        Ok(Target { schema: Arc::new(target), metadata, projection })
    }

    fn of_others(
        keys: &WriteKeys,
        format: Option<u8>,
        schema: &Schema,
        metadata: &Metadata,
    ) -> Result<Target> {
        let scale = keys.given_scale().ok_or_else(|| {
            let told = format!(
                "a {} scan written as LAS needs a scale for its coordinates",
                schema.layout.family
            );
            Error::pipeline(told).help(
                "give `write.scale = \"auto\"`, which looks for the decimals of the points, or \
                 what the scan's precision is, in its own unit, such as `write.scale = 0.001`",
            )
        })?;
        let (smallest, mut extra) = las_schema(schema, &keys.drop)?;
        let format = format.unwrap_or(smallest);
        refuse_types(keys, format)?;
        for (name, scalar) in &mut extra {
            *scalar = keys.type_of(name).unwrap_or(*scalar);
        }
        let offset = keys.given_offset().unwrap_or([0.0; 3]);
        let own = Arc::new(layout(format, &extra, scale, offset));
        let mut projection = Projection::asked(schema, &own, &AskedValues::of(keys))?;
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

/// True if an output of LAS records has other dimensions than these, or values of another meaning.
pub(super) fn reshapes(keys: &WriteKeys) -> bool {
    let has_names = !keys.drop.is_empty() || !keys.map.is_empty() || !keys.types.is_empty();
    has_names || keys.intensity.is_some()
}

/// Gives coordinates the scale and the offset that are given.
fn place(keys: &WriteKeys, target: &mut Schema) {
    let (scale, offset) = (keys.given_scale(), keys.given_offset());
    for (axis, name) in names::XYZ.into_iter().enumerate() {
        if let Some(dimension) = target.dimensions.iter_mut().find(|d| d.name == name) {
            dimension.scale = scale.map_or(dimension.scale, |scale| scale[axis]);
            dimension.origin = offset.map_or(dimension.origin, |offset| offset[axis]);
        }
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
        if !projection.preset(field, Value::Unsigned(1)) {
            return Err(Error::internal("a number of returns does not hold 1"));
        }
    }
    Ok(())
}
