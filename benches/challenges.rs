//! Error rates of the verdict, layer (a) of `challenges.sh`: measured sets drawn from pools of stored runs.
//!
//! `cargo bench --bench challenges -- FOLDER POOL SETS COUNTS PLACES PANELS EVIDENCE [TRUTH…]` takes a study that is trained.
//! For every truth, or for those named as `none` and `cohesion=1`, at every place of PLACES (as `A,B`), it stores POOL runs of
//! each fitted experiment, prepares PANELS diagnoses with their own direct runs at data of other seeds, draws SETS measured sets of every count of COUNTS (as
//! `10,20,50`) from the pool, and calibrates, diagnoses and scores each by one of them: with all observables, the KPIs alone,
//! or all of them but the true effect left out of the library (EVIDENCE, as `all,kpis,without`). A cell that stands in
//! FOLDER/rates.csv already is not done again. FOLDER alone prints what stands there, the tables of docs/challenges.md.
//! `strengths` in EVIDENCE prints how the strengths of the hidden effect lie about the true one; this is not kept.

use granulake::campaign::{Campaign, Options, Values};
use granulake::challenge::{ConfusionMatrix, Declaration, Score, Solution, Truth, score};
use granulake::config::{Config, Measured, MeasuredSource, MeasuredValue};
use granulake::experiments::EXPERIMENTS;
use granulake::pipeline::Study;
use granulake::rng::Stream;
use granulake::stages::{Context, Panel, PanelRows};
use granulake::stats::summary::{clopper_pearson, mean, sd};
use granulake::tables::KpiRow;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;
use std::fmt::Write;
use std::path::{Path, PathBuf};

type Failed = Box<dyn Error + Send + Sync>;

/// Places of the hidden parameters in the unit cube, in the order of a study's parameters: two far apart, and one so near the upper
/// bound of the second that fits may end on it.
const PLACES: [(&str, [f64; 3]); 3] = [("A", [0.35, 0.35, 0.65]), ("B", [0.65, 0.7, 0.3]), ("C", [0.5, 0.97, 0.5])];
/// What is hidden, and whether the same data are also diagnosed without that candidate.
const TRUTHS: &[(Option<(&str, f64)>, bool)] = &[
    (None, false),
    (Some(("cohesion", 1.0)), true),
    (Some(("size_distribution", 0.1)), true),
    (Some(("cohesion", 0.3)), false),
    (Some(("fill_level", 0.1)), true),
    (Some(("wall_friction_scatter", 0.25)), false),
    (Some(("tilt", 2.0)), false),
];
/// Seed of the pools, and of the reference data of the first panel; packings of challenges come from a context of their own.
const SEEDS: [u64; 2] = [9001, 9002];
/// Repetitions of the reference data, at whose optimum the direct runs are made.
const REFERENCE: u32 = 50;
/// Repetitions of direct runs for each of a measured set. The sets of a panel share these runs, so that an error of theirs is
/// no noise between sets: it must be small beside theirs, and several panels must be averaged.
const REFINE: u32 = 5;
/// Draws behind the detection limit of a cell.
const LIMIT_DRAWS: usize = 1000;
/// Scatter of a weighing of the grains [kg/m³], and their number.
const WEIGHINGS: (f64, u32) = (30.0, 10);

fn main() -> Result<(), Failed> {
    // cargo passes `--bench` on to the binary.
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let [folder, pool, sets, counts, places, panels, evidence, truths @ ..] = arguments.as_slice() else {
        match arguments.first() {
            Some(folder) => Book::open(Path::new(folder).join("rates.csv"))?.print(),
            None => println!("challenges: no folder given, nothing to do; see benches/challenges.sh"),
        }
        return Ok(());
    };
    let counts = counts.split(',').map(str::parse).collect::<Result<Vec<u32>, _>>()?;
    let panels: u32 = panels.parse()?;
    let places: Vec<String> = places.split(',').map(str::to_owned).collect();
    one_of("PLACES", &places, &PLACES.map(|(name, _)| name.to_owned()))?;
    let evidence: Vec<String> = evidence.split(',').map(str::to_owned).collect();
    one_of("EVIDENCE", &evidence, &["all", "kpis", "without", STRENGTHS].map(str::to_owned))?;
    one_of("TRUTH", truths, &TRUTHS.iter().map(|(effect, _)| name_of(*effect)).collect::<Vec<_>>())?;
    let plan = Plan { pool: pool.parse()?, sets: sets.parse::<u32>()? / panels.max(1), counts, evidence };
    let study = Study::load(&Path::new(folder).join("pipeline.toml"))?;
    let campaign = study.campaign(Options { progress: false, ..Options::default() })?;
    let mut book = Book::open(Path::new(folder).join("rates.csv"))?;
    let places: Vec<_> = PLACES.into_iter().filter(|(name, _)| places.iter().any(|asked| asked == name)).collect();
    // Every truth has its first panel before any has its second.
    for panel in 1..=panels {
        let asked = |truth: &Hidden| truths.is_empty() || truths.contains(&truth.name());
        for truth in places.iter().flat_map(|place| hidden(&study.config, place)).filter(asked) {
            truth.cells(&study, &campaign, (&plan, panel), &mut book)?;
        }
    }
    book.print();
    Ok(())
}

/// Fails on the first word that is not known.
fn one_of(what: &str, words: &[String], known: &[String]) -> Result<(), Failed> {
    match words.iter().find(|word| !known.contains(word)) {
        Some(word) => Err(format!("{what} `{word}` is none of {}", known.join(", ")).into()),
        None => Ok(()),
    }
}

fn name_of(effect: Option<(&str, f64)>) -> String {
    effect.map_or("none".to_owned(), |(name, strength)| format!("{name}={strength}"))
}

/// What is hidden at a place: the truths that the study has among its candidates.
fn hidden<'t>(
    config: &Config,
    (theta, place): &'t (&'static str, [f64; 3]),
) -> impl Iterator<Item = Hidden<'t>> + use<'t> {
    let candidates = config.diagnose.candidates.clone();
    let known = move |effect: &Option<(&str, f64)>| effect.is_none_or(|(name, _)| candidates.iter().any(|c| c == name));
    let truths = TRUTHS.iter().filter(move |(effect, _)| known(effect));
    truths.map(move |(effect, left_out)| Hidden { theta, place, effect: *effect, left_out: *left_out })
}

/// What the verdicts of a line were made by: a later form of engine or diagnosis does its cells anew.
fn form() -> String {
    let diagnosis = granulake::stages::find("diagnose").map_or(0, |stage| stage.version);
    format!("physics {} diagnose {diagnosis}", granulake::dem::PHYSICS_VERSION)
}

/// Sizes.
struct Plan {
    pool: u32,
    /// Sets of every panel in a cell.
    sets: u32,
    counts: Vec<u32>,
    /// What is judged: `all`, `kpis`, `without`.
    evidence: Vec<String>,
}

/// One truth.
struct Hidden<'t> {
    theta: &'static str,
    place: &'t [f64; 3],
    effect: Option<(&'static str, f64)>,
    left_out: bool,
}

/// What one line of the results is about.
struct Cell {
    panel: u32,
    count: u32,
    evidence: &'static str,
    without: Option<&'static str>,
}

impl Hidden<'_> {
    fn name(&self) -> String {
        name_of(self.effect)
    }

    fn key(&self, cell: &Cell, plan: &Plan) -> String {
        let without = cell.without.unwrap_or("-");
        let Cell { panel, count, evidence, .. } = cell;
        let Plan { pool, sets, .. } = plan;
        format!("{},{},{},{count},{evidence},{without},{panel},{pool},{sets}", form(), self.theta, self.name())
    }

    fn parameters(&self, config: &Config) -> Values {
        let value = |(parameter, place): (&granulake::config::Parameter, &f64)| {
            (parameter.name.to_owned(), parameter.from_unit(*place))
        };
        config.parameters.iter().zip(self.place).map(value).collect()
    }

    /// All cells of a panel of this truth that the book lacks.
    fn cells(
        &self,
        study: &Study,
        campaign: &Campaign,
        (plan, panel): (&Plan, u32),
        book: &mut Book,
    ) -> Result<(), Failed> {
        let missing: Vec<Cell> =
            self.cells_of(panel, plan).into_iter().filter(|cell| !book.has(&self.key(cell, plan))).collect();
        if missing.is_empty() {
            return Ok(());
        }
        eprintln!("{} at {}, panel {panel}: {} cells", self.name(), self.theta, missing.len());
        let effects: Values = self.effect.iter().map(|(name, strength)| ((*name).to_owned(), *strength)).collect();
        let truth = Truth { parameters: self.parameters(&study.config), effects, scale: Vec::new() };
        let measure = |repetitions, seed| {
            truth.measure(&study.config, campaign, &study.config.experiments(), (repetitions, 50), seed)
        };
        let (pool, first) = (measure(plan.pool, SEEDS[0])?, measure(REFERENCE, SEEDS[1] + u64::from(panel))?);
        campaign.compact()?;
        self.panel(study, campaign, (&pool, &first), (&missing, plan, book))
    }

    fn cells_of(&self, panel: u32, plan: &Plan) -> Vec<Cell> {
        let of_count = |count: &u32| {
            let cell = |evidence, without| Cell { panel, count: *count, evidence, without };
            let left_out = self.effect.filter(|_| self.left_out).map(|(name, _)| ("without", cell("all", Some(name))));
            let of_strengths = self.effect.map(|_| (STRENGTHS, cell(STRENGTHS, None)));
            let all = [("all", cell("all", None)), ("kpis", cell("kpis", None))]
                .into_iter()
                .chain(left_out)
                .chain(of_strengths);
            let asked = all.filter(|(what, _)| plan.evidence.iter().any(|known| known == what));
            asked.map(|(_, cell)| cell).collect::<Vec<_>>()
        };
        plan.counts.iter().flat_map(of_count).collect()
    }

    /// The cells of one panel, whose direct runs stand at the optima of `first`: these differ with the evidence and with the
    /// library, as in the stage, which knows no observable that was not measured and no candidate that may not be named.
    fn panel(
        &self,
        study: &Study,
        campaign: &Campaign,
        (pool, first): (&[KpiRow], &[KpiRow]),
        (missing, plan, book): (&[Cell], &Plan, &mut Book),
    ) -> Result<(), Failed> {
        let (density, number) = (self.density(&study.config), missing[0].panel);
        let all: Vec<u32> = (1..=REFERENCE).collect();
        let purpose = format!("{} {} reference {number}", self.theta, self.name());
        let left_out = self.effect.map(|(name, _)| ("all", Some(name)));
        for (evidence, without) in [("all", None), ("kpis", None), (STRENGTHS, None)].into_iter().chain(left_out) {
            let cells = missing.iter().filter(|cell| (cell.evidence, cell.without) == (evidence, without));
            let cells: Vec<&Cell> = cells.collect();
            if cells.is_empty() {
                continue;
            }
            let weighings = &mut Stream::new(SEEDS[1], &purpose);
            let sets = [data((first, evidence), &|_| all.clone(), density, weighings)];
            let config = self.config(study, without, plan);
            let context = Context::new(&config, &sets, campaign, study.store().root());
            let least = plan.counts.iter().min().copied().unwrap_or(1);
            let panel = Panel::new(&context, &sets[0], least)?
                .map_err(|why| format!("{} at {}: {why}", self.name(), self.theta))?;
            campaign.compact()?;
            for cell in cells {
                let (drawn, start) = (self.draw(pool, density, cell, plan), std::time::Instant::now());
                if evidence == STRENGTHS {
                    campaign.install(|| self.tell_strengths(&panel, &drawn, cell))?;
                    continue;
                }
                let tally = campaign.install(|| self.judge(&panel, &drawn, cell))?;
                let seconds = start.elapsed().as_secs_f64();
                eprintln!("  {} sets of n = {}, {evidence}: {seconds:.0} s", plan.sets, cell.count);
                book.add(self.key(cell, plan), &tally)?;
            }
        }
        Ok(())
    }

    /// The study with the drawn data, whose candidate `without` may not be named, and direct runs for a panel.
    fn config(&self, study: &Study, without: Option<&str>, plan: &Plan) -> Config {
        let source = MeasuredSource {
            name: NAME.to_owned(),
            path: PathBuf::new(),
            comparable: true,
            note: String::new(),
            controls: Vec::new(),
        };
        let mut config = study.config.with_only(source, without);
        config.diagnose.refine_repetitions = REFINE * plan.counts.iter().max().copied().unwrap_or(1);
        config
    }

    fn density(&self, config: &Config) -> Option<f64> {
        self.parameters(config).into_iter().find(|(name, _)| name == "particle_density").map(|(_, value)| value)
    }

    /// Measured sets drawn from the pool without replacement within a set.
    fn draw(&self, pool: &[KpiRow], density: Option<f64>, cell: &Cell, plan: &Plan) -> Vec<Measured> {
        let first = (cell.panel - 1) * plan.sets;
        (first..first + plan.sets)
            .map(|number| {
                // The same repetitions for every evidence and library, so that these can be compared.
                let purpose = format!("{} {} {} {number}", self.theta, self.name(), cell.count);
                let stream = std::cell::RefCell::new(Stream::new(SEEDS[0], &purpose));
                let pick = |_: &str| some_of(plan.pool, cell.count, &mut stream.borrow_mut());
                data((pool, cell.evidence), &pick, density, &mut Stream::new(SEEDS[0], &format!("weighings {purpose}")))
            })
            .collect()
    }

    /// Prints how the strengths of the hidden effect lie about the true one.
    fn tell_strengths(&self, panel: &Panel, sets: &[Measured], cell: &Cell) -> Result<(), Failed> {
        let Some((name, truth)) = self.effect else { return Ok(()) };
        let drawn: Vec<_> = sets
            .par_iter()
            .map(|set| panel.strength(set, name))
            .collect::<Result<_, granulake::stages::StageError>>()
            .map_err(|e| e.to_string())?;
        let drawn: Vec<(f64, f64)> = drawn.into_iter().flatten().collect();
        println!(
            "{} at {}, panel {}, n = {}: {}",
            self.name(),
            self.theta,
            cell.panel,
            cell.count,
            spread(&drawn, truth)
        );
        Ok(())
    }

    fn judge(&self, panel: &Panel, sets: &[Measured], cell: &Cell) -> Result<Tally, Failed> {
        let first = panel.judge(&sets[0], LIMIT_DRAWS).map_err(|e| e.to_string())?;
        let first = first.ok_or("a drawn set lacks an observable")?;
        // Where nothing was found, whether that is right depends on the detection limit of the set.
        let may_be_weak = self.effect.is_some() && cell.without.is_none();
        let judged = |set| match panel.judge(set, 0)? {
            Some((verdict, ..)) if may_be_weak && verdict.verdict == QUIET => panel.judge(set, LIMIT_DRAWS),
            rows => Ok(rows),
        };
        let judged: Vec<Option<PanelRows>> = sets
            .par_iter()
            .map(judged)
            .collect::<Result<_, granulake::stages::StageError>>()
            .map_err(|e| e.to_string())?;
        let effect = self.effect.map(|(name, strength)| (name.to_owned(), strength));
        let declaration = Declaration { effect, foreign: false, parameters: BTreeMap::default() };
        let by_fits = judged.iter().flatten().filter(|(verdict, ..)| verdict.advice.contains(BY_FITS)).count();
        eprintln!("  {by_fits} of {} sets, n = {}, {}: {BY_FITS}", sets.len(), cell.count, cell.evidence);
        let mut tally = Tally::new(&first);
        for (verdict, attribution, confusion) in judged.into_iter().flatten() {
            tally.add(&score(&declaration, &Solution { verdict, attribution, confusion }));
        }
        Ok(tally)
    }
}

/// The word of EVIDENCE for the strengths of the hidden effect, told from all observables.
const STRENGTHS: &str = "strengths";

/// How strengths lie about the true one.
fn spread(drawn: &[(f64, f64)], truth: f64) -> String {
    let (means, sds): (Vec<f64>, Vec<f64>) = drawn.iter().copied().unzip();
    let errors: Vec<f64> = drawn.iter().map(|(mean, sd)| (mean - truth) / sd).collect();
    let beyond = |limit: f64| errors.iter().filter(|error| error.abs() > limit).count();
    format!(
        "{} sets, {:.4} on the mean, spread {:.4}, own standard errors {:.4} on the mean; off by {:.2} of these on the mean, spread {:.2}; \
         beyond 1.96 of them {}, beyond 2.81 {}",
        drawn.len(),
        mean(&means),
        sd(&means),
        mean(&sds),
        mean(&errors),
        sd(&errors),
        beyond(1.96),
        beyond(2.81)
    )
}

/// What the advice says where a parameter lies on its bound.
const BY_FITS: &str = "the fits of the models with each effect decide";

/// The verdict that nothing is seen.
const QUIET: &str = "no_detectable_discrepancy";

const NAME: &str = "challenge";

/// `count` different numbers from 1 to `size`, sorted.
fn some_of(size: u32, count: u32, stream: &mut Stream) -> Vec<u32> {
    let mut numbers: Vec<u32> = (1..=size).collect();
    for place in 0..count as usize {
        let other = place + stream.index(numbers.len() - place);
        numbers.swap(place, other);
    }
    numbers.truncate(count as usize);
    numbers.sort_unstable();
    numbers
}

/// Measured data of those repetitions of every experiment that `pick` picks, all observables or the KPIs alone, and
/// weighings of the grains.
fn data(
    (rows, evidence): (&[KpiRow], &str),
    pick: &dyn Fn(&str) -> Vec<u32>,
    density: Option<f64>,
    stream: &mut Stream,
) -> Measured {
    let mut values: Vec<MeasuredValue> = Vec::new();
    for experiment in EXPERIMENTS {
        let picked = pick(experiment.name());
        for row in rows.iter().filter(|row| row.experiment == experiment.name()) {
            let place = picked.binary_search(&row.repetition);
            let mut observables = experiment.observables().iter().filter(|o| evidence != "kpis" || o.is_kpi);
            let observable = observables.find(|observable| observable.name == row.kpi);
            if let (Ok(place), Some(observable), Some(value)) = (place, observable, row.value) {
                let (experiment, repetition) = (experiment.name(), place as u32 + 1);
                values.push(MeasuredValue { experiment, kpi: observable.name, repetition, value });
            }
        }
    }
    values.sort_by_key(|value| (value.experiment, value.kpi, value.repetition));
    let (scatter, n) = WEIGHINGS;
    let weighings: Vec<f64> = density
        .iter()
        .flat_map(|mean| (0..n).map(move |_| mean))
        .map(|mean| mean + scatter * stream.normal())
        .collect();
    Measured { name: NAME.to_owned(), values, properties: property(&weighings), ..Measured::default() }
}

fn property(values: &[f64]) -> Vec<granulake::config::MeasuredSummary> {
    if values.len() < 2 {
        return Vec::new();
    }
    vec![granulake::config::MeasuredSummary {
        experiment: "grains",
        kpi: "particle_density",
        unit: "kg/m3",
        mean: mean(values),
        sd: sd(values),
        n: values.len() as u32,
    }]
}

/// Counts of one cell.
#[derive(Default)]
struct Tally {
    sets: u32,
    correct: u32,
    class_size: u32,
    named: u32,
    /// Sets in which "none of the candidates" is due.
    decidable: u32,
    /// Those of them that are right.
    decided: u32,
    /// Sets in which one name alone is due.
    apart: u32,
    /// Those of them that have it.
    alone: u32,
    /// D² of the hidden effect to the nearest rival in every set.
    separations: Vec<f64>,
    answers: BTreeMap<String, u32>,
    /// What every effect shows in the first set.
    limits: String,
    /// Directions of evidence of the first set.
    dof: u32,
    /// How alike the effects look in the first set.
    cosines: String,
}

impl Tally {
    fn new((verdict, limits, confusion): &PanelRows) -> Self {
        let mut tally = Self { dof: verdict.dof, ..Self::default() };
        for row in limits {
            let limit = row.strength_90.map_or("-".to_owned(), |limit| format!("{limit:.3}"));
            let _ = write!(
                tally.limits,
                "{} a={:.3} visible={:.2} eta90={limit} {}; ",
                row.effect, row.a, row.visibility, row.part
            );
        }
        for pair in confusion {
            let _ = write!(tally.cosines, "{} {}={:.2}; ", pair.effect, pair.other, pair.cosine);
        }
        tally
    }

    fn add(&mut self, score: &Score) {
        self.sets += 1;
        self.correct += u32::from(score.correct);
        let is_due = score.decidable == Some(true);
        self.decidable += u32::from(is_due);
        self.decided += u32::from(is_due && score.correct);
        self.apart += u32::from(score.is_due_alone());
        self.alone += u32::from(score.is_due_alone() && score.is_alone());
        self.separations.extend(score.separation);
        if !score.named.is_empty() {
            self.named += 1;
            self.class_size += score.named.len() as u32;
        }
        *self.answers.entry(score.answer()).or_default() += 1;
    }

    /// The median of D²; nothing where nothing is hidden.
    fn separation(&self) -> String {
        let mut sorted = self.separations.clone();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).map_or_else(String::new, |median| format!("{median:.1}"))
    }
}

/// Results, one line per cell.
struct Book {
    path: PathBuf,
    lines: Vec<String>,
}

impl Book {
    fn open(path: PathBuf) -> Result<Self, Failed> {
        let text = if path.exists() { std::fs::read_to_string(&path)? } else { String::new() };
        Ok(Self { path, lines: text.lines().map(str::to_owned).collect() })
    }

    fn has(&self, key: &str) -> bool {
        self.lines.iter().any(|line| line.starts_with(&format!("{key},")))
    }

    fn add(&mut self, key: String, tally: &Tally) -> Result<(), Failed> {
        let answers: Vec<String> = tally.answers.iter().map(|(answer, count)| format!("{answer}: {count}")).collect();
        let Tally { correct, class_size, named, decidable, decided, apart, alone, limits, dof, cosines, .. } = tally;
        let (answers, separation) = (answers.join("; "), tally.separation());
        let line = format!(
            "{key},{correct},{class_size},{named},{decidable},{decided},{apart},{alone},{separation},{answers},{limits},\
             {dof},{cosines}"
        );
        println!("{line}");
        self.lines.push(line);
        Ok(std::fs::write(&self.path, self.lines.join("\n") + "\n")?)
    }

    /// The tables of docs/challenges.md: of every cell what the newest diagnosis found that has judged it.
    fn print(&self) {
        let cells = newest(self.lines.iter().filter_map(|line| Line::parse(line)));
        confusion(&cells).iter().for_each(|(n, matrix)| print_confusion(n, matrix));
        ["all", "kpis"].iter().for_each(|evidence| print_answers(evidence, &cells));
        print_limits(&cells);
    }
}

/// Theta, truth, n, evidence, left out.
type CellName<'a> = [&'a str; 5];

/// A line of the results: one panel of a cell.
struct Line<'a> {
    cell: CellName<'a>,
    /// Version of the diagnosis.
    version: u32,
    sets: u32,
    right: u32,
    classes: u32,
    named: u32,
    decidable: u32,
    decided: u32,
    apart: u32,
    alone: u32,
    separation: &'a str,
    answers: &'a str,
    limits: &'a str,
    dof: &'a str,
    cosines: &'a str,
}

impl<'a> Line<'a> {
    /// `None` where the line is of another form of the engine or has other columns.
    fn parse(text: &'a str) -> Option<Self> {
        let words: Vec<&str> = text.split(',').collect();
        let &[
            form,
            theta,
            truth,
            n,
            evidence,
            without,
            _panel,
            _pool,
            sets,
            right,
            classes,
            named,
            decidable,
            decided,
            apart,
            alone,
            separation,
            answers,
            limits,
            dof,
            cosines,
        ] = words.as_slice()
        else {
            return None;
        };
        let engine = format!("physics {} diagnose ", granulake::dem::PHYSICS_VERSION);
        let [sets, right, classes, named, decidable, decided, apart, alone] =
            [sets, right, classes, named, decidable, decided, apart, alone].map(|count| count.parse().unwrap_or(0));
        Some(Self {
            cell: [theta, truth, n, evidence, without],
            version: form.strip_prefix(&engine)?.parse().ok()?,
            sets,
            right,
            classes,
            named,
            decidable,
            decided,
            apart,
            alone,
            separation,
            answers,
            limits,
            dof,
            cosines,
        })
    }

    /// Answers and their number.
    fn answers(&self) -> impl Iterator<Item = (&'a str, usize)> {
        let texts = self.answers.split("; ").filter_map(|text| text.rsplit_once(": "));
        texts.map(|(answer, count)| (answer, count.parse().unwrap_or(0)))
    }

    /// Of every effect its name, a, visible, η₉₀, part.
    fn limits(&self) -> impl Iterator<Item = Vec<&'a str>> {
        let effects = self.limits.split("; ").filter(|effect| !effect.is_empty());
        effects.map(|effect| effect.split(' ').map(|word| word.rsplit('=').next().unwrap_or(word)).collect())
    }

    /// The cosine of two effects.
    fn cosine(&self, effect: &str, other: &str) -> &'a str {
        let pair = format!("{effect} {other}=");
        self.cosines.split("; ").find_map(|text| text.strip_prefix(&pair)).unwrap_or("–")
    }
}

/// Panels of every cell by the newest diagnosis that has judged it.
type Cells<'a> = BTreeMap<CellName<'a>, Vec<Line<'a>>>;

fn newest<'a>(lines: impl Iterator<Item = Line<'a>>) -> Cells<'a> {
    let mut cells = Cells::new();
    for line in lines {
        let panels = cells.entry(line.cell).or_default();
        let newest = panels.first().map_or(0, |panel| panel.version);
        if line.version > newest {
            panels.clear();
        }
        if line.version >= newest {
            panels.push(line);
        }
    }
    cells
}

/// What was answered to what was hidden, all observables and both places together: one matrix for every n.
fn confusion(cells: &Cells) -> BTreeMap<String, ConfusionMatrix> {
    let mut matrices: BTreeMap<String, ConfusionMatrix> = BTreeMap::new();
    for (cell, panels) in cells {
        let [_, truth, n, "all", without] = *cell else { continue };
        let hidden = truth.replace(['_', '='], " ") + if without == "-" { "" } else { ", left out" };
        let effect = truth.split('=').next().unwrap_or(truth);
        let matrix = matrices.entry(n.to_owned()).or_default();
        let answers = panels.iter().flat_map(Line::answers);
        answers.for_each(|(answer, count)| matrix.add(&hidden, effect, answer, count));
    }
    matrices
}

/// The matrix in percent of the sets.
fn print_confusion(n: &str, matrix: &ConfusionMatrix) {
    let columns = matrix.columns();
    println!("\n| hidden, n = {n} | sets | {} |\n|{}", columns.join(" | "), "---|".repeat(columns.len() + 2));
    for (hidden, counts) in matrix.rows() {
        let sets: usize = counts.iter().sum();
        let share = |&count: &usize| match count {
            0 => "–".to_owned(),
            count => format!("{:.1}", 100.0 * count as f64 / sets as f64),
        };
        println!("| {hidden} | {sets} | {} |", counts.iter().map(share).collect::<Vec<_>>().join(" | "));
    }
}

/// The answers of every cell over all panels.
fn print_answers(evidence: &str, cells: &Cells) {
    println!(
        "\n| theta | truth | n | evidence | left out | diagnose | right | 95 % interval | by panel | mean class | \
         right of decidable | alone of D² > 10 | median D² | answers |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|"
    );
    for (cell, panels) in cells.iter().filter(|(cell, _)| cell[3] == evidence) {
        println!("| {} | {} | {} |", cell.join(" | "), panels[0].version, sum_up(panels).join(" | "));
    }
}

/// What every effect shows in the first set of the first panel at n = [`SHOWN`], all observables, the whole library, and its
/// cosines with the others.
fn print_limits(cells: &Cells) {
    let shown = cells.values().filter_map(|panels| panels.first());
    let shown: Vec<&Line> = shown.filter(|line| matches!(line.cell, [_, _, SHOWN, "all", "-"])).collect();
    let effects: BTreeSet<&str> = shown.iter().flat_map(|line| line.limits()).map(|words| words[0]).collect();
    let heads: String = effects.iter().map(|effect| format!(" c with {effect} |")).collect();
    println!("\n| theta | truth | diagnose | d | effect | a | visible | η₉₀ | part |{heads}");
    println!("|{}", "---|".repeat(9 + effects.len()));
    for line in shown {
        let (head, version, dof) = (line.cell[..2].join(" | "), line.version, line.dof);
        for words in line.limits() {
            let c = effects.iter().map(|other| line.cosine(words[0], other)).collect::<Vec<_>>().join(" | ");
            println!("| {head} | {version} | {dof} | {} | {c} |", words.join(" | "));
        }
    }
}

/// Repetitions of the measurements at which the table of limits stands.
const SHOWN: &str = "20";

/// The rest of a line of the matrix from the lines of its panels.
fn sum_up(panels: &[Line]) -> [String; 8] {
    let sum = |count: fn(&Line) -> u32| panels.iter().map(count).sum::<u32>();
    let (sets, right, classes, named) = (sum(|l| l.sets), sum(|l| l.right), sum(|l| l.classes), sum(|l| l.named));
    let interval = clopper_pearson(right as usize, sets as usize, 0.95);
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for (answer, count) in panels.iter().flat_map(Line::answers) {
        *counts.entry(answer).or_default() += count;
    }
    let answers: Vec<String> = counts.iter().map(|(answer, count)| format!("{answer}: {count}")).collect();
    let share = |hits: u32, of: u32| if of > 0 { format!("{hits} of {of}") } else { "-".to_owned() };
    let medians: Vec<&str> = panels.iter().map(|line| line.separation).filter(|median| !median.is_empty()).collect();
    [
        format!("{right} of {sets}"),
        format!("{:.3} to {:.3}", interval.lower, interval.upper),
        panels.iter().map(|line| line.right.to_string()).collect::<Vec<_>>().join(" + "),
        if named > 0 { format!("{:.2}", f64::from(classes) / f64::from(named)) } else { "-".to_owned() },
        share(sum(|l| l.decided), sum(|l| l.decidable)),
        share(sum(|l| l.alone), sum(|l| l.apart)),
        if medians.is_empty() { "-".to_owned() } else { medians.join(" + ") },
        answers.join("; "),
    ]
}
