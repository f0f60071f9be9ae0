//! The point data record formats 0 to 10 (LAS 1.4 R15, section 2.6) as schemas.

use std::collections::{BTreeMap, BTreeSet};

use super::extra::Descriptor;
use super::laz::Layers;
use crate::point::{Dimension, Endian, Layout, Scalar, Schema, names};
use crate::{Error, Result};

/// Bytes of a record of `format` without extra bytes; None for formats that do not exist.
pub fn record_size(format: u8) -> Option<u16> {
    const SIZES: [u16; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];
    SIZES.get(usize::from(format)).copied()
}

/// True if records of `format` have a GPS time.
pub fn has_gps_time(format: u8) -> bool {
    !matches!(format, 0 | 2)
}

/// True if records of `format` refer to waveform packets.
pub fn has_waveforms(format: u8) -> bool {
    matches!(format, 4 | 5 | 9 | 10)
}

/// The family of LAS records.
pub const FAMILY: &str = "LAS";

/// The class of overlap in point formats 0 to 5, which have no flag for it (LAS 1.4 R15, table 9).
const OVERLAP_CLASS: u8 = 12;

/// LAS point records of `format` (0 to 10), extra bytes behind them.
pub const fn records(format: u8) -> Layout {
    Layout { family: FAMILY, form: Some(format), steps: true, overlap_class: Some(OVERLAP_CLASS) }
}

/// The point format of records of `schema`; None for those of other families.
pub fn format_of(schema: &Schema) -> Option<u8> {
    schema.layout.form.filter(|_| schema.layout.family == FAMILY)
}

/// The schema of records of `format` (0 to 10) with extra dimensions in this order behind it.
/// Coordinates are i32 with `scale` and `offset`.
pub fn layout(format: u8, extra: &[(String, Scalar)], scale: [f64; 3], offset: [f64; 3]) -> Schema {
    let descriptors: Vec<Descriptor> =
        extra.iter().map(|(name, scalar)| Descriptor::plain(name, *scalar)).collect();
    let length = extra.iter().map(|(_, scalar)| scalar.size()).sum();
    schema(format, &descriptors, length, scale, offset)
}

/// The schema of records of `format` with `extra` bytes behind it, named by `descriptors`; bytes
/// without one become dimensions of their own.
pub fn schema(
    format: u8,
    descriptors: &[Descriptor],
    extra: usize,
    scale: [f64; 3],
    offset: [f64; 3],
) -> Schema {
    let mut dimensions = standard(format, scale, offset);
    let base = usize::from(record_size(format).unwrap_or(0));
    let mut taken: BTreeSet<String> = dimensions.iter().map(|d| d.name.clone()).collect();
    // Hundreds of descriptors may want one name: numbers that were taken are not tried again.
    let mut copies: BTreeMap<String, u32> = BTreeMap::new();
    let mut add = |mut dimension: Dimension, dimensions: &mut Vec<Dimension>| {
        let wanted = std::mem::take(&mut dimension.name);
        let mut name = wanted.clone();
        if taken.contains(&name) {
            let copy = copies.entry(wanted.clone()).or_insert(1);
            while taken.contains(&name) {
                *copy += 1;
                name = format!("{wanted}_{copy}");
            }
        }
        taken.insert(name.clone());
        dimension.name = name;
        dimensions.push(dimension);
    };
    let mut at = 0;
    for descriptor in descriptors {
        if at + descriptor.size() > extra {
            break;
        }
        for dimension in descriptor.dimensions(base + at) {
            add(dimension, &mut dimensions);
        }
        at += descriptor.size();
    }
    for (i, byte) in (at..extra).enumerate() {
        let name =
            if extra - at == 1 { "ExtraBytes".to_owned() } else { format!("ExtraBytes[{i}]") };
        add(Dimension::new(name, Scalar::U8, base + byte), &mut dimensions);
    }
    Schema { layout: records(format), endian: Endian::Little, stride: base + extra, dimensions }
}

/// The schema of records like those of `from` in another point format: its fields, and the extra
/// bytes of `from` behind them.
///
/// # Errors
///
/// Extra bytes that have the name of one of its fields.
pub fn reformed(from: &Schema, format: u8) -> Result<Schema> {
    let [scale, offset] = match from.coordinates() {
        Some(axes) => [axes.map(|d| d.scale), axes.map(|d| d.origin)],
        None => [[1.0; 3], [0.0; 3]],
    };
    let own = format_of(from).and_then(record_size).unwrap_or(0);
    let (own, base) = (usize::from(own), usize::from(record_size(format).unwrap_or(0)));
    let mut dimensions = standard(format, scale, offset);
    for dimension in from.dimensions.iter().filter(|d| d.offset >= own) {
        if dimensions.iter().any(|field| field.name == dimension.name) {
            let name = &dimension.name;
            let told = format!("the extra bytes `{name}` have the name of a field of LAS point");
            return Err(Error::pipeline(format!("{told} format {format}"))
                .help("write another point format, or convert by way of PLY"));
        }
        let offset = dimension.offset - own + base;
        dimensions.push(Dimension { offset, ..dimension.clone() });
    }
    let stride = from.stride.saturating_sub(own) + base;
    Ok(Schema { layout: records(format), endian: Endian::Little, stride, dimensions })
}

/// The layers of compressed records of `schema` that are to be decoded if nobody looks at the
/// dimensions `unread`: a layer is left out if it holds no others.
pub fn selection(schema: &Schema, unread: &[String]) -> Layers {
    const FLAGS: [&str; 6] = [
        names::SYNTHETIC,
        names::KEY_POINT,
        names::WITHHELD,
        names::OVERLAP,
        names::SCAN_DIRECTION_FLAG,
        names::EDGE_OF_FLIGHT_LINE,
    ];
    let Some(format) = format_of(schema) else { return Layers::ALL };
    if unread.is_empty() {
        return Layers::ALL;
    }
    let base = usize::from(record_size(format).unwrap_or(0));
    let layer = |dimension: &Dimension| match dimension.name.as_str() {
        _ if dimension.offset >= base => Layers::EXTRA,
        names::CLASSIFICATION => Layers::CLASS,
        names::INTENSITY => Layers::INTENSITY,
        names::SCAN_ANGLE => Layers::ANGLE,
        names::USER_DATA => Layers::USER,
        names::POINT_SOURCE_ID => Layers::SOURCE,
        names::GPS_TIME => Layers::TIME,
        names::RED | names::GREEN | names::BLUE => Layers::RGB,
        names::NIR => Layers::NIR,
        name if FLAGS.contains(&name) => Layers::FLAGS,
        name if name.starts_with("Wave") => Layers::WAVES,
        // Coordinates and what is coded with them.
        _ => Layers::Z,
    };
    let read = schema.dimensions.iter().filter(|d| !unread.contains(&d.name));
    read.fold(Layers::Z, |all, dimension| all.and(layer(dimension)))
}

/// The fields that the specification gives a format.
fn standard(format: u8, scale: [f64; 3], offset: [f64; 3]) -> Vec<Dimension> {
    let mut all: Vec<Dimension> = (0..3)
        .map(|axis| {
            Dimension::new(names::XYZ[axis], Scalar::I32, 4 * axis)
                .scaled(scale[axis], offset[axis])
        })
        .collect();
    all.push(Dimension::new(names::INTENSITY, Scalar::U16, 12));
    let bits = |name, at, shift, width| Dimension::new(name, Scalar::U8, at).bits(shift, width);
    if format < 6 {
        all.extend([
            bits(names::RETURN_NUMBER, 14, 0, 3),
            bits(names::NUMBER_OF_RETURNS, 14, 3, 3),
            bits(names::SCAN_DIRECTION_FLAG, 14, 6, 1),
            bits(names::EDGE_OF_FLIGHT_LINE, 14, 7, 1),
            bits(names::CLASSIFICATION, 15, 0, 5),
            bits(names::SYNTHETIC, 15, 5, 1),
            bits(names::KEY_POINT, 15, 6, 1),
            bits(names::WITHHELD, 15, 7, 1),
            Dimension::new(names::SCAN_ANGLE, Scalar::I8, 16),
            Dimension::new(names::USER_DATA, Scalar::U8, 17),
            Dimension::new(names::POINT_SOURCE_ID, Scalar::U16, 18),
        ]);
    } else {
        all.extend([
            bits(names::RETURN_NUMBER, 14, 0, 4),
            bits(names::NUMBER_OF_RETURNS, 14, 4, 4),
            bits(names::SYNTHETIC, 15, 0, 1),
            bits(names::KEY_POINT, 15, 1, 1),
            bits(names::WITHHELD, 15, 2, 1),
            bits(names::OVERLAP, 15, 3, 1),
            bits(names::SCANNER_CHANNEL, 15, 4, 2),
            bits(names::SCAN_DIRECTION_FLAG, 15, 6, 1),
            bits(names::EDGE_OF_FLIGHT_LINE, 15, 7, 1),
            Dimension::new(names::CLASSIFICATION, Scalar::U8, 16),
            Dimension::new(names::USER_DATA, Scalar::U8, 17),
            Dimension::new(names::SCAN_ANGLE, Scalar::I16, 18).scaled(0.006, 0.0),
            Dimension::new(names::POINT_SOURCE_ID, Scalar::U16, 20),
        ]);
    }
    optional(format, &mut all);
    all
}

/// GPS time, colours and waveform packets.
fn optional(format: u8, all: &mut Vec<Dimension>) {
    let mut at = if format < 6 { 20 } else { 22 };
    let mut push = |name: &str, scalar: Scalar| {
        all.push(Dimension::new(name, scalar, at));
        at += scalar.size();
    };
    if has_gps_time(format) {
        push(names::GPS_TIME, Scalar::F64);
    }
    if matches!(format, 2 | 3 | 5 | 7 | 8 | 10) {
        push(names::RED, Scalar::U16);
        push(names::GREEN, Scalar::U16);
        push(names::BLUE, Scalar::U16);
    }
    if matches!(format, 8 | 10) {
        push(names::NIR, Scalar::U16);
    }
    if has_waveforms(format) {
        push(names::WAVE_DESCRIPTOR, Scalar::U8);
        push(names::WAVE_OFFSET, Scalar::U64);
        push(names::WAVE_SIZE, Scalar::U32);
        push(names::WAVE_RETURN, Scalar::F32);
        for direction in names::WAVE_DIRECTION {
            push(direction, Scalar::F32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fields_of_every_format_end_where_its_record_does() {
        for format in 0..=10 {
            let schema = layout(format, &[], [0.01; 3], [0.0; 3]);
            let end = schema.dimensions.iter().map(|d| d.offset + d.scalar.size()).max();
            assert_eq!(end, Some(schema.stride), "format {format}");
            assert_eq!(record_size(format).map(usize::from), Some(schema.stride));
        }
        assert_eq!(record_size(11), None);
    }

    #[test]
    fn undescribed_bytes_and_name_clashes_keep_every_byte_reachable() {
        let described =
            [Descriptor::plain("Intensity", Scalar::U16), Descriptor::plain("", Scalar::U8)];
        let schema = schema(0, &described, 6, [1.0; 3], [0.0; 3]);
        let extra: Vec<_> = schema.dimensions[15..].iter().map(|d| d.name.as_str()).collect();
        assert_eq!(
            extra,
            ["Intensity_2", "ExtraBytes", "ExtraBytes[0]", "ExtraBytes[1]", "ExtraBytes[2]"]
        );
        assert_eq!(schema.dimensions.last().map(|d| d.offset), Some(25));
    }

    #[test]
    fn descriptors_beyond_the_record_are_cut_off() {
        let schema = schema(0, &[Descriptor::plain("Big", Scalar::F64)], 3, [1.0; 3], [0.0; 3]);
        assert!(schema.find("Big").is_none());
        assert_eq!(schema.stride, 23);
        assert!(schema.find("ExtraBytes[2]").is_some());
    }
}
