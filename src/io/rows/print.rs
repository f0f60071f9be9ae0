//! How the fields of rows are printed.
//!
//! Coordinates of whole steps are printed from the steps, as whole numbers with a point between two
//! digits: 57 steps of 0.01 are 0.57, where 57 · 0.01 in floating point is 0.5700000000000001.

use super::number;
use crate::point::names::XYZ;
use crate::point::{Dimension, Endian, Value};

/// How texts are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TextStyle {
    /// What stands between two numbers.
    pub separator: u8,
    /// Decimals of coordinates; None: as many as it takes to read them back equal.
    pub decimals: Option<u8>,
}

impl TextStyle {
    /// Blanks between numbers that read back equal.
    pub const BLANKS: TextStyle = TextStyle { separator: b' ', decimals: None };

    /// How a field is printed.
    pub fn printer(&self, field: &Dimension) -> Printer {
        let is_axis = XYZ.contains(&field.name.as_str());
        let way = match self.decimals.filter(|_| is_axis) {
            Some(decimals) => Way::Rounded { decimals: usize::from(decimals) },
            None if field.scalar.is_float() || !is_scaled(field) => Way::Stored,
            None => Way::steps(field).unwrap_or(Way::World),
        };
        Printer { field: field.clone(), way }
    }
}

fn is_scaled(field: &Dimension) -> bool {
    field.scale != 1.0 || field.origin != 0.0
}

/// Prints one field of rows.
pub(crate) struct Printer {
    field: Dimension,
    way: Way,
}

enum Way {
    /// The stored number.
    Stored,
    /// (stored · `factor` + `shift`) units of the last of so many decimals.
    Steps { factor: i128, shift: i128, decimals: u32 },
    /// The world value, as it is in floating point.
    World,
    /// The world value with so many decimals.
    Rounded { decimals: usize },
}

/// The most decimals of a scale or offset that is taken for a decimal number.
const DECIMALS_MOST: u32 = 12;

impl Way {
    /// The steps of a scaled field, if its scale and offset are decimal numbers.
    fn steps(field: &Dimension) -> Option<Way> {
        (0..=DECIMALS_MOST).find_map(|decimals| {
            let units = |value: f64| {
                let unit = 10f64.powi(decimals as i32);
                let units = (value * unit).round();
                (units.abs() < 1e15 && units / unit == value).then_some(units as i128)
            };
            let (factor, shift) = (units(field.scale)?, units(field.origin)?);
            Some(Way::Steps { factor, shift, decimals })
        })
    }
}

impl Printer {
    /// The longest text of the field, what separates it from the next included.
    pub fn longest(&self) -> usize {
        match self.way {
            Way::Stored => number::longest(self.field.scalar),
            // Of 64 bits times a factor below 1e15, in decimal, with sign and point.
            Way::Steps { .. } => 40,
            Way::World => number::longest(crate::point::Scalar::F64),
            // A number of f64 has 309 digits before the point at most.
            Way::Rounded { decimals } => 312 + decimals,
        }
    }

    /// Appends the field of a little-endian row; returns by how much a coordinate was rounded.
    pub fn print(&self, row: &[u8], out: &mut Vec<u8>) -> f64 {
        let stored = self.field.get(row, Endian::Little);
        match self.way {
            Way::Stored => number::print(stored, out),
            Way::Steps { factor, shift, decimals } => {
                let stored = match stored {
                    Value::Unsigned(v) => i128::from(v),
                    Value::Signed(v) => i128::from(v),
                    Value::Single(_) | Value::Double(_) => 0, // steps are whole numbers
                };
                number::print_decimal(stored * factor + shift, decimals, out);
            }
            Way::World => {
                let world = self.field.world(row, Endian::Little);
                number::print(Value::Double(world), out);
            }
            Way::Rounded { decimals } => {
                let world = self.field.world(row, Endian::Little);
                return number::print_rounded(world, decimals, out);
            }
        }
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::point::Scalar;

    fn printed(style: TextStyle, field: &Dimension, value: Value) -> (String, f64) {
        let (mut row, mut out) = ([0; 8], Vec::new());
        assert!(field.put(&mut row, Endian::Little, value));
        let printer = style.printer(field);
        let rounded = printer.print(&row, &mut out);
        assert!(out.len() < printer.longest());
        (String::from_utf8(out).unwrap(), rounded)
    }

    #[test]
    fn steps_are_printed_as_the_decimal_numbers_that_they_are() {
        let field = |scale, origin| Dimension::new("X", Scalar::I32, 0).scaled(scale, origin);
        let text = |field: &Dimension, v| printed(TextStyle::BLANKS, field, Value::Signed(v)).0;
        assert_eq!(text(&field(0.01, 0.0), 57), "0.57");
        assert_eq!(text(&field(0.01, 0.0), -5), "-0.05");
        assert_eq!(text(&field(0.001, 600_000.5), 1), "600000.501");
        assert_eq!(text(&field(0.25, -1.0), 3), "-0.25");
        assert_eq!(text(&field(10.0, 0.0), i64::from(i32::MIN)), "-21474836480");
        assert_eq!(text(&field(1.0 / 3.0, 0.0), 1), "0.3333333333333333");
        for scale in [1e-12, 0.001, 1e15 / 1.001] {
            text(&field(scale, 0.0), i64::from(i32::MIN));
        }
    }

    #[test]
    fn decimals_that_are_asked_for_round_coordinates_and_nothing_else() {
        let style = TextStyle { separator: b' ', decimals: Some(2) };
        let double = |name| Dimension::new(name, Scalar::F64, 0);
        let (text, rounded) = printed(style, &double("Z"), Value::Double(1.25625));
        assert_eq!((text.as_str(), (rounded - 0.00375).abs() < 1e-12), ("1.26", true));
        assert_eq!(printed(style, &double("Z"), Value::Double(-7.5)), ("-7.50".to_owned(), 0.0));
        assert_eq!(printed(style, &double("GpsTime"), Value::Double(1.125)).0, "1.125");
        assert_eq!(printed(style, &double("X"), Value::Double(f64::MIN)).1, 0.0);
    }
}
