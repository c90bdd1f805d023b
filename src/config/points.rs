//! Points that somebody chose: a CSV or Parquet file with one row per point of the design or per point that is to be
//! repeated more often, as `plan --suggest` writes it.
//!
//! Columns are the parameters of the study, each value plain in SI or with a unit, and `extra_repetitions`: runs beyond
//! those that every point gets. A column `note` is free.

use super::measured::raw::{self, RawTable};
use super::problem::{Problem, Problems};
use super::types::Parameter;
use crate::units;
use std::path::Path;

/// Column of the runs beyond those that every point gets.
pub const EXTRA: &str = "extra_repetitions";
/// Column that is free.
const NOTE: &str = "note";
/// Most runs beyond those that every point gets.
const MOST: u32 = 100_000;

/// A row of the file.
#[derive(Debug, Clone, PartialEq)]
pub struct ChosenPoint {
    /// Value of every parameter, in the order of the study, within the bounds.
    pub values: Vec<f64>,
    /// Runs beyond those that every point gets.
    pub extra: u32,
}

/// Reads the points in `file` for `parameters`.
///
/// # Errors
/// Every row that cannot be taken, with its place and a remedy.
pub fn read(file: &Path, parameters: &[Parameter]) -> Result<Vec<ChosenPoint>, Problems> {
    let table = raw::read(file)?;
    let columns = columns(&table, parameters)?;
    let (mut points, mut problems) = (Vec::new(), Vec::new());
    for (place, cells) in &table.rows {
        match row(cells, parameters, &columns) {
            Ok(point) => points.push(point),
            Err(what) => problems.push(Problem { file: table.file.clone(), place: *place, what }),
        }
    }
    Problems::none_in(problems).map(|()| points)
}

/// Where the column of every parameter stands, then that of the extra repetitions.
fn columns(table: &RawTable, parameters: &[Parameter]) -> Result<Vec<usize>, Problem> {
    let refuse = |what: String| Problem { file: table.file.clone(), place: table.header_place, what };
    let names: Vec<&str> = parameters.iter().map(|parameter| parameter.name).chain([EXTRA]).collect();
    let find = |name: &&str| {
        let missing = || refuse(format!("column `{name}` is missing; the columns are {}", names.join(", ")));
        table.header.iter().position(|column| column == name).ok_or_else(missing)
    };
    if let Some(unknown) = table.header.iter().find(|name| !names.contains(&name.as_str()) && *name != NOTE) {
        return Err(refuse(format!("`{unknown}` is no parameter of this study; the columns are {}", names.join(", "))));
    }
    names.iter().map(find).collect()
}

fn row(cells: &[String], parameters: &[Parameter], columns: &[usize]) -> Result<ChosenPoint, String> {
    let cell = |column: usize| cells.get(column).map_or("", String::as_str);
    let value = |(parameter, column): (&Parameter, &usize)| {
        let value =
            units::parse(cell(*column), parameter.unit).map_err(|error| format!("{}: {error}", parameter.name))?;
        let (lower, upper) = (parameter.lower, parameter.upper);
        let shown = units::canonical;
        if (lower..=upper).contains(&value) {
            return Ok(value);
        }
        let (value, lower, upper) = (shown(value), shown(lower), shown(upper));
        Err(format!("{} = {value} lies outside the bounds {lower} to {upper}", parameter.name))
    };
    let values = parameters.iter().zip(columns).map(value).collect::<Result<Vec<f64>, String>>()?;
    let text = cell(columns[parameters.len()]);
    let extra = text.parse::<u32>().ok().filter(|extra| *extra <= MOST);
    let extra = extra.ok_or_else(|| format!("{EXTRA} `{text}` is not a whole number from 0 to {MOST}"))?;
    Ok(ChosenPoint { values, extra })
}
