//! Rows of a finished attribution.

use super::Tables;
use super::controls::Offset;
use super::joint::Contender;
use super::moments::{Moment, Statistic};
use super::verdict::Case;
use crate::stats::attribution::{
    Attribution, Candidate, DetectionLimit, EffectReport, Presence, Separation, Signature, Status, Verdict,
};
use crate::tables::list::{AttributionRow, ConfusionRow, PriorWidthRow, ResidualRow, SignatureRow, VerdictRow};

/// Size aη at which an effect is usually detected.
const DETECTABLE: f64 = 5.0;
/// Observables that a verdict names as carrying what is left.
const CARRIERS: usize = 4;

/// Name of a statistic in texts.
pub fn name(statistic: &Statistic) -> String {
    match statistic.moment {
        Moment::Mean => statistic.kpi.clone(),
        Moment::LnSd => format!("ln sd {}", statistic.kpi),
        Moment::Trend => format!("trend {}", statistic.kpi),
    }
}

/// The row of a data set that allows no diagnosis.
pub fn no_verdict(measured: &str, why: String) -> VerdictRow {
    VerdictRow {
        measured: measured.to_owned(),
        verdict: "not_attributable".to_owned(),
        effects: String::new(),
        sentence: format!("Not attributable: {why}."),
        t0: 0.0,
        dof: 0,
        p: 1.0,
        direction: String::new(),
        advice: String::new(),
    }
}

/// Adds signatures, residuals, attribution, confusion and verdict of a case.
pub fn write(
    case: &Case,
    contenders: &[Contender],
    candidates: &[Candidate],
    attribution: &Attribution,
    tables: &mut Tables,
) {
    tables.signatures.extend(signatures(case, contenders, candidates, attribution));
    tables.residuals.extend(residuals(case, attribution));
    tables.attribution.extend(attribution.effects.iter().map(|effect| attribution_row(case, attribution, effect)));
    tables.confusion.extend(confusion(case, attribution));
    tables.verdicts.push(verdict(case, attribution));
    tables.prior_widths.extend(prior_widths(case, attribution));
}

/// The rows of a case that a score needs.
pub fn of(case: &Case, attribution: &Attribution) -> (VerdictRow, Vec<AttributionRow>, Vec<ConfusionRow>) {
    let effects = attribution.effects.iter().map(|effect| attribution_row(case, attribution, effect)).collect();
    (verdict(case, attribution), effects, confusion(case, attribution))
}

fn signatures(
    case: &Case,
    contenders: &[Contender],
    candidates: &[Candidate],
    found: &Attribution,
) -> Vec<SignatureRow> {
    let mut rows = Vec::new();
    for (column, parameter) in case.context.config.parameters.iter().enumerate() {
        let errors = &case.slopes.covariance[column];
        let slope = |i: usize| (case.slopes.jacobian[(i, column)], errors[(i, i)]);
        rows.extend(signature(case, (parameter.name, "metamodel", None), slope));
    }
    for ((contender, candidate), effect) in contenders.iter().zip(candidates).zip(&found.effects) {
        if candidate.testable.is_err() {
            continue;
        }
        let Some(nearest) = nearest(candidate, effect.strength) else { continue };
        let square = nearest.strength * nearest.strength;
        let direct_runs = contender.is_tied() && candidate.presence != Presence::Absent;
        // At a tie the change is the difference of two direct batches.
        let direct = |i: usize| 2.0 * case.model.covariance[(i, i)] / square;
        let variance = |i: usize| if direct_runs { direct(i) } else { candidate.covariance[(i, i)] };
        let origin = if direct_runs { "direct" } else { "metamodel" };
        let from = (candidate.name.as_str(), origin, Some(nearest.strength));
        rows.extend(signature(case, from, |i| (nearest.per_unit[i], variance(i))));
    }
    rows
}

/// Source, origin and strength of a signature.
type From<'a> = (&'a str, &'a str, Option<f64>);

fn signature(case: &Case, (source, origin, strength): From, entry: impl Fn(usize) -> (f64, f64)) -> Vec<SignatureRow> {
    let row = |(i, statistic): (usize, &Statistic)| {
        let (value, variance) = entry(i);
        SignatureRow {
            measured: case.set.name.clone(),
            source: source.to_owned(),
            kpi: statistic.kpi.clone(),
            statistic: statistic.moment.name().to_owned(),
            strength,
            value,
            standard_error: variance.max(0.0).sqrt(),
            origin: origin.to_owned(),
        }
    };
    case.evidence.statistics.iter().enumerate().map(row).collect()
}

/// The signature taken nearest to a strength.
fn nearest(candidate: &Candidate, strength: f64) -> Option<&Signature> {
    let distance = |s: &&Signature| (s.strength - strength).abs();
    candidate.signatures.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))
}

fn residuals(case: &Case, attribution: &Attribution) -> Vec<ResidualRow> {
    let (residual, covariance) = (case.residual(), case.covariance());
    let unabsorbed = |name: &str| {
        let row = attribution.residual.iter().find(|row| row.name == name);
        // A row that calibration always fits has no scatter of its own left.
        row.map(|row| row.standardised).filter(|z| z.is_finite()).unwrap_or(0.0)
    };
    let row = |(i, statistic): (usize, &Statistic)| ResidualRow {
        measured: case.set.name.clone(),
        experiment: statistic.experiment.clone(),
        kpi: statistic.kpi.clone(),
        statistic: statistic.moment.name().to_owned(),
        measured_value: case.evidence.values[i],
        model_value: case.model.values[i],
        residual: residual[i],
        standard_error: covariance[(i, i)].sqrt(),
        z: residual[i] / covariance[(i, i)].sqrt(),
        unabsorbed_z: unabsorbed(&name(statistic)),
        unit: if statistic.moment == Moment::LnSd { "1".to_owned() } else { statistic.unit.clone() },
    };
    case.evidence.statistics.iter().enumerate().map(row).collect()
}

fn attribution_row(case: &Case, attribution: &Attribution, effect: &EffectReport) -> AttributionRow {
    let side = side_of(effect);
    AttributionRow {
        measured: case.set.name.clone(),
        effect: effect.name.clone(),
        unit: effect.unit.clone(),
        strength: effect.strength,
        strength_sd: effect.strength_sd,
        a: effect.a,
        z: effect.z,
        p_family: effect.familywise_p,
        leftover: effect.leftover,
        leftover_p: effect.leftover_p,
        visibility: effect.visibility,
        resolved: effect.status != Status::SignatureNotResolved,
        physical: effect.accepted,
        ln_odds: effect.ln_bayes,
        strength_90: side.and_then(|limit| limit.strength),
        part: if case.leaves_out(&effect.name) { "left_out" } else { part(attribution, effect) }.to_owned(),
    }
}

/// The detection limit on the side of zero where the effect fits best.
fn side_of(effect: &EffectReport) -> Option<&DetectionLimit> {
    effect.detection.iter().find(|limit| limit.side * effect.strength >= 0.0)
}

/// An effect that these data could not show at any physical strength of the sign that fits best is not testable with them,
/// whatever the fit says.
fn part(attribution: &Attribution, effect: &EffectReport) -> &'static str {
    let hidden = side_of(effect).is_some_and(|limit| limit.strength.is_none());
    let named = attribution.verdict.names().contains(&effect.name.as_str());
    match (&effect.status, &attribution.verdict) {
        (_, Verdict::Effect(_)) if named => "named",
        (_, Verdict::Class { .. }) if named => "class",
        (_, Verdict::Pair(..)) if named => "pair",
        (Status::AbsorbedByCalibration, _) => "absorbed",
        (Status::SignatureNotResolved, _) => "unresolved",
        (Status::NotTestable(_), _) => "not_testable",
        (Status::Testable, _) if hidden && is_absorbed(effect) => "absorbed",
        (Status::Testable, _) if hidden => "not_testable",
        (Status::Testable, _) => "rejected",
    }
}

/// Whether an effect that no strength of its range would show would be seen if calibration left it alone: η₉₀ is about
/// 5/a, and most of the signature is gone.
fn is_absorbed(effect: &EffectReport) -> bool {
    let end = effect.detection.iter().map(|limit| limit.side.abs()).fold(0.0, f64::max);
    effect.visibility < 0.5 && effect.a * end >= DETECTABLE * effect.visibility.sqrt()
}

fn confusion(case: &Case, attribution: &Attribution) -> Vec<ConfusionRow> {
    let effects = &attribution.effects;
    let mut rows = Vec::new();
    for (k, effect) in effects.iter().enumerate() {
        for (l, other) in effects.iter().enumerate().filter(|(l, _)| *l != k) {
            let cosine = attribution.confusion[(k, l)];
            if !cosine.is_finite() {
                continue;
            }
            rows.push(ConfusionRow {
                measured: case.set.name.clone(),
                effect: effect.name.clone(),
                other: other.name.clone(),
                cosine,
                separation: attribution.leads[(k, l)],
            });
        }
    }
    rows
}

fn verdict(case: &Case, attribution: &Attribution) -> VerdictRow {
    VerdictRow {
        measured: case.set.name.clone(),
        verdict: attribution.verdict.code().to_owned(),
        effects: attribution.verdict.names().join(","),
        sentence: attribution.verdict.sentence(),
        t0: attribution.t0,
        dof: attribution.evidence as u32,
        p: attribution.t0_p,
        direction: direction(attribution),
        advice: advice(case, attribution),
    }
}

fn prior_widths(case: &Case, attribution: &Attribution) -> impl Iterator<Item = PriorWidthRow> {
    attribution.sensitivity.iter().map(|other| PriorWidthRow {
        measured: case.set.name.clone(),
        strength_factor: other.strength_scale,
        other_factor: other.other_scale,
        verdict: other.verdict.code().to_owned(),
        effects: other.verdict.names().join(","),
    })
}

/// How many other widths of the priors would change the verdict.
fn hangs_on_priors(attribution: &Attribution) -> Option<String> {
    let of = |verdict: &Verdict| (verdict.code(), verdict.names().join(","));
    let own = of(&attribution.verdict);
    let differ = attribution.sensitivity.iter().filter(|other| of(&other.verdict) != own).count();
    let all = attribution.sensitivity.len();
    (differ > 0)
        .then(|| format!("{differ} of {all} other widths of the priors give another verdict (table prior_widths)"))
}

/// The rows with the largest standardised residual, such as `pile_t50 +4.1, ledge_mass -2.7`.
fn direction(attribution: &Attribution) -> String {
    let mut rows: Vec<_> = attribution.residual.iter().filter(|row| row.standardised.is_finite()).collect();
    rows.sort_by(|a, b| b.standardised.abs().total_cmp(&a.standardised.abs()));
    let text = rows.iter().take(CARRIERS).map(|row| format!("{} {:+.1}", row.name, row.standardised));
    text.collect::<Vec<_>>().join(", ")
}

/// The rival that is nearer to a named effect than a single name asks for: D² is twice the lead over it.
fn near_rival(attribution: &Attribution, named: &str, due: f64) -> Option<String> {
    let effect = attribution.effects.iter().find(|effect| effect.name == named)?;
    let (rival, lead) = effect.nearest_rival.as_ref()?;
    let squared = 2.0 * lead;
    (squared < due).then(|| {
        format!("{rival} is near: squared distance {squared:.1}, where {due:.0} is asked for a name of its own; add repetitions or observables")
    })
}

/// What a proposed measurement is expected to add for the two members of a class that are hardest to tell apart.
fn worth(attribution: &Attribution, name: &str) -> String {
    let least = |values: Vec<f64>| values.into_iter().fold(f64::INFINITY, f64::min);
    let now = least(attribution.separations.iter().map(|pair| pair.expected).collect());
    let with = |pair: &Separation| pair.with_proposal.iter().find(|(known, _)| known == name).map_or(0.0, |(_, e)| *e);
    let then = least(attribution.separations.iter().map(with).collect());
    format!(
        "measure {name}: the expected lead of the true effect over its nearest rival, as ln likelihood, goes from {now:.1} to {then:.1}"
    )
}

fn advice(case: &Case, attribution: &Attribution) -> String {
    let due = case.context.config.diagnose.thresholds.separation;
    let next = match &attribution.verdict {
        Verdict::Effect(named) => near_rival(attribution, &named.name, due).unwrap_or_default(),
        Verdict::Class { measure: Some(name), .. } => worth(attribution, name),
        Verdict::Class { measure: None, .. } => {
            "measure more observables of the same tests, or add repetitions, to separate the class".to_owned()
        }
        Verdict::Pair(first, second) => format!(
            "no model is fitted with both: put {} = {:.3} under [effects.active], and the diagnosis may name {} beside it and \
             add that",
            first.name, first.strength, second.name
        ),
        Verdict::NoneOfTheCandidates => {
            "name more candidates, or look at the observables that carry the residual".to_owned()
        }
        _ => String::new(),
    };
    let offset = case.evidence.offset.as_ref().map(Offset::sentence);
    let (residual, covariance) = (case.residual(), case.covariance());
    let doubts = case.evidence.doubts.iter();
    let doubts = doubts.map(|doubt| doubt.sentence(&case.evidence.statistics, &residual, &covariance));
    let notes = attribution.notes.iter().cloned().chain(offset).chain(doubts).chain(hangs_on_priors(attribution));
    std::iter::once(next).chain(notes).filter(|text| !text.is_empty()).collect::<Vec<_>>().join("; ")
}
