//! `init`: a commented study and a template for measured data.

use super::{CliError, Outcome};
use crate::config::template;
use clap::Args;
use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Write a commented pipeline.toml, the measured values of the shipped study and a template for your own.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  granulake init              into this folder
  granulake init my-study     into a new folder")]
pub struct Arguments {
    /// Folder to write to.
    #[arg(default_value = ".")]
    folder: PathBuf,
}

/// Writes the files; one that exists is never touched.
pub fn run(arguments: &Arguments) -> Result<Outcome, CliError> {
    for (path, text) in template::files() {
        create(&arguments.folder.join(path), &text)?;
    }
    eprintln!("next: granulake plan, then granulake repro");
    Ok(Outcome::Done)
}

fn create(path: &Path, text: &str) -> Result<(), CliError> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(|e| format!("cannot create {}: {e}", folder.display()))?;
    }
    let file = OpenOptions::new().write(true).create_new(true).open(path);
    let mut file =
        file.map_err(|e| format!("cannot write {}: {e}; nothing that exists is overwritten", path.display()))?;
    file.write_all(text.as_bytes())?;
    eprintln!("wrote {}", path.display());
    Ok(())
}
