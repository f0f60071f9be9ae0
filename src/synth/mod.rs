//! Scans that are computed instead of read: seeded, of any size, never held. A scan is a function
//! of its scene, number of points, seed and noise alone, whatever the batches and whoever makes
//! which part. Knows no files.

mod als;
mod front;
mod kind;
mod landscape;
mod part;
mod plane;
mod random;
mod record;
mod relief;
mod scene;
mod sphere;
mod squares;
mod synthetic;
mod truth;

pub use front::{Front, NoiseIn, SquaresProjection};
pub use kind::Synth;
#[cfg(feature = "testing")]
pub(crate) use random::Random;
pub use scene::Scene;
pub use synthetic::Synthetic;
pub use truth::Truth;

#[cfg(test)]
mod tests;
