//! Scans that are computed instead of read: seeded, of any size, never held. A scan is a function of
//! its scene, number of points, seed and noise alone, whatever the batches and whoever makes which
//! part. Knows no files.

mod als;
mod kind;
mod landscape;
mod part;
mod plane;
mod random;
mod record;
mod relief;
mod sphere;
mod squares;

pub use kind::Synth;

use std::fmt;
use std::ops::Range;
use std::str::FromStr;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::io::las;
use crate::point::{GpsTime, Metadata, PointBatch, Schema};
use crate::stage::{OpenSource, Part, Source};
use crate::{Error, Result};

/// Points of a part; the last may have fewer.
const PART_POINTS: u64 = 1 << 16;
/// The most points a scan can have: all scenes fit the 32 bits of a stored coordinate.
const MOST_POINTS: u64 = 10_000_000_000_000;
/// The most noise, in world units: the same limit again.
const MOST_NOISE: f64 = 1000.0;

/// What is scanned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scene {
    /// A tilted square plane, 400 points a square unit of its plan, in random order.
    Plane,
    /// A machined part, a box of 120 × 80 × 30 with four through holes and a dome, from all sides:
    /// sharp edges, even by area, in random order. `UserData` is the number of the face.
    Part,
    /// A sphere of radius 50 around world 0, even by area, in random order. `UserData` is the number of
    /// the octant: 1, 2 and 4 for negative x, y and z.
    Sphere,
    /// The paper's experiment: squares of 60 × 60 pixels at random places of a window of 1200 × 1600,
    /// projected on the front of an object, a point for each. The object is ours, the paper names
    /// none: 120 × 160 mm with two planes that meet in an edge, and a dome. `UserData` is the number of
    /// the face.
    SquaresRandom,
    /// The same with the squares on a grid, 60 pixels apart and 520 a run, each run 2 pixels further
    /// in x; after 30 runs also 2 pixels lower. `PointSourceId` is the number of the run. After
    /// 468,000 points all places are taken and come again with other noise.
    SquaresUniform,
    /// An airborne scan in metres: ground (class 2), trees (5) and gabled roofs (6) in overlapping
    /// strips, about 10 points a square metre, in the order of acquisition.
    Als,
}

impl Scene {
    /// All scenes.
    pub const ALL: [Scene; 6] = [
        Scene::Plane,
        Scene::Part,
        Scene::Sphere,
        Scene::SquaresRandom,
        Scene::SquaresUniform,
        Scene::Als,
    ];

    /// The word for it in pipelines and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Scene::Plane => "plane",
            Scene::Part => "part",
            Scene::Sphere => "sphere",
            Scene::SquaresRandom => "squares-random",
            Scene::SquaresUniform => "squares-uniform",
            Scene::Als => "als",
        }
    }

    /// Standard deviation of the noise unless told otherwise, in world units: across the surface
    /// (`plane`, `sphere`), in every direction (`part`), in depth (squares) or in height (`als`).
    pub fn default_noise(self) -> f64 {
        match self {
            Scene::Plane => 0.005,
            Scene::Part | Scene::Sphere => 0.02,
            Scene::SquaresRandom | Scene::SquaresUniform => 0.1,
            Scene::Als => 0.025,
        }
    }

    /// The true surface nearest to the world coordinates `p`, where it has a closed form (all
    /// but `als`).
    pub fn truth(self, p: [f64; 3]) -> Option<Truth> {
        match self {
            Scene::Plane => Some(plane::truth(p)),
            Scene::Part => part::truth(p),
            Scene::Sphere => Some(sphere::truth(p)),
            Scene::SquaresRandom | Scene::SquaresUniform => relief::truth(p),
            Scene::Als => None,
        }
    }
}

impl fmt::Display for Scene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Scene {
    type Err = Error;

    /// The scene of that name. Error: no scene has it.
    fn from_str(name: &str) -> Result<Scene> {
        Scene::ALL.into_iter().find(|scene| scene.name() == name).ok_or_else(|| {
            let names = Scene::ALL.map(Scene::name).join(", ");
            Error::pipeline(format!("there is no scene {name:?}"))
                .help(format!("the scenes are {names}"))
        })
    }
}

/// The surface that a synthetic point was measured on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// Distance to the surface in world units.
    pub distance: f64,
    /// Unit normal of the surface at its nearest point, outward or upward.
    pub normal: [f64; 3],
}

/// A scan to be computed.
#[derive(Debug, Clone, PartialEq)]
pub struct Synthetic {
    /// What is scanned.
    pub scene: Scene,
    /// How many points, up to 10^13.
    pub points: u64,
    /// Another seed is another scan of the scene; for `als` also another landscape.
    pub seed: u64,
    /// Standard deviation of the noise in world units, 0 to 1000; the scene's own if None.
    pub noise: Option<f64>,
}

impl OpenSource for Synthetic {
    /// Errors: too many points, noise out of range.
    fn open(&self) -> Result<Box<dyn Source>> {
        if self.points > MOST_POINTS {
            let message = format!("a synthetic scan has at most 10^13 points, not {}", self.points);
            return Err(Error::pipeline(message));
        }
        let noise = self.noise.unwrap_or(self.scene.default_noise());
        if !(0.0..=MOST_NOISE).contains(&noise) {
            let message =
                format!("the noise of a synthetic scan is 0 to {MOST_NOISE}, not {noise}");
            return Err(Error::pipeline(message));
        }
        let (surface, scale, origin) = Surface::of(self, noise);
        let schema = las::layout(record::FORMAT, &[], [scale; 3], origin);
        Ok(Box::new(Scan {
            metadata: Metadata { gps_time: Some(GpsTime::Week), ..las::fresh(&schema, None) },
            schema: Arc::new(schema),
            points: self.points,
            surface,
        }))
    }
}

/// An opened synthetic scan.
struct Scan {
    schema: Arc<Schema>,
    metadata: Metadata,
    points: u64,
    surface: Surface,
}

/// A scene with its figures settled.
enum Surface {
    Plane(plane::Plane),
    Part(part::Part),
    Sphere(sphere::Sphere),
    Squares(squares::Squares),
    Als(Box<als::Als>),
}

impl Surface {
    /// The scene of a scan with this noise, the scale of its coordinates and their origin.
    fn of(scan: &Synthetic, noise: f64) -> (Surface, f64, [f64; 3]) {
        let (points, seed) = (scan.points, scan.seed);
        let squares = |pattern| {
            let squares = squares::Squares::new(pattern, seed, noise);
            (Surface::Squares(squares), squares::SCALE, [0.0; 3])
        };
        match scan.scene {
            Scene::Plane => {
                let plane = plane::Plane::new(points, seed, noise);
                (Surface::Plane(plane), plane::SCALE, [0.0; 3])
            }
            Scene::Part => (Surface::Part(part::Part::new(seed, noise)), part::SCALE, [0.0; 3]),
            Scene::Sphere => {
                (Surface::Sphere(sphere::Sphere::new(seed, noise)), sphere::SCALE, [0.0; 3])
            }
            Scene::SquaresRandom => squares(squares::Pattern::Random),
            Scene::SquaresUniform => squares(squares::Pattern::Uniform),
            Scene::Als => {
                let als = als::Als::new(points, seed, noise);
                (Surface::Als(Box::new(als)), als::SCALE, als::ORIGIN)
            }
        }
    }

    /// Makes the points from number `first` on, as many as `records` takes.
    fn fill(&self, first: u64, records: &mut [u8]) {
        match self {
            Surface::Plane(plane) => plane.fill(first, records),
            Surface::Part(part) => part.fill(first, records),
            Surface::Sphere(sphere) => sphere.fill(first, records),
            Surface::Squares(squares) => squares.fill(first, records),
            Surface::Als(als) => als.fill(first, records),
        }
    }
}

impl Source for Scan {
    fn schema(&self) -> &Arc<Schema> {
        &self.schema
    }

    fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    fn points(&self) -> u64 {
        self.points
    }

    fn part_bytes(&self) -> u64 {
        size_of::<Stretch>() as u64
    }

    fn parts(&self) -> usize {
        self.points.div_ceil(PART_POINTS) as usize // at most 1.6e8
    }

    fn part(&self, index: usize) -> Result<Box<dyn Part + '_>> {
        let start = (index as u64).saturating_mul(PART_POINTS).min(self.points);
        let end = start.saturating_add(PART_POINTS).min(self.points);
        Ok(Box::new(Stretch { surface: &self.surface, numbers: start..end }))
    }
}

/// The points of a part that are still to be made.
struct Stretch<'a> {
    surface: &'a Surface,
    numbers: Range<u64>,
}

impl Part for Stretch<'_> {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        let left = self.numbers.end - self.numbers.start;
        let count = left.min(batch.capacity() as u64);
        batch.source = 0;
        self.surface.fill(self.numbers.start, batch.refill(count as usize));
        self.numbers.start += count;
        Ok(())
    }
}

#[cfg(test)]
mod tests;
