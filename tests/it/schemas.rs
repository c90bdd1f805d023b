//! The schemas beside the code are those of the code.

use granulake::config::schema;
use granulake::tables::list::{BESIDE, TABLES};
use granulake::tables::schema::describe;
use std::path::Path;

const REMEDY: &str = "run `cargo run --release -- schemas`";

#[test]
fn schemas_are_up_to_date() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("schemas");
    let tables = TABLES.iter().chain(BESIDE).map(|table| (format!("{}.json", table.name), describe(table)));
    let expected: Vec<(String, String)> = tables.chain([("pipeline.schema.json".to_owned(), schema::text())]).collect();
    for (name, text) in &expected {
        let found = std::fs::read_to_string(folder.join(name)).unwrap_or_default();
        assert!(&found == text, "schemas/{name} is stale; {REMEDY}");
    }
    let files = std::fs::read_dir(&folder).expect("schemas is there").count();
    assert_eq!(files, expected.len(), "schemas holds files of tables that are gone; delete them and {REMEDY}");
}
