//! Designs of experiments in the unit cube.
//!
//! A study samples the faces by a [`factorial`] of a few levels and the inside by a Latin hypercube that is
//! optimised *given* the points that are there already ([`latin::conditional_latin_hypercube`]); validation points
//! are another one, given both. For more parameters than a factorial can afford there is the [`sobol`] sequence.
//! [`metrics`] states how good a design is. Deliberately knows nothing of parameter names, bounds and scales.

pub mod latin;
pub mod metrics;
pub mod sobol;

use super::points::Points;

/// All combinations of `levels` equally spaced values per parameter, 0 and 1 included; shape (levels^p, p).
///
/// With three levels and three parameters the 27 points of the paper's boundary sample: corners, mid-edges, face
/// centres and the centre (section 4.2). The last parameter varies fastest.
///
/// # Panics
/// If there are fewer than two levels.
pub fn factorial(levels: usize, dimension: usize) -> Points {
    assert!(levels >= 2, "a factorial needs two levels");
    let exponent = u32::try_from(dimension).expect("a few parameters");
    let mut points = Points::empty(dimension);
    for index in 0..levels.pow(exponent) {
        let mut rest = index;
        let mut row = vec![0.0; dimension];
        for coordinate in row.iter_mut().rev() {
            *coordinate = (rest % levels) as f64 / (levels - 1) as f64;
            rest /= levels;
        }
        points.push(&row);
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_levels_of_three_parameters_are_the_boundary_sample() {
        let points = factorial(3, 3);
        assert_eq!(points.len(), 27);
        assert_eq!(points.row(0), [0.0, 0.0, 0.0]);
        assert_eq!(points.row(1), [0.0, 0.0, 0.5]);
        assert_eq!(points.row(13), [0.5, 0.5, 0.5]);
        assert_eq!(points.row(26), [1.0, 1.0, 1.0]);
        assert_eq!(metrics::min_distance(&points), 0.5);
    }
}
