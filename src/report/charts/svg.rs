//! SVG elements as text. Positions are either numbers of the drawing's own units or percentages of its width, so that
//! a chart can follow the page without scaling its letters.

use std::fmt::Write;

/// Series that stands for the paper's printed values: hollow, in the colour of the text.
pub const PAPER: usize = 4;

/// Outlines of the series' marks: colour is never the only difference.
const SHAPES: [&str; 5] = [
    "M-5 0a5 5 0 1 0 10 0a5 5 0 1 0-10 0z",
    "M0-6.5 6.5 0 0 6.5-6.5 0z",
    "M-4.5-4.5h9v9h-9z",
    "M0-6 6 5H-6z",
    "M-5-5h10v10h-10z",
];

/// Outline of a series' mark around the origin.
pub fn shape(series: usize) -> &'static str {
    SHAPES[series % SHAPES.len()]
}

/// Replaces what XML reads as markup, drops what it does not allow, puts everything on one line.
pub fn escape(text: &str) -> String {
    escape_lines(&text.replace(['\n', '\t'], " "))
}

/// `escape` that keeps the lines.
pub fn escape_lines(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            c if c.is_control() && c != '\n' => {}
            c => escaped.push(c),
        }
    }
    escaped
}

/// `escape`, and a minus sign instead of a hyphen before a number.
pub fn typeset(text: &str) -> String {
    let mut set = String::with_capacity(text.len());
    let mut before = ' ';
    let mut letters = text.chars().peekable();
    while let Some(c) = letters.next() {
        let number = letters.peek().is_some_and(char::is_ascii_digit);
        let minus = c == '-' && number && !before.is_alphanumeric() && !matches!(before, '-' | ')' | ']');
        set.push(if minus { '−' } else { c });
        before = c;
    }
    escape(&set)
}

/// Where something stands: units of the drawing or per cent of its width.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum X {
    /// Units of the drawing.
    Units(f64),
    /// Per cent of the width.
    Percent(f64),
}

impl X {
    fn text(self) -> String {
        match self {
            Self::Units(value) => format!("{value:.1}"),
            Self::Percent(value) => format!("{value:.2}%"),
        }
    }
}

/// Elements of one drawing, in painting order.
#[derive(Debug, Default)]
pub struct Canvas(pub String);

impl Canvas {
    /// A straight line.
    pub fn line(&mut self, class: &str, from: (X, f64), to: (X, f64)) {
        let (x1, x2) = (from.0.text(), to.0.text());
        self.push(format_args!(r#"<line class="{class}" x1="{x1}" y1="{:.1}" x2="{x2}" y2="{:.1}"/>"#, from.1, to.1));
    }

    /// An upright line.
    pub fn upright(&mut self, class: &str, x: X, top: f64, bottom: f64) {
        self.line(class, (x, top), (x, bottom));
    }

    /// A text; `anchor` is start, middle or end.
    pub fn text(&mut self, class: &str, at: (X, f64), anchor: &str, text: &str) {
        let (x, text) = (at.0.text(), typeset(text));
        self.push(format_args!(
            r#"<text class="{class}" x="{x}" y="{:.1}" text-anchor="{anchor}">{text}</text>"#,
            at.1
        ));
    }

    /// The mark of a series, with a text that shows on pointing at it.
    pub fn mark(&mut self, series: usize, at: (X, f64), hint: &str) {
        let (x, path, hint) = (at.0.text(), shape(series), typeset(hint));
        self.push(format_args!(
            r#"<svg x="{x}" y="{:.1}" overflow="visible"><path class="mark s{series}" d="{path}"><title>{hint}</title></path></svg>"#,
            at.1
        ));
    }

    /// A filled rectangle in units of the drawing.
    pub fn area(&mut self, class: &str, corner: (f64, f64), size: (f64, f64), opacity: f64) {
        let ((x, y), (width, height)) = (corner, size);
        self.push(format_args!(
            r#"<rect class="{class}" x="{x:.1}" y="{y:.1}" width="{width:.1}" height="{height:.1}" fill-opacity="{opacity:.2}"/>"#
        ));
    }

    /// A closed polygon or an open line through points.
    pub fn path(&mut self, class: &str, points: &[(f64, f64)], closed: bool) {
        let element = if closed { "polygon" } else { "polyline" };
        let points: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
        self.push(format_args!(r#"<{element} class="{class}" points="{}"/>"#, points.join(" ")));
    }

    fn push(&mut self, element: std::fmt::Arguments) {
        // Writing to a String cannot fail.
        let _ = self.0.write_fmt(element);
        self.0.push('\n');
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_in_names_is_harmless() {
        assert_eq!(escape("<script a='1'>&\u{0}"), "&lt;script a=&#39;1&#39;&gt;&amp;");
    }

    #[test]
    fn only_a_hyphen_before_a_number_is_a_minus() {
        assert_eq!(typeset("-5.0 [-7, 3] RBM-MV n-1 2-3 -x"), "−5.0 [−7, 3] RBM-MV n-1 2-3 -x");
    }
}
