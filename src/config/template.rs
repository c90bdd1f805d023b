//! Texts that `init` writes: a commented study, the paper's targets and a form for one's own measurements.
//!
//! The study is the shipped pipeline.toml itself, so a new user starts from what the tests run.

use super::schema;

/// The commented default study.
pub fn pipeline() -> &'static str {
    include_str!("../../pipeline.toml")
}

/// A form for measured values: every observable, how it is read off, and which effect it makes visible.
pub fn measured() -> &'static str {
    include_str!("measured_template.csv")
}

/// The targets of Fransen et al. (2022), Table 2.
pub fn paper_targets() -> &'static str {
    include_str!("../../artifacts/measured/fransen2022.csv")
}

/// Measurements made by the shipped set-up with an effect that the shipped study does not declare.
pub fn demo() -> &'static str {
    include_str!("../../artifacts/measured/demo/measured.csv")
}

/// Path, relative to the new folder, and text of every file above, with the schema that editors complete from.
pub fn files() -> Vec<(&'static str, String)> {
    vec![
        ("pipeline.toml", pipeline().to_owned()),
        ("schemas/pipeline.schema.json", schema::text()),
        ("artifacts/measured/fransen2022.csv", paper_targets().to_owned()),
        ("artifacts/measured/demo/measured.csv", demo().to_owned()),
        ("artifacts/measured/template.csv", measured().to_owned()),
    ]
}
