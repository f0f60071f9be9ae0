//! LAS records with other extra bytes than those that they come from: some left out, others under
//! another name or in another type.

use super::described::Described;
use super::extra::{Descriptor, LONGEST_NAME};
use super::format::{format_of, layout, record_size, records};
use super::native::Native;
use crate::point::names::XYZ;
use crate::point::{Dimension, Schema};
use crate::stage::WriteKeys;
use crate::{Error, Result};

/// The schema of records like those of `schema`, which are LAS under the names of the output, in
/// point format `format` and with the extra bytes that `keys` leave, and their descriptors: those
/// that `native` has, where they still hold.
///
/// # Errors
///
/// A field of the point format that is to be left out or to have another type, and names too long
/// for a descriptor.
pub(super) fn reshaped(
    keys: &WriteKeys,
    format: u8,
    schema: &Schema,
    native: Option<&Native>,
) -> Result<(Schema, Vec<Descriptor>)> {
    refuse_types(keys, format)?;
    let own_format = format_of(schema).unwrap_or(0);
    let own = usize::from(record_size(own_format).unwrap_or(0));
    let [scale, offset] = match schema.coordinates() {
        Some(axes) => [axes.map(|d| d.scale), axes.map(|d| d.origin)],
        None => [[1.0; 3], [0.0; 3]],
    };
    let fields = layout(format, &[], scale, offset);
    let own_fields = layout(own_format, &[], scale, offset);
    if format == own_format {
        refuse_fields(keys, schema, &fields)?;
    }
    // A field that the other point format lacks is no extra byte for that: it is refused or
    // dropped. Under another name it is one.
    let is_extra = |d: &&Dimension| {
        let is_left = !keys.drop.contains(&d.name) && fields.find(&d.name).is_none();
        is_left && (d.offset >= own || own_fields.find(&d.name).is_none())
    };
    let mut extras: Vec<&Dimension> = schema.dimensions.iter().filter(is_extra).collect();
    extras.sort_by_key(|d| d.offset);
    let known = match native {
        Some(native) => {
            Described::of(&native.vlrs, &native.evlrs, schema.stride - own)?.descriptors
        }
        None => Vec::new(),
    };
    let known = KnownDescriptors::of(&known, own);
    let mut target = Schema { layout: records(format), ..fields };
    let mut descriptors = Vec::new();
    let mut rest = &extras[..];
    while let Some(first) = rest.first() {
        let (count, descriptor) = match known.whole(rest, keys) {
            Some(whole) => whole,
            None => (1, known.single(first, keys)?),
        };
        for extra in &rest[..count] {
            let mut dimension = retyped(extra, keys);
            dimension.offset = target.stride;
            target.stride += dimension.scalar.size();
            target.dimensions.push(dimension);
        }
        descriptors.push(descriptor);
        rest = &rest[count..];
    }
    Ok((target, descriptors))
}

/// The dimension as the output has it: without the bits that it is of another field.
fn retyped(extra: &Dimension, keys: &WriteKeys) -> Dimension {
    match keys.type_of(&extra.name) {
        Some(scalar) => Dimension::new(&extra.name, scalar, 0),
        None => Dimension { bits: None, ..extra.clone() },
    }
}

/// The descriptors of the input, each with the byte of a record at which its first value begins.
struct KnownDescriptors<'a>(Vec<(usize, &'a Descriptor)>);

impl<'a> KnownDescriptors<'a> {
    fn of(all: &'a [Descriptor], own: usize) -> Self {
        let mut at = own;
        let placed = all.iter().map(|descriptor| {
            let start = at;
            at += descriptor.size();
            (start, descriptor)
        });
        KnownDescriptors(placed.collect())
    }

    fn at(&self, offset: usize) -> Option<&'a Descriptor> {
        self.0.iter().find(|(start, _)| *start == offset).map(|(_, descriptor)| *descriptor)
    }

    /// The descriptor of the first of `extras` and of as many as it describes, if all of these are
    /// there as they were.
    fn whole(&self, extras: &[&Dimension], keys: &WriteKeys) -> Option<(usize, Descriptor)> {
        let first = extras.first()?;
        let descriptor = self.at(first.offset)?;
        let described = descriptor.dimensions(first.offset);
        let are_there = extras.len() >= described.len()
            && described.iter().zip(extras).all(|(was, is)| {
                was.offset == is.offset
                    && was.name == is.name
                    && keys.type_of(&is.name).is_none_or(|scalar| scalar == is.scalar)
            });
        are_there.then(|| (described.len(), descriptor.clone()))
    }

    /// A descriptor for `extra` alone: its own under another name where only that changes.
    fn single(&self, extra: &Dimension, keys: &WriteKeys) -> Result<Descriptor> {
        if extra.name.len() > LONGEST_NAME {
            let told = format!(
                "LAS cannot name extra bytes `{}`: a name has at most {LONGEST_NAME} bytes",
                extra.name
            );
            return Err(Error::pipeline(told).help("`write.map` gives it a shorter one"));
        }
        let is_typed = keys.type_of(&extra.name).is_some_and(|scalar| scalar != extra.scalar);
        let own = self.at(extra.offset).filter(|own| own.dimensions(extra.offset).len() == 1);
        Ok(match own.filter(|_| !is_typed) {
            Some(own) => own.named(&extra.name),
            None => Descriptor::of(&retyped(extra, keys)),
        })
    }
}

/// Refuses types of fields that every record of the point format has.
pub(super) fn refuse_types(keys: &WriteKeys, format: u8) -> Result<()> {
    let fields = layout(format, &[], [1.0; 3], [0.0; 3]);
    let fixed = keys.types.iter().find(|retyped| {
        fields.find(&retyped.name).is_some_and(|field| field.scalar != retyped.scalar)
    });
    let Some(retyped) = fixed else { return Ok(()) };
    let told = format!(
        "`write.types` has `{retyped}`, and LAS point format {format} has a type for it that is \
         always the same"
    );
    let name = &retyped.name;
    if XYZ.contains(&name.as_str()) {
        return Err(Error::pipeline(told)
            .help("LAS has coordinates in whole steps: `write.scale` says how long one is"));
    }
    Err(Error::pipeline(told).help(format!(
        "`write.map = [\"{name}={name}2\"]` with `write.types = [\"{name}2={}\"]` has it as extra \
         bytes",
        retyped.to_string().rsplit('=').next().unwrap_or_default()
    )))
}

/// Refuses to leave out what every record of the point format has.
fn refuse_fields(keys: &WriteKeys, schema: &Schema, fields: &Schema) -> Result<()> {
    let is_field = |name: &&String| fields.find(name).is_some() && schema.find(name).is_some();
    let Some(field) = keys.drop.iter().find(is_field) else { return Ok(()) };
    let told = format!(
        "`write.drop` names `{field}`, which every record of LAS point format {} has",
        format_of(fields).unwrap_or(0)
    );
    let error = Error::pipeline(told);
    if XYZ.contains(&field.as_str()) {
        return Err(error.help("coordinates stay: leave it out"));
    }
    let without = |format: &u8| layout(*format, &[], [1.0; 3], [0.0; 3]).find(field).is_none();
    Err(error.help(match (0..=10).find(without) {
        Some(format) => format!(
            "`write.point_format = {format}` does not have it; extra bytes can be left out of any"
        ),
        None => "all point formats have it; extra bytes can be left out".to_owned(),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::point::{Scalar, names};

    fn keys(drop: &[&str], types: &[&str]) -> WriteKeys {
        WriteKeys {
            drop: drop.iter().map(|&name| name.to_owned()).collect(),
            types: types.iter().map(|text| text.parse().unwrap()).collect(),
            ..WriteKeys::default()
        }
    }

    fn named(schema: &Schema) -> Vec<(&str, usize)> {
        let extras = schema.dimensions.iter().filter(|d| d.offset >= 20);
        extras.map(|d| (d.name.as_str(), d.offset)).collect()
    }

    #[test]
    fn extra_bytes_close_up_where_one_is_left_out() {
        let extra = [("A", Scalar::U8), ("B", Scalar::F32), ("C", Scalar::U16)];
        let extra = extra.map(|(name, scalar)| (name.to_owned(), scalar));
        let schema = layout(0, &extra, [0.01; 3], [0.0; 3]);
        let (target, descriptors) = reshaped(&keys(&["B"], &["C=f64"]), 0, &schema, None).unwrap();
        assert_eq!((named(&target), target.stride), (vec![("A", 20), ("C", 21)], 29));
        let names: Vec<String> = descriptors.iter().map(Descriptor::name).collect();
        assert_eq!(names, ["A", "C"]);
        assert_eq!(target.find("C").unwrap().scalar, Scalar::F64);
    }

    #[test]
    fn fields_of_the_point_format_stay() {
        let schema = layout(1, &[], [0.01; 3], [0.0; 3]);
        for keys in [keys(&[names::GPS_TIME], &[]), keys(&[], &["GpsTime=f32"])] {
            let told = reshaped(&keys, 1, &schema, None).unwrap_err().to_string();
            assert!(told.contains("GpsTime") && told.contains("point format 1"), "{told}");
        }
        assert!(reshaped(&keys(&[names::GPS_TIME], &[]), 0, &schema, None).is_ok());
    }
}
