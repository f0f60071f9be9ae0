//! The `[run]` settings of a pipeline file and what a command line puts in their place.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

use crate::geom::simd;
use crate::geom::simd::Level;
use crate::quantity::{SizeText, Whole, has_schema, some_bytes};
use crate::{Error, Result};

/// What a run may use and where it leaves things. No setting but `lattice`, `z_scale`, `nonfinite`,
/// `withheld` and `noise` changes what is computed, and none besides these but `provenance` changes
/// a byte of an output. All are optional; arguments of the same name take their place.
///
/// # Sizes
///
/// A size is `512MiB`, `1.5 GiB`, `2GB`, or bytes without a unit. A fraction of a byte is cut
/// off.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RunSettings {
    /// Bound of the process's peak resident memory, in bytes; none: half of what the machine or its
    /// control group has.
    #[serde(deserialize_with = "some_bytes")]
    #[schemars(with = "Option<SizeText>")]
    pub memory: Option<u64>,
    /// Threads that work at once, at most 1024; none: all processors.
    #[serde(deserialize_with = "some_threads")]
    #[schemars(with = "Option<Whole<1, { MOST_THREADS as u64 }>>")]
    pub threads: Option<NonZeroUsize>,
    /// Folder for what does not fit in memory; none: beside the output.
    #[schemars(title = "a path")]
    pub scratch: Option<PathBuf>,
    /// Where the report is written; none: nowhere. As JSON or, if its name ends in `.html`, as a
    /// page that people hand on, with pictures, maps and curves.
    #[schemars(title = "a path")]
    pub report: Option<PathBuf>,
    /// What becomes of files that are already where an output or the report is to be.
    pub existing: Existing,
    /// Lattice step in world units; none: as the inputs' headers have it, or 2^-30 where
    /// coordinates are floats. A run warns where that merges more than one position in a thousand
    /// whose points have unequal coordinates, and says what step does not. Sides that are "auto"
    /// are powers of two of steps: another step gives them other lengths, and other points are
    /// kept, also in number.
    #[serde(deserialize_with = "some_step")]
    #[schemars(schema_with = "above_0")]
    pub lattice: Option<f64>,
    /// What z is multiplied by wherever distances are measured, so that its unit is that of x and
    /// y; the records keep their z. None: 1, where the units match or are not known; of units that
    /// give reason for doubt (feet below heights of no unit, a reference system of no known unit) a
    /// run warns, and of a scan without a reference system, or in metres without one for z, it does
    /// not.
    pub z_scale: Option<ZScale>,
    /// What becomes of scans whose x, y and z have different units, where stages measure distances.
    pub units: MixedUnits,
    /// What becomes of points whose coordinates are not finite, where stages measure distances. A
    /// pipeline that streams copies them unless they are dropped: a conversion keeps its records.
    pub nonfinite: Nonfinite,
    /// What becomes of scans whose points are not as their LAS header says, which damage looks
    /// like: outside of its box, or counted otherwise by return. LAZ has no checksum; this is what
    /// stands in for one. A box that holds none of a LAZ file's points (less than 99 in 100 of a
    /// LAS file's), or that is not set, is told as a warning in any case; one wider than the points
    /// is right.
    pub headers: Headers,
    /// What becomes of points with the withheld flag, in pipelines that work on tiles; others keep
    /// every point.
    pub withheld: Treatment,
    /// What becomes of points of the classes 7 and 18, low and high noise, in pipelines that work
    /// on tiles; none: they are points like all others. The command `reduce` leaves them out.
    pub noise: Option<Treatment>,
    /// Most points a tile's cube holds, for tests; none: as the memory allows.
    pub tile_points: Option<NonZeroUsize>,
    /// Which of the equal code paths runs, for tests.
    pub simd: SimdSetting,
    /// Whether points may stay in memory, for tests.
    pub spill: SpillSetting,
    /// Whether outputs say how they were made: the pipeline, the version of pointmill, and the
    /// SHA-256 of each input, by which `pointmill reproduce` makes them again; none: true. Then the
    /// report has the SHA-256 of inputs and outputs, too.
    pub provenance: Option<bool>,
}

/// What becomes of files that are already where an output or the report is to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Existing {
    /// They are replaced when the run is done, and keep their permissions.
    #[default]
    Replace,
    /// The run is refused before any work, with exit code 1; a file that appears meanwhile is not
    /// replaced either.
    Refuse,
}
/// Threads that a run has at most.
pub const MOST_THREADS: usize = 1024;

/// What becomes of points whose coordinates are not finite.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Nonfinite {
    /// The run fails and names the first.
    #[default]
    Refuse,
    /// They are removed, entered in the ledger as such.
    Drop,
}

/// What becomes of scans whose points contradict their header.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Headers {
    /// The run fails and names what differs.
    #[default]
    Refuse,
    /// A warning names it: for files whose writer did not keep the header up.
    Warn,
}

/// What becomes of scans whose x, y and z have different units.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum MixedUnits {
    /// The run fails and names the units, unless `z_scale` is given.
    #[default]
    Refuse,
    /// All are taken for one unit.
    Ignore,
}

/// What z is multiplied by.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum ZScale {
    /// What the units in the coordinate reference system ask for; refused where it does not tell
    /// both.
    Auto,
    /// This number, above 0.
    Factor(f64),
}

/// What becomes of points that the scan itself says are of no use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Treatment {
    /// They take no part and are removed, entered in the ledger as such.
    #[default]
    Drop,
    /// They are points like all others.
    Keep,
    /// They take no part and are written as they are.
    Ignore,
}

/// Where decoded points wait for the mill.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum SpillSetting {
    /// In memory as far as it goes, on disk beyond.
    #[default]
    Auto,
    /// On disk, all of them.
    Always,
}

/// Which of the equal code paths runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum SimdSetting {
    /// The fastest that the processor has.
    #[default]
    Auto,
    /// 256-bit vectors of x86-64; the run is refused where the processor has none.
    Avx2,
    /// 512-bit vectors of x86-64, likewise.
    Avx512,
    /// The one that every processor has.
    Portable,
}

impl SimdSetting {
    /// What kernels are to run by.
    ///
    /// # Errors
    ///
    /// If this processor does not have it.
    pub(crate) fn resolve(self) -> Result<simd::Simd> {
        let level = match self {
            SimdSetting::Auto => return Ok(simd::Simd::best()),
            SimdSetting::Avx2 => Level::Avx2,
            SimdSetting::Avx512 => Level::Avx512,
            SimdSetting::Portable => Level::Portable,
        };
        simd::Simd::of(level).ok_or_else(|| {
            Error::pipeline(format!("this processor has no {}", level.name()))
                .help("leave `run.simd` out: the fastest that is there is taken")
        })
    }
}

/// What a command line or a program puts in the place of `[run]` settings.
///
/// ```
/// use pointmill::Overrides;
/// use pointmill::graph::RunSettings;
///
/// let settings = RunSettings { memory: Some(1 << 30), ..RunSettings::default() };
/// let overrides = Overrides { memory: Some(256 << 20), ..Overrides::default() };
/// assert_eq!(settings.with(&overrides).memory, Some(256 << 20));
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Overrides {
    /// For [`RunSettings::memory`], in bytes.
    pub memory: Option<u64>,
    /// For [`RunSettings::threads`].
    pub threads: Option<NonZeroUsize>,
    /// For [`RunSettings::scratch`].
    pub scratch: Option<PathBuf>,
    /// For [`RunSettings::report`].
    pub report: Option<PathBuf>,
}

impl RunSettings {
    /// These settings with those of `overrides` that are given.
    pub fn with(self, overrides: &Overrides) -> RunSettings {
        let over = overrides.clone();
        RunSettings {
            memory: over.memory.or(self.memory),
            threads: over.threads.or(self.threads),
            scratch: over.scratch.or(self.scratch),
            report: over.report.or(self.report),
            ..self
        }
    }
}

impl RunSettings {
    /// Those of these settings alone that decide about the bytes of outputs.
    pub(crate) fn deciding(&self) -> RunSettings {
        // All are named: whoever adds one says here of which kind it is.
        let RunSettings {
            lattice,
            z_scale,
            units,
            nonfinite,
            headers,
            withheld,
            noise,
            memory: _,
            threads: _,
            scratch: _,
            report: _,
            existing: _,
            tile_points: _,
            simd: _,
            spill: _,
            provenance: _,
        } = *self;
        let others = RunSettings::default();
        RunSettings { lattice, z_scale, units, nonfinite, headers, withheld, noise, ..others }
    }

    /// True if outputs say how they were made.
    pub(crate) fn has_provenance(&self) -> bool {
        self.provenance != Some(false)
    }
}

impl Serialize for ZScale {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self {
            ZScale::Auto => to.serialize_str("auto"),
            ZScale::Factor(factor) => to.serialize_f64(*factor),
        }
    }
}

impl<'de> Deserialize<'de> for ZScale {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Factor;
        impl de::Visitor<'_> for Factor {
            type Value = ZScale;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a number above 0, or \"auto\"")
            }

            fn visit_f64<E: de::Error>(self, factor: f64) -> Result<ZScale, E> {
                match factor.is_finite() && factor > 0.0 {
                    true => Ok(ZScale::Factor(factor)),
                    false => Err(E::invalid_value(de::Unexpected::Float(factor), &self)),
                }
            }

            fn visit_i64<E: de::Error>(self, factor: i64) -> Result<ZScale, E> {
                self.visit_f64(factor as f64)
            }

            fn visit_u64<E: de::Error>(self, factor: u64) -> Result<ZScale, E> {
                self.visit_f64(factor as f64)
            }

            fn visit_str<E: de::Error>(self, word: &str) -> Result<ZScale, E> {
                match word {
                    "auto" => Ok(ZScale::Auto),
                    _ => Err(E::invalid_value(de::Unexpected::Str(word), &self)),
                }
            }
        }
        from.deserialize_any(Factor)
    }
}

has_schema!(ZScale, "ZScale", {
    "anyOf": [{ "type": "number", "exclusiveMinimum": 0 }, { "const": "auto" }],
});

fn above_0(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "number", "exclusiveMinimum": 0 })
}

fn some_threads<'de, D: Deserializer<'de>>(from: D) -> Result<Option<NonZeroUsize>, D::Error> {
    let threads = Whole::<1, { MOST_THREADS as u64 }>::deserialize(from)?;
    Ok(NonZeroUsize::new(threads.get() as usize))
}

fn some_step<'de, D: Deserializer<'de>>(from: D) -> Result<Option<f64>, D::Error> {
    struct StepVisitor;
    impl de::Visitor<'_> for StepVisitor {
        type Value = f64;

        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            f.write_str("a number above 0, in the scan's unit and without a unit behind it")
        }

        fn visit_f64<E: de::Error>(self, step: f64) -> Result<f64, E> {
            match step.is_finite() && step > 0.0 {
                true => Ok(step),
                false => Err(E::invalid_value(de::Unexpected::Float(step), &self)),
            }
        }

        fn visit_i64<E: de::Error>(self, step: i64) -> Result<f64, E> {
            self.visit_f64(step as f64)
        }

        fn visit_u64<E: de::Error>(self, step: u64) -> Result<f64, E> {
            self.visit_f64(step as f64)
        }
    }
    from.deserialize_any(StepVisitor).map(Some)
}
