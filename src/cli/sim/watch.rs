//! What `sim` writes while a run goes on: frames for ParaView, a trace of its energies, checkpoints.
//!
//! Looks at a run and never changes it, so its bits are the same with and without.

use super::vtk::Series;
use crate::cli::CliError;
use crate::dem::{Energies, Simulation, World};
use crate::store::atomic;
use crate::tables::columns::{Column, ColumnFile};
use crate::units;
use clap::Args;
use std::path::PathBuf;

/// What to write on the way.
#[derive(Debug, Args)]
pub struct Options {
    /// Write the grains as a file series for ParaView into this folder (grains.pvd).
    #[arg(long, value_name = "DIR")]
    vtk: Option<PathBuf>,
    /// Write energies, mass, contacts and overlap over time into this Parquet file.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Write all of the run's state into this file, each time in place of the last, for --resume.
    #[arg(long, value_name = "FILE")]
    checkpoint: Option<PathBuf>,
    /// Simulated time between two frames, rows of the trace, and checkpoints.
    #[arg(long, value_name = "TIME", default_value = "0.02 s", value_parser = interval)]
    every: f64,
}

fn interval(text: &str) -> Result<f64, String> {
    let time = units::parse(text, "s").map_err(|e| e.to_string())?;
    if time > 0.0 { Ok(time) } else { Err("give a time above zero, such as `10 ms`".to_owned()) }
}

/// A watch over one run.
pub struct Watch<'a> {
    options: &'a Options,
    frames: Option<Series>,
    rows: Vec<Row>,
    /// Time of the next look [s].
    next: f64,
}

/// One row of the trace.
struct Row {
    time: f64,
    energies: Energies,
    mass: f64,
    grains: u32,
    contacts: u32,
    max_overlap: f64,
}

impl<'a> Watch<'a> {
    /// A watch that has not looked yet.
    pub fn new(options: &'a Options) -> Self {
        Self { options, frames: options.vtk.clone().map(Series::new), rows: Vec::new(), next: 0.0 }
    }

    /// Looks at the run if it is time to.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn look(&mut self, run: &Simulation) -> Result<(), CliError> {
        let time = run.time();
        if time < self.next {
            return Ok(());
        }
        self.next = self.options.every * ((time / self.options.every).floor() + 1.0);
        self.record(run)?;
        match &self.options.checkpoint {
            Some(path) => Ok(atomic::publish(path, run.checkpoint().as_bytes())?),
            None => Ok(()),
        }
    }

    /// Adds the run as it is to frames and trace.
    fn record(&mut self, run: &Simulation) -> Result<(), CliError> {
        let world = run.world();
        if let Some(frames) = &mut self.frames {
            frames.add(&world.state(), run.time())?;
        }
        if self.options.trace.is_some() {
            self.rows.push(row(run, world));
        }
        Ok(())
    }

    /// Takes the end of the run, good or bad, and writes the trace.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn finish(mut self, run: &Simulation) -> Result<(), CliError> {
        self.record(run)?;
        match &self.options.trace {
            Some(path) => Ok(atomic::publish(path, &trace_bytes(&self.rows)?)?),
            None => Ok(()),
        }
    }
}

fn row(run: &Simulation, world: &World) -> Row {
    let region = run.setup().trace.as_ref().map_or(run.setup().domain, |trace| trace.region);
    Row {
        time: run.time(),
        energies: world.energies(),
        mass: world.mass_in(&region),
        grains: world.len() as u32,
        contacts: world.contacts().len() as u32,
        max_overlap: world.max_overlap(),
    }
}

/// The trace as Parquet bytes, units in the metadata of the columns.
fn trace_bytes(rows: &[Row]) -> Result<Vec<u8>, CliError> {
    // A run that exploded may hold no numbers at its end.
    let rows: Vec<&Row> = rows.iter().filter(|row| row.energies.total().is_finite()).collect();
    let number = |name: &str, unit: &str, value: fn(&Row) -> f64| {
        Column::f64(name, unit, rows.iter().map(|row| value(row)).collect())
    };
    let columns = vec![
        number("time", "s", |row| row.time),
        number("translational_energy", "J", |row| row.energies.translational),
        number("rotational_energy", "J", |row| row.energies.rotational),
        number("elastic_energy", "J", |row| row.energies.elastic),
        number("potential_energy", "J", |row| row.energies.potential),
        number("mass", "kg", |row| row.mass),
        Column::u32("grains", "1", rows.iter().map(|row| row.grains).collect()),
        Column::u32("contacts", "1", rows.iter().map(|row| row.contacts).collect()),
        number("max_overlap", "1", |row| row.max_overlap),
    ];
    Ok(ColumnFile::new("run_trace", columns)?.to_parquet_bytes("run_trace")?)
}
