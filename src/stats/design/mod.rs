//! Designs of experiments in the unit cube.
//!
//! A study samples the faces by a [`factorial`] of a few levels and the inside by a Latin hypercube that is
//! optimised *given* the points that are there already ([`latin::conditional_latin_hypercube`]); validation points
//! are another one, given both. For more parameters than a factorial can afford there is the [`sobol`] sequence.
//! [`metrics`] states how good a design is. Deliberately knows nothing of parameter names, bounds and scales.

pub mod latin;
pub mod metrics;
pub mod sobol;

use super::points::{Points, squared_distance};

/// All combinations of `levels` equally spaced values per parameter, 0 and 1 included; shape (levels^p, p), no point
/// at all for no level.
///
/// With three levels and three parameters the 27 points of the paper's boundary sample: corners, mid-edges, face
/// centres and the centre (section 4.2). The last parameter varies fastest.
///
/// # Panics
/// If there is one level, which spans nothing.
pub fn factorial(levels: usize, dimension: usize) -> Points {
    assert!(levels != 1, "a factorial needs two levels");
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

/// `count` points, each as far as can be from `existing` and from those before it, out of the first points of the
/// [`sobol`] sequence. The first ones do not depend on how many follow, so a design that grows keeps what it had.
///
/// # Errors
/// [`sobol::TooManyDimensions`], if any point is asked for.
pub fn farthest(count: usize, existing: &Points) -> Result<Points, sobol::TooManyDimensions> {
    let mut chosen = Points::empty(existing.dimension());
    if count == 0 {
        return Ok(chosen);
    }
    let candidates = sobol::Sobol::new(existing.dimension())?.take(CANDIDATES);
    let mut nearest = vec![f64::INFINITY; candidates.len()];
    existing.rows().for_each(|point| approach(&mut nearest, &candidates, point));
    for _ in 0..count {
        let farther = |a: &usize, b: &usize| nearest[*a].total_cmp(&nearest[*b]).then(b.cmp(a));
        let Some(index) = (0..nearest.len()).max_by(farther) else { break };
        chosen.push(candidates.row(index));
        approach(&mut nearest, &candidates, candidates.row(index));
    }
    Ok(chosen)
}

/// Points of the sequence among which [`farthest`] chooses.
const CANDIDATES: usize = 4096;

/// Lowers the squared distance of every candidate to its nearest point, now that there is `point`.
fn approach(nearest: &mut [f64], candidates: &Points, point: &[f64]) {
    for (distance, candidate) in nearest.iter_mut().zip(candidates.rows()) {
        *distance = distance.min(squared_distance(candidate, point));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn added_points_lie_far_from_all_and_do_not_move_when_more_follow() {
        let corners = factorial(2, 2);
        let few = farthest(3, &corners).unwrap();
        assert!(few.row(0).iter().all(|x| (x - 0.5).abs() < 1e-6), "the middle is farthest from the corners");
        let more = farthest(20, &corners).unwrap();
        assert!(few.rows().eq(more.rows().take(3)));
        assert!(metrics::min_distance(&corners.joined(&more)) > 0.1);
        assert!(farthest(0, &Points::empty(99)).unwrap().is_empty());
        assert!(farthest(1, &Points::empty(99)).is_err());
        assert_eq!(farthest(2, &Points::empty(1)).unwrap().len(), 2);
    }

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
