//! What all points of a file come to, as people read it: `info --deep`.

use serde_json::{Map, Value, json};

use crate::io::{ClassCount, DeepDimension, DeepFigures, DensityFigures, ReturnCount};
use crate::report::{Coordinate, Grouped, Short};

/// Letters of the longest bar.
const BAR: f64 = 30.0;

/// The figures as facts, whose numbers have the digits that say something; `scales` are those of
/// x, y and z, where the file has some.
pub(super) fn shown(figures: &DeepFigures, scales: &[f64]) -> Value {
    let DeepFigures { points, density, dimensions, returns, classes, quantiles } = figures;
    let mut all = Map::new();
    let mut put = |name: &str, value: Value| drop(all.insert(name.to_owned(), value));
    put("points", json!(Grouped(*points).to_string()));
    if let Some(density) = density {
        put("density", json!(of_density(density)));
        let unit = density.unit.map_or_else(String::new, |unit| format!(" {unit}"));
        put("spacing", json!(format!("{}{unit}", Short(density.spacing))));
    }
    let step = |axis: usize| scales.get(axis).copied().unwrap_or(0.0);
    let row = |(n, dimension): (usize, &DeepDimension)| {
        of_dimension(dimension, if n < 3 { step(n) } else { 0.0 })
    };
    put("dimensions", dimensions.iter().enumerate().map(row).collect());
    let row = |count: &ReturnCount| {
        json!({
            "return": count.number,
            "points": Grouped(count.points).to_string(),
            "of pulses": Grouped(count.of_pulses).to_string(),
            "share": bar(count.points, *points),
        })
    };
    put("returns", returns.iter().map(row).collect());
    let row = |ClassCount { class, name, points: own }: &ClassCount| {
        json!({
            "class": class,
            "name": name.unwrap_or_default(),
            "points": Grouped(*own).to_string(),
            "share": bar(*own, *points),
        })
    };
    put("classes", classes.iter().map(row).collect());
    for (n, spread) in quantiles.iter().enumerate() {
        let step = if n == 0 { step(2) } else { 0.0 };
        let row = |[share, value]: &[f64; 2]| {
            let percent = format!("{} %", share * 100.0);
            json!({ "points below": percent, "value": Coordinate { at: *value, step }.to_string() })
        };
        put(spread.name, spread.values.iter().map(row).collect());
    }
    Value::Object(all)
}

/// How dense the points are, in one line.
fn of_density(density: &DensityFigures) -> String {
    let DensityFigures { points_per_square, unit, cell, cells, .. } = density;
    let (square, side) = match unit {
        Some(unit) => (format!("{unit}²"), format!("{} {unit}", Short(*cell))),
        None => ("unit²".to_owned(), Short(*cell).to_string()),
    };
    format!(
        "{} points per {square}, in {} squares of {side} that have points",
        Short(*points_per_square),
        Grouped(*cells)
    )
}

fn of_dimension(dimension: &DeepDimension, step: f64) -> Value {
    let exact = |value: Option<f64>| {
        value.map(|at| Coordinate { at, step }.to_string()).unwrap_or_default()
    };
    let deviation = dimension.deviation.unwrap_or(0.0);
    let mut told = Vec::new();
    if let Some(set) = dimension.set {
        told.push(format!("{} set", Grouped(set)));
    } else if let Some(distinct) = dimension.distinct {
        told.push(match distinct {
            1 => "1 value".to_owned(),
            n => format!("{n} values"),
        });
    }
    if dimension.not_finite > 0 {
        told.push(format!("{} not finite", Grouped(dimension.not_finite)));
    }
    json!({
        "name": dimension.name,
        "min": exact(dimension.min),
        "max": exact(dimension.max),
        "mean": dimension.mean.map(|v| mean(v, deviation, step)),
        "deviation": dimension.deviation.map(|v| Short(v).to_string()),
        "values": told.join(", "),
    })
}

/// A mean in the digits that its deviation leaves, and in one more than the values have.
fn mean(value: f64, deviation: f64, step: f64) -> String {
    let below = |v: f64| if v > 0.0 && v.is_finite() { -v.log10().floor() } else { 0.0 };
    let digits = if step > 0.0 { below(step) + 1.0 } else { below(deviation) + 2.0 };
    format!("{value:.*}", digits.clamp(0.0, 9.0) as usize)
}

/// A share of all in per cent, and as a bar.
fn bar(own: u64, all: u64) -> String {
    let share = own as f64 / all.max(1) as f64;
    let letters = (share * BAR).ceil() as usize;
    format!("{:5.1} %  {}", share * 100.0, "#".repeat(letters))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_have_the_digits_that_say_something() {
        assert_eq!(mean(5_017_899.666_12, 64.7, 0.01), "5017899.666");
        assert_eq!(mean(483_906.123, 192.0, 0.0), "483906");
        assert_eq!(mean(1.374_2, 0.598, 0.0), "1.374");
        assert_eq!((mean(0.0, 0.0, 0.0), mean(1.0, f64::NAN, 0.0)), ("0.00".into(), "1.00".into()));
    }

    #[test]
    fn a_bar_has_a_letter_for_the_smallest_share() {
        assert_eq!(bar(0, 10).trim(), "0.0 %");
        assert!(bar(1, 1_000_000).ends_with("  #") && bar(7, 7).ends_with(&"#".repeat(30)));
    }
}
