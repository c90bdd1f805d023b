//! Words for names, units and codes of the tables.
//!
//! Names are contracts (`angle_of_repose`), so they are only made readable here, never translated: putting the
//! underscores back gives the name to query for.

use super::document::Tone;

/// The four KPIs of the paper, in its order; every other observable follows them.
pub const KPIS: [&str; 4] = ["angle_of_repose", "angle_of_movement", "bulk_density", "discharge_rate"];

/// The calibrated parameters of the paper, in its order.
pub const PARAMETERS: [&str; 3] = ["sliding_friction", "rolling_friction", "particle_density"];

/// The kinds of metamodel, in the order in which they are shown.
pub const KINDS: [&str; 3] = ["ibm", "rbm", "sk"];

/// Is this observable one of the paper's KPIs?
pub fn is_kpi(name: &str) -> bool {
    KPIS.contains(&name)
}

/// Sort key that puts the paper's names first, in the paper's order, then the others by name.
pub fn rank(name: &str) -> (usize, &str) {
    let known = KPIS.iter().chain(&PARAMETERS).position(|&known| known == name);
    (known.unwrap_or(usize::MAX), name)
}

/// A name without its underscores.
pub fn label(name: &str) -> String {
    name.replace('_', " ")
}

/// A name at the start of a sentence or table row.
pub fn title(name: &str) -> String {
    let text = label(name);
    let mut letters = text.chars();
    match letters.next() {
        Some(first) => first.to_uppercase().chain(letters).collect(),
        None => text,
    }
}

/// Unit as printed beside a value: `°`, `kg/m³`; a dash for a pure number.
pub fn unit(unit: &str) -> String {
    match unit {
        "deg" => "°".to_string(),
        "1" | "" => "–".to_string(),
        other => other.replace("m3", "m³").replace("m2", "m²"),
    }
}

/// A value text with its unit.
pub fn with_unit(value: &str, unit: &str) -> String {
    match unit {
        "deg" => format!("{value}°"),
        "1" | "" => value.to_string(),
        other => format!("{value} {}", self::unit(other)),
    }
}

/// Name of a calibration as the paper writes it: `RBM-MV`.
pub fn method(kind: &str, approach: &str) -> String {
    format!("{}-{}", kind.to_uppercase(), approach.to_uppercase())
}

/// `mean`, `ln sd` or `sd`.
pub fn statistic(name: &str) -> String {
    label(name)
}

/// The verdict code in a few words.
pub fn verdict(code: &str) -> String {
    match code {
        "effect" => "effect named".to_string(),
        "class" => "class of effects".to_string(),
        "pair" => "pair of effects".to_string(),
        "not_attributable" => "not attributable at this resolution".to_string(),
        other => label(other),
    }
}

/// Colour of a verdict.
pub fn verdict_tone(code: &str) -> Tone {
    match code {
        "no_detectable_discrepancy" => Tone::Good,
        "effect" | "class" | "pair" => Tone::Strong,
        _ => Tone::Caution,
    }
}

/// The part an effect plays in the verdict, as a phrase and its colour.
pub fn part(code: &str) -> (String, Tone) {
    match code {
        "named" | "class" | "pair" => (label(code), Tone::Strong),
        "absorbed" => ("absorbed by calibration".to_string(), Tone::Muted),
        "unresolved" => ("signature not resolved".to_string(), Tone::Muted),
        "left_out" => ("left out of the library".to_string(), Tone::Muted),
        "not_testable" => ("not testable with these data".to_string(), Tone::Muted),
        other => (label(other), Tone::Plain),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paper_names_come_first_in_its_order() {
        let mut names = vec!["apex_height", "discharge_rate", "angle_of_repose", "zebra"];
        names.sort_by_key(|name| rank(name));
        assert_eq!(names, ["angle_of_repose", "discharge_rate", "apex_height", "zebra"]);
    }

    #[test]
    fn units_read_well() {
        assert_eq!(with_unit("25.4", "deg"), "25.4°");
        assert_eq!(with_unit("1473", "kg/m3"), "1473 kg/m³");
        assert_eq!(with_unit("0.55", "1"), "0.55");
        assert_eq!(title("wall_friction"), "Wall friction");
        assert_eq!(method("rbm", "mv"), "RBM-MV");
    }
}
