//! The JSON Schema of pipeline.toml, from the declaration that the reader checks against and the list of settings.
//!
//! Editors that know the `#:schema` line complete and explain every key. Draft 7, the one TOML editors read.

use super::declare::{BOTH, DENSITY, Key, Kind, SECTIONS, Section, Shape, effect_names, experiment_names, kpi_names};
use crate::effects::EFFECTS;
use crate::settings::{self, Kind as SettingKind, SettingSpec};
use serde_json::{Map, Value, json};
use toml::de::DeValue;

/// A text with a unit stands wherever a number does.
const QUANTITY: [&str; 2] = ["number", "string"];

/// The schema as text, ending with a line feed; the same on every machine and with any set of features.
pub fn text() -> String {
    let sections: Vec<(String, Value)> = SECTIONS
        .iter()
        .filter(|section| !section.path.contains('.'))
        .map(|section| (section.path.to_owned(), of_section(section)))
        .collect();
    let required = ["study", "parameters", "measured"];
    let mut root = closed(sections, &required);
    insert(&mut root, "$schema", json!("http://json-schema.org/draft-07/schema#"));
    insert(&mut root, "title", json!("A granulake study"));
    let mut text = serde_json::to_string_pretty(&sorted(root)).unwrap_or_default();
    text.push('\n');
    text
}

fn of_section(section: &Section) -> Value {
    let mut schema = match section.shape {
        Shape::Table(keys) => table(section.path, keys),
        Shape::Effects(keys, declared) => {
            let mut schema = table(section.path, keys);
            insert(&mut schema, "additionalProperties", table("", declared));
            schema
        }
        Shape::Parameters(keys) => json!({
            "type": "object",
            "minProperties": 1,
            "propertyNames": { "enum": number_settings() },
            "properties": { DENSITY: both_or_none(table("", keys)) },
            "additionalProperties": table("", keys),
        }),
        Shape::List(_, keys) => json!({ "type": "array", "items": table("", keys) }),
        Shape::Settings => setup(),
        Shape::Weights => map(kpi_names().into_iter().map(|name| (name, json!({ "type": QUANTITY, "minimum": 0 })))),
        Shape::Strengths => open(map(EFFECTS.iter().map(|effect| {
            let (lower, upper) = effect.range();
            let meaning = format!("{} [{}]", effect.meaning(), effect.unit());
            (effect.name(), json!({ "type": QUANTITY, "minimum": lower, "maximum": upper, "description": meaning }))
        }))),
    };
    insert(&mut schema, "description", json!(section.meaning));
    schema
}

fn table(path: &str, keys: &[Key]) -> Value {
    let nested = SECTIONS.iter().filter_map(|section| {
        let name = section.path.strip_prefix(path)?.strip_prefix('.').filter(|_| !path.is_empty())?;
        Some((name.to_owned(), of_section(section)))
    });
    let properties = keys.iter().map(|key| (key.name.to_owned(), of_key(key))).chain(nested).collect();
    let required: Vec<&str> = keys.iter().filter(|key| key.default.is_none()).map(|key| key.name).collect();
    closed(properties, &required)
}

fn of_key(key: &Key) -> Value {
    let mut schema = of_kind(key.kind);
    insert(&mut schema, "description", json!(key.meaning));
    if let Some(Ok(default)) = key.default.map(DeValue::parse) {
        insert(&mut schema, "default", plain(default.get_ref()));
    }
    schema
}

fn of_kind(kind: Kind) -> Value {
    const NAME: &str = "^[a-z0-9_.-]+$";
    let list = |items: Value| json!({ "type": "array", "items": items, "minItems": 1, "uniqueItems": true });
    let all_or = |items: Value| json!({ "anyOf": [{ "const": "all" }, list(items)] });
    match kind {
        Kind::Text => json!({ "type": "string" }),
        Kind::Path | Kind::Unit(_) => json!({ "type": "string", "minLength": 1 }),
        Kind::Name | Kind::Measured => json!({ "type": "string", "pattern": NAME }),
        Kind::Parameter => json!({ "enum": number_settings() }),
        Kind::Flag => json!({ "type": "boolean" }),
        Kind::Count(least, most) => json!({ "type": "integer", "minimum": least, "maximum": most }),
        Kind::Number(_, lower, upper) => json!({ "type": QUANTITY, "minimum": lower, "maximum": upper }),
        Kind::Quantity => json!({ "type": QUANTITY }),
        Kind::Choice(words) => json!({ "enum": words }),
        Kind::Choices(words) => list(json!({ "enum": words })),
        Kind::Counts(least, most) => list(json!({ "type": "integer", "minimum": least, "maximum": most })),
        Kind::Interval(lower, upper) => {
            let bound = json!({ "type": "number", "minimum": lower, "maximum": upper });
            json!({ "type": "array", "items": bound, "minItems": 2, "maxItems": 2 })
        }
        Kind::Experiment => json!({ "enum": experiment_names() }),
        Kind::Experiments => list(json!({ "enum": experiment_names() })),
        Kind::Effects => all_or(effect(&[])),
        Kind::ChoiceOrEffect(words) => effect(words),
        Kind::Range => {
            json!({ "type": "array", "items": { "type": QUANTITY }, "minItems": 2, "maxItems": 2 })
        }
        Kind::Setting => json!({ "enum": number_settings() }),
        Kind::MeasuredSets => all_or(json!({ "type": "string", "pattern": NAME })),
        Kind::OtherSets => {
            json!({ "type": "array", "items": { "type": "string", "pattern": NAME }, "uniqueItems": true })
        }
    }
}

/// The same section of a parameter, which may leave out both bounds.
fn both_or_none(mut schema: Value) -> Value {
    if let Some(object) = schema.as_object_mut() {
        object.remove("required");
    }
    let [lower, upper] = BOTH;
    insert(&mut schema, "dependencies", json!({ lower: [upper], upper: [lower] }));
    schema
}

/// One of `words`, a built-in effect, or the name of a declared one.
fn effect(words: &[&str]) -> Value {
    let known = [words, &effect_names()].concat();
    json!({ "anyOf": [{ "enum": known }, { "type": "string", "pattern": "^[a-z0-9_]+$" }] })
}

/// The same object, which also takes numbers under the names of declared effects.
fn open(mut schema: Value) -> Value {
    insert(&mut schema, "additionalProperties", json!({ "type": QUANTITY }));
    schema
}

/// `[setup]`: bare settings, and a table per experiment for the others.
fn setup() -> Value {
    let bare = settings::specs().filter(|spec| !spec.name.contains('.')).map(|spec| (spec.name, of_setting(spec)));
    let owned = experiment_names().into_iter().map(|experiment| {
        let inner = settings::specs().filter_map(|spec| {
            let name = spec.name.strip_prefix(experiment)?.strip_prefix('.')?;
            Some((name, of_setting(spec)))
        });
        (experiment, map(inner))
    });
    map(bare.chain(owned))
}

fn of_setting(spec: &SettingSpec) -> Value {
    let doubt = if spec.assumption { "; assumption" } else { "" };
    let meaning = format!("{} [{}] ({}{doubt})", spec.meaning, spec.unit, spec.source);
    match spec.kind {
        SettingKind::Number { default, lower, upper } => json!({
            "type": QUANTITY, "minimum": lower, "maximum": upper, "default": default, "description": meaning,
        }),
        SettingKind::Choice { options, default } => {
            json!({ "enum": options, "default": options.get(default), "description": meaning })
        }
    }
}

fn number_settings() -> Vec<&'static str> {
    settings::specs().filter(|spec| matches!(spec.kind, SettingKind::Number { .. })).map(|spec| spec.name).collect()
}

fn map<'n>(properties: impl Iterator<Item = (&'n str, Value)>) -> Value {
    closed(properties.map(|(name, schema)| (name.to_owned(), schema)).collect(), &[])
}

/// An object that takes no other properties.
fn closed(properties: Vec<(String, Value)>, required: &[&str]) -> Value {
    let properties: Map<String, Value> = properties.into_iter().collect();
    let mut schema = json!({ "type": "object", "additionalProperties": false, "properties": properties });
    if !required.is_empty() {
        insert(&mut schema, "required", json!(required));
    }
    schema
}

fn insert(schema: &mut Value, name: &str, value: Value) {
    if let Some(object) = schema.as_object_mut() {
        object.insert(name.to_owned(), value);
    }
}

/// The same value with the names of every object sorted: whether a map keeps the order of insertion depends on features.
fn sorted(value: Value) -> Value {
    match value {
        Value::Object(object) => {
            let mut entries: Vec<(String, Value)> =
                object.into_iter().map(|(name, value)| (name, sorted(value))).collect();
            entries.sort_by(|a, b| a.0.cmp(&b.0));
            Value::Object(entries.into_iter().collect())
        }
        Value::Array(items) => Value::Array(items.into_iter().map(sorted).collect()),
        other => other,
    }
}

/// A TOML default as JSON.
fn plain(value: &DeValue) -> Value {
    match value {
        DeValue::String(text) => json!(text),
        DeValue::Boolean(flag) => json!(flag),
        DeValue::Integer(integer) => json!(integer.as_str().parse::<i64>().unwrap_or_default()),
        DeValue::Float(float) => json!(float.as_str().parse::<f64>().unwrap_or_default()),
        DeValue::Array(items) => items.iter().map(|item| plain(item.get_ref())).collect(),
        _ => Value::Null,
    }
}
