//! The report: every value of the tables is on the page, nothing is fetched, markup is sound, gaps are named.

mod synthetic;

use granulake::report::{Report, Resolution, html, markdown, summary};
use granulake::tables::{BeforeAfterRow, VerdictRow};

use synthetic::full;

/// Elements that HTML never closes; the report writes them closed anyway, except the doctype.
fn unbalanced(html: &str) -> Result<(), String> {
    let mut open: Vec<&str> = Vec::new();
    let mut rest = html.strip_prefix("<!DOCTYPE html>").ok_or("no doctype")?;
    while let Some(start) = rest.find('<') {
        let tag = &rest[start + 1..];
        let end = tag.find('>').ok_or_else(|| format!("`<{}` is never closed", &tag[..tag.len().min(40)]))?;
        let (inner, after) = (&tag[..end], &tag[end + 1..]);
        let name = inner.trim_start_matches('/').split([' ', '/']).next().unwrap_or("");
        if !name.starts_with(|c: char| c.is_ascii_alphabetic()) || inner.matches('"').count() % 2 == 1 {
            return Err(format!("`<{inner}>` is not a tag"));
        }
        match (inner.starts_with('/'), inner.ends_with('/')) {
            (true, _) if open.pop() != Some(name) => return Err(format!("</{name}> closes nothing of that name")),
            (false, false) => open.push(name),
            _ => {}
        }
        rest = after;
    }
    if open.is_empty() { Ok(()) } else { Err(format!("still open: {open:?}")) }
}

/// What a reader sees: markup removed, entities and minus signs put back.
fn visible(html: &str) -> String {
    let body = &html[html.find("<main>").expect("a body")..];
    let mut text = String::new();
    let mut inside = false;
    for c in body.chars() {
        match c {
            '<' => inside = true,
            '>' => inside = false,
            c if !inside => text.push(c),
            _ => {}
        }
    }
    let text = text.replace('−', "-").replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"");
    text.replace("&#39;", "'").replace("&amp;", "&")
}

/// Two decimals with a sign, none for zero.
fn percent(value: &f64) -> String {
    let text = format!("{value:+.2}");
    if text[1..] == *"0.00" { text[1..].to_string() } else { text }
}

fn holds(text: &str, wanted: &str) {
    assert!(text.contains(wanted), "`{wanted}` is not in the report");
}

/// Every number of the result tables stands on the page, in the digits its uncertainty carries. The formats are
/// spelled out here, independent of the report's own.
#[test]
fn every_value_of_the_result_tables_is_shown() {
    let report = full();
    for text in [visible(&html(&report)), markdown(&report)] {
        for row in &report.before_after {
            let shown = [row.before_error_percent, row.after_error_percent, row.after_upper_percent];
            shown.iter().flatten().for_each(|value| holds(&text, &percent(value)));
        }
        for row in &report.verification {
            row.target_error_percent.iter().for_each(|value| holds(&text, &percent(value)));
            row.prediction_error_percent.iter().for_each(|value| holds(&text, &percent(value)));
        }
        report
            .validation
            .iter()
            .filter_map(|row| row.error_percent.as_ref())
            .for_each(|value| holds(&text, &percent(value)));
        for row in &report.residuals {
            holds(&text, &percent(&row.z));
            holds(&text, &percent(&row.unabsorbed_z));
        }
        report.confusion.iter().for_each(|row| holds(&text, &format!("{:.2}", row.cosine)));
        holds(&text, "0.512 ± 0.061");
        holds(&text, "25.43 [24.84, 26.02]");
        holds(&text, "1473.1 [1470.0, 1476.2]");
        holds(&text, "31.2");
        holds(&text, "2637.7 ± 12.3");
        for verdict in &report.verdicts {
            holds(&text, &verdict.sentence);
            holds(&text, &verdict.direction);
        }
        for said in ["100 mm", "insertion_step", "stiffness_scale", "0.01"] {
            holds(&text, said);
        }
    }
}

#[test]
fn the_paper_stands_beside_its_own_data_set_only() {
    let report = full();
    let text = visible(&html(&report));
    for printed in ["0.5513", "0.4804", "2812.7", "-13.17", "-19.28", "3.86 [3.77, 3.95]", "+8.15", "3.34"] {
        holds(&text, printed);
    }
    let mut alone = report.clone();
    alone.study.published = None;
    let text = visible(&html(&alone));
    assert!(!text.contains("-19.28") && !text.contains("2812.7"), "the paper's results stand beside other data");
}

#[test]
fn a_coarse_study_says_so_wherever_the_paper_stands_beside_it() {
    let warning = "A coarse set-up is its own model.";
    let report = full();
    assert_eq!(visible(&html(&report)).matches(warning).count(), 4, "runs, parameters, verification, validation");
    let mut fine = report;
    fine.study.resolution = Resolution::Full;
    assert!(!html(&fine).contains(warning));
}

#[test]
fn nothing_is_fetched_and_nothing_runs() {
    let page = html(&full());
    for outside in ["http:", "https:", "src=", "@import", "url(", "<script", "<link", "javascript:", "xlink"] {
        assert!(!page.contains(outside), "`{outside}` is in the page");
    }
}

#[test]
fn tags_are_balanced_and_ids_are_unique() {
    for page in [html(&full()), html(&Report::default())] {
        unbalanced(&page).expect("well-formed");
        let mut ids: Vec<&str> = page.split(" id=\"").skip(1).filter_map(|after| after.split('"').next()).collect();
        let count = ids.len();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), count, "an id is used twice");
        for target in page.split("href=\"#").skip(1).filter_map(|after| after.split('"').next()) {
            assert!(ids.contains(&target), "no place is called {target}");
        }
    }
}

/// The checker itself must be able to fail.
#[test]
fn the_checker_refuses_broken_markup() {
    for broken in ["<p>", "</p>", "<p><b></p></b>", "<p", "a < b", "<p class=\"x>text</p>"] {
        assert!(unbalanced(&format!("<!DOCTYPE html>{broken}")).is_err(), "{broken}");
    }
}

#[test]
fn every_table_has_caption_and_headings_of_rows_and_columns() {
    let page = html(&full());
    let tables: Vec<&str> = page.split("<table>").skip(1).collect();
    assert!(tables.len() > 25, "{} tables", tables.len());
    for table in tables {
        let table = table.split("</table>").next().unwrap_or("");
        assert!(table.trim_start().starts_with("<caption>"));
        let columns = table.matches("<th scope=\"col\"").count();
        let rows = table.matches("<th scope=\"row\"").count();
        assert!(columns > 1 && rows > 0);
        assert_eq!(table.matches("<td").count(), rows * (columns - 1), "a row is not as long as the headings");
    }
    assert_eq!(page.matches("role=\"img\"").count(), page.matches("<desc ").count());
}

#[test]
fn names_from_files_cannot_become_markup() {
    let mut report = full();
    let nasty = "<img src=x onerror=alert(1)> & \"q\" 'a' `b` *c* |d|";
    report.study.title = nasty.into();
    report.study.assumptions[0].meaning = nasty.into();
    report.verdicts[0].sentence = nasty.into();
    report.runs[0].status = "failed".into();
    report.runs[0].reason = Some(nasty.into());
    let page = html(&report);
    assert!(!page.contains("<img"));
    unbalanced(&page).expect("well-formed");
    holds(&visible(&page), nasty);
    let text = markdown(&report);
    assert!(!text.contains("<img") || text.contains("\\<img"));
    assert!(!text.contains(" `b` *c*"), "markup of a name is live");
    assert!(
        text.lines().filter(|line| line.starts_with("| ")).all(|line| !line.contains(" |d| ")),
        "a bar splits a cell"
    );
}

#[test]
fn the_same_tables_give_the_same_bytes() {
    let (one, two) = (full(), full());
    assert_eq!(html(&one), html(&two));
    assert_eq!(markdown(&one), markdown(&two));
    assert_eq!(summary(&one), summary(&two));
}

/// Takes one stage's rows away from a report.
type Remove = fn(&mut Report);

#[test]
fn a_stage_that_has_not_run_is_named() {
    let stages: [(&str, Remove); 8] = [
        ("sample", |report| report.samples.clear()),
        ("simulate", |report| report.runs.clear()),
        ("aggregate", |report| report.aggregates.clear()),
        ("train", |report| report.metamodels.clear()),
        ("calibrate", |report| {
            report.optima.clear();
            report.calibrations.clear();
        }),
        ("verify", |report| report.verification.clear()),
        ("validate", |report| report.validation.clear()),
        ("diagnose", |report| report.verdicts.clear()),
    ];
    for (stage, remove) in stages {
        let command = format!("granulake repro {stage}");
        let mut report = full();
        assert!(!html(&report).contains(&command), "{stage} has run");
        remove(&mut report);
        for text in [html(&report), markdown(&report)] {
            holds(&text, &command);
            holds(&text, "Asking the tables");
        }
        assert!(summary(&report).lines().count() > 4);
    }
}

/// One data set without verification must not vanish because another one has it.
#[test]
fn a_data_set_without_rows_is_named_beside_those_that_have_them() {
    let mut report = full();
    let missing = "— No simulations were made at the optima of these data.";
    assert!(!visible(&html(&report)).contains(missing));
    report.verification.retain(|row| row.measured != "paper");
    for text in [visible(&html(&report)), markdown(&report)] {
        holds(&text, missing);
        holds(&text, "— No effect was switched on for these data.");
    }
}

#[test]
fn an_empty_report_still_has_all_its_sections() {
    let report = Report::default();
    let page = html(&report);
    assert_eq!(page.matches("<section ").count(), 12);
    assert_eq!(markdown(&report).matches("\n## ").count(), 12);
}

#[test]
fn missing_values_are_dashes_with_their_reason() {
    let report = full();
    for text in [visible(&html(&report)), markdown(&report)] {
        for reason in [
            "one repetition has no variance to learn from",
            "all five hoppers arched",
            "0 of 1 runs gave a value",
            "no single values",
            "not in the paper",
            "beyond its physical range",
            "not simulated",
            "the hopper is clogged: 41 % of the mass stays above the slot",
            "fewer than three bins hold a particle",
        ] {
            holds(&text, reason);
        }
    }
}

/// A reason belongs to a failed row, not to each of its cells.
#[test]
fn a_reason_for_failure_is_said_once() {
    let mut report = full();
    let why = "five points are too few for this kind";
    for row in report.metamodels.iter_mut().filter(|row| row.kind == "rbm" && row.n == 1) {
        (row.status, row.reason) = ("failed".into(), Some(why.into()));
        (row.lml, row.nrmse_train_mean, row.nrmse_validation_mean) = (None, None, None);
    }
    assert_eq!(markdown(&report).matches(why).count(), 1);
    let of_calibration = "no metamodel stands behind it";
    let row = &mut report.calibrations[0];
    (row.status, row.reason) = ("failed".into(), Some(of_calibration.into()));
    (row.objective, row.starts_at_optimum, row.flat_directions) = (None, None, None);
    assert_eq!(markdown(&report).matches(of_calibration).count(), 1);
}

/// The study asks for 90 %; credible intervals of the parameters always hold 95 %.
#[test]
fn intervals_are_called_by_their_confidence() {
    let text = visible(&html(&full()));
    for said in [
        "Bars are the",
        "this study,",
        "With",
        "Mean with",
        "in per cent, with",
        "each with its",
        "the coloured one the",
    ] {
        holds(&text, &format!("{said} 90 % interval"));
    }
    assert_eq!(text.matches("95 % interval").count(), text.matches("median [95 % interval]").count());
}

#[test]
fn held_out_is_what_the_held_out_experiment_gives_and_nothing_else() {
    let mut report = full();
    let row = report.before_after.iter_mut().find(|row| row.kpi == "mass_on_shelf" && row.statistic == "mean");
    row.expect("a row").fitted = false;
    let angle = report.before_after.iter().find(|row| row.kpi == "angle_of_repose" && row.statistic == "mean");
    let angle = angle.expect("a row").clone();
    report.before_after.push(BeforeAfterRow { fitted: false, held_out_repetitions: true, ..angle });
    let text = markdown(&report);
    let roles = |name: &str| {
        let rows = text.lines().filter(|line| line.starts_with(&format!("| {name} ")) && line.contains("| mean "));
        rows.map(|line| line.split('|').nth(3).expect("a role").trim().to_string()).collect::<Vec<_>>()
    };
    assert!(roles("Mass on shelf").contains(&"not used".to_string()), "{:?}", roles("Mass on shelf"));
    assert!(roles("Discharge rate").contains(&"held out".to_string()));
    assert!(!text.contains("Mass on shelf, mean (held out)"));
    let of_angle = roles("Angle of repose");
    assert!(
        ["fitted", "held-out repetitions"].iter().all(|role| of_angle.contains(&(*role).to_string())),
        "{of_angle:?}"
    );
    assert!(summary(&report).contains("(held-out repetitions)"), "{}", summary(&report));
    holds(&text, "diagnosis only");
}

/// The paper's Table 8: methods as columns, KPIs as rows, errors of means above those of mean ± sd.
#[test]
fn table_8_has_the_papers_layout_with_both_values_and_their_difference() {
    let report = full();
    let text = markdown(&report);
    let mean = "Mean KPI % error: simulation against target, beside the paper's Table 8";
    let spread = "Mean ± standard deviation KPI % error: simulation against target, beside the paper's Table 8";
    let table = &text[text.find(mean).expect("means")..text.find(spread).expect("spreads")];
    let cells = |line: &str| line.split('|').map(|cell| cell.trim().trim_matches('*').to_string()).collect::<Vec<_>>();
    let rows: Vec<Vec<String>> = table.lines().filter(|line| line.starts_with('|')).map(cells).collect();
    assert_eq!(rows[0][3..7], ["IBM-M", "IBM-MV", "RBM-M", "RBM-MV"]);
    let wanted = |kpi: &str| {
        report.verification.iter().find(|row| {
            (row.measured.as_str(), row.kind.as_str(), row.approach.as_str(), row.n) == ("paper", "rbm", "m", 3)
                && row.kpi == kpi
        })
    };
    let ours = wanted("bulk_density").and_then(|row| row.target_error_percent).expect("an error");
    let of_density: Vec<&Vec<String>> = rows.iter().filter(|row| row[1].starts_with("Bulk density")).collect();
    let froms: Vec<&str> = of_density.iter().map(|row| row[2].as_str()).collect();
    assert_eq!(froms, ["this study, n = 3", "paper, n = 50", "difference"]);
    let column: Vec<&str> = of_density.iter().map(|row| row[5].as_str()).collect();
    assert_eq!(column, [percent(&ours), "-0.04".to_string(), percent(&(ours + 0.04))]);
    holds(&text[text.find(spread).expect("spreads")..], "-0.47 / +0.38");
}

/// A verification with the very runs that trained the metamodel is none, and the page says so.
#[test]
fn an_optimum_at_a_design_point_is_called_no_test() {
    let mut report = full();
    let said = "The optimum of SK-MV is a point of the design";
    assert!(!markdown(&report).contains(said));
    let run = report.runs.iter().find(|run| run.label == "design").expect("a run").clone();
    let label = "demo/sk-mv/3".to_string();
    let hopper = run.clone();
    report.runs.push(granulake::tables::RunRow { label: label.clone(), ..run });
    // The held-out runs at the same optimum are no part of the design.
    let (experiment, run_key) = ("siphon".to_string(), "another".to_string());
    report.runs.push(granulake::tables::RunRow { label, experiment, run_key, ..hopper });
    holds(&markdown(&report), said);
}

/// An error of a mean near zero is shown in its own unit.
#[test]
fn an_error_without_a_percentage_is_shown_in_its_unit() {
    let mut report = full();
    let row = &mut report.before_after[0];
    (row.before_error_percent, row.before_lower_percent, row.before_upper_percent) = (None, None, None);
    (row.before_error, row.before_lower, row.before_upper) = (Some(-0.456), Some(-1.23), Some(0.342));
    row.unit = "deg".to_string();
    for text in [visible(&html(&report)), markdown(&report)] {
        let rest = text.split_once("-0.46 [-1.23, 0.34]").expect("the error in its unit").1;
        assert!(rest.split_once("no percentage so near zero").is_some_and(|(unit, _)| unit.contains('°')), "{rest}");
    }
}

#[test]
fn without_an_effect_there_is_no_after() {
    let mut report = full();
    for row in &mut report.before_after {
        (row.after, row.after_error, row.after_lower, row.after_upper) = (None, None, None, None);
        (row.after_error_percent, row.after_lower_percent, row.after_upper_percent) = (None, None, None);
    }
    report.recalibration.retain(|row| row.model == "before");
    assert!(!summary(&report).contains('→'), "{}", summary(&report));
    holds(&markdown(&report), "no effect was switched on");
    assert!(!markdown(&report).contains("not recalibrated"));
}

#[test]
fn what_is_not_a_number_is_never_printed() {
    let mut report = full();
    for bad in [f64::NAN, f64::INFINITY] {
        report.residuals[0].z = bad;
        report.residuals[1].standard_error = bad;
        report.attribution[0].strength_sd = bad;
        report.attribution[1].strength_90 = Some(bad);
        report.confusion[0].cosine = bad;
        report.before_after[0].after_upper_percent = Some(bad);
        report.before_after[1].before_error_percent = Some(bad);
        report.optima[0].lower = Some(bad);
        report.aggregates[0].mean = Some(bad);
        report.targets[0].mean_upper = bad;
        report.verification[0].predicted_mean = bad;
        for text in [html(&report), markdown(&report), summary(&report)] {
            let body = text.split("</style>").last().unwrap_or("");
            for word in ["NaN", " inf", "inf ", ">inf"] {
                assert!(!body.contains(word), "`{word}` is printed");
            }
        }
    }
}

#[test]
fn the_summary_is_short_and_says_what_counts() {
    let text = summary(&full());
    assert!(text.lines().count() <= 35, "{} lines", text.lines().count());
    assert!(text.lines().all(|line| line.chars().count() <= 100), "a line is too wide");
    for said in [
        "pile 36",
        "hopper 36",
        "3 failed",
        "SK-MV, n = 3",
        "hopper",
        "The model lacks cohesion",
        "cohesion 0.512 ± 0.061",
    ] {
        let said = said.replace("hopper 36", "hopper 33");
        holds(&text, &said);
    }
    let mut many = full();
    for index in 0..6 {
        many.verdicts.push(VerdictRow { measured: format!("set {index}"), ..many.verdicts[0].clone() });
    }
    let text = summary(&many);
    assert!(text.lines().count() <= 35);
    holds(&text, "of 8 data sets more are in the report");
}

/// The report as files, as the pipeline writes them; set `GRANULAKE_REPORT_DIR` to keep and look at them.
#[test]
fn a_full_report_can_be_written_and_read_back() {
    let scratch = tempfile::tempdir().expect("a folder");
    let kept = std::env::var_os("GRANULAKE_REPORT_DIR").map(std::path::PathBuf::from);
    let folder = kept.as_deref().unwrap_or(scratch.path());
    let report = full();
    for (name, text) in
        [("index.html", html(&report)), ("report.md", markdown(&report)), ("summary.txt", summary(&report))]
    {
        let path = folder.join(name);
        std::fs::write(&path, &text).expect("written");
        assert_eq!(std::fs::read_to_string(&path).expect("UTF-8"), text);
        assert!(text.len() < 2_000_000, "{name} is {} bytes", text.len());
    }
}
