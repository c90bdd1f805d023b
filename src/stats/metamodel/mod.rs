//! Metamodels of one KPI over the parameters: three kinds behind one interface.
//!
//! * `ibm` (paper, section 4.3): a noiseless Gaussian process for the normalised mean, another for the coefficient
//!   of variation. Interpolates, so the noise of few repetitions is reproduced as if it were response.
//! * `rbm` (paper, section 4.3): one process for the normalised mean with a noise at every point. Its "standard
//!   deviation" is the root of eq. 9, that is the uncertainty of the mean and **not** the scatter of the KPI; the
//!   paper uses it as if it were, and so does this kind, to reproduce it.
//! * `sk` (ours; stochastic kriging after Ankenman, Nelson & Staum 2010 with a smoothed variance as in Binois et al.
//!   2018): a process for the log variance, and one for the mean whose noise is that variance over the repetitions.
//!   Works for observables of any sign, because nothing is divided by the mean.
//!
//! Takes mean, sd and number of runs at points of the unit cube; gives mean, sd and the uncertainty of the mean with
//! gradients. The state of a model is the observations plus one [`PartRecord`] per process, all plain numbers.
//! Deliberately knows nothing of parameter names, units and files.

mod ibm;
mod part;
pub mod quality;
mod rbm;
mod sk;

pub use part::{Part, PartRecord, Role};

use super::gp::kernel::Kernel;
use super::gp::log_likelihood_of_runs;
use super::linalg::{Jitter, LinalgError};
use super::naming::named;
use super::points::Points;
use ibm::Ibm;
use rbm::Rbm;
use sk::Sk;

/// The kinds of metamodel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// Interpolation: noiseless mean, noiseless coefficient of variation.
    Ibm,
    /// Regression: mean with noise; sd by eq. 9.
    Rbm,
    /// Stochastic kriging: smoothed variance, mean with variance over repetitions.
    Sk,
}

/// The paper's σ_n² of eq. 7, which its text leaves open (kind `rbm`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Noise {
    /// Squared coefficient of variation, (s/m)²: the reading that keeps the units (default).
    CvSquared,
    /// Coefficient of variation, s/m: the literal text.
    Cv,
    /// Variance of the normalised mean, (s/scale)²/n.
    VarOfMean,
}

/// What the second process of kind `ibm` interpolates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scatter {
    /// Coefficient of variation s/m; the sd is that times the predicted mean (default, the paper's).
    Cv,
    /// Normalised standard deviation s/scale.
    Sd,
}

named!(Kind, "kind of metamodel", Ibm => "ibm", Rbm => "rbm", Sk => "sk");
named!(Noise, "reading of the noise", CvSquared => "cv_squared", Cv => "cv", VarOfMean => "var_of_mean");
named!(Scatter, "scatter", Cv => "cv", Sd => "sd");

/// What a metamodel is trained or scored on: one KPI over a design.
#[derive(Debug, Clone, PartialEq)]
pub struct Observations {
    /// Points in the unit cube, shape (n_points, n_parameters).
    pub points: Points,
    /// Mean of the KPI at each point, in its unit; ignored where the count is 0.
    pub means: Vec<f64>,
    /// Standard deviation (n − 1) of the KPI at each point; ignored where the count is below 2.
    pub sds: Vec<f64>,
    /// Number of runs that gave the KPI at each point; 0 where none did.
    pub counts: Vec<usize>,
}

/// A metamodel that cannot be trained or restored.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MetamodelError {
    /// Lengths disagree.
    #[error("{points} points come with {means} means, {sds} sds and {counts} counts; give one of each per point")]
    Shape {
        /// Number of points.
        points: usize,
        /// Number of means.
        means: usize,
        /// Number of standard deviations.
        sds: usize,
        /// Number of counts.
        counts: usize,
    },
    /// A mean or sd is NaN, infinite or, for an sd, negative.
    #[error("mean or sd of point {point} is not usable; set its count to 0 if there is no observation")]
    NotFinite {
        /// Zero-based point.
        point: usize,
    },
    /// Not enough points to choose hyperparameters.
    #[error("{usable} points have a mean, a metamodel needs {needed}; simulate more points")]
    TooFewPoints {
        /// Points with at least one run.
        usable: usize,
        /// Points needed.
        needed: usize,
    },
    /// Single runs have no scatter.
    #[error(
        "{usable} points have two or more runs, `{kind}` needs {needed}: single runs tell nothing of the scatter \
         that this kind needs as noise; add repetitions or use `ibm`",
        kind = kind.name()
    )]
    NoScatter {
        /// Kind that was asked for.
        kind: Kind,
        /// Points with at least two runs.
        usable: usize,
        /// Points needed.
        needed: usize,
    },
    /// Normalisation by the mean breaks down.
    #[error(
        "the mean of point {point} is {mean:e}, zero or of another sign than at the first point: `{kind}` divides by \
         the mean; use `sk` for this observable",
        kind = kind.name()
    )]
    MeanChangesSign {
        /// Kind that was asked for.
        kind: Kind,
        /// Zero-based point.
        point: usize,
        /// Mean there.
        mean: f64,
    },
    /// A stored model lacks a process.
    #[error("the stored `{kind}` metamodel has no {role} process; train it again", kind = kind.name(), role = role.name())]
    MissingPart {
        /// Kind of the stored model.
        kind: Kind,
        /// The process that is missing.
        role: Role,
    },
    /// A stored model over other parameters.
    #[error("the stored metamodel has {found} length scales, the points have {expected} parameters; train it again")]
    RecordShape {
        /// Length scales stored.
        found: usize,
        /// Parameters of the points.
        expected: usize,
    },
    /// The covariance of the training points is singular.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

/// How observations become the processes: what neither they nor the hyperparameters tell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Noise of kind `rbm`.
    pub noise: Noise,
    /// Scatter of kind `ibm`.
    pub scatter: Scatter,
    /// Kind `sk`: smallest variance that enters a logarithm, as a share of the mean variance over the design. Guards
    /// against runs that agree exactly (a count, a mass that is always zero).
    pub variance_floor: f64,
    /// Kernel of kind `sk`; the others have the paper's.
    pub kernel: Kernel,
}

impl Default for Reading {
    /// `cv_squared`, `cv`, a floor of 10⁻⁴ (one percent of the typical standard deviation), and Matérn 5/2.
    fn default() -> Self {
        Self { noise: Noise::CvSquared, scatter: Scatter::Cv, variance_floor: 1e-4, kernel: Kernel::Matern52 }
    }
}

/// How a metamodel is trained.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// How observations are read.
    pub reading: Reading,
    /// Bounds of log10 a_d: the paper's "[−1, 1]³".
    pub log10_a: (f64, f64),
    /// Diagonal of the noiseless processes.
    pub jitter: Jitter,
    /// Seed of the starts.
    pub seed: u64,
    /// Seeded starts that are evaluated.
    pub starts: usize,
    /// The best of them that are refined.
    pub refined: usize,
    /// A model of fewer repetitions, whose optimum is refined too.
    pub warm: Vec<PartRecord>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            reading: Reading::default(),
            log10_a: (-1.0, 1.0),
            jitter: Jitter::default(),
            seed: 0,
            starts: 100,
            refined: 6,
            warm: Vec::new(),
        }
    }
}

/// A value with its gradient with respect to the parameters in the unit cube.
#[derive(Debug, Clone, PartialEq)]
pub struct Differentiable {
    /// Value, in the unit of the KPI.
    pub value: f64,
    /// ∂ value / ∂x_d, shape (n_parameters).
    pub gradient: Vec<f64>,
}

/// What a metamodel says of a KPI at one point.
#[derive(Debug, Clone, PartialEq)]
pub struct Prediction {
    /// Mean of the KPI.
    pub mean: Differentiable,
    /// Standard deviation of the KPI between repetitions, as this kind defines it; none where it was trained on
    /// single runs.
    pub sd: Option<Differentiable>,
    /// Standard deviation of the mean's own uncertainty.
    pub epistemic_sd: f64,
    /// Standard deviation of the uncertainty of ln sd; 0 where this kind makes no statement on it.
    pub log_sd_error: f64,
}

/// What a metamodel says of a KPI at one point, without how sure it is.
#[derive(Debug, Clone, PartialEq)]
pub struct Response {
    /// Mean of the KPI.
    pub mean: Differentiable,
    /// Standard deviation of the KPI between repetitions, as in [`Prediction`].
    pub sd: Option<Differentiable>,
}

impl From<Prediction> for Response {
    fn from(prediction: Prediction) -> Self {
        Self { mean: prediction.mean, sd: prediction.sd }
    }
}

/// A trained metamodel of one KPI.
#[derive(Debug, Clone)]
pub enum Metamodel {
    /// Interpolation.
    Ibm(Ibm),
    /// Regression.
    Rbm(Rbm),
    /// Stochastic kriging.
    Sk(Sk),
}

impl Metamodel {
    /// Trains a metamodel of the given kind.
    ///
    /// # Errors
    /// [`MetamodelError`] for inconsistent observations, for too few of them, and where this kind cannot represent
    /// them.
    pub fn fit(kind: Kind, observations: &Observations, options: &Options) -> Result<Self, MetamodelError> {
        let usable = observations.usable()?;
        Ok(match kind {
            Kind::Ibm => Self::Ibm(Ibm::fit(&usable, options)?),
            Kind::Rbm => Self::Rbm(Rbm::fit(&usable, options)?),
            Kind::Sk => Self::Sk(Sk::fit(&usable, options)?),
        })
    }

    /// The metamodel that [`Metamodel::parts`] described, on the same observations: predictions are equal to the bit.
    ///
    /// # Errors
    /// [`MetamodelError::MissingPart`] and [`MetamodelError::RecordShape`] for records that belong to other
    /// observations, and the errors of [`Metamodel::fit`].
    pub fn restore(records: &[PartRecord], observations: &Observations) -> Result<Self, MetamodelError> {
        let usable = observations.usable()?;
        let (kind, expected) = (records.first().map_or(Kind::Ibm, |record| record.kind), usable.points.dimension());
        if let Some(record) = records.iter().find(|record| record.log10_a.len() != expected) {
            return Err(MetamodelError::RecordShape { found: record.log10_a.len(), expected });
        }
        let find = |role: Role| records.iter().find(|record| record.role == role);
        let mean = find(Role::Mean).ok_or(MetamodelError::MissingPart { kind, role: Role::Mean })?;
        let scatter = find(Role::Scatter);
        Ok(match kind {
            Kind::Ibm => Self::Ibm(Ibm::restore(&usable, mean, scatter)?),
            Kind::Rbm => Self::Rbm(Rbm::restore(&usable, mean)?),
            Kind::Sk => Self::Sk(Sk::restore(&usable, mean, scatter)?),
        })
    }

    /// Kind of this metamodel.
    pub fn kind(&self) -> Kind {
        match self {
            Self::Ibm(_) => Kind::Ibm,
            Self::Rbm(_) => Kind::Rbm,
            Self::Sk(_) => Kind::Sk,
        }
    }

    /// Its processes: the mean first, then the scatter where there is one.
    pub fn parts(&self) -> Vec<&Part> {
        match self {
            Self::Ibm(model) => model.parts(),
            Self::Rbm(model) => vec![model.part()],
            Self::Sk(model) => model.parts(),
        }
    }

    /// What is to be stored of this metamodel, beside its observations.
    pub fn records(&self) -> Vec<PartRecord> {
        self.parts().into_iter().map(|part| part.record().clone()).collect()
    }

    /// Number of parameters.
    pub fn dimension(&self) -> usize {
        self.mean_part().process().training().points.dimension()
    }

    /// Mean, sd and uncertainty of the mean at `x` in the unit cube.
    ///
    /// # Panics
    /// If `x` has another dimension than the training points.
    pub fn predict(&self, x: &[f64]) -> Prediction {
        assert_eq!(x.len(), self.dimension(), "a point of another dimension");
        match self {
            Self::Ibm(model) => model.predict(x),
            Self::Rbm(model) => model.predict(x),
            Self::Sk(model) => model.predict(x),
        }
    }

    /// The same mean and sd as [`Metamodel::predict`] gives, bit for bit; for kind `sk` without the solves behind its
    /// uncertainties, which are most of the work.
    ///
    /// # Panics
    /// If `x` has another dimension than the training points.
    pub fn response(&self, x: &[f64]) -> Response {
        assert_eq!(x.len(), self.dimension(), "a point of another dimension");
        match self {
            Self::Sk(model) => model.response(x),
            Self::Ibm(_) | Self::Rbm(_) => self.predict(x).into(),
        }
    }

    /// Standard deviation of the uncertainty of the slopes of the mean at `x`, shape (n_parameters).
    pub fn mean_slope_sd(&self, x: &[f64]) -> Vec<f64> {
        self.mean_part().slope_sd(x)
    }

    /// The same of the slopes of ln sd; 0 where this kind makes no statement on its uncertainty.
    pub fn log_sd_slope_sd(&self, x: &[f64]) -> Vec<f64> {
        match self {
            Self::Sk(model) => model.log_sd_slope_sd(x),
            Self::Ibm(_) | Self::Rbm(_) => vec![0.0; x.len()],
        }
    }

    /// Standard deviation of the uncertainty of the difference of the mean between `x` and `y`.
    pub fn mean_difference_sd(&self, x: &[f64], y: &[f64]) -> f64 {
        self.mean_part().difference_sd(x, y)
    }

    /// The same of the difference of ln sd; 0 where this kind makes no statement on its uncertainty.
    pub fn log_sd_difference_sd(&self, x: &[f64], y: &[f64]) -> f64 {
        match self {
            Self::Sk(model) => model.log_sd_difference_sd(x, y),
            Self::Ibm(_) | Self::Rbm(_) => 0.0,
        }
    }

    /// Mean of the KPI at `x` alone: a tenth of the work of [`Metamodel::predict`].
    pub fn mean(&self, x: &[f64]) -> f64 {
        self.mean_part().mean(x)
    }

    fn mean_part(&self) -> &Part {
        match self {
            Self::Ibm(model) => model.mean(),
            Self::Rbm(model) => model.part(),
            Self::Sk(model) => model.mean(),
        }
    }

    /// Mean of the KPI and sd of its uncertainty at every training point with runs, predicted from all the others.
    pub fn leave_one_out(&self) -> Vec<(f64, f64)> {
        self.mean_part().leave_one_out()
    }

    /// Log likelihood of all single runs, for kind `sk`; the other kinds have no model of a single run.
    pub fn log_likelihood_of_runs(&self) -> Option<f64> {
        let Self::Sk(model) = self else { return None };
        let (variances, observed, counts) = model.run_variances();
        let scale = libm::log(model.mean().record().scale) * counts.len() as f64;
        let of_means = self.mean_part().process().log_likelihood() - scale;
        variances.iter().all(|&v| v > 0.0).then(|| log_likelihood_of_runs(of_means, variances, observed, counts))
    }
}

/// Observations with at least one run each, checked.
#[derive(Debug, Clone)]
struct Usable {
    points: Points,
    means: Vec<f64>,
    sds: Vec<f64>,
    counts: Vec<usize>,
}

impl Observations {
    /// These observations, then those of `more`; of a point in both, whose runs may be the same, only that of `more`.
    #[must_use]
    pub fn joined(&self, more: &Self) -> Self {
        let again = |point: &[f64]| more.points.rows().any(|other| other == point);
        let own: Vec<usize> = (0..self.counts.len()).filter(|&i| !again(self.points.row(i))).collect();
        let join = |mine: &[f64], theirs: &[f64]| own.iter().map(|&i| mine[i]).chain(theirs.iter().copied()).collect();
        Self {
            points: self.points.select(&own).joined(&more.points),
            means: join(&self.means, &more.means),
            sds: join(&self.sds, &more.sds),
            counts: own.iter().map(|&i| self.counts[i]).chain(more.counts.iter().copied()).collect(),
        }
    }

    /// The observations at the points of these indices, in their order.
    #[must_use]
    pub fn select(&self, indices: &[usize]) -> Self {
        let pick = |values: &[f64]| indices.iter().map(|&i| values[i]).collect();
        Self {
            points: self.points.select(indices),
            means: pick(&self.means),
            sds: pick(&self.sds),
            counts: indices.iter().map(|&i| self.counts[i]).collect(),
        }
    }

    /// The points with at least one run.
    fn usable(&self) -> Result<Usable, MetamodelError> {
        let (points, means, sds, counts) = (self.points.len(), self.means.len(), self.sds.len(), self.counts.len());
        if points != means || points != sds || points != counts {
            return Err(MetamodelError::Shape { points, means, sds, counts });
        }
        let kept: Vec<usize> = (0..points).filter(|&i| self.counts[i] > 0).collect();
        let bad_sd = |i: usize| self.counts[i] > 1 && !(self.sds[i].is_finite() && self.sds[i] >= 0.0);
        if let Some(&point) = kept.iter().find(|&&i| !self.means[i].is_finite() || bad_sd(i)) {
            return Err(MetamodelError::NotFinite { point });
        }
        let needed = self.points.dimension() + 2;
        if kept.len() < needed {
            return Err(MetamodelError::TooFewPoints { usable: kept.len(), needed });
        }
        let pick = |values: &[f64]| kept.iter().map(|&i| values[i]).collect();
        Ok(Usable {
            points: self.points.select(&kept),
            means: pick(&self.means),
            sds: pick(&self.sds),
            counts: kept.iter().map(|&i| self.counts[i]).collect(),
        })
    }
}

impl Usable {
    /// Indices of the points with an sd.
    fn replicated(&self) -> Vec<usize> {
        (0..self.counts.len()).filter(|&i| self.counts[i] > 1).collect()
    }

    /// Points with an sd that kind `kind` needs to choose the hyperparameters of its noise.
    fn require_replicates(&self, kind: Kind) -> Result<Vec<usize>, MetamodelError> {
        let (replicated, needed) = (self.replicated(), self.points.dimension() + 2);
        let error = MetamodelError::NoScatter { kind, usable: replicated.len(), needed };
        if replicated.len() < needed { Err(error) } else { Ok(replicated) }
    }

    /// The mean over the design, by which kinds `ibm` and `rbm` normalise.
    fn design_mean(&self, kind: Kind) -> Result<f64, MetamodelError> {
        let sign = self.means[0].signum();
        if let Some(point) = self.means.iter().position(|&mean| mean * sign <= 0.0) {
            return Err(MetamodelError::MeanChangesSign { kind, point, mean: self.means[point] });
        }
        Ok(mean_of(&self.means))
    }

    /// Coefficient of variation |s/m| of point `i`.
    fn cv(&self, i: usize) -> f64 {
        (self.sds[i] / self.means[i]).abs()
    }
}

fn mean_of(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[cfg(test)]
mod tests;
