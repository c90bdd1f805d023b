use super::identifiability::identify;
use super::*;
use crate::rng::Stream;
use crate::stats::ensemble::{Length, Sample, everywhere, sample};
use crate::stats::metamodel::{Kind, Observations, Options};
use crate::stats::points::Points;

const TRUE: [f64; 2] = [0.4, 0.7];

/// Two KPIs of two parameters; `mixing` 0 makes both depend on the sum alone, so that the difference stays free.
fn means(x: &[f64], mixing: f64) -> [f64; 2] {
    [10.0 + 3.0 * (x[0] + x[1]), 20.0 - 2.0 * (x[0] + x[1]) + mixing * (x[0] - x[1])]
}

fn models(mixing: f64) -> Vec<Metamodel> {
    let mut stream = Stream::new(1, "objective test");
    let (mut points, runs) = (Points::empty(2), 20);
    let mut values = [vec![], vec![]];
    for _ in 0..40 {
        let x = [stream.uniform(), stream.uniform()];
        points.push(&x);
        let noise = [stream.normal(), stream.normal()];
        means(&x, mixing)
            .iter()
            .enumerate()
            .for_each(|(k, mean)| values[k].push(mean + 0.3 * noise[k] / 20.0_f64.sqrt()));
    }
    let sds: Vec<f64> = (0..40).map(|i| 0.3 * (1.0 + 0.2 * (points.row(i)[0] - 0.5))).collect();
    let fit = |means: Vec<f64>| {
        let data = Observations { points: points.clone(), means, sds: sds.clone(), counts: vec![runs; 40] };
        Metamodel::fit(Kind::Sk, &data, &Options { starts: 30, refined: 2, ..Options::default() }).unwrap()
    };
    values.into_iter().map(fit).collect()
}

fn targets(mixing: f64) -> Vec<Target> {
    means(&TRUE, mixing).map(|mean| Target { mean, sd: 0.3, count: 50, weight: 1.0 }).to_vec()
}

fn problem(models: &[Metamodel], mixing: f64, mode: Mode, priors: Vec<Prior>) -> Problem<'_> {
    Problem::new(models.iter().collect(), targets(mixing), priors, mode).unwrap()
}

#[test]
fn gradient_of_the_objective_is_that_of_its_value() {
    let models = models(4.0);
    let prior = Prior { parameter: 1, mean: 0.2, sd: 0.05, relative_sd: 0.02, weight: 0.7 };
    for &mode in Mode::ALL {
        let objective = CalibrationObjective::new(problem(&models, 4.0, mode, vec![prior]), 0.5).unwrap();
        let (value, gradient) = objective.value_and_gradient(&[0.3, 0.6]);
        assert_eq!(value, objective.value(&[0.3, 0.6]));
        for d in 0..2 {
            let at = |shift: f64| {
                let mut x = [0.3, 0.6];
                x[d] += shift;
                objective.value(&x)
            };
            let numeric = (at(1e-5) - at(-1e-5)) / 2e-5;
            assert!((gradient[d] - numeric).abs() < 1e-7, "{mode:?} {d}: {} {numeric}", gradient[d]);
        }
    }
}

fn draws(problem: &Problem) -> Sample {
    let mut stream = Stream::new(0, "posterior walkers");
    let start = everywhere(problem.dimension(), 32, &mut stream);
    sample(start, |x| problem.log_posterior(x), Length { sweeps: 1300, draws: 0.0, doublings: 0 }, stream)
}

#[test]
fn calibration_finds_planted_parameters_within_their_posterior() {
    let models = models(4.0);
    let starts = Starts { seed: 1, number: 100, refined: 20, warm: Vec::new() };
    let objective = CalibrationObjective::new(problem(&models, 4.0, Mode::Mean, vec![]), 0.5).unwrap();
    let found = calibrate(&objective, &starts);
    assert!(found.value < 1e-12 && found.agreeing == 20, "{found:?}");
    let problem = problem(&models, 4.0, Mode::MeanVariance, vec![]);
    let sampled = draws(&problem);
    assert!((0.2..0.9).contains(&sampled.acceptance) && sampled.autocorrelation_time < 100.0, "{sampled:?}");
    let known = identify(&problem, &found.x);
    assert!(known.directions.iter().all(|direction| !direction.flat));
    for (d, marginal) in sampled.marginals().into_iter().enumerate() {
        assert!(marginal.lower < TRUE[d] && TRUE[d] < marginal.upper, "parameter {d}: {marginal:?}");
        assert!((found.x[d] - TRUE[d]).abs() < 4.0 * marginal.sd, "parameter {d}: {:?}", found.x);
        // The response is linear here, so both must agree but for the noise of the sample and the term ln S.
        let linear = known.covariance[d][d].sqrt();
        assert!((marginal.sd / linear - 1.0).abs() < 0.15, "parameter {d}: {} {linear}", marginal.sd);
    }
    assert_eq!(sampled, draws(&problem));
}

#[test]
fn a_direction_that_nothing_depends_on_is_named_and_a_prior_fixes_it() {
    let models = models(0.0);
    let open = identify(&problem(&models, 0.0, Mode::Mean, vec![]), &[0.5, 0.5]);
    assert!(open.directions[0].flat && !open.directions[1].flat, "{open:?}");
    let label = open.directions[0].label(&["sliding_friction", "rolling_friction"]);
    assert!(label.contains("sliding_friction") && label.contains(" - ") && label.starts_with("0.7"), "{label}");
    let prior = Prior::measured(0, 5.4, 0.2, 4, (5.0, 6.0));
    assert!((prior.mean - 0.4).abs() < 1e-12 && (prior.sd - 0.1).abs() < 1e-12);
    let fixed = problem(&models, 0.0, Mode::Mean, vec![prior]);
    assert!(identify(&fixed, &[0.5, 0.5]).directions.iter().all(|direction| !direction.flat));
    let sampled = draws(&fixed);
    let marginal = sampled.marginals()[0];
    assert!((marginal.mean - 0.4).abs() < 0.03 && (marginal.sd - 0.1).abs() < 0.02, "{marginal:?}");
    assert!(sampled.correlations()[0][1] < -0.8, "{:?}", sampled.correlations());
}

#[test]
fn a_target_out_of_reach_ends_on_the_bounds() {
    let models = models(4.0);
    let far = vec![Target { mean: 30.0, sd: 0.3, count: 50, weight: 1.0 }; 2];
    let problem = Problem::new(models.iter().collect(), far, vec![], Mode::Mean).unwrap();
    let starts = Starts { seed: 1, number: 20, refined: 5, warm: Vec::new() };
    let found = calibrate(&CalibrationObjective::new(problem, 0.5).unwrap(), &starts);
    assert_eq!(found.at_bound, [true, false], "{found:?}");
    assert!(found.x[0] == 1.0 && found.terms[0].mean > 0.01);
}

#[test]
fn mismatches_are_refused() {
    let models = models(4.0);
    let refuse = |targets: Vec<Target>, priors: Vec<Prior>, mode| {
        Problem::new(models.iter().collect(), targets, priors, mode).unwrap_err()
    };
    assert_eq!(refuse(vec![], vec![], Mode::Mean), ObjectiveError::Shape { models: 2, targets: 0 });
    let mut once = targets(4.0);
    once[1].count = 1;
    assert_eq!(refuse(once, vec![], Mode::MeanVariance), ObjectiveError::NoScatter { index: 1 });
    let prior = Prior { parameter: 2, mean: 0.5, sd: 0.1, relative_sd: 0.1, weight: 1.0 };
    assert_eq!(refuse(targets(4.0), vec![prior], Mode::Mean), ObjectiveError::BadPrior { index: 0 });
    let mut zero = targets(4.0);
    zero[0].mean = 0.3;
    let problem = Problem::new(models.iter().collect(), zero, vec![], Mode::MeanVariance).unwrap();
    assert_eq!(CalibrationObjective::new(problem, 0.5).unwrap_err(), ObjectiveError::ZeroTarget { index: 0 });
}
