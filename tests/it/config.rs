//! Studies as users write them: the shipped ones are valid and complete, and every mistake is answered with file, line,
//! what is wrong and what to do.

use granulake::config::{
    Accept, Approach, Config, Measured, MeasuredSummary, MetamodelKind, Parameter, Problems, Resolution, Scale, schema,
    template,
};
use granulake::effects::EFFECTS;
use granulake::experiments::EXPERIMENTS;
use granulake::settings::specs;
use granulake::stats::summary::Convention;
use std::path::Path;

/// The smallest study: all else takes its default.
const MINIMAL: &str = r#"
[study]
name = "tiny"
[parameters.sliding_friction]
lower = 0.1
upper = 0.9
[[measured]]
name = "lab"
path = "lab.csv"
comparable = true
"#;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

fn parse(text: &str) -> Result<Config, Problems> {
    Config::parse(text, Path::new("pipeline.toml"))
}

fn measured(name: &str) -> Measured {
    Measured { name: name.to_owned(), ..Measured::default() }
}

fn shipped(path: &str) -> Config {
    Config::load(&Path::new(ROOT).join(path)).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn the_default_study_says_what_it_says() {
    let config = shipped("pipeline.toml");
    assert_eq!((config.study.repetitions, config.study.resolution), (3, Resolution::Coarse));
    let names: Vec<_> =
        config.parameters.iter().map(|parameter| (parameter.name, parameter.lower, parameter.upper)).collect();
    assert_eq!(
        names,
        [("particle_density", 2542.9, 2834.7), ("rolling_friction", 0.1, 0.9), ("sliding_friction", 0.1, 0.9)]
    );
    assert!(config.design.interior >= 20 && config.design.validation >= 8 && config.design.boundary_levels == 3);
    assert_eq!(config.verify.counts, [3], "counts above the repetitions are left out");
    assert_eq!(config.validate.experiment.name(), "hopper");
    assert_eq!(
        config.experiments().iter().map(|experiment| experiment.name()).collect::<Vec<_>>(),
        ["pile", "ledge", "bulk_density"]
    );
    assert_eq!(config.metamodel.kinds, MetamodelKind::ALL);
    assert_eq!(config.calibrate.approaches, Approach::ALL);
    assert_eq!((config.calibrate.c, config.calibrate.weight("bulk_density")), (0.5, 1.0));
    assert_eq!((config.statistics.confidence, config.statistics.convention), (0.95, Convention::Correct));
    assert_eq!(config.diagnose.measured, ["demo", "paper"]);
    assert_eq!(config.diagnose.candidates, ["cohesion", "wall_friction_scatter", "size_distribution"]);
    assert_eq!(config.effects.accept, Accept::Auto);
    assert!(config.effects.active.is_empty(), "the default study declares no effect");
    let paper = config.measured.iter().find(|source| source.name == "paper").unwrap();
    assert!(!paper.comparable, "a coarse set-up does not resolve real gravel");
}

#[test]
fn the_full_study_is_the_papers() {
    let config = shipped("studies/fransen2022.toml");
    assert_eq!((config.study.repetitions, config.study.resolution), (50, Resolution::Full));
    assert_eq!((config.design.boundary_levels, config.design.interior, config.design.validation), (3, 100, 32));
    assert_eq!(config.verify.counts, [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 15, 20, 30, 40, 50]);
    assert_eq!(config.validate.repetitions, 5);
    // What the paper leaves open and its published simulations decide (docs/physics.md); all else is its own or a default.
    let chosen = [("damping_reading", "constant"), ("deletion_reference", "top"), ("pile.drop_height", "0.15")];
    for spec in specs() {
        let settings = config.base_settings();
        match chosen.iter().find(|(name, _)| *name == spec.name) {
            Some((name, text)) => assert_eq!(settings.text(name).unwrap(), *text),
            None => {
                let value = settings.get(spec.name).unwrap();
                assert_eq!(value.to_bits(), spec.default_value().to_bits(), "{} is not the paper's", spec.name);
            }
        }
    }
}

#[test]
fn the_shipped_file_shows_every_key_and_every_default_of_the_schema() {
    let schema: serde_json::Value = serde_json::from_str(&schema::text()).unwrap();
    let study: toml::Table = template::pipeline().parse().unwrap();
    let mut seen = 0;
    for (section, schema) in schema["properties"].as_object().unwrap() {
        if ["prior", "uncertain", "equipment"].contains(&section.as_str()) {
            // What the default study does without is shown as a comment.
            let commented = template::pipeline().split_once(&format!("# [[{section}]]\n")).expect(section).1;
            let keys = schema["items"]["properties"].as_object().unwrap();
            keys.keys().for_each(|key| assert!(commented.contains(&format!("# {key} = ")), "{section}.{key}"));
        } else if section != "setup" {
            let table = match &study[section] {
                toml::Value::Array(items) => vec![(&schema["items"], items[0].as_table().unwrap())],
                toml::Value::Table(table) if section == "parameters" => {
                    table.values().map(|inner| (&schema["additionalProperties"], inner.as_table().unwrap())).collect()
                }
                other => vec![(schema, other.as_table().unwrap())],
            };
            table.iter().for_each(|(schema, table)| seen += shown(section, schema, table));
        }
    }
    assert!(seen > 50, "only {seen} keys were compared");
}

/// Asserts that `table` has every key of its schema, except free ones; gives their number.
fn shown(path: &str, schema: &serde_json::Value, table: &toml::Table) -> usize {
    let properties = schema["properties"].as_object().unwrap();
    let mut count = 0;
    for (key, inner) in properties {
        let path = format!("{path}.{key}");
        match table.get(key) {
            Some(toml::Value::Table(table)) if path != "effects.active" && path != "calibrate.weights" => {
                count += shown(&path, inner, table);
            }
            Some(_) => count += 1,
            None => panic!("{path} is not shown in pipeline.toml"),
        }
    }
    count
}

#[test]
fn what_is_left_out_takes_the_default_of_the_shipped_file() {
    let (minimal, shipped) = (parse(MINIMAL).unwrap(), shipped("pipeline.toml"));
    let sections = ["design", "experiments", "statistics", "metamodel", "calibrate", "verify", "validate", "effects"];
    let texts = |config: &Config| {
        // The shipped study verifies fewer counts, to stay within minutes.
        let own = |path: &str| path.starts_with("calibrate.weights") || path == "verify.counts";
        config.settings_text(&sections).into_iter().filter(move |(path, _)| !own(path))
    };
    assert_eq!(texts(&minimal).collect::<Vec<_>>(), texts(&shipped).collect::<Vec<_>>());
    let thresholds = ["diagnose.thresholds"];
    assert_eq!(minimal.settings_text(&thresholds), shipped.settings_text(&thresholds));
}

#[test]
fn values_with_units_and_plain_numbers_have_the_same_text() {
    let with = |setup: &str| parse(&format!("{MINIMAL}\n[setup]\n{setup}")).unwrap().settings_text(&["setup"]);
    assert_eq!(with("radius_mean = \"5.02 mm\""), with("radius_mean = 0.00502"));
    assert_eq!(with("[setup.pile]\ndrop_height = \"40 cm\""), with("\"pile.drop_height\" = 0.4"));
    assert_eq!(with("radius_mean = \"5.02 mm\""), with(""), "a default written out changes nothing");
    let changed = with("slope_operator = \"slices\"");
    let difference: Vec<_> = changed.iter().filter(|entry| !with("").iter().any(|other| other == *entry)).collect();
    assert_eq!(difference, [(&"setup.slope_operator".to_owned(), &"slices".to_owned())]);
}

#[test]
fn texts_are_chosen_by_whole_path_parts() {
    let config = parse(&format!("{MINIMAL}\n[effects.active]\ncohesion = 0.2\n")).unwrap();
    assert_eq!(
        config.settings_text(&["effects.active"]).into_iter().collect::<Vec<_>>(),
        [("effects.active.cohesion".to_owned(), "0.2".to_owned())]
    );
    assert_eq!(config.settings_text(&["study.seed"]).len(), 1);
    assert!(config.settings_text(&["effect", "stud"]).is_empty());
    assert_eq!(config.effects.active, [("cohesion".to_owned(), 0.2)]);
    assert!(!config.diagnose.candidates.contains(&"cohesion".to_owned()), "the model already has it");
}

#[test]
fn other_repetitions_change_what_depends_on_them_and_are_checked() {
    let config = parse(MINIMAL).unwrap();
    let grown = config.with_repetitions(7).unwrap();
    assert_eq!((grown.study.repetitions, grown.verify.counts.as_slice()), (7, [1, 2, 3, 4, 5, 6, 7].as_slice()));
    assert_eq!(grown.settings_text(&["study.repetitions"])["study.repetitions"], "7");
    assert_eq!(grown.settings_text(&["design", "setup"]), config.settings_text(&["design", "setup"]));
    assert!(config.with_repetitions(0).unwrap_err().to_string().contains("--reps: 0 repetitions cannot be run"));
    let late = parse(&format!("{MINIMAL}\n[verify]\ncounts = [3]\n")).unwrap();
    assert!(late.with_repetitions(2).unwrap_err().to_string().contains("`verify.counts`: none is at most"));
}

#[test]
fn parameters_map_to_the_unit_interval_and_back() {
    let linear = Parameter { name: "sliding_friction", unit: "1", lower: 0.1, upper: 0.9, scale: Scale::Linear };
    let log = Parameter { lower: 1e-3, upper: 10.0, scale: Scale::Log, ..linear };
    for parameter in [linear, log] {
        assert_eq!((parameter.from_unit(0.0), parameter.from_unit(1.0)), (parameter.lower, parameter.upper));
        for step in 0..=100 {
            let position = f64::from(step) / 100.0;
            let value = parameter.from_unit(position);
            assert!((parameter.lower..=parameter.upper).contains(&value));
            // One rounding each of a product and a logarithm.
            assert!((parameter.to_unit(value) - position).abs() < 1e-14, "{parameter:?} at {position}");
        }
    }
    assert!((log.from_unit(0.5) - 0.1).abs() < 1e-15);
}

#[test]
fn a_dimension_of_an_experiment_can_be_a_parameter_with_its_dot_quoted_or_not() {
    let of = |header: &str| {
        parse(&plus(&format!("[parameters.{header}]\nlower = \"300 mm\"\nupper = 0.5"))).unwrap().parameters
    };
    assert_eq!(of("pile.drop_height"), of("\"pile.drop_height\""));
    assert_eq!((of("pile.drop_height")[0].name, of("pile.drop_height")[0].lower), ("pile.drop_height", 0.3));
}

#[test]
fn paths_are_relative_to_the_study() {
    let config = Config::parse(MINIMAL, Path::new("some where/study.toml")).unwrap();
    assert_eq!(config.artifacts(), Path::new("some where/artifacts"));
    assert_eq!(config.resolve(&config.measured[0].path), Path::new("some where/lab.csv"));
    assert_eq!(parse(MINIMAL).unwrap().artifacts(), Path::new("artifacts"));
}

#[test]
fn priors_belong_to_a_data_set() {
    let prior =
        "[[prior]]\nparameter = \"particle_density\"\nmeasured = \"lab\"\nmean = \"2.3134 g/cm3\"\nsd = 30\nn = 10\n";
    let density = "[parameters.particle_density]\nlower = 2500\nupper = 2800\n";
    let config = parse(&format!("{MINIMAL}{density}{prior}")).unwrap();
    let priors: Vec<_> = config.priors_of(&measured("lab"));
    assert_eq!(
        (priors[0].parameter, priors[0].mean, priors[0].sd, priors[0].n),
        ("particle_density", 2313.4, 30.0, 10)
    );
    assert!(config.priors_of(&measured("other")).is_empty());
    // What the data say of the grains is a prior of its own accord, but does not overrule the study.
    let property = |kpi, mean| MeasuredSummary { experiment: "grains", kpi, unit: "1", mean, sd: 0.1, n: 4 };
    let known = |name: &str, kpi| Measured { properties: vec![property(kpi, 0.3)], ..measured(name) };
    assert_eq!(config.priors_of(&known("other", config.parameters[0].name))[0].mean, 0.3);
    assert!(config.priors_of(&known("other", "damping")).is_empty(), "not calibrated");
    assert_eq!(config.priors_of(&known("lab", config.priors[0].parameter)).len(), 1);
    assert_ne!(config.priors_of(&known("lab", config.priors[0].parameter))[0].mean, 0.3);
}

#[test]
fn uncertain_settings_belong_to_a_data_set_and_have_units() {
    let uncertain = "[[uncertain]]\nmeasured = \"lab\"\nsetting = \"pile.drop_height\"\nsd = \"2 cm\"\n";
    let config = parse(&format!("{MINIMAL}{uncertain}")).unwrap();
    let [one] = &config.uncertain[..] else { panic!("{:?}", config.uncertain) };
    assert_eq!((&*one.measured, one.setting.name, one.sd), ("lab", "pile.drop_height", 0.02));
    let other = "[[uncertain]]\nmeasured = \"lab\"\nsetting = \"ledge.depth\"\nsd = 0.01\n";
    assert_eq!(parse(&format!("{MINIMAL}{uncertain}{other}")).unwrap().uncertain.len(), 2);
}

/// Adds `text` to the smallest study.
fn plus(text: &str) -> String {
    format!("{MINIMAL}{text}\n")
}

/// Replaces part of the smallest study.
fn instead(from: &str, to: &str) -> String {
    assert!(MINIMAL.contains(from), "{from}");
    MINIMAL.replace(from, to)
}

#[test]
fn mistakes_are_answered_with_line_reason_and_remedy() {
    let cases = [
        // Syntax.
        (plus("[design\ninterior = 3"), "pipeline.toml:11: "),
        (plus("seed = 1\nseed = 2"), "duplicate key"),
        (String::new(), "`study.name`: key is missing"),
        // Names.
        (plus("[desing]\ninterior = 3"), "pipeline.toml:11: unknown section `desing`; did you mean `design`?"),
        (plus("[design]\ninteror = 3"), "pipeline.toml:12: unknown key `interor`; did you mean `interior`?"),
        (
            plus("[design]\nzzzzzz = 3"),
            "unknown key `zzzzzz`; there are: boundary_levels, interior, filling, added, points, validation",
        ),
        (
            plus("[setup]\nsliding_fricton = 0.3"),
            "`setup.sliding_fricton`: no such setting; did you mean `sliding_friction`?",
        ),
        (plus("[setup]\ndrop_height = 0.3"), "`setup.drop_height`: no such setting; did you mean `pile.drop_height`?"),
        (plus("[setup.pile]\nradius_mean = 0.005"), "`radius_mean` is shared by the experiments; move it to [setup]"),
        (plus("[setup.pille]\ndepth = 0.1"), "`setup.pille` is not an experiment; did you mean `pile`?"),
        (
            plus("[parameters.rolling_fricton]\nlower = 0\nupper = 1"),
            "`parameters.rolling_fricton`: no such setting; did you mean `rolling_friction`?",
        ),
        (
            plus("[parameters.pile.drop_hight]\nlower = 0\nupper = 1"),
            "`parameters.pile.drop_hight`: no such setting; did you mean `pile.drop_height`?",
        ),
        (
            plus(
                "[parameters.pile.depth]\nlower = 0.1\nupper = 0.2\n[parameters.\"pile.depth\"]\nlower = 0.1\nupper = 0.2",
            ),
            "`parameters.pile.depth` stands twice; remove one",
        ),
        // Bounds of the particle density may be left out together, those of others may not.
        (
            plus("[parameters.particle_density]\nupper = 2800"),
            "pipeline.toml:11: `parameters.particle_density.lower`: key is missing; add it, or leave out both bounds",
        ),
        (plus("[parameters.damping]"), "`parameters.damping.lower`: key is missing; add it (lower bound)"),
        (
            instead("[parameters.sliding_friction]\nlower = 0.1\nupper = 0.9", "[parameters.particle_density]"),
            "`parameters.particle_density`: bounds come from the ends of the other parameters, of which there is none",
        ),
        (
            plus("[parameters.particle_density]\n[experiments]\nfitted = [\"pile\"]"),
            "`experiments.fitted`: lacks bulk_density, whose test gives the bounds",
        ),
        (
            plus("[parameters.particle_density]\n[setup]\nparticle_density = 2500"),
            "pipeline.toml:11: `parameters.particle_density.lower`: is calibrated, but [setup] fixes it",
        ),
        (plus("[metamodel]\nkind = [\"sk\"]"), "unknown key `kind`; did you mean `kinds`?"),
        (
            plus("[parameters.slope_operator]\nlower = 0\nupper = 1"),
            "a choice between front, slices, silhouette cannot be calibrated",
        ),
        (plus("[effects.active]\ncohesin = 1"), "unknown effect `cohesin`; did you mean `cohesion`?"),
        (plus("[diagnose]\ncandidates = [\"cohesin\"]"), "`cohesin` is not one of"),
        (
            plus("[calibrate.weights]\nangle_of_repos = 1"),
            "unknown KPI `angle_of_repos`; did you mean `angle_of_repose`?",
        ),
        (
            plus("[diagnose]\nmeasured = [\"labb\"]"),
            "`diagnose.measured`: no [[measured]] is called `labb`; did you mean `lab`?",
        ),
        // Kinds.
        (
            plus("[design]\ninterior = 3.5"),
            "`design.interior`: a whole number is expected, but this is the decimal number 3.5",
        ),
        (plus("[design]\ninterior = \"3\""), "a whole number is expected, but this is the text \"3\""),
        (plus("design = 3"), "pipeline.toml:11: unknown key `design`; it is a section of its own, [design]"),
        (
            plus("[design]\nrepetitions = 3"),
            "unknown key `repetitions`; it belongs to [study] or [bounds] or [validate]",
        ),
        (
            format!("design = 3\n{MINIMAL}"),
            "pipeline.toml:1: `design` is a section; write [design] on a line of its own",
        ),
        (plus("[measured.lab]\nname = \"x\""), "pipeline.toml:11: "),
        (
            format!("measured = 3\n{}", instead("[[measured]]", "[study2]")),
            "`measured` is written with two brackets, one [[measured]] per item",
        ),
        (
            instead("comparable = true", "comparable = \"yes\""),
            "pipeline.toml:10: `measured.lab.comparable`: true or false is expected",
        ),
        (
            instead("comparable = true", ""),
            "pipeline.toml:7: `measured.lab.comparable`: key is missing; add it (whether the set-up resolves",
        ),
        (plus("[diagnose]\ncandidates = \"cohesion\""), "\"all\" or a list of names is expected"),
        (
            instead("\"tiny\"", "\"Tiny Study\""),
            "pipeline.toml:3: `study.name`: `Tiny Study` is not a name; use lower-case letters",
        ),
        (instead("\"lab\"", "\"all\""), "`all` stands for every data set; use another name"),
        (instead("\"lab.csv\"", "\"\""), "the path is empty"),
        // Units.
        (
            plus("[setup]\nradius_mean = \"5.02 MPa\""),
            "`5.02 MPa` is a pressure, but a length such as \"5.02 mm\" is expected here",
        ),
        (plus("[setup]\nradius_mean = \"5,02 mm\""), "decimals take a point, not a comma"),
        (plus("[setup]\nradius_mean = \"5.02 mmm\""), "unit `mmm` is not known"),
        (
            instead("lower = 0.1", "lower = \"0.1 m\""),
            "pipeline.toml:5: `parameters.sliding_friction.lower`: `0.1 m` is a length, but a plain number",
        ),
        (plus("[setup]\nradius_mean = nan"), "`nan` is not a number"),
        (plus("[setup]\nradius_mean = inf"), "`inf` is not a number"),
        (
            plus("[setup]\ngravity = true"),
            "an acceleration such as \"9.81 m/s2\" is expected, but this is the flag true",
        ),
        // Ranges.
        (plus("[setup]\nradius_mean = 5.02"), "`setup.radius_mean`: 5.02 m is above 0.1 m; allowed is 0.0001 to 0.1 m"),
        (
            plus("[setup]\nslope_operator = \"side\""),
            "`setup.slope_operator`: `side` is not one of front, slices, silhouette",
        ),
        (plus("[design]\ninterior = -3"), "`design.interior`: -3 is below 0; allowed is 0 to 1000000"),
        (plus("[design]\ninterior = 99999999999999999999999"), "pipeline.toml:12: "),
        (plus("[statistics]\nconfidence = 95"), "`statistics.confidence`: 95 is above 0.9999"),
        (plus("[statistics]\nconvention = \"papr\""), "`papr` is not one of correct, paper; did you mean `paper`?"),
        (plus("[effects.active]\ncohesion = 50"), "`effects.active.cohesion`: 50 is above 2"),
        (plus("[metamodel]\nlog10_a = [1, -1]"), "1 stands before -1; sort the list"),
        (plus("[metamodel]\nlog10_a = [1]"), "1 items; an interval is [lower, upper]"),
        (plus("[validate]\nrepetitions = 1"), "`validate.repetitions`: 1 is below 2"),
        // Lists.
        (plus("[metamodel]\nkinds = []"), "`metamodel.kinds`: the list is empty; give at least one item"),
        (plus("[metamodel]\nkinds = [\"sk\", \"sk\"]"), "`sk` stands twice; remove one"),
        (plus("[experiments]\nfitted = []"), "`experiments.fitted`: the list is empty"),
        (plus("[verify]\ncounts = [3, 2]"), "3 stands before 2; sort the list and drop what is double"),
        (
            plus("[[measured]]\nname = \"lab\"\npath = \"b.csv\"\ncomparable = true"),
            "pipeline.toml:11: a second [[measured]] for `lab`; give it another name",
        ),
        (
            instead("comparable = true", "comparable = true\ncontrols = [\"labb\"]"),
            "pipeline.toml:11: `measured.lab.controls`: no [[measured]] is called `labb`; did you mean `lab`?",
        ),
        (
            instead("comparable = true", "comparable = true\ncontrols = [\"lab\"]"),
            "`measured.lab.controls`: `lab` cannot be its own control; remove it",
        ),
        (
            plus(
                "[[measured]]\nname = \"b\"\npath = \"b.csv\"\ncomparable = true\ncontrols = [\"c\"]\n\
                 [[measured]]\nname = \"c\"\npath = \"c.csv\"\ncomparable = true\ncontrols = [\"lab\"]",
            ),
            "`measured.b.controls`: `c` has controls of its own; name those instead",
        ),
        // Sections against each other.
        (
            instead("lower = 0.1", "lower = 0.9"),
            "pipeline.toml:5: `parameters.sliding_friction.lower`: 0.9 is not below the upper bound 0.9",
        ),
        (
            instead("upper = 0.9", "upper = 7"),
            "`parameters.sliding_friction.upper`: 7 lies outside the setting's range",
        ),
        (instead("lower = 0.1", "lower = 0\nscale = \"log\""), "a log scale needs a lower bound above 0"),
        (
            plus("[setup]\nsliding_friction = 0.3"),
            "`parameters.sliding_friction.lower`: is calibrated, but [setup] fixes it in line 12",
        ),
        (
            plus("[setup]\n\"pile.depth\" = 0.1\n[setup.pile]\ndepth = 0.1"),
            "`setup.pile.depth` stands twice, first in line",
        ),
        (
            instead("[parameters.sliding_friction]", "[design]").replace("lower = 0.1\nupper = 0.9", ""),
            "nothing to calibrate; add a section",
        ),
        (MINIMAL.split("[[measured]]").next().unwrap().to_owned(), "no measured data; add a [[measured]] section"),
        (plus("[design]\nboundary_levels = 1"), "one level spans nothing; take 0 (none) or 2 and more"),
        (plus("[design]\nboundary_levels = 0\ninterior = 2"), "2 points cannot show the slopes of 1 parameters"),
        (
            plus("[experiments]\nfitted = [\"pile\", \"hopper\"]"),
            "`hopper` is fitted too; validation needs an experiment the calibration never sees",
        ),
        (plus("[verify]\ncounts = [20]"), "`verify.counts`: none is at most study.repetitions = 3"),
        (plus("[metamodel]\nkinds = [\"ibm\"]"), "`diagnose.kind`: `sk` is not trained"),
        (
            plus("[diagnose]\ncandidates = [\"cohesion\"]\n[effects]\naccept = \"tilt\""),
            "`tilt` is not among diagnose.candidates",
        ),
        (
            plus("[diagnose]\ncandidates = [\"cohesion\"]\n[effects.active]\ncohesion = 1"),
            "every candidate is already active",
        ),
        (
            plus("[[prior]]\nparameter = \"particle_density\"\nmeasured = \"lab\"\nmean = 2313\nsd = 30\nn = 10"),
            "`particle_density` is no parameter of this study",
        ),
        (
            plus("[[uncertain]]\nmeasured = \"lab\"\nsetting = \"pile.drop_heigth\"\nsd = 0.1"),
            "no setting is called `pile.drop_heigth`; the nearest name is `pile.drop_height`",
        ),
        (
            plus("[[uncertain]]\nmeasured = \"lab\"\nsetting = \"sliding_friction\"\nsd = 0.1"),
            "`uncertain.lab.sliding_friction.setting`: `sliding_friction` is calibrated; say what is known of it in a [[prior]]",
        ),
        (
            plus("[[uncertain]]\nmeasured = \"lab\"\nsetting = \"hopper.slot\"\nsd = 0.01"),
            "no fitted experiment reads `hopper.slot`",
        ),
        (
            plus("[[uncertain]]\nmeasured = \"lab\"\nsetting = \"pile.drop_height\"\nsd = 0"),
            "`uncertain.lab.pile.drop_height.sd`: is not above 0",
        ),
        (plus("[[uncertain]]\nmeasured = \"lab\"\nsetting = \"ledge.depth\"\nsd = 1"), "one standard deviation off, "),
        (
            plus("[[prior]]\nparameter = \"sliding_friction\"\nmeasured = \"lab\"\nmean = 0.5\nsd = 0\nn = 10"),
            "`prior.lab.sliding_friction.sd`: is not above 0",
        ),
        (
            plus("[setup.pile]\nrelease_time = 50"),
            "pile: `pile.release_time` (50 s) must be below `pile.time_cap` (10 s); change one of the two",
        ),
    ];
    assert!(cases.len() >= 30);
    let mut wrong = String::new();
    for (text, snippet) in cases {
        let message = parse(&text).map_or_else(|problems| problems.to_string(), |_| "accepted".to_owned());
        if !message.contains(snippet) || !message.contains("pipeline.toml") {
            wrong.push_str(&format!("{text}\n  gave     {message}\n  expected {snippet}\n"));
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}

#[test]
fn all_problems_are_told_at_once_in_the_order_of_their_lines() {
    let message = parse(&plus("[design]\ninterior = -3\nvalidation = \"x\"\n[desing]\n[statistics]\nconfidence = 95"))
        .unwrap_err()
        .to_string();
    let lines: Vec<_> = message.lines().skip(1).map(|line| line.trim().split(": ").next().unwrap()).collect();
    assert_eq!(message.lines().next(), Some("4 problems:"));
    assert_eq!(lines, ["pipeline.toml:12", "pipeline.toml:13", "pipeline.toml:14", "pipeline.toml:16"]);
}

#[test]
fn a_missing_study_says_how_to_get_one() {
    let message = Config::load(Path::new("no/such.toml")).unwrap_err().to_string();
    assert!(message.contains("cannot read the study no/such.toml") && message.contains("granulake init"), "{message}");
}

#[test]
fn the_papers_targets_read_as_printed() {
    let config = shipped("studies/fransen2022.toml");
    let sets = config.read_measured().unwrap_or_else(|problems| panic!("{problems}"));
    let statistics: Vec<_> = sets[0].statistics().into_iter().map(|s| (s.kpi, s.mean, s.sd, s.n, s.unit)).collect();
    assert_eq!(
        statistics,
        [
            ("bulk_density", 1473.1, 10.94, 50, "kg/m3"),
            ("discharge_rate", 3.68, 0.025, 5, "kg/s"),
            ("angle_of_movement", 41.40, 1.38, 50, "deg"),
            ("angle_of_repose", 25.43, 2.09, 50, "deg"),
        ]
    );
}

#[test]
fn the_measured_template_asks_for_every_observable_and_becomes_data_when_filled_in() {
    for observable in EXPERIMENTS.iter().flat_map(|experiment| experiment.observables()) {
        let row = template::measured().lines().find(|line| line.split_whitespace().nth(2) == Some(observable.name));
        let row = row.unwrap_or_else(|| panic!("the template does not ask for {}", observable.name));
        assert_eq!(row.split_whitespace().nth(3), Some(observable.unit), "{row}");
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("mine.csv");
    std::fs::write(&file, template::measured()).unwrap();
    let empty = granulake::config::Measured::read("mine", &file).unwrap_err().to_string();
    assert!(empty.contains("holds a header but no rows"), "{empty}");
    let filled =
        format!("{}pile,1,angle_of_repose,25.1,deg,\npile,2,angle_of_repose,25.9,deg,\n", template::measured());
    std::fs::write(&file, filled).unwrap();
    assert_eq!(granulake::config::Measured::read("mine", &file).unwrap().values.len(), 2);
}

#[test]
fn a_new_folder_holds_a_valid_study() {
    let folder = tempfile::tempdir().unwrap();
    for (path, text) in template::files() {
        let path = folder.path().join(path);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    let config = Config::load(&folder.path().join("pipeline.toml")).unwrap();
    assert!(config.resolve(Path::new("artifacts/measured/fransen2022.csv")).is_file());
}

#[test]
fn the_schema_knows_every_setting_and_effect() {
    let schema: serde_json::Value = serde_json::from_str(&schema::text()).unwrap();
    let setup = &schema["properties"]["setup"]["properties"];
    for spec in specs() {
        let found = match spec.name.split_once('.') {
            Some((experiment, name)) => &setup[experiment]["properties"][name],
            None => &setup[spec.name],
        };
        assert!(found["description"].as_str().is_some_and(|text| text.contains(spec.meaning)), "{}", spec.name);
    }
    let active = &schema["properties"]["effects"]["properties"]["active"]["properties"];
    assert!(EFFECTS.iter().all(|effect| active[effect.name()].is_object()));
    assert_eq!(schema::text(), schema::text());
}

const DECLARED: &str = "[effects.drop]\nsetting = \"pile.drop_height\"\nkind = \"shift\"\nrange = [\"-50 mm\", 0.05]\n\
                        source = \"a ruler\"\n[diagnose]\ncandidates = [\"drop\", \"cohesion\"]\n";

#[test]
fn a_study_declares_effects_of_its_own() {
    let config =
        parse(&format!("{MINIMAL}{DECLARED}[effects]\naccept = \"drop\"\n[effects.active]\ntilt = 1")).unwrap();
    assert_eq!(config.diagnose.candidates, ["drop", "cohesion"]);
    assert_eq!(config.effects.accept, Accept::Effect("drop".to_owned()));
    let effect = config.effects.library.find("drop").unwrap();
    assert_eq!((effect.range(), effect.unit()), ((-0.05, 0.05), "m"));
    // Only those that are on, or may be named, enter the keys of the stages that see them.
    assert!(!config.active_text().keys().any(|path| path.starts_with("effects.drop")));
    let active = parse(&format!("{MINIMAL}{DECLARED}[effects.active]\ndrop = \"10 mm\"")).unwrap();
    assert!(active.active_text().contains_key("effects.drop.range"));
    assert_eq!(active.effects.active, [("drop".to_owned(), 0.01)]);
    assert_eq!(active.diagnose.candidates, ["cohesion"]);
    // \"all\" holds them too.
    let all = parse(&format!("{MINIMAL}{}", DECLARED.replace("[\"drop\", \"cohesion\"]", "\"all\""))).unwrap();
    assert!(all.diagnose.candidates.contains(&"drop".to_owned()) && all.diagnose.candidates.len() == EFFECTS.len() + 1);
}

#[test]
fn wrong_declarations_are_refused_with_a_remedy() {
    for (from, to, wanted) in [
        ("pile.drop_height", "pile.drop_heigt", "the nearest name is `pile.drop_height`"),
        ("pile.drop_height", "damping_reading", "is a choice between"),
        ("effects.drop", "effects.tilt", "is built in; choose another name"),
        ("effects.drop", "effects.Drop", "cannot name an effect"),
        ("\"shift\"", "\"shove\"", "is not one of shift, scatter, drift"),
        ("\"shift\"", "\"scatter\"", "a scatter is not negative"),
        ("[\"-50 mm\", 0.05]", "[0.01, 0.05]", "must hold 0"),
        ("[\"-50 mm\", 0.05]", "[\"-50 mm\", 9.0]", "narrow the range"),
        ("[\"-50 mm\", 0.05]", "[\"-50 kg\", 0.05]", "kg"),
        ("source = \"a ruler\"", "source = 3", "a text in quotes is expected"),
        ("[effects.drop]\n", "[effects.drop]\nunit = \"m\"\n", "unknown key `unit`"),
        ("[\"drop\", ", "[\"drip\", ", "did you mean `drop`?"),
    ] {
        assert!(DECLARED.contains(from), "{from}");
        let problems = parse(&format!("{MINIMAL}{}", DECLARED.replace(from, to))).unwrap_err().to_string();
        assert!(problems.contains(wanted), "{from} -> {to}: {problems}");
    }
}
