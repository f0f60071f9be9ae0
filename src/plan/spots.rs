//! Which records of a stretch of the input a trial works on: all those in a few columns of space,
//! so that each has the neighbours that it has in the scan. Records thinned evenly would not.

/// Fine columns along each of the two axes, as a power of two.
const BITS: u32 = 8;

/// Where records lie: the fine column of each, numbered so that those of a larger column follow
/// each other.
pub(super) struct Spots {
    columns: Vec<u16>,
}

impl Spots {
    /// Of records at these places; those that are nowhere are in the first column.
    pub fn of(places: impl Iterator<Item = [f64; 3]> + Clone) -> Spots {
        let (mut lo, mut hi) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for at in places.clone().filter(|at| at.iter().all(|x| x.is_finite())) {
            for axis in 0..3 {
                lo[axis] = lo[axis].min(at[axis]);
                hi[axis] = hi[axis].max(at[axis]);
            }
        }
        let [a, b] = widest(lo, hi);
        // Of one width along both axes: a column is a square.
        let side = (hi[a] - lo[a]) / f64::from(1 << BITS);
        let number = |at: [f64; 3], axis: usize| {
            let number = (at[axis] - lo[axis]) / side;
            (number as u16).min((1 << BITS) - 1) // what is no number is 0
        };
        let columns = places.map(|at| interleaved(number(at, a), number(at, b)));
        Spots { columns: columns.collect() }
    }

    /// The records in about `count` columns, spread evenly over the records, that hold about
    /// `records` in all: for each record whether it is one of them.
    pub fn chosen(&self, count: usize, records: usize) -> Vec<bool> {
        let level = self.level(records as f64 / count.max(1) as f64);
        let mut held = vec![0usize; 1 << (2 * BITS - level)];
        self.columns.iter().for_each(|fine| held[usize::from(fine >> level)] += 1);
        let mut is_chosen = vec![false; held.len()];
        let (mut column, mut behind) = (0, held.first().copied().unwrap_or_default());
        for n in 0..count {
            let rank = self.columns.len() * (2 * n + 1) / (2 * count);
            while behind <= rank && column + 1 < held.len() {
                column += 1;
                behind += held[column];
            }
            is_chosen[column] = true;
        }
        self.columns.iter().map(|fine| is_chosen[usize::from(fine >> level)]).collect()
    }

    /// Bits of a fine column that a column leaves out which holds about so many records, as a
    /// record sees it: most records are in columns that hold more than the average.
    fn level(&self, records: f64) -> u32 {
        let mut held = vec![0u64; 1 << (2 * BITS)];
        self.columns.iter().for_each(|fine| held[usize::from(*fine)] += 1);
        let all = self.columns.len().max(1) as f64;
        let mut best = (f64::INFINITY, 0);
        for level in (0..2 * BITS).step_by(2) {
            let squares = held.iter().map(|&held| held as f64 * held as f64).sum::<f64>();
            let off = (squares / all / records).ln().abs();
            if off < best.0 {
                best = (off, level);
            }
            held = held.chunks(4).map(|four| four.iter().sum()).collect();
        }
        best.1
    }
}

/// The two axes along which a box is widest, the wider first.
fn widest(lo: [f64; 3], hi: [f64; 3]) -> [usize; 2] {
    let mut axes = [0, 1, 2];
    axes.sort_by(|&a, &b| (hi[b] - lo[b]).total_cmp(&(hi[a] - lo[a])));
    [axes[0], axes[1]]
}

/// The bits of two numbers in turn.
fn interleaved(a: u16, b: u16) -> u16 {
    (0..BITS)
        .fold(0, |code, bit| code | (a >> bit & 1) << (2 * bit + 1) | (b >> bit & 1) << (2 * bit))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_columns_of_about_the_wanted_size_are_chosen() {
        // A million records of a plane a thousand wide; the height is any.
        let at = |n: u32| [f64::from(n % 1000), 0.001 * f64::from(n % 7), f64::from(n / 1000)];
        let places = (0..1_000_000).map(at);
        let chosen = Spots::of(places.clone()).chosen(8, 240_000);
        let count = chosen.iter().filter(|chosen| **chosen).count();
        assert!((100_000..400_000).contains(&count), "{count}");
        // A record has all of its neighbours, but at the faces of columns.
        let is = |n: u32| chosen[n as usize];
        let inner = (1..999).flat_map(|y| (1..999).map(move |x| y * 1000 + x)).filter(|n| is(*n));
        let whole = |n: &u32| is(n - 1) && is(n + 1) && is(n - 1000) && is(n + 1000);
        let (all, whole) = (inner.clone().count(), inner.filter(whole).count());
        assert!(whole * 100 > all * 95, "{whole} of {all}");
    }

    #[test]
    fn one_place_and_no_number_are_no_trouble() {
        for places in [vec![], vec![[1.0; 3]; 100], vec![[f64::NAN, 0.0, f64::INFINITY]; 5]] {
            let chosen = Spots::of(places.iter().copied()).chosen(8, 10);
            assert_eq!(chosen, vec![true; places.len()]);
        }
    }
}
