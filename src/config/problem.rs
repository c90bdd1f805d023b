//! Problems: what is wrong in a file of the user, where, and what to do. All of a file's problems are told at once.

use std::fmt;

/// Most problems printed; the rest is counted.
const SHOWN: usize = 20;

/// Where in a file a problem lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Place {
    /// The file as a whole.
    File,
    /// A line of a text file, from 1.
    Line(usize),
    /// A row of a table without lines, from 1.
    Row(usize),
}

/// One problem.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// The file, as the user named it.
    pub file: String,
    /// Where in the file.
    pub place: Place,
    /// What is wrong and what to do.
    pub what: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.place {
            Place::File => write!(f, "{}: {}", self.file, self.what),
            Place::Line(line) => write!(f, "{}:{line}: {}", self.file, self.what),
            Place::Row(row) => write!(f, "{}, row {row}: {}", self.file, self.what),
        }
    }
}

/// One or more problems, in the order of their places.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problems(Vec<Problem>);

impl Problems {
    /// `Ok` when the list is empty, else all of it, sorted by file and place.
    ///
    /// # Errors
    /// The problems.
    pub fn none_in(mut problems: Vec<Problem>) -> Result<(), Self> {
        problems.sort_by(|a, b| (&a.file, a.place).cmp(&(&b.file, b.place)));
        if problems.is_empty() { Ok(()) } else { Err(Self(problems)) }
    }

    /// The problems, sorted by place; never empty.
    pub fn list(&self) -> &[Problem] {
        &self.0
    }
}

impl From<Problem> for Problems {
    fn from(problem: Problem) -> Self {
        Self(vec![problem])
    }
}

impl std::error::Error for Problems {}

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let [only] = self.0.as_slice() {
            return write!(f, "{only}");
        }
        write!(f, "{} problems:", self.0.len())?;
        self.0.iter().take(SHOWN).try_for_each(|problem| write!(f, "\n  {problem}"))?;
        match self.0.len().saturating_sub(SHOWN) {
            0 => Ok(()),
            more => write!(f, "\n  and {more} more"),
        }
    }
}
