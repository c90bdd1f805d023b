//! The document as one HTML file: style sheet and drawings inside, no script, nothing fetched.

use std::fmt::Write;

use super::charts::{Chart, shape, typeset};
use super::document::{Block, Cell, Column, Document, Figure, Legend, Section, Style, Table, Text, Tone};

const STYLE: &str = include_str!("style.css");

/// Renders the document.
pub fn render(document: &Document) -> String {
    let mut page = Page::default();
    page.head(document);
    for (index, section) in document.sections.iter().enumerate() {
        page.section(index + 1, section);
    }
    page.line("</main>\n</body>\n</html>");
    page.html
}

#[derive(Default)]
struct Page {
    html: String,
    /// Drawings so far: their titles need names that are unique within the page.
    charts: usize,
}

impl Page {
    fn line(&mut self, line: &str) {
        self.html.push_str(line);
        self.html.push('\n');
    }

    fn head(&mut self, document: &Document) {
        let title = typeset(&document.title);
        self.line("<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>");
        self.line("<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>");
        self.line(&format!("<title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<header>"));
        self.line(&format!("<h1>{title}</h1>\n<p class=\"subtitle\">{}</p>", typeset(&document.subtitle)));
        self.line("<nav aria-label=\"Contents\"><ol>");
        for (index, section) in document.sections.iter().enumerate() {
            let (id, number, title) = (section.id, index + 1, typeset(&section.title));
            self.line(&format!("<li><a href=\"#{id}\">{number} {title}</a></li>"));
        }
        self.line("</ol></nav>\n</header>\n<main>");
    }

    fn section(&mut self, number: usize, section: &Section) {
        let (id, title) = (section.id, typeset(&section.title));
        self.line(&format!("<section id=\"{id}\" aria-labelledby=\"{id}-title\">"));
        self.line(&format!("<h2 id=\"{id}-title\"><span class=\"number\">{number}</span> {title}</h2>"));
        self.blocks(&section.blocks);
        self.line("</section>");
    }

    fn blocks(&mut self, blocks: &[Block]) {
        for block in blocks {
            self.block(block);
        }
    }

    fn block(&mut self, block: &Block) {
        match block {
            Block::Heading(title) => self.line(&format!("<h3>{}</h3>", typeset(title))),
            Block::Paragraph(text) => self.line(&format!("<p>{}</p>", spans(text))),
            Block::Note { tone, title, text } => self.note(*tone, title, text),
            Block::Card { tone, eyebrow, headline, blocks } => self.card(*tone, eyebrow, headline, blocks),
            Block::Facts(facts) => self.facts(facts),
            Block::Table(table) => self.table(table),
            Block::Figures { legend, figures } => self.figures(legend, figures),
            Block::Code(code) => self.line(&format!("<pre><code>{}</code></pre>", super::charts::escape_lines(code))),
            Block::Details { summary, blocks } => self.details(summary, blocks),
        }
    }

    fn note(&mut self, tone: Tone, title: &str, text: &Text) {
        let (class, title) = (class(tone), typeset(title));
        self.line(&format!("<div class=\"note {class}\"><p><strong>{title}</strong> {}</p></div>", spans(text)));
    }

    fn card(&mut self, tone: Tone, eyebrow: &str, headline: &str, blocks: &[Block]) {
        self.line(&format!("<article class=\"card {}\">", class(tone)));
        self.line(&format!("<p class=\"eyebrow\">{}</p>", typeset(eyebrow)));
        self.line(&format!("<h3 class=\"headline\">{}</h3>", typeset(headline)));
        self.blocks(blocks);
        self.line("</article>");
    }

    fn facts(&mut self, facts: &[(String, Text)]) {
        self.line("<dl>");
        for (term, text) in facts {
            self.line(&format!("<dt>{}</dt><dd>{}</dd>", typeset(term), spans(text)));
        }
        self.line("</dl>");
    }

    fn details(&mut self, summary: &str, blocks: &[Block]) {
        self.line(&format!("<details>\n<summary>{}</summary>", typeset(summary)));
        self.blocks(blocks);
        self.line("</details>");
    }

    fn table(&mut self, table: &Table) {
        let caption = typeset(&table.caption);
        self.line(&format!("<div class=\"scroll\" role=\"region\" tabindex=\"0\" aria-label=\"{caption}\">\n<table>"));
        self.line(&format!("<caption><span>{caption}</span></caption>\n<thead><tr>"));
        for column in &table.columns {
            let class = if column.numeric { " class=\"num\"" } else { "" };
            self.line(&format!("<th scope=\"col\"{class}>{}</th>", typeset(&column.title)));
        }
        self.line("</tr></thead>\n<tbody>");
        let groups = table.rows.windows(2).any(|pair| named_alike(&pair[0], &pair[1]));
        let mut before: &[Cell] = &[];
        for row in &table.rows {
            let class = if named_alike(before, row) { "again" } else { "new" };
            self.row(if groups { class } else { "" }, &table.columns, row);
            before = row;
        }
        self.line("</tbody>\n</table>\n</div>");
    }

    fn row(&mut self, class: &str, columns: &[Column], row: &[Cell]) {
        self.html.push_str(&if class.is_empty() { "<tr>".to_string() } else { format!("<tr class=\"{class}\">") });
        for (index, (column, cell)) in columns.iter().zip(row).enumerate() {
            let text = content(cell);
            let numeric = if column.numeric { "num" } else { short(&cell.text) };
            let class = format!("{numeric} {}", self::class(cell.tone));
            let class = if class.trim().is_empty() { String::new() } else { format!(" class=\"{}\"", class.trim()) };
            // Writing to a String cannot fail.
            let _ = match index {
                0 => write!(self.html, "<th scope=\"row\"{class}>{text}</th>"),
                _ => write!(self.html, "<td{class}>{text}</td>"),
            };
        }
        self.line("</tr>");
    }

    fn figures(&mut self, legend: &Legend, figures: &[Figure]) {
        self.line("<div class=\"figures\">");
        if !legend.is_empty() {
            self.legend(legend);
        }
        self.line("<div class=\"panels\">");
        for figure in figures {
            self.figure(figure);
        }
        self.line("</div>\n</div>");
    }

    fn legend(&mut self, legend: &Legend) {
        self.line("<ul class=\"legend\">");
        for (series, meaning) in legend {
            let path = format!("<path class=\"mark s{series}\" d=\"{}\"/>", shape(*series));
            let icon =
                format!("<svg width=\"14\" height=\"14\" viewBox=\"-7 -7 14 14\" aria-hidden=\"true\">{path}</svg>");
            self.line(&format!("<li>{icon}{}</li>", typeset(meaning)));
        }
        self.line("</ul>");
    }

    fn figure(&mut self, figure: &Figure) {
        self.line(&format!("<figure>\n<p class=\"name\">{}</p>\n<div class=\"draw\">", typeset(&figure.chart.title)));
        self.chart(&figure.chart);
        self.line("</div>");
        if !figure.caption.is_empty() {
            self.line(&format!("<figcaption>{}</figcaption>", typeset(&figure.caption)));
        }
        self.line("</figure>");
    }

    fn chart(&mut self, chart: &Chart) {
        self.charts += 1;
        let (number, height) = (self.charts, chart.height);
        let size = match chart.width {
            Some(width) => format!("viewBox=\"0 0 {width} {height}\" style=\"width:100%;max-width:{width}px\""),
            None => format!("width=\"100%\" height=\"{height}\""),
        };
        self.line(&format!("<svg {size} role=\"img\" aria-labelledby=\"chart-{number} chart-{number}-text\">"));
        self.line(&format!("<title id=\"chart-{number}\">{}</title>", typeset(&chart.title)));
        self.line(&format!("<desc id=\"chart-{number}-text\">{}</desc>", typeset(&chart.description)));
        self.html.push_str(&chart.body);
        self.line("</svg>");
    }
}

/// Names are kept on one line, sentences are not.
fn short(text: &str) -> &'static str {
    if text.chars().count() <= 20 { "short" } else { "" }
}

/// Do two rows carry the same heading, so that the second one continues the first?
fn named_alike(one: &[Cell], two: &[Cell]) -> bool {
    one.first().zip(two.first()).is_some_and(|(one, two)| one.text == two.text)
}

fn class(tone: Tone) -> &'static str {
    match tone {
        Tone::Plain => "",
        Tone::Strong => "strong",
        Tone::Good => "good",
        Tone::Caution => "caution",
        Tone::Muted => "muted",
    }
}

fn content(cell: &Cell) -> String {
    let text = typeset(&cell.text);
    if cell.note.is_empty() { text } else { format!("{text} <small>{}</small>", typeset(&cell.note)) }
}

fn spans(text: &Text) -> String {
    let mut html = String::new();
    for span in &text.0 {
        html.push_str(&match span.style {
            Style::Plain => typeset(&span.text),
            Style::Strong => format!("<strong>{}</strong>", typeset(&span.text)),
            Style::Code => format!("<code>{}</code>", super::charts::escape_lines(&span.text)),
        });
    }
    html
}
