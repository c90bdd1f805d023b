//! Metamodels between tables: observations out of `samples` and `aggregates`, trained processes out of `hyperparameters`.

use super::{Context, StageError};
use crate::config::{self, Config, MetamodelKind, RbmNoise};
use crate::stats::gp::kernel::Kernel;
use crate::stats::linalg::Jitter;
use crate::stats::metamodel::{Kind, Metamodel, Noise, Observations, Options, PartRecord, Reading, Role};
use crate::stats::points::Points;
use crate::tables::list::{AggregateRow, HyperparameterRow, SampleRow};
use std::collections::BTreeMap;

/// Points of the design in the unit cube, parameters in the order of the study.
pub struct Design {
    /// Numbers of the points that metamodels are trained on.
    training: Vec<u32>,
    /// Numbers of the points that they are judged by.
    validation: Vec<u32>,
    unit: BTreeMap<u32, Vec<f64>>,
}

impl Design {
    /// The design of `samples`.
    pub fn new(config: &Config, samples: &[SampleRow]) -> Self {
        let position = |name: &str| config.parameters.iter().position(|parameter| parameter.name == name);
        let mut unit: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
        let mut sets: BTreeMap<u32, &str> = BTreeMap::new();
        for row in samples {
            let point = unit.entry(row.point).or_insert_with(|| vec![0.0; config.parameters.len()]);
            if let Some(index) = position(&row.parameter) {
                point[index] = row.unit_value;
            }
            sets.insert(row.point, &row.set);
        }
        let (validation, training) = sets.keys().partition(|number| sets[number] == "validation");
        Self { training, validation, unit }
    }

    /// Observations of a KPI over the first `n` repetitions, on training or on validation points.
    pub fn observations(&self, aggregates: &Aggregates, kpi: &str, n: u32, validation: bool) -> Observations {
        let numbers = if validation { &self.validation } else { &self.training };
        let rows: Vec<Option<&AggregateRow>> = numbers.iter().map(|point| aggregates.get(kpi, n, *point)).collect();
        let pick = |value: &dyn Fn(&AggregateRow) -> Option<f64>| {
            rows.iter().map(|row| row.and_then(value).unwrap_or(0.0)).collect::<Vec<_>>()
        };
        let mut points = Points::empty(self.unit.values().next().map_or(0, Vec::len));
        numbers.iter().for_each(|number| points.push(&self.unit[number]));
        Observations {
            points,
            means: pick(&|row| row.mean),
            sds: pick(&|row| row.sd),
            counts: rows.iter().map(|row| row.map_or(0, |row| row.count as usize)).collect(),
        }
    }
}

/// Rows of `aggregates` by observable, number of repetitions and point.
pub struct Aggregates {
    rows: BTreeMap<(String, u32, u32), AggregateRow>,
}

impl Aggregates {
    /// Indexes the rows.
    pub fn new(rows: Vec<AggregateRow>) -> Self {
        Self { rows: rows.into_iter().map(|row| ((row.kpi.clone(), row.n, row.point), row)).collect() }
    }

    fn get(&self, kpi: &str, n: u32, point: u32) -> Option<&AggregateRow> {
        self.rows.get(&(kpi.to_owned(), n, point))
    }
}

/// The kind as the numerics know it.
pub fn kind(kind: MetamodelKind) -> Kind {
    match kind {
        MetamodelKind::Ibm => Kind::Ibm,
        MetamodelKind::Rbm => Kind::Rbm,
        MetamodelKind::Sk => Kind::Sk,
    }
}

/// How the study trains metamodels.
pub fn options(config: &Config, seed: u64) -> Options {
    Options {
        reading: reading(config),
        log10_a: config.metamodel.log10_a,
        jitter: Jitter { first: config.metamodel.jitter, ..Jitter::default() },
        starts: config.metamodel.starts as usize,
        seed,
        ..Options::default()
    }
}

fn reading(config: &Config) -> Reading {
    let noise = match config.metamodel.rbm_noise {
        RbmNoise::CvSquared => Noise::CvSquared,
        RbmNoise::Cv => Noise::Cv,
        RbmNoise::VarianceOverN => Noise::VarOfMean,
    };
    let kernel = match config.metamodel.sk_kernel {
        config::Kernel::SquaredExponential => Kernel::SquaredExponential,
        config::Kernel::Matern52 => Kernel::Matern52,
    };
    Reading { noise, kernel, ..Reading::default() }
}

/// The rows that restore a metamodel.
pub fn rows(config: &Config, kpi: &str, n: u32, records: &[PartRecord]) -> Vec<HyperparameterRow> {
    let mut rows = Vec::new();
    for record in records {
        let mut add = |name: String, value: f64| {
            rows.push(HyperparameterRow {
                kpi: kpi.to_owned(),
                kind: record.kind.name().to_owned(),
                n,
                response: record.role.name().to_owned(),
                name,
                value,
            });
        };
        for (parameter, log10_a) in config.parameters.iter().zip(&record.log10_a) {
            add(format!("log10_a {}", parameter.name), *log10_a);
        }
        add("offset".to_owned(), record.offset);
        add("scale".to_owned(), record.scale);
        add("jitter".to_owned(), record.jitter);
        add("variance".to_owned(), record.variance);
        add("beta".to_owned(), record.beta);
        add("log_likelihood".to_owned(), record.log_likelihood);
    }
    rows
}

/// Trained metamodels, restored on demand.
pub struct Models<'a> {
    config: &'a Config,
    design: Design,
    aggregates: Aggregates,
    hyperparameters: BTreeMap<(String, String, u32), Vec<HyperparameterRow>>,
}

impl<'a> Models<'a> {
    /// Reads what `sample`, `aggregate` and `train` wrote.
    pub fn read(context: &Context<'a>) -> Result<Self, StageError> {
        let mut hyperparameters: BTreeMap<_, Vec<HyperparameterRow>> = BTreeMap::new();
        for row in context.read::<HyperparameterRow>()? {
            hyperparameters.entry((row.kpi.clone(), row.kind.clone(), row.n)).or_default().push(row);
        }
        Ok(Self {
            config: context.config,
            design: Design::new(context.config, &context.read()?),
            aggregates: Aggregates::new(context.read()?),
            hyperparameters,
        })
    }

    /// Observations of an observable over the first `n` repetitions on the points that metamodels are trained on.
    pub fn design(&self, kpi: &str, n: u32) -> Observations {
        self.design.observations(&self.aggregates, kpi, n, false)
    }

    /// Numbers of the points that metamodels are trained on, in the order of [`Models::design`].
    pub fn training_points(&self) -> &[u32] {
        &self.design.training
    }

    /// The points that metamodels are judged by, in the unit cube.
    pub fn validation_points(&self) -> Points {
        let mut points = Points::empty(self.design.unit.values().next().map_or(0, Vec::len));
        self.design.validation.iter().for_each(|number| points.push(&self.design.unit[number]));
        points
    }

    /// The metamodel of a KPI; `None` where training failed, and `metamodels` says why.
    pub fn restore(&self, kpi: &str, kind: Kind, n: u32) -> Option<Metamodel> {
        Metamodel::restore(&self.records(kpi, kind, n)?, &self.design(kpi, n)).ok()
    }

    /// What training found for a KPI.
    pub fn records(&self, kpi: &str, kind: Kind, n: u32) -> Option<Vec<PartRecord>> {
        let rows = self.hyperparameters.get(&(kpi.to_owned(), kind.name().to_owned(), n))?;
        Some([Role::Mean, Role::Scatter].iter().filter_map(|role| self.record(kind, *role, rows)).collect())
    }

    fn record(&self, kind: Kind, role: Role, rows: &[HyperparameterRow]) -> Option<PartRecord> {
        let value =
            |name: &str| rows.iter().find(|row| row.response == role.name() && row.name == name).map(|r| r.value);
        let log10_a: Option<Vec<f64>> =
            self.config.parameters.iter().map(|parameter| value(&format!("log10_a {}", parameter.name))).collect();
        let log10_a = log10_a?;
        Some(PartRecord {
            kind,
            role,
            reading: reading(self.config),
            offset: value("offset")?,
            scale: value("scale")?,
            jitter: value("jitter")?,
            at_bound: vec![false; log10_a.len()],
            log10_a,
            variance: value("variance")?,
            beta: value("beta")?,
            log_likelihood: value("log_likelihood")?,
            descents: 0,
            agreeing: 0,
        })
    }
}
