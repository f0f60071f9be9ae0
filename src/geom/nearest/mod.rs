//! The k nearest neighbours of every position of a set, exactly. Knows no tiles, no files.
//!
//! Nearest is by exact integer squared distance, ties by index. The search itself is done in 32-bit
//! floats, 16 points at a time, and every point's answer is then proven or redone in integers:
//!
//! - Coordinates are relative to a run of 256 points in Morton order, which is near to the
//!   points that look at it. While all coordinates are integers up to 2^24, differences below 2^12
//!   and sums of their squares below 2^24 are exact, and what is farther gets a float of 2^24 or
//!   more (rounding is monotonic). A set whose last float distance is below 2^24 is therefore
//!   exact, ties included.
//! - Otherwise let e bound the error of a coordinate difference. The stored points of two runs are
//!   off by half a unit in the last place each; moving a point to another frame rounds the shift
//!   and the sum. The difference, its square and the two sums round five times more, each by a
//!   factor within 1 ± 2^-24. For a true distance d and the float f of its square this leaves
//!   |√f − d| ≤ √3·e + 2^-22·√f, with room to spare. The set of k is exact if the k-th √f plus its
//!   error is below the (k+1)-th √f less its own: nothing unseen has a smaller float than that, or,
//!   passed over by a box of positions, a smaller distance. Its order is then that of exact
//!   distances.
//! - A point without such a gap is searched for again in integers alone, within the exact distance
//!   of the k candidates at hand.

mod among;
mod batch;
mod exact;
mod kernel;
mod own;
mod refine;
#[cfg(test)]
mod tests;
mod tree;
mod walk;

pub use among::NearestAmong;
pub use own::Nearest;
