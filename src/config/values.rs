//! Checked values by path, such as `design.interior`: what a file says, defaults included.

use crate::units;
use std::collections::BTreeMap;

/// A checked value.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// Text, name, path or chosen word.
    Text(String),
    /// true or false.
    Flag(bool),
    /// A whole number.
    Count(u64),
    /// A number in SI (angles in degrees).
    Number(f64),
    /// Chosen words.
    Words(Vec<String>),
    /// Ascending whole numbers.
    Counts(Vec<u64>),
    /// Ascending numbers.
    Numbers(Vec<f64>),
}

impl Value {
    /// Canonical text: equal values have equal texts, different ones different texts, on every machine.
    pub fn canonical(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Flag(flag) => flag.to_string(),
            Self::Count(count) => count.to_string(),
            Self::Number(number) => units::canonical(*number),
            Self::Words(words) => words.join(", "),
            Self::Counts(counts) => counts.iter().map(u64::to_string).collect::<Vec<_>>().join(", "),
            Self::Numbers(numbers) => {
                numbers.iter().map(|number| units::canonical(*number)).collect::<Vec<_>>().join(", ")
            }
        }
    }
}

/// Values by path, with the line each stands on.
///
/// The typed getters panic on a path that is not declared or has another kind: only code of this module names paths,
/// and every declared path has a value once a file was read without problems.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Values {
    entries: BTreeMap<String, (Value, usize)>,
}

impl Values {
    /// Stores a value; gives the line of an earlier one of the same path.
    pub fn insert(&mut self, path: String, value: Value, line: usize) -> Option<usize> {
        self.entries.insert(path, (value, line)).map(|(_, line)| line)
    }

    /// Whether `path` has a value.
    pub fn has(&self, path: &str) -> bool {
        self.entries.contains_key(path)
    }

    /// The line on which `path` stands, if it has a value.
    pub fn line(&self, path: &str) -> Option<usize> {
        self.entries.get(path).map(|(_, line)| *line)
    }

    /// Canonical texts of all paths that are, or lie under, one of `prefixes`.
    pub fn texts(&self, prefixes: &[&str]) -> BTreeMap<String, String> {
        let inside = |path: &str, prefix: &&str| {
            path.strip_prefix(*prefix).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        };
        let wanted = self.entries.iter().filter(|(path, _)| prefixes.iter().any(|prefix| inside(path, prefix)));
        wanted.map(|(path, (value, _))| (path.clone(), value.canonical())).collect()
    }

    /// Numbers directly under `section`, by last part of their path, sorted.
    pub fn numbers_under(&self, section: &str) -> Vec<(String, f64)> {
        let entries = self.entries.iter().filter_map(|(path, (value, _))| {
            let name = path.strip_prefix(section)?.strip_prefix('.')?;
            if let Value::Number(number) = value { Some((name.to_owned(), *number)) } else { None }
        });
        entries.collect()
    }

    pub(super) fn text(&self, path: &str) -> &str {
        match self.at(path) {
            Value::Text(text) => text,
            other => panic!("`{path}` is declared as text, not {other:?}"),
        }
    }

    pub(super) fn flag(&self, path: &str) -> bool {
        match self.at(path) {
            Value::Flag(flag) => *flag,
            other => panic!("`{path}` is declared as a flag, not {other:?}"),
        }
    }

    pub(super) fn count(&self, path: &str) -> u64 {
        match self.at(path) {
            Value::Count(count) => *count,
            other => panic!("`{path}` is declared as a count, not {other:?}"),
        }
    }

    /// A count whose declared upper bound fits in 32 bits.
    pub(super) fn count32(&self, path: &str) -> u32 {
        u32::try_from(self.count(path)).unwrap_or(u32::MAX)
    }

    pub(super) fn number(&self, path: &str) -> f64 {
        match self.at(path) {
            Value::Number(number) => *number,
            other => panic!("`{path}` is declared as a number, not {other:?}"),
        }
    }

    pub(super) fn words(&self, path: &str) -> &[String] {
        match self.at(path) {
            Value::Words(words) => words,
            other => panic!("`{path}` is declared as a list of words, not {other:?}"),
        }
    }

    pub(super) fn counts(&self, path: &str) -> &[u64] {
        match self.at(path) {
            Value::Counts(counts) => counts,
            other => panic!("`{path}` is declared as a list of counts, not {other:?}"),
        }
    }

    pub(super) fn numbers(&self, path: &str) -> &[f64] {
        match self.at(path) {
            Value::Numbers(numbers) => numbers,
            other => panic!("`{path}` is declared as a list of numbers, not {other:?}"),
        }
    }

    fn at(&self, path: &str) -> &Value {
        match self.entries.get(path) {
            Some((value, _)) => value,
            None => panic!("`{path}` is not declared"),
        }
    }
}
