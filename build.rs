//! Tells the binary what it was made from, for the provenance of runs: commit, compiler and target. Nothing of it
//! enters a result.

use std::env;
use std::process::Command;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    for path in ["src", "Cargo.toml", "Cargo.lock"] {
        println!("cargo:rerun-if-changed={path}");
    }
    let compiler = env::var("RUSTC").ok().and_then(|rustc| output(&rustc, &["--version"]));
    println!("cargo:rustc-env=GRANULAKE_COMMIT={}", commit().unwrap_or_else(|| "unknown".to_owned()));
    println!("cargo:rustc-env=GRANULAKE_COMPILER={}", compiler.unwrap_or_else(|| "unknown".to_owned()));
    println!("cargo:rustc-env=GRANULAKE_TARGET={}", env::var("TARGET").unwrap_or_default());
}

/// The commit of this checkout, with `+` where the sources differ from it; of a package, the one it was packed from.
fn commit() -> Option<String> {
    if let Ok(packed) = std::fs::read_to_string(".cargo_vcs_info.json") {
        return packed.split('"').find(|word| word.len() == 40).map(str::to_owned);
    }
    let head = output("git", &["rev-parse", "HEAD"])?;
    for file in ["HEAD", "logs/HEAD"] {
        if let Some(path) = output("git", &["rev-parse", "--git-path", file]) {
            println!("cargo:rerun-if-changed={path}");
        }
    }
    let clean = output("git", &["status", "--porcelain", "--", "src", "Cargo.toml", "Cargo.lock", "build.rs"])?;
    Some(if clean.is_empty() { head } else { format!("{head}+") })
}

/// What a command prints, if it succeeds.
fn output(command: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(command).args(arguments).output().ok().filter(|output| output.status.success())?;
    String::from_utf8(output.stdout).ok().map(|text| text.trim().to_owned())
}
