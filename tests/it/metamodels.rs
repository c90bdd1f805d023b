//! What `train` writes of its metamodels, worked out anew from the tables.

use crate::support::Study;
use granulake::tables::{AggregateRow, HyperparameterRow, MetamodelRow, SampleRow};
use nalgebra::{DMatrix, DVector};

/// A point of the design: its place in the unit interval and the mean observed there.
type Seen = (f64, f64);

/// The tables of a study with one parameter.
struct Tables {
    samples: Vec<SampleRow>,
    aggregates: Vec<AggregateRow>,
    hyperparameters: Vec<HyperparameterRow>,
}

impl Tables {
    /// The points of the validation, or all others.
    fn seen(&self, row: &MetamodelRow, validation: bool) -> Vec<Seen> {
        let wanted = self.samples.iter().filter(|sample| (sample.set == "validation") == validation);
        let mean = |point: u32| {
            let same = |other: &&AggregateRow| (&other.kpi, other.n, other.point) == (&row.kpi, row.n, point);
            self.aggregates.iter().find(same).and_then(|aggregate| aggregate.mean).expect("a mean")
        };
        wanted.map(|sample| (sample.unit_value, mean(sample.point))).collect()
    }

    fn number(&self, row: &MetamodelRow, name: &str) -> f64 {
        let own = |other: &&HyperparameterRow| {
            (&other.kpi, &other.kind, other.n) == (&row.kpi, &row.kind, row.n) && other.response == "mean"
        };
        self.hyperparameters.iter().filter(own).find(|other| other.name == name).expect("a number").value
    }

    /// The zero-mean interpolating process of a row (eqs 4 to 8), by a dense solve.
    fn process(&self, row: &MetamodelRow) -> impl Fn(f64) -> f64 {
        let (a, jitter) = (10.0_f64.powf(self.number(row, "log10_a sliding_friction")), self.number(row, "jitter"));
        let scale = self.number(row, "scale");
        let k = move |x: f64, y: f64| (-0.5 * a * (x - y) * (x - y)).exp();
        let seen = self.seen(row, false);
        let n = seen.len();
        let matrix = DMatrix::from_fn(n, n, |i, j| k(seen[i].0, seen[j].0) + if i == j { jitter } else { 0.0 });
        let targets = DVector::from_iterator(n, seen.iter().map(|(_, mean)| mean / scale));
        let alpha = matrix.full_piv_lu().solve(&targets).expect("a regular matrix");
        move |x| scale * seen.iter().zip(alpha.iter()).map(|((at, _), alpha)| k(x, *at) * alpha).sum::<f64>()
    }
}

/// Eq. 15.
fn nrmse(predict: impl Fn(f64) -> f64, seen: &[Seen]) -> f64 {
    let n = seen.len() as f64;
    let squares: f64 = seen.iter().map(|(x, mean)| (predict(*x) - mean) * (predict(*x) - mean)).sum();
    (squares / n).sqrt() / (seen.iter().map(|(_, mean)| mean).sum::<f64>() / n).abs()
}

/// Every n has its own errors, on the points of the training and on those kept for validation.
#[test]
fn errors_in_training_and_validation_are_those_of_eq_15_for_every_n() {
    let study = Study::quick();
    study.edit("pipeline.toml", "interior = 2\nvalidation = 1", "interior = 4\nvalidation = 3");
    study.edit("pipeline.toml", "kinds = [\"sk\"]", "kinds = [\"ibm\", \"rbm\", \"sk\"]");
    study.succeed(&["repro", "train", "--reps", "3"]);
    let tables = Tables { samples: study.table(), aggregates: study.table(), hyperparameters: study.table() };
    let rows: Vec<MetamodelRow> = study.table();
    let mut validated = Vec::new();
    for row in rows.iter().filter(|row| row.kpi == "bulk_density") {
        // Single runs have no scatter, which two of the kinds need as noise.
        assert_eq!(row.status == "ok", row.kind == "ibm" || row.n > 1, "{row:?}");
        if row.status == "ok" {
            assert!(row.nrmse_train_mean.is_some() && row.nrmse_validation_mean.is_some(), "{row:?}");
            assert_eq!(row.nrmse_validation_sd.is_some(), row.n > 1, "{row:?}");
        }
        if row.kind == "ibm" {
            let process = tables.process(row);
            for (told, validation) in [(row.nrmse_train_mean, false), (row.nrmse_validation_mean, true)] {
                let wanted = nrmse(&process, &tables.seen(row, validation));
                // The condition is up to 6/1e-8, so a solve may be off by 1e-7 of the mean.
                assert!((told.expect("an error") - wanted).abs() < 1e-7, "{told:?} against {wanted}: {row:?}");
            }
            validated.push((row.n, row.nrmse_validation_mean));
        }
    }
    assert_eq!(validated.iter().map(|(n, _)| *n).collect::<Vec<_>>(), [1, 2, 3]);
    assert!(validated[0].1 != validated[1].1 && validated[1].1 != validated[2].1, "{validated:?}");
}
