//! The smallest scan that still shows what was found: delta debugging (Zeller and Hildebrandt:
//! Simplifying and isolating failure-inducing input, IEEE TSE 28(2), 2002) over the records.

use super::made::MadeScan;

/// Scans that are tried at most.
const TRIES: usize = 200;

/// The smallest part of `scan` that is found for which `breaks` gives something, and what it gave.
/// `found` is what it gave for all of it.
pub(super) fn smallest<T>(
    scan: MadeScan,
    found: T,
    mut breaks: impl FnMut(&MadeScan) -> Option<T>,
) -> (MadeScan, T) {
    let (mut scan, mut found, mut tries) = (scan, found, 0);
    let mut pieces = 2;
    while scan.len() > 0 && tries < TRIES {
        let (len, size) = (scan.len(), scan.len().div_ceil(pieces));
        let smaller = (0..len).step_by(size).find_map(|begin| {
            tries += 1;
            let others: Vec<usize> =
                (0..len).filter(|n| !(begin..begin + size).contains(n)).collect();
            let smaller = scan.only(&others);
            breaks(&smaller).map(|found| (smaller, found))
        });
        match smaller {
            Some((smaller, now)) => {
                (scan, found) = (smaller, now);
                pieces = (pieces - 1).max(2);
            }
            None if size == 1 => break,
            None => pieces = (2 * pieces).min(len),
        }
    }
    (scan, found)
}
