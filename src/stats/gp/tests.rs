use super::likelihood::Likelihood;
use super::*;
use crate::rng::Stream;

const P: usize = 3;

fn sample(n: usize, seed: u64) -> TrainingSet {
    let mut stream = Stream::new(seed, "gp test");
    let mut points = Points::empty(P);
    let (mut targets, mut noise) = (Vec::new(), Vec::new());
    for _ in 0..n {
        let x: Vec<f64> = (0..P).map(|_| stream.uniform()).collect();
        noise.push(1e-3 + 1e-2 * x[1]);
        targets.push(5.0 + libm::sin(3.0 * x[0]) - x[1] * x[2] + 0.05 * stream.normal());
        points.push(&x);
    }
    TrainingSet { points, targets, noise }
}

fn hyper() -> Hyperparameters {
    Hyperparameters { log10_a: vec![0.4, -0.2, 0.1], variance: 2.5 }
}

/// Every mean function with every kernel.
fn forms() -> impl Iterator<Item = Form> {
    let of = |trend| Kernel::ALL.iter().map(move |&kernel| Form { trend, kernel });
    [Trend::Zero, Trend::Constant].into_iter().flat_map(of)
}

fn central(function: impl Fn(f64) -> f64, at: f64) -> f64 {
    let step = 1e-5;
    (function(at + step) - function(at - step)) / (2.0 * step)
}

#[test]
fn gradients_of_mean_and_variance_are_those_of_the_values() {
    for form in forms() {
        let process = GaussianProcess::new(sample(25, 1), hyper(), form).unwrap();
        let x = [0.35, 0.8, 0.15];
        let here = process.predict(&x);
        assert_eq!((process.mean_with_gradient(&x).0, process.variance(&x)), (here.mean, here.variance));
        assert!((here.mean - process.mean(&x)).abs() < 1e-13);
        for d in 0..P {
            let at = |value: f64| {
                let mut moved = x;
                moved[d] = value;
                process.predict(&moved)
            };
            let mean = central(|value| at(value).mean, x[d]);
            let variance = central(|value| at(value).variance, x[d]);
            assert!((here.mean_gradient[d] - mean).abs() < 1e-7, "{form:?} mean {d}");
            assert!((here.variance_gradient[d] - variance).abs() < 1e-7, "{form:?} variance {d}");
        }
    }
}

/// Cov(f(x), f(y))² from conditioning on f(y) exactly: Var(f(x) | f(y)) = v_x − c²/v_y.
fn squared_covariance(training: &TrainingSet, form: Form, x: &[f64], y: &[f64]) -> f64 {
    let of = |training: TrainingSet| GaussianProcess::new(training, hyper(), form).unwrap();
    let process = of(training.clone());
    let mut wider = training.clone();
    wider.points.push(y);
    wider.targets.push(0.0);
    wider.noise.push(0.0);
    (process.variance(x) - of(wider).variance(x)) * process.variance(y)
}

/// Var(f(x) − f(y)) = v_x + v_y − 2c, far and near, where both errors go together, and 0 of a point and itself.
#[test]
fn variance_of_a_difference_is_that_of_both_ends_less_their_covariance() {
    for form in forms() {
        let training = sample(25, 1);
        let process = GaussianProcess::new(training.clone(), hyper(), form).unwrap();
        let x = [0.35, 0.8, 0.15];
        for y in [[0.36, 0.79, 0.17], [0.5, 0.6, 0.2], [0.9, 0.1, 0.7]] {
            let (v_x, v_y) = (process.variance(&x), process.variance(&y));
            let told = 0.5 * (v_x + v_y - process.difference_variance(&x, &y));
            let seen = squared_covariance(&training, form, &x, &y);
            assert!((told * told - seen).abs() < 1e-6 * v_x * v_y, "{form:?} {y:?}: told {}, seen {seen}", told * told);
        }
        assert!(process.difference_variance(&x, &x) < 1e-12);
    }
}

/// The variance of a central difference of f.
#[test]
fn variance_of_the_gradient_is_that_of_a_narrow_difference() {
    for form in forms() {
        let process = GaussianProcess::new(sample(25, 1), hyper(), form).unwrap();
        let x = [0.35, 0.8, 0.15];
        for (d, told) in process.gradient_variance(&x).into_iter().enumerate() {
            let h = 0.005;
            let (mut low, mut high) = (x, x);
            low[d] -= h;
            high[d] += h;
            let seen = process.difference_variance(&low, &high) / (4.0 * h * h);
            assert!((seen / told - 1.0).abs() < 0.02, "{form:?} {d}: told {told}, seen {seen}");
        }
    }
}

#[test]
fn gradient_of_the_likelihood_is_that_of_the_value() {
    let training = sample(25, 2);
    for form in forms() {
        let likelihood = Likelihood::new(&training, form);
        let (value, gradient) = likelihood.value_and_gradient(&hyper());
        assert_eq!(value, likelihood.value(&hyper()));
        for (d, slope) in gradient.iter().enumerate() {
            let at = |shift: f64| {
                let mut moved = hyper();
                match moved.log10_a.get_mut(d) {
                    Some(exponent) => *exponent += shift,
                    None => moved.variance *= libm::exp10(shift),
                }
                likelihood.value(&moved)
            };
            let numeric = central(at, 0.0);
            assert!((slope - numeric).abs() < 1e-6 * numeric.abs().max(1.0), "{form:?} {d}");
        }
    }
}

#[test]
fn leave_one_out_equals_fitting_without_the_point() {
    let training = sample(12, 3);
    for form in forms() {
        let closed = GaussianProcess::new(training.clone(), hyper(), form).unwrap().leave_one_out();
        for (i, (mean, variance)) in closed.into_iter().enumerate() {
            let rest: Vec<usize> = (0..12).filter(|&j| j != i).collect();
            let pick = |values: &[f64]| rest.iter().map(|&j| values[j]).collect();
            let reduced = TrainingSet {
                points: training.points.select(&rest),
                targets: pick(&training.targets),
                noise: pick(&training.noise),
            };
            let left = GaussianProcess::new(reduced, hyper(), form).unwrap().predict(training.points.row(i));
            assert!((left.mean - mean).abs() < 1e-9 && (left.variance - variance).abs() < 1e-9, "{form:?} {i}");
        }
    }
}

#[test]
fn one_run_per_point_leaves_the_likelihood_as_it_is() {
    assert_eq!(log_likelihood_of_runs(-3.5, &[0.2, 0.4], &[0.0, 0.0], &[1, 1]), -3.5);
}
