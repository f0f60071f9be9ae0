//! Reach for this when you want to see what a reduction keeps: draws a scan and its reduction side
//! by side, from one oblique view, coloured by height, as an SVG of dots.
//!
//! `cargo run --example 07_picture -- picture.svg scan.laz reduced.laz`
//!
//! Without files, the picture is of a computed scan and every sixth point of it.

#![allow(clippy::print_stdout, reason = "an example shows its results")]

use std::error::Error;
use std::fmt::Write;

use pointmill::io::las;
use pointmill::point::PointBatch;
use pointmill::stage::{OpenSource, Source};
use pointmill::synth::{Scene, Synthetic};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (scan, kept, what) = match &arguments[..] {
        [_, scan, reduced] => {
            let [scan, reduced] = [scan, reduced].map(|path| las::open(&[path.into()]));
            (positions(&*scan?)?, positions(&*reduced?)?, "reduced")
        }
        [] | [_] => {
            let scan = Synthetic {
                scene: Scene::Als,
                points: 20_000,
                seed: 1,
                noise: None,
                ..Synthetic::default()
            };
            let scan = positions(&*scan.open()?)?;
            let kept = scan.iter().step_by(6).copied().collect();
            (scan, kept, "every sixth point")
        }
        _ => return Err("usage: 07_picture [PICTURE.svg [SCAN REDUCED]]".into()),
    };
    let share = 100.0 * kept.len() as f64 / scan.len() as f64;
    let picture = draw(&[
        (format!("scan: {} points", scan.len()), &scan),
        (format!("{what}: {} points ({share:.1} %)", kept.len()), &kept),
    ]);
    match arguments.first() {
        Some(path) => std::fs::write(path, picture)?,
        None => println!("{} bytes of SVG; give a path to keep it", picture.len()),
    }
    Ok(())
}

/// World coordinates of all points of a source: a picture's worth, so they are simply collected.
fn positions(source: &dyn Source) -> Result<Vec<[f64; 3]>, Box<dyn Error>> {
    let schema = source.schema();
    let axes = schema.coordinates().ok_or("the scan has no coordinates")?;
    let mut batch = PointBatch::new(schema.clone(), 8192);
    let mut positions = Vec::new();
    for index in 0..source.parts() {
        let mut part = source.part(index)?;
        loop {
            part.read(&mut batch)?;
            if batch.is_empty() {
                break;
            }
            positions.extend(batch.iter().map(|r| axes.map(|axis| axis.world(r, schema.endian))));
        }
    }
    Ok(positions)
}

/// Width of a panel, its margin and the room for its title, in tenths of a pixel: whole numbers are
/// the shortest way to write a tenth.
const PANEL: f64 = 6000.0;
const MARGIN: f64 = 150.0;
const TITLE: f64 = 420.0;
/// Diameter of a dot, the same.
const DOT: u32 = 28;
/// Sine and cosine of the angle by which the view is turned about the vertical, and of the angle by
/// which it is raised above the horizon: 37°, by numbers that are the same on every machine.
const TURNED: [f64; 2] = [0.6, 0.8];
const RAISED: [f64; 2] = [0.6, 0.8];
/// Low to high: dark blue over green to yellow.
const COLORS: [&str; 10] = [
    "#2b2f77", "#31508c", "#33708e", "#2f8f8b", "#3aa981", "#63c06c", "#98cf55", "#cbd545",
    "#eeca3b", "#f7a534",
];
/// Dots are painted in this many layers from the far to the near, or a far dot would hide a near one.
const LAYERS: usize = 12;

/// A dot of a panel: place on the panel, and which layer and colour it has.
struct Dot {
    x: i64,
    y: i64,
    layer: usize,
    color: usize,
}

/// The panels side by side. All are drawn to the scale of the first.
fn draw(panels: &[(String, &[[f64; 3]])]) -> String {
    let view = View::of(panels.first().map_or(&[], |(_, points)| points));
    let width = PANEL * panels.len() as f64;
    let height = view.height() + TITLE;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{}\" height=\"{}\" \
         viewBox=\"0 0 {width} {height}\">\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"#fbfbf8\"/>\n",
        width / 10.0,
        height / 10.0
    );
    for (number, (title, points)) in panels.iter().enumerate() {
        let left = PANEL * number as f64;
        let dots = points.iter().map(|&p| view.dot(p)).collect();
        let _ = write!(
            svg,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\" font-family=\"sans-serif\" \
             font-size=\"190\" fill=\"#333\">{title}</text>\n\
             <g transform=\"translate({left} {TITLE})\" fill=\"none\" stroke-width=\"{DOT}\" \
             stroke-linecap=\"round\">\n{}</g>\n",
            left + PANEL / 2.0,
            TITLE * 0.66,
            paths(dots)
        );
    }
    svg + "</svg>\n"
}

/// One path a layer and colour; a dot is a line of no length with round ends.
fn paths(mut dots: Vec<Dot>) -> String {
    dots.sort_by_key(|d| (d.layer, d.color, d.y, d.x));
    let mut svg = String::new();
    for group in dots.chunk_by(|a, b| (a.layer, a.color) == (b.layer, b.color)) {
        let [mut x, mut y] = [0, 0];
        let _ = write!(svg, "<path stroke=\"{}\" d=\"", COLORS[group[0].color]);
        for dot in group {
            // A minus sign parts two numbers as well as a space does.
            let [dx, dy] = [dot.x - x, dot.y - y];
            let space = if dy < 0 { "" } else { " " };
            let _ = write!(svg, "m{dx}{space}{dy}h0");
            [x, y] = [dot.x, dot.y];
        }
        svg.push_str("\"/>\n");
    }
    svg
}

/// An oblique parallel projection that makes a scan as wide as a panel.
struct View {
    /// World directions to the right, upwards and towards the eye.
    axes: [[f64; 3]; 3],
    /// Smallest and largest coordinates along them.
    range: [[f64; 2]; 3],
    heights: [f64; 2],
    scale: f64,
}

impl View {
    fn of(points: &[[f64; 3]]) -> View {
        let ([sin_a, cos_a], [sin_e, cos_e]) = (TURNED, RAISED);
        let axes = [
            [cos_a, sin_a, 0.0],
            [-sin_a * sin_e, cos_a * sin_e, cos_e],
            [sin_a * cos_e, -cos_a * cos_e, sin_e],
        ];
        let range = axes.map(|axis| range(points.iter().map(|&p| dot(axis, p))));
        let heights = range_of_most(points.iter().map(|p| p[2]).collect());
        let scale = (PANEL - 2.0 * MARGIN) / (range[0][1] - range[0][0]);
        View { axes, range, heights, scale }
    }

    /// Height of a panel.
    fn height(&self) -> f64 {
        ((self.range[1][1] - self.range[1][0]) * self.scale + 2.0 * MARGIN).round()
    }

    fn dot(&self, p: [f64; 3]) -> Dot {
        let [x, y, near] = self.axes.map(|axis| dot(axis, p));
        let middle = self.range.map(|[lo, hi]| (lo + hi) / 2.0);
        Dot {
            x: (PANEL / 2.0 + (x - middle[0]) * self.scale).round() as i64,
            y: (self.height() / 2.0 - (y - middle[1]) * self.scale).round() as i64,
            layer: step(near, self.range[2], LAYERS),
            color: step(p[2], self.heights, COLORS.len()),
        }
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::MAX, f64::MIN], |[lo, hi], v| [lo.min(v), hi.max(v)])
}

/// The range without the lowest and highest hundredth, so that one tree does not take all colours.
fn range_of_most(mut values: Vec<f64>) -> [f64; 2] {
    values.sort_by(f64::total_cmp);
    let hundredth = values.len() / 100;
    match values.len() {
        0 => [0.0, 1.0],
        n => [values[hundredth], values[n - 1 - hundredth]],
    }
}

/// Which of `count` equal steps of a range a value is in; values outside are in the first or last.
fn step(value: f64, [lo, hi]: [f64; 2], count: usize) -> usize {
    ((value - lo) / (hi - lo) * count as f64).clamp(0.0, count as f64 - 1.0) as usize
}
