//! Who is taken for whom: answers counted over what was hidden.

use std::collections::{BTreeMap, BTreeSet};

/// Columns that follow the effects named alone.
const LAST: [&str; 5] =
    ["a class with it", "another class", "a pair with it", "another pair", "none of the candidates"];
/// The first column.
const FIRST: &str = "no detectable discrepancy";

/// Counts of answers, one row for everything that was hidden.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ConfusionMatrix {
    rows: BTreeMap<String, BTreeMap<String, usize>>,
}

impl ConfusionMatrix {
    /// Counts answers ([`super::Score::answer`]) to the hidden effect `truth`, in the row `hidden`.
    pub fn add(&mut self, hidden: &str, truth: &str, answer: &str, count: usize) {
        *self.rows.entry(hidden.to_owned()).or_default().entry(column(answer, truth)).or_default() += count;
    }

    /// Heads of the columns: nothing, every effect that was named alone, then the answers of more or less than one.
    pub fn columns(&self) -> Vec<&str> {
        let seen: BTreeSet<&str> = self.rows.values().flat_map(|row| row.keys().map(String::as_str)).collect();
        let alone = seen.into_iter().filter(|column| *column != FIRST && !LAST.contains(column));
        [FIRST].into_iter().chain(alone).chain(LAST).collect()
    }

    /// What was hidden, and the counts of all columns.
    pub fn rows(&self) -> impl Iterator<Item = (&str, Vec<usize>)> {
        let columns = self.columns();
        self.rows.iter().map(move |(hidden, counts)| {
            let of = |column: &&str| counts.get(*column).copied().unwrap_or(0);
            (hidden.as_str(), columns.iter().map(of).collect())
        })
    }
}

/// The column of an answer to the hidden effect `truth`.
fn column(answer: &str, truth: &str) -> String {
    match answer.split_once(' ') {
        Some(("class", rest)) if rest.ends_with(" with it") => "a class with it".to_owned(),
        Some(("class", _)) => "another class".to_owned(),
        Some(("pair", pair)) if pair.split('+').any(|name| name == truth) => "a pair with it".to_owned(),
        Some(("pair", _)) => "another pair".to_owned(),
        _ => answer.replace('_', " "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_stand_in_the_column_that_the_truth_gives_them() {
        let mut matrix = ConfusionMatrix::default();
        for (answer, count) in [
            ("no_detectable_discrepancy", 1),
            ("fill_level", 2),
            ("tilt", 3),
            ("class of 2 with it", 4),
            ("class of 3 with it", 5),
            ("class of 2 without it", 6),
            ("pair cohesion+tilt", 7),
            ("pair cohesion+fill_level", 8),
            ("none_of_the_candidates", 9),
        ] {
            matrix.add("tilt 2", "tilt", answer, count);
        }
        matrix.add("none", "none", "no_detectable_discrepancy", 10);
        assert_eq!(matrix.columns()[..3], ["no detectable discrepancy", "fill level", "tilt"]);
        assert_eq!(matrix.columns()[3..], LAST);
        let rows: Vec<_> = matrix.rows().collect();
        assert_eq!(rows, [("none", vec![10, 0, 0, 0, 0, 0, 0, 0]), ("tilt 2", vec![1, 2, 3, 9, 6, 7, 8, 9])]);
    }
}
