//! Tables: the same rows give the same bytes, and what does not fit is named by file and column.

use super::{Entry, entry, other};
use granulake::canonical::Digest;
use granulake::tables::columns::{Column, ColumnFile};
use granulake::tables::io::{from_foreign_parquet_bytes, from_parquet_bytes, read_table_as, to_parquet_bytes};
use granulake::tables::{Fault, Row, TableError, TableSpec, io, schema};
use std::fs;

granulake::table! {
    /// One row of every type a table can hold,
    /// over two lines.
    pub struct EveryType in "every_type" version 3 sorted by (count, name) {
        /// A count.
        count: u32 ["1"],
        /// A seed.
        seed: u64 ["1"],
        /// A number.
        value: f64 ["kg/m3"],
        /// A truth.
        flag: bool [""],
        /// A text.
        name: String [""],
        /// A count that may be missing.
        some_count: Option<u32> ["1"],
        /// A seed that may be missing.
        some_seed: Option<u64> ["1"],
        /// A number that may be missing.
        some_value: Option<f64> ["deg"],
        /// A truth that may be missing.
        some_flag: Option<bool> [""],
        /// A text that may be missing.
        some_name: Option<String> [""],
    }
}

fn every_type(count: u32) -> EveryType {
    let some = count % 2 == 1;
    EveryType {
        count,
        seed: u64::MAX - u64::from(count),
        value: f64::from(count) * 0.1 - 7.0,
        flag: some,
        name: format!("sand “{count}” ä"),
        some_count: some.then_some(u32::MAX),
        some_seed: some.then_some(u64::MAX),
        some_value: some.then_some(f64::MIN_POSITIVE),
        some_flag: some.then_some(false),
        some_name: some.then(String::new),
    }
}

#[test]
fn every_type_and_null_survives() {
    for n in [0, 1, 2, 1000] {
        let rows: Vec<_> = (0..n).map(every_type).collect();
        let bytes = to_parquet_bytes(&rows).unwrap();
        assert_eq!(from_parquet_bytes::<EveryType>("file", bytes).unwrap(), rows, "{n} rows");
    }
    let extreme = [f64::INFINITY, f64::NEG_INFINITY, -0.0, f64::MAX, 5e-324, 0.1 + 0.2];
    let rows: Vec<_> =
        extreme.iter().zip(0..).map(|(&value, count)| EveryType { value, ..every_type(count) }).collect();
    let read = from_parquet_bytes::<EveryType>("file", to_parquet_bytes(&rows).unwrap()).unwrap();
    let bits = |rows: &[EveryType]| rows.iter().map(|row| row.value.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&read), bits(&rows));
}

#[test]
fn bytes_depend_on_the_rows_alone() {
    let rows: Vec<_> = (0..300).map(every_type).collect();
    let bytes = to_parquet_bytes(&rows).unwrap();
    let backwards: Vec<_> = rows.iter().rev().cloned().collect();
    assert_eq!(to_parquet_bytes(&backwards).unwrap(), bytes);
    assert!(String::from_utf8_lossy(&bytes).contains("granulake"));
    assert!(!String::from_utf8_lossy(&bytes).contains("parquet-rs"), "the writer's version would move every digest");
    // Pinned: a change of these bytes moves every stored digest, so it needs a new schema version and a changelog entry.
    let golden = "e4a9c19ab1c321d9f3ad3563f5d99c5819fbd1eaee02703c987c0aeeaf6a1879";
    assert_eq!(Digest::of_content(&bytes).to_string(), golden);
}

#[test]
fn nan_is_refused_with_its_place() {
    let rows = [every_type(1), EveryType { some_value: Some(f64::NAN), ..every_type(2) }];
    let error = to_parquet_bytes(&rows).unwrap_err();
    assert_eq!(*error.fault, Fault::NotANumber { column: "some_value".into(), row: 2 });
    assert_eq!(
        error.to_string(),
        "rows in memory: table `every_type`: column `some_value`, row 2: NaN cannot be stored; store a null and a \
         reason instead"
    );
}

fn fault<R: Row + std::fmt::Debug>(bytes: Vec<u8>) -> (Fault, String) {
    let error: TableError = from_parquet_bytes::<R>("tables/x.parquet", bytes).unwrap_err();
    let text = error.to_string();
    assert!(text.starts_with("tables/x.parquet: table `"), "{text}");
    (*error.fault, text)
}

#[test]
fn a_schema_that_differs_is_named_by_file_and_column() {
    let full = to_parquet_bytes(&[every_type(1)]).unwrap();
    let thin = to_parquet_bytes(&[other::WrongType { count: 1 }]).unwrap();
    let (unknown, text) = fault::<other::WrongType>(full);
    assert_eq!(unknown, Fault::UnknownColumn { column: "seed".into() }, "{text}");
    let (wrong, text) = fault::<EveryType>(thin);
    assert!(matches!(wrong, Fault::WrongType { ref column, .. } if column == "count"), "{wrong:?}");
    assert!(text.contains("column `count` has type UInt64, expected u32"), "{text}");

    let entries = to_parquet_bytes(&entry(1)).unwrap();
    let (unit, text) = fault::<other::WrongUnit>(entries.clone());
    assert!(matches!(unit, Fault::WrongUnit { .. }), "{text}");
    assert!(text.contains("column `value` has unit `1`, expected `mm`"), "{text}");
    assert!(matches!(fault::<other::Later>(entries.clone()).0, Fault::WrongVersion { expected: 2, .. }));
    assert_eq!(fault::<EveryType>(entries).0, Fault::WrongTable { found: "entries".into() });
}

#[test]
fn a_missing_column_is_named() {
    let batch = Entry::to_batch(&entry(1)).unwrap().project(&[0, 2]).unwrap();
    let error = Entry::from_batch(&batch).unwrap_err().to_string();
    assert!(error.contains("column `name` (string) is missing"), "{error}");
}

#[test]
fn damaged_bytes_are_an_error_and_never_a_panic() {
    let bytes = to_parquet_bytes(&(0..20).map(every_type).collect::<Vec<_>>()).unwrap();
    for length in 0..bytes.len() {
        assert!(from_parquet_bytes::<EveryType>("x", bytes[..length].to_vec()).is_err(), "cut at {length}");
    }
}

#[test]
fn a_table_may_share_its_columns_with_another() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("twin.parquet");
    let twin = TableSpec { name: "twin", ..*EveryType::SPEC };
    let rows = [every_type(1), every_type(2)];
    fs::write(&path, io::encode(&twin, &EveryType::to_batch(&rows).unwrap()).unwrap()).unwrap();
    assert_eq!(read_table_as::<EveryType>(&twin, &path).unwrap(), rows);
    assert!(io::read_table::<EveryType>(&path).unwrap_err().to_string().contains("this is table `twin`"));
}

#[test]
fn foreign_files_are_converted_without_loss_or_refused() {
    let foreign = |count, value| to_parquet_bytes(&[other::Foreign { index: 0, count, value }]).unwrap();
    let read = |bytes| from_foreign_parquet_bytes::<other::Narrow>("measured.parquet", bytes);
    assert_eq!(read(foreign(7, None)).unwrap(), [other::Narrow { value: None, count: 7 }]);
    let error = read(foreign(u64::from(u32::MAX) + 1, None)).unwrap_err();
    assert!(matches!(*error.fault, Fault::OutOfRange { .. }), "{error}");
    assert!(error.to_string().starts_with("measured.parquet: table `narrow`: column `count`"), "{error}");
    // Text never becomes a number by itself.
    let text = to_parquet_bytes(&[Entry { key: "1".into(), name: "2".into(), value: None }]).unwrap();
    assert!(matches!(*read(text).unwrap_err().fault, Fault::MissingColumn { .. }));
}

#[test]
fn states_keep_names_units_and_bits() {
    let columns = vec![
        Column::u32("id", "1", vec![3, 1, 2]),
        Column::f64("x", "m", vec![0.1, -0.0, 1e-300]),
        Column::f64("vx", "m/s", vec![0.0; 3]),
    ];
    let state = ColumnFile::new("state", columns).unwrap();
    let bytes = state.clone().to_parquet_bytes("state").unwrap();
    assert_eq!(bytes, state.clone().to_parquet_bytes("state").unwrap());
    let read = ColumnFile::from_parquet_bytes("state", "a", bytes.clone()).unwrap();
    assert_eq!(read, state);
    assert_eq!(read.u32("id"), Some(&[3, 1, 2][..]));
    assert_eq!(read.f64("x").map(|x| x[1].to_bits()), Some((-0.0_f64).to_bits()));
    assert_eq!((read.f64("id"), read.f64("y"), read.rows()), (None, None, 3));

    let error = ColumnFile::from_parquet_bytes("trace", "a", bytes).unwrap_err().to_string();
    assert!(error.contains("this is table `state`"), "{error}");
    let ragged = vec![Column::f64("x", "m", vec![0.0]), Column::f64("y", "m", vec![])];
    let error = ColumnFile::new("state", ragged).unwrap_err().to_string();
    assert!(error.contains("column `y` has 0 values, expected 1"), "{error}");
    let diverged = ColumnFile::new("state", vec![Column::f64("x", "m", vec![f64::NAN])]).unwrap();
    assert!(diverged.to_parquet_bytes("state").is_err());
}

#[test]
fn a_description_says_what_the_declaration_says() {
    let text = schema::describe(Entry::SPEC);
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(json["keyed_by"], "key");
    assert_eq!(json["columns"][2]["unit"], "1");
    assert_eq!(json["columns"][2]["nullable"], true);
    assert_eq!(EveryType::SPEC.meaning, "One row of every type a table can hold, over two lines.");
    assert_eq!(EveryType::SPEC.keyed_by, None);
    assert!(text.starts_with("{\n  \"table\": \"entries\",") && text.ends_with("}\n"), "{text}");
}
