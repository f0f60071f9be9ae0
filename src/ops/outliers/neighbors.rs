//! How many neighbours a point can be judged by.

use crate::{Error, Result};

/// Most neighbours that the stage takes.
pub const MAX_NEIGHBORS: usize = 64;

/// Refuses a number of neighbours outside 1 to 64.
pub(super) fn checked(key: &'static str, neighbors: usize) -> Result<usize, (&'static str, Error)> {
    if (1..=MAX_NEIGHBORS).contains(&neighbors) {
        return Ok(neighbors);
    }
    let told = format!("`{key}` must be 1 to {MAX_NEIGHBORS}, not {neighbors}");
    Err((key, Error::pipeline(told)))
}
