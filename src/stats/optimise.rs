//! Minimisers within bounds, from one start and from many.
//!
//! One start: L-BFGS-B (Byrd, Lu, Nocedal, Zhu 1995; Moré and Thuente's line search) of the crate `basin`, on plain
//! vectors, so that no linear-algebra back end and no run-time dispatch is involved. Many starts: seeded points are
//! evaluated, the best few that lie apart from each other are refined. The result does not depend on the number of
//! threads: values come back in the order of the starts, and ties are broken by that order.
//! Deliberately absent: constraints other than bounds, and minimisation without gradients.

use crate::rng::Stream;
use basin::{
    BoxBounds, ConstraintDescription, ConstraintSet, Constraints, CostFunction, Executor, FirstOrderState, Gradient,
    Lbfgsb, TerminationCode,
};
use rayon::prelude::*;
use std::convert::Infallible;

/// What stands for a value that is infinite or NaN: far above any objective, yet harmless in a cubic interpolation.
const FORBIDDEN: f64 = 1e100;

/// A smooth function of `dimension` variables, to be minimised.
pub trait Objective: Sync {
    /// Number of variables.
    fn dimension(&self) -> usize;

    /// Value at `x`; infinite or NaN where the function is not defined.
    fn value(&self, x: &[f64]) -> f64;

    /// Value and gradient at `x`.
    fn value_and_gradient(&self, x: &[f64]) -> (f64, Vec<f64>);
}

/// A box, lower ≤ upper in every variable.
#[derive(Debug, Clone, PartialEq)]
pub struct Bounds {
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl Bounds {
    /// The box of the given sides.
    ///
    /// # Panics
    /// If the lengths differ or a side is inverted.
    pub fn new(lower: Vec<f64>, upper: Vec<f64>) -> Self {
        assert_eq!(lower.len(), upper.len(), "bounds of different length");
        assert!(lower.iter().zip(&upper).all(|(low, high)| low <= high), "inverted bounds");
        Self { lower, upper }
    }

    /// [low, high] in each of `dimension` variables.
    pub fn cube(dimension: usize, low: f64, high: f64) -> Self {
        Self::new(vec![low; dimension], vec![high; dimension])
    }

    /// Number of variables.
    pub fn dimension(&self) -> usize {
        self.lower.len()
    }

    /// Lower sides.
    pub fn lower(&self) -> &[f64] {
        &self.lower
    }

    /// Upper sides.
    pub fn upper(&self) -> &[f64] {
        &self.upper
    }

    /// The point of the box nearest to `x`.
    pub fn clamp(&self, x: &[f64]) -> Vec<f64> {
        x.iter().enumerate().map(|(i, value)| value.clamp(self.lower[i], self.upper[i])).collect()
    }

    /// Which variables lie on a side, within 10⁻⁶ of the width.
    pub fn active(&self, x: &[f64]) -> Vec<bool> {
        let near = |i: usize, value: f64| {
            let slack = 1e-6 * (self.upper[i] - self.lower[i]);
            value - self.lower[i] <= slack || self.upper[i] - value <= slack
        };
        x.iter().enumerate().map(|(i, &value)| near(i, value)).collect()
    }

    /// A point uniform in the box.
    pub fn draw(&self, stream: &mut Stream) -> Vec<f64> {
        self.lower.iter().zip(&self.upper).map(|(&low, &high)| stream.uniform_in(low, high)).collect()
    }

    /// A start: uniform in a box wider by [`OVERHANG`] on each side, moved into this one.
    fn draw_start(&self, stream: &mut Stream) -> Vec<f64> {
        let wide = |(&low, &high): (&f64, &f64)| {
            let overhang = OVERHANG * (high - low);
            stream.uniform_in(low - overhang, high + overhang).clamp(low, high)
        };
        self.lower.iter().zip(&self.upper).map(wide).collect()
    }

    /// Largest coordinate difference of two points, as a share of the width.
    fn separation(&self, a: &[f64], b: &[f64]) -> f64 {
        let share = |i: usize| {
            let width = self.upper[i] - self.lower[i];
            if width > 0.0 { (a[i] - b[i]).abs() / width } else { 0.0 }
        };
        (0..a.len()).map(share).fold(0.0, f64::max)
    }
}

/// When a descent stops.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stopping {
    /// Largest component of the projected gradient that counts as zero.
    pub gradient: f64,
    /// Decrease of the value in one step that counts as none, relative to the value or to 1 if that is larger; 0
    /// switches the test off.
    pub decrease: f64,
    /// Largest number of iterations.
    pub iterations: u64,
}

impl Default for Stopping {
    /// Projected gradient 10⁻⁹, decrease ten rounding units, 400 iterations.
    fn default() -> Self {
        Self { gradient: 1e-9, decrease: 10.0 * f64::EPSILON, iterations: 400 }
    }
}

/// End of one descent.
#[derive(Debug, Clone, PartialEq)]
pub struct Minimum {
    /// Point reached, within the bounds.
    pub x: Vec<f64>,
    /// Value there.
    pub value: f64,
    /// Evaluations of value and gradient spent.
    pub evaluations: u64,
    /// Whether the projected gradient vanishes, or a fresh beginning confirmed that no decrease is left.
    pub converged: bool,
    /// Which variables lie on a bound.
    pub active: Vec<bool>,
}

/// An objective with its bounds, as `basin` wants to see it.
struct Bounded<'a> {
    objective: &'a dyn Objective,
    bounds: &'a Bounds,
}

impl Constraints for Bounded<'_> {
    type Set = ConstraintSet<BoxBounds<Vec<f64>>>;

    fn constraints(&self) -> <Self::Set as ConstraintDescription>::Borrowed<'_> {
        ConstraintSet::new().with_bounds(BoxBounds::new(Some(&self.bounds.lower), Some(&self.bounds.upper)))
    }
}

impl CostFunction for Bounded<'_> {
    type Param = Vec<f64>;
    type Output = f64;
    type Error = Infallible;

    fn cost(&self, x: &Vec<f64>) -> Result<f64, Infallible> {
        Ok(self.cost_and_gradient(x)?.0)
    }
}

impl Gradient for Bounded<'_> {
    type Gradient = Vec<f64>;

    fn gradient(&self, x: &Vec<f64>) -> Result<Vec<f64>, Infallible> {
        Ok(self.cost_and_gradient(x)?.1)
    }

    fn cost_and_gradient(&self, x: &Vec<f64>) -> Result<(f64, Vec<f64>), Infallible> {
        let (value, gradient) = self.objective.value_and_gradient(x);
        let defined = value.is_finite() && gradient.iter().all(|slope| slope.is_finite());
        Ok(if defined { (value, gradient) } else { (FORBIDDEN, vec![0.0; x.len()]) })
    }
}

/// Fresh beginnings granted to a descent that ended where the projected gradient does not vanish.
///
/// Values of near-singular covariances are noisy; a step then fails to decrease them, or a stale curvature estimate
/// stops the line search, far from the minimum. Beginning again without history carries on.
const RESTARTS: usize = 5;

/// A fresh beginning that gains less than this share of the value confirms the minimum.
const CONFIRMED: f64 = 1e-10;

/// Minimises `objective` within `bounds` from `start`, which is moved into the box first.
///
/// A start at which the objective is not defined is returned as it is, with an infinite value.
pub fn minimise(objective: &dyn Objective, bounds: &Bounds, start: &[f64], stopping: &Stopping) -> Minimum {
    let mut best = descend(objective, bounds, start, stopping);
    for _ in 0..RESTARTS {
        if best.converged || !best.value.is_finite() {
            break;
        }
        let again = descend(objective, bounds, &best.x, stopping);
        let confirmed = best.value - again.value <= CONFIRMED * best.value.abs() + stopping.decrease;
        let evaluations = best.evaluations + again.evaluations;
        best = Minimum { evaluations, converged: again.converged || confirmed, ..again };
    }
    best
}

/// One run of L-BFGS-B.
fn descend(objective: &dyn Objective, bounds: &Bounds, start: &[f64], stopping: &Stopping) -> Minimum {
    let solver = Lbfgsb::new()
        .with_absolute_projected_gradient_tolerance(stopping.gradient)
        .with_relative_cost_reduction_tolerance((stopping.decrease > 0.0).then_some(stopping.decrease));
    let state = FirstOrderState::new(bounds.clamp(start));
    let run = Executor::new(Bounded { objective, bounds }, solver, state).max_iter(stopping.iterations).run();
    // The solver refuses a problem only for bounds that are no box, which the type excludes: then the start stands.
    let Ok(result) = run else { return unmoved(objective, bounds, start) };
    let x = bounds.clamp(result.best_param());
    let defined = result.best_cost() < FORBIDDEN;
    Minimum {
        value: if defined { result.best_cost() } else { f64::INFINITY },
        evaluations: result.cost_evals(),
        converged: defined && result.report.code() == TerminationCode::ProjectedGradientTolerance,
        active: bounds.active(&x),
        x,
    }
}

fn unmoved(objective: &dyn Objective, bounds: &Bounds, start: &[f64]) -> Minimum {
    let x = bounds.clamp(start);
    Minimum { value: objective.value(&x), evaluations: 1, converged: false, active: bounds.active(&x), x }
}

/// How many starts, from which seed, and which of them are refined.
#[derive(Debug, Clone, PartialEq)]
pub struct Starts {
    /// Seed of the stream of starts.
    pub seed: u64,
    /// Number of seeded starts that are evaluated.
    pub number: usize,
    /// Number of the best starts that are refined.
    pub refined: usize,
    /// Starts that are always refined, for instance the optimum for fewer repetitions.
    pub warm: Vec<Vec<f64>>,
}

/// All descents of a search from many starts.
#[derive(Debug, Clone, PartialEq)]
pub struct Search {
    /// Best end point.
    pub best: Minimum,
    /// Every descent: those from warm starts first, then from the best seeded starts.
    pub minima: Vec<Minimum>,
}

impl Search {
    /// How many descents ended within `tolerance` of the best value.
    pub fn agreeing(&self, tolerance: f64) -> usize {
        self.minima.iter().filter(|minimum| minimum.value <= self.best.value + tolerance).count()
    }
}

/// Bounded optima often lie on faces and edges, whose valleys starts in the interior miss: with this overhang a
/// quarter of the coordinates of starts lie on a bound.
const OVERHANG: f64 = 0.15;

/// Two starts nearer than this share of the box count as one when the starts to refine are chosen.
const SEPARATION: f64 = 0.25;

/// Evaluates seeded starts, refines the best few of them and every warm start, keeps the best end point.
///
/// # Panics
/// If there is neither a seeded start to refine nor a warm one.
pub fn multi_start(objective: &dyn Objective, bounds: &Bounds, starts: &Starts, stopping: &Stopping) -> Search {
    let mut stream = Stream::new(starts.seed, "optimiser starts");
    let drawn: Vec<Vec<f64>> = (0..starts.number).map(|_| bounds.draw_start(&mut stream)).collect();
    let chosen = if starts.refined < starts.number {
        let values: Vec<f64> = drawn.par_iter().map(|x| objective.value(x)).collect();
        best_apart(&drawn, &values, bounds, starts.refined)
    } else {
        (0..starts.number).collect()
    };
    let refine: Vec<&Vec<f64>> = starts.warm.iter().chain(chosen.iter().map(|&index| &drawn[index])).collect();
    let minima: Vec<Minimum> = refine.par_iter().map(|start| minimise(objective, bounds, start, stopping)).collect();
    let best = minima.iter().min_by(|a, b| a.value.total_cmp(&b.value)).expect("at least one start").clone();
    Search { best, minima }
}

/// Indices of the `wanted` best starts that lie apart; filled up with the next best where too few do.
fn best_apart(drawn: &[Vec<f64>], values: &[f64], bounds: &Bounds, wanted: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..drawn.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut chosen: Vec<usize> = Vec::with_capacity(wanted);
    for &index in &order {
        let apart = |&other: &usize| bounds.separation(&drawn[index], &drawn[other]) >= SEPARATION;
        if chosen.len() < wanted && chosen.iter().all(apart) {
            chosen.push(index);
        }
    }
    let rest: Vec<usize> = order.into_iter().filter(|index| !chosen.contains(index)).collect();
    let missing = wanted - chosen.len();
    chosen.extend(rest.into_iter().take(missing));
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Function<F: Fn(&[f64]) -> (f64, Vec<f64>) + Sync>(usize, F);

    impl<F: Fn(&[f64]) -> (f64, Vec<f64>) + Sync> Objective for Function<F> {
        fn dimension(&self) -> usize {
            self.0
        }
        fn value(&self, x: &[f64]) -> f64 {
            self.1(x).0
        }
        fn value_and_gradient(&self, x: &[f64]) -> (f64, Vec<f64>) {
            self.1(x)
        }
    }

    fn rosenbrock(x: &[f64]) -> (f64, Vec<f64>) {
        let (a, b) = (1.0 - x[0], x[1] - x[0] * x[0]);
        (a * a + 100.0 * b * b, vec![-2.0 * a - 400.0 * x[0] * b, 200.0 * b])
    }

    /// Σ i (x_i − c_i)²: the bounded minimum is c clamped to the box.
    fn bowl(centre: &'static [f64]) -> impl Fn(&[f64]) -> (f64, Vec<f64>) + Sync {
        move |x| {
            let part = |i: usize| (i + 1) as f64 * (x[i] - centre[i]);
            let value = (0..x.len()).map(|i| part(i) * (x[i] - centre[i])).sum();
            (value, (0..x.len()).map(|i| 2.0 * part(i)).collect())
        }
    }

    fn near(x: &[f64], wanted: &[f64], tolerance: f64) {
        for (a, b) in x.iter().zip(wanted) {
            assert!((a - b).abs() < tolerance, "{x:?} instead of {wanted:?}");
        }
    }

    #[test]
    fn rosenbrock_with_and_without_an_active_bound() {
        let objective = Function(2, rosenbrock);
        let free = minimise(&objective, &Bounds::cube(2, -2.0, 2.0), &[-1.2, 1.0], &Stopping::default());
        near(&free.x, &[1.0, 1.0], 1e-6);
        assert!(free.converged && free.active == [false, false]);
        // With x ≤ 0.5 the valley is left at its foot: (0.5, 0.25), value 0.25.
        let bounds = Bounds::new(vec![-2.0, -2.0], vec![0.5, 2.0]);
        let held = minimise(&objective, &bounds, &[-1.2, 1.0], &Stopping::default());
        near(&held.x, &[0.5, 0.25], 1e-7);
        assert!((held.value - 0.25).abs() < 1e-12 && held.active == [true, false]);
    }

    #[test]
    fn a_bowl_outside_the_box_ends_on_its_sides() {
        const CENTRE: [f64; 4] = [0.3, 1.7, -0.4, 0.9];
        let (bounds, stopping) = (Bounds::cube(4, 0.0, 1.0), Stopping::default());
        let found = minimise(&Function(4, bowl(&CENTRE)), &bounds, &[0.5; 4], &stopping);
        // The value is near 1, so a position is seen to the square root of the rounding unit only.
        near(&found.x, &[0.3, 1.0, 0.0, 0.9], 1e-7);
        assert_eq!(found.active, [false, true, true, false]);
    }

    #[test]
    fn a_start_on_a_bound_can_leave_it() {
        const CENTRE: [f64; 2] = [0.5, 0.5];
        let objective = Function(2, bowl(&CENTRE));
        let found = minimise(&objective, &Bounds::cube(2, 0.0, 1.0), &[0.0, 1.0], &Stopping::default());
        near(&found.x, &CENTRE, 1e-7);
    }

    #[test]
    fn undefined_regions_are_avoided() {
        // x − ln x has its minimum 1 at 1 and is not defined below 0.
        let objective = Function(1, |x: &[f64]| (x[0] - libm::log(x[0]), vec![1.0 - 1.0 / x[0]]));
        let bounds = Bounds::cube(1, -5.0, 5.0);
        near(&minimise(&objective, &bounds, &[4.0], &Stopping::default()).x, &[1.0], 1e-6);
        let lost = minimise(&objective, &bounds, &[-1.0], &Stopping::default());
        assert!(lost.value.is_infinite() && !lost.converged);
    }

    /// Himmelblau's function plus a tilt: four valleys, the best one near (3, 2).
    fn valleys(x: &[f64]) -> (f64, Vec<f64>) {
        let (u, v) = (x[0] * x[0] + x[1] - 11.0, x[0] + x[1] * x[1] - 7.0);
        let value = u * u + v * v - 0.5 * (x[0] + x[1]);
        (value, vec![4.0 * x[0] * u + 2.0 * v - 0.5, 2.0 * u + 4.0 * x[1] * v - 0.5])
    }

    #[test]
    fn few_refinements_find_what_all_refinements_find() {
        let (objective, bounds) = (Function(2, valleys), Bounds::cube(2, -5.0, 5.0));
        for seed in 0..10 {
            let starts = |refined| Starts { seed, number: 100, refined, warm: Vec::new() };
            let few = multi_start(&objective, &bounds, &starts(5), &Stopping::default());
            let all = multi_start(&objective, &bounds, &starts(100), &Stopping::default());
            near(&few.best.x, &all.best.x, 1e-6);
            assert!(few.best.x[0] > 2.9 && few.best.x[1] > 1.9, "seed {seed}: {:?}", few.best.x);
            assert!(all.agreeing(1e-6) < 100, "the function has other valleys");
        }
    }

    #[test]
    fn threads_do_not_change_a_bit() {
        let (objective, bounds) = (Function(2, valleys), Bounds::cube(2, -5.0, 5.0));
        let starts = Starts { seed: 3, number: 40, refined: 7, warm: vec![vec![0.0, 0.0]] };
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| multi_start(&objective, &bounds, &starts, &Stopping::default()))
        };
        assert_eq!(run(1), run(2));
        assert_eq!(run(1).minima.len(), 8);
    }
}
