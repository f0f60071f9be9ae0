//! Temporary.
use super::Nearest;
use crate::point::{Position, distance2};
use std::collections::HashMap;

impl Nearest {
    /// Temporary.
    pub fn search_among(
        &mut self,
        others: &[Position],
        queries: &[Position],
        k: usize,
        within: i64,
        mut visit: impl FnMut(usize, &[u32]),
    ) {
        let side = (within / 4).max(1);
        let place = |p: &Position| p.map(|v| v.div_euclid(side));
        let mut cubes: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
        for (i, p) in others.iter().enumerate() {
            cubes.entry(place(p)).or_default().push(i as u32);
        }
        let most = (within as u128) * (within as u128);
        let mut found: Vec<(u128, u32)> = Vec::new();
        let mut ranks = Vec::new();
        for (i, q) in queries.iter().enumerate() {
            found.clear();
            let at = place(q);
            for shell in 0i64..=5 {
                for x in -shell..=shell {
                    for y in -shell..=shell {
                        for z in -shell..=shell {
                            if x.abs().max(y.abs()).max(z.abs()) != shell {
                                continue;
                            }
                            if let Some(c) = cubes.get(&[at[0] + x, at[1] + y, at[2] + z]) {
                                for &j in c {
                                    let d = distance2(*q, others[j as usize]);
                                    if d <= most {
                                        found.push((d, j));
                                    }
                                }
                            }
                        }
                    }
                }
                found.sort_unstable();
                let proven = (shell * side) as u128;
                if found.len() >= k && found[k - 1].0 < proven * proven {
                    break;
                }
            }
            ranks.clear();
            ranks.extend(found.iter().take(k).map(|f| f.1));
            visit(i, &ranks);
        }
    }
}
