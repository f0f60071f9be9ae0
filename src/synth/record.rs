//! The record that every scene makes: LAS point data record format 6 without extra bytes.

/// Point data record format (LAS 1.4 R15, table 12).
pub const FORMAT: u8 = 6;
/// Bytes of a record.
pub const STRIDE: usize = 30;

/// The fields of a record that a scene sets; the others are 0.
#[derive(Clone, Copy)]
pub struct SceneRecord {
    /// Stored X, Y, Z: world coordinates less the origin, in steps of the scale.
    pub position: [i32; 3],
    pub intensity: u16,
    pub return_number: u8,
    pub number_of_returns: u8,
    pub scan_direction: bool,
    pub edge_of_flight_line: bool,
    pub classification: u8,
    pub user_data: u8,
    /// In steps of 0.006°.
    pub scan_angle: i16,
    pub point_source_id: u16,
    /// Seconds of the GPS week.
    pub gps_time: f64,
}

impl SceneRecord {
    /// A single return at `position`, class 1 (unclassified), at `gps_time`.
    pub fn single(position: [i32; 3], gps_time: f64) -> Self {
        SceneRecord {
            position,
            intensity: 0,
            return_number: 1,
            number_of_returns: 1,
            scan_direction: false,
            edge_of_flight_line: false,
            classification: 1,
            user_data: 0,
            scan_angle: 0,
            point_source_id: 1,
            gps_time,
        }
    }

    /// Stores the record in `bytes`, which are [`STRIDE`] long.
    pub fn store(&self, bytes: &mut [u8]) {
        for (axis, stored) in self.position.iter().enumerate() {
            bytes[4 * axis..4 * axis + 4].copy_from_slice(&stored.to_le_bytes());
        }
        bytes[12..14].copy_from_slice(&self.intensity.to_le_bytes());
        bytes[14] = self.return_number | self.number_of_returns << 4;
        bytes[15] = u8::from(self.scan_direction) << 6 | u8::from(self.edge_of_flight_line) << 7;
        bytes[16] = self.classification;
        bytes[17] = self.user_data;
        bytes[18..20].copy_from_slice(&self.scan_angle.to_le_bytes());
        bytes[20..22].copy_from_slice(&self.point_source_id.to_le_bytes());
        bytes[22..30].copy_from_slice(&self.gps_time.to_le_bytes());
    }
}

/// The whole number nearest to `value`, ties to even, for |value| < 2^51. Adding and subtracting
/// 1.5 · 2^52 leaves no room for a fraction; unlike a call of `round` it costs two additions on
/// every machine.
pub fn nearest(value: f64) -> f64 {
    const NO_FRACTION: f64 = 6_755_399_441_055_744.0;
    (value + NO_FRACTION) - NO_FRACTION
}

/// `local` (world coordinates less the origin) in `per_unit` steps a unit.
pub fn stored(local: [f64; 3], per_unit: f64) -> [i32; 3] {
    local.map(|v| nearest(v * per_unit) as i32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::las;
    use crate::point::{Value, names};

    #[test]
    fn a_stored_record_reads_back_by_the_names_of_its_fields() {
        let schema = las::layout(FORMAT, &[], [0.001; 3], [350_000.0, 0.0, -5.0]);
        assert_eq!(schema.stride, STRIDE);
        let record = SceneRecord {
            position: [-1, 2_000, i32::MAX],
            intensity: 65_535,
            return_number: 2,
            number_of_returns: 3,
            scan_direction: true,
            edge_of_flight_line: true,
            classification: 6,
            user_data: 9,
            scan_angle: -3_000,
            point_source_id: 513,
            gps_time: 3.0e5,
        };
        let mut bytes = [0; STRIDE];
        record.store(&mut bytes);
        let read = |name| {
            let field = schema.find(name).unwrap();
            (field.get(&bytes, schema.endian), field.world(&bytes, schema.endian))
        };
        assert_eq!(read(names::XYZ[0]), (Value::Signed(-1), 349_999.999));
        assert_eq!(read(names::XYZ[1]).0, Value::Signed(2_000));
        assert_eq!(read(names::INTENSITY).0, Value::Unsigned(65_535));
        assert_eq!(read(names::RETURN_NUMBER).0, Value::Unsigned(2));
        assert_eq!(read(names::NUMBER_OF_RETURNS).0, Value::Unsigned(3));
        assert_eq!(read(names::SYNTHETIC).0, Value::Unsigned(0));
        assert_eq!(read(names::SCAN_DIRECTION_FLAG).0, Value::Unsigned(1));
        assert_eq!(read(names::EDGE_OF_FLIGHT_LINE).0, Value::Unsigned(1));
        assert_eq!(read(names::CLASSIFICATION).0, Value::Unsigned(6));
        assert_eq!(read(names::USER_DATA).0, Value::Unsigned(9));
        assert_eq!(read(names::SCAN_ANGLE).1, -18.0);
        assert_eq!(read(names::POINT_SOURCE_ID).0, Value::Unsigned(513));
        assert_eq!(read(names::GPS_TIME).0, Value::Double(3.0e5));
    }

    #[test]
    fn nearest_rounds_as_the_standard_says() {
        for v in [-2.5, -1.5, -0.5, -0.3, 0.0, 0.5, 1.5, 2.4999, 1e9 + 0.5, -7.000_000_1] {
            assert_eq!(nearest(v), v.round_ties_even(), "{v}");
        }
    }
}
