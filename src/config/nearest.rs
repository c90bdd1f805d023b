//! Nearest names: what a user probably meant.

use crate::settings::edit_distance;

/// The candidate with the fewest edits, if few enough to be a slip of the fingers: at most two, or a third of the name.
/// Upper and lower case and hyphens for underscores cost nothing; the first candidate wins a tie.
pub fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let plain = |text: &str| text.to_lowercase().replace('-', "_");
    let limit = (name.chars().count() / 3).max(2);
    let distance = |candidate: &&str| edit_distance(&plain(name), &plain(candidate));
    candidates.into_iter().min_by_key(distance).filter(|best| distance(best) <= limit)
}

/// The end of a message about an unknown name: the nearest one, else all.
pub fn suggestion(name: &str, candidates: &[&str]) -> String {
    match nearest(name, candidates.iter().copied()) {
        Some(best) => format!("did you mean `{best}`?"),
        None if candidates.is_empty() => "there is none".to_owned(),
        None => format!("there are: {}", candidates.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_are_found_and_strangers_are_not() {
        let names = ["interior", "boundary_levels", "validation"];
        assert_eq!(nearest("interor", names), Some("interior"));
        assert_eq!(nearest("Boundary-Levels", names), Some("boundary_levels"));
        assert_eq!(nearest("weights", names), None);
        assert_eq!(suggestion("weights", &names), "there are: interior, boundary_levels, validation");
        assert_eq!(suggestion("weights", &[]), "there is none");
    }
}
