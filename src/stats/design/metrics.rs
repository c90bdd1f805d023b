//! How well a design fills the unit cube: distances between points and discrepancies.

use crate::stats::points::{Points, squared_distance};

/// Distances of all pairs i < j.
fn distances(points: &Points) -> impl Iterator<Item = f64> + '_ {
    let n = points.len();
    let pairs = (0..n).flat_map(move |i| (i + 1..n).map(move |j| (i, j)));
    pairs.map(|(i, j)| squared_distance(points.row(i), points.row(j)).sqrt())
}

/// Smallest Euclidean distance of two points; infinite for fewer than two.
pub fn min_distance(points: &Points) -> f64 {
    distances(points).fold(f64::INFINITY, f64::min)
}

/// Smallest Euclidean distance of a point of `a` from a point of `b`; infinite where one is empty.
pub fn min_distance_between(a: &Points, b: &Points) -> f64 {
    let nearest = |x: &[f64]| b.rows().map(|y| squared_distance(x, y)).fold(f64::INFINITY, f64::min);
    a.rows().map(nearest).fold(f64::INFINITY, f64::min).sqrt()
}

/// φ_p = (Σ_{i<j} d_ij^−p)^(1/p) (Morris & Mitchell 1995); for large p, 1/(smallest distance).
pub fn phi_p(points: &Points, p: f64) -> f64 {
    let nearest = min_distance(points);
    // Relative to the nearest pair no power can overflow.
    let sum: f64 = distances(points).map(|distance| libm::pow(nearest / distance, p)).sum();
    libm::pow(sum, 1.0 / p) / nearest
}

/// Σ over pairs, the diagonal included, of Π over coordinates.
fn pair_products(points: &Points, factor: impl Fn(f64, f64) -> f64) -> f64 {
    let product = |x: &[f64], y: &[f64]| -> f64 { x.iter().zip(y).map(|(&a, &b)| factor(a, b)).product() };
    points.rows().map(|x| points.rows().map(|y| product(x, y)).sum::<f64>()).sum()
}

/// Σ over points of Π over coordinates.
fn point_products(points: &Points, factor: impl Fn(f64) -> f64) -> f64 {
    points.rows().map(|x| x.iter().map(|&a| factor(a)).product::<f64>()).sum()
}

fn power(base: f64, exponent: usize) -> f64 {
    (0..exponent).map(|_| base).product()
}

/// Squared centred L2 discrepancy (Hickernell 1998).
pub fn centred_discrepancy(points: &Points) -> f64 {
    let n = points.len() as f64;
    let one = |x: f64| {
        let u = (x - 0.5).abs();
        1.0 + 0.5 * u - 0.5 * u * u
    };
    let two = |x: f64, y: f64| 1.0 + 0.5 * ((x - 0.5).abs() + (y - 0.5).abs() - (x - y).abs());
    power(13.0 / 12.0, points.dimension()) - 2.0 / n * point_products(points, one)
        + pair_products(points, two) / (n * n)
}

/// Squared wrap-around L2 discrepancy (Hickernell 1998).
pub fn wraparound_discrepancy(points: &Points) -> f64 {
    let n = points.len() as f64;
    let two = |x: f64, y: f64| {
        let u = (x - y).abs();
        1.5 - u + u * u
    };
    pair_products(points, two) / (n * n) - power(4.0 / 3.0, points.dimension())
}

/// Squared mixture discrepancy (Zhou, Fang & Ning 2013).
pub fn mixture_discrepancy(points: &Points) -> f64 {
    let n = points.len() as f64;
    let one = |x: f64| {
        let u = (x - 0.5).abs();
        5.0 / 3.0 - 0.25 * u - 0.25 * u * u
    };
    let two = |x: f64, y: f64| {
        let (u, v, w) = ((x - 0.5).abs(), (y - 0.5).abs(), (x - y).abs());
        15.0 / 8.0 - 0.25 * u - 0.25 * v - 0.75 * w + 0.5 * w * w
    };
    power(19.0 / 12.0, points.dimension()) - 2.0 / n * point_products(points, one)
        + pair_products(points, two) / (n * n)
}

/// L2 star discrepancy (Warnock 1972), not squared.
pub fn star_discrepancy(points: &Points) -> f64 {
    let (n, p) = (points.len() as f64, points.dimension());
    let squared = power(1.0 / 3.0, p) - 2.0 / (n * power(2.0, p)) * point_products(points, |x| 1.0 - x * x)
        + pair_products(points, |x, y| 1.0 - x.max(y)) / (n * n);
    squared.sqrt()
}
