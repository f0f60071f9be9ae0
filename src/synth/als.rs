//! An airborne scan of a landscape: overlapping strips flown there and back, each swept in zig-zag
//! lines, about 10 points a square metre, in the order of acquisition.

use super::landscape::{Landscape, LandscapeView, SeenSurface};
use super::random::{Random, key};
use super::record::{STRIDE, SceneRecord, nearest, stored};

/// World units (metres) of a stored step.
pub const SCALE: f64 = 0.001;
const PER_UNIT: f64 = 1000.0;
/// Where the scan is: an easting, a northing and a height of a projected system in metres.
pub const ORIGIN: [f64; 3] = [350_000.0, 5_600_000.0, 0.0];

/// Points per square metre, all strips together.
const DENSITY: f64 = 10.0;
/// At least this many strips, and none wider than [`WIDEST`] metres apart.
const FEWEST: f64 = 4.0;
const WIDEST: f64 = 480.0;
/// Width of a strip in distances between strips: neighbours share a fifth of it.
const SWATH: f64 = 1.25;
/// Full opening angle in steps of 0.006°: 40°.
const OPENING: f64 = 40.0 / 0.006;
/// Seconds of the GPS week at the first pulse, seconds between pulses and between strips.
const START: f64 = 100_000.0;
const PULSE: f64 = 2.0e-6;
const TURN: f64 = 300.0;

/// Classes of LAS 1.4 R15, table 17.
const GROUND: u8 = 2;
const HIGH_VEGETATION: u8 = 5;
const BUILDING: u8 = 6;

/// The flight and what is flown over.
pub struct AlsScene {
    key: u64,
    landscape: Landscape,
    noise: f64,
    /// Side of the square flown, along and across.
    side: f64,
    /// Distance between strips.
    between: f64,
    /// Points of a strip and of a line; a strip's is even, so that no pair is torn.
    per_strip: u64,
    per_line: u64,
}

impl AlsScene {
    pub fn new(points: u64, seed: u64, noise: f64) -> Self {
        let side = (points as f64 / DENSITY).sqrt();
        let strips = (side / WIDEST).ceil().max(FEWEST);
        let between = side / strips;
        let per_strip = points.div_ceil(strips as u64).next_multiple_of(2).max(2);
        // Lines as far apart as points along a line: per_line² / width = per_strip / length.
        let share = if side > 0.0 { SWATH * between / side } else { 0.0 };
        let per_line = ((per_strip as f64 * share).sqrt().round() as u64).max(2);
        let landscape = Landscape::new(seed);
        AlsScene { key: key(seed, 0x75), landscape, noise, side, between, per_strip, per_line }
    }

    /// Makes the points from number `first` on.
    pub fn fill(&self, first: u64, records: &mut [u8]) {
        let mut view = self.landscape.view();
        // Points come in pairs from an even number on; the second of a pair is the echo of the
        // first's pulse if there was one.
        let mut echo = match first % 2 {
            0 => None,
            _ => self.shoot(first - 1, &mut view).1,
        };
        for (bytes, index) in records.chunks_exact_mut(STRIDE).zip(first..) {
            let record = match echo.take() {
                Some(record) => record,
                None => {
                    let (record, second) = self.shoot(index, &mut view);
                    echo = second;
                    record
                }
            };
            record.store(bytes);
        }
    }

    /// The first return of pulse `index` and, where it met a crown and is the first of a pair, the
    /// second.
    fn shoot(&self, index: u64, view: &mut LandscapeView) -> (SceneRecord, Option<SceneRecord>) {
        let mut random = Random::new(self.key, index);
        let (plan, pulse) = self.aim(index, &mut random);
        let seen = view.look(plan, random.unit());
        let [noise, other_noise] = random.gaussians();
        let echoes = index.is_multiple_of(2) && matches!(seen, SeenSurface::Crown { .. });
        let (class, height) = match seen {
            SeenSurface::Ground(height) => (GROUND, height),
            SeenSurface::Roof(height) => (BUILDING, height),
            SeenSurface::Crown { top, .. } => (HIGH_VEGETATION, top),
        };
        let returned = |class, height, number, random: &mut Random| SceneRecord {
            position: stored([plan[0], plan[1], height], PER_UNIT),
            classification: class,
            intensity: intensity(class, random),
            return_number: number,
            number_of_returns: 1 + u8::from(echoes),
            ..pulse
        };
        let first = returned(class, height + self.noise * noise, 1, &mut random);
        let second = match seen {
            SeenSurface::Crown { top, ground } if echoes => {
                // Most second returns are from the ground, the others from below the crown.
                let below = random.unit();
                let (class, height) = match below < 0.7 {
                    true => (GROUND, ground),
                    false => (HIGH_VEGETATION, ground + (below - 0.7) * (top - ground)),
                };
                Some(returned(class, height + self.noise * other_noise, 2, &mut random))
            }
            _ => None,
        };
        (first, second)
    }

    /// Where pulse `index` goes, and a record of all that does not depend on what it meets.
    fn aim(&self, index: u64, random: &mut Random) -> ([f64; 2], SceneRecord) {
        let (strip, in_strip) = (index / self.per_strip, index % self.per_strip);
        let (line, in_line) = (in_strip / self.per_line, in_strip % self.per_line);
        let swept = (in_line as f64 + 0.5) / self.per_line as f64;
        let back = line % 2 == 1;
        let across = if back { 0.5 - swept } else { swept - 0.5 };
        let flown = (in_strip as f64 + 0.5) / self.per_strip as f64;
        let along = if strip % 2 == 1 { 1.0 - flown } else { flown };
        // A pulse strays by a fraction of the distance between pulses.
        let stray = 0.3 * SWATH * self.between / self.per_line as f64;
        let plan = [
            along * self.side + stray * (random.unit() - 0.5),
            (strip as f64 + 0.5 + SWATH * across) * self.between + stray * (random.unit() - 0.5),
        ];
        let record = SceneRecord {
            scan_direction: back,
            edge_of_flight_line: in_line == 0 || in_line == self.per_line - 1,
            scan_angle: nearest(across * OPENING) as i16,
            point_source_id: strip as u16 + 1,
            ..SceneRecord::single([0; 3], START + strip as f64 * TURN + index as f64 * PULSE)
        };
        (plan, record)
    }
}

/// Brightness of a class, with the spread of a real return (a triangle of ±400).
fn intensity(class: u8, random: &mut Random) -> u16 {
    let mean = match class {
        GROUND => 900.0,
        BUILDING => 1600.0,
        _ => 500.0,
    };
    (mean + 400.0 * (random.unit() - random.unit())) as u16
}
