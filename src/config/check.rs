//! One TOML value against its declared kind.
//!
//! Takes a value as parsed; gives a checked one, or a sentence that says what is wrong and what would be right.
//! Names of other sections (parameters, measured sets) are checked once the whole file is read.

use super::declare::{Kind, experiment_names};
use super::nearest::suggestion;
use super::values::Value;
use crate::settings::{self, Kind as SettingKind, SettingSpec};
use crate::units;
use toml::de::DeValue;

/// A sentence about what is wrong.
pub type Complaint = String;

/// Checks `value` against `kind`. `unit` is the unit of a [`Kind::Quantity`], `effects` are the names of the known ones.
///
/// # Errors
/// What is wrong and what to do.
pub fn check(value: &DeValue, kind: Kind, unit: &str, effects: &[&str]) -> Result<Value, Complaint> {
    match kind {
        Kind::Text => text(value).map(Value::Text),
        Kind::Name | Kind::Measured | Kind::Parameter => name(value, kind).map(Value::Text),
        Kind::Path => path(value).map(Value::Text),
        Kind::Unit(expected) => unit_name(value, expected).map(Value::Text),
        Kind::Flag => value.as_bool().map(Value::Flag).ok_or_else(|| expected("true or false", value)),
        Kind::Count(least, most) => count(value, least, most).map(Value::Count),
        Kind::Number(unit, lower, upper) => bounded(value, unit, lower, upper).map(Value::Number),
        Kind::Quantity => number(value, unit).map(Value::Number),
        Kind::Choice(words) => word(value, words).map(Value::Text),
        Kind::Choices(options) => words(value, options).map(Value::Words),
        Kind::Counts(least, most) => ascending(value, |item| count(item, least, most)).map(Value::Counts),
        Kind::Interval(lower, upper) => interval(value, |item| bounded(item, "1", lower, upper)).map(Value::Numbers),
        Kind::Range => interval(value, |item| number(item, unit)).map(Value::Numbers),
        Kind::Setting => setting_name(value).map(Value::Text),
        Kind::Experiment => word(value, &experiment_names()).map(Value::Text),
        Kind::Experiments => words(value, &experiment_names()).map(Value::Words),
        Kind::Effects => all_or(value, effects).map(Value::Words),
        Kind::ChoiceOrEffect(choices) => word(value, &[choices, effects].concat()).map(Value::Text),
        Kind::MeasuredSets => names_or_all(value).map(Value::Words),
        Kind::OtherSets => different(list(value)?, set_name).map(Value::Words),
    }
}

/// Checks the value of a setting of the model; gives its SI number, or the index of a word.
///
/// # Errors
/// What is wrong and what to do.
pub fn setting(value: &DeValue, spec: &SettingSpec) -> Result<f64, Complaint> {
    match spec.kind {
        SettingKind::Number { lower, upper, .. } => bounded(value, spec.unit, lower, upper),
        SettingKind::Choice { options, .. } => {
            let chosen = word(value, options)?;
            Ok(options.iter().position(|option| *option == chosen).unwrap_or_default() as f64)
        }
    }
}

/// A number within bounds, with its unit or in SI.
///
/// # Errors
/// What is wrong and what to do.
pub fn bounded(value: &DeValue, unit: &str, lower: f64, upper: f64) -> Result<f64, Complaint> {
    let number = number(value, unit)?;
    if (lower..=upper).contains(&number) {
        return Ok(number);
    }
    let shown = |bound: f64| units::canonical(bound);
    let (side, bound) = if number < lower { ("below", lower) } else { ("above", upper) };
    let unit = if unit == "1" { String::new() } else { format!(" {unit}") };
    let (number, bound) = (shown(number), shown(bound));
    Err(format!("{number}{unit} is {side} {bound}{unit}; allowed is {} to {}{unit}", shown(lower), shown(upper)))
}

/// A finite number, with its unit or in SI.
fn number(value: &DeValue, unit: &str) -> Result<f64, Complaint> {
    let text = match value {
        DeValue::String(text) => text.as_ref(),
        DeValue::Float(float) => float.as_str(),
        DeValue::Integer(integer) if integer.radix() == 10 => integer.as_str(),
        _ => return Err(expected(&units::describe(unit), value)),
    };
    units::parse(text, unit).map_err(|error| error.to_string())
}

fn count(value: &DeValue, least: u64, most: u64) -> Result<u64, Complaint> {
    let integer = value.as_integer().ok_or_else(|| expected("a whole number", value))?;
    let range = format!("allowed is {least} to {most}");
    let parsed = i128::from_str_radix(integer.as_str(), integer.radix());
    let count = parsed.map_err(|_| format!("{} is too large; {range}", integer.as_str()))?;
    let inside = u64::try_from(count).ok().filter(|count| (least..=most).contains(count));
    let side = if count < i128::from(least) { format!("below {least}") } else { format!("above {most}") };
    inside.ok_or_else(|| format!("{count} is {side}; {range}"))
}

fn text(value: &DeValue) -> Result<String, Complaint> {
    value.as_str().map(str::to_owned).ok_or_else(|| expected("a text in quotes", value))
}

fn path(value: &DeValue) -> Result<String, Complaint> {
    let path = text(value)?;
    if path.trim().is_empty() { Err("the path is empty; give one relative to this file".to_owned()) } else { Ok(path) }
}

fn unit_name(value: &DeValue, expected: &str) -> Result<String, Complaint> {
    let name = text(value)?;
    let one = units::convert(1.0, &name, expected);
    one.map(|_| name).map_err(|error| format!("{error}; give the unit alone"))
}

fn name(value: &DeValue, kind: Kind) -> Result<String, Complaint> {
    let name = text(value)?;
    let dots = kind == Kind::Parameter;
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_' || c == '-' || (dots && c == '.');
    if name.is_empty() || !name.chars().all(plain) {
        return Err(format!("`{name}` is not a name; use lower-case letters, digits, `_` and `-`"));
    }
    if kind == Kind::Name && name == "all" {
        return Err("`all` stands for every data set; use another name".to_owned());
    }
    Ok(name)
}

/// The name of a setting that is a number.
fn setting_name(value: &DeValue) -> Result<String, Complaint> {
    let name = text(value)?;
    let spec = settings::spec(&name).map_err(|error| error.to_string())?;
    match spec.kind {
        SettingKind::Number { .. } => Ok(name),
        SettingKind::Choice { .. } => {
            Err(format!("`{name}` is a choice between {}, which has no strength", spec.allowed()))
        }
    }
}

fn word(value: &DeValue, words: &[&str]) -> Result<String, Complaint> {
    let given = value.as_str().ok_or_else(|| expected(&format!("one of the words {}", words.join(", ")), value))?;
    if words.contains(&given) {
        return Ok(given.to_owned());
    }
    Err(format!("`{given}` is not one of {}; {}", words.join(", "), suggestion(given, words)))
}

fn words(value: &DeValue, options: &[&str]) -> Result<Vec<String>, Complaint> {
    different(items(value)?, |item| word(item, options))
}

fn all_or(value: &DeValue, options: &[&str]) -> Result<Vec<String>, Complaint> {
    match value.as_str() {
        Some("all") => Ok(options.iter().map(|option| (*option).to_owned()).collect()),
        Some(_) => Err(format!("{}; one name needs brackets too", expected("\"all\" or a list of names", value))),
        None => words(value, options),
    }
}

fn names_or_all(value: &DeValue) -> Result<Vec<String>, Complaint> {
    match value.as_str() {
        Some("all") => Ok(vec!["all".to_owned()]),
        Some(_) => Err(format!("{}; one name needs brackets too", expected("\"all\" or a list of names", value))),
        None => different(items(value)?, set_name),
    }
}

fn set_name(value: &DeValue) -> Result<String, Complaint> {
    name(value, Kind::Measured)
}

fn items<'v, 'd>(value: &'v DeValue<'d>) -> Result<Vec<&'v DeValue<'d>>, Complaint> {
    let items = list(value)?;
    if items.is_empty() {
        return Err("the list is empty; give at least one item, or leave the key out for the default".to_owned());
    }
    Ok(items)
}

fn list<'v, 'd>(value: &'v DeValue<'d>) -> Result<Vec<&'v DeValue<'d>>, Complaint> {
    let array = value.as_array().ok_or_else(|| expected("a list in brackets", value))?;
    Ok(array.iter().map(toml::Spanned::get_ref).collect())
}

fn different(
    items: Vec<&DeValue>,
    check: impl Fn(&DeValue) -> Result<String, Complaint>,
) -> Result<Vec<String>, Complaint> {
    let mut list: Vec<String> = Vec::new();
    for item in items {
        let item = check(item)?;
        if list.contains(&item) {
            return Err(format!("`{item}` stands twice; remove one"));
        }
        list.push(item);
    }
    Ok(list)
}

fn ascending<T: PartialOrd + Copy + std::fmt::Display>(
    value: &DeValue,
    check: impl Fn(&DeValue) -> Result<T, Complaint>,
) -> Result<Vec<T>, Complaint> {
    let list = items(value)?.into_iter().map(check).collect::<Result<Vec<T>, _>>()?;
    match list.windows(2).find(|pair| pair[0] >= pair[1]) {
        Some(pair) => Err(format!("{} stands before {}; sort the list and drop what is double", pair[0], pair[1])),
        None => Ok(list),
    }
}

fn interval(value: &DeValue, check: impl Fn(&DeValue) -> Result<f64, Complaint>) -> Result<Vec<f64>, Complaint> {
    let list = ascending(value, check)?;
    if list.len() == 2 { Ok(list) } else { Err(format!("{} items; an interval is [lower, upper]", list.len())) }
}

/// `expected X, but this is Y`.
fn expected(what: &str, value: &DeValue) -> Complaint {
    let found = match value {
        DeValue::String(text) => format!("the text \"{text}\""),
        DeValue::Integer(integer) => format!("the whole number {integer}"),
        DeValue::Float(float) => format!("the decimal number {float}"),
        DeValue::Boolean(flag) => format!("the flag {flag}"),
        DeValue::Datetime(date) => format!("the date {date}"),
        DeValue::Array(_) => "a list".to_owned(),
        DeValue::Table(_) => "a section".to_owned(),
    };
    format!("{what} is expected, but this is {found}")
}
