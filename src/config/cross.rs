//! How the sections of a study fit together: checks that need more than one key.
//!
//! Takes what was read without problems; adds a problem for everything that is right by itself and wrong together,
//! and resolves `"all"` for measured sets, so that a new set makes stale what uses all of them.

use super::declare::DENSITY;
use super::nearest::suggestion;
use super::problem::{Place, Problem};
use super::read::Reading;
use super::types::DensityBounds;
use super::values::Value;
use crate::effects::{self, Effect, EffectError};
use crate::experiments::{self, EXPERIMENTS, Experiment};
use crate::settings;
use crate::units::canonical;

/// Most points of a design: beyond it a typing error is likelier than a wish.
const MOST_POINTS: u64 = 1_000_000;
/// The experiment behind bounds of the particle density.
const BULK_DENSITY: &str = "bulk_density";

/// Checks `reading`, which holds no problems yet, and adds those found. `file` is its name for messages.
pub fn check(reading: &mut Reading, file: &str) {
    let mut cross = Cross { reading, file };
    cross.parameters();
    cross.design();
    cross.experiments();
    cross.measured();
    cross.priors();
    cross.uncertain();
    cross.counts();
    cross.declared();
    cross.diagnosis();
    cross.apparatus();
}

struct Cross<'r> {
    reading: &'r mut Reading,
    file: &'r str,
}

impl Cross<'_> {
    fn problem(&mut self, path: &str, what: String) {
        let place = self.reading.line(path).map_or(Place::File, Place::Line);
        self.reading.problems.push(Problem { file: self.file.to_owned(), place, what: format!("`{path}`: {what}") });
    }

    fn parameters(&mut self) {
        if self.reading.parameters.is_empty() {
            self.problem(
                "parameters",
                "nothing to calibrate; add a section such as [parameters.sliding_friction]".to_owned(),
            );
        }
        for name in self.reading.parameters.clone() {
            if !self.is_sought(&name) {
                self.bounds(&name);
            }
            self.fixed_too(&name);
        }
        if self.reading.unbounded.is_some() {
            self.can_be_found();
        }
    }

    /// Whether the bounds of a parameter are still to be found.
    fn is_sought(&self, name: &str) -> bool {
        name == DENSITY && self.reading.density_bounds() == DensityBounds::Sought
    }

    /// What the stage `bounds` needs of a study whose particle density has none.
    fn can_be_found(&mut self) {
        let remedy = "or give lower and upper";
        if self.reading.parameters.len() == 1 {
            let what =
                format!("bounds come from the ends of the other parameters, of which there is none; add one, {remedy}");
            self.problem(&format!("parameters.{DENSITY}"), what);
        }
        if !self.reading.values.words("experiments.fitted").iter().any(|name| name == BULK_DENSITY) {
            let test = format!("{BULK_DENSITY}, whose test gives the bounds that [parameters.{DENSITY}] leaves out");
            let what = format!("lacks {test}; add it, {remedy}");
            self.problem("experiments.fitted", what);
        }
    }

    fn bounds(&mut self, name: &str) {
        let at = |key: &str| format!("parameters.{name}.{key}");
        let values = &self.reading.values;
        let (lower, upper) = (values.number(&at("lower")), values.number(&at("upper")));
        let logarithmic = values.text(&at("scale")) == "log";
        if lower >= upper {
            self.problem(
                &at("lower"),
                format!("{} is not below the upper bound {}", canonical(lower), canonical(upper)),
            );
        }
        if logarithmic && lower <= 0.0 {
            self.problem(
                &at("scale"),
                "a log scale needs a lower bound above 0; raise it or take \"linear\"".to_owned(),
            );
        }
        let Ok(spec) = settings::spec(name) else { return };
        for (key, bound) in [("lower", lower), ("upper", upper)] {
            if !spec.accepts(bound) {
                self.problem(
                    &at(key),
                    format!("{} lies outside the setting's range, {}", canonical(bound), spec.allowed()),
                );
            }
        }
    }

    fn fixed_too(&mut self, name: &str) {
        if let Some(line) = self.reading.overrides.get(name) {
            let line = *line;
            let what = format!("is calibrated, but [setup] fixes it in line {line}; remove one of the two");
            self.problem(&format!("parameters.{name}.lower"), what);
        }
    }

    fn design(&mut self) {
        let values = &self.reading.values;
        let levels = values.count("design.boundary_levels");
        let inside = values.count("design.interior") + values.count("design.added");
        let dimensions = self.reading.parameters.len() as u32;
        if levels == 1 {
            self.problem("design.boundary_levels", "one level spans nothing; take 0 (none) or 2 and more".to_owned());
        }
        let boundary = if levels == 0 { 0 } else { levels.saturating_pow(dimensions) };
        let points = boundary.saturating_add(inside);
        if points > MOST_POINTS {
            let what =
                format!("{levels} levels of {dimensions} parameters make {boundary} points; take fewer levels, or 0");
            self.problem("design.boundary_levels", what);
        } else if points < u64::from(dimensions) + 2 {
            let what =
                format!("{points} points cannot show the slopes of {dimensions} parameters; add interior points");
            self.problem("design.interior", what);
        }
    }

    fn experiments(&mut self) {
        let held_out = self.reading.values.text("validate.experiment").to_owned();
        if self.reading.values.words("experiments.fitted").contains(&held_out) {
            let what = format!("`{held_out}` is fitted too; validation needs an experiment the calibration never sees");
            self.problem("validate.experiment", what);
        }
    }

    fn measured(&mut self) {
        let sets = self.sets();
        if sets.is_empty() {
            self.problem(
                "measured",
                "no measured data; add a [[measured]] section with name, path and comparable".to_owned(),
            );
        }
        sets.iter().for_each(|set| self.controls(set));
        let line = self.reading.values.line("diagnose.measured").unwrap_or(1);
        let chosen = self.reading.values.words("diagnose.measured").to_vec();
        if chosen == ["all"] {
            self.reading.values.insert("diagnose.measured".to_owned(), Value::Words(sets), line);
            return;
        }
        for name in chosen {
            self.known_set("diagnose.measured", &name);
        }
    }

    /// Controls are other sets, and have none themselves: an offset is seen where nothing was taken off.
    fn controls(&mut self, set: &str) {
        let path = |set: &str| format!("measured.{set}.controls");
        for control in self.reading.values.words(&path(set)).to_vec() {
            self.known_set(&path(set), &control);
            if control == set {
                self.problem(&path(set), format!("`{set}` cannot be its own control; remove it"));
            } else if self.sets().contains(&control) && !self.reading.values.words(&path(&control)).is_empty() {
                self.problem(&path(set), format!("`{control}` has controls of its own; name those instead"));
            }
        }
    }

    fn priors(&mut self) {
        for id in self.reading.lists.get("prior").cloned().unwrap_or_default() {
            let at = |key: &str| format!("prior.{id}.{key}");
            let parameter = self.reading.values.text(&at("parameter")).to_owned();
            if !self.reading.parameters.contains(&parameter) {
                let known: Vec<&str> = self.reading.parameters.iter().map(String::as_str).collect();
                let what = format!("`{parameter}` is no parameter of this study; {}", suggestion(&parameter, &known));
                self.problem(&at("parameter"), what);
            }
            let set = self.reading.values.text(&at("measured")).to_owned();
            self.known_set(&at("measured"), &set);
            if self.reading.values.number(&at("sd")) <= 0.0 {
                self.problem(&at("sd"), "is not above 0; give the scatter of one measurement".to_owned());
            }
        }
    }

    /// Uncertain settings are read by a fitted test, calibrated by none, and describe an apparatus at either end of their
    /// standard deviation.
    fn uncertain(&mut self) {
        for id in self.reading.lists.get("uncertain").cloned().unwrap_or_default() {
            let at = |key: &str| format!("uncertain.{id}.{key}");
            let set = self.reading.values.text(&at("measured")).to_owned();
            self.known_set(&at("measured"), &set);
            let (name, sd) =
                (self.reading.values.text(&at("setting")).to_owned(), self.reading.values.number(&at("sd")));
            let fitted = self.reading.fitted();
            let Ok(spec) = settings::spec(&name) else { continue };
            if self.reading.parameters.contains(&name) {
                let what = format!("`{name}` is calibrated; say what is known of it in a [[prior]]");
                self.problem(&at("setting"), what);
            } else if !fitted.iter().any(|experiment| self.reading.settings.is_read(spec, experiment.name())) {
                let what = format!("no fitted experiment reads `{name}`, so that no data depend on it; remove it");
                self.problem(&at("setting"), what);
            } else if sd <= 0.0 {
                self.problem(&at("sd"), "is not above 0; give what the setting may be off by, or remove it".to_owned());
            } else if let Some(error) = [-sd, sd].into_iter().find_map(|off| self.impossible(&name, off)) {
                self.problem(&at("sd"), format!("one standard deviation off, {error}; give a smaller one"));
            }
        }
    }

    /// Why a setting cannot be off by so much.
    fn impossible(&self, name: &str, off: f64) -> Option<String> {
        let mut settings = self.reading.settings.clone();
        let moved = settings.get(name).and_then(|value| settings.set(name, value + off));
        let refused = || self.used().iter().find_map(|experiment| experiment.setup(&settings).err());
        moved.err().map(|error| error.to_string()).or_else(|| refused().map(|error| error.to_string()))
    }

    fn known_set(&mut self, path: &str, name: &str) {
        let sets = self.sets();
        if !sets.iter().any(|set| set == name) {
            let known: Vec<&str> = sets.iter().map(String::as_str).collect();
            self.problem(path, format!("no [[measured]] is called `{name}`; {}", suggestion(name, &known)));
        }
    }

    fn sets(&self) -> Vec<String> {
        self.reading.lists.get("measured").cloned().unwrap_or_default()
    }

    fn counts(&mut self) {
        let repetitions = self.reading.values.count("study.repetitions");
        if self.reading.values.counts("verify.counts").iter().all(|count| *count > repetitions) {
            let what = format!("none is at most study.repetitions = {repetitions}; add a smaller count");
            self.problem("verify.counts", what);
        }
    }

    /// Ranges of declared effects: they hold 0, have a sign that makes sense, and stay within what the setting takes.
    fn declared(&mut self) {
        for name in self.reading.declared.clone() {
            let path = format!("effects.{name}.range");
            let Ok(effect) = self.reading.library.find(&name) else { continue };
            let (lower, upper) = effect.range();
            if !(lower <= 0.0 && 0.0 < upper) {
                let what =
                    format!("{} to {} must hold 0 (absent) and end above it", canonical(lower), canonical(upper));
                self.problem(&path, what);
            } else if effect.is_scatter() && lower < 0.0 {
                self.problem(&path, "a scatter is not negative; begin with 0".to_owned());
            } else if let Some(error) = self.unphysical(&*effect) {
                self.problem(&path, format!("{error}; narrow the range"));
            }
        }
    }

    /// What goes wrong at an end of the effect's range, anywhere between the bounds of the parameters.
    fn unphysical(&self, effect: &dyn Effect) -> Option<EffectError> {
        let values = &self.reading.values;
        let corner = |bound: &str| {
            let mut settings = self.reading.settings.clone();
            for name in self.reading.parameters.iter().filter(|name| !self.is_sought(name)) {
                // A bound that the setting refuses is a problem of its own.
                let _ = settings.set(name, values.number(&format!("parameters.{name}.{bound}")));
            }
            settings
        };
        let (lower, upper) = effect.range();
        let last = self.reading.settings["series_length"] as u32;
        let ends = [lower, upper].into_iter().flat_map(|strength| [1, last].map(|repetition| (strength, repetition)));
        let mut all = ends.flat_map(|end| ["lower", "upper"].map(|bound| (end, corner(bound))));
        all.find_map(|((strength, repetition), mut settings)| {
            effects::apply(effect, strength, &mut settings, 0, repetition).err()
        })
    }

    fn diagnosis(&mut self) {
        let values = &self.reading.values;
        let (kind, accept) = (values.text("diagnose.kind").to_owned(), values.text("effects.accept").to_owned());
        let (kinds, candidates) =
            (values.words("metamodel.kinds").to_vec(), values.words("diagnose.candidates").to_vec());
        if !kinds.contains(&kind) {
            self.problem(
                "diagnose.kind",
                format!("`{kind}` is not trained; add it to metamodel.kinds = {}", kinds.join(", ")),
            );
        }
        if accept != "auto" && accept != "none" && !candidates.contains(&accept) {
            let what = format!("`{accept}` is not among diagnose.candidates; add it there, or take \"auto\"");
            self.problem("effects.accept", what);
        }
        let active = self.reading.values.numbers_under("effects.active");
        if candidates.iter().all(|name| active.iter().any(|(effect, strength)| effect == name && *strength != 0.0)) {
            let what = "every candidate is already active; add one that the model lacks".to_owned();
            self.problem("diagnose.candidates", what);
        }
    }

    /// The fitted experiments and the held-out one.
    fn used(&self) -> Vec<&'static dyn Experiment> {
        let held_out = self.reading.values.text("validate.experiment");
        let held_out = EXPERIMENTS.iter().copied().filter(|experiment| experiment.name() == held_out);
        self.reading.fitted().into_iter().chain(held_out).collect()
    }

    /// Settings that are each allowed but together describe no apparatus, for every experiment of the study.
    fn apparatus(&mut self) {
        let setups = self.used().into_iter().map(|experiment| experiment.setup(&self.reading.settings));
        let errors: Vec<experiments::SetupError> = setups.filter_map(Result::err).collect();
        for error in errors {
            let known = [error.small, error.large].into_iter().find(|name| self.reading.overrides.contains_key(name));
            self.problem(&format!("setup.{}", known.unwrap_or(error.small)), format!("{error}; change one of the two"));
        }
    }
}
