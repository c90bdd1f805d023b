//! A closer look at an optimum: direct runs all over its region.
//!
//! Metamodels trained over the whole space can be wrong by several standard errors of a measurement at an optimum, in their
//! slopes too, and more runs at the optimum itself tell neither. So the region that the fit leaves open is sampled, the
//! metamodels learn what was seen, and the fit is repeated; the region follows the optimum, near or far, until that lies well inside
//! one that was looked at. Then the optimum itself is simulated, and the fit repeated with the scatter seen there, until the
//! runs stand where it is. Fits without an effect and with one go the same way.

use super::direct::{self, Axis};
use super::evidence::{Evidence, Noise};
use super::fit::{self, Surface, Weights};
use super::lab::Lab;
use super::moments::{Batch, Shape};
use crate::stages::{Context, StageError};
use crate::stats::attribution::{GlsFit, Parameter};
use crate::stats::design::latin::{Annealing, conditional_latin_hypercube};
use crate::stats::points::Points;
use nalgebra::{DMatrix, DVector};

/// Most regions that are looked at, one after the other.
const ROUNDS: usize = 6;
/// Half width of a region in standard errors of the fit.
const WIDTH: f64 = 4.0;
/// The least and the largest half width, in the unit cube.
const HALF: (f64, f64) = (0.2, 0.3);
/// Share of its width by which an optimum inside a region keeps away from the faces.
const MARGIN: f64 = 0.25;
/// Most places at which an optimum is simulated, one after the other.
const STANDS: u32 = 4;
/// How much less likely, in −2 ln likelihood, the place of the runs may be than the optimum and still count as it: half a
/// standard error.
const STAYS: f64 = 0.25;

/// Runs at a point of the unit cube.
pub type Run = (DVector<f64>, Batch);

/// A box in the unit cube.
#[derive(Debug)]
struct Region {
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl Region {
    /// The region that a fit leaves open.
    fn around(fit: &GlsFit) -> Self {
        let half = |i: usize| (WIDTH * fit.covariance[(i, i)].max(0.0).sqrt()).clamp(HALF.0, HALF.1);
        let face = |side: f64| {
            let place = |(i, x): (usize, &f64)| (x + side * half(i)).clamp(0.0, 1.0);
            fit.parameters.iter().enumerate().map(place).collect()
        };
        Self { lower: face(-1.0), upper: face(1.0) }
    }

    /// Whether an optimum lies well inside, or on the face of the unit cube.
    fn holds(&self, x: &DVector<f64>) -> bool {
        let inside = |(x, (low, high)): (&f64, (&f64, &f64))| {
            let margin = MARGIN * (high - low);
            (*low == 0.0 || *x >= low + margin) && (*high == 1.0 || *x <= high - margin)
        };
        x.iter().zip(self.lower.iter().zip(&self.upper)).all(inside)
    }

    /// A Latin hypercube over the region.
    fn points(&self, number: usize, seed: u64) -> Vec<DVector<f64>> {
        let annealing = Annealing { seed, ..Annealing::default() };
        let cube = conditional_latin_hypercube(number, &Points::empty(self.lower.len()), &annealing).points;
        let place = |i: usize, x: f64| self.lower[i] + x * (self.upper[i] - self.lower[i]);
        cube.rows().map(|row| DVector::from_fn(row.len(), |i, _| place(i, row[i]))).collect()
    }
}

/// What is looked at.
pub struct Look<'a> {
    /// The study.
    pub context: &'a Context<'a>,
    /// The statistics that are fitted.
    pub evidence: &'a Evidence,
    /// Label of the runs.
    pub label: String,
    /// Name and range of the effect whose strength is the last coordinate, if there is one.
    pub effect: Option<Axis<'a>>,
    /// What fits weigh by.
    pub weights: Weights<'a>,
    /// The parameters that start at a point.
    pub parameters: &'a dyn Fn(&[f64]) -> Vec<Parameter>,
    /// Where fits start, besides the last optimum.
    pub starts: Vec<Vec<f64>>,
}

/// What was seen.
pub struct Seen {
    /// The metamodels, which know the runs.
    pub surface: Surface,
    /// The optimum.
    pub fit: GlsFit,
    /// All runs made.
    pub runs: Vec<Run>,
}

/// An optimum that was simulated.
pub struct Stood {
    /// The metamodels, which know the runs.
    pub surface: Surface,
    /// Where the runs were made.
    pub optimum: DVector<f64>,
    /// Covariance of the optimum, with the scatter of the runs there.
    pub covariance: DMatrix<f64>,
    /// The runs there.
    pub batch: Batch,
    /// Runs elsewhere: around the optimum, and where it was thought to be before.
    pub runs: Vec<Run>,
    /// How repetitions near the optimum scatter.
    pub shape: Shape,
    /// How well the statistics are known.
    pub noise: Noise,
}

impl Look<'_> {
    /// Looks at the region of `fit`, the optimum of `surface`, and at that of the next optimum, until it lies in one that
    /// was looked at.
    pub fn settle(&self, lab: &mut Lab, mut surface: Surface, mut fit: GlsFit) -> Result<Seen, StageError> {
        let (mut runs, mut regions): (Vec<Run>, Vec<Region>) = (Vec::new(), Vec::new());
        while regions.len() < ROUNDS && !regions.iter().any(|region| region.holds(&fit.parameters)) {
            let region = Region::around(&fit);
            let more = self.run(lab, &region, regions.len() + 1)?;
            surface = surface.knowing(&more);
            runs.extend(more);
            regions.push(region);
            fit = self.fit(&surface, &fit.parameters)?;
        }
        Ok(Seen { surface, fit, runs })
    }

    /// Simulates the optimum and fits again by the scatter of the runs there, of those around it and, where they are of the same
    /// model, of those at the `centre`, until the optimum stays where it was simulated. Without a closer look, which leaves it
    /// where metamodels alone see it, it is simulated once. `None` where an observable could not be measured.
    pub fn stand(
        &self,
        lab: &mut Lab,
        label: &str,
        seen: Seen,
        centre: Option<&Batch>,
    ) -> Result<Option<Stood>, StageError> {
        let Seen { mut surface, fit, mut runs } = seen;
        let rounds = if runs.is_empty() { 1 } else { STANDS };
        let mut optimum = fit.parameters;
        for round in 1.. {
            let name = (label.to_owned(), round);
            let repetitions = self.context.config.diagnose.refine_repetitions;
            let job = direct::job(self.context, name, optimum.as_slice(), self.effect, repetitions)?;
            let batch = lab.run(&[job])?.remove(0);
            let around = Batch::deviations(&runs.iter().map(|(_, batch)| batch).collect::<Vec<_>>());
            let near: Vec<Batch> = centre.cloned().into_iter().chain([around, batch.clone()]).collect();
            let Some((shape, noise)) = self.evidence.scatter(&near) else { break };
            surface = surface.knowing(&[(optimum.clone(), batch.clone())]);
            let weights = Weights { noise: &noise.covariance, correlation: &shape.correlation };
            let next = Look { weights, starts: self.starts.clone(), label: self.label.clone(), ..*self };
            let fit = next.fit(&surface, &optimum)?;
            if round == rounds || next.stays(&surface, &optimum, &fit) {
                let parameters = (self.parameters)(optimum.as_slice());
                let Some(covariance) = fit::covariance_at(&surface, weights, &optimum, &parameters) else { break };
                return Ok(Some(Stood { surface, optimum, covariance, batch, runs, shape, noise }));
            }
            runs.push((std::mem::replace(&mut optimum, fit.parameters), batch));
        }
        Ok(None)
    }

    /// Whether a place is nearly as likely as the optimum of a fit.
    fn stays(&self, surface: &Surface, place: &DVector<f64>, fit: &GlsFit) -> bool {
        let ln_posterior = |x: &DVector<f64>| {
            self.weights.ln_posterior(surface, &self.evidence.values, &(self.parameters)(x.as_slice()), x)
        };
        2.0 * (ln_posterior(&fit.parameters) - ln_posterior(place)) < STAYS
    }

    fn run(&self, lab: &mut Lab, region: &Region, round: usize) -> Result<Vec<Run>, StageError> {
        let diagnose = &self.context.config.diagnose;
        let seed = self.context.seed(&format!("{} {round}", self.label));
        let points = region.points(diagnose.refine_points as usize, seed);
        let job = |(index, x): (usize, &DVector<f64>)| {
            let name = (format!("{} {round}", self.label), index as u32 + 1);
            direct::job(self.context, name, x.as_slice(), self.effect, diagnose.anchor_repetitions)
        };
        let jobs = points.iter().enumerate().map(job).collect::<Result<Vec<_>, _>>()?;
        Ok(points.into_iter().zip(lab.run(&jobs)?).collect())
    }

    fn fit(&self, surface: &Surface, known: &DVector<f64>) -> Result<GlsFit, StageError> {
        let starts = [&[known.as_slice().to_vec()], self.starts.as_slice()].concat();
        let first = self.weights.at(surface, known);
        Ok(fit::two_passes(surface, self.evidence, self.weights, (&first, &starts), self.parameters)?.fit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fit(parameters: &[f64], sds: &[f64]) -> GlsFit {
        let p = parameters.len();
        GlsFit {
            parameters: DVector::from_row_slice(parameters),
            covariance: DMatrix::from_diagonal(&DVector::from_fn(p, |i, _| sds[i] * sds[i])),
            chi2: 0.0,
            dof: 0,
            at_bound: vec![None; p],
            condition: 1.0,
            residual: DVector::zeros(0),
            jacobian: DMatrix::zeros(0, p),
            iterations: 0,
            converged: true,
        }
    }

    #[test]
    fn a_region_is_four_standard_errors_wide_within_limits_and_within_the_cube() {
        let region = Region::around(&fit(&[0.5, 0.5, 0.5, 0.95], &[0.06, 0.01, 0.5, 0.0]));
        let close = |a: &[f64], b: [f64; 4]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
        assert!(
            close(&region.lower, [0.26, 0.3, 0.2, 0.75]) && close(&region.upper, [0.74, 0.7, 0.8, 1.0]),
            "{region:?}"
        );
    }

    #[test]
    fn an_optimum_is_held_well_inside_or_on_a_face_of_the_cube() {
        let region = Region { lower: vec![0.2, 0.6], upper: vec![0.6, 1.0] };
        let holds = |x: f64, y: f64| region.holds(&DVector::from_vec(vec![x, y]));
        assert!(holds(0.4, 0.8) && holds(0.31, 0.71) && holds(0.4, 1.0));
        assert!(!holds(0.29, 0.8) && !holds(0.4, 0.69) && !holds(0.51, 0.8) && !holds(0.7, 0.8));
    }

    /// One point in every slab of every coordinate, the same for the same seed.
    #[test]
    fn the_points_fill_the_region() {
        let region = Region { lower: vec![0.2, 0.6], upper: vec![0.6, 1.0] };
        let points = region.points(8, 3);
        assert_eq!(points, region.points(8, 3));
        for (d, low) in [(0, 0.2), (1, 0.6)] {
            let mut slabs: Vec<usize> = points.iter().map(|x| ((x[d] - low) / 0.05) as usize).collect();
            slabs.sort_unstable();
            assert_eq!(slabs, (0..8).collect::<Vec<_>>());
        }
    }
}
