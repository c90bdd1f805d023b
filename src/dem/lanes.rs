//! One number, or one number per contact: the contact law and the walls are written once for both.
//!
//! [`Number`] is what they need of either; [`Lanes`] is a vector of the machine as such a number. Every operation is exact per
//! lane and rounds once, so the bits of a contact depend neither on the width nor on its neighbours in the vector.
//! A closure or `array::map` over [`Lanes`] is not inlined into code for the machine's own vectors, and costs fivefold: write it out.

use pulp::Simd;
use pulp::bytemuck::{cast_slice, cast_slice_mut};
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Sub};

/// Contacts per block of the lists: the widest vector. Narrower vectors take a block in parts.
pub const WIDTH: usize = 8;

/// Arithmetic that the contact law and the walls are made of.
pub trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// Result of a comparison.
    type Mask: Mask;

    /// This number in every lane.
    fn splat(self, value: f64) -> Self;
    /// √x, rounded correctly.
    fn sqrt(self) -> Self;
    /// |x|.
    fn abs(self) -> Self;
    /// Whether x < y.
    fn less(self, other: Self) -> Self::Mask;
    /// Whether x ≤ y.
    fn at_most(self, other: Self) -> Self::Mask;
    /// x where the mask holds, else y.
    fn pick(mask: Self::Mask, x: Self, y: Self) -> Self;
}

/// One truth value per lane.
pub trait Mask: Copy + BitAnd<Output = Self> + BitOr<Output = Self> {
    /// Whether it holds in any lane.
    fn any(self) -> bool;
}

impl Number for f64 {
    type Mask = bool;

    #[inline(always)]
    fn splat(self, value: f64) -> f64 {
        value
    }

    #[inline(always)]
    fn sqrt(self) -> f64 {
        self.sqrt()
    }

    #[inline(always)]
    fn abs(self) -> f64 {
        self.abs()
    }

    #[inline(always)]
    fn less(self, other: f64) -> bool {
        self < other
    }

    #[inline(always)]
    fn at_most(self, other: f64) -> bool {
        self <= other
    }

    #[inline(always)]
    fn pick(mask: bool, x: f64, y: f64) -> f64 {
        if mask { x } else { y }
    }
}

impl Mask for bool {
    #[inline(always)]
    fn any(self) -> bool {
        self
    }
}

/// A vector of the machine.
#[derive(Debug, Clone, Copy)]
pub struct Lanes<S: Simd>(S, S::f64s);

/// Truth values of a vector.
#[derive(Debug, Clone, Copy)]
pub struct Truths<S: Simd>(S, S::m64s);

impl<S: Simd> Number for Lanes<S> {
    type Mask = Truths<S>;

    #[inline(always)]
    fn splat(self, value: f64) -> Self {
        Self(self.0, self.0.splat_f64s(value))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0, self.0.sqrt_f64s(self.1))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0, self.0.abs_f64s(self.1))
    }

    #[inline(always)]
    fn less(self, other: Self) -> Truths<S> {
        Truths(self.0, self.0.less_than_f64s(self.1, other.1))
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> Truths<S> {
        Truths(self.0, self.0.less_than_or_equal_f64s(self.1, other.1))
    }

    #[inline(always)]
    fn pick(mask: Truths<S>, x: Self, y: Self) -> Self {
        Self(x.0, x.0.select_f64s(mask.1, x.1, y.1))
    }
}

impl<S: Simd> Lanes<S> {
    /// Zero in every lane.
    #[inline(always)]
    pub fn zero(simd: S) -> Self {
        Self(simd, simd.splat_f64s(0.0))
    }

    /// Which lanes of part `part` belong to the first `count` entries of a block.
    #[inline(always)]
    pub fn filled(simd: S, part: usize, count: usize) -> Truths<S> {
        const COUNT: [f64; WIDTH] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
        let lane = Self::load(simd, &COUNT, 0);
        lane.less(lane.splat(count as f64 - (part * S::F64_LANES) as f64))
    }

    /// Part `part` of a block.
    #[inline(always)]
    pub fn load(simd: S, block: &[f64; WIDTH], part: usize) -> Self {
        Self(simd, S::as_simd_f64s(block).0[part])
    }

    /// Becomes part `part` of a block.
    #[inline(always)]
    pub fn store(self, block: &mut [f64; WIDTH], part: usize) {
        S::as_mut_simd_f64s(block).0[part] = self.1;
    }

    /// The smaller of two numbers, neither of which is NaN.
    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        Self(self.0, self.0.min_f64s(self.1, other.1))
    }

    /// The sum of all lanes, in no order that may be relied on.
    #[inline(always)]
    pub fn sum(self) -> f64 {
        self.0.reduce_sum_f64s(self.1)
    }

    /// The numbers; only the first `S::F64_LANES` mean something.
    #[inline(always)]
    pub fn numbers(self) -> [f64; WIDTH] {
        let mut block = [0.0; WIDTH];
        self.store(&mut block, 0);
        block
    }
}

macro_rules! operator {
    ($Trait:ident, $name:ident, $function:ident) => {
        impl<S: Simd> $Trait for Lanes<S> {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                Self(self.0, self.0.$function(self.1, other.1))
            }
        }
    };
}

operator!(Add, add, add_f64s);
operator!(Sub, sub, sub_f64s);
operator!(Mul, mul, mul_f64s);
operator!(Div, div, div_f64s);

impl<S: Simd> Neg for Lanes<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0, self.0.neg_f64s(self.1))
    }
}

impl<S: Simd> BitAnd for Truths<S> {
    type Output = Self;

    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self(self.0, self.0.and_m64s(self.1, other.1))
    }
}

impl<S: Simd> BitOr for Truths<S> {
    type Output = Self;

    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self(self.0, self.0.or_m64s(self.1, other.1))
    }
}

impl<S: Simd> Mask for Truths<S> {
    #[inline(always)]
    fn any(self) -> bool {
        self.0.first_true_m64s(self.1) < S::F64_LANES
    }
}

/// Rows of four numbers to lanes and back.
#[derive(Debug, Clone, Copy)]
pub struct Transposer<S: Simd>(pub S);

impl<S: Simd> Transposer<S> {
    /// Place in memory of the row of each lane, as pulp's shuffles for this width take them; its own inverse.
    const SLOT: [usize; WIDTH] =
        if S::F64_LANES == WIDTH { [0, 2, 1, 3, 4, 6, 5, 7] } else { [0, 1, 2, 3, 4, 5, 6, 7] };

    /// Lanes from the rows that `row` gives for each of them.
    #[inline(always)]
    pub fn gather(self, row: impl Fn(usize) -> [f64; 4]) -> [Lanes<S>; 4] {
        self.lanes(self.in_slots(row))
    }

    /// Lanes from two rows each: the differences of the first three numbers, the sum of the fourth.
    #[inline(always)]
    pub fn gather_between(self, a: impl Fn(usize) -> [f64; 4], b: impl Fn(usize) -> [f64; 4]) -> [Lanes<S>; 4] {
        let (mut a, b, sign) = (self.in_slots(a), self.in_slots(b), self.in_slots(|_| [-0.0, -0.0, -0.0, 0.0]));
        for k in 0..4 {
            a[k] = self.0.add_f64s(a[k], self.0.xor_f64s(b[k], sign[k]));
        }
        self.lanes(a)
    }

    /// Lanes from the differences of two rows each.
    #[inline(always)]
    pub fn gather_difference(self, a: impl Fn(usize) -> [f64; 4], b: impl Fn(usize) -> [f64; 4]) -> [Lanes<S>; 4] {
        let (mut a, b) = (self.in_slots(a), self.in_slots(b));
        for k in 0..4 {
            a[k] = self.0.sub_f64s(a[k], b[k]);
        }
        self.lanes(a)
    }

    /// The rows of all lanes as the shuffles take them.
    #[inline(always)]
    fn in_slots(self, row: impl Fn(usize) -> [f64; 4]) -> [S::f64s; 4] {
        let mut rows = [self.0.splat_f64s(0.0); 4];
        for (slot, place) in cast_slice_mut::<S::f64s, [f64; 4]>(&mut rows).iter_mut().enumerate() {
            *place = row(Self::SLOT[slot]);
        }
        rows
    }

    #[inline(always)]
    fn lanes(self, rows: [S::f64s; 4]) -> [Lanes<S>; 4] {
        let [a, b, c, d] = self.0.deinterleave_shfl_f64s(rows);
        [Lanes(self.0, a), Lanes(self.0, b), Lanes(self.0, c), Lanes(self.0, d)]
    }

    /// Rows (x, y, z, 0) from lanes.
    #[inline(always)]
    pub fn rows(self, [x, y, z]: [Lanes<S>; 3]) -> LaneRows<S> {
        let zero = self.0.splat_f64s(0.0);
        LaneRows(self.0.interleave_shfl_f64s([x.1, y.1, z.1, zero]))
    }
}

/// Rows made of lanes.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub struct LaneRows<S: Simd>([S::f64s; 4]);

impl<S: Simd> LaneRows<S> {
    /// The row of a lane.
    #[inline(always)]
    pub fn of(&self, lane: usize) -> &[f64; 4] {
        &cast_slice::<S::f64s, [f64; 4]>(&self.0)[Transposer::<S>::SLOT[lane]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pulp::{Arch, WithSimd};

    /// Sends numbered rows to lanes and back.
    struct RoundTrip;

    impl WithSimd for RoundTrip {
        type Output = ();

        fn with_simd<S: Simd>(self, simd: S) {
            let transposer = Transposer(simd);
            let row = |l: usize| [0.0, 1.0, 2.0, 3.0].map(|c| 10.0 * l as f64 + c);
            let lanes = transposer.gather(row);
            let rows = transposer.rows([lanes[0], lanes[1], lanes[2]]);
            for l in 0..S::F64_LANES {
                assert_eq!(lanes.map(|lanes| lanes.numbers()[l]), row(l), "lane {l}");
                assert_eq!(rows.of(l)[..3], row(l)[..3], "row {l}");
            }
        }
    }

    #[test]
    fn rows_keep_their_lane_at_every_width() {
        Arch::Scalar.dispatch(RoundTrip);
        Arch::new().dispatch(RoundTrip);
        #[cfg(target_arch = "x86_64")]
        if let Some(v3) = pulp::x86::V3::try_new() {
            Arch::V3(v3).dispatch(RoundTrip);
        }
    }
}
