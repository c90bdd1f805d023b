//! Measured data as users write it, right and wrong.

use super::raw::{self, Format};
use super::*;
use arrow::array::{ArrayRef, Float64Array, Int32Array, RecordBatch, StringArray};
use parquet::arrow::ArrowWriter;
use std::sync::Arc;

const HEADER: &str = "experiment,repetition,kpi,value,unit\n";
const SUMMARY: &str = "experiment,kpi,mean,sd,n,unit\n";

fn collect(files: &[(&str, &str)]) -> Result<(Vec<MeasuredValue>, Vec<MeasuredSummary>), Problems> {
    let mut collector = rows::Collector::default();
    for (file, text) in files {
        match raw::csv(text, file) {
            Ok(table) => collector.add(&table),
            Err(problem) => collector.problem(problem),
        }
    }
    collector.finish(&Settings::default()).map(|(values, summaries, _)| (values, summaries))
}

/// The message about `text` as file `m.csv`.
fn refusal(text: &str) -> String {
    match collect(&[("m.csv", text)]) {
        Ok(rows) => panic!("accepted {text:?} as {rows:?}"),
        Err(problems) => problems.to_string(),
    }
}

#[test]
fn single_values_are_converted_sorted_and_summarised() {
    let text = "# a comment\r\n\u{20}\nunit,kpi,value,experiment,repetition,note\r\ng,pile_shelf_mass,412,pile,2,\r\n\
                deg,angle_of_repose, 25.5 ,pile,2,\"wet, windy\"\nkg,pile_shelf_mass,0.402,pile,1,\n°,angle_of_repose,24.5,pile,1,x\n";
    let (values, summaries) = collect(&[("m.csv", text)]).unwrap();
    let seen: Vec<_> = values.iter().map(|value| (value.kpi, value.repetition, value.value)).collect();
    assert_eq!(
        seen,
        [
            ("angle_of_repose", 1, 24.5),
            ("angle_of_repose", 2, 25.5),
            ("pile_shelf_mass", 1, 0.402),
            ("pile_shelf_mass", 2, 0.412)
        ]
    );
    let set = Measured::new("m", values, summaries, Vec::new());
    let angle = set.statistic("angle_of_repose").unwrap();
    assert_eq!((angle.mean, angle.n, angle.unit, angle.experiment), (25.0, 2, "deg", "pile"));
    assert!((angle.sd - 0.5_f64.sqrt()).abs() < 1e-15);
    assert_eq!(set.values_of("pile_shelf_mass"), [0.402, 0.412]);
    assert_eq!(set.statistic("bulk_density"), None);
}

#[test]
fn the_first_n_values_are_those_with_the_lowest_repetitions() {
    let rows = [(3, 1490.0), (1, 1470.0), (2, 1480.0)];
    let text = rows.iter().fold(HEADER.to_owned(), |text, (repetition, value)| {
        format!("{text}bulk_density,{repetition},bulk_density,{value},kg/m3\n")
    });
    let (values, summaries) = collect(&[("m.csv", &text)]).unwrap();
    let set = Measured::new("m", values, summaries, Vec::new());
    let means: Vec<_> =
        [2, 3, 9].iter().map(|n| (set.statistics_of_first(*n)[0].mean, set.statistics_of_first(*n)[0].n)).collect();
    assert_eq!(means, [(1475.0, 2), (1480.0, 3), (1480.0, 3)]);
}

#[test]
fn bad_rows_are_refused_with_line_and_remedy() {
    let row = |row: &str| format!("{HEADER}{row}\n");
    let summary = |row: &str| format!("{SUMMARY}{row}\n");
    let cases: Vec<(String, &str)> = vec![
        (String::new(), "m.csv: holds no header; `granulake init` writes a template"),
        (HEADER.to_owned(), "m.csv: holds a header but no rows"),
        ("experiment;repetition;kpi;value;unit\n".to_owned(), "m.csv:1: columns are not separated by commas"),
        ("experiment,repetition,kpi,value\n".to_owned(), "m.csv:1: column `unit` is missing"),
        ("experiment,repetition,kpi,valu,unit\n".to_owned(), "m.csv:1: unknown column `valu`; did you mean `value`?"),
        ("experiment,repetition,kpi,kpi,value,unit\n".to_owned(), "m.csv:1: column `kpi` stands twice"),
        ("experiment,kpi,value,mean,sd,n,unit\n".to_owned(), "m.csv:1: single values and summaries share a header"),
        (row("pile,1,angle_of_repose,25"), "m.csv:2: 4 cells where the header has 5"),
        (row("pile,1,angle_of_repose,25,1,deg"), "m.csv:2: 6 cells where the header has 5"),
        (row("pile,1,\"angle_of_repose,25,deg"), "m.csv:2: a double quote is not closed"),
        (row("pil,1,angle_of_repose,25,deg"), "m.csv:2: no experiment is called `pil`; did you mean `pile`?"),
        (
            row("pile,1,angle_of_repos,25,deg"),
            "m.csv:2: pile has no observable `angle_of_repos`; did you mean `angle_of_repose`?",
        ),
        (
            row("pile,1,bulk_density,25,deg"),
            "m.csv:2: pile has no observable `bulk_density`; it belongs to bulk_density",
        ),
        (row("pile,0,angle_of_repose,25,deg"), "m.csv:2: repetition `0` is not a whole number from 1 on"),
        (row("pile,1.5,angle_of_repose,25,deg"), "m.csv:2: repetition `1.5` is not a whole number from 1 on"),
        (row("pile,-1,angle_of_repose,25,deg"), "m.csv:2: repetition `-1` is not a whole number from 1 on"),
        (row("pile,1,angle_of_repose,NaN,deg"), "m.csv:2: value `NaN` is not a finite number"),
        (row("pile,1,angle_of_repose,inf,deg"), "m.csv:2: value `inf` is not a finite number"),
        (row("pile,1,angle_of_repose,1e999,deg"), "m.csv:2: value `1e999` is not a finite number"),
        (row("pile,1,angle_of_repose,12 %,deg"), "m.csv:2: value `12 %` is not a finite number"),
        (row("pile,1,angle_of_repose,,deg"), "m.csv:2: value `` is not a finite number"),
        (
            row("pile,1,angle_of_repose,25,kg"),
            "m.csv:2: unit of angle_of_repose: `25 kg` is a mass, but an angle such as",
        ),
        (row("pile,1,angle_of_repose,25,"), "m.csv:2: unit of angle_of_repose: `25` is a plain number, but an angle"),
        (row("pile,1,angle_of_repose,25,degg"), "m.csv:2: unit of angle_of_repose: unit `degg` is not known"),
        (row("pile,1,angle_of_repose,25,deg"), "m.csv:2: angle_of_repose of pile was measured once"),
        (
            row("pile,1,angle_of_repose,25,deg\npile,1,angle_of_repose,26,deg"),
            "m.csv:3: repetition 1 of angle_of_repose stands twice, first in line 2",
        ),
        (
            row("pile,1,angle_of_repose,25,deg\npile,2,angle_of_repose,25,deg"),
            "m.csv:2: angle_of_repose of pile has the same value in every repetition",
        ),
        (
            row("pile,1,angle_of_repose,1e300,deg\npile,2,angle_of_repose,-1e300,deg"),
            "m.csv:2: angle_of_repose of pile has values too large for a mean and a scatter",
        ),
        (summary("pile,angle_of_repose,25,2,1,deg"), "m.csv:2: n `1` is not a whole number from 2 on"),
        (summary("pile,angle_of_repose,25,-2,50,deg"), "m.csv:2: sd is -2; give the scatter"),
        (summary("pile,angle_of_repose,25,0,50,deg"), "m.csv:2: sd is 0; give the scatter"),
        (summary("pile,angle_of_repose,25,NaN,50,deg"), "m.csv:2: sd `NaN` is not a finite number"),
        (summary("pile,angle_of_repose,25,2,50,m"), "m.csv:2: unit of angle_of_repose: `25 m` is a length"),
        (
            summary("pile,angle_of_repose,25,2,50,deg\npile,angle_of_repose,25,2,50,deg"),
            "m.csv:3: angle_of_repose stands twice, first in line 2",
        ),
    ];
    for (text, snippet) in cases {
        let message = refusal(&text);
        assert!(message.contains(snippet), "{text:?}\n  gave     {message}\n  expected {snippet}");
    }
}

#[test]
fn all_problems_of_a_file_are_told_at_once() {
    let message = refusal(&format!(
        "{HEADER}pil,1,angle_of_repose,1,deg\npile,0,angle_of_repose,2,deg\npile,1,angle_of_repose,x,deg\n"
    ));
    assert!(message.starts_with("3 problems:\n  m.csv:2:"), "{message}");
    assert!(message.contains("\n  m.csv:3:") && message.contains("\n  m.csv:4:"), "{message}");
}

#[test]
fn files_of_one_set_may_not_contradict_each_other() {
    let values = format!("{HEADER}pile,1,angle_of_repose,25,deg\npile,2,angle_of_repose,26,deg\n");
    let summary = format!("{SUMMARY}pile,angle_of_repose,25,2,50,deg\n");
    let message = collect(&[("a.csv", &values), ("b.csv", &summary)]).unwrap_err().to_string();
    assert!(message.contains("angle_of_repose of pile has single values and a summary"), "{message}");
    let twice = collect(&[("a.csv", &values), ("b.csv", &values)]).unwrap_err().to_string();
    assert!(
        twice.contains("b.csv:2: repetition 1 of angle_of_repose stands twice, first in line 2 of a.csv"),
        "{twice}"
    );
}

#[test]
fn parquet_reads_as_csv_does() {
    let folder = tempfile::tempdir().unwrap();
    let texts = |column: [&str; 2]| Arc::new(StringArray::from(column.to_vec())) as ArrayRef;
    let write = |name: &str, values: Vec<Option<f64>>| {
        let batch = RecordBatch::try_from_iter([
            ("experiment", texts(["ledge", "ledge"])),
            ("repetition", Arc::new(Int32Array::from(vec![1, 2])) as ArrayRef),
            ("kpi", texts(["ledge_mass", "ledge_mass"])),
            ("value", Arc::new(Float64Array::from(values)) as ArrayRef),
            ("unit", texts(["g", "g"])),
        ])
        .unwrap();
        let file = std::fs::File::create(folder.path().join(name)).unwrap();
        let mut writer = ArrowWriter::try_new(file, batch.schema(), None).unwrap();
        writer.write(&batch).unwrap();
        writer.close().unwrap();
    };
    write("right.parquet", vec![Some(402.1), Some(412.5)]);
    let set = Measured::read("lab", &folder.path().join("right.parquet")).unwrap();
    assert_eq!(set.values_of("ledge_mass"), [0.4021, 0.4125]);

    write("wrong.parquet", vec![Some(402.1), None]);
    let message = Measured::read("lab", &folder.path().join("wrong.parquet")).unwrap_err().to_string();
    assert!(message.contains("wrong.parquet, row 2: value `` is not a finite number"), "{message}");

    std::fs::write(folder.path().join("broken.parquet"), b"PAR1 but nothing more PAR1").unwrap();
    let message = Measured::read("lab", &folder.path().join("broken.parquet")).unwrap_err().to_string();
    assert!(message.contains("cannot be read as Parquet"), "{message}");
}

#[test]
fn a_folder_is_the_union_of_its_data_files() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let empty = Measured::read("lab", folder.path()).unwrap_err().to_string();
    assert!(empty.contains("holds no .csv or .parquet file"), "{empty}");
    write("README.md", "not data");
    write("b.csv", &format!("{SUMMARY}hopper,discharge_rate,3.68,0.025,5,kg/s\n"));
    write("a.csv", &format!("{HEADER}pile,1,angle_of_repose,25,deg\npile,2,angle_of_repose,26,deg\n"));
    let set = Measured::read("lab", folder.path()).unwrap();
    assert_eq!(set.files, [folder.path().join("a.csv"), folder.path().join("b.csv")]);
    let names: Vec<_> = set.statistics().iter().map(|summary| summary.kpi).collect();
    assert_eq!(names, ["discharge_rate", "angle_of_repose"]);
    let missing = Measured::read("lab", &folder.path().join("none.csv")).unwrap_err().to_string();
    assert!(missing.contains("cannot be read") && missing.contains("check `path`"), "{missing}");
}

#[test]
fn the_ending_decides_the_format() {
    assert_eq!(Format::of(Path::new("a/b.CSV")), Some(Format::Csv));
    assert_eq!(Format::of(Path::new("b.parquet")), Some(Format::Parquet));
    assert_eq!(Format::of(Path::new("b.xlsx")), None);
    assert_eq!(Format::of(Path::new("csv")), None);
}

#[test]
fn a_property_of_the_grains_is_no_observable() {
    let text = format!(
        "{HEADER}grains,1,particle_density,2.30,g/cm3\ngrains,2,particle_density,2.32,g/cm3\npile,1,angle_of_repose,25,deg\n\
         pile,2,angle_of_repose,26,deg\n"
    );
    let (values, summaries) = collect(&[("m.csv", &text)]).unwrap();
    let set = Measured::new("m", values, summaries, Vec::new());
    assert_eq!(set.statistics().len(), 1);
    let density = &set.properties[0];
    assert_eq!((density.kpi, density.unit, density.n), ("particle_density", "kg/m3", 2));
    assert!((density.mean - 2310.0).abs() < 1e-9 && (density.sd - 200.0_f64.sqrt()).abs() < 1e-9);
    let wrong = refusal(&format!("{HEADER}grains,1,particle_densty,2300,kg/m3\n"));
    assert!(wrong.contains("did you mean `particle_density`?"), "{wrong}");
    let set = [("m.csv", &*format!("{SUMMARY}grains,particle_density,2313.4,30,10,kg/m3\n"))];
    let (values, summaries) = collect(&set).unwrap();
    assert_eq!(Measured::new("m", values, summaries, Vec::new()).properties[0].n, 10);
}

/// Of ten repetitions every fifth is held out; where that leaves one value, or a test is not named, nothing is.
#[test]
fn a_share_of_the_repetitions_is_held_out_evenly() {
    let value =
        |experiment, kpi, repetition: u32| MeasuredValue { experiment, kpi, repetition, value: f64::from(repetition) };
    let pile = (1..=10).map(|repetition| value("pile", "angle_of_repose", repetition));
    let density = (1..=6).map(|repetition| value("density", "bulk_density", repetition));
    let hopper = (1..=10).map(|repetition| value("hopper", "discharge_rate", repetition));
    let values: Vec<_> = density.chain(hopper).chain(pile).collect();
    let set = Measured { name: "blind".to_owned(), values, ..Measured::default() };
    let tests = ["pile", "density"];
    let (seen, unseen) = set.hold_out(0.2, &tests);
    assert_eq!(unseen.series_of("angle_of_repose"), [(5, 5.0), (10, 10.0)]);
    assert_eq!(seen.values_of("angle_of_repose"), [1.0, 2.0, 3.0, 4.0, 6.0, 7.0, 8.0, 9.0]);
    assert_eq!((seen.values.len(), unseen.values.len(), unseen.name.as_str()), (24, 2, "blind"));
    let (seen, unseen) = set.hold_out(0.5, &tests);
    assert_eq!(unseen.values_of("bulk_density"), [2.0, 4.0, 6.0]);
    assert_eq!(seen.values_of("discharge_rate").len(), 10, "not a test of the fit");
    assert_eq!(set.hold_out(0.0, &tests).0, set);
}
