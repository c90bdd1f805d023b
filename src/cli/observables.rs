//! What `sim` and `measure` share: settings changed on the command line, observables as JSON and as text.

use super::CliError;
use crate::experiments::{Experiment, Measurement};
use crate::settings::{Settings, spec};
use crate::units;
use serde_json::{Map, Value, json};

/// An argument of the form NAME=VALUE.
pub fn pair(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.split_once('=').ok_or("expected NAME=VALUE")?;
    Ok((name.trim().to_owned(), value.trim().to_owned()))
}

/// The settings with changes; a unit may follow a number.
///
/// # Errors
/// An unknown setting, or a value it does not take.
pub fn changed(base: &Settings, changes: &[(String, String)]) -> Result<Settings, CliError> {
    let mut settings = base.clone();
    for (name, text) in changes {
        match settings.word(name)? {
            Some(_) => settings.set_text(name, text)?,
            None => settings.set(name, units::parse(text, spec(name)?.unit)?)?,
        }
    }
    Ok(settings)
}

/// Unit of an observable.
pub fn unit(experiment: &dyn Experiment, name: &str) -> &'static str {
    experiment.observables().iter().find(|known| known.name == name).map_or("1", |known| known.unit)
}

/// Value and unit of every observable, or null and the reason.
pub fn json(experiment: &dyn Experiment, measured: &[Measurement]) -> Map<String, Value> {
    let entry = |(name, value): &Measurement| {
        let unit = unit(experiment, name);
        let entry = match value {
            Ok(value) => json!({"value": value, "unit": unit}),
            Err(reason) => json!({"value": Value::Null, "unit": unit, "reason": reason.to_string()}),
        };
        ((*name).to_owned(), entry)
    };
    measured.iter().map(entry).collect()
}

/// The same entries as one line each.
pub fn lines(entries: &Value) -> String {
    let line = |(name, entry): (&String, &Value)| {
        let unit = entry["unit"].as_str().unwrap_or_default();
        let value = match (entry["value"].as_f64(), entry["reason"].as_str()) {
            (Some(value), _) => units::format(value, unit),
            (None, reason) => format!("none: {}", reason.unwrap_or("no reason given")),
        };
        format!("  {name:<24} {value}\n")
    };
    entries.as_object().into_iter().flatten().map(line).collect()
}
