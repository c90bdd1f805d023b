//! Contact lists: which grains and walls may touch before the next rebuild, with the springs of those that do.
//!
//! Pairs are sorted by (i, j) and wall contacts by wall; forces are added in this order, which fixes the bits. Those of one wall may
//! stand in any order, because a grain has one contact with it: the ones that touch come first, so that their vectors are full.
//! Springs are stored beside their contact and move with it when the lists are rebuilt and the grains renumbered.
//! Contacts stand in blocks of [`WIDTH`], one array per number, so that a vector of them is one load; a list is padded to whole
//! blocks with entries that belong to grain 0 and are never touched.

use super::checkpoint::stored;
use super::contact::{Constants, Friction, Springs};
use super::lanes::WIDTH;
use std::ops::Range;

/// One number of every contact in a block.
pub type Row = [f64; WIDTH];

/// Numbers of as many contacts as the widest vector holds.
#[derive(Debug, Clone, Default)]
#[repr(C, align(64))]
pub struct Block {
    /// Springs: ξ, then ξ_r [m]; zero unless the contact touched in the last evaluation.
    pub springs: [Row; 6],
    /// γ_n and γ_r [kg/s], D [m].
    pub constants: [Row; 3],
}

impl Block {
    /// Constants of lane `to` become those of lane `from` of another block.
    #[inline(always)]
    pub fn copy_constants(&mut self, to: usize, other: &Self, from: usize) {
        for (row, other) in self.constants.iter_mut().zip(&other.constants) {
            row[to] = other[from];
        }
    }

    /// The same for the springs.
    #[inline(always)]
    pub fn copy_springs(&mut self, to: usize, other: &Self, from: usize) {
        for (row, other) in self.springs.iter_mut().zip(&other.springs) {
            row[to] = other[from];
        }
    }
}

/// Constants and springs of listed contacts.
#[derive(Debug, Clone, Default)]
pub struct Entries {
    /// The contacts, padded to whole blocks.
    pub blocks: Vec<Block>,
    /// Whether a spring of the block may be other than zero.
    pub live: Vec<bool>,
    /// 1 where a liquid bridge exists, else 0; one row per block.
    pub bridge: Vec<Row>,
}

/// Listed pairs of grains.
#[derive(Debug, Clone, Default)]
pub struct PairList {
    /// The two grains, i < j, padded to whole blocks.
    pub ends: Vec<[u32; 2]>,
    /// Constants and springs.
    pub entries: Entries,
    /// Sliding and rolling friction of the pairs, one entry per block; none where every pair has the law's.
    pub frictions: Vec<[Row; 2]>,
    /// Number of pairs.
    len: usize,
    /// First pair of each grain, up to the last grain that has one.
    start: Vec<u32>,
}

/// All listed pairs: vectors of the first list are full of contacts; of the second, those that touch are looked for and then taken
/// full vectors at a time; those of the others see their second grain from across the ends of a period, one list for every
/// shift of [`super::period::Periods`].
#[derive(Debug, Clone, Default)]
pub struct Pairs {
    /// Pairs that touched at the last rebuild.
    pub touching: PairList,
    /// The others.
    pub apart: PairList,
    /// Pairs (i, j) of a grain near the lower ends and one near the upper, whose image is a shift below it.
    pub across: Vec<PairList>,
}

/// Listed contacts of grains with walls.
#[derive(Debug, Clone, Default)]
pub struct WallList {
    /// The grain; the contacts of every wall are padded to whole blocks.
    pub grain: Vec<u32>,
    /// Constants and springs.
    pub entries: Entries,
    /// Of each wall the first contact, the first of those that did not touch at the last rebuild, and the one after the last.
    ranges: Vec<[u32; 3]>,
}

stored!(Block { springs, constants });
stored!(Entries { blocks, live, bridge });
stored!(PairList { ends, entries, frictions, len, start });
stored!(Pairs { touching, apart, across });
stored!(WallList { grain, entries, ranges });

/// Which walls every grain may touch: the lists of walls the other way round.
#[derive(Debug, Clone, Default)]
pub struct Rivals {
    /// First of each grain, and the end of the last.
    start: Vec<u32>,
    walls: Vec<u32>,
}

impl Rivals {
    /// Reads the lists anew.
    pub fn index(&mut self, list: &WallList, grains: usize) {
        self.start.clear();
        self.start.resize(grains + 2, 0);
        let all = || (0..list.ranges.len()).flat_map(|w| list.of_wall(w).map(move |entry| (w, entry)));
        // Counted two places ahead, so that after the sum every place is the cursor of the grain before it.
        all().for_each(|(_, entry)| self.start[list.grain[entry] as usize + 2] += 1);
        for i in 1..self.start.len() {
            self.start[i] += self.start[i - 1];
        }
        self.walls.clear();
        self.walls.resize(self.start.last().map_or(0, |&count| count as usize), 0);
        for (w, entry) in all() {
            let cursor = &mut self.start[list.grain[entry] as usize + 1];
            self.walls[*cursor as usize] = w as u32;
            *cursor += 1;
        }
    }

    /// Walls that list a grain, in order.
    pub fn of_grain(&self, grain: u32) -> &[u32] {
        let [first, last] = [0, 1].map(|next| self.start[grain as usize + next] as usize);
        &self.walls[first..last]
    }
}

impl Entries {
    /// Whether the arrays hold whole blocks.
    fn is_consistent(&self) -> bool {
        self.live.len() == self.blocks.len() && self.bridge.len() == self.blocks.len()
    }

    fn clear(&mut self) {
        self.blocks.clear();
        self.live.clear();
        self.bridge.clear();
    }

    /// Number of entries with the padding.
    fn capacity(&self) -> usize {
        self.blocks.len() * WIDTH
    }

    /// Makes room for entry `k` and its block.
    fn reach(&mut self, k: usize) {
        if k == self.capacity() {
            self.blocks.push(Block::default());
            self.live.push(false);
            self.bridge.push(Row::default());
        }
    }

    /// Writes entry `k`: an older one with its sliding spring multiplied by `sign`, or an untouched one with `fresh` constants.
    fn put(&mut self, k: usize, older: Option<(&Self, usize)>, sign: f64, fresh: impl FnOnce() -> Constants) {
        let Some((old, from)) = older else {
            self.set_constants(k, &fresh());
            return;
        };
        let (block, lane) = (&mut self.blocks[k / WIDTH], k % WIDTH);
        block.copy_constants(lane, &old.blocks[from / WIDTH], from % WIDTH);
        if old.live[from / WIDTH] {
            block.copy_springs(lane, &old.blocks[from / WIDTH], from % WIDTH);
            block.springs[..3].iter_mut().for_each(|row| row[lane] *= sign);
            self.live[k / WIDTH] = true;
        }
        self.set_bridge(k, old.has_bridge(from));
    }

    fn set_constants(&mut self, k: usize, constants: &Constants) {
        let Constants { damping, rolling_damping, length } = *constants;
        for (row, number) in self.blocks[k / WIDTH].constants.iter_mut().zip([damping, rolling_damping, length]) {
            row[k % WIDTH] = number;
        }
    }

    /// Springs of entry `k`.
    pub fn springs(&self, k: usize) -> Springs {
        let (springs, lane) = (&self.blocks[k / WIDTH].springs, k % WIDTH);
        Springs { sliding: [0, 1, 2].map(|c| springs[c][lane]), rolling: [3, 4, 5].map(|c| springs[c][lane]) }
    }

    fn set_springs(&mut self, k: usize, springs: &Springs) {
        let numbers = springs.sliding.into_iter().chain(springs.rolling);
        for (row, number) in self.blocks[k / WIDTH].springs.iter_mut().zip(numbers) {
            row[k % WIDTH] = number;
        }
    }

    /// Rolling length of entry `k` [m].
    pub fn length(&self, k: usize) -> f64 {
        self.blocks[k / WIDTH].constants[2][k % WIDTH]
    }

    /// Whether entry `k` has a liquid bridge.
    pub fn has_bridge(&self, k: usize) -> bool {
        self.bridge[k / WIDTH][k % WIDTH] > 0.0
    }

    /// Makes or breaks the liquid bridge of entry `k`.
    pub fn set_bridge(&mut self, k: usize, exists: bool) {
        self.bridge[k / WIDTH][k % WIDTH] = f64::from(u8::from(exists));
    }

    /// Entry `to` takes springs and bridge of entry `from`.
    pub fn inherit(&mut self, from: usize, to: usize) {
        let springs = self.springs(from);
        self.set_springs(to, &springs);
        self.live[to / WIDTH] = true;
        self.set_bridge(to, self.has_bridge(from));
    }
}

impl PairList {
    /// Whether the list fits this number of grains.
    fn is_consistent(&self, grains: usize) -> bool {
        let known = |ends: &[u32; 2]| ends.iter().all(|&i| (i as usize) < grains);
        let whole = self.ends.len() == self.entries.capacity() && self.len <= self.ends.len();
        whole
            && self.entries.is_consistent()
            && (self.frictions.is_empty() || self.frictions.len() == self.entries.blocks.len())
            && self.ends.iter().all(known)
            && self.start.iter().all(|&first| first as usize <= self.len)
    }

    /// Number of listed pairs.
    pub fn len(&self) -> usize {
        self.len
    }

    /// The listed pairs.
    pub fn pairs(&self) -> &[[u32; 2]] {
        &self.ends[..self.len]
    }

    /// Empties the list.
    pub fn clear(&mut self) {
        self.ends.clear();
        self.entries.clear();
        self.frictions.clear();
        self.start.clear();
        self.len = 0;
    }

    /// Appends the pair (i, j), which was `older`; a pair new to the list asks for its constants. All pairs of a list have a
    /// friction of their own, or none has.
    fn push(
        &mut self,
        ends: [u32; 2],
        older: Option<(&Entries, usize)>,
        sign: f64,
        friction: Option<Friction>,
        fresh: impl FnOnce() -> Constants,
    ) {
        // `start` is filled as the pairs come: grains without pairs get an empty range.
        while self.start.len() <= ends[0] as usize {
            self.start.push(self.len as u32);
        }
        self.entries.reach(self.len);
        self.entries.put(self.len, older, sign, fresh);
        self.ends.resize(self.entries.capacity(), [0; 2]);
        self.ends[self.len] = ends;
        if let Some(Friction { sliding, rolling }) = friction {
            self.frictions.resize(self.entries.blocks.len(), [Row::default(); 2]);
            let [of_sliding, of_rolling] = &mut self.frictions[self.len / WIDTH];
            (of_sliding[self.len % WIDTH], of_rolling[self.len % WIDTH]) = (sliding, rolling);
        }
        self.len += 1;
    }

    /// Pairs whose first grain is `i`.
    fn of_grain(&self, i: u32) -> Range<usize> {
        let bound = |k: usize| self.start.get(k).map_or(self.len, |&first| first as usize);
        bound(i as usize)..bound(i as usize + 1)
    }

    fn find(&self, i: u32, j: u32) -> Option<(&Entries, usize)> {
        self.of_grain(i).find(|&k| self.ends[k][1] == j).map(|k| (&self.entries, k))
    }
}

impl Pairs {
    /// Whether the lists fit this number of grains.
    pub fn is_consistent(&self, grains: usize) -> bool {
        self.lists().all(|list| list.is_consistent(grains))
    }

    /// Empty lists with this number of shifts.
    pub fn new(shifts: usize) -> Self {
        Self { across: vec![PairList::default(); shifts], ..Self::default() }
    }

    /// Number of listed pairs.
    pub fn len(&self) -> usize {
        self.lists().map(PairList::len).sum()
    }

    /// The lists, in the order in which forces are added.
    pub fn lists(&self) -> impl Iterator<Item = &PairList> {
        [&self.touching, &self.apart].into_iter().chain(&self.across)
    }

    /// Empties the lists.
    pub fn clear(&mut self) {
        self.touching.clear();
        self.apart.clear();
        self.across.iter_mut().for_each(PairList::clear);
    }

    /// Appends the pair (i, j), which was (a, b) in the numbering of `old`, with its friction where that is not the law's; a pair new
    /// to the lists asks for its constants.
    ///
    /// Where the order of the two is reversed the sliding spring changes sign, because it belongs to v_i - v_j; the rolling
    /// spring does not, because n and ω_i - ω_j both change sign. The constants do not either.
    pub fn push(
        &mut self,
        touching: bool,
        ends: [u32; 2],
        old: &Self,
        [a, b]: [u32; 2],
        friction: Option<Friction>,
        fresh: impl FnOnce() -> Constants,
    ) {
        let (older, sign) = old.older(a, b);
        let list = if touching { &mut self.touching } else { &mut self.apart };
        list.push(ends, older, sign, friction, fresh);
    }

    /// Appends the pair (i, j) that is near across the ends over which a shift leads, which was (a, b) in the numbering of `old`.
    pub fn push_across(
        &mut self,
        shift: usize,
        ends: [u32; 2],
        old: &Self,
        [a, b]: [u32; 2],
        friction: Option<Friction>,
        fresh: impl FnOnce() -> Constants,
    ) {
        let (older, sign) = old.older(a, b);
        self.across[shift].push(ends, older, sign, friction, fresh);
    }

    /// The entry of a pair, and -1 where it stands there the other way round.
    fn older(&self, a: u32, b: u32) -> (Option<(&Entries, usize)>, f64) {
        let (inside, sign) = if a < b { (self.find(a, b), 1.0) } else { (self.find(b, a), -1.0) };
        if inside.is_some() {
            return (inside, sign);
        }
        let found = |a: u32, b: u32| self.across.iter().find_map(|list| list.find(a, b));
        match found(a, b) {
            Some(entry) => (Some(entry), 1.0),
            None => (found(b, a), -1.0),
        }
    }

    fn find(&self, i: u32, j: u32) -> Option<(&Entries, usize)> {
        self.touching.find(i, j).or_else(|| self.apart.find(i, j))
    }
}

impl WallList {
    /// Whether the list fits this number of grains and walls.
    pub fn is_consistent(&self, grains: usize, walls: usize) -> bool {
        let inside = |range: &[u32; 3]| range.is_sorted() && range[2] as usize <= self.grain.len();
        self.ranges.len() == walls
            && self.ranges.iter().all(|range| inside(range) && (range[0] as usize).is_multiple_of(WIDTH))
            && self.grain.len() == self.entries.capacity()
            && self.entries.is_consistent()
            && self.grain.iter().all(|&i| (i as usize) < grains)
    }

    /// Empties the list.
    pub fn clear(&mut self) {
        self.grain.clear();
        self.entries.clear();
        self.ranges.clear();
    }

    /// Begins the contacts of the next wall.
    pub fn begin(&mut self) {
        self.ranges.push([self.grain.len() as u32; 3]);
    }

    /// Appends a contact of the wall begun last, which was entry `from` of `old`; a new one asks for its constants. The contacts that
    /// touch come first, both kinds in order of grains.
    pub fn push(
        &mut self,
        touching: bool,
        grain: u32,
        old: &Self,
        from: Option<usize>,
        fresh: impl FnOnce() -> Constants,
    ) {
        let Some([_, apart, last]) = self.ranges.last_mut() else { return };
        let k = *last as usize;
        *last += 1;
        if touching {
            *apart = *last;
        }
        self.entries.reach(k);
        self.entries.put(k, from.map(|from| (&old.entries, from)), 1.0, fresh);
        self.grain.resize(self.entries.capacity(), 0);
        self.grain[k] = grain;
    }

    /// Entries of a wall; they begin with a block.
    pub fn of_wall(&self, wall: usize) -> Range<usize> {
        self.ranges.get(wall).map_or(0..0, |&[first, _, last]| first as usize..last as usize)
    }

    /// The same, those that touched at the last rebuild and the others.
    fn parts(&self, wall: usize) -> [Range<usize>; 2] {
        let [first, apart, last] = self.ranges.get(wall).map_or([0; 3], |range| range.map(|k| k as usize));
        [first..apart, apart..last]
    }

    /// Entries of a wall in order of grains.
    pub fn by_grain(&self, wall: usize) -> impl Iterator<Item = usize> {
        let [mut touching, mut apart] = self.parts(wall).map(Iterator::peekable);
        std::iter::from_fn(move || match (touching.peek(), apart.peek()) {
            (Some(&a), Some(&b)) if self.grain[a] < self.grain[b] => touching.next(),
            (_, Some(_)) => apart.next(),
            (_, None) => touching.next(),
        })
    }

    /// Entry of (wall, grain).
    pub fn find(&self, wall: usize, grain: u32) -> Option<usize> {
        let in_part = |part: Range<usize>| {
            let first = part.start;
            self.grain[part].binary_search(&grain).ok().map(|k| first + k)
        };
        self.parts(wall).into_iter().find_map(in_part)
    }
}
