//! What the first phase stores: pairs of numbers.
//!
//! An initial cell that can be divided is two pairs, (x, CELL) and (y, z) of its Morton-first
//! position; its divisions follow, each (range, parts more that it makes), every part's before
//! those of its own parts. A tile ends with (records kept whatever is divided, KEPT).

use crate::Result;
use crate::point::Position;
use crate::stage::Gathered;

/// A division has less than these in its second number.
const CELL: u64 = 1 << 62;
const KEPT: u64 = 2 << 62;

/// The sign of an f64.
const SIGN: u64 = 1 << 63;

/// What was stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Entry {
    /// Records that are kept whatever is divided.
    Kept(u64),
    /// An initial cell that can be divided, by its Morton-first position.
    Cell(Position),
    /// A division of the last cell.
    Division {
        /// Its range of angles, the widest first: see [`key`].
        key: u64,
        /// How many parts more it makes.
        parts: u64,
    },
}

/// Numbers that compare as the cosines do: ranges of angles from the widest to the narrowest.
pub(super) fn key(cosine: f64) -> u64 {
    let bits = (cosine + 0.0).to_bits(); // −0 + 0 = 0
    if bits & SIGN == 0 { bits | SIGN } else { !bits }
}

/// The cosine that has this key.
pub(super) fn cosine(key: u64) -> f64 {
    f64::from_bits(if key & SIGN == 0 { !key } else { key & !SIGN })
}

/// See [`Entry::Division`].
pub(super) fn division(cosine: f64, parts: u64) -> [u64; 2] {
    [key(cosine), parts]
}

/// See [`Entry::Cell`].
pub(super) fn cell([x, y, z]: Position) -> [[u64; 2]; 2] {
    [[x as u64, CELL], [y as u64, z as u64]]
}

/// See [`Entry::Kept`].
pub(super) fn kept(records: u64) -> [u64; 2] {
    [records, KEPT]
}

/// Calls `visit` with all that was stored, in order.
pub(super) fn each(found: &dyn Gathered, mut visit: impl FnMut(Entry)) -> Result<()> {
    let mut begun = None;
    found.each(&mut |stretch| {
        for &[a, b] in stretch {
            match (begun.take(), b) {
                (Some(x), _) => visit(Entry::Cell([x, a as i64, b as i64])),
                (None, CELL) => begun = Some(a as i64),
                (None, KEPT) => visit(Entry::Kept(a)),
                (None, parts) => visit(Entry::Division { key: a, parts }),
            }
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_compare_as_cosines_and_give_them_back() {
        let cosines =
            [-1.5, -1.0, -0.5, -1e-300, 0.0, 1e-300, 0.5, 1.0 - f64::EPSILON, 1.0, f64::INFINITY];
        assert!(cosines.map(key).is_sorted_by(|a, b| a < b));
        assert_eq!(cosines.map(|c| cosine(key(c))), cosines);
        assert_eq!(key(-0.0), key(0.0));
    }

    struct Stretches(Vec<Vec<[u64; 2]>>);

    impl Gathered for Stretches {
        fn each(&self, visit: &mut dyn FnMut(&[[u64; 2]]) -> Result<()>) -> Result<()> {
            self.0.iter().try_for_each(|stretch| visit(stretch))
        }

        fn records(&self) -> u64 {
            0
        }
    }

    #[test]
    fn what_is_stored_comes_back_however_it_is_cut() {
        let entries = [
            Entry::Cell([-1, i64::MIN, 1 << 62]),
            Entry::Division { key: key(-0.25), parts: 7 },
            Entry::Division { key: key(0.25), parts: 1 },
            Entry::Kept(12),
            Entry::Cell([1 << 62, -(2 << 61), i64::MAX]),
            Entry::Kept(0),
        ];
        let mut stored = Vec::new();
        for entry in entries {
            match entry {
                Entry::Kept(records) => stored.push(kept(records)),
                Entry::Cell(position) => stored.extend(cell(position)),
                Entry::Division { key, parts } => stored.push(division(cosine(key), parts)),
            }
        }
        for length in 1..=stored.len() {
            let stretches = Stretches(stored.chunks(length).map(<[_]>::to_vec).collect());
            let mut back = Vec::new();
            each(&stretches, |entry| back.push(entry)).unwrap();
            assert_eq!(back, entries, "stretches of {length}");
        }
    }
}
