//! Anchors: every candidate simulated over the parameters and its strength together, shared by all diagnoses.
//!
//! Each candidate has a Latin hypercube of its own over the unit cube of the parameters and one more coordinate, the
//! place of the strength in its physical range. One-sided effects are sampled more densely near zero, because many
//! saturate: the mass that cohesion holds on a shelf grows like a root of the Bond number. With the runs of the design,
//! where every strength is zero, these points train the metamodels of `joint`.

use super::lab::{Job, Lab, requests_of};
use super::moments::{Batch, Statistic};
use crate::campaign::{CampaignError, Point, Request};
use crate::effects::Effect;
use crate::stages::{Context, StageError};
use crate::stats::design::latin::{Annealing, conditional_latin_hypercube};
use crate::stats::metamodel::Observations;
use crate::stats::points::Points;
use crate::stats::summary::{mean, sd};
use rayon::prelude::*;

/// Runs of all candidates, and of the plain model in the centre of the parameter space.
pub struct Anchors {
    centre: Batch,
    effects: Vec<EffectRuns>,
}

struct EffectRuns {
    name: String,
    /// Parameters in the unit cube, then the strength's place in its range.
    unit: Points,
    batches: Vec<Batch>,
}

impl Anchors {
    /// Simulates the anchors, or looks them up.
    pub fn simulate(context: &Context, lab: &mut Lab) -> Result<Self, StageError> {
        let (jobs, plan) = jobs(context)?;
        let mut batches = lab.run(&jobs)?.into_iter();
        let centre = batches.next().unwrap_or_default();
        let runs = |(name, unit): (String, Points)| {
            let batches = batches.by_ref().take(unit.len()).collect();
            EffectRuns { name, unit, batches }
        };
        Ok(Self { centre, effects: plan.into_iter().map(runs).collect() })
    }

    /// The runs of the plain model in the centre of the parameter space.
    pub fn centre(&self) -> &Batch {
        &self.centre
    }

    /// The batches of an effect's anchors, each with its parameters in the unit cube and the place of its strength.
    pub fn runs(&self, effect: &str) -> impl Iterator<Item = (&[f64], &Batch)> {
        let found = self.effects.iter().filter(move |runs| runs.name == effect);
        found.flat_map(|runs| runs.unit.rows().zip(&runs.batches))
    }

    /// What a statistic's observable gave at the anchors of an effect; none of an effect without anchors.
    pub fn observations(&self, effect: &str, statistic: &Statistic) -> Option<Observations> {
        let runs = self.effects.iter().find(|runs| runs.name == effect)?;
        let values = |batch: &Batch| batch.series(statistic).map(|series| series.values().copied().collect::<Vec<_>>());
        let series: Vec<Vec<f64>> = runs.batches.iter().map(|batch| values(batch).unwrap_or_default()).collect();
        Some(Observations {
            points: runs.unit.clone(),
            means: series.iter().map(|values| if values.is_empty() { 0.0 } else { mean(values) }).collect(),
            sds: series.iter().map(|values| if values.len() < 2 { 0.0 } else { sd(values) }).collect(),
            counts: series.iter().map(Vec::len).collect(),
        })
    }
}

/// The runs that every diagnosis needs, known before anything is: the centre, then the anchors of every candidate.
pub fn requests(context: &Context) -> Result<Vec<Request>, StageError> {
    let (jobs, _) = jobs(context)?;
    let requests = jobs.iter().map(|job| requests_of(job, context.config.study.seed)).collect::<Result<Vec<_>, _>>()?;
    Ok(requests.concat())
}

/// The anchors of every candidate by name, in order.
type AnchorPoints = Vec<(String, Points)>;

/// The centre and the anchors as jobs, and the points of every candidate.
fn jobs(context: &Context) -> Result<(Vec<Job>, AnchorPoints), StageError> {
    let diagnose = &context.config.diagnose;
    let centre = point_at(context, 1, &vec![0.5; context.config.parameters.len()])?;
    let mut jobs = vec![job(context, "anchors".to_owned(), centre, diagnose.refine_repetitions)];
    let cubes: Vec<Points> =
        context.campaign.install(|| diagnose.candidates.par_iter().map(|name| hypercube(context, name)).collect());
    let mut plan = Vec::new();
    for (name, cube) in diagnose.candidates.iter().zip(cubes) {
        let effect = context.config.effects.library.find(name).map_err(CampaignError::from)?;
        let unit = anchor_points(&cube, &*effect);
        for (index, x) in unit.rows().enumerate() {
            let (u, place) = x.split_at(x.len() - 1);
            let strength = strength_at(effect.range(), place[0]);
            let point = point_at(context, index as u32 + 1, u)?;
            let point = with_more(context, &point, &[(name.clone(), strength)]);
            jobs.push(job(context, format!("anchors/{name}"), point, diagnose.anchor_repetitions));
        }
        plan.push((name.clone(), unit));
    }
    Ok((jobs, plan))
}

/// The strength at a place of its range, 0 at the lower end and 1 at the upper one.
pub fn strength_at((lower, upper): (f64, f64), place: f64) -> f64 {
    lower + place * (upper - lower)
}

/// The place of a strength in its range.
pub fn place_of((lower, upper): (f64, f64), strength: f64) -> f64 {
    (strength - lower) / (upper - lower)
}

/// The hypercube of an effect over the parameters and the place of its strength.
fn hypercube(context: &Context, name: &str) -> Points {
    let p = context.config.parameters.len();
    let annealing = Annealing { seed: context.seed(&format!("anchors {name}")), ..Annealing::default() };
    let number = context.config.diagnose.anchors as usize;
    conditional_latin_hypercube(number, &Points::empty(p + 1), &annealing).points
}

/// The same, denser at small strengths where the effect is one-sided.
fn anchor_points(cube: &Points, effect: &dyn Effect) -> Points {
    let p = cube.dimension() - 1;
    let mut points = Points::empty(p + 1);
    for row in cube.rows() {
        let mut x = row.to_vec();
        if effect.one_sided() {
            x[p] *= x[p];
        }
        points.push(&x);
    }
    points
}

/// The point at `u` in the unit cube, with the effects the model already has.
pub fn point_at(context: &Context, number: u32, u: &[f64]) -> Result<Point, StageError> {
    point_with(context, number, u, &[])
}

/// The same with other values of some settings.
pub fn point_with(context: &Context, number: u32, u: &[f64], settings: &[(String, f64)]) -> Result<Point, StageError> {
    let parameters = context.config.parameters.iter().zip(u);
    let own = parameters.map(|(parameter, x)| (parameter.name.to_owned(), parameter.from_unit(*x)));
    let values: Vec<_> = own.chain(settings.iter().cloned()).collect();
    let point = Point::new(number, context.config.base_settings(), &values)?;
    Ok(point.knowing(&context.config.effects.library).with_effects(&context.config.effects.active))
}

/// The point with further effects on.
pub fn with_more(context: &Context, point: &Point, more: &[(String, f64)]) -> Point {
    let effects: Vec<_> = context.config.effects.active.iter().chain(more).cloned().collect();
    point.clone().with_effects(&effects)
}

fn job(context: &Context, label: String, point: Point, repetitions: u32) -> Job {
    Job { label, point, experiments: context.config.experiments(), repetitions }
}
