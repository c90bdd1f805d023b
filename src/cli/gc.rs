//! `gc`: files that nothing refers to.

use super::{CliError, Outcome};
use crate::pipeline::Study;
use crate::pipeline::integrity::{Keep, live, pin};
use crate::store::gc::{self, Garbage};
use clap::Args;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

/// List files that nothing needs any more; delete them with --delete.
///
/// Kept is what the study's lock, the locks given with --lock, the pins in artifacts/pins/ and the ledgers refer to.
/// With --unrooted the ledgers do not count: results of earlier settings, and of other studies in the same store whose
/// lock is neither given nor pinned, can go too. They are computed again when they are asked for.
/// Refused while a ledger has lost rows: `fsck` first finds out what is still needed.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  granulake gc                                   what could go, and how much
  granulake gc --delete
  granulake gc --pin submitted                   keep the results of the present lock for good
  granulake gc --unrooted --lock other/pipeline.lock
  granulake gc --unrooted --delete")]
pub struct Arguments {
    /// Only list; this is the default.
    #[arg(long, conflicts_with = "delete")]
    dry_run: bool,
    /// Delete what is listed. Refused while another granulake works in the same artifacts folder.
    #[arg(long)]
    delete: bool,
    /// Also results that only the ledgers remember.
    #[arg(long)]
    unrooted: bool,
    /// Another lock file whose results are kept.
    #[arg(long, value_name = "LOCK", alias = "keep")]
    lock: Vec<PathBuf>,
    /// Copy the present lock to artifacts/pins/NAME.lock and do nothing else.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["delete", "dry_run", "unrooted", "lock"])]
    pin: Option<String>,
}

/// Prints, and on demand deletes, what nothing refers to.
pub fn run(path: &Path, arguments: &Arguments) -> Result<Outcome, CliError> {
    let study = Study::load(path)?;
    let mut out = std::io::stdout().lock();
    if let Some(name) = &arguments.pin {
        writeln!(out, "pinned as {}", pin(&study, name)?.display())?;
        return Ok(Outcome::Done);
    }
    if arguments.delete {
        // From here on nobody else writes, so that nothing listed comes to be needed before it is deleted.
        study.store().claim()?;
    }
    let keep = if arguments.unrooted { Keep::Rooted } else { Keep::Remembered };
    let garbage = gc::find(study.store(), &live(&study, &arguments.lock, keep)?)?;
    for file in &garbage {
        writeln!(out, "{:>12}  {:<24} {}", file.bytes, file.kind.name(), file.path.display())?;
    }
    if arguments.delete {
        gc::delete(study.store(), &garbage)?;
    }
    let verb = if arguments.delete { "deleted" } else { "could be deleted" };
    for (kind, (files, bytes)) in totals(&garbage) {
        writeln!(out, "{kind}: {files} files, {}", size(bytes))?;
    }
    let bytes = garbage.iter().map(|file| file.bytes).sum();
    writeln!(out, "{} files, {} {verb}", garbage.len(), size(bytes))?;
    Ok(Outcome::Done)
}

/// Number and bytes of the files of every kind.
fn totals(garbage: &[Garbage]) -> BTreeMap<&'static str, (usize, u64)> {
    let mut totals: BTreeMap<&'static str, (usize, u64)> = BTreeMap::new();
    for file in garbage {
        let (files, bytes) = totals.entry(file.kind.name()).or_default();
        *files += 1;
        *bytes += file.bytes;
    }
    totals
}

/// Bytes in the largest unit that leaves a number of at least one.
fn size(bytes: u64) -> String {
    const UNITS: [(u64, &str); 3] = [(1 << 30, "GiB"), (1 << 20, "MiB"), (1 << 10, "KiB")];
    match UNITS.iter().find(|(unit, _)| bytes >= *unit) {
        Some((unit, name)) => format!("{:.1} {name}", bytes as f64 / *unit as f64),
        None => format!("{bytes} bytes"),
    }
}

#[cfg(test)]
mod tests {
    use super::size;

    #[test]
    fn sizes_are_told_in_units_a_person_reads() {
        assert_eq!([0, 1023, 1024, 1 << 21].map(size), ["0 bytes", "1023 bytes", "1.0 KiB", "2.0 MiB"]);
    }
}
