//! What the measured data are worth: intervals as the paper prints them, raw records, repetitions needed, feasibility.

use crate::support::Study;
use granulake::stats::summary::{Convention, mean_interval, plan_repetitions, sd_interval};
use granulake::tables::{
    AggregateRow, DesignQualityRow, FeasibilityRow, MeasuredAnalysisRow, MeasuredStatisticRow, PosteriorRow,
    PosteriorSummaryRow, ReplicationRow, SampleRow, SensitivityRow,
};

/// Observable, n, mean, and three values with half a unit of their last digits.
type PublishedRow = (&'static str, u32, f64, [(f64, f64); 3]);

/// Table 2 of Fransen et al. (2022): observable, n, mean, half width, sd, its offsets down and up, and half a unit of the
/// last digit printed of each. What the paper cannot mean by its own rules stands with what they give: the lower offsets
/// of the angles are swapped in print, the half width of the angle of movement is printed as 0.36 and its upper offset as
/// 0.31.
const TABLE_2: [PublishedRow; 4] = [
    ("angle_of_repose", 50, 25.43, [(0.58, 0.005), (0.36, 0.005), (0.48, 0.005)]),
    ("angle_of_movement", 50, 41.40, [(0.38, 0.005), (0.24, 0.005), (0.32, 0.005)]),
    ("bulk_density", 50, 1473.1, [(3.0, 0.05), (1.88, 0.005), (2.52, 0.005)]),
    ("discharge_rate", 5, 3.68, [(0.029, 0.0005), (0.011, 0.0005), (0.030, 0.0005)]),
];

/// The quick study with other measured data.
fn study(data: &str) -> Study {
    let study = Study::quick();
    study.write("lab.csv", data);
    study
}

#[test]
fn the_papers_convention_prints_table_2() {
    let study = study(include_str!("../../artifacts/measured/fransen2022.csv"));
    study.edit("pipeline.toml", "[metamodel]", "[statistics]\nconvention = \"paper\"\n\n[metamodel]");
    assert_eq!(study.ran(&["analyse"]), ["analyse"], "no simulation is needed");
    let rows: Vec<MeasuredStatisticRow> = study.table();
    for (kpi, n, mean, offsets) in TABLE_2 {
        let row = rows.iter().find(|row| row.kpi == kpi).expect("a row");
        assert_eq!((row.n, row.mean), (n, mean));
        let sd = row.sd.unwrap();
        let found = [row.mean_upper.unwrap() - row.mean, sd - row.sd_lower.unwrap(), row.sd_upper.unwrap() - sd];
        for (found, (printed, rounding)) in found.into_iter().zip(offsets) {
            // The sd that enters is rounded itself, to a unit of 0.5 % at worst.
            assert!((found - printed).abs() <= rounding + 0.002 * printed, "{kpi}: {found} against {printed}");
        }
    }
    // Section 1: 1.837 at three repetitions, where n - 1 degrees of freedom give 2.484; 0.284 at fifty by either.
    let factor = |n, convention| mean_interval(0.0, 1.0, n, 0.95, convention).upper;
    assert!((factor(3, Convention::Paper) - 1.837).abs() < 5e-4);
    assert!((factor(3, Convention::Correct) - 2.484).abs() < 5e-4);
    assert!((factor(50, Convention::Correct) - 0.284).abs() < 5e-4);
    assert!(
        sd_interval(1.0, 50, 0.95, Convention::Paper).upper < sd_interval(1.0, 50, 0.95, Convention::Correct).upper
    );
}

#[test]
fn every_n_is_analysed_and_the_needed_repetitions_are_told() {
    let mut data = "experiment,repetition,kpi,value,unit\n".to_owned();
    // Alternating about 25 with a known scatter, so that means and counts follow by hand.
    (1..=12).for_each(|i| {
        data += &format!("pile,{i},angle_of_repose,{},deg\n", if i % 2 == 0 { 24.0 } else { 26.0 });
    });
    let study = study(&data);
    study.succeed(&["repro", "analyse"]);
    let rows: Vec<MeasuredStatisticRow> = study.table();
    assert_eq!(rows.iter().map(|row| row.n).collect::<Vec<_>>(), (1..=12).collect::<Vec<_>>());
    assert!(rows[0].sd.is_none() && rows[0].mean_lower.is_none());
    // sd of n alternating values ±1: √(n/(n − 1)).
    assert!((rows[11].sd.unwrap() - (12.0_f64 / 11.0).sqrt()).abs() < 1e-12);
    let analysis: Vec<MeasuredAnalysisRow> = study.table();
    let [row] = analysis.as_slice() else { panic!("{analysis:?}") };
    // Running means are 25 or 25 + 1/n: within 1 % (0.25) from n = 4 on, because 1/5 < 0.25 < 1/3.
    assert_eq!(row.stable_from, Some(4));
    assert!(
        row.lilliefors_p.unwrap() < 0.05 && row.lilliefors_p_simulated.unwrap() < 0.05,
        "two values are not normal"
    );
    let plan = plan_repetitions(25.0, rows[11].sd.unwrap(), 12, 0.02, 0.95, Convention::Correct);
    assert_eq!(row.needed.map(|n| n as usize), plan.needed);
    assert!(row.needed_lower < row.needed && row.needed < row.needed_upper);

    let said = study.succeed(&["repetitions", "--precision", "1 %", "--json"]).out;
    let said: serde_json::Value = serde_json::from_str(&said).expect("JSON");
    // t(n − 1) 1.0445/√n ≤ 0.25 first at n = 70: t(69) = 1.9949.
    assert_eq!(said[0]["needed"], 70, "{said}");
    assert_eq!(study.run(&["repetitions", "--precision=0"]).code, Some(1));
}

/// A load cell over a hopper that discharges `rate` kg/s from the release on, sampled at 50 Hz, a tare of 3 N on it.
fn force(repetition: u32, rate: f64) -> String {
    let sample = |i: i32| {
        let time = f64::from(i) / 50.0;
        let mass = (20.0 + f64::from(repetition) - rate * time.max(0.0)).max(0.0);
        format!("hopper,{repetition},{time},{},N\n", 9.81 * mass + 3.0)
    };
    (-10..400).map(sample).collect()
}

/// The edge of a ledge that slopes down by `angle` degrees, a point every centimetre.
fn outline(repetition: u32, angle: f64) -> String {
    let point = |i: i32| {
        let x = f64::from(i) * 10.0;
        format!("ledge,{repetition},{x},{},mm\n", 220.0 + f64::from(repetition) - x * angle.to_radians().tan())
    };
    (0..24).map(point).collect()
}

#[test]
fn raw_records_go_through_the_code_of_the_simulations() {
    let study = study(&format!("experiment,repetition,time,force,unit\n{}{}", force(1, 3.6), force(2, 3.8)));
    let outlines = format!("experiment,repetition,x,z,unit\n{}{}", outline(1, 40.0), outline(2, 42.0));
    study.write("data/outline.csv", &outlines);
    std::fs::rename(study.path("lab.csv"), study.path("data/force.csv")).expect("a file");
    study.edit("pipeline.toml", "path = \"lab.csv\"", "path = \"data\"");
    study.succeed(&["repro", "analyse"]);
    let rows: Vec<MeasuredStatisticRow> = study.table();
    let last = |kpi: &str| rows.iter().rfind(|row| row.kpi == kpi).expect("a row");
    // Both records are exactly linear, so only rounding of the text is left.
    assert!((last("discharge_rate").mean - 3.7).abs() < 1e-9 && last("discharge_rate").n == 2);
    assert!((last("angle_of_movement").mean - 41.0).abs() < 1e-9, "{}", last("angle_of_movement").mean);
    // Time of 95 % of 21 and 22 kg at either rate.
    assert!((last("hopper_emptying_time").mean - 0.5 * 0.95 * (21.0 / 3.6 + 22.0 / 3.8)).abs() < 1e-9);
    assert!(rows.iter().all(|row| row.kpi != "ledge_mass"), "a picture does not weigh");

    // A setting of the measurement changes what the records say, and makes stale what reads them.
    study.write("data/outline.csv", &outlines.replace("ledge,1,200,", "ledge,1,200,9"));
    study.succeed(&["repro", "analyse"]);
    study.edit("pipeline.toml", "[setup.ledge]\n", "[setup.ledge]\nwindow_end = 0.15\n");
    assert_eq!(study.ran(&["analyse"]), ["analyse"]);
    study.write("data/force.csv", "experiment,repetition,time,force,unit\nhopper,1,0,9,N\nhopper,1,0.02,9,N\n");
    let refused = study.run(&["repro", "analyse"]);
    assert_eq!(refused.code, Some(1));
    assert!(refused.err.contains("gives no discharge_rate") && refused.err.contains("force.csv:2"), "{}", refused.err);
    study.write("data/force.csv", "experiment,repetition,time,force,unit\nhopper,1,0.2,9,N\nhopper,1,0.1,9,N\n");
    assert!(study.run(&["repro", "analyse"]).err.contains("sort by time"));
    study.write("data/force.csv", "experiment,repetition,time,force,unit\nledge,1,0.2,9,N\n");
    assert!(study.run(&["repro", "analyse"]).err.contains("nothing is read off a force over time of ledge"));
}

#[test]
fn design_sensitivity_posterior_and_feasibility_are_tables() {
    let study = Study::quick();
    study.succeed(&["repro", "feasibility"]);
    study.succeed(&["repro", "calibrate"]);
    let quality: Vec<DesignQualityRow> = study.table();
    assert_eq!(
        quality.iter().map(|row| (row.set.as_str(), row.points)).collect::<Vec<_>>(),
        [("boundary", 2), ("interior", 2), ("validation", 1)]
    );
    assert!(quality.iter().all(|row| row.joint_min_distance.unwrap() > 0.0));
    let feasibility: Vec<FeasibilityRow> = study.table();
    assert!(!feasibility.is_empty());
    for row in &feasibility {
        let (low, high) = (row.lowest.unwrap(), row.highest.unwrap());
        assert_eq!(row.bracketed, (low..=high).contains(&row.target), "{row:?}");
        assert_eq!(row.bracketed, row.outside_sd == Some(0.0), "{row:?}");
    }
    let sensitivity: Vec<SensitivityRow> = study.table();
    assert_eq!(sensitivity.len(), 2 * 2, "two KPIs, mean and sd, one parameter");
    // The only parameter explains everything that varies.
    for row in sensitivity.iter().filter(|row| row.spread > 0.0) {
        assert!((row.first - 1.0).abs() < 0.02 && (row.total - 1.0).abs() < 0.02, "{row:?}");
    }
    let (draws, summary): (Vec<PosteriorRow>, Vec<PosteriorSummaryRow>) = (study.table(), study.table());
    assert_eq!(summary.len(), 1);
    assert!(draws.len() >= 350 && draws.iter().all(|row| (0.2..=0.8).contains(&row.value)));
    let inside = draws.iter().filter(|row| (summary[0].lower..=summary[0].upper).contains(&row.value)).count();
    // 95 % of the walk lie inside; 400 draws of it scatter by four standard errors of 1.1 % at most.
    assert!((inside as f64 / draws.len() as f64 - 0.95).abs() < 0.045, "{inside} of {}", draws.len());
}

#[test]
fn a_suggested_round_is_taken_by_sample() {
    let study = Study::quick();
    assert!(study.run(&["plan", "--suggest", "2"]).err.contains("granulake repro train"));
    study.succeed(&["repro", "train"]);
    let (before, points) = (study.runs(), study.table::<SampleRow>().len());
    let rows = study.succeed(&["plan", "--suggest", "3"]).out;
    assert!(rows.starts_with("sliding_friction,extra_repetitions,note\n") && rows.lines().count() == 4, "{rows}");
    // One of its own besides: a point of the design, which only gets more runs.
    study.write("points.csv", &format!("{rows}0.2,1,by hand\n"));
    study.edit("pipeline.toml", "validation = 1", "validation = 1\npoints = \"points.csv\"");
    study.succeed(&["repro", "train"]);
    let new = rows.matches("new point").count();
    assert_eq!(study.table::<SampleRow>().len(), points + new, "one parameter, one row per point");
    // Two repetitions of every choice in two experiments, and one by hand.
    assert_eq!(study.runs() - before, 3 * 2 * 2 + 2);
    let extra: u32 = study.table::<ReplicationRow>().iter().map(|row| row.extra).sum();
    assert_eq!(extra as usize, 2 * (3 - new) + 1);
    let aggregates: Vec<AggregateRow> = study.table();
    let counted = |n: u32| aggregates.iter().filter(|row| row.n == n).map(|row| row.count).max();
    assert_eq!(counted(1), Some(1));
    assert!(counted(2) > Some(2), "the runs beyond the others' count at the largest n");

    let again = study.succeed(&["plan", "--suggest", "1"]).out;
    assert_eq!(again.matches("chosen before").count(), 4, "{again}");
    for (row, complaint) in [
        ("0.95,0", "points.csv:2: sliding_friction = 0.95 lies outside the bounds 0.2 to 0.8"),
        ("0.5,-1", "extra_repetitions `-1` is not a whole number"),
    ] {
        study.write("points.csv", &format!("sliding_friction,extra_repetitions\n{row}\n"));
        let refused = study.run(&["plan"]);
        assert!(refused.code == Some(1) && refused.err.contains(complaint), "{}", refused.err);
    }
}

#[test]
fn bounds_of_the_density_bring_the_simulated_bulk_density_to_the_measured_one() {
    let study = Study::quick();
    assert!(study.run(&["bounds", "--density", "2500"]).err.contains("is no parameter of this study"));
    let parameter = "[parameters.particle_density]\nlower = 2000\nupper = 3500\n\n[experiments]";
    study.edit("pipeline.toml", "[experiments]", parameter);
    assert!(study.run(&["bounds"]).err.contains("give one with --density"));
    let asked = ["bounds", "--density", "2500 kg/m3", "--reps", "3", "--json"];
    let found: serde_json::Value = serde_json::from_str(&study.succeed(&asked).out).expect("JSON");
    assert_eq!(study.runs(), 6, "three at either corner");
    let lab = std::fs::read_to_string(study.path("lab.csv")).expect("data");
    let row = lab.lines().find(|line| line.starts_with("bulk_density,bulk_density")).expect("a bulk density");
    let measured: f64 = row.split(',').nth(2).and_then(|text| text.parse().ok()).expect("a number");
    let number = |bound: &str, key: &str| found[bound][key].as_f64().expect("a number");
    for bound in ["lower", "upper"] {
        // Eqs 2 and 3.
        let wanted = measured / number(bound, "simulated_mean") * 2500.0;
        assert!((number(bound, "unrounded") - wanted).abs() < 1e-9 * wanted && number(bound, "standard_error") > 0.0);
    }
    let text = study.succeed(&asked[..5]).out;
    assert!(text.contains("[parameters.particle_density]\nlower = ") && study.runs() == 6, "{text}");
}

/// Any number of settings can be calibrated: five here, one on a log scale, one the friction of a wall.
#[test]
fn five_parameters_go_through_the_whole_study() {
    let study = Study::quick();
    let parameters = "[parameters.rolling_friction]\nlower = 0.1\nupper = 0.6\n\n\
                      [parameters.particle_density]\nlower = 2300\nupper = 2900\n\n\
                      [parameters.damping]\nlower = 0.1\nupper = 0.6\nscale = \"log\"\n\n\
                      [parameters.wall_friction_acrylic]\nlower = 0.2\nupper = 0.7\n\n[experiments]";
    study.edit("pipeline.toml", "[experiments]", parameters);
    study.edit("pipeline.toml", "boundary_levels = 2\ninterior = 2", "boundary_levels = 0\ninterior = 8");
    study.succeed(&["repro"]);
    let samples: Vec<SampleRow> = study.table();
    assert_eq!(samples.len(), 5 * (8 + 1));
    for row in samples.iter().filter(|row| row.parameter == "damping") {
        let wanted = 0.1 * 6.0_f64.powf(row.unit_value);
        assert!((row.value - wanted).abs() < 1e-12, "{row:?}");
    }
    // A Sobol sequence: every half of every parameter's range holds half of the eight points.
    let inside = |name: &str| {
        let own = samples.iter().filter(|row| row.parameter == name && row.set == "interior");
        own.filter(|row| row.unit_value < 0.5).count()
    };
    assert_eq!(inside("damping"), 4);
    assert_eq!(study.table::<PosteriorSummaryRow>().len(), 5);
    assert_eq!(study.table::<SensitivityRow>().len(), 5 * 2 * 2);
    let report = std::fs::read_to_string(study.path("artifacts/report/index.html")).expect("a report");
    assert!(report.contains("wall friction acrylic") && report.contains("Corner plots"));
}
