//! The scale, the offset and the point format that several LAS inputs of different ones have in
//! common: no coordinate is rounded, and no field is lost.
//!
//! Scales and offsets are decimals that a header holds in binary, so their common step is found
//! among decimals: 0.01 and 0.0025 are whole numbers of 0.0025, though no binary division of the
//! two comes out even.

use std::path::PathBuf;

use super::header::Header;
use crate::io::steps::{reaches, whole_steps};
use crate::{Error, Result};

/// Digits behind the point that are told apart.
const MOST_DECIMALS: i32 = 15;

/// The largest steps per axis that those of all headers are whole numbers of, their offsets being
/// whole steps apart.
///
/// # Errors
///
/// If the steps are too small to reach all points.
pub fn scale(headers: &[Header], paths: &[PathBuf]) -> Result<[f64; 3]> {
    let mut found = [0.0; 3];
    for (axis, step) in found.iter_mut().enumerate() {
        let scales: Vec<f64> = headers.iter().map(|header| header.scale()[axis]).collect();
        let offsets: Vec<f64> = headers.iter().map(|header| header.offset()[axis]).collect();
        *step = common_step(&scales, &offsets).ok_or_else(|| too_fine(paths))?;
    }
    match offset(headers, found) {
        Some(_) => Ok(found),
        None => Err(too_fine(paths)),
    }
}

/// An offset from which steps of `scale` reach all points: the smallest of the headers if it is
/// one.
pub fn offset(headers: &[Header], scale: [f64; 3]) -> Option<[f64; 3]> {
    let least = smallest(headers.iter());
    let mut found = least;
    for (axis, offset) in found.iter_mut().enumerate() {
        let full = headers.iter().filter(|header| header.points() > 0);
        let bounds = full.map(|header| header.bounds().map(|corner| corner[axis]));
        let whole = bounds.reduce(|[lo, hi], [a, b]| [lo.min(a), hi.max(b)]);
        let Some([lo, hi]) = whole else { continue };
        let step = scale[axis];
        let reaches = |from: f64| reaches([lo, hi], from, step);
        if !reaches(*offset) {
            *offset += ((f64::midpoint(lo, hi) - *offset) / step).round() * step;
        }
        if !reaches(*offset) {
            return None;
        }
    }
    Some(found)
}

/// The smallest point format that has the fields of all, if there is one.
pub fn point_format(headers: &[Header]) -> Option<u8> {
    let mut formats = headers.iter().map(Header::format);
    let first = formats.next()?;
    formats.try_fold(first, holding)
}

/// The smallest point format that has the fields of both, if there is one.
pub fn holding(one: u8, two: u8) -> Option<u8> {
    let fields = |format: u8| -> Vec<String> {
        let schema = super::format::schema(format, &[], 0, [1.0; 3], [0.0; 3]);
        schema.dimensions.into_iter().map(|dimension| dimension.name).collect()
    };
    let (one, two) = (fields(one), fields(two));
    (0..=10).find(|&format| {
        let own = fields(format);
        one.iter().chain(&two).all(|name| own.contains(name))
    })
}

/// The smallest offset of all on each axis.
pub fn smallest<'a>(headers: impl Iterator<Item = &'a Header>) -> [f64; 3] {
    let least = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|axis| a[axis].min(b[axis]));
    headers.map(Header::offset).reduce(least).unwrap_or_default()
}

fn too_fine(paths: &[PathBuf]) -> Error {
    let told = "the scales and offsets of the inputs have no common step that reaches all points";
    let error = Error::pipeline(told)
        .help("give `read.scale`, to which coordinates are rounded, which is told");
    match paths.first() {
        Some(first) => error.at(first),
        None => error,
    }
}

/// The largest decimal that all `scales` are whole numbers of, and so are the ways from one of the
/// `offsets` to another.
fn common_step(scales: &[f64], offsets: &[f64]) -> Option<f64> {
    let scales = scales.iter().map(|scale| Decimal::of(scale.abs())).collect::<Option<Vec<_>>>()?;
    let step = scales.into_iter().reduce(Decimal::common)?;
    let first = *offsets.first()?;
    let is_whole = |offset: &f64| whole_steps(first, *offset, step.value()).is_some();
    if offsets.iter().all(is_whole) {
        return Some(step.value());
    }
    let offsets = offsets.iter().map(|offset| Decimal::of(*offset)).collect::<Option<Vec<_>>>()?;
    let ways = offsets.iter().map(|offset| offset.less(offsets[0]));
    let ways = ways.collect::<Option<Vec<_>>>()?;
    Some(ways.into_iter().fold(step, Decimal::common).value())
}

/// A decimal: a whole number of 10^-15.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Decimal(i128);

impl Decimal {
    /// The shortest one that reads as `value`, if it has no more digits than are told apart.
    fn of(value: f64) -> Option<Decimal> {
        let text = format!("{value:e}");
        let (digits, exponent) = text.split_once('e')?;
        let decimals = digits.split_once('.').map_or(0, |(_, decimals)| decimals.len() as i32);
        let digits: i128 = digits.replace('.', "").parse().ok()?;
        let shift = exponent.parse::<i32>().ok()? - decimals + MOST_DECIMALS;
        let power = 10i128.checked_pow(u32::try_from(shift).ok()?)?;
        digits.checked_mul(power).map(Decimal)
    }

    fn less(self, other: Decimal) -> Option<Decimal> {
        self.0.checked_sub(other.0).map(Decimal)
    }

    /// The largest that both are whole numbers of.
    fn common(self, other: Decimal) -> Decimal {
        let (mut a, mut b) = (self.0.abs(), other.0.abs());
        while b != 0 {
            (a, b) = (b, a % b);
        }
        Decimal(a)
    }

    fn value(self) -> f64 {
        format!("{}e-{MOST_DECIMALS}", self.0).parse().unwrap_or(f64::NAN)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_common_step_is_decimal() {
        for (scales, offsets, step) in [
            (&[0.01, 0.001][..], &[0.0, 0.0][..], Some(0.001)),
            (&[0.01, 0.0025], &[0.0, 0.0], Some(0.0025)),
            (&[0.01, 0.0254], &[0.0, 0.0], Some(0.0002)),
            (&[0.01], &[638_000.0, 638_000.005], Some(0.005)),
            (&[0.01], &[638_000.0, 639_000.0], Some(0.01)),
            (&[1e-7, 0.001], &[7.5, -120.25], Some(1e-7)),
            (&[0.1 + 0.2], &[0.0], None),
            (&[0.01], &[1.6e23, -1.6e23], None),
        ] {
            assert_eq!(common_step(scales, offsets), step, "{scales:?} {offsets:?}");
        }
    }

    #[test]
    fn the_smallest_format_that_holds_two() {
        for (one, two, both) in [
            (0, 1, Some(1)),
            (1, 2, Some(3)),
            (3, 3, Some(3)),
            (6, 7, Some(7)),
            (8, 6, Some(8)),
            (4, 2, Some(5)),
            (9, 8, Some(10)),
        ] {
            assert_eq!((holding(one, two), holding(two, one)), (both, both), "{one} {two}");
        }
    }
}
