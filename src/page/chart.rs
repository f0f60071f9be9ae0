//! How far removed points are off, as a drawing: how many are so far off, and the part of all that
//! is no farther, over lengths in powers of two.

use std::fmt::Write as _;

use super::words;
use crate::report::{DeviationBin, DeviationTotals};

/// What so small a part of all deviates less than is left out at the beginning, and what is below
/// so many powers of two.
const LEFT_OUT: f64 = 0.004;
const POWERS: f64 = 14.0;
/// The drawing, and where bars stand in it.
const SIZE: [f64; 2] = [860.0, 300.0];
const LEFT: f64 = 20.0;
const RIGHT: f64 = 810.0;
const TOP: f64 = 44.0;
const FLOOR: f64 = 252.0;

/// Bars on the axis of logarithms, each as wide as what it counts and as high as that is dense.
struct DeviationBars {
    /// Binary logarithms of where each begins and ends, and its records; in ascending order.
    bars: Vec<(f64, f64, u64)>,
    /// Records that deviate less.
    less: u64,
    all: u64,
    /// Binary logarithms of the ends of the axis.
    ends: [f64; 2],
}

impl DeviationBars {
    /// Of bins in eighths of powers of two of `step`.
    fn of(bins: &[DeviationBin], step: f64) -> Option<DeviationBars> {
        let end = libm::log2(bins.last().filter(|bin| bin.to > 0.0)?.to);
        let all: u64 = bins.iter().map(|bin| bin.points).sum();
        let mut out = DeviationBars { bars: Vec::new(), less: 0, all, ends: [end; 2] };
        let most_less = (all as f64 * LEFT_OUT) as u64;
        for bin in bins {
            let from = if bin.to > 0.0 { libm::log2(begin(bin.to, step)) } else { f64::MIN };
            let is_first = out.bars.is_empty();
            let is_less = is_first && out.less + bin.points <= most_less;
            if is_less || from < end - POWERS {
                out.less += bin.points;
                continue;
            }
            if is_first {
                out.ends[0] = from;
            }
            out.bars.push((from, libm::log2(bin.to), bin.points));
        }
        (!out.bars.is_empty()).then_some(out)
    }

    /// Where a binary logarithm is on the axis.
    fn at(&self, log: f64) -> f64 {
        let [from, to] = self.ends;
        LEFT + (RIGHT - LEFT) * (log - from) / (to - from)
    }

    /// Where a length is on the axis; None beyond its ends.
    fn x(&self, length: f64) -> Option<f64> {
        let x = self.at(libm::log2(length));
        (length > 0.0 && x >= LEFT).then_some(x.min(RIGHT))
    }
}

/// Where the bin that ends at `to` begins: an eighth of a power of two of `step` below.
fn begin(to: f64, step: f64) -> f64 {
    let steps = to / step;
    // An edge belongs to the power of two that it ends.
    let power = libm::ceil(libm::log2(steps) - 1e-9) - 1.0;
    (steps - libm::exp2(power) / 8.0) * step
}

/// The drawing as SVG; empty where nothing was measured, or nothing is off.
pub(super) fn svg(
    (bins, step): (&[DeviationBin], f64),
    totals: &DeviationTotals,
    unit: Option<&str>,
) -> String {
    let Some(bars) = DeviationBars::of(bins, step) else { return String::new() };
    let [wide, high] = SIZE;
    let mut out = format!(
        "<svg viewBox=\"0 0 {wide} {high}\" role=\"img\" aria-label=\"Histogram of deviations and \
         the part of points that deviate no more\">"
    );
    axes(&mut out, &bars, unit);
    columns(&mut out, &bars);
    marks(&mut out, &bars, totals, unit);
    out + "</svg>"
}

fn text(out: &mut String, (x, y): (f64, f64), class: &str, anchor: &str, text: &str) {
    // A String takes all.
    let _ = write!(
        out,
        "<text x=\"{x:.1}\" y=\"{y:.1}\" class=\"{class}\" text-anchor=\"{anchor}\">{text}</text>"
    );
}

fn line(out: &mut String, [x, y, to_x, to_y]: [f64; 4], class: &str) {
    let _ = write!(
        out,
        "<line x1=\"{x:.1}\" y1=\"{y:.1}\" x2=\"{to_x:.1}\" y2=\"{to_y:.1}\" class=\"{class}\"/>"
    );
}

/// Lines of the parts, and lengths in powers of ten below.
fn axes(out: &mut String, bars: &DeviationBars, unit: Option<&str>) {
    for part in [0, 25, 50, 75, 100] {
        let y = FLOOR - (FLOOR - TOP) * f64::from(part) / 100.0;
        line(out, [LEFT, y, RIGHT, y], "grid");
        text(out, (RIGHT + 8.0, y + 4.0), "tick", "start", &format!("{part} %"));
    }
    let last = libm::floor(libm::log10(libm::exp2(bars.ends[1]))) as i32;
    for power in last - 6..=last {
        for digit in [1.0, 3.0] {
            let length = digit * libm::pow(10.0, f64::from(power));
            let Some(x) = bars.x(length).filter(|x| *x < RIGHT - 4.0) else { continue };
            line(out, [x, FLOOR, x, FLOOR + 5.0], "axis");
            if digit == 1.0 && x > LEFT + 20.0 {
                text(out, (x, FLOOR + 20.0), "tick", "middle", &words::tick(length, unit));
            }
        }
    }
    line(out, [LEFT, FLOOR, RIGHT, FLOOR], "axis");
    let below = "distance of removed points from the surface of what stands for them";
    text(out, ((LEFT + RIGHT) / 2.0, FLOOR + 42.0), "label", "middle", below);
}

/// The bars, and the curve above them.
fn columns(out: &mut String, bars: &DeviationBars) {
    let density = |&(from, to, count): &(f64, f64, u64)| count as f64 / (to - from);
    let most = bars.bars.iter().map(density).fold(f64::MIN_POSITIVE, f64::max);
    let part = |seen: u64| FLOOR - (FLOOR - TOP) * seen as f64 / bars.all.max(1) as f64;
    let mut seen = bars.less;
    let mut curve = format!("{LEFT:.1},{:.1}", part(seen));
    for bar in &bars.bars {
        let [x, end] = [bars.at(bar.0), bars.at(bar.1)];
        let high = (FLOOR - TOP) * density(bar) / most;
        let _ = write!(
            out,
            "<rect x=\"{x:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{high:.1}\" class=\"bar\"/>",
            FLOOR - high,
            (end - x - 0.6).max(0.5)
        );
        // What is between two bars has no points: the curve does not rise there.
        let _ = write!(curve, " {x:.1},{:.1}", part(seen));
        seen += bar.2;
        let _ = write!(curve, " {end:.1},{:.1}", part(seen));
    }
    let _ = write!(out, "<polyline points=\"{curve}\" class=\"curve\"/>");
}

/// Lines at the percentiles; words beside each other do not cover each other.
fn marks(out: &mut String, bars: &DeviationBars, totals: &DeviationTotals, unit: Option<&str>) {
    let all = [("50 %", totals.p50), ("95 %", totals.p95), ("99 %", totals.p99)];
    let mut end = [f64::NEG_INFINITY; 2];
    for (name, length) in all.into_iter().chain([("max", totals.max)]) {
        let Some(x) = bars.x(length) else { continue };
        let told = format!("{name} {}", words::length(length, unit));
        let half = 3.6 * told.chars().count() as f64;
        let middle = x.clamp(LEFT + half, RIGHT - half);
        let row = usize::from(middle - half < end[0] + 6.0);
        if middle - half < end[row] {
            continue;
        }
        end[row] = middle + half;
        let y = TOP - 10.0 - 15.0 * row as f64;
        line(out, [x, y + 4.0, x, FLOOR], "mark");
        text(out, (middle, y), "told", "middle", &told);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bins(figures: &[(f64, u64)]) -> Vec<DeviationBin> {
        figures.iter().map(|&(to, points)| DeviationBin { to, points }).collect()
    }

    #[test]
    fn bars_begin_where_the_bins_before_them_end() {
        let eighths = [1.0, 1.125, 1.25, 1.875, 2.0, 2.25, 4.0].map(|steps| begin(steps, 1.0));
        assert_eq!(eighths, [0.9375, 1.0, 1.125, 1.75, 1.875, 2.0, 3.75]);
        assert!((begin(1.125 * 0.001, 0.001) - 0.001).abs() < 1e-12);
        assert!((begin(2.0 * 0.1, 0.1) - 0.1875).abs() < 1e-12);
    }

    #[test]
    fn bars_have_all_records_but_the_least_and_end_at_the_largest() {
        let figures = [(0.0, 2), (1e-9, 1), (0.25, 700), (0.5, 100), (1.0, 400), (2.0, 3)];
        let bars = DeviationBars::of(&bins(&figures), 1.0).unwrap();
        let counts: Vec<u64> = bars.bars.iter().map(|bar| bar.2).collect();
        assert_eq!((bars.less, counts, bars.all), (3, vec![700, 100, 400, 3], 1206));
        assert_eq!((bars.x(2.0), bars.x(1e-9), bars.x(0.0)), (Some(RIGHT), None, None));
        assert_eq!(bars.at(bars.bars[0].0), LEFT);
        assert!(DeviationBars::of(&bins(&[(0.0, 9)]), 1.0).is_none());
    }

    #[test]
    fn the_drawing_is_well_formed_and_tells_the_percentiles() {
        let (points, at) = (17, [0.0; 3]);
        let totals =
            DeviationTotals { points, rms: 0.1, p50: 0.02, p95: 0.04, p99: 0.08, max: 0.1, at };
        let bins = bins(&[(0.008, 7), (0.064, 9), (0.128, 1)]);
        let svg = svg((&bins, 0.001), &totals, Some("m"));
        for told in ["50 % 20.0 mm", "95 % 40.0 mm", "max 0.100 m", "100 %", ">10 mm<", ">0.1 m<"] {
            assert!(svg.contains(told), "{told}: {svg}");
        }
        assert_eq!(svg.matches("<text").count(), svg.matches("</text>").count());
        assert_eq!(svg.matches("class=\"bar\"").count(), 3);
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }
}
