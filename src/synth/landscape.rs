//! What an airborne scanner flies over: rolling ground, gabled roofs and trees, without end and
//! computed where it is looked at.

use std::f64::consts::PI;

use super::random::{Random, key};
use super::record::nearest;

/// Waves that the ground is the sum of.
const WAVES: usize = 12;
/// The shortest and the longest of them, in metres.
const WAVELENGTHS: [f64; 2] = [40.0, 1500.0];
/// Height of a wave per metre of its length.
const STEEPNESS: f64 = 0.012;
/// Mean height of the ground.
const ELEVATION: f64 = 120.0;
/// Side of the squares that hold one building or none.
const PLOT: f64 = 45.0;
/// Side of the squares that hold one tree or none.
const GROVE: f64 = 9.0;

/// The landscape of a seed; plan coordinates in metres.
pub struct Landscape {
    waves: HeightWaves,
    buildings: u64,
    trees: u64,
}

/// Wave numbers along x and y in turns a metre, phases in turns, heights; side by side.
struct HeightWaves {
    x: [f64; WAVES],
    y: [f64; WAVES],
    phase: [f64; WAVES],
    height: [f64; WAVES],
}

/// A house with a gabled roof.
#[derive(Clone, Copy)]
struct Building {
    center: [f64; 2],
    /// Cosine and sine of the ridge's direction.
    ridge: [f64; 2],
    half_length: f64,
    half_width: f64,
    /// Height of the ridge above the ground's zero.
    top: f64,
    /// Fall of the roof per metre from the ridge.
    pitch: f64,
}

/// A tree with a round crown.
#[derive(Clone, Copy)]
struct Tree {
    center: [f64; 2],
    radius: f64,
    height: f64,
}

/// What a laser pulse from above meets first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SeenSurface {
    /// Bare ground at this height.
    Ground(f64),
    /// A roof at this height.
    Roof(f64),
    /// The crown of a tree: the heights where the pulse meets it and where the ground is below.
    Crown { top: f64, ground: f64 },
}

/// Looks at a landscape and remembers the last plot and grove, which the next pulse mostly shares.
/// Memory saves time and changes no answer.
pub struct LandscapeView<'a> {
    landscape: &'a Landscape,
    plot: Option<([i64; 2], Option<Building>)>,
    grove: Option<([i64; 2], Option<Tree>)>,
}

impl Landscape {
    /// The landscape of `seed`.
    pub fn new(seed: u64) -> Self {
        let mut waves = HeightWaves {
            x: [0.0; WAVES],
            y: [0.0; WAVES],
            phase: [0.0; WAVES],
            height: [0.0; WAVES],
        };
        let [short, long] = WAVELENGTHS.map(libm::log);
        for i in 0..WAVES {
            let mut random = Random::new(key(seed, 0x72), i as u64);
            let place = (i as f64 + random.unit()) / WAVES as f64;
            let length = libm::exp(short + (long - short) * place);
            let [cos, sin] = random.direction();
            (waves.x[i], waves.y[i]) = (cos / length, sin / length);
            waves.phase[i] = random.unit();
            waves.height[i] = STEEPNESS * length;
        }
        Landscape { waves, buildings: key(seed, 0x73), trees: key(seed, 0x74) }
    }

    /// A view of it with nothing remembered.
    pub fn view(&self) -> LandscapeView<'_> {
        LandscapeView { landscape: self, plot: None, grove: None }
    }

    /// Height of the bare ground.
    pub fn ground(&self, [x, y]: [f64; 2]) -> f64 {
        let waves = &self.waves;
        let heights: [f64; WAVES] = std::array::from_fn(|i| {
            waves.height[i] * wave(waves.x[i] * x + waves.y[i] * y + waves.phase[i])
        });
        heights.iter().fold(ELEVATION, |sum, height| sum + height)
    }

    /// The building of a plot. It stays 4 m within, so that no house crosses into another plot.
    fn building(&self, [i, j]: [i64; 2]) -> Option<Building> {
        let mut random = Random::of_cell(self.buildings, i, j);
        if random.unit() >= 0.7 {
            return None;
        }
        let center = [i, j].map(|k| (k as f64 + 0.5) * PLOT);
        let half_width = random.between(4.0, 8.0);
        let eaves = random.between(3.0, 10.0);
        let pitch = libm::tan(random.between(15.0, 50.0) * (PI / 180.0));
        Some(Building {
            center,
            ridge: random.direction(),
            half_length: random.between(8.0, 15.0),
            half_width,
            top: self.ground(center) + eaves + half_width * pitch,
            pitch,
        })
    }

    /// The tree of a grove. Its crown stays within.
    fn tree(&self, [i, j]: [i64; 2]) -> Option<Tree> {
        let mut random = Random::of_cell(self.trees, i, j);
        if random.unit() >= 0.55 {
            return None;
        }
        let radius = random.between(1.5, 4.0);
        let room = GROVE / 2.0 - radius;
        let center = [i, j].map(|k| (k as f64 + 0.5) * GROVE + random.between(-room, room));
        Some(Tree { center, radius, height: random.between(5.0, 19.0) })
    }
}

impl LandscapeView<'_> {
    /// What a pulse at `plan` meets first. `chance`, uniform in [0, 1), decides how deep it goes
    /// into a crown, and whether it passes.
    pub fn look(&mut self, plan: [f64; 2], chance: f64) -> SeenSurface {
        let building = self.building(plan);
        if let Some(height) = building.and_then(|b| b.roof(plan)) {
            return SeenSurface::Roof(height);
        }
        let ground = self.landscape.ground(plan);
        match self.tree(plan) {
            // A tree that would stand in the house was never planted.
            Some(tree) if building.is_none_or(|b| !b.stands_on(tree.center)) => {
                match tree.crown(plan, chance) {
                    Some(above) => SeenSurface::Crown { top: ground + above, ground },
                    None => SeenSurface::Ground(ground),
                }
            }
            _ => SeenSurface::Ground(ground),
        }
    }

    fn building(&mut self, plan: [f64; 2]) -> Option<Building> {
        let at = square(plan, PLOT);
        match self.plot {
            Some((plot, building)) if plot == at => building,
            _ => self.plot.insert((at, self.landscape.building(at))).1,
        }
    }

    fn tree(&mut self, plan: [f64; 2]) -> Option<Tree> {
        let at = square(plan, GROVE);
        match self.grove {
            Some((grove, tree)) if grove == at => tree,
            _ => self.grove.insert((at, self.landscape.tree(at))).1,
        }
    }
}

impl Building {
    /// Distances along and from the ridge.
    fn along(&self, plan: [f64; 2]) -> [f64; 2] {
        let [x, y] = [plan[0] - self.center[0], plan[1] - self.center[1]];
        let [cos, sin] = self.ridge;
        [(x * cos + y * sin).abs(), (y * cos - x * sin).abs()]
    }

    /// Height of the roof, if it is over `plan`.
    fn roof(&self, plan: [f64; 2]) -> Option<f64> {
        let [along, from] = self.along(plan);
        (along < self.half_length && from < self.half_width).then_some(self.top - from * self.pitch)
    }

    /// True if a tree at `plan` would be in the house or touch its walls.
    fn stands_on(&self, plan: [f64; 2]) -> bool {
        let [along, from] = self.along(plan);
        along < self.half_length + 1.0 && from < self.half_width + 1.0
    }
}

impl Tree {
    /// Height above the ground where a pulse meets the crown, if it does.
    fn crown(&self, plan: [f64; 2], chance: f64) -> Option<f64> {
        const PASSES: f64 = 0.85;
        let [x, y] = [plan[0] - self.center[0], plan[1] - self.center[1]];
        let square = (x * x + y * y) / (self.radius * self.radius);
        if square >= 1.0 || chance >= PASSES {
            return None;
        }
        let depth = chance / PASSES;
        let outside = self.height * (0.45 + 0.55 * (1.0 - square).sqrt());
        Some(outside * (1.0 - 0.35 * depth * depth))
    }
}

/// The numbers along x and y of the square of `side` that holds `plan`.
fn square(plan: [f64; 2], side: f64) -> [i64; 2] {
    plan.map(|v| nearest(v * (1.0 / side) - 0.5) as i64)
}

/// A wave of height 1 at `turns`: the sine to 4e-6, by additions and multiplications alone.
fn wave(turns: f64) -> f64 {
    let turn = turns - nearest(turns); // -1/2 to 1/2
    let folded = turn.abs().min(0.5 - turn.abs()); // 0 to 1/4
    let angle = 2.0 * PI * folded;
    let square = angle * angle;
    // Taylor's series of the sine to the ninth power.
    let series = 1.0
        + square
            * (-1.0 / 6.0
                + square * (1.0 / 120.0 + square * (-1.0 / 5040.0 + square * (1.0 / 362_880.0))));
    (angle * series).copysign(turn)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wave_is_a_sine() {
        for i in -4000..4000 {
            let turns = f64::from(i) / 1000.0;
            let sine = libm::sin(2.0 * PI * turns);
            assert!((wave(turns) - sine).abs() < 4e-6, "{turns}");
        }
    }

    #[test]
    fn what_is_seen_does_not_depend_on_what_was_seen_before() {
        let landscape = Landscape::new(5);
        let plans: Vec<[f64; 2]> = (0..4000)
            .map(|i| {
                let mut random = Random::new(1, i);
                [random.between(0.0, 300.0), random.between(-50.0, 50.0)]
            })
            .collect();
        let mut view = landscape.view();
        let mut kinds = [0; 3];
        for plan in plans {
            let seen = view.look(plan, 0.5);
            assert_eq!(seen, landscape.view().look(plan, 0.5));
            match seen {
                SeenSurface::Ground(_) => kinds[0] += 1,
                SeenSurface::Roof(_) => kinds[1] += 1,
                SeenSurface::Crown { top, ground } => {
                    assert!(top > ground);
                    kinds[2] += 1;
                }
            }
        }
        assert!(kinds.iter().all(|&n| n > 100), "{kinds:?}");
    }

    #[test]
    fn houses_and_crowns_stay_in_their_squares() {
        let landscape = Landscape::new(11);
        let (mut houses, mut trees) = (0, 0);
        for i in -30..30 {
            for j in -30..30 {
                if let Some(b) = landscape.building([i, j]) {
                    houses += 1;
                    let reach =
                        (b.half_length * b.half_length + b.half_width * b.half_width).sqrt();
                    assert!(reach < PLOT / 2.0);
                }
                if let Some(t) = landscape.tree([i, j]) {
                    trees += 1;
                    for (axis, cell) in [i, j].into_iter().enumerate() {
                        let low = cell as f64 * GROVE;
                        assert!(t.center[axis] - t.radius >= low - 1e-9);
                        assert!(t.center[axis] + t.radius <= low + GROVE + 1e-9);
                    }
                }
            }
        }
        assert!(houses > 1500 && trees > 1000, "{houses} houses, {trees} trees");
    }
}
