//! Gaussian processes, metamodels and calibration against numbers from other people's libraries (origin:
//! tests/data/README.md). Values marked mp60 were computed there with 60 digits.

use granulake::stats::gp::kernel::Kernel;
use granulake::stats::gp::likelihood::{Likelihood, LikelihoodSearch, Variance, maximise_likelihood};
use granulake::stats::gp::{Form, GaussianProcess, Hyperparameters, TrainingSet, Trend, log_likelihood_of_runs};
use granulake::stats::metamodel::{Kind, Metamodel, Noise, Observations, Options, PartRecord, Reading, Role, Scatter};
use granulake::stats::objective::{CalibrationObjective, Mode, Problem, Target, calibrate};
use granulake::stats::optimise::{Objective, Starts};
use granulake::stats::points::Points;
use serde_json::Value;

fn data(file: &str) -> Value {
    let path = format!("{}/tests/data/{file}", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{path}: {error}"))
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

fn list(value: &Value) -> &[Value] {
    value.as_array().unwrap_or_else(|| panic!("{value} is not a list"))
}

fn numbers(value: &Value) -> Vec<f64> {
    list(value).iter().map(number).collect()
}

fn points(value: &Value) -> Points {
    let rows: Vec<Vec<f64>> = list(value).iter().map(numbers).collect();
    Points::from_rows(&rows, rows[0].len()).unwrap()
}

fn agree(what: &str, ours: f64, theirs: f64, relative: f64, absolute: f64) {
    let error = (ours - theirs).abs();
    assert!(error <= relative * theirs.abs() + absolute, "{what}: ours {ours:e}, theirs {theirs:e}, error {error:e}");
}

fn agree_all(what: &str, ours: &[f64], theirs: &[f64], relative: f64, absolute: f64) {
    assert_eq!(ours.len(), theirs.len(), "{what}");
    for (index, (ours, theirs)) in ours.iter().zip(theirs).enumerate() {
        agree(&format!("{what} {index}"), *ours, *theirs, relative, absolute);
    }
}

fn unit_process(log10_a: &Value) -> Hyperparameters {
    Hyperparameters { log10_a: numbers(log10_a), variance: 1.0 }
}

/// Likelihood, its gradient, mean and variance of one case, at the tolerances of the data's README.
fn check_case(what: &str, training: TrainingSet, case: &Value, test: &Points, condition: f64, keys: [&str; 2]) {
    // 50 n eps cond(K), never below 1e-9; predictions and gradients have a floor of their own.
    let limit = (50.0 * training.targets.len() as f64 * 2.2e-16 * condition).max(1e-9);
    let hyper = unit_process(&case["log10_a"]);
    let (value, gradient) = Likelihood::new(&training, Form::PAPER).value_and_gradient(&hyper);
    agree(what, value, number(&case["lml_mp60"]), limit, 0.0);
    let theirs = numbers(&case["grad_lml_log10a_sklearn"]);
    agree_all(&format!("{what} gradient"), &gradient[..3], &theirs, (10.0 * limit).max(1e-6), 0.0);
    let process = GaussianProcess::new(training, hyper, Form::PAPER).unwrap();
    let latent: Vec<_> = test.rows().map(|x| process.predict(x)).collect();
    let means: Vec<f64> = latent.iter().map(|l| l.mean).collect();
    let variances: Vec<f64> = latent.iter().map(|l| l.variance).collect();
    agree_all(&format!("{what} mean"), &means, &numbers(&case[keys[0]]), limit.max(1e-8), 0.0);
    // A variance is a difference from 1, so it carries an absolute rounding of its own.
    agree_all(&format!("{what} variance"), &variances, &numbers(&case[keys[1]]), limit.max(1e-6), 1e-11);
}

#[test]
fn interpolating_process_agrees_with_60_digits() {
    let oracle = data("gp_ibm.json");
    let (x, y, test) = (points(&oracle["X"]), numbers(&oracle["y"]), points(&oracle["X_test"]));
    for case in list(&oracle["cases"]) {
        let noise = vec![number(&case["jitter"]); y.len()];
        let training = TrainingSet { points: x.clone(), targets: y.clone(), noise };
        let what = format!("ibm {} {}", case["jitter"], case["log10_a"]);
        check_case(&what, training, case, &test, number(&case["cond_K"]), ["mean_mp60", "latent_var_mp60"]);
    }
}

#[test]
fn a_rough_process_agrees_with_scikit_learn() {
    let oracle = data("gp_matern.json");
    let test = points(&oracle["X_test"]);
    let form = Form { trend: Trend::Zero, kernel: Kernel::Matern52 };
    for case in list(&oracle["cases"]) {
        let training = TrainingSet {
            points: points(&oracle["X"]),
            targets: numbers(&oracle["y"]),
            noise: numbers(&oracle["noise"]),
        };
        let hyper = Hyperparameters { log10_a: numbers(&case["log10_a"]), variance: number(&case["variance"]) };
        let (value, gradient) = Likelihood::new(&training, form).value_and_gradient(&hyper);
        agree("likelihood", value, number(&case["lml"]), 1e-9, 0.0);
        agree_all("gradient", &gradient, &numbers(&case["grad_lml"]), 1e-7, 1e-9);
        let process = GaussianProcess::new(training, hyper, form).unwrap();
        let latent: Vec<_> = test.rows().map(|x| process.predict(x)).collect();
        let means: Vec<f64> = latent.iter().map(|l| l.mean).collect();
        let variances: Vec<f64> = latent.iter().map(|l| l.variance).collect();
        agree_all("mean", &means, &numbers(&case["mean"]), 1e-8, 1e-10);
        agree_all("variance", &variances, &numbers(&case["latent_var"]), 1e-6, 1e-11);
    }
}

/// The three readings of the paper's noise, at the rounding of the data.
fn rbm_training(oracle: &Value, reading: &str) -> TrainingSet {
    let (y, cv, n) = (numbers(&oracle["y"]), numbers(&oracle["cv"]), number(&oracle["n_rep"]));
    let noise = |(cv, y): (&f64, &f64)| match reading {
        "cv_squared" => cv * cv,
        "cv" => *cv,
        _ => (cv * y) * (cv * y) / n,
    };
    let noise = cv.iter().zip(&y).map(noise).map(|value| (value * 1e12).round_ties_even() / 1e12).collect();
    TrainingSet { points: points(&oracle["X"]), targets: y, noise }
}

#[test]
fn regression_process_agrees_with_60_digits_and_leave_one_out_with_refits() {
    let oracle = data("gp_rbm.json");
    let test = points(&oracle["X_test"]);
    for case in list(&oracle["cases"]) {
        let reading = case["reading"].as_str().unwrap();
        let training = rbm_training(&oracle, reading);
        let what = format!("rbm {reading} {}", case["log10_a"]);
        check_case(&what, training.clone(), case, &test, 0.0, ["mean_mp60", "latent_var_mp60"]);
        let process = GaussianProcess::new(training, unit_process(&case["log10_a"]), Form::PAPER).unwrap();
        let (means, variances): (Vec<f64>, Vec<f64>) = process.leave_one_out().into_iter().take(8).unzip();
        agree_all(&what, &means, &numbers(&case["loo_mean_first8"]), 1e-8, 0.0);
        agree_all(&what, &variances, &numbers(&case["loo_latent_var_first8"]), 1e-6, 0.0);
    }
}

fn paper_search(seed: u64, refined: usize) -> LikelihoodSearch {
    let starts = Starts { seed, number: 100, refined, warm: Vec::new() };
    LikelihoodSearch { log10_a: (-1.0, 1.0), variance: Variance::Fixed(1.0), starts }
}

/// Reference training sets with the best log likelihood that 100 descents of another optimiser reached.
fn reference_searches() -> Vec<(String, TrainingSet, f64, Vec<f64>)> {
    let ibm = data("gp_ibm.json");
    let y = numbers(&ibm["y"]);
    let best = &ibm["multistart_jitter_1e-8"];
    let training = TrainingSet { points: points(&ibm["X"]), noise: vec![1e-8; y.len()], targets: y };
    let mut cases = vec![("ibm".to_owned(), training, number(&best["lml"]), numbers(&best["log10_a"]))];
    let rbm = data("gp_rbm.json");
    for reading in ["cv_squared", "cv", "var_of_mean"] {
        let best = &rbm["multistart"][reading];
        let training = rbm_training(&rbm, reading);
        cases.push((reading.to_owned(), training, number(&best["lml"]), numbers(&best["log10_a"])));
    }
    cases
}

#[test]
fn few_refined_starts_reach_the_optimum_of_a_hundred_descents() {
    for (what, training, best, log10_a) in reference_searches() {
        let few = maximise_likelihood(training.clone(), Form::PAPER, &paper_search(1, 4)).unwrap();
        let all = maximise_likelihood(training, Form::PAPER, &paper_search(2, 100)).unwrap();
        let ours = few.process.log_likelihood();
        // Optima may be better than the reference, never worse; 1e-6 is where a change of ln p has no meaning.
        assert!(ours >= best - 1e-6, "{what}: {ours} against {best}");
        assert!((ours - all.process.log_likelihood()).abs() < 1e-6, "{what}: few and all descents differ");
        agree_all(&what, &few.process.hyperparameters().log10_a, &log10_a, 0.0, 1e-3);
    }
}

/// hetGP's kernel, here and in the oracle.
fn squared_exponential(trend: Trend) -> Form {
    Form { trend, kernel: Kernel::SquaredExponential }
}

/// hetGP's theta is 2/a.
fn from_theta(theta: &[f64], variance: f64) -> Hyperparameters {
    Hyperparameters { log10_a: theta.iter().map(|theta| (2.0 / theta).log10()).collect(), variance }
}

struct Replicated {
    points: Points,
    means: Vec<f64>,
    squares: Vec<f64>,
    counts: Vec<usize>,
}

/// Means, variances and counts of the replicated data.
fn replicated(oracle: &Value) -> Replicated {
    let groups: Vec<Vec<f64>> = list(&oracle["Z_by_point"]).iter().map(numbers).collect();
    let means: Vec<f64> = groups.iter().map(|group| group.iter().sum::<f64>() / group.len() as f64).collect();
    let square = |(group, mean): (&Vec<f64>, &f64)| {
        group.iter().map(|z| (z - mean) * (z - mean)).sum::<f64>() / (group.len() as f64 - 1.0)
    };
    let squares = groups.iter().zip(&means).map(square).collect();
    Replicated { points: points(&oracle["X0"]), means, squares, counts: groups.iter().map(Vec::len).collect() }
}

/// Log likelihood of all runs where run i has the variance ν λ_i, and the process of the means.
fn all_runs(
    runs: &Replicated,
    theta: &[f64],
    nu: f64,
    lambda: &[f64],
    eps: f64,
    trend: Trend,
) -> (f64, GaussianProcess) {
    let variances: Vec<f64> = lambda.iter().map(|value| nu * value).collect();
    let noise = variances.iter().zip(&runs.counts).map(|(v, &n)| v / n as f64 + nu * eps).collect();
    let training = TrainingSet { points: runs.points.clone(), targets: runs.means.clone(), noise };
    let process = GaussianProcess::new(training, from_theta(theta, nu), squared_exponential(trend)).unwrap();
    let value = log_likelihood_of_runs(process.log_likelihood(), &variances, &runs.squares, &runs.counts);
    (value, process)
}

#[test]
fn unique_points_give_the_likelihood_and_predictions_of_all_runs() {
    let oracle = data("hetgp.json");
    let runs = replicated(&oracle);
    for case in list(&oracle["fullN"]) {
        let (theta, lambda) = (numbers(&case["theta"]), numbers(&case["lambda"]));
        let (value, process) = all_runs(&runs, &theta, number(&case["nu"]), &lambda, 0.0, Trend::Zero);
        agree("all runs", value, number(&case["lml_fullN_sklearn"]), 1e-9, 0.0);
        let latent: Vec<_> = points(&case["X_test"]).rows().map(|x| process.predict(x)).collect();
        let means: Vec<f64> = latent.iter().map(|l| l.mean).collect();
        let variances: Vec<f64> = latent.iter().map(|l| l.variance).collect();
        agree_all("mean", &means, &numbers(&case["mean"]), 1e-9, 0.0);
        agree_all("variance", &variances, &numbers(&case["latent_var"]), 1e-6, 0.0);
    }
}

/// The largest likelihood over ν: at ν̂ = (Σ (n_i − 1)s_i²/λ_i + (z̄ − β)ᵀU⁻¹(z̄ − β))/N, which is read off at ν = 1.
fn profile(runs: &Replicated, theta: &[f64], lambda: &[f64], eps: f64, trend: Trend) -> f64 {
    let (_, unit) = all_runs(runs, theta, 1.0, lambda, eps, trend);
    let (n, total) = (runs.means.len() as f64, runs.counts.iter().sum::<usize>() as f64);
    // The quadratic form follows from two likelihoods: scaling K by c changes ln p by −½(1/c − 1) q − ½ n ln c.
    let (_, double) = all_runs(runs, theta, 2.0, lambda, eps, trend);
    let q = 4.0 * (double.log_likelihood() - unit.log_likelihood() + 0.5 * n * 2.0_f64.ln());
    let within: f64 = (0..runs.means.len()).map(|i| (runs.counts[i] as f64 - 1.0) * runs.squares[i] / lambda[i]).sum();
    all_runs(runs, theta, (within + q) / total, lambda, eps, trend).0
}

#[test]
fn profile_likelihoods_of_equal_and_of_smoothed_variances_agree_with_hetgp() {
    let oracle = data("hetgp.json");
    let runs = replicated(&oracle);
    for case in list(&oracle["hom_loglik"]) {
        let trend = if case["beta0"].is_null() { Trend::Constant } else { Trend::Zero };
        let lambda = vec![number(&case["g"]); runs.means.len()];
        let ours = profile(&runs, &numbers(&case["theta"]), &lambda, number(&case["eps"]), trend);
        agree("equal variances", ours, number(&case["loglik"]), 1e-9, 0.0);
    }
    for case in list(&oracle["het_loglik"]).iter().filter(|case| case["penalty"] == false) {
        let (eps, g) = (number(&case["eps"]), number(&case["g"]));
        let noise = runs.counts.iter().map(|&n| eps + g / n as f64).collect();
        let training = TrainingSet { points: runs.points.clone(), targets: numbers(&case["Delta"]), noise };
        let hyper = from_theta(&numbers(&case["theta_g"]), 1.0);
        let smooth = GaussianProcess::new(training, hyper, squared_exponential(Trend::Constant)).unwrap();
        let lambda: Vec<f64> = runs.points.rows().map(|x| smooth.mean(x).exp()).collect();
        let ours = profile(&runs, &numbers(&case["theta"]), &lambda, eps, Trend::Constant);
        agree("smoothed variances", ours, number(&case["loglik"]), 1e-8, 0.0);
    }
}

/// The calibration data as observations of a KPI: 20 runs per point.
fn kpi(oracle: &Value, index: usize) -> Observations {
    let means = numbers(&oracle["y"][index]);
    let counts = vec![20; means.len()];
    Observations { points: points(&oracle["X"]), means, sds: numbers(&oracle["std"][index]), counts }
}

/// The stored model that the oracle describes: given length scales, targets not scaled, ibm on the sd itself.
fn stored(oracle: &Value, kind: Kind, role: Role, index: usize) -> PartRecord {
    let jitter = if kind == Kind::Ibm { number(&oracle["jitter"]) } else { 0.0 };
    PartRecord {
        kind,
        role,
        reading: Reading { noise: Noise::CvSquared, scatter: Scatter::Sd, ..Reading::default() },
        offset: 0.0,
        scale: 1.0,
        jitter,
        log10_a: numbers(&oracle["log10_a"][index]),
        variance: 1.0,
        beta: 0.0,
        log_likelihood: 0.0,
        at_bound: vec![false; 3],
        descents: 0,
        agreeing: 0,
    }
}

fn stored_models(oracle: &Value, kind: Kind) -> Vec<Metamodel> {
    let roles: &[Role] = if kind == Kind::Ibm { &[Role::Mean, Role::Scatter] } else { &[Role::Mean] };
    let model = |index: usize| {
        let records: Vec<PartRecord> = roles.iter().map(|&role| stored(oracle, kind, role, index)).collect();
        Metamodel::restore(&records, &kpi(oracle, index)).unwrap()
    };
    (0..3).map(model).collect()
}

fn targets(oracle: &Value) -> Vec<Target> {
    let (means, sds) = (numbers(&oracle["target_mean"]), numbers(&oracle["target_std"]));
    means.iter().zip(&sds).map(|(&mean, &sd)| Target { mean, sd, count: 50, weight: 1.0 }).collect()
}

#[test]
fn calibration_objectives_agree_and_their_minima_are_at_least_as_low() {
    let oracle = data("calibration_objective.json");
    let places = points(&oracle["points"]);
    for (kind, mode) in [Kind::Ibm, Kind::Rbm].into_iter().flat_map(|k| Mode::ALL.iter().map(move |&m| (k, m))) {
        let models = stored_models(&oracle, kind);
        for (place, expected) in places.rows().zip(list(&oracle["pred_at_points"][kind.name()])) {
            let predictions: Vec<_> = models.iter().map(|model| model.predict(place)).collect();
            let means: Vec<f64> = predictions.iter().map(|p| p.mean.value).collect();
            let sds: Vec<f64> = predictions.iter().map(|p| p.sd.as_ref().unwrap().value).collect();
            // Condition numbers near 1e7 at jitter 1e-6: 50 n eps cond is 5e-6; agreement is far better.
            agree_all("predicted mean", &means, &numbers(&expected[0]), 1e-8, 0.0);
            agree_all("predicted sd", &sds, &numbers(&expected[1]), 1e-7, 0.0);
        }
        let problem = Problem::new(models.iter().collect(), targets(&oracle), Vec::new(), mode).unwrap();
        let objective = CalibrationObjective::new(problem, 0.5).unwrap();
        let expected = &oracle["objective"][format!("{}_{}", kind.name(), mode.name())];
        let values: Vec<f64> = places.rows().map(|x| objective.value(x)).collect();
        agree_all("objective", &values, &numbers(&expected["c_at_points"]), 1e-7, 0.0);
        let starts = Starts { seed: 5, number: 100, refined: 30, warm: Vec::new() };
        let found = calibrate(&objective, &starts);
        // An exact match has c = 0 up to rounding: 1e-15 is a relative deviation of 3e-8 in a KPI.
        let best = number(&expected["best_c"]);
        assert!(found.value <= best * (1.0 + 1e-9) + 1e-15, "{expected}: {found:?}");
        assert!(found.x.iter().all(|x| (0.0..=1.0).contains(x)));
    }
}

/// Stochastic kriging is fitted in two steps, hetGP jointly with a penalty: they are different estimates of the same
/// functions, so they must agree within their own uncertainty and find as likely a model.
#[test]
fn stochastic_kriging_is_consistent_with_a_joint_heteroscedastic_fit() {
    let oracle = data("hetgp.json");
    let runs = replicated(&oracle);
    let sds = runs.squares.iter().map(|square| square.sqrt()).collect();
    let observations = Observations { points: runs.points, means: runs.means, sds, counts: runs.counts };
    let model = Metamodel::fit(Kind::Sk, &observations, &Options::default()).unwrap();
    let fit = &oracle["fits"]["het"];
    let (means, variances) = (numbers(&fit["mean"]), numbers(&fit["sd2_latent"]));
    for ((x, theirs), variance) in points(&oracle["X_test"]).rows().zip(&means).zip(&variances) {
        let ours = model.predict(x);
        let sd = (ours.epistemic_sd * ours.epistemic_sd + variance).sqrt();
        assert!((ours.mean.value - theirs).abs() < 2.0 * sd, "{} against {theirs} ± {sd}", ours.mean.value);
    }
    let ours = model.log_likelihood_of_runs().unwrap();
    let equal = number(&oracle["fits"]["hom"]["loglik"]);
    assert!(
        ours > equal + 10.0,
        "{ours}: a variance that changes over the design must be far more likely than {equal}"
    );
}
