//! Which module may import which: read off the `use` and `crate::` paths of every source file.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Each module may import from layers above its own, never from its own layer or below. Modules of one layer are
/// siblings that have never heard of each other.
const LAYERS: &[&[&str]] = &[
    &["units", "canonical"],
    &["rng"],
    &["stats", "dem"],
    &["settings"],
    &["effects", "experiments"],
    &["tables"],
    &["store", "config"],
    &["campaign", "report"],
    &["challenge", "stages"],
    &["pipeline"],
    &["cli"],
];

fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).expect("the source folder is there") {
        let path = entry.expect("a readable entry").path();
        match path.is_dir() {
            true => files.extend(sources(&path)),
            false if path.extension().is_some_and(|extension| extension == "rs") => files.push(path),
            false => {}
        }
    }
    files
}

/// The top-level module of a file, none for lib.rs and main.rs.
fn module(root: &Path, file: &Path) -> Option<String> {
    let relative = file.strip_prefix(root).ok()?;
    let first = relative.components().next()?.as_os_str().to_string_lossy().into_owned();
    let name = first.trim_end_matches(".rs").to_owned();
    (name != "lib" && name != "main").then_some(name)
}

/// Names after `crate::` outside comments.
fn imports(text: &str) -> Vec<String> {
    let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
    let names = code.flat_map(|line| {
        let pieces: Vec<&str> = line.split("crate::").skip(1).collect();
        pieces.into_iter().map(str::to_owned).collect::<Vec<_>>()
    });
    let identifier = |text: String| text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    names.map(identifier).filter(|name| !name.is_empty()).collect()
}

fn ranks() -> BTreeMap<&'static str, usize> {
    LAYERS.iter().enumerate().flat_map(|(rank, names)| names.iter().map(move |name| (*name, rank))).collect()
}

#[test]
fn no_module_imports_from_its_own_layer_or_below() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let ranks = ranks();
    let mut wrong = Vec::new();
    let mut seen = 0;
    for file in sources(&root) {
        let Some(name) = module(&root, &file) else { continue };
        let rank = *ranks.get(name.as_str()).unwrap_or_else(|| panic!("{name} has no layer: add it to LAYERS"));
        for import in imports(&fs::read_to_string(&file).expect("a readable source")) {
            let Some(&other) = ranks.get(import.as_str()) else { continue };
            seen += 1;
            if import != name && other >= rank {
                wrong.push(format!("{} imports {import}", file.display()));
            }
        }
    }
    assert!(seen > 100, "only {seen} imports were recognised: the test no longer sees them");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn numerics_do_no_input_or_output() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for folder in ["stats", "dem", "effects", "experiments"] {
        for file in sources(&root.join(folder)) {
            let text = fs::read_to_string(&file).expect("a readable source");
            for word in ["std::fs", "std::net", "std::env", "println!", "eprintln!", "SystemTime", "Instant"] {
                assert!(!text.contains(word), "{} uses {word}", file.display());
            }
        }
    }
}

/// Functions of f64 that call the platform's mathematical library, whose last bits differ between machines.
#[test]
fn nothing_passes_through_the_platforms_libm() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let calls = [
        ".exp()",
        ".ln()",
        ".sin()",
        ".cos()",
        ".tan()",
        ".atan()",
        ".atan2(",
        ".powf(",
        ".powi(",
        ".log10()",
        ".exp2()",
        ".log2()",
        ".ln_1p()",
        ".exp_m1()",
        ".cbrt()",
        ".hypot(",
        ".mul_add(",
        ".sinh()",
        ".cosh()",
        ".tanh()",
        ".acos()",
        ".asin()",
        "sin_cos()",
    ];
    for file in sources(&root) {
        let text = fs::read_to_string(&file).expect("a readable source");
        let body = text.split("#[cfg(test)]").next().unwrap_or_default();
        for (number, line) in body.lines().enumerate().filter(|(_, line)| !line.trim_start().starts_with("//")) {
            let call = calls.iter().find(|call| line.contains(*call));
            assert!(call.is_none(), "{}:{}: {}", file.display(), number + 1, line.trim());
        }
    }
}
