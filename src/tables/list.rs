//! Every table of the lake, in the order in which the stages write them.
//!
//! Tables are tall: one row per value, with its name and unit beside it, so that any number of parameters and
//! observables fits without a change of schema. `status` is `ok` or `failed`; a failed row keeps its place and says
//! why in `reason`. A `label` names who asked for a batch of runs: `design`, a calibration such as
//! `paper/sk-mv/3`, or a purpose of the diagnosis such as `demo/before`.

use super::{Row, TableSpec};
use crate::table;

table! {
    /// Bounds of the particle density that a study leaves out, from the measured bulk density by simulation (eqs 2 and 3).
    pub struct BoundRow in "bounds" version 1 sorted by (parameter, bound) {
        /// The parameter: particle_density.
        parameter: String ["1"],
        /// `lower` or `upper`.
        bound: String ["1"],
        /// The bound that all later stages take: `unrounded` rounded outward to three significant digits.
        value: f64 ["see unit"],
        /// Measured over simulated bulk density, times the measured particle density.
        unrounded: f64 ["see unit"],
        /// Standard error of `unrounded`: both measurements and the simulations.
        standard_error: f64 ["see unit"],
        /// The other parameters in the simulations, as `name=value`.
        others: String ["1"],
        /// Mean of the simulated bulk densities.
        simulated_mean: f64 ["see unit"],
        /// Lower limit of the mean's interval.
        simulated_mean_lower: Option<f64> ["see unit"],
        /// Upper limit of the mean's interval.
        simulated_mean_upper: Option<f64> ["see unit"],
        /// Standard deviation of the simulated bulk densities.
        simulated_sd: Option<f64> ["see unit"],
        /// Simulations that gave a bulk density; all stand in `bounds_kpis`.
        count: u32 ["1"],
        /// Measured data set that the next columns are of.
        measured: String ["1"],
        /// Measured mean bulk density.
        measured_bulk_density: f64 ["see unit"],
        /// Its standard error.
        measured_bulk_density_error: f64 ["see unit"],
        /// Measured mean density of the grains, with which the simulations ran.
        measured_particle_density: f64 ["see unit"],
        /// Its standard error.
        measured_particle_density_error: f64 ["see unit"],
        /// Unit of all values.
        unit: String ["1"],
    }
}

table! {
    /// Design of experiments: one row per design point and parameter.
    pub struct SampleRow in "samples" version 1 sorted by (point, parameter) {
        /// Design point, from 1.
        point: u32 ["1"],
        /// Part of the design: boundary, interior or validation.
        set: String ["1"],
        /// Name of the parameter.
        parameter: String ["1"],
        /// Value of the parameter, in `unit`.
        value: f64 ["see unit"],
        /// Unit of `value`.
        unit: String ["1"],
        /// Value scaled to its bounds: 0 at the lower, 1 at the upper one.
        unit_value: f64 ["1"],
        /// Hash of all parameter values of this point.
        parameter_hash: String ["1"],
    }
}

table! {
    /// Runs beyond those that every design point gets, for points that are repeated more often.
    pub struct ReplicationRow in "replications" version 1 sorted by (point) {
        /// Design point.
        point: u32 ["1"],
        /// Runs beyond `study.repetitions`; they count at the largest number of repetitions only.
        extra: u32 ["1"],
    }
}

table! {
    /// How evenly each part of the design fills the unit cube.
    pub struct DesignQualityRow in "design_quality" version 1 sorted by (set) {
        /// Part of the design: boundary, interior, validation, added or chosen.
        set: String ["1"],
        /// Number of its points.
        points: u32 ["1"],
        /// Smallest distance between two of its points, in the unit cube.
        min_distance: Option<f64> ["1"],
        /// The same where one of the two may belong to an earlier part: what the hypercubes are optimised for.
        joint_min_distance: Option<f64> ["1"],
    }
}

table! {
    /// One row per simulation: where it stands in the study, how it ended and where its final state is kept.
    pub struct RunRow in "runs" version 2 partitioned by experiment sorted by (label, experiment, point, repetition) {
        /// Who asked for the run: `design`, a calibration or a purpose of the diagnosis.
        label: String ["1"],
        /// Experiment: pile, ledge, bulk_density or hopper.
        experiment: String ["1"],
        /// Point within the label, from 1.
        point: u32 ["1"],
        /// Hash of the parameter values and effect strengths.
        parameter_hash: String ["1"],
        /// Repetition, from 1.
        repetition: u32 ["1"],
        /// Seed of the random packing.
        seed: u64 ["1"],
        /// Strengths of the effects that are switched on, as `name=value`, empty when none.
        effects: String ["1"],
        /// Content key of the run: physics version, resolved settings and seed.
        run_key: String ["1"],
        /// `ok` or `failed`.
        status: String ["1"],
        /// Why the run failed.
        reason: Option<String> ["1"],
        /// Which criterion ended the run.
        stop: Option<String> ["1"],
        /// Simulated time at the end.
        time_s: Option<f64> ["s"],
        /// Number of time steps.
        steps: Option<u64> ["1"],
        /// Grains inserted.
        inserted: Option<u32> ["1"],
        /// Attempts of the insertion, accepted or not.
        insertion_attempts: Option<u64> ["1"],
        /// Grains deleted because they lay above the fill height.
        deleted: Option<u32> ["1"],
        /// Grains that left the domain.
        lost: Option<u32> ["1"],
        /// Particles in the final state: inserted less deleted and lost.
        particles: Option<u32> ["1"],
        /// Translational kinetic over elastic energy at the end; null where no contact is left.
        energy_ratio: Option<f64> ["1"],
        /// Mean number of contacts per particle in the final state.
        coordination_number: Option<f64> ["1"],
        /// Largest overlap of the run over the radius of the smaller particle.
        max_overlap: Option<f64> ["1"],
        /// Digest of the final particle states, an object of the store.
        state: Option<String> ["1"],
        /// Digest of the mass trace, an object of the store.
        trace: Option<String> ["1"],
    }
}

table! {
    /// Where the runs of the diagnosis stand: one row per point and parameter, and per effect that is switched on there.
    pub struct PointRow in "diagnose_points" version 1 sorted by (label, point, name) {
        /// Who asked for the runs, as in `diagnose_runs`.
        label: String ["1"],
        /// Point within the label, from 1.
        point: u32 ["1"],
        /// Name of the parameter or effect.
        name: String ["1"],
        /// Value of the parameter or strength of the effect, in `unit`.
        value: f64 ["see unit"],
        /// Unit of `value`.
        unit: String ["1"],
        /// Hash of the parameter values and effect strengths, as in `diagnose_runs`.
        parameter_hash: String ["1"],
    }
}

table! {
    /// One row per simulation and observable.
    pub struct KpiRow in "kpis" version 1 partitioned by experiment sorted by (label, experiment, point, repetition, kpi) {
        /// Who asked for the run, as in `runs`.
        label: String ["1"],
        /// Experiment.
        experiment: String ["1"],
        /// Point within the label, from 1.
        point: u32 ["1"],
        /// Hash of the parameter values and effect strengths.
        parameter_hash: String ["1"],
        /// Seed of the random packing.
        seed: u64 ["1"],
        /// Repetition, from 1.
        repetition: u32 ["1"],
        /// Content key of the run.
        run_key: String ["1"],
        /// Name of the observable; the first one of each experiment is its KPI.
        kpi: String ["1"],
        /// Value of the observable, in `unit`; null when it could not be measured.
        value: Option<f64> ["see unit"],
        /// Unit of `value`.
        unit: String ["1"],
        /// `ok` or `failed`.
        status: String ["1"],
        /// Why there is no value.
        reason: Option<String> ["1"],
    }
}

table! {
    /// Mean and standard deviation of every observable over the first n repetitions of a design point.
    pub struct AggregateRow in "aggregates" version 1 partitioned by experiment sorted by (experiment, kpi, point, n) {
        /// Experiment.
        experiment: String ["1"],
        /// Observable.
        kpi: String ["1"],
        /// Design point.
        point: u32 ["1"],
        /// Hash of the parameter values.
        parameter_hash: String ["1"],
        /// Number of repetitions asked for.
        n: u32 ["1"],
        /// Number of repetitions among them that gave a value.
        count: u32 ["1"],
        /// Mean.
        mean: Option<f64> ["see unit"],
        /// Lower limit of the mean's confidence interval.
        mean_lower: Option<f64> ["see unit"],
        /// Upper limit of the mean's confidence interval.
        mean_upper: Option<f64> ["see unit"],
        /// Standard deviation (n - 1).
        sd: Option<f64> ["see unit"],
        /// Lower limit of the standard deviation's confidence interval.
        sd_lower: Option<f64> ["see unit"],
        /// Upper limit of the standard deviation's confidence interval.
        sd_upper: Option<f64> ["see unit"],
        /// Unit of the values.
        unit: String ["1"],
    }
}

table! {
    /// One row per trained metamodel: kind, number of repetitions, likelihood and errors.
    pub struct MetamodelRow in "metamodels" version 1 sorted by (kpi, kind, n) {
        /// Observable that the metamodel predicts.
        kpi: String ["1"],
        /// ibm, rbm or sk.
        kind: String ["1"],
        /// Repetitions it was trained on.
        n: u32 ["1"],
        /// Design points it was trained on.
        points: u32 ["1"],
        /// Log marginal likelihood of the mean's Gaussian process.
        lml: Option<f64> ["1"],
        /// NRMSE of the mean in the training points (eq. 15).
        nrmse_train_mean: Option<f64> ["1"],
        /// NRMSE of the standard deviation in the training points.
        nrmse_train_sd: Option<f64> ["1"],
        /// NRMSE of the mean in the validation points.
        nrmse_validation_mean: Option<f64> ["1"],
        /// NRMSE of the standard deviation in the validation points.
        nrmse_validation_sd: Option<f64> ["1"],
        /// `ok` or `failed`.
        status: String ["1"],
        /// Why there is no metamodel.
        reason: Option<String> ["1"],
    }
}

table! {
    /// Numbers that rebuild every metamodel from `samples` and `aggregates` without a search.
    pub struct HyperparameterRow in "hyperparameters" version 1 sorted by (kpi, kind, n, response, name) {
        /// Observable.
        kpi: String ["1"],
        /// ibm, rbm or sk.
        kind: String ["1"],
        /// Repetitions.
        n: u32 ["1"],
        /// Which of the metamodel's processes: mean, cv or log_variance.
        response: String ["1"],
        /// Name of the number: log10_a of a parameter, scale, jitter and so on.
        name: String ["1"],
        /// Its value.
        value: f64 ["1"],
    }
}

table! {
    /// Sobol indices: the share of the variance of a KPI's mean or sd over the parameter space that a parameter explains.
    pub struct SensitivityRow in "sensitivity" version 1 sorted by (kpi, kind, statistic, parameter) {
        /// Observable.
        kpi: String ["1"],
        /// Metamodel: ibm, rbm or sk.
        kind: String ["1"],
        /// Repetitions behind the metamodel.
        n: u32 ["1"],
        /// mean or sd.
        statistic: String ["1"],
        /// Parameter.
        parameter: String ["1"],
        /// Share that the parameter explains alone; slightly negative values are sampling error.
        first: f64 ["1"],
        /// Share that involves the parameter at all.
        total: f64 ["1"],
        /// Mean of the statistic over the parameter space.
        mean: f64 ["see unit"],
        /// Standard deviation of the statistic over the parameter space.
        spread: f64 ["see unit"],
        /// Unit of `mean` and `spread`.
        unit: String ["1"],
    }
}

table! {
    /// Measured statistics of every data set: what the calibration aims at and what is held out.
    pub struct TargetRow in "targets" version 1 sorted by (measured, experiment, kpi) {
        /// Name of the measured data set.
        measured: String ["1"],
        /// Experiment.
        experiment: String ["1"],
        /// Observable.
        kpi: String ["1"],
        /// Number of measured repetitions.
        n: u32 ["1"],
        /// Mean.
        mean: f64 ["see unit"],
        /// Lower limit of the mean's confidence interval.
        mean_lower: f64 ["see unit"],
        /// Upper limit of the mean's confidence interval.
        mean_upper: f64 ["see unit"],
        /// Standard deviation.
        sd: f64 ["see unit"],
        /// Lower limit of the standard deviation's confidence interval.
        sd_lower: f64 ["see unit"],
        /// Upper limit of the standard deviation's confidence interval.
        sd_upper: f64 ["see unit"],
        /// p-value of the Lilliefors test of normality, where single values are given.
        lilliefors_p: Option<f64> ["1"],
        /// Unit of the values.
        unit: String ["1"],
        /// Used by the calibration (true) or held out (false).
        fitted: bool ["1"],
    }
}

table! {
    /// Mean and standard deviation of a measured observable over its first n repetitions (Fig. 6).
    pub struct MeasuredStatisticRow in "measured_statistics" version 1 sorted by (measured, experiment, kpi, n) {
        /// Name of the measured data set.
        measured: String ["1"],
        /// Experiment.
        experiment: String ["1"],
        /// Observable.
        kpi: String ["1"],
        /// Number of repetitions; of a published summary only the published one.
        n: u32 ["1"],
        /// Mean.
        mean: f64 ["see unit"],
        /// Lower limit of the mean's confidence interval.
        mean_lower: Option<f64> ["see unit"],
        /// Upper limit of the mean's confidence interval.
        mean_upper: Option<f64> ["see unit"],
        /// Standard deviation (n - 1).
        sd: Option<f64> ["see unit"],
        /// Lower limit of the standard deviation's confidence interval.
        sd_lower: Option<f64> ["see unit"],
        /// Upper limit of the standard deviation's confidence interval.
        sd_upper: Option<f64> ["see unit"],
        /// Unit of the values.
        unit: String ["1"],
    }
}

table! {
    /// Whether a measured observable has settled, whether it is normal, and how many repetitions a precision takes.
    pub struct MeasuredAnalysisRow in "measured_analysis" version 1 sorted by (measured, experiment, kpi) {
        /// Name of the measured data set.
        measured: String ["1"],
        /// Experiment.
        experiment: String ["1"],
        /// Observable.
        kpi: String ["1"],
        /// Number of measured repetitions.
        n: u32 ["1"],
        /// Smallest n from which on the running mean stays within the band of `analysis.stability` around the last mean;
        /// null without single values.
        stable_from: Option<u32> ["1"],
        /// Half width of the mean's confidence interval over the mean, as reached.
        precision: Option<f64> ["1"],
        /// Half width wished for, over the mean.
        precision_wished: f64 ["1"],
        /// Repetitions that the wished half width takes, at the standard deviation as measured.
        needed: Option<u32> ["1"],
        /// The same at the lower limit of the standard deviation's confidence interval.
        needed_lower: Option<u32> ["1"],
        /// The same at its upper limit.
        needed_upper: Option<u32> ["1"],
        /// Lilliefors' distance from the normal distribution; null below four single values.
        lilliefors_d: Option<f64> ["1"],
        /// Its p-value from published fits.
        lilliefors_p: Option<f64> ["1"],
        /// Its p-value by simulation.
        lilliefors_p_simulated: Option<f64> ["1"],
    }
}

table! {
    /// Whether the simulations of the design bracket a measured mean: without, no calibration can reach it.
    pub struct FeasibilityRow in "feasibility" version 1 sorted by (measured, experiment, kpi, set) {
        /// Name of the measured data set.
        measured: String ["1"],
        /// Experiment.
        experiment: String ["1"],
        /// Observable.
        kpi: String ["1"],
        /// Points looked at: `corner` (every parameter on a bound), `boundary` or `design` (all trained on).
        set: String ["1"],
        /// Number of these points with a mean.
        points: u32 ["1"],
        /// Lowest mean among them.
        lowest: Option<f64> ["see unit"],
        /// Design point with the lowest mean.
        lowest_point: Option<u32> ["1"],
        /// Highest mean among them.
        highest: Option<f64> ["see unit"],
        /// Design point with the highest mean.
        highest_point: Option<u32> ["1"],
        /// Measured mean.
        target: f64 ["see unit"],
        /// Whether lowest <= target <= highest.
        bracketed: bool ["1"],
        /// How far the target lies outside, over the larger of measured and simulated standard deviation; 0 inside.
        outside_sd: Option<f64> ["1"],
        /// Unit of the values.
        unit: String ["1"],
    }
}

table! {
    /// One row per calibration: data set, kind of metamodel, approach and number of repetitions.
    pub struct CalibrationRow in "calibrations" version 1 sorted by (measured, kind, approach, n) {
        /// Measured data set.
        measured: String ["1"],
        /// ibm, rbm or sk.
        kind: String ["1"],
        /// m (mean) or mv (mean and variance).
        approach: String ["1"],
        /// Repetitions behind the metamodel.
        n: u32 ["1"],
        /// Objective at the optimum (eqs 10-13).
        objective: Option<f64> ["1"],
        /// Number of starts.
        starts: u32 ["1"],
        /// Number of starts that ended within 1 % of the best objective.
        starts_at_optimum: Option<u32> ["1"],
        /// Directions that the data do not fix, in words; empty when none.
        flat_directions: Option<String> ["1"],
        /// `ok` or `failed`.
        status: String ["1"],
        /// Why there is no optimum.
        reason: Option<String> ["1"],
    }
}

table! {
    /// Calibrated parameters with their uncertainty.
    pub struct OptimumRow in "optima" version 1 sorted by (measured, kind, approach, n, parameter) {
        /// Measured data set.
        measured: String ["1"],
        /// ibm, rbm or sk.
        kind: String ["1"],
        /// m or mv.
        approach: String ["1"],
        /// Repetitions behind the metamodel.
        n: u32 ["1"],
        /// Parameter.
        parameter: String ["1"],
        /// Calibrated value.
        value: f64 ["see unit"],
        /// Lower limit of the 95 % credible interval (posterior over the metamodel).
        lower: Option<f64> ["see unit"],
        /// Upper limit of the 95 % credible interval.
        upper: Option<f64> ["see unit"],
        /// Unit of the values.
        unit: String ["1"],
        /// The optimum lies on a bound of this parameter.
        at_bound: bool ["1"],
    }
}

table! {
    /// Draws of the parameters from their distribution given the measurements, for the largest number of repetitions.
    pub struct PosteriorRow in "posterior" version 1 sorted by (measured, kind, approach, draw, parameter) {
        /// Measured data set.
        measured: String ["1"],
        /// ibm, rbm or sk.
        kind: String ["1"],
        /// m or mv.
        approach: String ["1"],
        /// Repetitions behind the metamodel.
        n: u32 ["1"],
        /// Draw, from 1.
        draw: u32 ["1"],
        /// Parameter.
        parameter: String ["1"],
        /// Value.
        value: f64 ["see unit"],
        /// Unit of `value`.
        unit: String ["1"],
    }
}

table! {
    /// Distribution of every parameter given the measurements, and how well the walk behind it has mixed.
    pub struct PosteriorSummaryRow in "posterior_summary" version 1 sorted by (measured, kind, approach, parameter) {
        /// Measured data set.
        measured: String ["1"],
        /// ibm, rbm or sk.
        kind: String ["1"],
        /// m or mv.
        approach: String ["1"],
        /// Repetitions behind the metamodel.
        n: u32 ["1"],
        /// Parameter.
        parameter: String ["1"],
        /// 2.5 % quantile.
        lower: f64 ["see unit"],
        /// Median.
        median: f64 ["see unit"],
        /// 97.5 % quantile.
        upper: f64 ["see unit"],
        /// Standard deviation over that of a uniform distribution between the bounds, both on the parameter's scale: near
        /// 1 the measurements say nothing.
        relative_sd: f64 ["1"],
        /// Parameter it is most strongly correlated with; null where there is only one.
        partner: Option<String> ["1"],
        /// That correlation.
        correlation: Option<f64> ["1"],
        /// Share of proposals that the walk accepted; 0.2 to 0.7 is usual.
        acceptance: f64 ["1"],
        /// Independent draws that the walk is worth.
        independent_draws: f64 ["1"],
        /// Unit of the quantiles.
        unit: String ["1"],
    }
}

table! {
    /// What the metamodels predict at the optima.
    pub struct PredictionRow in "predictions" version 1 sorted by (measured, kind, approach, n, kpi) {
        /// Measured data set.
        measured: String ["1"],
        /// ibm, rbm or sk.
        kind: String ["1"],
        /// m or mv.
        approach: String ["1"],
        /// Repetitions behind the metamodel.
        n: u32 ["1"],
        /// Observable.
        kpi: String ["1"],
        /// Predicted mean.
        mean: f64 ["see unit"],
        /// Predicted standard deviation between repetitions, as the kind of metamodel defines it.
        sd: Option<f64> ["see unit"],
        /// Standard deviation of the predicted mean itself.
        epistemic_sd: Option<f64> ["see unit"],
        /// Unit of the values.
        unit: String ["1"],
    }
}

table! {
    /// DEM runs at the optima against the metamodel's prediction and the measured target (Tables 8, Figs 15 and 16).
    pub struct VerificationRow in "verification" version 1 sorted by (measured, kind, approach, n, kpi) {
        /// Measured data set.
        measured: String ["1"],
        /// ibm, rbm or sk.
        kind: String ["1"],
        /// m or mv.
        approach: String ["1"],
        /// Repetitions behind the metamodel and of these runs.
        n: u32 ["1"],
        /// Observable.
        kpi: String ["1"],
        /// Runs that gave a value.
        count: u32 ["1"],
        /// Simulated mean.
        mean: Option<f64> ["see unit"],
        /// Lower limit of its confidence interval.
        mean_lower: Option<f64> ["see unit"],
        /// Upper limit of its confidence interval.
        mean_upper: Option<f64> ["see unit"],
        /// Simulated standard deviation.
        sd: Option<f64> ["see unit"],
        /// Predicted mean.
        predicted_mean: f64 ["see unit"],
        /// Predicted standard deviation.
        predicted_sd: Option<f64> ["see unit"],
        /// Measured mean.
        target_mean: f64 ["see unit"],
        /// Measured standard deviation.
        target_sd: f64 ["see unit"],
        /// Simulated over predicted mean, minus one.
        prediction_error_percent: Option<f64> ["%"],
        /// Simulated over measured mean, minus one.
        target_error_percent: Option<f64> ["%"],
        /// The same for mean + standard deviation.
        target_error_upper_percent: Option<f64> ["%"],
        /// The same for mean - standard deviation.
        target_error_lower_percent: Option<f64> ["%"],
        /// Unit of the values.
        unit: String ["1"],
    }
}

table! {
    /// Held-out equipment runs at the optima against the measurement (eq. 14, Table 9).
    pub struct ValidationRow in "validation" version 1 sorted by (measured, kind, approach, n, kpi) {
        /// Measured data set.
        measured: String ["1"],
        /// ibm, rbm or sk.
        kind: String ["1"],
        /// m or mv.
        approach: String ["1"],
        /// Repetitions behind the metamodel.
        n: u32 ["1"],
        /// Held-out observable.
        kpi: String ["1"],
        /// Runs asked for.
        repetitions: u32 ["1"],
        /// Runs that gave a value.
        count: u32 ["1"],
        /// Simulated mean.
        mean: Option<f64> ["see unit"],
        /// Lower limit of its confidence interval.
        mean_lower: Option<f64> ["see unit"],
        /// Upper limit of its confidence interval.
        mean_upper: Option<f64> ["see unit"],
        /// Simulated standard deviation.
        sd: Option<f64> ["see unit"],
        /// Measured mean.
        target_mean: f64 ["see unit"],
        /// Measured standard deviation.
        target_sd: f64 ["see unit"],
        /// Number of measured repetitions.
        target_n: u32 ["1"],
        /// Error of the simulated mean (eq. 14).
        error_percent: Option<f64> ["%"],
        /// Lower limit of the error's confidence interval (both means uncertain, Welch).
        error_lower_percent: Option<f64> ["%"],
        /// Upper limit of the error's confidence interval.
        error_upper_percent: Option<f64> ["%"],
        /// Why there is no value.
        reason: Option<String> ["1"],
        /// Unit of the values.
        unit: String ["1"],
    }
}

table! {
    /// Signatures: change of every statistic per unit of an effect's strength, and of every parameter.
    pub struct SignatureRow in "signatures" version 2 sorted by (measured, source, kpi, statistic) {
        /// Measured data set at whose optimum the signature holds.
        measured: String ["1"],
        /// Effect, or parameter (per unit of its scaled range).
        source: String ["1"],
        /// Observable.
        kpi: String ["1"],
        /// mean or ln_sd.
        statistic: String ["1"],
        /// Strength at which it was taken; none for a parameter, whose signature is a slope.
        strength: Option<f64> ["see unit"],
        /// Change of the statistic per unit of strength, parameters held.
        value: f64 ["see unit"],
        /// Standard error of `value`.
        standard_error: f64 ["see unit"],
        /// How it was found: `metamodel` (over parameters and strength) or `direct` (tied to runs at the optimum).
        origin: String ["1"],
    }
}

table! {
    /// What is left between the calibrated model and every measured statistic.
    pub struct ResidualRow in "residuals" version 1 sorted by (measured, kpi, statistic) {
        /// Measured data set.
        measured: String ["1"],
        /// Experiment.
        experiment: String ["1"],
        /// Observable.
        kpi: String ["1"],
        /// mean or ln_sd.
        statistic: String ["1"],
        /// Measured value of the statistic, less the model's own offset where the data have controls.
        measured_value: f64 ["see unit"],
        /// Value of the calibrated model.
        model_value: f64 ["see unit"],
        /// Measured minus model.
        residual: f64 ["see unit"],
        /// Standard error of the residual: measurement, simulation and metamodel together.
        standard_error: f64 ["see unit"],
        /// Residual over its standard error.
        z: f64 ["1"],
        /// The same for the part of the residual that no parameter can absorb.
        unabsorbed_z: f64 ["1"],
        /// Unit of the values.
        unit: String ["1"],
    }
}

table! {
    /// One row per candidate effect: how well it explains the residual and how small a strength would be seen.
    pub struct AttributionRow in "attribution" version 1 sorted by (measured, effect) {
        /// Measured data set.
        measured: String ["1"],
        /// Candidate effect.
        effect: String ["1"],
        /// Unit of its strength.
        unit: String ["1"],
        /// Estimated strength.
        strength: f64 ["see unit"],
        /// Standard error of the strength.
        strength_sd: f64 ["see unit"],
        /// Length of the whitened signature that calibration cannot absorb, per unit of strength.
        a: f64 ["1"],
        /// Score of the residual along the signature.
        z: f64 ["1"],
        /// Family-wise p-value of the score.
        p_family: f64 ["1"],
        /// Misfit left once the effect is in the model.
        leftover: f64 ["1"],
        /// p-value of the leftover.
        leftover_p: f64 ["1"],
        /// Share of the signature that calibration cannot absorb.
        visibility: f64 ["1"],
        /// The signature differs from zero beyond its own error.
        resolved: bool ["1"],
        /// The strength lies in the effect's physical range.
        physical: bool ["1"],
        /// Natural logarithm of the odds against no effect.
        ln_odds: f64 ["1"],
        /// Strength at which the procedure names the effect (alone or in a class of at most three) in 90 % of cases;
        /// null where no strength of the physical range does.
        strength_90: Option<f64> ["see unit"],
        /// Part the effect plays in the verdict: named, class, pair, rejected, absorbed, unresolved, not_testable or left_out.
        part: String ["1"],
    }
}

table! {
    /// How alike the visible parts of two signatures are.
    pub struct ConfusionRow in "confusion" version 1 sorted by (measured, effect, other) {
        /// Measured data set.
        measured: String ["1"],
        /// Effect.
        effect: String ["1"],
        /// Another effect.
        other: String ["1"],
        /// Cosine of the angle between their projected signatures.
        cosine: f64 ["1"],
        /// Expected separation at the estimated strength, in units of ln odds: half of what the other effect leaves over of it.
        separation: f64 ["1"],
    }
}

table! {
    /// The verdict on every measured data set.
    pub struct VerdictRow in "verdicts" version 1 sorted by (measured) {
        /// Measured data set.
        measured: String ["1"],
        /// Verdict code: no_detectable_discrepancy, effect, class, pair, none_of_the_candidates or not_attributable.
        verdict: String ["1"],
        /// Effects the verdict names, separated by commas.
        effects: String ["1"],
        /// The verdict as a sentence; beside an effect that was added also how many fitted means agree with it in the model.
        sentence: String ["1"],
        /// Misfit of the calibrated model without any effect.
        t0: f64 ["1"],
        /// Degrees of freedom of the misfit.
        dof: u32 ["1"],
        /// p-value of the misfit.
        p: f64 ["1"],
        /// Observables that carry what is left, with their standardised share.
        direction: String ["1"],
        /// The measurement that would tell a class apart, or what else to do; empty when none is needed.
        advice: String ["1"],
    }
}

table! {
    /// The verdict with other widths of the priors of the strengths and of "something else" than those of the study.
    pub struct PriorWidthRow in "prior_widths" version 1 sorted by (measured, strength_factor, other_factor) {
        /// Measured data set.
        measured: String ["1"],
        /// Factor on the width of the prior of every strength.
        strength_factor: f64 ["1"],
        /// Factor on the width of the prior of "something else".
        other_factor: f64 ["1"],
        /// Verdict code there, as in `verdicts`.
        verdict: String ["1"],
        /// Effects it names, separated by commas.
        effects: String ["1"],
    }
}

table! {
    /// Parameters and strengths before and after the effect was added.
    pub struct RecalibrationRow in "recalibration" version 1 sorted by (measured, model, name) {
        /// Measured data set.
        measured: String ["1"],
        /// before or after.
        model: String ["1"],
        /// Parameter or effect.
        name: String ["1"],
        /// Value: without the effect the optimum, with it the mean over all that the data leave open.
        value: f64 ["see unit"],
        /// Standard error: with the effect the standard deviation over all that the data leave open.
        standard_error: f64 ["see unit"],
        /// Unit.
        unit: String ["1"],
        /// The optimum lies on a bound.
        at_bound: bool ["1"],
    }
}

table! {
    /// Error of every statistic before and after the effect was added, from DEM runs with packings that no fit saw. The intervals
    /// of held-out means hold what the data leave open in the parameters, those of standard deviations the tails of the fitted
    /// observables.
    pub struct BeforeAfterRow in "before_after" version 3 sorted by (measured, kpi, statistic, held_out_repetitions) {
        /// Measured data set.
        measured: String ["1"],
        /// Experiment.
        experiment: String ["1"],
        /// Observable.
        kpi: String ["1"],
        /// mean or sd.
        statistic: String ["1"],
        /// The fit used this statistic (true) or never saw it (false).
        fitted: bool ["1"],
        /// Measured in repetitions of a fitted experiment that were kept from the fit, `[diagnose] held_out_share`.
        held_out_repetitions: bool ["1"],
        /// Measured value, less the model's own offset where the data have controls.
        measured_value: f64 ["see unit"],
        /// Simulated value before.
        before: Option<f64> ["see unit"],
        /// Simulated value after.
        after: Option<f64> ["see unit"],
        /// Error before.
        before_error: Option<f64> ["see unit"],
        /// Lower limit of its confidence interval.
        before_lower: Option<f64> ["see unit"],
        /// Upper limit of its confidence interval.
        before_upper: Option<f64> ["see unit"],
        /// Error after.
        after_error: Option<f64> ["see unit"],
        /// Lower limit of its confidence interval.
        after_lower: Option<f64> ["see unit"],
        /// Upper limit of its confidence interval.
        after_upper: Option<f64> ["see unit"],
        /// Error before over the measured value; none where a measured mean is smaller than the scatter about it.
        before_error_percent: Option<f64> ["%"],
        /// Lower limit of its confidence interval.
        before_lower_percent: Option<f64> ["%"],
        /// Upper limit of its confidence interval.
        before_upper_percent: Option<f64> ["%"],
        /// Error after over the measured value; none where a measured mean is smaller than the scatter about it.
        after_error_percent: Option<f64> ["%"],
        /// Lower limit of its confidence interval.
        after_lower_percent: Option<f64> ["%"],
        /// Upper limit of its confidence interval.
        after_upper_percent: Option<f64> ["%"],
        /// Unit of the values.
        unit: String ["1"],
    }
}

table! {
    /// What the held-out experiment says of an effect that was added: one row per mean that was measured. The level of the
    /// intervals is shared out among the means of a data set.
    pub struct HeldOutRow in "held_out" version 1 sorted by (measured, kpi) {
        /// Measured data set.
        measured: String ["1"],
        /// The effect.
        effect: String ["1"],
        /// Experiment.
        experiment: String ["1"],
        /// Observable.
        kpi: String ["1"],
        /// Simulated less measured mean without the effect; null where no run has a value, see `diagnose_kpis`.
        before_error: Option<f64> ["see unit"],
        /// Simulated less measured mean with it.
        after_error: Option<f64> ["see unit"],
        /// Half width of the interval of the error with it, what the data leave open in the parameters included; null where
        /// that is not known.
        after_half_width: Option<f64> ["see unit"],
        /// What the effect changes, parameters fitted again.
        change: Option<f64> ["see unit"],
        /// Change that runs and measurements would hide; null where that is not known.
        noise: Option<f64> ["see unit"],
        /// better, within (the error grew, and its interval holds zero), worse (it does not: the model without the effect is
        /// kept) or cannot_judge (the change is hidden, or a mean or its interval is not known).
        judgement: String ["1"],
        /// Unit of the values.
        unit: String ["1"],
    }
}

table! {
    /// By what, on what and at what cost a run or the outputs of a stage were made; the latest time counts.
    pub struct ProvenanceRow in "provenance" version 1 keyed by key sorted by (key) {
        /// Content key of the run, or key of the stage in pipeline.lock.
        key: String [""],
        /// `run` or `stage`.
        subject: String [""],
        /// Experiment of the run, or the stage.
        name: String [""],
        /// Duration. Of a stage, the simulations it asked for included.
        wall_s: f64 ["s"],
        /// Processor time of the thread that made the run, or of all threads during the stage; none where the system
        /// keeps no account of it.
        cpu_s: Option<f64> ["s"],
        /// Version of granulake.
        version: String [""],
        /// Commit it was built from, with `+` where the sources differed from it; `unknown` outside a repository.
        commit: String [""],
        /// Compiler it was built with.
        compiler: String [""],
        /// Target it was built for.
        target: String [""],
        /// Processor it ran on.
        processor: String [""],
    }
}

/// Runs behind bounds of the particle density, with the columns of `runs`.
pub static BOUNDS_RUNS: TableSpec = TableSpec { name: "bounds_runs", ..*RunRow::SPEC };
/// Observables of the runs behind bounds of the particle density, with the columns of `kpis`.
pub static BOUNDS_KPIS: TableSpec = TableSpec { name: "bounds_kpis", ..*KpiRow::SPEC };
/// Runs at the optima, with the columns of `runs`.
pub static VERIFY_RUNS: TableSpec = TableSpec { name: "verify_runs", ..*RunRow::SPEC };
/// Observables of the runs at the optima, with the columns of `kpis`.
pub static VERIFY_KPIS: TableSpec = TableSpec { name: "verify_kpis", ..*KpiRow::SPEC };
/// Runs of the held-out equipment, with the columns of `runs`.
pub static VALIDATE_RUNS: TableSpec = TableSpec { name: "validate_runs", ..*RunRow::SPEC };
/// Observables of the held-out equipment, with the columns of `kpis`.
pub static VALIDATE_KPIS: TableSpec = TableSpec { name: "validate_kpis", ..*KpiRow::SPEC };
/// Runs of the diagnosis, with the columns of `runs`.
pub static DIAGNOSE_RUNS: TableSpec = TableSpec { name: "diagnose_runs", ..*RunRow::SPEC };
/// Observables of the diagnosis, with the columns of `kpis`.
pub static DIAGNOSE_KPIS: TableSpec = TableSpec { name: "diagnose_kpis", ..*KpiRow::SPEC };

/// Every table of the lake, in the order in which the stages write them.
pub const TABLES: &[&TableSpec] = &[
    &BOUNDS_RUNS,
    &BOUNDS_KPIS,
    BoundRow::SPEC,
    SampleRow::SPEC,
    ReplicationRow::SPEC,
    DesignQualityRow::SPEC,
    RunRow::SPEC,
    KpiRow::SPEC,
    AggregateRow::SPEC,
    MeasuredStatisticRow::SPEC,
    MeasuredAnalysisRow::SPEC,
    FeasibilityRow::SPEC,
    MetamodelRow::SPEC,
    HyperparameterRow::SPEC,
    SensitivityRow::SPEC,
    TargetRow::SPEC,
    CalibrationRow::SPEC,
    OptimumRow::SPEC,
    PosteriorRow::SPEC,
    PosteriorSummaryRow::SPEC,
    PredictionRow::SPEC,
    &VERIFY_RUNS,
    &VERIFY_KPIS,
    VerificationRow::SPEC,
    &VALIDATE_RUNS,
    &VALIDATE_KPIS,
    ValidationRow::SPEC,
    PointRow::SPEC,
    &DIAGNOSE_RUNS,
    &DIAGNOSE_KPIS,
    SignatureRow::SPEC,
    ResidualRow::SPEC,
    AttributionRow::SPEC,
    ConfusionRow::SPEC,
    VerdictRow::SPEC,
    PriorWidthRow::SPEC,
    RecalibrationRow::SPEC,
    BeforeAfterRow::SPEC,
    HeldOutRow::SPEC,
];

/// Tables that the lake keeps of itself, in `ledger/`: what they hold depends on time and machine.
pub const BESIDE: &[&TableSpec] = &[ProvenanceRow::SPEC];
