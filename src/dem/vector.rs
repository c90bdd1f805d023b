//! Arithmetic on three numbers, or on three vectors of the machine.

use super::lanes::Number;
use super::setup::Vec3;
use aligned_vec::{AVec, ConstAlign};
use std::ops::{Deref, DerefMut};

/// Four numbers that never straddle a cache line.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[repr(C, align(32))]
pub struct Row4(pub [f64; 4]);

/// Eight numbers that fill one cache line.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[repr(C, align(64))]
pub struct Row8(pub [f64; 8]);

impl Deref for Row4 {
    type Target = [f64; 4];

    #[inline(always)]
    fn deref(&self) -> &[f64; 4] {
        &self.0
    }
}

impl DerefMut for Row4 {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f64; 4] {
        &mut self.0
    }
}

impl Deref for Row8 {
    type Target = [f64; 8];

    #[inline(always)]
    fn deref(&self) -> &[f64; 8] {
        &self.0
    }
}

impl DerefMut for Row8 {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f64; 8] {
        &mut self.0
    }
}

/// Rows of four numbers, of which two fill a cache line: the first and the second, the third and the fourth, and so on.
#[derive(Debug, Clone)]
pub struct AlignedRows(AVec<Row4, ConstAlign<{ align_of::<Row8>() }>>);

impl Default for AlignedRows {
    fn default() -> Self {
        Self(AVec::new(0))
    }
}

impl Deref for AlignedRows {
    type Target = [Row4];

    #[inline(always)]
    fn deref(&self) -> &[Row4] {
        &self.0
    }
}

impl DerefMut for AlignedRows {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [Row4] {
        &mut self.0
    }
}

impl AlignedRows {
    /// Appends a row.
    pub fn push(&mut self, row: Row4) {
        self.0.push(row);
    }

    /// Holds these rows in place of its own.
    pub fn refill(&mut self, rows: impl Iterator<Item = Row4>) {
        self.0.clear();
        self.0.reserve(rows.size_hint().0);
        rows.for_each(|row| self.0.push(row));
    }
}

/// a + b.
#[inline(always)]
pub fn add<T: Number>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// a - b.
#[inline(always)]
pub fn sub<T: Number>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// s a.
#[inline(always)]
pub fn scale<T: Number>(a: [T; 3], s: T) -> [T; 3] {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// -a.
#[inline(always)]
pub fn minus<T: Number>(a: [T; 3]) -> [T; 3] {
    [-a[0], -a[1], -a[2]]
}

/// a·b.
#[inline(always)]
pub fn dot<T: Number>(a: [T; 3], b: [T; 3]) -> T {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a × b.
#[inline(always)]
pub fn cross<T: Number>(a: [T; 3], b: [T; 3]) -> [T; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// |a|.
#[inline(always)]
pub fn length<T: Number>(a: [T; 3]) -> T {
    dot(a, a).sqrt()
}

/// a where the mask holds, else b.
#[inline(always)]
pub fn pick<T: Number>(mask: T::Mask, a: [T; 3], b: [T; 3]) -> [T; 3] {
    [T::pick(mask, a[0], b[0]), T::pick(mask, a[1], b[1]), T::pick(mask, a[2], b[2])]
}

/// The same vector in every lane of `like`.
#[inline(always)]
pub fn splat<T: Number>(like: T, a: Vec3) -> [T; 3] {
    [like.splat(a[0]), like.splat(a[1]), like.splat(a[2])]
}

/// The first three numbers of a row.
#[inline(always)]
pub fn xyz(row: &Row4) -> Vec3 {
    [row[0], row[1], row[2]]
}
