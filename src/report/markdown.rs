//! The document as Markdown (CommonMark with GitHub's tables), readable as it stands in a terminal.
//!
//! Drawings are named but not drawn: every number in them stands in a table.

use super::document::{Block, Cell, Column, Document, Figure, Legend, Section, Style, Table, Text, Tone};

/// Renders the document.
pub fn render(document: &Document) -> String {
    let mut markdown = format!("# {}\n\n{}\n", plain(&document.title), plain(&document.subtitle));
    for (index, section) in document.sections.iter().enumerate() {
        markdown.push_str(&self::section(index + 1, section));
    }
    markdown
}

fn section(number: usize, section: &Section) -> String {
    format!("\n## {number} {}\n{}", plain(&section.title), blocks(&section.blocks, 3))
}

fn blocks(blocks: &[Block], level: usize) -> String {
    blocks.iter().map(|block| format!("\n{}\n", self::block(block, level))).collect()
}

fn block(block: &Block, level: usize) -> String {
    let hashes = "#".repeat(level);
    match block {
        Block::Heading(title) => format!("{hashes} {}", plain(title)),
        Block::Paragraph(text) => spans(text),
        Block::Note { title, text, .. } => format!("> **{}** {}", plain(title), spans(text)),
        Block::Card { eyebrow, headline, blocks, .. } => {
            let head = format!("{hashes} {}\n\n**{}**", plain(eyebrow), plain(headline));
            format!("{head}\n{}", self::blocks(blocks, level + 1)).trim_end().to_string()
        }
        Block::Facts(facts) => facts.iter().map(fact).collect::<Vec<_>>().join("\n"),
        Block::Table(table) => self::table(table),
        Block::Figures { legend, figures } => self::figures(legend, figures),
        Block::Code(code) => format!("```sql\n{code}\n```"),
        Block::Details { summary, blocks } => {
            format!("{hashes} {}\n{}", plain(summary), self::blocks(blocks, level + 1)).trim_end().to_string()
        }
    }
}

fn fact((term, text): &(String, Text)) -> String {
    format!("- {}: {}", plain(term), spans(text))
}

fn figures(legend: &Legend, figures: &[Figure]) -> String {
    let titles: Vec<String> = figures.iter().map(|figure| plain(&figure.chart.title)).collect();
    let series: Vec<String> = legend.iter().map(|(_, meaning)| plain(meaning)).collect();
    let marks = if series.is_empty() { String::new() } else { format!(" ({})", series.join(", ")) };
    format!("*Drawn in the HTML report: {}{marks}.*", titles.join("; "))
}

/// A table whose columns are padded to equal width.
fn table(table: &Table) -> String {
    let head: Vec<String> = table.columns.iter().map(|column| in_table(&plain(&column.title))).collect();
    let rows: Vec<Vec<String>> = table.rows.iter().map(|row| row.iter().map(content).collect()).collect();
    let widths: Vec<usize> = (0..head.len()).map(|column| width(&head, &rows, column)).collect();
    let rule: Vec<String> = table.columns.iter().zip(&widths).map(|(column, &width)| ruler(column, width)).collect();
    let mut lines = vec![format!("**{}**\n", plain(&table.caption)), line(&table.columns, &head, &widths)];
    lines.push(format!("|{}|", rule.join("|")));
    lines.extend(rows.iter().map(|row| line(&table.columns, row, &widths)));
    lines.join("\n")
}

fn width(head: &[String], rows: &[Vec<String>], column: usize) -> usize {
    let cells = rows.iter().filter_map(|row| row.get(column)).chain(&head[column..=column]);
    cells.map(|cell| cell.chars().count()).max().unwrap_or(0).max(3)
}

fn ruler(column: &Column, width: usize) -> String {
    if column.numeric { format!("{}:", "-".repeat(width + 1)) } else { "-".repeat(width + 2) }
}

fn line(columns: &[Column], cells: &[String], widths: &[usize]) -> String {
    let pad = |((column, cell), width): ((&Column, &String), &usize)| {
        if column.numeric { format!(" {cell:>width$} |") } else { format!(" {cell:<width$} |") }
    };
    let padded: String = columns.iter().zip(cells).zip(widths).map(pad).collect();
    format!("|{padded}")
}

fn content(cell: &Cell) -> String {
    let note = match cell.note.chars().next() {
        None => String::new(),
        Some('[') => format!(" {}", plain(&cell.note)),
        Some(_) => format!(" ({})", plain(&cell.note)),
    };
    let text = plain(&cell.text);
    let bold = matches!(cell.tone, Tone::Strong | Tone::Good | Tone::Caution);
    in_table(&if bold { format!("**{text}**{note}") } else { format!("{text}{note}") })
}

fn in_table(text: &str) -> String {
    text.replace('|', "\\|")
}

fn spans(text: &Text) -> String {
    let mut markdown = String::new();
    for span in &text.0 {
        markdown.push_str(&match span.style {
            Style::Plain => plain(&span.text),
            Style::Strong => format!("**{}**", plain(&span.text)),
            Style::Code => code(&span.text),
        });
    }
    markdown
}

fn code(text: &str) -> String {
    let text = text.replace(['\n', '\r'], " ");
    if text.contains('`') { format!("`` {text} ``") } else { format!("`{text}`") }
}

/// Text without meaning as markup. An underscore or hyphen within a word needs no escape, and brackets only make a
/// link when a parenthesis follows, so names and intervals stay readable.
fn plain(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    let mut letters = text.chars().peekable();
    let mut before = ' ';
    while let Some(c) = letters.next() {
        let after = letters.peek().copied().unwrap_or(' ');
        let in_word = before.is_alphanumeric() && after.is_alphanumeric();
        match c {
            '\n' | '\r' | '\t' => escaped.push(' '),
            c if c.is_control() => {}
            '_' if in_word => escaped.push('_'),
            '\\' | '`' | '*' | '_' => escaped.extend(['\\', c]),
            '&' if after.is_alphabetic() || after == '#' => escaped.extend(['\\', c]),
            '<' if after != ' ' => escaped.extend(['\\', c]),
            ']' if after == '(' => escaped.extend(['\\', c]),
            c => escaped.push(c),
        }
        before = c;
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::super::document::{cell, text};
    use super::*;

    #[test]
    fn names_cannot_become_markup() {
        assert_eq!(plain("angle_of_repose"), "angle_of_repose");
        assert_eq!(plain("_x_ *y* `z` <b> [a](b)"), "\\_x\\_ \\*y\\* \\`z\\` \\<b> [a\\](b)");
        assert_eq!(plain("25.4 [24.8, 26.0], p < 0.001"), "25.4 [24.8, 26.0], p < 0.001");
        assert_eq!(spans(&text("see ").code("a`b")), "see `` a`b ``");
    }

    #[test]
    fn columns_are_aligned_and_bars_escaped() {
        let rows = [vec![cell("a|b"), cell("1.0")], vec![cell("c"), Cell::missing("too few runs")]];
        let table = Table::new("Values", &["name", "#value"]).with_rows(rows);
        let expected = "**Values**\n\n\
            | name |            value |\n\
            |------|-----------------:|\n\
            | a\\|b |              1.0 |\n\
            | c    | — (too few runs) |";
        assert_eq!(super::table(&table), expected);
    }
}
