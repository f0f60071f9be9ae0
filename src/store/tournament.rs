//! The merge's choice: which of many runs goes on first.
//!
//! Runs that cover the same ground take turns at random, so a heap of positions mispredicts at
//! every level. Here each level of a tree keeps the earlier of two keys of 63 bits by selection,
//! without a branch. Keys tie where a range is wider than 21 levels of the octree; what ties is
//! compared exactly by the merge.

use std::hint::select_unpredictable;

/// A run and the key of its next position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Head {
    pub key: u64,
    pub run: usize,
}

impl Head {
    /// Behind all others: that of a run which has ended.
    const END: Head = Head { key: u64::MAX, run: 0 };

    fn or_earlier(self, other: Head) -> Head {
        let earlier = other.key < self.key;
        Head {
            key: select_unpredictable(earlier, other.key, self.key),
            run: select_unpredictable(earlier, other.run, self.run),
        }
    }
}

/// A tree of which each node knows the first head below it. A change of one run costs as many
/// comparisons as the tree has levels, and none is a branch: which run goes on is as good as random
/// where runs cover the same ground.
#[derive(Debug)]
pub(crate) struct Tournament {
    /// Node 1 is the root, nodes 2n and 2n + 1 are below node n, and the last half are the runs.
    firsts: Vec<Head>,
}

impl Tournament {
    /// A tournament of so many runs, all ended.
    pub fn new(runs: usize) -> Self {
        Tournament { firsts: vec![Head::END; 2 * runs] }
    }

    /// Tells the key of a run's head, less than `u64::MAX`; None if it has ended.
    pub fn set(&mut self, run: usize, key: Option<u64>) {
        let mut node = self.firsts.len() / 2 + run;
        let mut head = key.map_or(Head::END, |key| Head { key, run });
        self.firsts[node] = head;
        while node > 1 {
            head = head.or_earlier(self.firsts[node ^ 1]);
            node /= 2;
            self.firsts[node] = head;
        }
    }

    /// The head with the least key; None if all runs have ended.
    pub fn first(&self) -> Option<Head> {
        self.firsts.get(1).copied().filter(|head| *head != Head::END)
    }

    /// The head with the least key of all runs but that of [`first`](Tournament::first): of the
    /// same key if two have it; None if the others have ended.
    pub fn second(&self) -> Option<Head> {
        let mut node = self.firsts.len() / 2 + self.first()?.run;
        let mut second = Head::END;
        while node > 1 {
            second = second.or_earlier(self.firsts[node ^ 1]);
            node /= 2;
        }
        Some(second).filter(|head| *head != Head::END)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_of_any_number_come_in_order() {
        for runs in 0..20 {
            let key = |i: usize| (i.wrapping_mul(0x9e37_79b9) >> 4 & 0xff) as u64;
            let mut left: Vec<Vec<u64>> = (0..runs)
                .map(|run| (0..run * 7 % 31).map(|i| key(run * 100 + i)).collect())
                .collect();
            left.iter_mut().for_each(|run| run.sort_by(|a, b| b.cmp(a)));
            let mut expected: Vec<u64> = left.concat();
            expected.sort();
            let mut tournament = Tournament::new(runs);
            (0..runs).for_each(|run| tournament.set(run, left[run].last().copied()));
            for key in expected {
                let Some(first) = tournament.first() else {
                    panic!("{runs} runs end before {key}")
                };
                assert_eq!((first.key, left[first.run].last()), (key, Some(&key)));
                let others = left.iter().enumerate().filter(|(run, _)| *run != first.run);
                let second = others.filter_map(|(_, run)| run.last().copied()).min();
                assert_eq!(tournament.second().map(|head| head.key), second);
                left[first.run].pop();
                tournament.set(first.run, left[first.run].last().copied());
            }
            assert_eq!(tournament.first(), None);
            assert_eq!(tournament.second(), None);
        }
    }
}
