//! A set of points of one dimension, stored row by row: the common currency of designs and metamodels.
//!
//! Shape (n_points, n_parameters). Carries no names, units or bounds; by convention the coordinates are those of
//! the unit cube, where 0 is a parameter's lower and 1 its upper bound.

/// Points of equal dimension, shape (n_points, n_parameters), row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct Points {
    values: Vec<f64>,
    dimension: usize,
}

/// Rows that do not form a set of points.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PointsError {
    /// Two rows differ in length.
    #[error("row {row} has {found} coordinates where {expected} are expected; give every point all parameters")]
    Ragged {
        /// Zero-based row.
        row: usize,
        /// Coordinates found there.
        found: usize,
        /// Coordinates of the other rows.
        expected: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("coordinate {column} of row {row} is not finite; remove the row or repair the value")]
    NotFinite {
        /// Zero-based row.
        row: usize,
        /// Zero-based column.
        column: usize,
    },
}

impl Points {
    /// No points yet, of the given dimension.
    pub fn empty(dimension: usize) -> Self {
        Self { values: Vec::new(), dimension }
    }

    /// Points from rows of `dimension` finite coordinates.
    ///
    /// # Errors
    /// [`PointsError`] for ragged rows and for coordinates that are not finite.
    pub fn from_rows<R: AsRef<[f64]>>(rows: &[R], dimension: usize) -> Result<Self, PointsError> {
        let mut points = Self::empty(dimension);
        for (row, coordinates) in rows.iter().map(AsRef::as_ref).enumerate() {
            if coordinates.len() != dimension {
                return Err(PointsError::Ragged { row, found: coordinates.len(), expected: dimension });
            }
            if let Some(column) = coordinates.iter().position(|value| !value.is_finite()) {
                return Err(PointsError::NotFinite { row, column });
            }
            points.push(coordinates);
        }
        Ok(points)
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.values.len().checked_div(self.dimension).unwrap_or(0)
    }

    /// Whether there is no point.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Number of parameters.
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// The coordinates of all points, one parameter after the other.
    pub fn columns(&self) -> Vec<f64> {
        (0..self.dimension).flat_map(|d| self.rows().map(move |row| row[d])).collect()
    }

    /// Coordinates of point `index`.
    ///
    /// # Panics
    /// If `index` is not below [`Points::len`].
    pub fn row(&self, index: usize) -> &[f64] {
        &self.values[index * self.dimension..(index + 1) * self.dimension]
    }

    /// All points in order.
    pub fn rows(&self) -> impl ExactSizeIterator<Item = &[f64]> + '_ {
        (0..self.len()).map(|index| self.row(index))
    }

    /// Appends one point.
    ///
    /// # Panics
    /// If the number of coordinates is not [`Points::dimension`].
    pub fn push(&mut self, coordinates: &[f64]) {
        assert_eq!(coordinates.len(), self.dimension, "a point of another dimension");
        self.values.extend_from_slice(coordinates);
    }

    /// These points followed by those of `other`.
    ///
    /// # Panics
    /// If the dimensions differ.
    pub fn joined(&self, other: &Self) -> Self {
        assert_eq!(self.dimension, other.dimension, "points of another dimension");
        Self { values: [self.values.as_slice(), &other.values].concat(), dimension: self.dimension }
    }

    /// The points of the given indices, in their order.
    pub fn select(&self, indices: &[usize]) -> Self {
        let values = indices.iter().flat_map(|&index| self.row(index).iter().copied()).collect();
        Self { values, dimension: self.dimension }
    }
}

/// Squared Euclidean distance of two points.
pub fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(u, v)| (u - v) * (u - v)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_come_back_as_they_went_in() {
        let points = Points::from_rows(&[[0.0, 1.0], [0.25, 0.5]], 2).unwrap();
        assert_eq!(points.len(), 2);
        assert_eq!(points.row(1), [0.25, 0.5]);
        assert_eq!(points.select(&[1, 0]).row(0), [0.25, 0.5]);
        assert_eq!(points.joined(&points).len(), 4);
        assert_eq!(squared_distance(points.row(0), points.row(1)), 0.3125);
    }

    #[test]
    fn bad_rows_are_refused_with_their_place() {
        let ragged = Points::from_rows(&[vec![0.0, 1.0], vec![0.5]], 2);
        assert_eq!(ragged, Err(PointsError::Ragged { row: 1, found: 1, expected: 2 }));
        let unknown = Points::from_rows(&[[0.0, f64::NAN]], 2);
        assert_eq!(unknown, Err(PointsError::NotFinite { row: 0, column: 1 }));
    }
}
