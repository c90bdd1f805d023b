//! Lines over the number of repetitions, with interval bands and a reference that carries a ±1 % band.

use super::Chart;
use super::scale::Scale;
use super::svg::{Canvas, X};

const WIDTH: f64 = 340.0;
const HEIGHT: f64 = 220.0;
const LEFT: f64 = 52.0;
const RIGHT: f64 = 322.0;
/// Keeps the marks of the first value off the labels of the upright axis.
const INSET: f64 = 10.0;
const TOP: f64 = 26.0;
const BOTTOM: f64 = 178.0;

/// More marks on a line would run into each other.
const MARKS: usize = 13;

/// A value at a number of repetitions.
#[derive(Debug, Clone, PartialEq)]
pub struct Node {
    /// Number of repetitions.
    pub n: u32,
    /// The value.
    pub value: f64,
    /// Interval around it.
    pub interval: Option<(f64, f64)>,
    /// The value in words.
    pub hint: String,
}

/// The values of one series.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Colour and shape.
    pub series: usize,
    /// Values by increasing n.
    pub nodes: Vec<Node>,
}

/// Lines over the number of repetitions.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LineChart {
    /// What it shows.
    pub title: String,
    /// What the upright axis shows, with its unit.
    pub axis: String,
    /// The series.
    pub lines: Vec<Line>,
    /// Value with a ±1 % band around it.
    pub reference: Option<f64>,
}

impl LineChart {
    /// Draws the lines.
    pub fn draw(&self) -> Chart {
        let (x, y) = (self.x_scale(), self.y_scale());
        let frame = Frame { x, y };
        let mut canvas = Canvas::default();
        self.draw_reference(&mut canvas, &frame);
        frame.draw(&mut canvas, "repetitions n", &self.axis);
        for line in &self.lines {
            draw_band(&mut canvas, &frame, line);
        }
        for line in &self.lines {
            draw_line(&mut canvas, &frame, line);
        }
        Chart {
            title: self.title.clone(),
            description: self.description(),
            width: Some(WIDTH as u32),
            height: HEIGHT as u32,
            body: canvas.0,
        }
    }

    fn nodes(&self) -> impl Iterator<Item = &Node> {
        self.lines.iter().flat_map(|line| &line.nodes).filter(|node| node.value.is_finite())
    }

    fn x_scale(&self) -> Scale {
        let low = self.nodes().map(|node| node.n).min().unwrap_or(1);
        let high = self.nodes().map(|node| node.n).max().unwrap_or(1);
        Scale::counting(low, high, 6)
    }

    /// Holds every value and the ±1 % band; the interval of two repetitions is cut rather than squash the rest.
    fn y_scale(&self) -> Scale {
        let band = self.reference.into_iter().flat_map(|value| [value * 0.99, value * 1.01]);
        let values: Vec<f64> = self.nodes().map(|node| node.value).chain(band).collect();
        let core = Scale::around(values.iter().copied(), 4);
        let room = core.high - core.low;
        let ends = self.nodes().filter_map(|node| node.interval).flat_map(|(low, high)| [low, high]);
        let inside: Vec<f64> = ends.map(|end| end.clamp(core.low - room, core.high + room)).collect();
        Scale::around(values.into_iter().chain(inside), 5)
    }

    fn draw_reference(&self, canvas: &mut Canvas, frame: &Frame) {
        let Some(value) = self.reference.filter(|value| value.is_finite()) else { return };
        let (top, bottom) = (frame.down(value * 1.01), frame.down(value * 0.99));
        canvas.area("band ref", (LEFT, top.min(bottom)), (RIGHT - LEFT, (bottom - top).abs()), 0.15);
        let y = frame.down(value);
        canvas.line("guide", (X::Units(LEFT), y), (X::Units(RIGHT), y));
    }

    fn description(&self) -> String {
        let node = |node: &Node| format!("n = {}: {}", node.n, node.hint);
        let said: Vec<String> = self.nodes().map(node).collect();
        format!("{} over the number of repetitions. {}.", self.axis, said.join("; "))
    }
}

/// A pair of axes around the drawing's inner field.
pub(super) struct Frame {
    pub x: Scale,
    pub y: Scale,
}

impl Frame {
    pub fn across(&self, value: f64) -> f64 {
        LEFT + INSET + (RIGHT - LEFT - INSET) * self.x.position(value)
    }

    pub fn down(&self, value: f64) -> f64 {
        BOTTOM - (BOTTOM - TOP) * self.y.position(value)
    }

    /// Grid, ticks and the names of both axes.
    pub fn draw(&self, canvas: &mut Canvas, across: &str, up: &str) {
        for (value, label) in self.y.ticks() {
            let y = self.down(value);
            canvas.line("grid", (X::Units(LEFT), y), (X::Units(RIGHT), y));
            canvas.text("tick", (X::Units(LEFT - 6.0), y + 4.0), "end", &label);
        }
        for (value, label) in self.x.ticks() {
            let x = X::Units(self.across(value));
            canvas.upright("grid", x, BOTTOM, BOTTOM + 4.0);
            canvas.text("tick", (x, BOTTOM + 17.0), "middle", &label);
        }
        canvas.text("axis", (X::Units(4.0), 12.0), "start", up);
        canvas.text("axis", (X::Units(RIGHT), HEIGHT - 6.0), "end", across);
    }
}

fn draw_band(canvas: &mut Canvas, frame: &Frame, line: &Line) {
    let with: Vec<(f64, f64, f64)> = line
        .nodes
        .iter()
        .filter_map(|node| node.interval.map(|(low, high)| (f64::from(node.n), low, high)))
        .filter(|(_, low, high)| low.is_finite() && high.is_finite())
        .collect();
    if with.len() < 2 {
        return draw_single_interval(canvas, frame, line.series, &with);
    }
    let upper = with.iter().map(|(n, _, high)| (frame.across(*n), frame.down(*high)));
    let lower = with.iter().rev().map(|(n, low, _)| (frame.across(*n), frame.down(*low)));
    canvas.path(&format!("band s{}", line.series), &upper.chain(lower).collect::<Vec<_>>(), true);
}

fn draw_single_interval(canvas: &mut Canvas, frame: &Frame, series: usize, with: &[(f64, f64, f64)]) {
    for &(n, low, high) in with {
        let x = X::Units(frame.across(n));
        canvas.upright(&format!("interval s{series}"), x, frame.down(high), frame.down(low));
    }
}

fn draw_line(canvas: &mut Canvas, frame: &Frame, line: &Line) {
    let finite: Vec<&Node> = line.nodes.iter().filter(|node| node.value.is_finite()).collect();
    let place = |node: &&Node| (frame.across(f64::from(node.n)), frame.down(node.value));
    let points: Vec<(f64, f64)> = finite.iter().map(place).collect();
    canvas.path(&format!("line s{}", line.series), &points, false);
    for (node, (x, y)) in finite.iter().zip(points).step_by(finite.len().div_ceil(MARKS).max(1)) {
        canvas.mark(line.series, (X::Units(x), y), &format!("n = {}: {}", node.n, node.hint));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(n: u32, value: f64, half: f64) -> Node {
        Node { n, value, interval: Some((value - half, value + half)), hint: format!("{value}") }
    }

    #[test]
    fn the_interval_of_two_repetitions_does_not_squash_the_rest() {
        let nodes = vec![node(2, 25.0, 60.0), node(3, 25.4, 2.0), node(4, 25.3, 1.0)];
        let chart = LineChart { lines: vec![Line { series: 0, nodes }], ..LineChart::default() };
        let scale = chart.y_scale();
        assert!(scale.high - scale.low < 4.0, "{scale:?}");
    }

    #[test]
    fn a_lone_point_and_no_point_still_draw() {
        let one = LineChart { lines: vec![Line { series: 1, nodes: vec![node(3, 1.0, 0.1)] }], ..LineChart::default() };
        assert!(one.draw().body.contains("class=\"mark s1\""));
        assert!(!LineChart::default().draw().body.contains("NaN"));
    }
}
