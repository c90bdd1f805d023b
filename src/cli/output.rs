//! Rows of plain values as aligned text, CSV or JSON.

use serde_json::Value;

/// Columns padded to equal width, numbers to the right, a rule under the head.
pub fn aligned(names: &[String], rows: &[Vec<Value>]) -> String {
    let texts: Vec<Vec<String>> = rows.iter().map(|row| row.iter().map(plain).collect()).collect();
    let width = |column: usize| {
        texts.iter().map(|row| row[column].chars().count()).chain([names[column].chars().count()]).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..names.len()).map(width).collect();
    let numeric = |column: usize| rows.iter().all(|row| matches!(row[column], Value::Number(_) | Value::Null));
    let right: Vec<bool> = (0..names.len()).map(|column| !rows.is_empty() && numeric(column)).collect();
    let line = |cells: &[String]| {
        let padded = cells.iter().enumerate().map(|(column, cell)| pad(cell, widths[column], right[column]));
        padded.collect::<Vec<_>>().join("  ").trim_end().to_owned()
    };
    let rule = widths.iter().map(|width| "-".repeat(*width)).collect::<Vec<_>>().join("  ");
    [line(names), rule].into_iter().chain(texts.iter().map(|row| line(row))).collect::<Vec<_>>().join("\n")
}

fn pad(text: &str, width: usize, right: bool) -> String {
    if right { format!("{text:>width$}") } else { format!("{text:<width$}") }
}

fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Null => "-".to_owned(),
        other => other.to_string(),
    }
}

#[cfg(any(feature = "query", test))]
/// Comma-separated values (RFC 4180): a null is an empty field.
pub fn csv(names: &[String], rows: &[Vec<Value>]) -> String {
    let field = |text: &str| match text.contains(['"', ',', '\n', '\r']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text.to_owned(),
    };
    let head = names.iter().map(|name| field(name)).collect::<Vec<_>>().join(",");
    let body = rows.iter().map(|row| {
        let cells = row.iter().map(|value| if value.is_null() { String::new() } else { field(&plain(value)) });
        cells.collect::<Vec<_>>().join(",")
    });
    std::iter::once(head).chain(body).map(|line| line + "\n").collect()
}

#[cfg(any(feature = "query", test))]
/// A JSON array with one object per row.
pub fn json(names: &[String], rows: &[Vec<Value>]) -> String {
    let object = |row: &Vec<Value>| Value::Object(names.iter().cloned().zip(row.iter().cloned()).collect());
    let objects: Vec<String> = rows.iter().map(|row| object(row).to_string()).collect();
    format!("[{}]", objects.join(",\n "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> (Vec<String>, Vec<Vec<Value>>) {
        let names = vec!["name".to_owned(), "value".to_owned()];
        (names, vec![vec!["a,\"b\"".into(), 1.5.into()], vec!["c".into(), Value::Null]])
    }

    #[test]
    fn text_is_aligned_with_numbers_to_the_right() {
        let (names, rows) = example();
        assert_eq!(aligned(&names, &rows), "name   value\n-----  -----\na,\"b\"    1.5\nc          -");
        assert_eq!(aligned(&names, &[]), "name  value\n----  -----");
    }

    #[test]
    fn csv_quotes_and_leaves_nulls_empty() {
        let (names, rows) = example();
        assert_eq!(csv(&names, &rows), "name,value\n\"a,\"\"b\"\"\",1.5\nc,\n");
    }

    #[test]
    fn json_is_an_array_of_objects() {
        let (names, rows) = example();
        let parsed: Value = serde_json::from_str(&json(&names, &rows)).unwrap();
        assert_eq!(parsed[0]["value"], 1.5);
        assert!(parsed[1]["value"].is_null());
    }
}
