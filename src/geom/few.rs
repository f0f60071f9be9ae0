//! Sorting a few keys by counting. Knows no tiles, no stages.

/// Most keys that are sorted so.
pub const FEW: usize = 32;
/// Keys that are counted for together.
const LANES: usize = 8;

/// For each key the number of smaller ones: its place in ascending order, if keys are distinct.
/// What follows the last key's has no meaning, nor has what exceeds [`FEW`] keys.
///
/// Of a dozen keys every second comparison surprises the processor; here no branch depends on one,
/// and the loops over lanes become vector instructions.
#[inline]
pub fn places(keys: &[u32]) -> [u32; FEW] {
    let keys = &keys[..keys.len().min(FEW)];
    let mut padded = [u32::MAX; FEW];
    padded[..keys.len()].copy_from_slice(keys);
    let mut places = [0; FEW];
    let blocks = places.chunks_exact_mut(LANES).zip(padded.chunks_exact(LANES));
    for (places, padded) in blocks.take(keys.len().div_ceil(LANES)) {
        let mut smaller = [0; LANES];
        for &other in keys {
            for lane in 0..LANES {
                smaller[lane] += u32::from(other < padded[lane]);
            }
        }
        places.copy_from_slice(&smaller);
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;

    proptest::proptest! {
        #[test]
        fn places_are_those_of_a_sort(
            keys in proptest::collection::hash_set(proptest::num::u32::ANY, 0..=FEW),
        ) {
            let keys: Vec<u32> = keys.into_iter().collect();
            let mut placed = vec![0; keys.len()];
            for (key, place) in keys.iter().zip(places(&keys)) {
                placed[place as usize] = *key;
            }
            let mut sorted = keys.clone();
            sorted.sort_unstable();
            proptest::prop_assert_eq!(placed, sorted);
        }
    }
}
