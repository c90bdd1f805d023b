//! Fits of all statistics at once, weighed by what is known of them.
//!
//! A [`Surface`] predicts every statistic of the evidence from metamodels, over the parameters alone or over the
//! parameters and the strength of one effect; direct DEM runs near an optimum join what it predicts from. Coordinates
//! are those of the unit cube: parameters between their bounds, a strength in its physical range.

use super::anchors::{Anchors, place_of, strength_at};
use super::closer::Run;
use super::evidence::Evidence;
use super::moments::{Batch, Moment, Statistic};
use crate::config::{Config, Measured};
use crate::stages::models::{self, Models, kind};
use crate::stages::{Context, StageError};
use crate::stats::attribution::{GlsFit, GlsOptions, Parameter, Prior, gls_fit};
use crate::stats::metamodel::{Metamodel, Observations, Prediction, Response};
use crate::stats::points::Points;
use crate::stats::special::{normal_quantile, student_t_quantile, trigamma};
use crate::stats::summary::{ln_sd, mean, sd};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

/// Metamodels of every statistic of the evidence.
#[derive(Clone)]
pub struct Surface {
    models: Vec<Metamodel>,
    /// A statistic of every observable, in the order of the metamodels, and what the metamodels predict from.
    observables: Vec<(Statistic, Observations)>,
    /// Lack of fit of ln s of every metamodel.
    lack: Vec<f64>,
    /// Index of the metamodel of every statistic, and its moment.
    rows: Vec<(usize, Moment)>,
    /// Trend of every statistic per unit of strength, zero where nothing drifts.
    trends: Vec<Trend>,
    /// Range of the strength, the last coordinate, where there is one.
    range: Option<(f64, f64)>,
}

/// A trend that is proportional to the strength of an effect.
#[derive(Debug, Clone, Copy, Default)]
struct Trend {
    per_strength: f64,
    /// 1/variance of `per_strength`; zero where nothing is known, or nothing drifts.
    information: f64,
}

impl Trend {
    /// The same with one more trend, known to a variance, at a strength.
    fn with(self, strength: f64, trend: f64, variance: f64) -> Self {
        let more = strength * strength / variance;
        if more.is_nan() || more <= 0.0 {
            return self;
        }
        let information = self.information + more;
        let per_strength = (self.information * self.per_strength + more * trend / strength) / information;
        Self { per_strength, information }
    }

    fn sd(self) -> f64 {
        if self.information > 0.0 { 1.0 / self.information.sqrt() } else { 0.0 }
    }
}

/// Slopes of the statistics with respect to the parameters in the unit cube.
pub struct Slopes {
    /// Slopes (m × p).
    pub jacobian: DMatrix<f64>,
    /// Covariance of the error of every column (p matrices m × m).
    pub covariance: Vec<DMatrix<f64>>,
}

impl Surface {
    /// The trained metamodels over the parameters, which predict from the design and from the runs at its `centre`;
    /// `None` where one was not trained.
    pub fn plain(context: &Context, models: &Models, centre: &Batch, statistics: &[Statistic]) -> Option<Self> {
        let (kind, n) = (kind(context.config.diagnose.kind), context.config.study.repetitions);
        let p = context.config.parameters.len();
        Self::of(statistics, |statistic| {
            let observations = models.design(&statistic.kpi, n).joined(&at(centre, statistic, &vec![0.5; p]));
            Some((Metamodel::restore(&models.records(&statistic.kpi, kind, n)?, &observations).ok()?, observations))
        })
    }

    /// Metamodels over the parameters and the strength of `effect`, trained on the design, the centre (both at strength
    /// zero) and the anchors; the inner error says which observable allows none.
    pub fn joint(
        context: &Context,
        models: &Models,
        anchors: &Anchors,
        (effect, range): (&str, (f64, f64)),
        statistics: &[Statistic],
    ) -> Result<Self, String> {
        let config = context.config;
        let (kind, n, p) = (kind(config.diagnose.kind), config.study.repetitions, config.parameters.len());
        let options = models::options(config, context.seed(&format!("joint {effect}")));
        let mut centre = vec![0.5; p];
        centre.push(place_of(range, 0.0));
        let train = |statistic: &Statistic| {
            let design = with_place(models.design(&statistic.kpi, n), place_of(range, 0.0));
            let plain = design.joined(&at(anchors.centre(), statistic, &centre));
            let observations = plain.joined(&anchors.observations(effect, statistic)?);
            Some((Metamodel::fit(kind, &observations, &options).ok()?, observations))
        };
        let surface = Self::of(statistics, train).map(|surface| Self { range: Some(range), ..surface });
        surface
            .map(|surface| surface.drifting(context, anchors, effect, statistics))
            .ok_or_else(|| format!("an observable allows no metamodel over the parameters and {effect}"))
    }

    /// One metamodel per observable, trained in parallel.
    fn of(
        statistics: &[Statistic],
        train: impl Fn(&Statistic) -> Option<(Metamodel, Observations)> + Sync,
    ) -> Option<Self> {
        let mut observables: Vec<&Statistic> = Vec::new();
        for statistic in statistics {
            if !observables.iter().any(|known| known.kpi == statistic.kpi) {
                observables.push(statistic);
            }
        }
        let place = |statistic: &Statistic| observables.iter().position(|known| known.kpi == statistic.kpi);
        let rows: Vec<_> = statistics.iter().map(|s| Some((place(s)?, s.moment))).collect::<Option<_>>()?;
        let trained: Vec<Option<(Metamodel, Observations)>> = observables.par_iter().map(|s| train(s)).collect();
        let trends = vec![Trend::default(); rows.len()];
        let mut surface =
            Self { models: Vec::new(), observables: Vec::new(), lack: Vec::new(), rows, trends, range: None };
        for (statistic, trained) in observables.into_iter().zip(trained) {
            let (model, observations) = trained?;
            surface.lack.push(lack(&model, &observations));
            surface.models.push(model);
            surface.observables.push((statistic.clone(), observations));
        }
        Some(surface)
    }

    /// The same metamodels, hyperparameters kept, which also know direct `runs`. A metamodel that cannot take them stays as
    /// it is.
    #[must_use]
    pub fn knowing(&self, runs: &[Run]) -> Self {
        let mut better = self.clone();
        for (row, trend) in better.trends.iter_mut().enumerate().filter(|(_, trend)| trend.information > 0.0) {
            let statistic = &self.observables[self.rows[row].0].0;
            for (x, batch) in runs {
                *trend = with_runs(*trend, batch, statistic, self.strength(x.as_slice()));
            }
        }
        for (model, (statistic, observations)) in better.models.iter_mut().zip(&mut better.observables) {
            for (x, batch) in runs {
                *observations = observations.joined(&at(batch, statistic, x.as_slice()));
            }
            if let Ok(restored) = Metamodel::restore(&model.records(), observations) {
                *model = restored;
            }
        }
        let pairs = better.models.iter().zip(&better.observables);
        better.lack = pairs.map(|(model, (_, observations))| lack(model, observations)).collect();
        better
    }

    /// Trends of what drifts with the effect, from the anchors.
    fn drifting(mut self, context: &Context, anchors: &Anchors, effect: &str, statistics: &[Statistic]) -> Self {
        if context.config.effects.library.find(effect).is_ok_and(|effect| effect.is_drift()) {
            for (row, statistic) in statistics.iter().enumerate().filter(|(_, s)| s.moment == Moment::Trend) {
                let add = |trend, (x, batch): (&[f64], &Batch)| with_runs(trend, batch, statistic, self.strength(x));
                self.trends[row] = anchors.runs(effect).fold(Trend::default(), add);
            }
        }
        self
    }

    /// The strength at a point, 0 where the surface has none.
    pub fn strength(&self, x: &[f64]) -> f64 {
        self.range.map_or(0.0, |range| strength_at(range, x[x.len() - 1]))
    }

    /// f(x) and its slopes for all statistics, shapes (m) and (m × dimension).
    pub fn predict(&self, x: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>) {
        let responses: Vec<Response> = self.models.iter().map(|model| model.response(x.as_slice())).collect();
        let rows = self.rows_of(&responses, x);
        let values = DVector::from_iterator(rows.len(), rows.iter().map(|(value, _)| *value));
        (values, DMatrix::from_fn(rows.len(), x.len(), |i, j| rows[i].1[j]))
    }

    /// How far repetitions scatter at a point: a standard deviation for every observable that has one.
    pub fn scatters(&self, x: &[f64]) -> impl Iterator<Item = (&Statistic, f64)> {
        let scatter = |model: &Metamodel| model.response(x).sd.map(|sd| sd.value).filter(|sd| *sd > 0.0);
        let observables = self.models.iter().zip(&self.observables);
        observables.filter_map(move |(model, (statistic, _))| Some((statistic, scatter(model)?)))
    }

    fn predictions(&self, x: &DVector<f64>) -> Vec<Prediction> {
        self.models.iter().map(|model| model.predict(x.as_slice())).collect()
    }

    /// Value and slopes of every statistic.
    fn rows_of(&self, responses: &[Response], x: &DVector<f64>) -> Vec<(f64, Vec<f64>)> {
        let one = |((model, moment), trend): (&(usize, Moment), &Trend)| match moment {
            Moment::Trend => self.trend_row(trend, x.as_slice()),
            _ => row(&responses[*model], *moment, x.len()),
        };
        self.rows.iter().zip(&self.trends).map(one).collect()
    }

    /// Standard deviation of the metamodels' own error in every statistic.
    fn errors_of(&self, predictions: &[Prediction], x: &DVector<f64>) -> Vec<f64> {
        let one = |((model, moment), trend): (&(usize, Moment), &Trend)| match moment {
            Moment::Mean => predictions[*model].epistemic_sd,
            Moment::LnSd => {
                let (error, lack) = (predictions[*model].log_sd_error, self.lack[*model]);
                (error * error + lack * lack).sqrt()
            }
            Moment::Trend => self.strength(x.as_slice()).abs() * trend.sd(),
        };
        self.rows.iter().zip(&self.trends).map(one).collect()
    }

    fn trend_row(&self, trend: &Trend, x: &[f64]) -> (f64, Vec<f64>) {
        let mut slopes = vec![0.0; x.len()];
        if let (Some((lower, upper)), Some(last)) = (self.range, slopes.last_mut()) {
            *last = trend.per_strength * (upper - lower);
        }
        (self.strength(x) * trend.per_strength, slopes)
    }

    /// Covariance of the metamodels' own error at `x`: [`Self::shared`] with the errors there.
    pub fn uncertainty(&self, x: &DVector<f64>, correlation: &DMatrix<f64>) -> DMatrix<f64> {
        self.shared(&self.errors_of(&self.predictions(x), x), correlation)
    }

    /// Covariance of errors of the metamodels with standard deviations `sd` (m). Errors of means are as correlated as the
    /// repetitions of a run (`correlation`, m × m); those of ln s and of trends are independent of all others. Held against
    /// runs at 128 places (docs/lessons.md, "Metamodels with honest errors").
    fn shared(&self, sd: &[f64], correlation: &DMatrix<f64>) -> DMatrix<f64> {
        let is_mean = |i: usize| self.rows[i].1 == Moment::Mean;
        let share = |i: usize, j: usize| if i == j || (is_mean(i) && is_mean(j)) { correlation[(i, j)] } else { 0.0 };
        DMatrix::from_fn(sd.len(), sd.len(), |i, j| share(i, j) * sd[i] * sd[j])
    }

    /// Covariance of the metamodels' error in the change between `x` and `y` ([`Self::shared`]).
    pub fn uncertainty_of_change(
        &self,
        x: &DVector<f64>,
        y: &DVector<f64>,
        correlation: &DMatrix<f64>,
    ) -> DMatrix<f64> {
        let (x, y) = (x.as_slice(), y.as_slice());
        let one = |((model, moment), trend): (&(usize, Moment), &Trend)| match moment {
            Moment::Mean => self.models[*model].mean_difference_sd(x, y),
            Moment::LnSd => self.models[*model].log_sd_difference_sd(x, y),
            Moment::Trend => (self.strength(x) - self.strength(y)).abs() * trend.sd(),
        };
        let sd: Vec<f64> = self.rows.iter().zip(&self.trends).map(one).collect();
        self.shared(&sd, correlation)
    }

    /// Slopes at `x` with the covariance of their error ([`Self::shared`]).
    pub fn slopes(&self, x: &DVector<f64>, correlation: &DMatrix<f64>) -> Slopes {
        let error = |(model, moment): &(usize, Moment)| match moment {
            Moment::Mean => self.models[*model].mean_slope_sd(x.as_slice()),
            Moment::LnSd => self.models[*model].log_sd_slope_sd(x.as_slice()),
            Moment::Trend => vec![0.0; x.len()],
        };
        let errors: Vec<Vec<f64>> = self.rows.iter().map(error).collect();
        let column = |j: usize| self.shared(&errors.iter().map(|row| row[j]).collect::<Vec<_>>(), correlation);
        Slopes { jacobian: self.predict(x).1, covariance: (0..x.len()).map(column).collect() }
    }
}

/// How much more than by their own error the scatters of repetitions differ from the metamodel, as a standard deviation of
/// ln s: the root of Σ w((ln s − ln ŝ)² − v)/Σ w with v = ψ₁(ν/2)/4 and w = 1/v², at least 0. Few repetitions at many points
/// let a metamodel take the scatter for constant; what many repetitions at one point tell then shows here.
fn lack(model: &Metamodel, observations: &Observations) -> f64 {
    let (mut sum, mut weights) = (0.0, 0.0);
    for (index, point) in observations.points.rows().enumerate() {
        let (n, s) = (observations.counts[index], observations.sds[index]);
        let Some(predicted) = model.response(point).sd.filter(|sd| n >= 2 && s > 0.0 && sd.value > 0.0) else {
            continue;
        };
        let (off, v) = (ln_sd(s, n).value - libm::log(predicted.value), 0.25 * trigamma(0.5 * (n as f64 - 1.0)));
        sum += (off * off - v) / (v * v);
        weights += 1.0 / (v * v);
    }
    if weights > 0.0 { (sum / weights).max(0.0).sqrt() } else { 0.0 }
}

/// A trend that also knows the runs of a batch, all at one strength.
fn with_runs(trend: Trend, batch: &Batch, statistic: &Statistic, strength: f64) -> Trend {
    let values: Vec<f64> = batch.series(statistic).map(|s| s.values().copied().collect()).unwrap_or_default();
    match batch.line(statistic) {
        Some(line) if values.len() > 2 => {
            let scatter = sd(&values);
            trend.with(strength, line.slope, scatter * scatter / line.lever)
        }
        _ => trend,
    }
}

/// What the runs at one point say of a statistic's observable.
fn at(batch: &Batch, statistic: &Statistic, x: &[f64]) -> Observations {
    let values: Vec<f64> = batch.series(statistic).map(|s| s.values().copied().collect()).unwrap_or_default();
    let usable = values.len() >= 2;
    let mut points = Points::empty(x.len());
    points.push(x);
    Observations {
        points,
        means: vec![if usable { mean(&values) } else { 0.0 }],
        sds: vec![if usable { sd(&values) } else { 0.0 }],
        counts: vec![if usable { values.len() } else { 0 }],
    }
}

/// The same observations with one more coordinate, the same for all.
fn with_place(observations: Observations, place: f64) -> Observations {
    let mut points = Points::empty(observations.points.dimension() + 1);
    observations.points.rows().for_each(|row| points.push(&[row, &[place]].concat()));
    Observations { points, ..observations }
}

fn row(response: &Response, moment: Moment, dimension: usize) -> (f64, Vec<f64>) {
    match (moment, &response.sd) {
        (Moment::LnSd, Some(sd)) if sd.value > 0.0 => {
            (libm::log(sd.value), sd.gradient.iter().map(|slope| slope / sd.value).collect())
        }
        (Moment::LnSd | Moment::Trend, _) => (0.0, vec![0.0; dimension]),
        (Moment::Mean, _) => (response.mean.value, response.mean.gradient.clone()),
    }
}

/// The parameters of the study in the unit cube with the priors of a data set, starting at `start`.
pub fn parameters(config: &Config, measured: &Measured, start: &[f64]) -> Vec<Parameter> {
    let known = config.priors_of(measured);
    let prior = |name: &str| known.iter().find(|prior| prior.parameter == name);
    let parameter = |(parameter, value): (&crate::config::Parameter, &f64)| Parameter {
        name: parameter.name.to_owned(),
        value: *value,
        lower: 0.0,
        upper: 1.0,
        prior: prior(parameter.name).map(|prior| {
            let error = error_of_mean(prior.sd, prior.n);
            let width = parameter.to_unit(prior.mean + 0.5 * error) - parameter.to_unit(prior.mean - 0.5 * error);
            Prior { mean: parameter.to_unit(prior.mean), sd: width }
        }),
    };
    config.parameters.iter().zip(start).map(parameter).collect()
}

/// Standard error of the mean of n ≥ 2 values whose standard deviation is known from themselves: of the normal distribution with
/// the 95 % interval of Student's t.
fn error_of_mean(sd: f64, n: u32) -> f64 {
    let tails = student_t_quantile(0.975, f64::from(n) - 1.0) / normal_quantile(0.975);
    tails * sd / f64::from(n).sqrt()
}

/// What a fit weighs by: covariance of the measured values, and correlation of the metamodels' errors.
#[derive(Clone, Copy)]
pub struct Weights<'a> {
    /// Covariance of the measured values (m × m).
    pub noise: &'a DMatrix<f64>,
    /// Correlation of the repetitions of a run (m × m), which the errors of the metamodels share in part.
    pub correlation: &'a DMatrix<f64>,
}

impl Weights<'_> {
    /// ln of the likelihood of `values` at `x` with the priors of the parameters, up to a constant:
    /// −½(rᵀΣ⁻¹r + ln det Σ) − ½ Σ priors, Σ with the metamodels' error at `x` itself. −∞ outside the unit cube.
    pub fn ln_posterior(
        &self,
        surface: &Surface,
        values: &DVector<f64>,
        parameters: &[Parameter],
        x: &DVector<f64>,
    ) -> f64 {
        if !x.iter().all(|place| (0.0..=1.0).contains(place)) {
            return f64::NEG_INFINITY;
        }
        let predictions = surface.predictions(x);
        let covariance = self.noise + surface.shared(&surface.errors_of(&predictions, x), self.correlation);
        let Some(factor) = covariance.cholesky() else { return f64::NEG_INFINITY };
        let responses: Vec<Response> = predictions.into_iter().map(Response::from).collect();
        let rows = surface.rows_of(&responses, x);
        let residual = DVector::from_fn(values.len(), |i, _| values[i] - rows[i].0);
        let misfit = residual.dot(&factor.solve(&residual)) + ln_det(&factor);
        let off = |(parameter, place): (&Parameter, &f64)| {
            parameter.prior.map_or(0.0, |prior| (place - prior.mean) * (place - prior.mean) / (prior.sd * prior.sd))
        };
        -0.5 * (misfit + parameters.iter().zip(x.iter()).map(off).sum::<f64>())
    }

    /// Covariance of what is measured less what is predicted at `x`.
    pub fn at(&self, surface: &Surface, x: &DVector<f64>) -> DMatrix<f64> {
        self.noise + surface.uncertainty(x, self.correlation)
    }
}

/// A fit over metamodels with the covariance behind it.
pub struct Fitted {
    /// The fit.
    pub fit: GlsFit,
    /// Covariance of what is measured less what is predicted, with the metamodels' error near the optimum (m × m).
    pub covariance: DMatrix<f64>,
    /// −2 ln of the likelihood with the priors, up to a constant.
    pub misfit: f64,
}

/// The likeliest fit over metamodels from several starts. From each their error is taken at `known` first, then at the
/// optimum of that first pass, and optima are compared by the likelihood with the error at their own place: one far from all
/// runs would be lost by the small error near them. `parameters` makes the parameters that start at a point. The
/// covariance of the result allows for the error of the slopes.
pub fn two_passes(
    surface: &Surface,
    evidence: &Evidence,
    weights: Weights,
    (known, starts): (&DMatrix<f64>, &[Vec<f64>]),
    parameters: impl Fn(&[f64]) -> Vec<Parameter>,
) -> Result<Fitted, StageError> {
    let fit = |covariance: &DMatrix<f64>, start: &[f64]| {
        gls(|x| surface.predict(x), &evidence.values, covariance, &parameters(start))
    };
    let (mut seen, mut best): (Vec<DVector<f64>>, Option<Fitted>) = (Vec::new(), None);
    for start in starts {
        let first = fit(known, start)?.parameters;
        if seen.iter().any(|x| (x - &first).amax() < SAME) {
            continue;
        }
        let covariance = weights.at(surface, &first);
        let fit = fit(&covariance, first.as_slice())?;
        seen.push(first);
        let ln_det = covariance.clone().cholesky().map_or(f64::INFINITY, |factor| ln_det(&factor));
        let misfit = fit.chi2 + ln_det;
        if best.as_ref().is_none_or(|best| misfit < best.misfit) {
            best = Some(Fitted { fit, covariance, misfit });
        }
    }
    let best = best.ok_or(StageError::Input { what: "there is no start for the fit".into(), remedy: "report this" })?;
    let Fitted { mut fit, covariance, misfit } = best;
    let held: Vec<bool> = fit.at_bound.iter().map(Option::is_some).collect();
    let priors = parameters(fit.parameters.as_slice());
    let slopes = surface.slopes(&fit.parameters, weights.correlation);
    if let Some(warranted) = with_slope_errors(&slopes, &covariance, &priors, &held) {
        fit.covariance = warranted;
    }
    Ok(Fitted { fit, covariance, misfit })
}

/// Covariance of the parameters at `x` as of a fit that ends there (p × p), zero for those on a face of the unit cube.
pub fn covariance_at(
    surface: &Surface,
    weights: Weights,
    x: &DVector<f64>,
    parameters: &[Parameter],
) -> Option<DMatrix<f64>> {
    let slopes = surface.slopes(x, weights.correlation);
    with_slope_errors(&slopes, &weights.at(surface, x), parameters, &at_bound(x))
}

/// Which parameters lie on a face of the unit cube.
pub fn at_bound(u: &DVector<f64>) -> Vec<bool> {
    u.iter().map(|x| *x <= 0.0 || *x >= 1.0).collect()
}

/// Two optima nearer than this in every coordinate of the unit cube are one.
const SAME: f64 = 1e-3;

/// ln det of a factorised matrix.
pub fn ln_det(factor: &Cholesky<f64, Dyn>) -> f64 {
    2.0 * factor.l_dirty().diagonal().map(libm::log).sum()
}

/// Variance of what is only known to lie within the unit interval.
const UNIFORM: f64 = 1.0 / 12.0;

/// The covariance that slopes warrant: (JᵀΣ⁻¹J − diag(tr Σ⁻¹C_j) + priors)⁻¹ over the parameters that no bound holds, zero for the
/// others, C_j being the covariance of the error of column j. Errors of slopes lengthen them, JᵀΣ⁻¹J on average by the trace
/// taken off here: without it a flat direction looks known. What then is not positive is known to the range alone. `None` if
/// Σ is not positive definite.
fn with_slope_errors(
    slopes: &Slopes,
    noise: &DMatrix<f64>,
    parameters: &[Parameter],
    held: &[bool],
) -> Option<DMatrix<f64>> {
    let factor = noise.clone().cholesky()?;
    let mut covariance = DMatrix::zeros(held.len(), held.len());
    let free: Vec<usize> = (0..held.len()).filter(|i| !held[*i]).collect();
    if free.is_empty() {
        return Some(covariance);
    }
    let jacobian = slopes.jacobian.select_columns(&free);
    let mut information = jacobian.tr_mul(&factor.solve(&jacobian));
    for (place, i) in free.iter().enumerate() {
        let prior = parameters[*i].prior.map_or(0.0, |prior| 1.0 / (prior.sd * prior.sd));
        information[(place, place)] += prior - factor.solve(&slopes.covariance[*i]).trace();
    }
    let eigen = information.symmetric_eigen();
    let variances = eigen.eigenvalues.map(|value| 1.0 / (value.max(0.0) + 1.0 / UNIFORM));
    let of_free = &eigen.eigenvectors * DMatrix::from_diagonal(&variances) * eigen.eigenvectors.transpose();
    for (a, i) in free.iter().enumerate() {
        for (b, j) in free.iter().enumerate() {
            covariance[(*i, *j)] = of_free[(a, b)];
        }
    }
    Some(covariance)
}

/// Points from which a fit over the parameters starts: the centre, and one towards every corner.
pub fn starts(p: usize) -> Vec<Vec<f64>> {
    let corner = |index: usize| (0..p).map(|d| if index >> d & 1 == 1 { 0.8 } else { 0.2 }).collect::<Vec<f64>>();
    let corners = if p <= 6 { 1 << p } else { 0 };
    std::iter::once(vec![0.5; p]).chain((0..corners).map(corner)).collect()
}

/// Weighted least squares with the errors of this stage.
pub fn gls(
    model: impl Fn(&DVector<f64>) -> (DVector<f64>, DMatrix<f64>),
    data: &DVector<f64>,
    covariance: &DMatrix<f64>,
    parameters: &[Parameter],
) -> Result<GlsFit, StageError> {
    gls_fit(model, data, covariance, parameters, &GlsOptions::default()).map_err(|error| StageError::Input {
        what: format!("the fit of all statistics failed: {error}"),
        remedy: "check the measured data for observables without scatter, or raise study.repetitions",
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quantiles of Student's t as printed in tables: 12.706 (1 degree of freedom) and 2.262 (9), 2.5 % a side; 1.960 of the normal.
    #[test]
    fn a_mean_of_few_values_is_known_as_well_as_student_says() {
        for (n, quantile) in [(2, 12.706), (10, 2.262), (1_000_000, 1.960)] {
            let expected = quantile / 1.960 * 30.0 / f64::from(n).sqrt();
            assert!((error_of_mean(30.0, n) / expected - 1.0).abs() < 1e-3, "{n}: {}", error_of_mean(30.0, n));
        }
    }

    #[test]
    fn only_errors_of_means_go_together_as_repetitions_do() {
        let rows = vec![(0, Moment::Mean), (1, Moment::Mean), (0, Moment::LnSd), (1, Moment::LnSd), (0, Moment::Trend)];
        let trends = vec![Trend::default(); rows.len()];
        let surface =
            Surface { models: Vec::new(), observables: Vec::new(), lack: Vec::new(), rows, trends, range: None };
        let correlation = DMatrix::from_fn(5, 5, |i, j| if i == j { 1.0 } else { 0.5 });
        let covariance = surface.shared(&[1.0, 2.0, 3.0, 4.0, 5.0], &correlation);
        let mut expected = DMatrix::from_diagonal(&DVector::from_vec(vec![1.0, 4.0, 9.0, 16.0, 25.0]));
        expected[(0, 1)] = 1.0;
        expected[(1, 0)] = 1.0;
        assert_eq!(covariance, expected);
    }
}
