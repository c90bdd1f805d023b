//! Arithmetic on three numbers, always inlined so that the kernels' loops vectorise.

use super::setup::Vec3;
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

/// a + b.
#[inline(always)]
pub fn add(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// a - b.
#[inline(always)]
pub fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// s a.
#[inline(always)]
pub fn scale(a: Vec3, s: f64) -> Vec3 {
    [a[0] * s, a[1] * s, a[2] * s]
}

/// a·b.
#[inline(always)]
pub fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// a × b.
#[inline(always)]
pub fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// |a|.
#[inline(always)]
pub fn length(a: Vec3) -> f64 {
    dot(a, a).sqrt()
}

/// The first three numbers of a row.
#[inline(always)]
pub fn xyz(row: &Row4) -> Vec3 {
    [row[0], row[1], row[2]]
}
