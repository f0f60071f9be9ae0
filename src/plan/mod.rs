//! From a graph, the headers of its inputs and the memory to a [`Plan`]: do the stages fit each
//! other, the inputs and the memory? Knows no stage by name, and reads no point but a few that it
//! looks at.

mod columns;
mod demanded;
mod fitted;
mod limits;
mod look;
mod order;
mod outline;
mod passes;
mod places;
mod pull;
mod shown;
mod sorted;
mod streaming;
mod stretch;
mod transforms;

pub use fitted::Plan;
pub use outline::Outline;
pub use pull::Pulled;
