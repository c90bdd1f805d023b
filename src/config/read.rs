//! Reads the text of pipeline.toml against its declaration.
//!
//! Takes the text; gives checked values by path, settings of the model, and every problem found, each with its line.
//! It reads one section after the other and knows nothing of how they fit together; `cross` does.

use super::check::{Complaint, bounded, check, setting};
use super::declare::{BOTH, DENSITY, Key, SECTIONS, Section, Shape, effect_names, experiment_names, kpi_names};
use super::nearest::{nearest, suggestion};
use super::problem::{Place, Problem};
use super::types::DensityBounds;
use super::values::{Value, Values};
use crate::effects::{Declared, Library, Way};
use crate::experiments::{EXPERIMENTS, Experiment};
use crate::settings::{self, SettingSpec, Settings};
use std::collections::BTreeMap;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// What a file says.
#[derive(Debug, Clone, Default)]
pub struct Reading {
    /// Checked values by path.
    pub values: Values,
    /// Defaults of the full-scale study with the file's overrides.
    pub settings: Settings,
    /// Lines of the settings that the file overrides.
    pub overrides: BTreeMap<&'static str, usize>,
    /// Names of the parameters, sorted.
    pub parameters: Vec<String>,
    /// Line of the section of [`DENSITY`] where it gives no bounds.
    pub unbounded: Option<usize>,
    /// Identities of the items of every list section, in the order of the file.
    pub lists: BTreeMap<&'static str, Vec<String>>,
    /// Names of the effects that the study declares.
    pub declared: Vec<String>,
    /// Built-in and declared effects.
    pub library: Library,
    /// What is wrong.
    pub problems: Vec<Problem>,
}

impl Reading {
    /// The line of `path`; that of its section for bounds which the section leaves out.
    pub fn line(&self, path: &str) -> Option<usize> {
        let of_density = || path.strip_prefix("parameters.").is_some_and(|rest| rest.starts_with(DENSITY));
        self.values.line(path).or_else(|| self.unbounded.filter(|_| of_density()))
    }

    /// The experiments whose KPIs are fitted, in the order in which experiments are registered.
    pub fn fitted(&self) -> Vec<&'static dyn Experiment> {
        let names = self.values.words("experiments.fitted");
        EXPERIMENTS.iter().copied().filter(|experiment| names.iter().any(|name| name == experiment.name())).collect()
    }

    /// Where the bounds of the particle density come from.
    pub fn density_bounds(&self) -> DensityBounds {
        match (self.parameters.iter().any(|name| name == DENSITY), self.unbounded) {
            (false, _) => DensityBounds::NotCalibrated,
            (true, None) => DensityBounds::Given,
            (true, Some(_)) if BOTH.iter().all(|key| self.values.has(&format!("parameters.{DENSITY}.{key}"))) => {
                DensityBounds::Found
            }
            (true, Some(_)) => DensityBounds::Sought,
        }
    }
}

/// Reads `document`, the text of `file`.
pub fn read(document: &str, file: &str) -> Reading {
    let mut reader = Reader { document, file, reading: Reading::default() };
    match DeTable::parse(document) {
        Ok(root) => reader.root(root.get_ref()),
        Err(error) => {
            let start = error.span().map_or(0, |span| span.start);
            reader.problem(
                start,
                format!("{}; see toml.io for how the file is written", error.message().replace('\n', "; ")),
            );
        }
    }
    reader.reading
}

struct Reader<'d> {
    document: &'d str,
    file: &'d str,
    reading: Reading,
}

type Item<'d> = Spanned<DeValue<'d>>;

impl<'d> Reader<'d> {
    fn problem(&mut self, at: usize, what: String) {
        let place = Place::Line(self.line(at));
        self.reading.problems.push(Problem { file: self.file.to_owned(), place, what });
    }

    fn line(&self, at: usize) -> usize {
        self.document.bytes().take(at).filter(|byte| *byte == b'\n').count() + 1
    }

    fn root(&mut self, root: &DeTable<'d>) {
        self.reading.declared = declared_names(root);
        let top: Vec<&str> = SECTIONS.iter().map(|section| section.path).filter(|path| !path.contains('.')).collect();
        self.refuse_unknown(root, "section", &top);
        for section in SECTIONS {
            let (at, item) = match section.path.split_once('.') {
                None => (0, root.get(section.path)),
                Some((outer, inner)) => inside(root, outer, inner),
            };
            match (section.shape, item) {
                (Shape::List(identity, keys), item) => self.list(section.path, identity, keys, item),
                (shape, Some(item)) => match item.get_ref().as_table() {
                    Some(table) => self.section(section.path, shape, table, item.span().start),
                    None => self.problem(item.span().start, not_a_section(section.path)),
                },
                (shape, None) => self.section(section.path, shape, &DeTable::new(), at),
            }
        }
    }

    fn section(&mut self, path: &str, shape: Shape, table: &DeTable<'d>, at: usize) {
        match shape {
            Shape::Table(keys) => self.table(path, keys, table, at, "1"),
            Shape::Parameters(keys) => self.parameters(path, keys, table),
            Shape::Settings => self.setup(table),
            Shape::Weights => self.weights(path, table),
            Shape::Strengths => self.strengths(path, table),
            Shape::Effects(keys, declared) => self.effects(path, (keys, declared), table, at),
            Shape::List(..) => {}
        }
    }

    /// A section with declared keys; sections within it are read by themselves.
    fn table(&mut self, path: &str, keys: &[Key], table: &DeTable<'d>, at: usize, unit: &str) {
        let nested = SECTIONS.iter().filter_map(|section| section.path.strip_prefix(path)?.strip_prefix('.'));
        let known: Vec<&str> = keys.iter().map(|key| key.name).chain(nested).collect();
        self.refuse_unknown(table, "key", &known);
        for key in keys {
            self.key(&format!("{path}.{}", key.name), key, table, at, unit);
        }
    }

    fn key(&mut self, path: &str, key: &Key, table: &DeTable<'d>, at: usize, unit: &str) {
        let (at, checked) = match (table.get(key.name), key.default) {
            (Some(item), _) => (item.span().start, check(item.get_ref(), key.kind, unit, &self.effect_names())),
            (None, Some(default)) => (at, checked_default(key, default, unit, &self.effect_names())),
            (None, None) => (at, Err(format!("key is missing; add it ({})", key.meaning))),
        };
        match checked {
            Ok(value) => self.store(path, value, at),
            Err(complaint) => self.problem(at, format!("`{path}`: {complaint}")),
        }
    }

    fn store(&mut self, path: &str, value: Value, at: usize) {
        let line = self.line(at);
        if let Some(first) = self.reading.values.insert(path.to_owned(), value, line) {
            self.problem(at, format!("`{path}` stands twice, first in line {first}; remove one"));
        }
    }

    /// Sections `[path.NAME]`, where NAME is a number among the settings, its dot quoted or not.
    fn parameters(&mut self, path: &str, keys: &[Key], table: &DeTable<'d>) {
        for (name, item) in table {
            let (at, name) = (name.span().start, name.get_ref().as_ref());
            match item.get_ref().as_table().filter(|_| experiment_names().contains(&name)) {
                None => self.parameter(path, name, keys, (item.get_ref(), at)),
                Some(inner) => inner.iter().for_each(|(key, item)| {
                    let (at, name) = (key.span().start, format!("{name}.{}", key.get_ref()));
                    self.parameter(path, &name, keys, (item.get_ref(), at));
                }),
            }
        }
        self.reading.parameters.sort();
    }

    fn parameter(&mut self, path: &str, name: &str, keys: &[Key], (value, at): (&DeValue<'d>, usize)) {
        let full = format!("{path}.{name}");
        match (value.as_table(), number_setting(name)) {
            (None, _) => self.problem(at, not_a_section(&full)),
            (_, Err(complaint)) => self.problem(at, format!("`{full}`: {complaint}")),
            (Some(_), Ok(_)) if self.reading.parameters.iter().any(|known| known == name) => {
                self.problem(at, format!("`{full}` stands twice; remove one"));
            }
            (Some(table), Ok(spec)) => {
                self.reading.parameters.push(name.to_owned());
                let keys = if name == DENSITY { self.keys_of_density(keys, table, at) } else { keys.to_vec() };
                self.table(&full, &keys, table, at, spec.unit);
            }
        }
    }

    /// The keys that the section of the density must give: all, or all but the two bounds.
    fn keys_of_density(&mut self, keys: &[Key], table: &DeTable<'d>, at: usize) -> Vec<Key> {
        let missing: Vec<&str> = BOTH.into_iter().filter(|key| table.get(*key).is_none()).collect();
        match missing[..] {
            [] => return keys.to_vec(),
            [one] => self.problem(
                at,
                format!(
                    "`parameters.{DENSITY}.{one}`: key is missing; add it, or leave out both bounds to have the stage \
                     `bounds` find them by simulation"
                ),
            ),
            _ => self.reading.unbounded = Some(self.line(at)),
        }
        keys.iter().filter(|key| !missing.contains(&key.name)).copied().collect()
    }

    /// Items `[[path]]`; the values of the identity keys, joined by dots, stand for the item in paths.
    fn list(&mut self, path: &'static str, identity: &[&str], keys: &[Key], item: Option<&Item<'d>>) {
        self.reading.lists.insert(path, Vec::new());
        let Some(item) = item else { return };
        let Some(array) = item.get_ref().as_array() else {
            let what = format!("`{path}` is written with two brackets, one [[{path}]] per item");
            return self.problem(item.span().start, what);
        };
        for (index, item) in array.iter().enumerate() {
            match item.get_ref().as_table() {
                Some(table) => self.list_item(path, identity, keys, (table, item.span().start, index)),
                None => {
                    self.problem(item.span().start, format!("`{path}` holds sections; write one [[{path}]] per item"))
                }
            }
        }
    }

    fn list_item(
        &mut self,
        path: &'static str,
        identity: &[&str],
        keys: &[Key],
        (table, at, index): (&DeTable<'d>, usize, usize),
    ) {
        let word = |key: &&str| table.get(*key).and_then(|item| item.get_ref().as_str()).map(str::to_owned);
        let id = identity
            .iter()
            .map(word)
            .collect::<Option<Vec<_>>>()
            .map_or_else(|| (index + 1).to_string(), |words| words.join("."));
        if self.reading.lists.get(path).is_some_and(|ids| ids.contains(&id)) {
            return self.problem(
                at,
                format!("a second [[{path}]] for `{id}`; give it another {} or remove it", identity.join(" or ")),
            );
        }
        self.reading.lists.entry(path).or_default().push(id.clone());
        let named = ["parameter", "setting"].iter().find_map(word);
        let unit = named.and_then(|name| settings::spec(&name).ok()).map_or("1", |spec| spec.unit);
        self.table(&format!("{path}.{id}"), keys, table, at, unit);
    }

    /// `[setup]` and `[setup.EXPERIMENT]`.
    fn setup(&mut self, table: &DeTable<'d>) {
        let experiments = experiment_names();
        for (name, item) in table {
            match item.get_ref().as_table() {
                Some(inner) => self.setup_of(name, inner, &experiments),
                None => self.setting(name.get_ref(), name.span().start, item.get_ref()),
            }
        }
        for spec in settings::specs() {
            let line = self.reading.overrides.get(spec.name).copied().unwrap_or(1);
            let text = self.reading.settings.text(spec.name).unwrap_or_default();
            self.reading.values.insert(format!("setup.{}", spec.name), Value::Text(text), line);
        }
    }

    fn setup_of(&mut self, name: &Spanned<std::borrow::Cow<'d, str>>, table: &DeTable<'d>, experiments: &[&str]) {
        let experiment = name.get_ref().as_ref();
        if !experiments.contains(&experiment) {
            let what = format!("`setup.{experiment}` is not an experiment; {}", suggestion(experiment, experiments));
            return self.problem(name.span().start, what);
        }
        for (key, item) in table {
            let (at, bare) = (key.span().start, key.get_ref().as_ref());
            let full = format!("{experiment}.{bare}");
            if settings::spec(&full).is_err() && settings::spec(bare).is_ok() {
                self.problem(at, format!("`setup.{full}`: `{bare}` is shared by the experiments; move it to [setup]"));
            } else {
                self.setting(&full, at, item.get_ref());
            }
        }
    }

    fn setting(&mut self, name: &str, at: usize, value: &DeValue<'d>) {
        let checked = known_setting(name).and_then(|spec| {
            let number = setting(value, spec)?;
            self.reading.settings.set(spec.name, number).map_err(|error| error.to_string())?;
            Ok(spec.name)
        });
        let line = self.line(at);
        match checked.map(|name| self.reading.overrides.insert(name, line)) {
            Ok(Some(first)) => {
                self.problem(at, format!("`setup.{name}` stands twice, first in line {first}; remove one"))
            }
            Ok(None) => {}
            Err(complaint) => self.problem(at, format!("`setup.{name}`: {complaint}")),
        }
    }

    fn weights(&mut self, path: &str, table: &DeTable<'d>) {
        let kpis = kpi_names();
        self.refuse_unknown(table, "KPI", &kpis);
        for kpi in kpis {
            let checked = table.get(kpi).map(|item| (item.span().start, bounded(item.get_ref(), "1", 0.0, 1e6)));
            self.number(path, kpi, checked.unwrap_or((0, Ok(1.0))));
        }
    }

    fn strengths(&mut self, path: &str, table: &DeTable<'d>) {
        let library = self.reading.library.clone();
        let names: Vec<&str> = effect_names().into_iter().chain(library.declared()).collect();
        self.refuse_unknown(table, "effect", &names);
        for (name, item) in table {
            let Ok(effect) = library.find(name.get_ref()) else { continue };
            let (lower, upper) = effect.range();
            let checked = bounded(item.get_ref(), effect.unit(), lower, upper);
            self.number(path, effect.name(), (item.span().start, checked));
        }
    }

    /// Names of all effects, built in and declared.
    fn effect_names(&self) -> Vec<&str> {
        effect_names().into_iter().chain(self.reading.declared.iter().map(String::as_str)).collect()
    }

    /// The section of the effects, and one section for every effect that the study declares.
    fn effects(&mut self, path: &str, (keys, declared): (&[Key], &[Key]), table: &DeTable<'d>, at: usize) {
        let is_declared = |name: &str| self.reading.declared.iter().any(|known| known == name);
        let own: DeTable<'d> = table
            .iter()
            .filter(|(name, _)| !is_declared(name.get_ref()))
            .map(|(n, i)| (n.clone(), i.clone()))
            .collect();
        self.table(path, keys, &own, at, "1");
        for (name, item) in table {
            let (at, name) = (name.span().start, name.get_ref().as_ref());
            if let Some(inner) = item.get_ref().as_table().filter(|_| name != ACTIVE) {
                self.declared(path, name, declared, (inner, at));
            }
        }
    }

    fn declared(&mut self, path: &str, name: &str, keys: &[Key], (table, at): (&DeTable<'d>, usize)) {
        let full = format!("{path}.{name}");
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        if effect_names().contains(&name) {
            return self.problem(at, format!("`{full}`: an effect of this name is built in; choose another name"));
        }
        if !name.chars().all(plain) || ["all", "auto", "none", "random"].contains(&name) {
            let what = format!("`{full}`: `{name}` cannot name an effect; use lower-case letters, digits and `_`");
            return self.problem(at, what);
        }
        let word = |key: &str| table.get(key).and_then(|item| item.get_ref().as_str());
        let spec = word("setting").and_then(|name| settings::spec(name).ok());
        let relative = table.get("relative").and_then(|item| item.get_ref().as_bool()).unwrap_or_default();
        let unit = spec.filter(|_| !relative).map_or("1", |spec| spec.unit);
        let before = self.reading.problems.len();
        self.table(&full, keys, table, at, unit);
        if let (Some(spec), true) = (spec, self.reading.problems.len() == before) {
            let values = &self.reading.values;
            let text = |key: &str| values.text(&format!("{full}.{key}")).to_owned();
            let range = values.numbers(&format!("{full}.range"));
            let how = (spec, Way::of_word(&text("kind")), relative);
            self.reading.library.add(Declared::new(name, how, (range[0], range[1]), &text("source")));
        }
    }

    fn number(&mut self, path: &str, name: &str, (at, checked): (usize, Result<f64, Complaint>)) {
        match checked {
            Ok(number) => self.store(&format!("{path}.{name}"), Value::Number(number), at),
            Err(complaint) => self.problem(at, format!("`{path}.{name}`: {complaint}")),
        }
    }

    fn refuse_unknown(&mut self, table: &DeTable<'d>, what: &str, known: &[&str]) {
        for name in table.keys() {
            let (at, name) = (name.span().start, name.get_ref().as_ref());
            if !known.contains(&name) {
                let stray = nearest(name, known.iter().copied()).is_none() && what == "key";
                let remedy = home(name).filter(|_| stray).unwrap_or_else(|| suggestion(name, known));
                self.problem(at, format!("unknown {what} `{name}`; {remedy}"));
            }
        }
    }
}

/// The section of effects that are on from the start; every other section beside it declares an effect.
const ACTIVE: &str = "active";

/// Names of the effects that a study declares.
fn declared_names(root: &DeTable) -> Vec<String> {
    let effects = root.get("effects").and_then(|item| item.get_ref().as_table());
    let tables = effects.into_iter().flatten().filter(|(_, item)| item.get_ref().as_table().is_some());
    tables.map(|(name, _)| name.get_ref().to_string()).filter(|name| name != ACTIVE).collect()
}

/// The section `outer.inner` and where `outer` starts. What is not a section is told when `outer` is read.
fn inside<'v, 'd>(root: &'v DeTable<'d>, outer: &str, inner: &str) -> (usize, Option<&'v Item<'d>>) {
    let outer = root.get(outer);
    let item = outer.and_then(|item| item.get_ref().as_table()).and_then(|table| table.get(inner));
    (outer.map_or(0, |item| item.span().start), item)
}

/// Where a key that stands in the wrong section belongs.
fn home(name: &str) -> Option<String> {
    if SECTIONS.iter().any(|section| section.path == name) {
        return Some(format!("it is a section of its own, [{name}]"));
    }
    let holds = |keys: &[Key]| keys.iter().any(|key| key.name == name);
    let declares = |section: &&Section| matches!(section.shape, Shape::Table(keys) if holds(keys));
    let sections: Vec<String> = SECTIONS.iter().filter(declares).map(|section| format!("[{}]", section.path)).collect();
    (!sections.is_empty()).then(|| format!("it belongs to {}", sections.join(" or ")))
}

fn not_a_section(path: &str) -> String {
    format!("`{path}` is a section; write [{path}] on a line of its own and its keys below")
}

fn checked_default(key: &Key, default: &str, unit: &str, effects: &[&str]) -> Result<Value, Complaint> {
    let value = DeValue::parse(default).map_err(|error| format!("its default cannot be read: {}", error.message()))?;
    check(value.get_ref(), key.kind, unit, effects)
}

/// The specification of a setting; a name that lacks its experiment is suggested first.
fn known_setting(name: &str) -> Result<&'static SettingSpec, Complaint> {
    settings::spec(name).map_err(|_| {
        let last = name.rsplit('.').next().unwrap_or(name);
        let owned =
            settings::specs().find(|spec| spec.name.split_once('.').is_some_and(|(_, dimension)| dimension == last));
        match owned {
            Some(spec) if !name.contains('.') => format!("no such setting; did you mean `{}`?", spec.name),
            _ => format!("no such setting; {}", suggestion_of_setting(name)),
        }
    })
}

fn suggestion_of_setting(name: &str) -> String {
    match nearest(name, settings::specs().map(|spec| spec.name)) {
        Some(best) => format!("did you mean `{best}`?"),
        None => "schemas/pipeline.schema.json lists all".to_owned(),
    }
}

fn number_setting(name: &str) -> Result<&'static SettingSpec, Complaint> {
    let spec = known_setting(name)?;
    match spec.kind {
        settings::Kind::Number { .. } => Ok(spec),
        settings::Kind::Choice { .. } => {
            Err(format!("a choice between {} cannot be calibrated; set it in [setup]", spec.allowed()))
        }
    }
}
