//! What any engine left behind: the grains at the end of a test, and the mass above the opening over time.
//!
//! Takes a CSV or Parquet file in which the header of every column carries its unit, as in `x [mm]`; gives SI, or all
//! problems with file, line and remedy. Grains have x, y, z and either radius or diameter; vx, vy and vz may be left out,
//! then they are at rest. A flow has time since the release (samples before it are negative) and mass. Columns `id`,
//! `type` and `note` are free. Deliberately moves nothing: x, y and z count from where the experiment has its origin
//! (`crate::experiments`).

use super::measured::raw::{self, RawTable};
use super::nearest::suggestion;
use super::problem::{Place, Problem, Problems};
use crate::dem::State;
use crate::units;
use std::path::Path;

const LENGTHS: [&str; 3] = ["x", "y", "z"];
const SIZES: [&str; 2] = ["radius", "diameter"];
const SPEEDS: [&str; 3] = ["vx", "vy", "vz"];
const FREE: [&str; 3] = ["id", "type", "note"];

/// The grains of a file.
///
/// # Errors
/// All problems of the file.
pub fn grains(path: &Path) -> Result<State, Problems> {
    let table = raw::read(path)?;
    let columns = Columns::new(&table, &[&LENGTHS[..], &SIZES, &SPEEDS].concat())?;
    let size = columns.size()?;
    let moving = SPEEDS.iter().any(|name| columns.has(name));
    let rows = columns.rows(|row| {
        let places = LENGTHS.map(|name| row.number(name, "m"));
        let speeds = SPEEDS.map(|name| if moving { row.number(name, "m/s") } else { Ok(0.0) });
        Ok((all(places)?, row.radius(size)?, all(speeds)?))
    })?;
    let count = rows.len();
    Ok(State {
        id: (0..).take(count).collect(),
        radius: rows.iter().map(|row| row.1).collect(),
        x: rows.iter().map(|row| row.0[0]).collect(),
        y: rows.iter().map(|row| row.0[1]).collect(),
        z: rows.iter().map(|row| row.0[2]).collect(),
        vx: rows.iter().map(|row| row.2[0]).collect(),
        vy: rows.iter().map(|row| row.2[1]).collect(),
        vz: rows.iter().map(|row| row.2[2]).collect(),
        wx: vec![0.0; count],
        wy: vec![0.0; count],
        wz: vec![0.0; count],
    })
}

/// The samples (time since the release [s], mass above the opening [kg]) of a file, in the order of time.
///
/// # Errors
/// All problems of the file.
pub fn flow(path: &Path) -> Result<Vec<(f64, f64)>, Problems> {
    let table = raw::read(path)?;
    let columns = Columns::new(&table, &["time", "mass"])?;
    let mut last = f64::NEG_INFINITY;
    columns.rows(|row| {
        let sample = (row.number("time", "s")?, row.number("mass", "kg")?);
        if sample.0 <= last {
            return Err(row.problem(format!("time {} s does not come after the row before it; sort by time", sample.0)));
        }
        last = sample.0;
        Ok(sample)
    })
}

fn all(values: [Result<f64, Problem>; 3]) -> Result<[f64; 3], Problem> {
    let [a, b, c] = values;
    Ok([a?, b?, c?])
}

/// A table whose header is known to be right: name, unit and position of every column that is read.
struct Columns<'t> {
    table: &'t RawTable,
    known: Vec<(&'t str, &'t str, usize)>,
}

impl<'t> Columns<'t> {
    fn new(table: &'t RawTable, names: &[&str]) -> Result<Self, Problem> {
        let refuse = |what: String| Problem { file: table.file.clone(), place: table.header_place, what };
        let mut known: Vec<(&str, &str, usize)> = Vec::new();
        for (index, head) in table.header.iter().enumerate() {
            let (name, unit) = match head.strip_suffix(']').and_then(|head| head.split_once('[')) {
                Some((name, unit)) => (name.trim(), unit.trim()),
                None => (head.as_str(), ""),
            };
            if FREE.contains(&name) {
                continue;
            }
            if !names.contains(&name) {
                return Err(refuse(format!("unknown column `{name}`; {}", suggestion(name, names))));
            }
            if unit.is_empty() {
                return Err(refuse(format!(
                    "column `{name}` carries no unit; write it behind the name, `{name} [mm]`"
                )));
            }
            if known.iter().any(|(other, _, _)| *other == name) {
                return Err(refuse(format!("column `{name}` stands twice; remove one")));
            }
            known.push((name, unit, index));
        }
        let has = |name: &str| known.iter().any(|(other, _, _)| *other == name);
        let some_speed = SPEEDS.iter().any(|name| has(name));
        let needed = |name: &&&str| !SIZES.contains(*name) && (some_speed || !SPEEDS.contains(*name));
        match names.iter().filter(needed).find(|name| !has(name)) {
            Some(missing) => Err(refuse(format!("column `{missing}` is missing; give it with its unit"))),
            None => Ok(Self { table, known }),
        }
    }

    fn has(&self, name: &str) -> bool {
        self.known.iter().any(|(other, _, _)| *other == name)
    }

    /// Which of radius and diameter there is, and what it is of the radius.
    fn size(&self) -> Result<(&'static str, f64), Problem> {
        match SIZES.map(|name| self.has(name)) {
            [true, false] => Ok(("radius", 1.0)),
            [false, true] => Ok(("diameter", 0.5)),
            _ => {
                let what = "give the size of the grains in one column, `radius [mm]` or `diameter [mm]`".to_owned();
                Err(Problem { file: self.table.file.clone(), place: self.table.header_place, what })
            }
        }
    }

    /// Every row as `read` takes it.
    fn rows<T>(&self, mut read: impl FnMut(&Row) -> Result<T, Problem>) -> Result<Vec<T>, Problems> {
        let refuse = |place, what: String| Problem { file: self.table.file.clone(), place, what };
        if self.table.rows.is_empty() {
            return Err(refuse(Place::File, "holds a header but no rows".to_owned()).into());
        }
        let (mut rows, mut problems) = (Vec::new(), Vec::new());
        for (place, cells) in &self.table.rows {
            let (found, wanted) = (cells.len(), self.table.header.len());
            let row = Row { columns: self, place: *place, cells };
            let taken = match found == wanted {
                true => read(&row),
                false => {
                    Err(refuse(*place, format!("{found} cells where the header has {wanted}; fill or remove cells")))
                }
            };
            match taken {
                Ok(row) => rows.push(row),
                Err(problem) => problems.push(problem),
            }
        }
        Problems::none_in(problems)?;
        Ok(rows)
    }
}

/// One row of a table.
struct Row<'t> {
    columns: &'t Columns<'t>,
    place: Place,
    cells: &'t [String],
}

impl Row<'_> {
    fn problem(&self, what: String) -> Problem {
        Problem { file: self.columns.table.file.clone(), place: self.place, what }
    }

    /// The number of a column that is there, in `unit`.
    fn number(&self, name: &str, unit: &str) -> Result<f64, Problem> {
        let found = self.columns.known.iter().find(|(other, _, _)| *other == name);
        let (_, given, index) = found.ok_or_else(|| self.problem(format!("column `{name}` is missing")))?;
        let text = &self.cells[*index];
        let number = units::plain(text).map_err(|_| {
            self.problem(format!("{name} `{text}` is not a finite number; correct it or remove the row"))
        })?;
        units::convert(number, given, unit).map_err(|error| self.problem(format!("unit of {name}: {error}")))
    }

    fn radius(&self, (name, share): (&str, f64)) -> Result<f64, Problem> {
        let size = self.number(name, "m")?;
        match size > 0.0 {
            true => Ok(share * size),
            false => Err(self.problem(format!("{name} is {size} m; a grain has a size above zero"))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(text: &str) -> (tempfile::TempDir, std::path::PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grains.csv");
        std::fs::write(&path, text).unwrap();
        (folder, path)
    }

    #[test]
    fn grains_are_read_in_any_unit_and_order() {
        let (_folder, path) = file("id,diameter [mm],z [cm],y [m],x [mm]\n7,10,1.5,0.25,-3\n9,12,2,0.5,4\n");
        let state = grains(&path).unwrap();
        // A unit is one multiplication, so only its rounding is left.
        let close = |found: &[f64], wanted: [f64; 2]| {
            found.iter().zip(wanted).all(|(found, wanted)| (found - wanted).abs() < 1e-15)
        };
        assert!(close(&state.radius, [5e-3, 6e-3]) && close(&state.x, [-3e-3, 4e-3]), "{state:?}");
        assert!(close(&state.y, [0.25, 0.5]) && close(&state.z, [0.015, 0.02]), "{state:?}");
        assert!(close(&state.vx, [0.0, 0.0]) && state.id == [0, 1]);
        let (_folder, path) = file("x [m],y [m],z [m],radius [m],vx [cm/s],vy [m/s],vz [m/s]\n0,0,0,1,50,0,-2\n");
        let state = grains(&path).unwrap();
        assert_eq!((state.vx[0], state.vz[0]), (0.5, -2.0));
    }

    #[test]
    fn bad_tables_are_refused_with_line_and_remedy() {
        let head = "x [m],y [m],z [m],radius [m]";
        let row = |row: &str| format!("{head}\n{row}\n");
        let cases = [
            (
                "x,y,z,radius\n0,0,0,1\n".to_owned(),
                "grains.csv:1: column `x` carries no unit; write it behind the name",
            ),
            ("x [m],y [m],z [m]\n0,0,0\n".to_owned(), "grains.csv:1: give the size of the grains in one column"),
            (format!("{head},diameter [m]\n0,0,0,1,2\n"), "grains.csv:1: give the size of the grains in one column"),
            ("x [m],z [m],radius [m]\n0,0,1\n".to_owned(), "grains.csv:1: column `y` is missing"),
            (format!("{head},vx [m/s]\n0,0,0,1,2\n"), "grains.csv:1: column `vy` is missing"),
            (format!("{head},radus [m]\n0,0,0,1,2\n"), "grains.csv:1: unknown column `radus`; did you mean `radius`?"),
            (format!("{head},x [m]\n0,0,0,1,2\n"), "grains.csv:1: column `x` stands twice"),
            (row("0,0,0"), "grains.csv:2: 3 cells where the header has 4"),
            (row("0,0,0,0"), "grains.csv:2: radius is 0 m; a grain has a size above zero"),
            (row("0,0,nan,1"), "grains.csv:2: z `nan` is not a finite number"),
            (row("0,0,0,1\n0,one,0,1"), "grains.csv:3: y `one` is not a finite number"),
            ("x [kg],y [m],z [m],radius [m]\n0,0,0,1\n".to_owned(), "grains.csv:2: unit of x: `0 kg` is a mass"),
            (format!("{head}\n"), "grains.csv: holds a header but no rows"),
        ];
        for (text, snippet) in cases {
            let (_folder, path) = file(&text);
            let message = grains(&path).unwrap_err().to_string();
            assert!(message.contains(snippet), "{text:?}\n  gave     {message}\n  expected {snippet}");
        }
    }

    #[test]
    fn a_flow_is_sorted_by_time() {
        let (_folder, path) = file("time [ms],mass [g]\n-10,500\n0,500\n10,480\n");
        let samples = flow(&path).unwrap();
        assert_eq!(samples.len(), 3);
        assert!((samples[0].0 + 0.01).abs() < 1e-15 && (samples[2].1 - 0.48).abs() < 1e-15);
        let (_folder, path) = file("time [s],mass [kg]\n0,1\n0,2\n");
        let message = flow(&path).unwrap_err().to_string();
        assert!(message.contains("grains.csv:3: time 0 s does not come after the row before it"), "{message}");
    }
}
