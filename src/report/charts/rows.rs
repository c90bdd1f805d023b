//! One row per name, marks along a common axis: dot plot, interval plot and dumbbell are the same drawing.
//!
//! ```text
//! angle of repose                          note
//! ---------------o=====●------|------------------
//! ```
//! Positions are per cent of the width, so that letters keep their size on narrow screens.

use super::Chart;
use super::scale::Scale;
use super::svg::{Canvas, X};

const ROW: f64 = 40.0;
const GROUP: f64 = 28.0;
const TOP: f64 = 8.0;
const FOOT: f64 = 40.0;
const LEFT: f64 = 3.0;
const WIDTH: f64 = 94.0;

/// A value on a row, with an interval where there is one.
#[derive(Debug, Clone, PartialEq)]
pub struct Mark {
    /// Colour and shape.
    pub series: usize,
    /// Where it stands.
    pub value: f64,
    /// Interval around it.
    pub interval: Option<(f64, f64)>,
    /// The value in words.
    pub hint: String,
}

/// A named row.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Row {
    /// Rows with the same group stand together under its name.
    pub group: String,
    /// Name of the row.
    pub label: String,
    /// Text at the right end: why there is no mark.
    pub note: String,
    /// Its values.
    pub marks: Vec<Mark>,
}

/// Rows along a common axis.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RowChart {
    /// What it shows.
    pub title: String,
    /// What the axis shows, with its unit.
    pub axis: String,
    /// Rows from top to bottom.
    pub rows: Vec<Row>,
    /// Upright lines at these values.
    pub guides: Vec<f64>,
    /// Limits of the axis, which marks beyond them widen; found from the marks when there are none.
    pub range: Option<(f64, f64)>,
    /// Join the marks of a row by a bar.
    pub joined: bool,
}

impl RowChart {
    /// Draws the rows.
    pub fn draw(&self) -> Chart {
        let scale = self.scale();
        let mut canvas = Canvas::default();
        let (places, height) = self.places();
        self.draw_axis(&mut canvas, &scale, height);
        for (row, place) in self.rows.iter().zip(&places) {
            self.draw_row(&mut canvas, &scale, row, *place);
        }
        Chart {
            title: self.title.clone(),
            description: self.description(),
            width: None,
            height: (height + FOOT) as u32,
            body: canvas.0,
        }
    }

    /// Marks always lie on the axis; an interval that would squash them is cut.
    fn scale(&self) -> Scale {
        let marks = || self.rows.iter().flat_map(|row| &row.marks).filter(|mark| mark.value.is_finite());
        if let Some((low, high)) = self.range.filter(|(low, high)| low < high) {
            let values = marks().map(|mark| mark.value);
            let (low, high) = values.fold((low, high), |(low, high), value| (low.min(value), high.max(value)));
            return Scale::exactly(low, high, 5);
        }
        let values: Vec<f64> = marks().map(|mark| mark.value).chain(self.guides.iter().copied()).collect();
        let core = Scale::around(values.iter().copied(), 5);
        let room = (core.high - core.low) * 0.75;
        let ends = marks().filter_map(|mark| mark.interval).flat_map(|(low, high)| [low, high]);
        let inside = ends.filter(|end| end.is_finite()).map(|end| end.clamp(core.low - room, core.high + room));
        Scale::around(values.into_iter().chain(inside.collect::<Vec<_>>()), 6)
    }

    /// Where each row's line stands and where the last one ends; a new group takes room for its name.
    fn places(&self) -> (Vec<Place>, f64) {
        let mut top = TOP;
        let mut group = "";
        let mut places = Vec::with_capacity(self.rows.len());
        for row in &self.rows {
            let heading = (row.group != group).then_some(top + 18.0);
            top += if heading.is_some() { GROUP } else { 0.0 };
            group = &row.group;
            places.push(Place { heading, top });
            top += ROW;
        }
        (places, top)
    }

    fn draw_axis(&self, canvas: &mut Canvas, scale: &Scale, height: f64) {
        for (value, label) in scale.ticks() {
            canvas.upright("grid", at(scale, value), TOP, height);
            canvas.text("tick", (at(scale, value), height + 15.0), "middle", &label);
        }
        for &guide in self.guides.iter().filter(|guide| scale.holds(**guide)) {
            canvas.upright("guide", at(scale, guide), TOP, height);
        }
        canvas.text("axis", (X::Percent(50.0), height + 33.0), "middle", &self.axis);
    }

    fn draw_row(&self, canvas: &mut Canvas, scale: &Scale, row: &Row, place: Place) {
        if let Some(y) = place.heading {
            canvas.text("group", (X::Percent(0.0), y), "start", &row.group);
        }
        canvas.text("label", (X::Percent(0.0), place.top + 14.0), "start", &row.label);
        canvas.text("note", (X::Percent(100.0), place.top + 14.0), "end", &row.note);
        let y = place.top + 27.0;
        let marks: Vec<&Mark> = row.marks.iter().filter(|mark| mark.value.is_finite()).collect();
        self.draw_bar(canvas, scale, &marks, y);
        let intervals = marks.iter().filter(|mark| mark.interval.is_some()).count();
        for (index, mark) in marks.iter().enumerate() {
            // Two intervals on one line would hide each other.
            let offset = if intervals > 1 { index as f64 * 4.0 - 2.0 } else { 0.0 };
            draw_interval(canvas, scale, mark, y + offset);
        }
        for mark in &marks {
            canvas.mark(mark.series, (at(scale, mark.value), y), &format!("{}: {}", row.label, mark.hint));
        }
    }

    fn draw_bar(&self, canvas: &mut Canvas, scale: &Scale, marks: &[&Mark], y: f64) {
        if let (true, [first, .., last]) = (self.joined, marks) {
            canvas.line("bar", (at(scale, first.value), y), (at(scale, last.value), y));
        }
    }

    fn description(&self) -> String {
        let row = |row: &Row| {
            let hints: Vec<&str> = row.marks.iter().map(|mark| mark.hint.as_str()).collect();
            let said = if hints.is_empty() { row.note.clone() } else { hints.join("; ") };
            format!("{}: {said}.", row.label)
        };
        let rows: Vec<String> = self.rows.iter().map(row).collect();
        format!("{}. {}", self.axis, rows.join(" "))
    }
}

#[derive(Debug, Clone, Copy)]
struct Place {
    heading: Option<f64>,
    top: f64,
}

fn at(scale: &Scale, value: f64) -> X {
    X::Percent(LEFT + WIDTH * scale.position(value))
}

/// The interval's line; an end beyond the axis has no cap, so that it reads as cut.
fn draw_interval(canvas: &mut Canvas, scale: &Scale, mark: &Mark, y: f64) {
    let Some((low, high)) = mark.interval.filter(|(low, high)| low.is_finite() && high.is_finite()) else {
        return;
    };
    let class = format!("interval s{}", mark.series);
    canvas.line(&class, (at(scale, low), y), (at(scale, high), y));
    for end in [low, high].into_iter().filter(|end| scale.holds(*end)) {
        canvas.upright(&class, at(scale, end), y - 4.0, y + 4.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mark(value: f64, interval: Option<(f64, f64)>) -> Mark {
        Mark { series: 0, value, interval, hint: format!("z {value}") }
    }

    #[test]
    fn a_huge_interval_is_cut_not_followed() {
        let row = |label: &str, value, end: f64| Row {
            label: label.into(),
            marks: vec![mark(value, Some((-end, end)))],
            ..Row::default()
        };
        let chart = RowChart { rows: vec![row("a", 1.0, 2.0), row("b", 3.0, 1e6)], ..RowChart::default() };
        assert!(chart.scale().high <= 10.0, "{:?}", chart.scale());
    }

    #[test]
    fn what_is_not_finite_is_left_out() {
        let row = Row { label: "a".into(), marks: vec![mark(f64::NAN, None), mark(1.0, None)], ..Row::default() };
        let chart = RowChart { rows: vec![row], ..RowChart::default() }.draw();
        assert_eq!(chart.body.matches("class=\"mark").count(), 1);
        assert!(!chart.body.contains("NaN"));
    }

    #[test]
    fn a_group_is_named_once() {
        let row = |group: &str| Row { group: group.into(), label: "x".into(), ..Row::default() };
        let chart = RowChart { rows: vec![row("fitted"), row("fitted"), row("held out")], ..RowChart::default() };
        assert_eq!(chart.draw().body.matches("class=\"group\"").count(), 2);
    }
}
