//! Heat map of cosines between -1 and 1: blue for alike, orange for opposite, the number in every field.

use super::super::numbers::{MISSING, fixed};
use super::Chart;
use super::svg::{Canvas, X};

const FIELD: f64 = 52.0;
const LETTER: f64 = 6.6;

/// A square table of cosines, each field with its number.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct HeatMap {
    /// What it shows.
    pub title: String,
    /// Names of rows and columns.
    pub names: Vec<String>,
    /// Cosine of row and column; none where it is not known.
    pub fields: Vec<Vec<Option<f64>>>,
}

impl HeatMap {
    /// Draws the fields; columns are numbered, rows carry number and name.
    pub fn draw(&self) -> Chart {
        let longest = self.names.iter().map(|name| name.chars().count()).max().unwrap_or(0);
        let left = 34.0 + LETTER * longest as f64;
        let mut canvas = Canvas::default();
        for (column, _) in self.names.iter().enumerate() {
            let x = left + FIELD * (column as f64 + 0.5);
            canvas.text("tick", (X::Units(x), 16.0), "middle", &(column + 1).to_string());
        }
        for (row, name) in self.names.iter().enumerate() {
            let y = 24.0 + FIELD * 0.6 * row as f64;
            canvas.text("label", (X::Units(0.0), y + 20.0), "start", &format!("{}  {name}", row + 1));
            self.draw_row(&mut canvas, left, y, row);
        }
        Chart {
            title: self.title.clone(),
            description: self.description(),
            width: Some((left + FIELD * self.names.len() as f64 + 2.0) as u32),
            height: (28.0 + FIELD * 0.6 * self.names.len() as f64) as u32,
            body: canvas.0,
        }
    }

    fn field(&self, row: usize, column: usize) -> Option<f64> {
        let field = self.fields.get(row).and_then(|fields| fields.get(column)).copied().flatten();
        field.filter(|cosine| cosine.is_finite())
    }

    fn draw_row(&self, canvas: &mut Canvas, left: f64, y: f64, row: usize) {
        for column in 0..self.names.len() {
            let x = left + FIELD * column as f64;
            let cosine = self.field(row, column);
            let strength = cosine.map_or(0.0, |cosine| 0.55 * cosine.abs().min(1.0));
            let class = if cosine.unwrap_or(0.0) < 0.0 { "field opposite" } else { "field alike" };
            canvas.area(class, (x + 1.0, y + 1.0), (FIELD - 2.0, FIELD * 0.6 - 2.0), strength);
            let text = match cosine {
                _ if row == column => "·".to_string(),
                Some(cosine) => fixed(cosine, 2),
                None => MISSING.to_string(),
            };
            canvas.text("field-text", (X::Units(x + FIELD / 2.0), y + 20.0), "middle", &text);
        }
    }

    fn description(&self) -> String {
        let mut said = Vec::new();
        for (row, name) in self.names.iter().enumerate() {
            for (column, other) in self.names.iter().enumerate().skip(row + 1) {
                let cosine = self.field(row, column).map_or(MISSING.to_string(), |cosine| fixed(cosine, 2));
                said.push(format!("{name} and {other}: {cosine}"));
            }
        }
        format!("Cosine between the visible parts of two effects. {}.", said.join("; "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_fields_are_dashes() {
        let names = vec!["cohesion".to_string(), "fines".to_string()];
        let fields = vec![vec![Some(1.0), Some(-0.5)], vec![Some(f64::NAN), Some(1.0)]];
        let chart = HeatMap { title: String::new(), names, fields }.draw();
        assert!(chart.body.contains("−0.50"));
        assert!(chart.body.contains(MISSING));
        assert!(!chart.body.contains("NaN"));
    }
}
