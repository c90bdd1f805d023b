//! The types of a study: what every section means once it is known to be right.
//!
//! They are built only from a checked file (see `Config::parse`), so whoever holds one need not check again. All
//! numbers are SI, angles in degrees.

use super::values::Values;
use crate::effects::Library;
use crate::experiments::{self, EXPERIMENTS, Experiment};
use crate::settings::{self, SettingSpec};
use crate::stats::summary::Convention;
use std::fmt;
use std::path::PathBuf;

/// Declares an enum of words together with the words.
macro_rules! words {
    ($(#[$doc:meta])* $name:ident { $($(#[$variant_doc:meta])* $variant:ident = $word:literal),+ $(,)? }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
        pub enum $name {
            $($(#[$variant_doc])* $variant),+
        }

        impl $name {
            /// Every value, in the order of the declaration.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// The word in files, tables and labels.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $word),+
                }
            }

            /// The value of a word.
            pub fn from_name(word: &str) -> Option<Self> {
                Self::ALL.iter().copied().find(|value| value.name() == word)
            }

            /// The value of a word that the declaration has already admitted.
            fn admitted(word: &str) -> Self {
                Self::from_name(word).unwrap_or(Self::ALL[0])
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(self.name())
            }
        }
    };
}

words! {
    /// What a set-up resolves.
    Resolution {
        /// Large or soft spheres: a model of its own.
        Coarse = "coarse",
        /// True sizes and stiffness.
        Full = "full",
    }
}

words! {
    /// How a parameter's range is mapped to the unit interval.
    Scale {
        /// u = (x - lower)/(upper - lower).
        Linear = "linear",
        /// u = ln(x/lower)/ln(upper/lower).
        Log = "log",
    }
}

words! {
    /// How the inside of the parameter space is filled.
    Filling {
        /// Latin hypercube up to four parameters, Sobol sequence beyond.
        Auto = "auto",
        /// Latin hypercube spread conditional on the points that are there.
        Latin = "latin",
        /// Shifted Sobol sequence.
        Sobol = "sobol",
    }
}

words! {
    /// Kind of metamodel.
    MetamodelKind {
        /// Interpolation-based: noiseless processes for mean and coefficient of variation.
        Ibm = "ibm",
        /// Regression-based: one process with known noise in every point.
        Rbm = "rbm",
        /// Stochastic kriging: a process on the log variance smooths the noise of the mean's.
        Sk = "sk",
    }
}

words! {
    /// What σ_n² of the regression-based metamodel is.
    RbmNoise {
        /// The squared coefficient of variation.
        CvSquared = "cv2",
        /// The coefficient of variation, as the paper prints it.
        Cv = "cv",
        /// The variance of the mean, s²/n.
        VarianceOverN = "variance_over_n",
    }
}

words! {
    /// How the correlation of a process falls with distance.
    Kernel {
        /// Infinitely smooth, as the paper's.
        SquaredExponential = "squared_exponential",
        /// Matérn with ν = 5/2: twice differentiable.
        Matern52 = "matern_5_2",
    }
}

words! {
    /// What a calibration fits.
    Approach {
        /// Means (eqs 10 and 11).
        Mean = "m",
        /// Means and mean ± sd (eqs 10 to 13).
        MeanVariance = "mv",
    }
}

/// What a study is.
#[derive(Debug, Clone, PartialEq)]
pub struct Study {
    /// Short name.
    pub name: String,
    /// Heading of the report; empty where none was given.
    pub title: String,
    /// Base seed.
    pub seed: u64,
    /// Simulations of every point.
    pub repetitions: u32,
    /// Time steps after which a simulation is given up.
    pub step_limit: Option<u64>,
    /// Folder of the outputs, relative to the study's folder.
    pub artifacts: PathBuf,
    /// What the set-up resolves.
    pub resolution: Resolution,
}

/// Where the bounds of the particle density come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DensityBounds {
    /// The density is no parameter.
    NotCalibrated,
    /// The study gives them.
    Given,
    /// The stage `bounds` is to find them: until it has, those of the parameter are what the setting accepts at most.
    Sought,
    /// The stage `bounds` has found them.
    Found,
}

/// A calibrated setting with its bounds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Name of the setting.
    pub name: &'static str,
    /// Unit of the setting.
    pub unit: &'static str,
    /// Lower bound.
    pub lower: f64,
    /// Upper bound, above the lower one.
    pub upper: f64,
    /// How the range is mapped to the unit interval; bounds are positive where it is `Log`.
    pub scale: Scale,
}

impl Parameter {
    /// Position of `value` between the bounds: 0 at the lower, 1 at the upper one.
    pub fn to_unit(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear => (value - self.lower) / (self.upper - self.lower),
            Scale::Log => libm::log(value / self.lower) / libm::log(self.upper / self.lower),
        }
    }

    /// Value at `position`; 0 and 1 give the bounds exactly, and nothing between leaves them.
    pub fn from_unit(&self, position: f64) -> f64 {
        if position <= 0.0 || position >= 1.0 {
            return if position <= 0.0 { self.lower } else { self.upper };
        }
        let value = match self.scale {
            Scale::Linear => self.lower + (self.upper - self.lower) * position,
            Scale::Log => self.lower * libm::exp(position * libm::log(self.upper / self.lower)),
        };
        value.max(self.lower).min(self.upper)
    }
}

/// How bounds of the particle density are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bounds {
    /// Where they come from.
    pub density: DensityBounds,
    /// Simulations at each end.
    pub repetitions: u32,
}

/// Numbers of sample points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Design {
    /// Levels of the full factorial on the boundary, 0 for none; never 1.
    pub boundary_levels: u32,
    /// Points inside.
    pub interior: u32,
    /// How the inside is filled.
    pub filling: Filling,
    /// Points put in later.
    pub added: u32,
    /// Points for validation only.
    pub validation: u32,
}

/// The file of points that somebody chose, relative to the study's folder; `None` without one.
pub(super) fn points_file(values: &Values) -> Option<PathBuf> {
    let text = values.text("design.points").trim();
    (!text.is_empty()).then(|| PathBuf::from(text))
}

/// Where a measured data set lies.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MeasuredSource {
    /// Name in tables and labels.
    pub name: String,
    /// File or folder, relative to the study's folder.
    pub path: PathBuf,
    /// Whether the set-up resolves what was measured.
    pub comparable: bool,
    /// Said beside the data in the report; empty where none was given.
    pub note: String,
    /// Data sets known to hold no effect, at which the model's own offset is seen.
    pub controls: Vec<String>,
}

/// A parameter that was measured by itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Prior {
    /// The data set whose material it was.
    pub measured: String,
    /// The parameter.
    pub parameter: &'static str,
    /// Measured mean, in the parameter's unit.
    pub mean: f64,
    /// Standard deviation of one measurement, positive.
    pub sd: f64,
    /// Number of measurements.
    pub n: u32,
}

/// A setting of the model that is known only to a standard deviation, the same in every repetition of a data set.
#[derive(Debug, Clone, PartialEq)]
pub struct Uncertain {
    /// The data set in whose tests it is uncertain.
    pub measured: String,
    /// The setting.
    pub setting: &'static SettingSpec,
    /// Standard deviation of what it may be off by, in the setting's unit, positive.
    pub sd: f64,
}

/// Intervals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Statistics {
    /// Confidence of the confidence intervals.
    pub confidence: f64,
    /// Degrees of freedom.
    pub convention: Convention,
}

/// What is asked of the measured data.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Analysis {
    /// Wished half width of the mean's interval over the mean.
    pub precision: f64,
    /// Half width of the band around the last mean, over that mean.
    pub stability: f64,
    /// Simulated samples behind the p-value of normality.
    pub lilliefors_draws: u32,
}

/// Metamodels.
#[derive(Debug, Clone, PartialEq)]
pub struct Metamodel {
    /// Kinds to train, in the order of the file.
    pub kinds: Vec<MetamodelKind>,
    /// Starts of the likelihood search.
    pub starts: u32,
    /// Bounds of log10 a.
    pub log10_a: (f64, f64),
    /// Added to the diagonal of a noiseless covariance.
    pub jitter: f64,
    /// Noise of `rbm`.
    pub rbm_noise: RbmNoise,
    /// Kernel of `sk`.
    pub sk_kernel: Kernel,
}

/// Calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibrate {
    /// What to fit, in the order of the file.
    pub approaches: Vec<Approach>,
    /// Weight w of every KPI, sorted by name.
    pub weights: Vec<(String, f64)>,
    /// Weight C of the mean ± sd terms.
    pub c: f64,
    /// Starts of the search.
    pub starts: u32,
}

impl Calibrate {
    /// Weight of `kpi`; 1 where none was declared.
    pub fn weight(&self, kpi: &str) -> f64 {
        self.weights.iter().find(|(name, _)| name == kpi).map_or(1.0, |(_, weight)| *weight)
    }
}

/// Verification.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Verify {
    /// Numbers of repetitions, ascending, none above the study's repetitions.
    pub counts: Vec<u32>,
}

/// Validation on the held-out experiment.
#[derive(Clone, Copy)]
pub struct Validate {
    /// The held-out experiment.
    pub experiment: &'static dyn Experiment,
    /// Simulations at every optimum.
    pub repetitions: u32,
}

impl fmt::Debug for Validate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Validate")
            .field("experiment", &self.experiment.name())
            .field("repetitions", &self.repetitions)
            .finish()
    }
}

/// Diagnosis.
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnose {
    /// Names of the data sets to diagnose, in the order of the study.
    pub measured: Vec<String>,
    /// Metamodel behind the diagnosis; one of the trained kinds.
    pub kind: MetamodelKind,
    /// Effects that may be named, without those the model already has.
    pub candidates: Vec<String>,
    /// A candidate that may not be named, as if the library did not know it; how well it stands out is still reported.
    pub left_out: Option<String>,
    /// Anchors of every effect: points over parameters and strength.
    pub anchors: u32,
    /// Simulations at every anchor, and at every point around an optimum.
    pub anchor_repetitions: u32,
    /// Points around an optimum.
    pub refine_points: u32,
    /// Direct simulations at an optimum.
    pub refine_repetitions: u32,
    /// Share of the measured repetitions that no fit sees.
    pub held_out_share: f64,
    /// Bootstrap draws.
    pub bootstrap: u32,
    /// When a verdict is given.
    pub thresholds: Thresholds,
}

/// Thresholds of the verdict (see the declaration of each key).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Thresholds {
    /// Level of the adequacy test of the model without any effect.
    pub adequacy: f64,
    /// Level of the test of what an effect leaves over.
    pub leftover: f64,
    /// Level at which a signature must differ from its own noise.
    pub resolved: f64,
    /// Difference of ln likelihood within which effects form a class.
    pub class_delta: f64,
    /// Largest class that counts as named.
    pub class_size: u32,
    /// Probability that defines the detection limit.
    pub detection: f64,
    /// Squared distance to the nearest rival from which one name is due.
    pub separation: f64,
    /// Condition of the parameter slopes beyond which the fits with each effect decide, and the verdict says so.
    pub condition: f64,
    /// Repetitions from which standard deviations enter the test.
    pub sd_from: u32,
    /// Odds by which an effect must beat "something else" and "nothing", and a pair every single effect too.
    pub odds: f64,
    /// Share of a signature below which an effect that is out of reach is absorbed by calibration.
    pub visibility: f64,
    /// Family-wise level of each member of a pair beside the other.
    pub pair_level: f64,
    /// Degrees of freedom from which pairs are considered.
    pub pair_freedom: u32,
}

/// What happens with a verdict's effect.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Accept {
    /// The effect that the verdict names is added.
    Auto,
    /// Nothing is added.
    None,
    /// This effect is added.
    Effect(String),
}

/// Effects of the model.
#[derive(Debug, Clone, PartialEq)]
pub struct Effects {
    /// What happens with a verdict's effect.
    pub accept: Accept,
    /// Effects the model has from the start with their strengths, sorted by name.
    pub active: Vec<(String, f64)>,
    /// Built-in effects and those that the study declares.
    pub library: Library,
}

pub(super) fn study(values: &Values) -> Study {
    Study {
        name: values.text("study.name").to_owned(),
        title: values.text("study.title").to_owned(),
        seed: values.count("study.seed"),
        repetitions: values.count32("study.repetitions"),
        step_limit: Some(values.count("study.step_limit")).filter(|limit| *limit > 0),
        artifacts: PathBuf::from(values.text("study.artifacts")),
        resolution: Resolution::admitted(values.text("study.resolution")),
    }
}

pub(super) fn parameter(values: &Values, spec: &SettingSpec) -> Parameter {
    let at = |key: &str| format!("parameters.{}.{key}", spec.name);
    // Only bounds that are sought have no value yet.
    let bound = |key: &str, widest: f64| if values.has(&at(key)) { values.number(&at(key)) } else { widest };
    let (least, most) = match spec.kind {
        settings::Kind::Number { lower, upper, .. } => (lower, upper),
        settings::Kind::Choice { .. } => (0.0, 1.0),
    };
    Parameter {
        name: spec.name,
        unit: spec.unit,
        lower: bound("lower", least),
        upper: bound("upper", most),
        scale: Scale::admitted(values.text(&at("scale"))),
    }
}

pub(super) fn design(values: &Values) -> Design {
    Design {
        boundary_levels: values.count32("design.boundary_levels"),
        interior: values.count32("design.interior"),
        filling: Filling::admitted(values.text("design.filling")),
        added: values.count32("design.added"),
        validation: values.count32("design.validation"),
    }
}

pub(super) fn measured(values: &Values, id: &str) -> MeasuredSource {
    let at = |key: &str| format!("measured.{id}.{key}");
    MeasuredSource {
        name: values.text(&at("name")).to_owned(),
        path: PathBuf::from(values.text(&at("path"))),
        comparable: values.flag(&at("comparable")),
        note: values.text(&at("note")).to_owned(),
        controls: values.words(&at("controls")).to_vec(),
    }
}

pub(super) fn prior(values: &Values, id: &str) -> Option<Prior> {
    let at = |key: &str| format!("prior.{id}.{key}");
    Some(Prior {
        measured: values.text(&at("measured")).to_owned(),
        parameter: settings::spec(values.text(&at("parameter"))).ok()?.name,
        mean: values.number(&at("mean")),
        sd: values.number(&at("sd")),
        n: values.count32(&at("n")),
    })
}

pub(super) fn uncertain(values: &Values, id: &str) -> Option<Uncertain> {
    let at = |key: &str| format!("uncertain.{id}.{key}");
    Some(Uncertain {
        measured: values.text(&at("measured")).to_owned(),
        setting: settings::spec(values.text(&at("setting"))).ok()?,
        sd: values.number(&at("sd")),
    })
}

pub(super) fn statistics(values: &Values) -> Statistics {
    let paper = values.text("statistics.convention") == "paper";
    Statistics {
        confidence: values.number("statistics.confidence"),
        convention: if paper { Convention::Paper } else { Convention::Correct },
    }
}

pub(super) fn analysis(values: &Values) -> Analysis {
    Analysis {
        precision: values.number("analysis.precision"),
        stability: values.number("analysis.stability"),
        lilliefors_draws: values.count32("analysis.lilliefors_draws"),
    }
}

pub(super) fn metamodel(values: &Values) -> Metamodel {
    let bounds = values.numbers("metamodel.log10_a");
    Metamodel {
        kinds: values.words("metamodel.kinds").iter().map(|word| MetamodelKind::admitted(word)).collect(),
        starts: values.count32("metamodel.starts"),
        log10_a: (bounds[0], bounds[1]),
        jitter: values.number("metamodel.jitter"),
        rbm_noise: RbmNoise::admitted(values.text("metamodel.rbm_noise")),
        sk_kernel: Kernel::admitted(values.text("metamodel.sk_kernel")),
    }
}

pub(super) fn calibrate(values: &Values) -> Calibrate {
    Calibrate {
        approaches: values.words("calibrate.approaches").iter().map(|word| Approach::admitted(word)).collect(),
        weights: values.numbers_under("calibrate.weights"),
        c: values.number("calibrate.c"),
        starts: values.count32("calibrate.starts"),
    }
}

/// Counts up to `repetitions`.
pub(super) fn verify(values: &Values, repetitions: u32) -> Verify {
    let counts = values.counts("verify.counts").iter().filter_map(|count| u32::try_from(*count).ok());
    Verify { counts: counts.filter(|count| *count <= repetitions).collect() }
}

pub(super) fn validate(values: &Values) -> Validate {
    let chosen = experiments::find(values.text("validate.experiment"));
    // The declaration admits registered names only, so the fallback is never taken.
    let experiment = chosen.unwrap_or(EXPERIMENTS[0]);
    Validate { experiment, repetitions: values.count32("validate.repetitions") }
}

pub(super) fn diagnose(values: &Values, active: &[(String, f64)]) -> Diagnose {
    let in_model = |name: &String| active.iter().any(|(effect, strength)| effect == name && *strength != 0.0);
    Diagnose {
        measured: values.words("diagnose.measured").to_vec(),
        kind: MetamodelKind::admitted(values.text("diagnose.kind")),
        candidates: values.words("diagnose.candidates").iter().filter(|name| !in_model(name)).cloned().collect(),
        left_out: None,
        anchors: values.count32("diagnose.anchors"),
        anchor_repetitions: values.count32("diagnose.anchor_repetitions"),
        refine_points: values.count32("diagnose.refine_points"),
        refine_repetitions: values.count32("diagnose.refine_repetitions"),
        held_out_share: values.number("diagnose.held_out_share"),
        bootstrap: values.count32("diagnose.bootstrap"),
        thresholds: thresholds(values),
    }
}

fn thresholds(values: &Values) -> Thresholds {
    let number = |key: &str| values.number(&format!("diagnose.thresholds.{key}"));
    let count = |key: &str| values.count32(&format!("diagnose.thresholds.{key}"));
    Thresholds {
        adequacy: number("adequacy"),
        leftover: number("leftover"),
        resolved: number("resolved"),
        class_delta: number("class_delta"),
        class_size: count("class_size"),
        detection: number("detection"),
        separation: number("separation"),
        condition: number("condition"),
        sd_from: count("sd_from"),
        odds: number("odds"),
        visibility: number("visibility"),
        pair_level: number("pair_level"),
        pair_freedom: count("pair_freedom"),
    }
}

pub(super) fn effects(values: &Values, library: &Library) -> Effects {
    let accept = match values.text("effects.accept") {
        "auto" => Accept::Auto,
        "none" => Accept::None,
        effect => Accept::Effect(effect.to_owned()),
    };
    Effects { accept, active: values.numbers_under("effects.active"), library: library.clone() }
}
