//! What a metamodel predicts against what the simulation then gave, around the line of equality.

use super::Chart;
use super::lines::Frame;
use super::scale::Scale;
use super::svg::{Canvas, X};

/// A prediction and the simulated mean with its interval.
#[derive(Debug, Clone, PartialEq)]
pub struct Pair {
    /// Colour and shape.
    pub series: usize,
    /// Predicted value.
    pub predicted: f64,
    /// Simulated value.
    pub simulated: f64,
    /// Interval around the simulated value.
    pub interval: Option<(f64, f64)>,
    /// The pair in words.
    pub hint: String,
}

/// Predictions against simulations of one observable.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Scatter {
    /// What it shows.
    pub title: String,
    /// Unit of both axes.
    pub unit: String,
    /// The points.
    pub pairs: Vec<Pair>,
    /// A value to aim at, drawn as a level line.
    pub target: Option<f64>,
}

impl Scatter {
    /// Draws the points.
    pub fn draw(&self) -> Chart {
        let frame = self.frame();
        let mut canvas = Canvas::default();
        frame.draw(&mut canvas, &format!("predicted [{}]", self.unit), &format!("simulated [{}]", self.unit));
        draw_equality(&mut canvas, &frame);
        if let Some(target) = self.target.filter(|target| frame.y.holds(*target)) {
            let y = frame.down(target);
            let (left, right) = (frame.across(frame.x.low), frame.across(frame.x.high));
            canvas.line("target", (X::Units(left), y), (X::Units(right), y));
        }
        for pair in self.finite() {
            draw_pair(&mut canvas, &frame, pair);
        }
        let said: Vec<&str> = self.pairs.iter().map(|pair| pair.hint.as_str()).collect();
        Chart {
            title: self.title.clone(),
            description: format!("Simulated over predicted mean. {}.", said.join("; ")),
            width: Some(340),
            height: 220,
            body: canvas.0,
        }
    }

    fn finite(&self) -> impl Iterator<Item = &Pair> {
        self.pairs.iter().filter(|pair| pair.predicted.is_finite() && pair.simulated.is_finite())
    }

    fn frame(&self) -> Frame {
        let ends = |pair: &Pair| pair.interval.map_or([pair.simulated; 2], |(low, high)| [low, high]);
        let up = self.finite().flat_map(|pair| [pair.simulated, pair.predicted].into_iter().chain(ends(pair)));
        let y = Scale::around(up.chain(self.target), 5);
        let x = Scale::around(self.finite().flat_map(|pair| [pair.predicted, pair.simulated]), 4);
        Frame { x, y }
    }
}

/// The part of the line of equality that lies in the frame.
fn draw_equality(canvas: &mut Canvas, frame: &Frame) {
    let low = frame.x.low.max(frame.y.low);
    let high = frame.x.high.min(frame.y.high);
    if low < high {
        let place = |value: f64| (X::Units(frame.across(value)), frame.down(value));
        canvas.line("guide", place(low), place(high));
    }
}

fn draw_pair(canvas: &mut Canvas, frame: &Frame, pair: &Pair) {
    let x = X::Units(frame.across(pair.predicted));
    if let Some((low, high)) = pair.interval.filter(|(low, high)| low.is_finite() && high.is_finite()) {
        canvas.upright(&format!("interval s{}", pair.series), x, frame.down(high), frame.down(low));
    }
    canvas.mark(pair.series, (x, frame.down(pair.simulated)), &pair.hint);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_that_are_not_finite_are_left_out() {
        let pair = |predicted| Pair { series: 0, predicted, simulated: 2.0, interval: None, hint: String::new() };
        let chart = Scatter { pairs: vec![pair(1.0), pair(f64::NAN)], ..Scatter::default() }.draw();
        assert_eq!(chart.body.matches("class=\"mark").count(), 1);
        assert!(!chart.body.contains("NaN"));
    }
}
