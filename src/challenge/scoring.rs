//! Scoring: a solution beside what its challenge hides.

use super::Declaration;
use crate::stats::special::{chi2_quantile, chi2_sf};
use crate::tables::list::{AttributionRow, ConfusionRow, RecalibrationRow, VerdictRow};
use std::collections::BTreeMap;

/// A solution beside the truth.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    /// What is hidden: the effect, `none` or `foreign`.
    pub truth: String,
    /// Its strength.
    pub strength: Option<f64>,
    /// Whether the effect could be named: it is among the candidates.
    pub in_library: bool,
    /// Verdict of the solution.
    pub verdict: String,
    /// Effects that the verdict names.
    pub named: Vec<String>,
    /// Strength found for the hidden effect.
    pub found: Option<f64>,
    /// Its standard error.
    pub found_sd: Option<f64>,
    /// Smallest strength that is detected with the wanted probability, if there is one.
    pub detectable: Option<f64>,
    /// What the nearest other candidate leaves of the hidden effect, in squared standard errors (D²); all of it where no
    /// other may be named.
    pub separation: Option<f64>,
    /// Whether an effect that was left out differs enough from every candidate for "none of them" to be due.
    pub decidable: Option<bool>,
    /// Whether the verdict is right.
    pub correct: bool,
}

impl Score {
    /// Whether an effect of the library is hidden that is at or above its detection limit.
    pub fn is_detectable(&self) -> bool {
        let reaches = |(strength, limit): (f64, f64)| strength.abs() >= limit.abs();
        self.in_library && self.strength.zip(self.detectable).is_some_and(reaches)
    }

    /// Whether the verdict names the hidden effect, alone or in a class.
    pub fn names_truth(&self) -> bool {
        self.named.contains(&self.truth)
    }

    /// Whether an effect of the library is hidden that no rival comes near, so that its name alone is due: D² exceeds 10. Not
    /// where it is right to see nothing.
    pub fn is_due_alone(&self) -> bool {
        let apart = self.in_library && self.separation.is_some_and(|left| left > APART);
        apart && !(self.correct && self.verdict == QUIET)
    }

    /// Whether the verdict names the hidden effect and no other.
    pub fn is_alone(&self) -> bool {
        self.verdict == "effect" && self.named == [self.truth.as_str()]
    }

    /// The verdict by what is hidden: the effect named alone, a class with it or without, the effects of a pair, or the verdict.
    pub fn answer(&self) -> String {
        match self.verdict.as_str() {
            "effect" => self.named.join("+"),
            "class" if self.names_truth() => format!("class of {} with it", self.named.len()),
            "class" => format!("class of {} without it", self.named.len()),
            "pair" => format!("pair {}", self.named.join("+")),
            other => other.to_owned(),
        }
    }

    /// How far the strength of an effect that was named is off, in its standard errors.
    pub fn off(&self) -> Option<f64> {
        let (found, sd) = self.found.zip(self.found_sd.filter(|sd| *sd > 0.0)).filter(|_| self.names_truth())?;
        Some((found - self.strength?) / sd)
    }
}

/// How far every hidden parameter is off in the standard errors of the model that holds what is hidden: the plain one where
/// that is nothing and nothing was found, the one with the effect where that is named alone; none of any other model.
pub fn parameters_off(declaration: &Declaration, score: &Score, rows: &[RecalibrationRow]) -> BTreeMap<String, f64> {
    let model = match (&declaration.effect, score.named.as_slice()) {
        (None, []) if !declaration.foreign && score.correct => "before",
        (Some((name, _)), [named]) if name == named => "after",
        _ => return BTreeMap::new(),
    };
    let of = |row: &RecalibrationRow| {
        let hidden = declaration.parameters.get(&row.name).filter(|_| row.standard_error > 0.0)?;
        Some((row.name.clone(), (row.value - hidden) / row.standard_error))
    };
    rows.iter().filter(|row| row.model == model).filter_map(of).collect()
}

/// Part of a candidate that could not be named, in the table of the attribution.
const LEFT_OUT: &str = "left_out";
/// Parts of candidates that could not be named.
const UNNAMED: [&str; 4] = [LEFT_OUT, "absorbed", "unresolved", "not_testable"];
/// Level of the leftover test, and the power that it must have.
const LEFTOVER: (f64, f64) = (0.01, 0.95);

impl Solution {
    /// The candidate that may be named and leaves least of the effect of `row` at a strength, and what it leaves, in squared
    /// standard errors: twice the expected lead, which grows with the square of the strength.
    fn nearest(&self, row: &AttributionRow, strength: f64) -> Option<(&str, f64)> {
        let scale = if row.strength == 0.0 { 0.0 } else { strength / row.strength };
        let may_be_named = |name: &str| {
            self.attribution.iter().any(|other| other.effect == name && !UNNAMED.contains(&other.part.as_str()))
        };
        let rivals = self.confusion.iter().filter(|pair| pair.effect == row.effect && may_be_named(&pair.other));
        let each = rivals.map(|pair| (pair.other.as_str(), 2.0 * pair.separation * scale * scale));
        each.min_by(|a, b| a.1.total_cmp(&b.1))
    }
}

/// Whether what the best rival leaves of an effect is seen by the leftover test: χ²(d − 1) with that as its non-centrality
/// exceeds its critical value (Patnaik's approximation of the non-central χ²).
fn is_decidable(shift: f64, dof: u32) -> bool {
    let (level, power) = LEFTOVER;
    let d = f64::from(dof.saturating_sub(1).max(1));
    let (scale, freedom) = ((d + 2.0 * shift) / (d + shift), (d + shift) * (d + shift) / (d + 2.0 * shift));
    chi2_sf(chi2_quantile(1.0 - level, d) / scale, freedom) >= power
}

/// D² to the nearest rival beyond which one name is due: a class ends where the misfits differ by 6.
const APART: f64 = 10.0;
/// The verdict that nothing is seen.
const QUIET: &str = "no_detectable_discrepancy";

/// Largest class that still counts as an answer.
const LARGEST_CLASS: usize = 3;

/// Tables of a solution that its score needs.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// The verdict.
    pub verdict: VerdictRow,
    /// What was found for every candidate.
    pub attribution: Vec<AttributionRow>,
    /// How alike the candidates look.
    pub confusion: Vec<ConfusionRow>,
}

/// Compares a solution with the declaration.
///
/// Right is: the hidden effect, or a class of at most three with it; "no detectable discrepancy" where nothing is hidden
/// or the strength is below the detection limit; "none of the candidates" where what is hidden is none of them. An effect
/// that was left out of the library and looks too much like a candidate may be taken for that one.
pub fn score(declaration: &Declaration, solution: &Solution) -> Score {
    let verdict = &solution.verdict;
    let named: Vec<String> = verdict.effects.split([',', ' ']).filter(|n| !n.is_empty()).map(str::to_owned).collect();
    let hidden = declaration.effect.as_ref();
    let row = hidden.and_then(|(name, _)| solution.attribution.iter().find(|row| row.effect == *name));
    let in_library = row.is_some_and(|row| row.part != LEFT_OUT);
    let quiet = verdict.verdict == QUIET;
    let none = verdict.verdict == "none_of_the_candidates";
    let one_or_class = matches!(verdict.verdict.as_str(), "effect" | "class") && named.len() <= LARGEST_CLASS;
    let detectable = row.and_then(|row| row.strength_90);
    let separation = hidden.zip(row).map(|((_, strength), row)| {
        // Where no candidate may be named, all of it is left.
        let whole = row.a * strength;
        solution.nearest(row, *strength).map_or(whole * whole, |(_, left)| left)
    });
    let decidable = separation.filter(|_| !in_library).map(|left| is_decidable(left, verdict.dof));
    let correct = match hidden {
        None if declaration.foreign => none,
        None => quiet,
        Some((name, strength)) if in_library => {
            let weak = detectable.is_none_or(|limit| strength.abs() < limit.abs());
            (one_or_class && named.contains(name)) || (weak && quiet)
        }
        Some((_, strength)) => {
            let nearest = row.and_then(|row| solution.nearest(row, *strength));
            let taken = nearest.is_some_and(|(name, _)| one_or_class && named.iter().any(|n| n == name));
            none || (decidable == Some(false) && (taken || quiet))
        }
    };
    Score {
        truth: hidden.map_or(if declaration.foreign { "foreign" } else { "none" }, |(name, _)| name).to_owned(),
        strength: hidden.map(|(_, strength)| *strength),
        in_library,
        separation,
        decidable,
        verdict: verdict.verdict.clone(),
        found: row.map(|row| row.strength),
        found_sd: row.map(|row| row.strength_sd),
        named,
        detectable,
        correct,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn none_of_the_candidates_is_due_where_the_leftover_test_sees_the_rest() {
        // Power of χ²(9) at 1 % (21.67): 0.95 needs a non-centrality of about 30.4 (tables of the non-central χ²).
        assert!(is_decidable(31.5, 10) && !is_decidable(29.0, 10));
    }
}
