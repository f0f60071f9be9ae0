//! The positions of a tile's zone by the cubes of a grid that they are in, and cubes by their
//! place. Knows not what is chosen of them.

use crate::point::Position;
use crate::tile::Tile;

/// Cubes of a side, anchored at world 0, that have a position of a tile's zone which the stage
/// decides about.
///
/// They are numbered as they are met in Morton order, so that neighbours are near in memory.
pub(super) struct CellTable {
    side: i64,
    /// Number of a cube and 1, or 0, where the hash of its place or a slot behind says.
    slots: Vec<u32>,
    /// Place of each cube: its indices along the axes.
    places: Vec<[i64; 3]>,
    /// Indices of positions, cube after cube; those that stay come first in a cube once it was
    /// visited.
    members: Vec<u32>,
    /// End of each cube in `members`.
    ends: Vec<u32>,
    /// How many of each cube stay, so far as is known.
    kept: Vec<u32>,
}

/// Where a position is in no cube.
const NONE: u32 = u32::MAX;

impl CellTable {
    /// Bytes for each position of the tile: slots are two to four, and cubes as many at most.
    pub const BYTES: usize = 4 * size_of::<u32>() + size_of::<[i64; 3]>() + 4 * size_of::<u32>();

    /// The cubes of `side` steps. A tile has fewer than 2^32 positions.
    pub fn of(tile: &Tile, side: i64) -> CellTable {
        let n = tile.positions.len();
        let mut table = CellTable {
            side,
            slots: vec![0; (2 * n).next_power_of_two()],
            places: Vec::with_capacity(n),
            members: Vec::new(),
            ends: Vec::new(),
            kept: Vec::new(),
        };
        let mut cubes = Vec::with_capacity(n);
        for (i, &p) in tile.positions.iter().enumerate() {
            let is_in = tile.in_zone(i) && tile.is_chosen(i);
            cubes.push(if is_in { table.enter(table.place(p)) } else { NONE });
        }
        table.sort(&cubes);
        table
    }

    /// Fills `members` from the cube of each position.
    fn sort(&mut self, cubes: &[u32]) {
        let is_in = |cube: &&u32| **cube != NONE;
        self.kept = vec![0; self.places.len()];
        self.ends = vec![0; self.places.len()];
        for &cube in cubes.iter().filter(is_in) {
            self.ends[cube as usize] += 1;
        }
        let mut begin = 0;
        for end in &mut self.ends {
            begin += std::mem::replace(end, begin);
        }
        self.members = vec![0; begin as usize];
        for (i, &cube) in cubes.iter().enumerate().filter(|(_, cube)| is_in(cube)) {
            let end = &mut self.ends[cube as usize];
            self.members[*end as usize] = i as u32;
            *end += 1;
        }
    }

    /// How many cubes there are.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// The indices of cube `number` along the axes.
    pub fn at(&self, number: usize) -> [i64; 3] {
        self.places[number]
    }

    /// The positions of cube `number`.
    pub fn members(&self, number: usize) -> &[u32] {
        &self.members[self.begin(number)..self.ends[number] as usize]
    }

    /// The positions that are known to stay of the cube at `place`.
    pub fn kept(&self, place: [i64; 3]) -> &[u32] {
        let Some(number) = self.find(place).1 else { return &[] };
        let begin = self.begin(number as usize);
        &self.members[begin..begin + self.kept[number as usize] as usize]
    }

    /// Enters that one more position of cube `number` stays. The others are in no order any more,
    /// and one is lost: whoever asks for members does so before.
    pub fn keep(&mut self, number: usize, position: u32) {
        let at = self.begin(number) + self.kept[number] as usize;
        self.members[at] = position;
        self.kept[number] += 1;
    }

    fn begin(&self, number: usize) -> usize {
        number.checked_sub(1).map_or(0, |before| self.ends[before] as usize)
    }

    fn place(&self, p: Position) -> [i64; 3] {
        p.map(|v| v.div_euclid(self.side))
    }

    /// The number of the cube at `place`, which it gets if it has none.
    fn enter(&mut self, place: [i64; 3]) -> u32 {
        if self.places.last() == Some(&place) {
            return self.places.len() as u32 - 1;
        }
        match self.find(place) {
            (_, Some(number)) => number,
            (slot, None) => {
                self.places.push(place);
                self.slots[slot] = self.places.len() as u32;
                self.places.len() as u32 - 1
            }
        }
    }

    /// The slot of the cube at `place`, or where it would be, and its number if it has one. Half
    /// of the slots are free at least, so that one is found.
    fn find(&self, place: [i64; 3]) -> (usize, Option<u32>) {
        let [x, y, z] = place.map(|v| v as u64);
        let sum = x
            .wrapping_mul(0x9e37_79b9_7f4a_7c15)
            .wrapping_add(y.wrapping_mul(0xbf58_476d_1ce4_e5b9))
            .wrapping_add(z.wrapping_mul(0x94d0_49bb_1331_11eb));
        // Of a product the highest bits depend on all.
        let mixed = (sum ^ (sum >> 32)).wrapping_mul(0xd6e8_feb8_6659_fd93);
        let mask = self.slots.len() - 1;
        let mut slot = (mixed >> 32) as usize & mask;
        loop {
            match self.slots[slot].checked_sub(1) {
                None => return (slot, None),
                Some(number) if self.places[number as usize] == place => {
                    return (slot, Some(number));
                }
                Some(_) => slot = (slot + 1) & mask,
            }
        }
    }
}
