//! From rows of text to measured values: every check of a row and of the rows together.

use super::raw::RawTable;
use super::{MeasuredSummary, MeasuredValue, summarise};
use crate::config::nearest::suggestion;
use crate::config::problem::{Place, Problem, Problems};
use crate::experiments::{self, EXPERIMENTS, Experiment, Observable, Raw, observe};
use crate::settings::{self, Kind, Scope, SettingSpec, Settings};
use crate::units;
use std::collections::BTreeMap;

const VALUE_COLUMNS: &[&str] = &["experiment", "repetition", "kpi", "value", "unit"];
const SUMMARY_COLUMNS: &[&str] = &["experiment", "kpi", "mean", "sd", "n", "unit"];
/// Force of the material on a load cell [unit] over the time since the release [s].
const FORCE_COLUMNS: &[&str] = &["experiment", "repetition", "time", "force", "unit"];
/// Edge of the material in a picture.
const OUTLINE_COLUMNS: &[&str] = &["experiment", "repetition", "x", "z", "unit"];
const FREE_COLUMN: &str = "note";

/// Stands where an experiment does for what was measured on the grains themselves.
pub const GRAINS: &str = "grains";

/// Experiment and observable.
type Quantity = (&'static str, &'static str);
/// File and place of a row.
type Origin = (String, Place);
/// What a data set holds, and whether some of it was read off raw records.
type Rows = (Vec<MeasuredValue>, Vec<MeasuredSummary>, bool);
/// Experiment, repetition and whether the record is an outline.
type Record = (&'static str, u32, bool);

/// Gathers the rows of all files of a data set, with where each came from.
#[derive(Debug, Default)]
pub struct Collector {
    values: BTreeMap<(Quantity, u32), (f64, Origin)>,
    summaries: BTreeMap<Quantity, (MeasuredSummary, Origin)>,
    records: BTreeMap<Record, (Vec<(f64, f64)>, Origin)>,
    problems: Vec<Problem>,
}

/// The observable `kpi` of `experiment`.
pub fn observable(experiment: &str, kpi: &str) -> Option<&'static Observable> {
    let experiment = EXPERIMENTS.iter().find(|known| known.name() == experiment)?;
    experiment.observables().iter().find(|known| known.name == kpi)
}

/// One row with its cells by column.
struct Row<'t> {
    table: &'t RawTable,
    place: Place,
    cells: BTreeMap<&'t str, &'t str>,
}

impl Collector {
    /// Keeps a problem for the end.
    pub fn problem(&mut self, problem: Problem) {
        self.problems.push(problem);
    }

    /// Takes all rows of a table.
    pub fn add(&mut self, table: &RawTable) {
        let columns = match columns_of(table) {
            Ok(columns) => columns,
            Err(problem) => return self.problem(problem),
        };
        if table.rows.is_empty() {
            let what = "holds a header but no rows; add measurements, or leave its [[measured]] out".to_owned();
            self.problem(Problem { file: table.file.clone(), place: Place::File, what });
        }
        for (place, cells) in &table.rows {
            let taken = row_of(table, *place, cells).and_then(|row| match columns {
                VALUE_COLUMNS => self.value(&row),
                SUMMARY_COLUMNS => self.summary(&row),
                _ => self.sample(&row, columns == OUTLINE_COLUMNS),
            });
            if let Err(problem) = taken {
                self.problem(problem);
            }
        }
    }

    fn value(&mut self, row: &Row) -> Result<(), Problem> {
        let (quantity, unit) = row.quantity()?;
        let repetition = row.whole("repetition", 1, "repetitions count from 1")?;
        let value = row.number("value", unit)?;
        match self.values.get(&(quantity, repetition)) {
            Some((_, first)) => Err(row.problem(format!(
                "repetition {repetition} of {} stands twice, first {}; number the repetitions, or remove one row",
                quantity.1,
                seen(first, row)
            ))),
            None => {
                self.values.insert((quantity, repetition), (value, row.origin()));
                Ok(())
            }
        }
    }

    fn summary(&mut self, row: &Row) -> Result<(), Problem> {
        let (quantity, unit) = row.quantity()?;
        let (mean, sd) = (row.number("mean", unit)?, row.number("sd", unit)?);
        let n = row.whole("n", 2, "a scatter needs two repetitions or more")?;
        if sd <= 0.0 {
            let what = format!(
                "sd is {}; give the scatter between repetitions with enough digits to be above 0",
                row.cell("sd")
            );
            return Err(row.problem(what));
        }
        if let Some((_, first)) = self.summaries.get(&quantity) {
            return Err(row.problem(format!(
                "{} stands twice, first {}; remove one row",
                quantity.1,
                seen(first, row)
            )));
        }
        let (experiment, kpi) = quantity;
        let summary = MeasuredSummary { experiment, kpi, unit, mean, sd, n };
        self.summaries.insert(quantity, (summary, row.origin()));
        Ok(())
    }

    /// One sample of a raw record: (time, force) or (x, z).
    fn sample(&mut self, row: &Row, outline: bool) -> Result<(), Problem> {
        let experiment = row.experiment()?;
        let repetition = row.whole("repetition", 1, "repetitions count from 1")?;
        let (names, kind) = if outline {
            (experiment.read_off_outline(), "an outline")
        } else {
            (experiment.read_off_force(), "a force over time")
        };
        if names.is_empty() {
            return Err(
                row.problem(format!("nothing is read off {kind} of {}; give values instead", experiment.name()))
            );
        }
        let sample = if outline {
            (row.number("x", "m")?, row.number("z", "m")?)
        } else {
            (row.seconds()?, row.number("force", "N")?)
        };
        let entry = self.records.entry((experiment.name(), repetition, outline));
        let (samples, _) = entry.or_insert_with(|| (Vec::new(), row.origin()));
        if !outline && samples.last().is_some_and(|last| last.0 >= sample.0) {
            let what = format!("time {} s does not come after the sample before it; sort by time", sample.0);
            return Err(row.problem(what));
        }
        samples.push(sample);
        Ok(())
    }

    /// Reads the observables off every raw record, as `settings` say.
    fn read_records(&mut self, settings: &Settings) {
        for ((name, repetition, outline), (samples, origin)) in std::mem::take(&mut self.records) {
            let Ok(experiment) = experiments::find(name) else { continue };
            let raw = if outline { Raw::Outline(samples) } else { Raw::Force(samples) };
            let problem = |what: String| Problem { file: origin.0.clone(), place: origin.1, what };
            match observe(experiment, settings, &raw) {
                Ok(measured) => measured.into_iter().for_each(|(kpi, value)| {
                    let place = (name, kpi, repetition);
                    self.read_value(place, value.map_err(|reason| reason.to_string()), &origin);
                }),
                Err(error) => self.problems.push(problem(format!("cannot be read: {error}"))),
            }
        }
    }

    /// A value off a record. An extra observable that a record does not show is left out; the KPI must be there.
    fn read_value(
        &mut self,
        (name, kpi, repetition): (&'static str, &'static str, u32),
        value: Result<f64, String>,
        origin: &Origin,
    ) {
        let problem = |what: String| Problem { file: origin.0.clone(), place: origin.1, what };
        let is_kpi = observable(name, kpi).is_some_and(|observable| observable.is_kpi);
        let key = ((name, kpi), repetition);
        match value {
            Ok(_) if self.values.contains_key(&key) => {
                let what = format!("repetition {repetition} of {kpi} is given as a value too; remove one of the two");
                self.problems.push(problem(what));
            }
            Ok(value) => {
                self.values.insert(key, (value, origin.clone()));
            }
            Err(reason) if is_kpi => {
                let what = format!("the record of {name}, repetition {repetition}, gives no {kpi}: {reason}");
                self.problems.push(problem(what));
            }
            Err(_) => {}
        }
    }

    /// All rows, sorted; raw records are read as `settings` say.
    ///
    /// # Errors
    /// All problems, of single rows and of rows together.
    pub fn finish(mut self, settings: &Settings) -> Result<Rows, Problems> {
        let raw = !self.records.is_empty();
        self.read_records(settings);
        self.check_together();
        Problems::none_in(self.problems)?;
        let values = self.values.into_iter().map(|(((experiment, kpi), repetition), (value, _))| MeasuredValue {
            experiment,
            kpi,
            repetition,
            value,
        });
        Ok((values.collect(), self.summaries.into_values().map(|(summary, _)| summary).collect(), raw))
    }

    /// Per observable: two values or more, not all equal, and not a summary besides.
    fn check_together(&mut self) {
        let mut groups: BTreeMap<Quantity, Vec<&(f64, Origin)>> = BTreeMap::new();
        for ((quantity, _), entry) in &self.values {
            groups.entry(*quantity).or_default().push(entry);
        }
        for (quantity, entries) in &groups {
            let (_, (file, place)) = entries[0];
            let values: Vec<f64> = entries.iter().map(|(value, _)| *value).collect();
            let sd = summarise(quantity.0, quantity.1, &values).sd;
            let complaint = if self.summaries.contains_key(quantity) {
                Some("has single values and a summary; keep the single values")
            } else if values.len() < 2 {
                Some("was measured once; a scatter needs two repetitions or more, so add some or remove the row")
            } else if sd == 0.0 {
                Some("has the same value in every repetition; give more digits, or leave it out")
            } else if !sd.is_finite() {
                Some("has values too large for a mean and a scatter; check their units")
            } else {
                None
            };
            let what = complaint.map(|complaint| format!("{} of {} {complaint}", quantity.1, quantity.0));
            self.problems.extend(what.map(|what| Problem { file: file.clone(), place: *place, what }));
        }
    }
}

/// Which of the two kinds the header announces; every column is known, present and single.
fn columns_of(table: &RawTable) -> Result<&'static [&'static str], Problem> {
    let refuse = |what: String| Problem { file: table.file.clone(), place: table.header_place, what };
    let has = |name: &str| table.header.iter().any(|column| column == name);
    if let [only] = table.header.as_slice()
        && only.contains([';', '\t'])
    {
        return Err(refuse("columns are not separated by commas; save with commas and decimal points".to_owned()));
    }
    if has("value") && (has("mean") || has("sd")) {
        return Err(refuse("single values and summaries share a header; put them in two files".to_owned()));
    }
    let columns = if has("force") || has("time") {
        FORCE_COLUMNS
    } else if has("x") || has("z") {
        OUTLINE_COLUMNS
    } else if has("mean") || has("sd") || has("n") {
        SUMMARY_COLUMNS
    } else {
        VALUE_COLUMNS
    };
    let known = [columns, &[FREE_COLUMN]].concat();
    for (index, name) in table.header.iter().enumerate() {
        if !known.contains(&name.as_str()) {
            return Err(refuse(format!("unknown column `{name}`; {}", suggestion(name, &known))));
        }
        if table.header[..index].contains(name) {
            return Err(refuse(format!("column `{name}` stands twice; remove one")));
        }
    }
    match columns.iter().find(|column| !has(column)) {
        Some(missing) => Err(refuse(format!("column `{missing}` is missing; the columns are {}", columns.join(", ")))),
        None => Ok(columns),
    }
}

fn row_of<'t>(table: &'t RawTable, place: Place, cells: &'t [String]) -> Result<Row<'t>, Problem> {
    if cells.len() != table.header.len() {
        let (found, wanted) = (cells.len(), table.header.len());
        let what = format!("{found} cells where the header has {wanted}; fill or remove cells (decimals take a point)");
        return Err(Problem { file: table.file.clone(), place, what });
    }
    let cells = table.header.iter().map(String::as_str).zip(cells.iter().map(String::as_str)).collect();
    Ok(Row { table, place, cells })
}

/// Where the first of two equal rows stands, as seen from the second.
fn seen((file, place): &Origin, row: &Row) -> String {
    let at = match place {
        Place::Line(line) => format!("in line {line}"),
        Place::Row(number) => format!("in row {number}"),
        Place::File => "before".to_owned(),
    };
    if *file == row.table.file { at } else { format!("{at} of {file}") }
}

impl Row<'_> {
    fn problem(&self, what: String) -> Problem {
        Problem { file: self.table.file.clone(), place: self.place, what }
    }

    fn origin(&self) -> Origin {
        (self.table.file.clone(), self.place)
    }

    fn cell(&self, column: &str) -> &str {
        self.cells.get(column).copied().unwrap_or_default()
    }

    fn experiment(&self) -> Result<&'static dyn Experiment, Problem> {
        let experiment = self.cell("experiment");
        let names: Vec<_> = EXPERIMENTS.iter().map(|known| known.name()).chain([GRAINS]).collect();
        let unknown =
            || self.problem(format!("no experiment is called `{experiment}`; {}", suggestion(experiment, &names)));
        EXPERIMENTS.iter().copied().find(|known| known.name() == experiment).ok_or_else(unknown)
    }

    /// Experiment, observable and its unit.
    fn quantity(&self) -> Result<(Quantity, &'static str), Problem> {
        let kpi = self.cell("kpi");
        if self.cell("experiment") == GRAINS {
            return self.property(kpi);
        }
        let (found, experiment) = (self.experiment()?, self.cell("experiment"));
        let observables: Vec<_> = found.observables().iter().map(|known| known.name).collect();
        let stranger = || {
            let home = EXPERIMENTS.iter().find(|other| other.observables().iter().any(|known| known.name == kpi));
            let hint =
                home.map_or_else(|| suggestion(kpi, &observables), |home| format!("it belongs to {}", home.name()));
            self.problem(format!("{experiment} has no observable `{kpi}`; {hint}"))
        };
        let observable = found.observables().iter().find(|known| known.name == kpi).ok_or_else(stranger)?;
        Ok(((found.name(), observable.name), observable.unit))
    }

    /// A property of the grains that was measured by itself: a setting of the model, with its unit.
    fn property(&self, name: &str) -> Result<(Quantity, &'static str), Problem> {
        let number = |spec: &&SettingSpec| matches!(spec.kind, Kind::Number { .. }) && !spec.name.contains('.');
        let known: Vec<_> = settings::specs().filter(number).filter(|spec| spec.scope == Scope::Simulate).collect();
        let names: Vec<_> = known.iter().map(|spec| spec.name).collect();
        let stranger = || self.problem(format!("{GRAINS} have no property `{name}`; {}", suggestion(name, &names)));
        let spec = known.into_iter().find(|spec| spec.name == name).ok_or_else(stranger)?;
        Ok(((GRAINS, spec.name), spec.unit))
    }

    /// A finite number, converted from the row's unit to `unit`.
    fn number(&self, column: &str, unit: &str) -> Result<f64, Problem> {
        let (number, given) = (self.plain(column)?, self.cell("unit"));
        let what = if self.cell("kpi").is_empty() { column } else { self.cell("kpi") };
        units::convert(number, given, unit).map_err(|error| self.problem(format!("unit of {what}: {error}")))
    }

    /// The time of a sample, always in seconds.
    fn seconds(&self) -> Result<f64, Problem> {
        self.plain("time")
    }

    fn plain(&self, column: &str) -> Result<f64, Problem> {
        let text = self.cell(column);
        units::plain(text).map_err(|_| {
            self.problem(format!(
                "{column} `{text}` is not a finite number; correct it, or remove the row of a failed test"
            ))
        })
    }

    fn whole(&self, column: &str, least: u32, reason: &str) -> Result<u32, Problem> {
        let text = self.cell(column);
        let number = text.parse::<u32>().ok().filter(|number| *number >= least);
        number.ok_or_else(|| self.problem(format!("{column} `{text}` is not a whole number from {least} on; {reason}")))
    }
}
