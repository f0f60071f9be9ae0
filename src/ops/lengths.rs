//! Lengths of stages, which the lattice rounds to whole steps.

use crate::geom::lattice::Lattice;
use crate::quantity::Figure;

/// What to tell of a length, given as the key `address`, that is not what it was given as.
pub(super) fn rounded(lattice: &Lattice, address: &str, length: f64) -> Option<String> {
    let held = Figure(lattice.rounded(length)?);
    let (length, steps) = (Figure(length), lattice.step);
    Some(format!(
        "`{address} = {length}` is {held} here: lengths are whole steps of the lattice, {steps}; \
         `run.lattice` makes finer ones"
    ))
}
