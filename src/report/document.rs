//! The report as a list of sections and blocks, written once and rendered twice (HTML and Markdown).
//!
//! Sections build blocks from tables; renderers know nothing of granular matter. Text is made of spans, so a name
//! from a user's file can never be taken for markup.

use super::charts::Chart;

/// Meaning that a colour carries; it is always said in words as well.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Tone {
    /// No colour.
    #[default]
    Plain,
    /// Stands out: what the reader looks for.
    Strong,
    /// In order.
    Good,
    /// To be read with care.
    Caution,
    /// Steps back.
    Muted,
}

/// How a span is set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Style {
    /// Running text.
    Plain,
    /// Emphasised.
    Strong,
    /// A name to type: stage, table, command.
    Code,
}

/// A piece of text in one style.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Span {
    /// How it is set.
    pub style: Style,
    /// What it says, without markup.
    pub text: String,
}

/// Running text.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Text(pub Vec<Span>);

impl Text {
    /// Appends running text.
    pub fn plain(self, text: impl Into<String>) -> Self {
        self.push(Style::Plain, text.into())
    }

    /// Appends emphasised text.
    pub fn strong(self, text: impl Into<String>) -> Self {
        self.push(Style::Strong, text.into())
    }

    /// Appends a name to type.
    pub fn code(self, text: impl Into<String>) -> Self {
        self.push(Style::Code, text.into())
    }

    fn push(mut self, style: Style, text: String) -> Self {
        self.0.push(Span { style, text });
        self
    }
}

/// Starts a text.
pub fn text(start: impl Into<String>) -> Text {
    Text::default().plain(start)
}

/// One value of a table.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Cell {
    /// What it says.
    pub text: String,
    /// Small print beside it: why a value is missing, that it lies on a bound.
    pub note: String,
    /// Its colour.
    pub tone: Tone,
}

impl Cell {
    /// A missing value and the reason why.
    pub fn missing(reason: impl Into<String>) -> Self {
        Self { text: super::numbers::MISSING.to_string(), note: reason.into(), tone: Tone::Muted }
    }

    /// The same cell with small print.
    pub fn with_note(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// The same cell in a colour.
    pub fn with_tone(mut self, tone: Tone) -> Self {
        self.tone = tone;
        self
    }
}

/// A cell without small print.
pub fn cell(text: impl Into<String>) -> Cell {
    Cell { text: text.into(), ..Cell::default() }
}

/// The cell of a value that may be missing.
pub fn optional(value: Option<f64>, show: impl Fn(f64) -> String, reason: &str) -> Cell {
    match value.filter(|value| value.is_finite()) {
        Some(value) => cell(show(value)),
        None => Cell::missing(reason),
    }
}

/// A column: its heading and whether it holds numbers (set flush right).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Heading.
    pub title: String,
    /// Holds numbers.
    pub numeric: bool,
}

/// A table with a caption; the first cell of each row is its heading.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    /// What the table shows.
    pub caption: String,
    /// Columns from left to right.
    pub columns: Vec<Column>,
    /// Rows, each as long as `columns`.
    pub rows: Vec<Vec<Cell>>,
}

impl Table {
    /// An empty table; a heading that starts with `#` is that of a column of numbers.
    pub fn new(caption: impl Into<String>, headings: &[&str]) -> Self {
        let column = |heading: &&str| match heading.strip_prefix('#') {
            Some(title) => Column { title: title.to_string(), numeric: true },
            None => Column { title: heading.to_string(), numeric: false },
        };
        Self { caption: caption.into(), columns: headings.iter().map(column).collect(), rows: Vec::new() }
    }

    /// The same table with these rows.
    pub fn with_rows(mut self, rows: impl IntoIterator<Item = Vec<Cell>>) -> Self {
        self.rows.extend(rows);
        self
    }
}

/// A chart with its caption and what its marks mean.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// The drawing.
    pub chart: Chart,
    /// One line below the drawing; empty for none.
    pub caption: String,
}

/// Series (index of colour and shape) and what it stands for.
pub type Legend = Vec<(usize, String)>;

/// A building block of a section.
#[derive(Debug, Clone, PartialEq)]
pub enum Block {
    /// A heading below the section's own.
    Heading(String),
    /// Running text.
    Paragraph(Text),
    /// Boxed text.
    Note {
        /// Its colour.
        tone: Tone,
        /// Its first words.
        title: String,
        /// What it says.
        text: Text,
    },
    /// Boxed blocks under one sentence that must not be missed.
    Card {
        /// Its colour.
        tone: Tone,
        /// Small line above the sentence.
        eyebrow: String,
        /// The sentence.
        headline: String,
        /// What belongs to it.
        blocks: Vec<Block>,
    },
    /// Terms and what is said of each.
    Facts(Vec<(String, Text)>),
    /// A table.
    Table(Table),
    /// Charts side by side that share a legend.
    Figures {
        /// Marks and their meaning.
        legend: Legend,
        /// The charts.
        figures: Vec<Figure>,
    },
    /// Text to copy.
    Code(String),
    /// Blocks that open on demand.
    Details {
        /// What is inside.
        summary: String,
        /// The blocks.
        blocks: Vec<Block>,
    },
}

/// A numbered section.
#[derive(Debug, Clone, PartialEq)]
pub struct Section {
    /// Anchor within the page.
    pub id: &'static str,
    /// Heading.
    pub title: String,
    /// Content.
    pub blocks: Vec<Block>,
}

/// The whole report.
#[derive(Debug, Clone, PartialEq)]
pub struct Document {
    /// Title of the page.
    pub title: String,
    /// Line under the title.
    pub subtitle: String,
    /// Sections in order.
    pub sections: Vec<Section>,
}
