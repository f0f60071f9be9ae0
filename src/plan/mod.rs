//! From a graph, the headers of its inputs and the memory to a [`Plan`]: do the stages fit each
//! other, the inputs and the memory? What will its run use? Knows no stage by name, and reads no
//! point but a few that it looks at and those of a trial.

mod accepted;
mod columns;
mod demanded;
mod document;
mod fitted;
mod limits;
mod look;
mod meshes;
mod order;
mod outline;
mod passes;
mod places;
mod prediction;
mod preview;
mod pull;
mod rehearsal;
mod shown;
mod sized;
mod sorted;
mod spots;
mod streaming;
mod stretch;
mod told;
mod transforms;
mod trial;
mod trial_reading;

pub use fitted::Plan;
pub use outline::Outline;
pub use prediction::{PredictedOutput, PredictedPhase, Prediction};
pub use preview::Preview;
pub use pull::Pulled;
pub use sized::FittedSize;
pub use trial::{Trial, TrialPoints};
