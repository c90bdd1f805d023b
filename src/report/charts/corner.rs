//! Corner plot: the distribution of every parameter on the diagonal, that of every pair below it.

use super::Chart;
use super::scale::Scale;
use super::svg::{Canvas, X};

/// Side of one field.
const FIELD: f64 = 118.0;
const GAP: f64 = 8.0;
const LEFT: f64 = 58.0;
const TOP: f64 = 20.0;
/// Room for ticks and names below the last row.
const BOTTOM: f64 = 36.0;
/// Bins of a range.
const BINS: usize = 18;

/// One parameter: its name with unit, the range of its axis, its draws and the value that was calibrated.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Axis {
    /// Name with unit.
    pub name: String,
    /// Lower and upper end.
    pub range: (f64, f64),
    /// One value per draw.
    pub draws: Vec<f64>,
    /// A value to mark.
    pub marked: Option<f64>,
}

/// Draws of several parameters.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Corner {
    /// What it shows.
    pub title: String,
    /// The parameters; all have as many draws.
    pub axes: Vec<Axis>,
}

impl Corner {
    /// Draws the fields.
    pub fn draw(&self) -> Chart {
        let mut canvas = Canvas::default();
        for (row, up) in self.axes.iter().enumerate() {
            for (column, across) in self.axes.iter().enumerate().take(row + 1) {
                let corner = place(row, column);
                canvas.area("band ref", corner, (FIELD, FIELD), 0.06);
                if row == column {
                    histogram(&mut canvas, corner, across)
                } else {
                    pair(&mut canvas, corner, across, up)
                }
                if row + 1 == self.axes.len() {
                    ticks_below(&mut canvas, corner, across);
                }
            }
            canvas.text("axis", (X::Units(place(row, row).0), place(row, 0).1 - 4.0), "start", &up.name);
            if row > 0 {
                ticks_beside(&mut canvas, place(row, 0), up);
            }
        }
        let size = self.axes.len() as f64 * (FIELD + GAP + TOP);
        Chart {
            title: self.title.clone(),
            description: self.description(),
            width: Some((LEFT + self.axes.len() as f64 * (FIELD + GAP) + 40.0) as u32),
            height: (size + BOTTOM) as u32,
            body: canvas.0,
        }
    }

    fn description(&self) -> String {
        let names: Vec<&str> = self.axes.iter().map(|axis| axis.name.as_str()).collect();
        let draws = self.axes.first().map_or(0, |axis| axis.draws.len());
        format!("Distribution of {} given the measurements, from {draws} draws.", names.join(", "))
    }
}

/// Upper left corner of a field.
fn place(row: usize, column: usize) -> (f64, f64) {
    (LEFT + column as f64 * (FIELD + GAP), TOP + row as f64 * (FIELD + GAP + TOP))
}

fn scale(axis: &Axis) -> Scale {
    Scale::exactly(axis.range.0, axis.range.1, 3)
}

fn bin(axis: &Axis, value: f64) -> usize {
    ((scale(axis).position(value) * BINS as f64) as usize).min(BINS - 1)
}

fn histogram(canvas: &mut Canvas, corner: (f64, f64), axis: &Axis) {
    let mut counts = [0_usize; BINS];
    axis.draws.iter().filter(|value| value.is_finite()).for_each(|value| counts[bin(axis, *value)] += 1);
    let most = counts.iter().copied().max().unwrap_or(0).max(1);
    let width = FIELD / BINS as f64;
    for (index, count) in counts.into_iter().enumerate().filter(|(_, count)| *count > 0) {
        let height = FIELD * 0.95 * count as f64 / most as f64;
        let at = (corner.0 + width * index as f64, corner.1 + FIELD - height);
        canvas.area("band s0", at, (width, height), 0.45);
    }
    if let Some(value) = axis.marked.filter(|value| value.is_finite()) {
        let x = X::Units(corner.0 + FIELD * scale(axis).position(value));
        canvas.upright("target", x, corner.1, corner.1 + FIELD);
    }
}

fn pair(canvas: &mut Canvas, corner: (f64, f64), across: &Axis, up: &Axis) {
    let mut counts = [[0_usize; BINS]; BINS];
    for (x, y) in across.draws.iter().zip(&up.draws).filter(|(x, y)| x.is_finite() && y.is_finite()) {
        counts[bin(up, *y)][bin(across, *x)] += 1;
    }
    let most = counts.iter().flatten().copied().max().unwrap_or(0).max(1);
    let width = FIELD / BINS as f64;
    for (row, line) in counts.iter().enumerate() {
        for (column, count) in line.iter().enumerate().filter(|(_, count)| **count > 0) {
            let at = (corner.0 + width * column as f64, corner.1 + FIELD - width * (row + 1) as f64);
            canvas.area("band s0", at, (width, width), 0.15 + 0.75 * *count as f64 / most as f64);
        }
    }
    if let Some((x, y)) = across.marked.zip(up.marked).filter(|(x, y)| x.is_finite() && y.is_finite()) {
        let at = corner.0 + FIELD * scale(across).position(x);
        let down = corner.1 + FIELD * (1.0 - scale(up).position(y));
        canvas.mark(1, (X::Units(at), down), "calibrated");
    }
}

fn ticks_below(canvas: &mut Canvas, corner: (f64, f64), axis: &Axis) {
    for (value, label) in scale(axis).ticks() {
        let x = X::Units(corner.0 + FIELD * scale(axis).position(value));
        canvas.text("tick", (x, corner.1 + FIELD + 15.0), "middle", &label);
    }
}

fn ticks_beside(canvas: &mut Canvas, corner: (f64, f64), axis: &Axis) {
    for (value, label) in scale(axis).ticks() {
        let y = corner.1 + FIELD * (1.0 - scale(axis).position(value)) + 4.0;
        canvas.text("tick", (X::Units(corner.0 - 5.0), y), "end", &label);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_parameter_has_a_histogram_and_every_pair_a_field() {
        let axis =
            |name: &str, draws: Vec<f64>| Axis { name: name.into(), range: (0.0, 1.0), draws, marked: Some(0.5) };
        let axes = vec![axis("a", vec![0.1, 0.2, f64::NAN]), axis("b", vec![0.9, 1.0, 0.0]), axis("c", vec![0.5; 3])];
        let chart = Corner { title: String::new(), axes }.draw();
        assert_eq!(chart.body.matches("band ref").count(), 6);
        assert_eq!(chart.body.matches("class=\"target\"").count(), 3);
        assert_eq!(chart.body.matches("<title>calibrated").count(), 3);
        assert!(!chart.body.contains("NaN"));
    }

    #[test]
    fn nothing_draws_as_nothing() {
        assert!(Corner::default().draw().body.is_empty());
    }
}
