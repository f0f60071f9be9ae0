//! A scene as a source: its points are made in parts, each by its numbers alone.

use std::ops::Range;
use std::sync::Arc;

use super::front::SquaresProjection;
use super::scene::Scene;
use super::{als, part, plane, record, sphere, squares};
use crate::io::las;
use crate::point::{GpsTime, Metadata, PointBatch, Schema};
use crate::stage::{OpenSource, Part, Source};
use crate::{Error, Result};

/// Points of a part; the last may have fewer.
pub(super) const PART_POINTS: u64 = 1 << 16;
/// The most points a scan can have: all scenes fit the 32 bits of a stored coordinate.
pub(super) const MOST_POINTS: u64 = 10_000_000_000_000;
/// The most noise, in world units: the same limit again.
const MOST_NOISE: f64 = 1000.0;

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
    /// Of projected squares: on what they are projected, and how they are seen.
    pub projection: SquaresProjection,
}

/// A plane without points: what is not said of a scan.
impl Default for Synthetic {
    fn default() -> Self {
        let (scene, projection) = (Scene::Plane, SquaresProjection::default());
        Synthetic { scene, points: 0, seed: 0, noise: None, projection }
    }
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
        self.check_projection()?;
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

impl Synthetic {
    /// Refuses what is said of a projection where there is none, and shares that are none.
    fn check_projection(&self) -> Result<()> {
        let SquaresProjection { outliers, .. } = self.projection;
        if !(0.0..=1.0).contains(&outliers) {
            let told = format!("`synth.outliers` is a share of the points, 0 to 1, not {outliers}");
            return Err(Error::pipeline(told));
        }
        let is_projected = matches!(self.scene, Scene::SquaresRandom | Scene::SquaresUniform);
        if is_projected || self.projection == SquaresProjection::default() {
            return Ok(());
        }
        let told = format!(
            "`synth.front`, `synth.noise_in` and `synth.outliers` are of projected squares, and \
             the scene is `{}`",
            self.scene
        );
        Err(Error::pipeline(told).help("take squares-random or squares-uniform, or leave them out"))
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
    Plane(plane::PlaneScene),
    Part(part::PartScene),
    Sphere(sphere::SphereScene),
    Squares(squares::SquaresScene),
    Als(Box<als::AlsScene>),
}

impl Surface {
    /// The scene of a scan with this noise, the scale of its coordinates and their origin.
    fn of(scan: &Synthetic, noise: f64) -> (Surface, f64, [f64; 3]) {
        let (points, seed) = (scan.points, scan.seed);
        let squares = |pattern| {
            let squares = squares::SquaresScene::new(pattern, seed, noise, scan.projection);
            (Surface::Squares(squares), squares::SCALE, [0.0; 3])
        };
        match scan.scene {
            Scene::Plane => {
                let plane = plane::PlaneScene::new(points, seed, noise);
                (Surface::Plane(plane), plane::SCALE, [0.0; 3])
            }
            Scene::Part => {
                (Surface::Part(part::PartScene::new(seed, noise)), part::SCALE, [0.0; 3])
            }
            Scene::Sphere => {
                (Surface::Sphere(sphere::SphereScene::new(seed, noise)), sphere::SCALE, [0.0; 3])
            }
            Scene::SquaresRandom => squares(squares::Pattern::Random),
            Scene::SquaresUniform => squares(squares::Pattern::Uniform),
            Scene::Als => {
                let als = als::AlsScene::new(points, seed, noise);
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
        size_of::<PartInMaking>() as u64
    }

    fn parts(&self) -> usize {
        self.points.div_ceil(PART_POINTS) as usize // at most 1.6e8
    }

    fn first_record(&self, index: usize) -> Option<u64> {
        Some((index as u64).saturating_mul(PART_POINTS).min(self.points))
    }

    fn part(&self, index: usize) -> Result<Box<dyn Part + '_>> {
        let start = (index as u64).saturating_mul(PART_POINTS).min(self.points);
        let end = start.saturating_add(PART_POINTS).min(self.points);
        Ok(Box::new(PartInMaking { surface: &self.surface, numbers: start..end }))
    }
}

/// The points of a part that are still to be made.
struct PartInMaking<'a> {
    surface: &'a Surface,
    numbers: Range<u64>,
}

impl Part for PartInMaking<'_> {
    fn read(&mut self, batch: &mut PointBatch) -> Result<()> {
        let left = self.numbers.end - self.numbers.start;
        let count = left.min(batch.capacity() as u64);
        batch.source = 0;
        self.surface.fill(self.numbers.start, batch.refill(count as usize));
        self.numbers.start += count;
        Ok(())
    }
}
