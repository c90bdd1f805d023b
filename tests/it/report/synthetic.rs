//! A report made up for the tests: every table filled with plausible numbers, some values missing with a reason.

use granulake::report::{Assumption, Departure, Method, Report, Resolution, Study};
use granulake::tables::{
    AggregateRow, AttributionRow, BeforeAfterRow, BoundRow, CalibrationRow, ConfusionRow, DesignQualityRow,
    FeasibilityRow, HyperparameterRow, KpiRow, MeasuredAnalysisRow, MeasuredStatisticRow, MetamodelRow, OptimumRow,
    PosteriorRow, PosteriorSummaryRow, PredictionRow, RecalibrationRow, ResidualRow, RunRow, SampleRow, SensitivityRow,
    SignatureRow, TargetRow, ValidationRow, VerdictRow, VerificationRow,
};

const SETS: [&str; 2] = ["demo", "paper"];
const KINDS: [&str; 3] = ["ibm", "rbm", "sk"];
const APPROACHES: [&str; 2] = ["m", "mv"];
/// Observable, experiment, unit, mean, standard deviation, fitted.
const OBSERVABLES: [(&str, &str, &str, f64, f64, bool); 7] = [
    ("angle_of_repose", "pile", "deg", 25.43, 2.09, true),
    ("angle_of_movement", "ledge", "deg", 41.40, 1.38, true),
    ("bulk_density", "bulk_density", "kg/m3", 1473.1, 10.94, true),
    ("discharge_rate", "hopper", "kg/s", 3.68, 0.025, false),
    ("mass_on_ledge", "ledge", "kg", 1.912, 0.081, true),
    ("mass_on_shelf", "pile", "kg", 0.641, 0.052, true),
    ("particle_count", "bulk_density", "1", 4187.0, 14.2, true),
];
const PARAMETERS: [(&str, &str, f64, f64, f64); 3] = [
    ("sliding_friction", "1", 0.5513, 0.1, 0.9),
    ("rolling_friction", "1", 0.4885, 0.1, 0.9),
    ("particle_density", "kg/m3", 2763.5, 2542.9, 2834.7),
];
const EFFECTS: [(&str, &str); 4] =
    [("cohesion", "1"), ("size_shift", "1"), ("wall_friction_scatter", "1"), ("camera_roll", "deg")];

/// Deterministic numbers between -1 and 1 that look irregular.
struct Wobble(u64);

impl Wobble {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f64 / f64::from(1u32 << 23) - 1.0
    }
}

/// A report with every table filled, gaps and failures among the rows.
pub fn full() -> Report {
    let mut wobble = Wobble(7);
    let mut report = Report { study: study(), ..Report::default() };
    design(&mut report, &mut wobble);
    laboratory(&mut report, &mut wobble);
    calibration(&mut report, &mut wobble);
    diagnosis(&mut report, &mut wobble);
    report
}

fn study() -> Study {
    Study {
        name: "pipeline".into(),
        title: "Gravel, coarse set-up: which effect does the model lack?".into(),
        resolution: Resolution::Coarse,
        physics_version: "1".into(),
        published: Some("paper".into()),
        method: Some(Method { kind: "sk".into(), approach: "mv".into() }),
        confidence: 0.9,
        assumptions: vec![
            Assumption {
                name: "pile.depth".into(),
                value: "100 mm".into(),
                meaning: "Depth of the pile's boxes; the paper's drawing does not give it.".into(),
            },
            Assumption {
                name: "insertion_step".into(),
                value: "1e-4 mean radii".into(),
                meaning: "Rise of the insertion plane per attempted particle.".into(),
            },
        ],
        departures: vec![
            Departure { name: "radius_scale".into(), value: "1.75".into(), paper: "1".into() },
            Departure { name: "stiffness_scale".into(), value: "0.01".into(), paper: "1".into() },
        ],
    }
}

fn design(report: &mut Report, wobble: &mut Wobble) {
    for point in 1..=12u32 {
        let set = ["boundary", "interior", "validation"][(point as usize - 1) / 4];
        for (name, unit, _, low, high) in PARAMETERS {
            let unit_value = if point == 1 {
                0.0
            } else if point == 4 {
                1.0
            } else {
                0.5 + 0.5 * wobble.next()
            };
            report.samples.push(SampleRow {
                point,
                set: set.into(),
                parameter: name.into(),
                value: low + unit_value * (high - low),
                unit: unit.into(),
                unit_value,
                parameter_hash: format!("{point:064x}"),
            });
        }
        for (experiment, label) in [("pile", "design"), ("ledge", "design"), ("hopper", "demo/before")] {
            (1..=3).for_each(|repetition| report.runs.push(run(label, experiment, point, repetition, wobble)));
        }
        for (kpi, experiment, unit, mean, sd, _) in OBSERVABLES {
            (1..=3).for_each(|n| report.aggregates.push(aggregate(kpi, experiment, unit, mean, sd, point, n, wobble)));
        }
    }
    report.kpis.push(KpiRow {
        label: "design".into(),
        experiment: "ledge".into(),
        point: 2,
        parameter_hash: "0".into(),
        seed: 2,
        repetition: 1,
        run_key: "other".into(),
        kpi: "angle_of_movement".into(),
        value: None,
        unit: "deg".into(),
        status: "failed".into(),
        reason: Some("fewer than three bins hold a particle".into()),
    });
}

fn run(label: &str, experiment: &str, point: u32, repetition: u32, wobble: &mut Wobble) -> RunRow {
    let failed = experiment == "hopper" && point == 3;
    RunRow {
        label: label.into(),
        experiment: experiment.into(),
        point,
        parameter_hash: format!("{point:064x}"),
        repetition,
        seed: u64::from(point * 100 + repetition),
        effects: String::new(),
        run_key: format!("{label}-{experiment}-{point}-{repetition}"),
        status: if failed { "failed" } else { "ok" }.into(),
        reason: failed.then(|| "the hopper is clogged: 41 % of the mass stays above the slot".into()),
        stop: (!failed).then(|| if point.is_multiple_of(5) { "time_cap" } else { "energy_ratio" }.into()),
        time_s: Some(3.1),
        steps: Some(48_211),
        inserted: Some(1100),
        insertion_attempts: Some(200_000),
        deleted: Some(288),
        lost: Some(0),
        particles: Some(812),
        energy_ratio: Some(9e-7),
        coordination_number: (!failed).then(|| 4.36 + 0.4 * wobble.next()),
        max_overlap: (!failed).then(|| 0.031 + 0.005 * wobble.next()),
        state: None,
        trace: None,
    }
}

#[allow(clippy::too_many_arguments, reason = "a row of test data is made of its columns")]
fn aggregate(
    kpi: &str,
    experiment: &str,
    unit: &str,
    mean: f64,
    sd: f64,
    point: u32,
    n: u32,
    wobble: &mut Wobble,
) -> AggregateRow {
    let mean = mean + sd * wobble.next() / f64::from(n);
    let half = [f64::INFINITY, 8.98, 2.48][n as usize - 1] * sd;
    let some = |value: f64| (n > 1).then_some(value);
    AggregateRow {
        experiment: experiment.into(),
        kpi: kpi.into(),
        point,
        parameter_hash: format!("{point:064x}"),
        n,
        count: n,
        mean: Some(mean),
        mean_lower: some(mean - half),
        mean_upper: some(mean + half),
        sd: some(sd),
        sd_lower: some(0.5 * sd),
        sd_upper: some(6.3 * sd),
        unit: unit.into(),
    }
}

fn calibration(report: &mut Report, wobble: &mut Wobble) {
    for (kpi, _, unit, ..) in OBSERVABLES {
        for kind in KINDS {
            sensitivity(report, kpi, unit, kind);
            (1..=3).for_each(|n| report.metamodels.push(metamodel(kpi, kind, n, wobble)));
        }
    }
    report.hyperparameters.push(HyperparameterRow {
        kpi: "bulk_density".into(),
        kind: "sk".into(),
        n: 3,
        response: "mean".into(),
        name: "log10_a_sliding_friction".into(),
        value: -0.31,
    });
    for measured in SETS {
        OBSERVABLES.iter().for_each(|observable| report.targets.push(target(measured, observable)));
        for kind in KINDS {
            for approach in APPROACHES {
                (1..=3).for_each(|n| method(report, measured, kind, approach, n, wobble));
                distribution(report, measured, kind, approach, wobble);
            }
        }
    }
}

/// A bound of the particle density that was found by simulation.
fn bound(name: &str) -> BoundRow {
    BoundRow {
        parameter: "particle_density".into(),
        bound: name.into(),
        value: 2630.0,
        unrounded: 2637.7,
        standard_error: 12.3,
        others: "sliding_friction=0.1".into(),
        simulated_mean: 1292.0,
        simulated_mean_lower: Some(1286.1),
        simulated_mean_upper: Some(1297.8),
        simulated_sd: Some(8.2),
        count: 10,
        measured: "paper".into(),
        measured_bulk_density: 1473.1,
        measured_bulk_density_error: 1.5,
        measured_particle_density: 2313.4,
        measured_particle_density_error: 9.5,
        unit: "kg/m3".into(),
    }
}

/// What the measured data are worth: single values in one data set, a published summary in the other.
fn laboratory(report: &mut Report, wobble: &mut Wobble) {
    report.bounds = ["lower", "upper"].map(bound).to_vec();
    for (index, set) in ["boundary", "interior", "validation"].into_iter().enumerate() {
        report.design_quality.push(DesignQualityRow {
            set: set.into(),
            points: 4,
            min_distance: (index > 0).then_some(0.21),
            joint_min_distance: Some(0.117),
        });
    }
    for (measured, (kpi, experiment, unit, mean, sd, fitted)) in
        SETS.into_iter().flat_map(|set| OBSERVABLES.map(|observable| (set, observable)))
    {
        let single = measured == "demo";
        for n in if single { 1..=5 } else { 50..=50 } {
            let half = 2.0 * sd / f64::from(n).sqrt();
            report.measured_statistics.push(MeasuredStatisticRow {
                measured: measured.into(),
                experiment: experiment.into(),
                kpi: kpi.into(),
                n,
                mean: mean + half * wobble.next(),
                mean_lower: (n > 1).then_some(mean - half),
                mean_upper: (n > 1).then_some(mean + half),
                sd: (n > 1).then_some(sd),
                sd_lower: (n > 1).then_some(0.6 * sd),
                sd_upper: (n > 1).then_some(2.1 * sd),
                unit: unit.into(),
            });
        }
        report.measured_analysis.push(MeasuredAnalysisRow {
            measured: measured.into(),
            experiment: experiment.into(),
            kpi: kpi.into(),
            n: if single { 5 } else { 50 },
            stable_from: single.then_some(3),
            precision: Some(0.0234),
            precision_wished: 0.02,
            needed: Some(68),
            needed_lower: Some(48),
            needed_upper: None,
            lilliefors_d: single.then_some(0.184),
            lilliefors_p: single.then_some(0.412),
            lilliefors_p_simulated: single.then_some(0.437),
        });
        for set in ["boundary", "corner", "design"] {
            report.feasibility.push(FeasibilityRow {
                measured: measured.into(),
                experiment: experiment.into(),
                kpi: kpi.into(),
                set: set.into(),
                points: 8,
                lowest: fitted.then_some(0.8 * mean),
                lowest_point: fitted.then_some(1),
                highest: fitted.then_some(0.9 * mean),
                highest_point: fitted.then_some(4),
                target: mean,
                bracketed: false,
                outside_sd: fitted.then_some(3.4),
                unit: unit.into(),
            });
        }
    }
}

/// Shares of the parameters, and draws of them given the data.
fn distribution(report: &mut Report, measured: &str, kind: &str, approach: &str, wobble: &mut Wobble) {
    for (index, (name, unit, value, low, high)) in PARAMETERS.into_iter().enumerate() {
        report.posterior_summary.push(PosteriorSummaryRow {
            measured: measured.into(),
            kind: kind.into(),
            approach: approach.into(),
            n: 3,
            parameter: name.into(),
            lower: value - 0.05 * (high - low),
            median: value,
            upper: value + 0.05 * (high - low),
            relative_sd: if index == 1 { 0.97 } else { 0.31 },
            partner: Some(PARAMETERS[(index + 1) % 3].0.into()),
            correlation: Some(-0.83),
            acceptance: 0.57,
            independent_draws: 311.0,
            unit: unit.into(),
        });
        for draw in 1..=20 {
            report.posterior.push(PosteriorRow {
                measured: measured.into(),
                kind: kind.into(),
                approach: approach.into(),
                n: 3,
                draw,
                parameter: name.into(),
                value: value + 0.05 * (high - low) * wobble.next(),
                unit: unit.into(),
            });
        }
    }
}

fn sensitivity(report: &mut Report, kpi: &str, unit: &str, kind: &str) {
    for statistic in ["mean", "sd"] {
        for (parameter, ..) in PARAMETERS {
            report.sensitivity.push(SensitivityRow {
                kpi: kpi.into(),
                kind: kind.into(),
                n: 3,
                statistic: statistic.into(),
                parameter: parameter.into(),
                first: -0.003,
                total: 0.62,
                mean: 25.0,
                spread: 4.0,
                unit: unit.into(),
            });
        }
    }
}

fn metamodel(kpi: &str, kind: &str, n: u32, wobble: &mut Wobble) -> MetamodelRow {
    let lone = kind == "sk" && n == 1;
    let error = |scale: f64, wobble: &mut Wobble| (!lone).then(|| scale * (1.2 + 0.2 * wobble.next()) / f64::from(n));
    MetamodelRow {
        kpi: kpi.into(),
        kind: kind.into(),
        n,
        points: 47,
        lml: (!lone).then_some(-13.37),
        nrmse_train_mean: error(if kind == "ibm" { 1e-14 } else { 0.02 }, wobble),
        nrmse_train_sd: error(0.2, wobble),
        nrmse_validation_mean: error(0.06, wobble),
        nrmse_validation_sd: error(0.5, wobble),
        status: if lone { "failed" } else { "ok" }.into(),
        reason: lone.then(|| "one repetition has no variance to learn from".into()),
    }
}

fn target(
    measured: &str,
    &(kpi, experiment, unit, mean, sd, fitted): &(&str, &str, &str, f64, f64, bool),
) -> TargetRow {
    TargetRow {
        measured: measured.into(),
        experiment: experiment.into(),
        kpi: kpi.into(),
        n: 50,
        mean,
        mean_lower: mean - 0.284 * sd,
        mean_upper: mean + 0.284 * sd,
        sd,
        sd_lower: 0.835 * sd,
        sd_upper: 1.246 * sd,
        lilliefors_p: (measured == "demo").then_some(0.412),
        unit: unit.into(),
        fitted,
    }
}

fn method(report: &mut Report, measured: &str, kind: &str, approach: &str, n: u32, wobble: &mut Wobble) {
    let keys = || (measured.to_string(), kind.to_string(), approach.to_string());
    let (m, k, a) = keys();
    report.calibrations.push(CalibrationRow {
        measured: m,
        kind: k,
        approach: a,
        n,
        objective: Some(0.0123 * (2.0 + wobble.next())),
        starts: 100,
        starts_at_optimum: Some(37),
        flat_directions: Some(if kind == "sk" { "" } else { "rolling_friction" }.into()),
        status: "ok".into(),
        reason: None,
    });
    for (parameter, unit, value, low, high) in PARAMETERS {
        let (m, k, a) = keys();
        let half = 0.08 * (high - low) * f64::from(4 - n);
        let value = (value + 0.5 * half * wobble.next()).min(high);
        let posterior = kind == "sk";
        report.optima.push(OptimumRow {
            measured: m,
            kind: k,
            approach: a,
            n,
            parameter: parameter.into(),
            value,
            lower: posterior.then_some((value - half).max(low)),
            upper: posterior.then_some((value + half).min(high)),
            unit: unit.into(),
            at_bound: kind == "ibm" && n == 3 && parameter == "particle_density",
        });
    }
    for (kpi, _, unit, mean, sd, fitted) in OBSERVABLES {
        let simulated = mean * (1.0 + 0.04 * wobble.next());
        let predicted = simulated * (1.0 + 0.02 * wobble.next());
        if fitted {
            let (m, k, a) = keys();
            let (measured, kind, approach, kpi, unit) = (m, k, a, kpi.to_string(), unit.to_string());
            let epistemic_sd = (kind == "sk").then_some(0.2 * sd);
            report.predictions.push(PredictionRow {
                measured,
                kind,
                approach,
                n,
                kpi,
                mean: predicted,
                sd: Some(sd),
                epistemic_sd,
                unit,
            });
            report.verification.push(verification(
                keys(),
                n,
                (&report.predictions[report.predictions.len() - 1], simulated, mean, sd),
            ));
        } else {
            report.validation.push(validation(keys(), n, kpi, unit, simulated, mean, sd));
        }
    }
}

type Keys = (String, String, String);

fn verification(
    (measured, kind, approach): Keys,
    n: u32,
    (prediction, simulated, mean, sd): (&PredictionRow, f64, f64, f64),
) -> VerificationRow {
    let lost = kind == "rbm" && prediction.kpi == "mass_on_shelf" && n == 1;
    let some = |value: f64| (!lost).then_some(value);
    let percent = |model: f64, target: f64| (model / target - 1.0) * 100.0;
    VerificationRow {
        measured,
        kind,
        approach,
        n,
        kpi: prediction.kpi.clone(),
        count: if lost { 0 } else { n },
        mean: some(simulated),
        mean_lower: (n > 1).then_some(simulated - 2.0 * sd),
        mean_upper: (n > 1).then_some(simulated + 2.0 * sd),
        sd: (n > 1).then_some(1.1 * sd),
        predicted_mean: prediction.mean,
        predicted_sd: prediction.sd,
        target_mean: mean,
        target_sd: sd,
        prediction_error_percent: some(percent(simulated, prediction.mean)),
        target_error_percent: some(percent(simulated, mean)),
        target_error_upper_percent: some(percent(simulated + 1.1 * sd, mean + sd)),
        target_error_lower_percent: some(percent(simulated - 1.1 * sd, mean - sd)),
        unit: prediction.unit.clone(),
    }
}

fn validation(
    (measured, kind, approach): Keys,
    n: u32,
    kpi: &str,
    unit: &str,
    simulated: f64,
    mean: f64,
    sd: f64,
) -> ValidationRow {
    let lost = kind == "ibm" && approach == "mv" && n == 3;
    let some = |value: f64| (!lost).then_some(value);
    let error = (simulated / mean - 1.0) * 100.0;
    ValidationRow {
        measured,
        kind,
        approach,
        n,
        kpi: kpi.into(),
        repetitions: 5,
        count: if lost { 0 } else { 4 },
        mean: some(simulated),
        mean_lower: some(simulated - 0.05),
        mean_upper: some(simulated + 0.05),
        sd: some(1.5 * sd),
        target_mean: mean,
        target_sd: sd,
        target_n: 5,
        error_percent: some(error),
        error_lower_percent: some(error - 1.6),
        error_upper_percent: some(error + 1.6),
        reason: lost.then(|| "all five hoppers arched".into()),
        unit: unit.into(),
    }
}

fn diagnosis(report: &mut Report, wobble: &mut Wobble) {
    for measured in SETS {
        for (kpi, experiment, unit, mean, sd, _) in OBSERVABLES.into_iter().filter(|observable| observable.5) {
            report.residuals.push(residual(measured, kpi, experiment, unit, "mean", mean, 0.2 * sd, wobble));
            report.residuals.push(residual(measured, kpi, experiment, "1", "ln_sd", 0.74, 0.11, wobble));
            for source in EFFECTS.iter().map(|effect| effect.0).chain(PARAMETERS.iter().map(|parameter| parameter.0)) {
                report.signatures.push(SignatureRow {
                    measured: measured.into(),
                    source: source.into(),
                    kpi: kpi.into(),
                    statistic: "mean".into(),
                    strength: Some(0.5),
                    value: sd * wobble.next(),
                    standard_error: 0.1 * sd,
                    origin: "direct".into(),
                });
            }
        }
        for (index, (effect, unit)) in EFFECTS.into_iter().enumerate() {
            report.attribution.push(attribution(measured, effect, unit, index));
            for (other, _) in EFFECTS.into_iter().filter(|other| other.0 != effect) {
                report.confusion.push(ConfusionRow {
                    measured: measured.into(),
                    effect: effect.into(),
                    other: other.into(),
                    cosine: wobble.next(),
                    separation: 4.2,
                });
            }
        }
    }
    report.verdicts = verdicts();
    recalibration(report, wobble);
}

#[allow(clippy::too_many_arguments, reason = "a row of test data is made of its columns")]
fn residual(
    measured: &str,
    kpi: &str,
    experiment: &str,
    unit: &str,
    statistic: &str,
    value: f64,
    error: f64,
    wobble: &mut Wobble,
) -> ResidualRow {
    let z = 6.0 * wobble.next();
    ResidualRow {
        measured: measured.into(),
        experiment: experiment.into(),
        kpi: kpi.into(),
        statistic: statistic.into(),
        measured_value: value,
        model_value: value - z * error,
        residual: z * error,
        standard_error: error,
        z,
        unabsorbed_z: 0.7 * z,
        unit: unit.into(),
    }
}

fn attribution(measured: &str, effect: &str, unit: &str, index: usize) -> AttributionRow {
    let found = index == 0;
    AttributionRow {
        measured: measured.into(),
        effect: effect.into(),
        unit: unit.into(),
        strength: [0.512, 0.021, 0.07, -0.8][index],
        strength_sd: [0.061, 0.018, 0.11, 1.3][index],
        a: [16.4, 55.6, 9.1, 0.77][index],
        z: [8.39, 1.17, 0.64, -0.62][index],
        p_family: if found { 0.0002 } else { 0.431 },
        leftover: [3.1, 70.2, 72.4, 72.5][index],
        leftover_p: if found { 0.79 } else { 0.0001 },
        visibility: [0.64, 0.31, 0.12, 0.03][index],
        resolved: index != 2,
        physical: true,
        ln_odds: [31.2, -0.4, -1.1, -1.3][index],
        strength_90: [Some(0.22), Some(0.049), None, Some(4.1)][index],
        part: ["named", "rejected", "unresolved", "absorbed"][index].into(),
    }
}

fn verdicts() -> Vec<VerdictRow> {
    vec![
        VerdictRow {
            measured: "demo".into(),
            verdict: "effect".into(),
            effects: "cohesion".into(),
            sentence: "The model lacks cohesion: a Bond number of 0.51 ± 0.06 explains what is left of the residual."
                .into(),
            t0: 73.5,
            dof: 7,
            p: 0.000_001,
            direction: "mass on shelf mean +0.81, angle of repose mean +0.44".into(),
            advice: String::new(),
        },
        VerdictRow {
            measured: "paper".into(),
            verdict: "not_attributable".into(),
            effects: String::new(),
            sentence: "Not attributable at this resolution: the offset of the coarse set-up is not in the store."
                .into(),
            t0: 912.0,
            dof: 3,
            p: 0.0,
            direction: "bulk density mean -0.97".into(),
            advice: "Run paired coarse and full simulations at five points or more, or use the full study.".into(),
        },
    ]
}

fn recalibration(report: &mut Report, wobble: &mut Wobble) {
    for (name, unit, value, low, high) in PARAMETERS {
        for (model, shift) in [("before", 0.1), ("after", 0.0)] {
            report.recalibration.push(RecalibrationRow {
                measured: "demo".into(),
                model: model.into(),
                name: name.into(),
                value: value + shift * (high - low),
                standard_error: 0.03 * (high - low),
                unit: unit.into(),
                at_bound: false,
            });
        }
    }
    report.recalibration.push(RecalibrationRow {
        measured: "demo".into(),
        model: "after".into(),
        name: "cohesion".into(),
        value: 0.512,
        standard_error: 0.061,
        unit: "1".into(),
        at_bound: false,
    });
    for (kpi, experiment, unit, mean, sd, fitted) in OBSERVABLES {
        for (statistic, value) in [("mean", mean), ("sd", sd)] {
            report.before_after.push(before_after(kpi, experiment, unit, statistic, value, fitted, wobble));
        }
    }
}

fn before_after(
    kpi: &str,
    experiment: &str,
    unit: &str,
    statistic: &str,
    value: f64,
    fitted: bool,
    wobble: &mut Wobble,
) -> BeforeAfterRow {
    let (scale, half) = if statistic == "mean" { (12.0, 1.4) } else { (40.0, 35.0) };
    let (before, after) = (scale * wobble.next(), 0.15 * scale * wobble.next());
    let lost = kpi == "particle_count" && statistic == "sd";
    let some = |value: f64| (!lost).then_some(value);
    BeforeAfterRow {
        measured: "demo".into(),
        experiment: experiment.into(),
        kpi: kpi.into(),
        statistic: statistic.into(),
        fitted,
        held_out_repetitions: false,
        measured_value: value,
        before: some(value * (1.0 + before / 100.0)),
        after: some(value * (1.0 + after / 100.0)),
        before_error: some(0.01 * before * value),
        before_lower: some(0.01 * (before - half) * value),
        before_upper: some(0.01 * (before + half) * value),
        after_error: some(0.01 * after * value),
        after_lower: some(0.01 * (after - half) * value),
        after_upper: some(0.01 * (after + half) * value),
        before_error_percent: some(before),
        before_lower_percent: some(before - half),
        before_upper_percent: some(before + half),
        after_error_percent: some(after),
        after_lower_percent: some(after - half),
        after_upper_percent: some(after + half),
        unit: unit.into(),
    }
}
