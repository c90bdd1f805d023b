//! The declaration of pipeline.toml: every section and key with its kind, default and meaning.
//!
//! The reader checks a file against it, the JSON Schema is generated from it, and the text of every resolved value that
//! enters the key of a stage is named by it; so the three cannot disagree. It holds no values of a study.

use crate::effects::{EFFECTS, Way};
use crate::experiments::EXPERIMENTS;
use crate::settings::MATERIALS;

/// What a key may hold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// Any text.
    Text,
    /// A name that can stand in paths and labels: lower-case letters, digits, `_` and `-`.
    Name,
    /// A path, relative to the folder of the file.
    Path,
    /// The name of a unit that can be converted to this one.
    Unit(&'static str),
    /// true or false.
    Flag,
    /// A whole number within inclusive bounds.
    Count(u64, u64),
    /// A number, or a text with a unit, within inclusive bounds.
    Number(&'static str, f64, f64),
    /// A number in the unit of the parameter or setting that the section names.
    Quantity,
    /// One of the words.
    Choice(&'static [&'static str]),
    /// A non-empty list of different words.
    Choices(&'static [&'static str]),
    /// A non-empty ascending list of whole numbers within inclusive bounds.
    Counts(u64, u64),
    /// Two ascending numbers within inclusive bounds.
    Interval(f64, f64),
    /// The name of an experiment.
    Experiment,
    /// A non-empty list of different experiments.
    Experiments,
    /// `"all"` or a non-empty list of different effects.
    Effects,
    /// One of the words, or the name of an effect.
    ChoiceOrEffect(&'static [&'static str]),
    /// Two ascending numbers in the unit of the setting that the section names.
    Range,
    /// The name of a setting that is a number.
    Setting,
    /// The name of a parameter of the study.
    Parameter,
    /// The name of a measured data set of the study.
    Measured,
    /// `"all"` or a non-empty list of different measured data sets.
    MeasuredSets,
    /// A list, maybe empty, of different measured data sets.
    OtherSets,
}

/// One key of a section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Key {
    /// Name as written.
    pub name: &'static str,
    /// What it holds.
    pub kind: Kind,
    /// Value as it would be written, used where the key is left out; `None` where it must be given.
    pub default: Option<&'static str>,
    /// What it means.
    pub meaning: &'static str,
}

/// How a section is written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// `[section]` with these keys.
    Table(&'static [Key]),
    /// `[section.NAME]` for every parameter, each with these keys.
    Parameters(&'static [Key]),
    /// `[[section]]`, each with these keys; the first list of names tells one item from another.
    List(&'static [&'static str], &'static [Key]),
    /// `[section]` and `[section.EXPERIMENT]` with settings of the model as keys.
    Settings,
    /// `[section]` with KPIs as keys and positive numbers as values, 1 where left out.
    Weights,
    /// `[section]` with effects as keys and their strengths as values.
    Strengths,
    /// `[section]` with the first keys, and `[section.NAME]` with the second ones for every effect that the study declares.
    Effects(&'static [Key], &'static [Key]),
}

/// One section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Section {
    /// Path as written between brackets.
    pub path: &'static str,
    /// How it is written.
    pub shape: Shape,
    /// What it is for.
    pub meaning: &'static str,
}

/// Largest count that any key takes.
const MANY: u64 = 1_000_000;

/// Every section, in the order of the shipped file.
pub const SECTIONS: &[Section] = &[
    Section { path: "study", shape: Shape::Table(STUDY), meaning: "what this study is" },
    Section {
        path: "parameters",
        shape: Shape::Parameters(PARAMETER),
        meaning: "what is calibrated: any number of settings, with bounds",
    },
    Section {
        path: "bounds",
        shape: Shape::Table(BOUNDS),
        meaning: "bounds of the particle density by simulation (eqs 2 and 3), where its section gives none",
    },
    Section { path: "experiments", shape: Shape::Table(FITTED), meaning: "experiments the calibration is fitted to" },
    Section { path: "design", shape: Shape::Table(DESIGN), meaning: "sample points in the space of the parameters" },
    Section {
        path: "setup",
        shape: Shape::Settings,
        meaning: "settings of the model that differ from the full-scale study of the paper",
    },
    Section {
        path: "equipment",
        shape: Shape::List(&["experiment", "name"], EQUIPMENT),
        meaning: "triangle meshes of your own that stand in an apparatus",
    },
    Section { path: "measured", shape: Shape::List(&["name"], MEASURED), meaning: "measured data sets" },
    Section {
        path: "prior",
        shape: Shape::List(&["measured", "parameter"], PRIOR),
        meaning: "parameters that were measured by themselves",
    },
    Section {
        path: "uncertain",
        shape: Shape::List(&["measured", "setting"], UNCERTAIN),
        meaning: "settings of the model, such as dimensions of an apparatus, that are known only to a standard deviation",
    },
    Section { path: "statistics", shape: Shape::Table(STATISTICS), meaning: "intervals" },
    Section { path: "analysis", shape: Shape::Table(ANALYSIS), meaning: "what is asked of the measured data" },
    Section {
        path: "metamodel",
        shape: Shape::Table(METAMODEL),
        meaning: "Gaussian processes that stand for the simulations",
    },
    Section { path: "calibrate", shape: Shape::Table(CALIBRATE), meaning: "search for the parameters (eqs 10-13)" },
    Section { path: "calibrate.weights", shape: Shape::Weights, meaning: "weight of every KPI in the objective" },
    Section { path: "verify", shape: Shape::Table(VERIFY), meaning: "new simulations at the optima" },
    Section { path: "validate", shape: Shape::Table(VALIDATE), meaning: "the experiment the calibration never sees" },
    Section { path: "diagnose", shape: Shape::Table(DIAGNOSE), meaning: "attribution of the residual to effects" },
    Section { path: "diagnose.thresholds", shape: Shape::Table(THRESHOLDS), meaning: "when a verdict is given" },
    Section {
        path: "effects",
        shape: Shape::Effects(EFFECT, DECLARED),
        meaning: "what happens with a verdict, and effects of the study's own",
    },
    Section {
        path: "effects.active",
        shape: Shape::Strengths,
        meaning: "effects that the model has from the start, with their strengths",
    },
];

const fn key(name: &'static str, kind: Kind, default: &'static str, meaning: &'static str) -> Key {
    Key { name, kind, default: Some(default), meaning }
}

const fn required(name: &'static str, kind: Kind, meaning: &'static str) -> Key {
    Key { name, kind, default: None, meaning }
}

const STUDY: &[Key] = &[
    required("name", Kind::Name, "short name, used in labels"),
    key("title", Kind::Text, "\"\"", "heading of the report"),
    key(
        "seed",
        Kind::Count(0, i64::MAX as u64),
        "1",
        "base seed; another seed gives other packings and another design",
    ),
    key("repetitions", Kind::Count(1, 100_000), "3", "simulations of every point with new random packings"),
    key(
        "step_limit",
        Kind::Count(0, i64::MAX as u64),
        "0",
        "time steps after which a simulation is given up and becomes a failed row; 0 = none",
    ),
    key("artifacts", Kind::Path, "\"artifacts\"", "where tables, objects and the report go"),
    key(
        "resolution",
        Kind::Choice(&["coarse", "full"]),
        "\"full\"",
        "label of the set-up: coarse or full; said beside every number",
    ),
];

/// The parameter whose section may leave out both bounds: they are found by simulation then.
pub const DENSITY: &str = "particle_density";
/// The keys of a parameter that [`DENSITY`] may leave out together.
pub const BOTH: [&str; 2] = ["lower", "upper"];

const PARAMETER: &[Key] = &[
    required("lower", Kind::Quantity, "lower bound"),
    required("upper", Kind::Quantity, "upper bound"),
    key("scale", Kind::Choice(&["linear", "log"]), "\"linear\"", "how the unit cube is stretched between the bounds"),
];

const BOUNDS: &[Key] = &[key(
    "repetitions",
    Kind::Count(2, 100_000),
    "10",
    "simulations at each end; apart from study.repetitions, so that more of those move no point of the design",
)];

const FITTED: &[Key] =
    &[key("fitted", Kind::Experiments, "[\"pile\", \"ledge\", \"bulk_density\"]", "experiments whose KPIs are fitted")];

const DESIGN: &[Key] = &[
    key("boundary_levels", Kind::Count(0, 9), "3", "levels of the full factorial that covers the boundary; 0 = none"),
    key("interior", Kind::Count(0, MANY), "20", "points inside"),
    key(
        "filling",
        Kind::Choice(&["auto", "latin", "sobol"]),
        "\"auto\"",
        "how the inside is filled: Latin hypercube spread conditional on the boundary points, Sobol sequence, or the first \
         up to four parameters and the second beyond",
    ),
    key(
        "added",
        Kind::Count(0, 1000),
        "0",
        "points put in later, each as far as can be from all before; no other point moves, so every run is kept",
    ),
    key(
        "points",
        Kind::Text,
        "\"\"",
        "CSV or Parquet file with points to add or to repeat more often, as `plan --suggest` writes it; empty = none",
    ),
    key("validation", Kind::Count(0, MANY), "8", "points the metamodels are judged by, never trained on"),
];

const EQUIPMENT: &[Key] = &[
    required("experiment", Kind::Experiment, "experiment in whose apparatus it stands"),
    required("name", Kind::Name, "name of the wall"),
    required("stl", Kind::Path, "STL file, binary or ASCII, in the coordinates of the apparatus"),
    required("unit", Kind::Unit("m"), "unit of length of the numbers in the file"),
    required(
        "material",
        Kind::Choice(MATERIALS),
        "wall material, whose friction is the setting wall_friction_MATERIAL",
    ),
];

const MEASURED: &[Key] = &[
    required("name", Kind::Name, "name in tables and labels"),
    required("path", Kind::Path, "CSV or Parquet file, or a folder of them"),
    required(
        "comparable",
        Kind::Flag,
        "whether the set-up resolves what was measured; if not, residuals are printed but not attributed",
    ),
    key("note", Kind::Text, "\"\"", "said beside the data in the report"),
    key(
        "controls",
        Kind::OtherSets,
        "[]",
        "data sets of the same origin that are known to hold no effect: what the model misses there is its own offset, which \
         is taken off before anything is attributed",
    ),
];

const PRIOR: &[Key] = &[
    required("parameter", Kind::Parameter, "the parameter"),
    required("measured", Kind::Measured, "the data set whose material it was"),
    required("mean", Kind::Quantity, "measured mean"),
    required("sd", Kind::Quantity, "standard deviation of one measurement"),
    required(
        "n",
        Kind::Count(2, MANY),
        "number of measurements; the mean is known to sd/sqrt(n), in the diagnosis with the tails of Student's t",
    ),
];

const UNCERTAIN: &[Key] = &[
    required("setting", Kind::Setting, "the setting; its value stands in [setup]"),
    required("measured", Kind::Measured, "the data set in whose tests it is uncertain, the same in every repetition"),
    required(
        "sd",
        Kind::Quantity,
        "standard deviation of what it may be off by; the diagnosis counts what that shifts as known no better",
    ),
];

const STATISTICS: &[Key] = &[
    key(
        "confidence",
        Kind::Number("1", 0.5, 0.9999),
        "0.95",
        "confidence of the confidence intervals; credible intervals hold 95 %",
    ),
    key(
        "convention",
        Kind::Choice(&["correct", "paper"]),
        "\"correct\"",
        "n - 1 degrees of freedom, or the figures as the paper prints them",
    ),
];

const ANALYSIS: &[Key] = &[
    key(
        "precision",
        Kind::Number("1", 1e-4, 1.0),
        "\"2 %\"",
        "wished half width of the mean's interval over the mean; the report says how many repetitions it takes",
    ),
    key(
        "stability",
        Kind::Number("1", 1e-4, 1.0),
        "\"1 %\"",
        "band around the last mean; the report says from which repetition on the mean stays in it (Fig. 6)",
    ),
    key("lilliefors_draws", Kind::Count(100, MANY), "10000", "simulated samples behind the p-value of normality"),
];

const METAMODEL: &[Key] = &[
    key(
        "kinds",
        Kind::Choices(&["ibm", "rbm", "sk"]),
        "[\"ibm\", \"rbm\", \"sk\"]",
        "interpolation, regression, stochastic kriging",
    ),
    key("starts", Kind::Count(1, MANY), "100", "starts of the search for the most likely hyperparameters"),
    key(
        "log10_a",
        Kind::Interval(-6.0, 6.0),
        "[-1.0, 1.0]",
        "bounds of log10 a_i, the inverse squared length scales in the unit cube",
    ),
    key("jitter", Kind::Number("1", 1e-12, 1e-2), "1e-8", "added to the diagonal of a noiseless covariance"),
    key(
        "rbm_noise",
        Kind::Choice(&["cv2", "cv", "variance_over_n"]),
        "\"cv2\"",
        "noise of `rbm`: cv squared, cv as printed, or variance of the mean",
    ),
    key(
        "sk_kernel",
        Kind::Choice(&["squared_exponential", "matern_5_2"]),
        "\"matern_5_2\"",
        "kernel of `sk`: Matern 5/2, or the paper's, which `ibm` and `rbm` have and which takes more for known than is",
    ),
];

const CALIBRATE: &[Key] = &[
    key(
        "approaches",
        Kind::Choices(&["m", "mv"]),
        "[\"m\", \"mv\"]",
        "fit the means (eq. 11), or means and mean +- sd (eqs 11-13)",
    ),
    key("c", Kind::Number("1", 0.0, 100.0), "0.5", "weight C of the two mean +- sd terms beside the mean"),
    key("starts", Kind::Count(1, MANY), "100", "starts of the search"),
];

const VERIFY: &[Key] = &[key(
    "counts",
    Kind::Counts(1, 100_000),
    "[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 15, 20, 30, 40, 50]",
    "numbers of repetitions n whose optima are simulated n times; those up to study.repetitions are used",
)];

const VALIDATE: &[Key] = &[
    key("experiment", Kind::Experiment, "\"hopper\"", "held out of calibration and diagnosis"),
    key("repetitions", Kind::Count(2, 100_000), "5", "simulations at every optimum"),
];

const DIAGNOSE: &[Key] = &[
    key("measured", Kind::MeasuredSets, "\"all\"", "data sets to diagnose"),
    key(
        "kind",
        Kind::Choice(&["ibm", "rbm", "sk"]),
        "\"sk\"",
        "metamodel behind the diagnosis; one of metamodel.kinds",
    ),
    key("candidates", Kind::Effects, "\"all\"", "effects that may be named"),
    key(
        "anchors",
        Kind::Count(1, MANY),
        "48",
        "points over parameters and strength at which every effect is simulated; shared by all diagnoses",
    ),
    key("anchor_repetitions", Kind::Count(2, 100_000), "8", "simulations at every such point"),
    key("refine_points", Kind::Count(4, MANY), "48", "points around an optimum, without and with an effect"),
    key(
        "refine_repetitions",
        Kind::Count(2, 100_000),
        "100",
        "direct simulations at the optimum without and with an effect; fewer make verdicts timid",
    ),
    key(
        "held_out_share",
        Kind::Number("1", 0.0, 0.5),
        "0",
        "share of the measured repetitions that no fit of the diagnosis sees; before and after are held against them",
    ),
    key("bootstrap", Kind::Count(100, MANY), "1000", "draws behind family-wise p-values and detection limits"),
];

const THRESHOLDS: &[Key] = &[
    key("adequacy", Kind::Number("1", 1e-6, 0.5), "0.05", "level of the test of the model without any effect"),
    key("leftover", Kind::Number("1", 1e-6, 0.5), "0.01", "level of the test of what an effect leaves over"),
    key("resolved", Kind::Number("1", 1e-6, 0.5), "0.01", "level at which a signature must differ from its own noise"),
    key(
        "class_delta",
        Kind::Number("1", 0.0, 100.0),
        "3",
        "effects within this much ln likelihood of the best one form a class",
    ),
    key("class_size", Kind::Count(1, 100), "3", "largest class that still counts as named in the detection limit"),
    key("detection", Kind::Number("1", 0.5, 0.999), "0.9", "probability with which the detection limit is named"),
    key(
        "separation",
        Kind::Number("1", 0.0, 1000.0),
        "10",
        "squared distance to the nearest rival from which one name is due",
    ),
    key(
        "condition",
        Kind::Number("1", 10.0, 1e15),
        "1e6",
        "condition of the parameter slopes beyond which the fits with each effect decide",
    ),
    key("sd_from", Kind::Count(2, 100_000), "10", "repetitions from which standard deviations enter the test"),
    key(
        "odds",
        Kind::Number("1", 1.0, 1e6),
        "3",
        "odds by which an effect must beat \"something else\" and \"nothing\", and a pair every effect too",
    ),
    key(
        "visibility",
        Kind::Number("1", 0.0, 1.0),
        "0.05",
        "share of a signature below which an effect is called absorbed by calibration, if it is out of reach too",
    ),
    key(
        "pair_level",
        Kind::Number("1", 1e-6, 0.5),
        "0.05",
        "family-wise level of each member of a pair beside the other",
    ),
    key("pair_freedom", Kind::Count(3, 1000), "6", "degrees of freedom from which pairs of effects are considered"),
];

const EFFECT: &[Key] = &[key(
    "accept",
    Kind::ChoiceOrEffect(&["auto", "none"]),
    "\"auto\"",
    "effect to add and recalibrate: the one the verdict names, none, or this one",
)];

const DECLARED: &[Key] = &[
    required("setting", Kind::Setting, "setting of the model or the measurement that it changes"),
    required(
        "kind",
        Kind::Choice(Way::WORDS),
        "the same in every repetition, at random, or growing from one to the next",
    ),
    required("range", Kind::Range, "physical range of the strength, [lower, upper]; holds 0, which is absent"),
    key("relative", Kind::Flag, "false", "whether the strength is a share of the setting's value, not in its unit"),
    required("source", Kind::Text, "where the range comes from"),
];

/// Names of all experiments.
pub fn experiment_names() -> Vec<&'static str> {
    EXPERIMENTS.iter().map(|experiment| experiment.name()).collect()
}

/// Names of the built-in effects.
pub fn effect_names() -> Vec<&'static str> {
    EFFECTS.iter().map(|effect| effect.name()).collect()
}

/// Names of the KPIs of all experiments.
pub fn kpi_names() -> Vec<&'static str> {
    let observables = EXPERIMENTS.iter().flat_map(|experiment| experiment.observables());
    observables.filter(|observable| observable.is_kpi).map(|observable| observable.name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_and_keys_are_unique() {
        let mut paths: Vec<_> = SECTIONS.iter().map(|section| section.path).collect();
        paths.sort_unstable();
        assert!(paths.windows(2).all(|pair| pair[0] != pair[1]), "{paths:?}");
        for section in SECTIONS {
            if let Shape::Table(keys) | Shape::Parameters(keys) | Shape::List(_, keys) | Shape::Effects(_, keys) =
                section.shape
            {
                let mut names: Vec<_> = keys.iter().map(|key| key.name).collect();
                names.sort_unstable();
                assert!(names.windows(2).all(|pair| pair[0] != pair[1]), "{}: {names:?}", section.path);
                assert!(keys.iter().all(|key| !key.meaning.is_empty()));
            }
        }
    }
}
