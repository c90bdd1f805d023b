//! Charts as inline SVG, from small pure functions of numbers and labels.
//!
//! Takes plain values and gives the inner markup of one drawing; titles, descriptions and legends are set by the HTML
//! renderer, colours by its style sheet. Charts hold no script and repeat only what a table beside them says: a
//! reader without them, or of the Markdown, misses no number. Values that are not finite are left out of a drawing.

mod corner;
mod heat;
mod lines;
mod rows;
mod scale;
mod scatter;
mod svg;

pub use corner::{Axis, Corner};
pub use heat::HeatMap;
pub use lines::{Line, LineChart, Node};
pub use rows::{Mark, Row, RowChart};
pub use scatter::{Pair, Scatter};
pub use svg::{PAPER, escape_lines, shape, typeset};

/// A finished drawing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Chart {
    /// What it shows, in a few words.
    pub title: String,
    /// The same for readers who cannot see it.
    pub description: String,
    /// Width of the drawing; none when it fills whatever width there is.
    pub width: Option<u32>,
    /// Height of the drawing.
    pub height: u32,
    /// SVG elements.
    pub body: String,
}
