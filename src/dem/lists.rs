//! Contact lists: which grains and walls may touch before the next rebuild, with the springs of those that do.
//!
//! Pairs are sorted by (i, j), wall contacts by (wall, grain); forces are added in this order, which fixes the bits.
//! Springs are stored beside their contact and move with it when the lists are rebuilt and the grains renumbered.

use super::vector::{Row4, Row8};

/// Springs of listed contacts, one entry per contact in every array.
#[derive(Debug, Clone, Default)]
pub struct History {
    /// Sliding spring ξ, 0, rolling spring ξ_r, 0 [m].
    pub springs: Vec<Row8>,
    /// Evaluation at which the contact last touched; older than the last one means the springs are void.
    pub touched: Vec<u32>,
    /// Whether a liquid bridge exists.
    pub bridge: Vec<bool>,
}

/// What a contact needs besides its ends: γ_n [kg/s], D [m], sliding friction, rolling friction.
pub type Constants = Row4;

/// Listed pairs of grains.
#[derive(Debug, Clone, Default)]
pub struct PairList {
    /// The two grains, i < j.
    pub ends: Vec<[u32; 2]>,
    /// Constants of the contact.
    pub constants: Vec<Constants>,
    /// Springs.
    pub history: History,
    /// First pair of each grain, up to the last grain that has one.
    start: Vec<u32>,
}

/// Listed contacts of grains with walls.
#[derive(Debug, Clone, Default)]
pub struct WallList {
    /// The grain.
    pub grain: Vec<u32>,
    /// Constants of the contact.
    pub constants: Vec<Constants>,
    /// Springs.
    pub history: History,
    /// Contacts of wall w are `start[w]..start[w + 1]`, in ascending order of grain.
    pub start: Vec<u32>,
}

impl History {
    fn clear(&mut self) {
        self.springs.clear();
        self.touched.clear();
        self.bridge.clear();
    }

    /// Appends entry `from` of `old`, its sliding spring multiplied by `sign`; or an empty entry.
    fn push(&mut self, old: &Self, from: Option<usize>, sign: f64) {
        let Some(k) = from else {
            self.springs.push(Row8::default());
            self.touched.push(0);
            self.bridge.push(false);
            return;
        };
        let mut springs = old.springs[k];
        springs[..3].iter_mut().for_each(|spring| *spring *= sign);
        self.springs.push(springs);
        self.touched.push(old.touched[k]);
        self.bridge.push(old.bridge[k]);
    }

    /// Springs of entry `k` in evaluation `tick`: void unless the contact touched in the one before.
    #[inline(always)]
    pub fn live(&self, k: usize, tick: u32) -> Row8 {
        // A product, not a branch: the row stays in a register.
        let keep = if self.touched[k] + 1 == tick { 1.0 } else { 0.0 };
        Row8(self.springs[k].map(|spring| spring * keep))
    }

    /// Entry `to` becomes what entry `from` is.
    pub fn copy(&mut self, from: usize, to: usize) {
        self.springs[to] = self.springs[from];
        self.touched[to] = self.touched[from];
        self.bridge[to] = self.bridge[from];
    }
}

impl PairList {
    /// Number of listed pairs.
    pub fn len(&self) -> usize {
        self.ends.len()
    }

    /// Empties the list.
    pub fn clear(&mut self) {
        self.ends.clear();
        self.constants.clear();
        self.history.clear();
        self.start.clear();
    }

    /// Appends the pair (i, j), which was (a, b) in the numbering of `old`.
    ///
    /// Where the order of the two is reversed the sliding spring changes sign, because it belongs to v_i - v_j; the rolling
    /// spring does not, because n and ω_i - ω_j both change sign.
    pub fn push(&mut self, ends: [u32; 2], constants: Constants, old: &Self, [a, b]: [u32; 2]) {
        let (from, sign) = if a < b { (old.find(a, b), 1.0) } else { (old.find(b, a), -1.0) };
        // `start` is filled as the pairs come: grains without pairs get an empty range.
        while self.start.len() <= ends[0] as usize {
            self.start.push(self.ends.len() as u32);
        }
        self.ends.push(ends);
        self.constants.push(constants);
        self.history.push(&old.history, from, sign);
    }

    /// Pairs whose first grain is `i`.
    fn of_grain(&self, i: u32) -> std::ops::Range<usize> {
        let bound = |k: usize| self.start.get(k).map_or(self.ends.len(), |&first| first as usize);
        bound(i as usize)..bound(i as usize + 1)
    }

    fn find(&self, i: u32, j: u32) -> Option<usize> {
        self.of_grain(i).find(|&k| self.ends[k][1] == j)
    }
}

impl WallList {
    /// Number of listed contacts.
    pub fn len(&self) -> usize {
        self.grain.len()
    }

    /// Empties the list.
    pub fn clear(&mut self) {
        self.grain.clear();
        self.constants.clear();
        self.history.clear();
        self.start.clear();
    }

    /// Appends a contact, which was entry `from` of `old`.
    pub fn push(&mut self, grain: u32, constants: Constants, old: &Self, from: Option<usize>) {
        self.grain.push(grain);
        self.constants.push(constants);
        self.history.push(&old.history, from, 1.0);
    }

    /// Entries of a wall.
    pub fn of_wall(&self, wall: usize) -> std::ops::Range<usize> {
        match (self.start.get(wall), self.start.get(wall + 1)) {
            (Some(&first), Some(&last)) => first as usize..last as usize,
            _ => 0..0,
        }
    }

    /// Entry of (wall, grain).
    pub fn find(&self, wall: usize, grain: u32) -> Option<usize> {
        let range = self.of_wall(wall);
        let first = range.start;
        self.grain[range].binary_search(&grain).ok().map(|k| first + k)
    }
}
