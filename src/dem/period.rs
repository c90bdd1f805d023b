//! Periods: a piece that repeats itself along x, y or z.
//!
//! A grain that leaves at one end comes in at the other, and near an end it touches the images of grains near the other one.
//! Of two opposite images one is enough, so a pair across the ends is seen once: its first grain near the lower ends, its
//! second taken lower by the periods between. Knows nothing of lists and forces.

use super::setup::Vec3;
use super::vector::{add, scale};

/// The axes along which a piece repeats itself, and the moves that lead to its images.
#[derive(Debug, Clone)]
pub struct Periods {
    /// Ends along x, y and z [m].
    ends: [Option<[f64; 2]>; 3],
    shifts: Vec<Vec3>,
}

impl Periods {
    /// Periods with these ends.
    pub fn new(ends: [Option<[f64; 2]>; 3]) -> Self {
        let steps = |axis: usize| if ends[axis].is_some() { &[0.0, 1.0, -1.0][..] } else { &[0.0] };
        let length = |axis: usize| ends[axis].map_or(0.0, |[low, high]| high - low);
        let mut shifts = Vec::new();
        for (x, y, z) in
            steps(0).iter().flat_map(|x| steps(1).iter().flat_map(move |y| steps(2).iter().map(move |z| (*x, *y, *z))))
        {
            if [x, y, z].into_iter().find(|step| *step != 0.0) == Some(1.0) {
                shifts.push([x * length(0), y * length(1), z * length(2)]);
            }
        }
        Self { ends, shifts }
    }

    /// Moves to the images, one of every two opposite ones; none without a period.
    pub fn shifts(&self) -> &[Vec3] {
        &self.shifts
    }

    /// A place, or its image between the ends [m].
    pub fn wrapped(&self, place: Vec3) -> Vec3 {
        [0, 1, 2].map(|axis| self.ends[axis].map_or(place[axis], |ends| within(place[axis], ends)))
    }

    /// Whether a place is so near the ends over which a shift leads that its image may touch what is inside.
    pub fn is_near(&self, place: Vec3, shift: Vec3, reach: f64) -> bool {
        (0..3).all(|axis| match self.ends[axis] {
            Some([low, _]) if shift[axis] > 0.0 => place[axis] < low + reach,
            Some([_, high]) if shift[axis] < 0.0 => place[axis] > high - reach,
            _ => true,
        })
    }

    /// All images of a place but itself.
    pub fn images(&self, place: Vec3) -> impl Iterator<Item = Vec3> + '_ {
        self.shifts.iter().flat_map(move |shift| [add(place, *shift), add(place, scale(*shift, -1.0))])
    }
}

/// A coordinate, or its image in the period [m].
fn within(x: f64, [low, high]: [f64; 2]) -> f64 {
    if (low..high).contains(&x) {
        return x;
    }
    let inside = x - (high - low) * ((x - low) / (high - low)).floor();
    // A hair below the lower end rounds to the upper one.
    if inside < high { inside } else { low }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_two_opposite_images_one_is_kept() {
        let ends = Some([-1.0, 1.0]);
        for (periods, count) in [([None; 3], 0), ([None, ends, None], 1), ([ends, ends, None], 4), ([ends; 3], 13)] {
            let periods = Periods::new(periods);
            assert_eq!((periods.shifts().len(), periods.images([0.0; 3]).count()), (count, 2 * count));
            let mut images: Vec<Vec3> = periods.images([0.0; 3]).collect();
            images.sort_by(|a, b| a.partial_cmp(b).unwrap());
            images.dedup();
            assert!(images.len() == 2 * count && !images.contains(&[0.0; 3]));
        }
    }

    #[test]
    fn a_place_beyond_any_end_comes_back_inside() {
        let periods = Periods::new([Some([-1.0, 1.0]), None, Some([0.0, 0.5])]);
        let place = periods.wrapped([3.5, 7.0, -0.125]);
        assert_eq!(place, [-0.5, 7.0, 0.375]);
        assert_eq!(periods.wrapped([1.0, 0.0, -1e-20]), [-1.0, 0.0, 0.0]);
    }
}
