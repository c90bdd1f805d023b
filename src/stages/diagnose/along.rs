//! Direct runs along what the data leave open.
//!
//! An optimum is known by its own runs; how far the data allow another strength is known only as well as the metamodels are
//! there. Where parameters can stand in for an effect that is far: the statistics hardly change along a line on which both
//! trade places, and a metamodel that bends it a little makes one end of it look impossible. So the simulation is run at
//! a few places of that line, the metamodels learn what was seen, and parameters and strength are drawn anew, until the strength
//! stays and little of what seems to be known of it can be an error of theirs.

use super::direct;
use super::joint::Contender;
use super::lab::{Job, Lab};
use super::verdict::Case;
use crate::stages::StageError;
use nalgebra::DVector;

/// Strengths at which runs are made, in standard deviations from their mean.
const PLACES: [f64; 4] = [-2.0, -1.0, 1.0, 2.0];
/// Most times that runs are made.
const ROUNDS: usize = 3;
/// Share of the information on the strength that errors of the metamodels may feign before more runs are made.
const FEIGNED: f64 = 0.2;
/// Share of its standard deviation by which a strength may move and still count as the same.
const SETTLED: f64 = 0.5;

/// Draws parameters and strength of a contender given the data, with runs along the line that they lie on. Does nothing
/// where no direct runs stand behind its model.
pub fn follow(case: &Case, contender: &mut Contender, lab: &mut Lab) -> Result<(), StageError> {
    contender.sample(case)?;
    for round in 1..=ROUNDS {
        let (Some(draws), Some((before, _))) = (contender.draws(), contender.strength()) else { return Ok(()) };
        let places = PLACES.map(|k| DVector::from_vec(draws.along(k)));
        let job = |(index, x): (usize, &DVector<f64>)| job(case, contender, (round, index), x);
        let jobs = places.iter().enumerate().map(job).collect::<Result<Vec<_>, _>>()?;
        let runs: Vec<_> = places.into_iter().zip(lab.run(&jobs)?).collect();
        contender.learn(&runs);
        contender.sample(case)?;
        let stays = contender.strength().is_some_and(|(after, sd)| (after - before).abs() < SETTLED * sd);
        if stays && !is_feigned(contender) {
            break;
        }
    }
    Ok(())
}

/// Whether the metamodels' errors count in what seems to be known of the strength.
fn is_feigned(contender: &Contender) -> bool {
    contender.feigned().is_some_and(|share| share > FEIGNED)
}

/// Twice as many runs at a place as at an optimum where the metamodels' errors count, else half as many.
fn job(
    case: &Case,
    contender: &Contender,
    (round, index): (usize, usize),
    x: &DVector<f64>,
) -> Result<Job, StageError> {
    let label = format!("{}/along {} {round}", case.set.name, contender.name());
    let at_optimum = case.context.config.diagnose.refine_repetitions;
    let repetitions = if is_feigned(contender) { 2 * at_optimum } else { (at_optimum / 2).max(2) };
    direct::job(case.context, (label, index as u32 + 1), x.as_slice(), Some(contender.axis()), repetitions)
}
