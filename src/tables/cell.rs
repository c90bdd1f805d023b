//! Cells: the Rust types a field of a table may have, and the Arrow array each becomes.

use super::{ColumnType, Fault};
use arrow::array::{Array, ArrayRef, BooleanArray, Float64Array, StringArray, UInt32Array, UInt64Array};
use std::cmp::Ordering;
use std::sync::Arc;

/// A field type: `u32`, `u64`, `f64`, `bool`, `String` or an `Option` of these. Sealed: a sixth type would be a new
/// kind of column in every reader of the tables.
pub trait Cell: sealed::Sealed + Sized {
    /// Type of the column.
    const TYPE: ColumnType;
    /// Whether the column may hold nulls.
    const NULLABLE: bool;
    /// The Arrow array that holds the column.
    type Array: Array + 'static;

    /// One column from the fields of all rows.
    fn collect<'a>(cells: impl Iterator<Item = &'a Self>) -> ArrayRef
    where
        Self: 'a;

    /// The field of row `row`, which the caller knows to exist.
    fn get(array: &Self::Array, row: usize) -> Self;

    /// Order of two fields in a sort key; numbers by IEEE 754 total order.
    fn order(&self, other: &Self) -> Ordering;
}

mod sealed {
    pub trait Sealed {}
}

/// Implements [`Cell`] for a type and for `Option` of it.
macro_rules! cell {
    ($rust:ty, $array:ty, $kind:expr, $borrow:expr, $own:expr, $order:expr) => {
        impl sealed::Sealed for $rust {}
        impl sealed::Sealed for Option<$rust> {}

        impl Cell for $rust {
            const TYPE: ColumnType = $kind;
            const NULLABLE: bool = false;
            type Array = $array;

            fn collect<'a>(cells: impl Iterator<Item = &'a Self>) -> ArrayRef {
                Arc::new(cells.map(|cell| Some($borrow(cell))).collect::<$array>())
            }

            fn get(array: &Self::Array, row: usize) -> Self {
                $own(array.value(row))
            }

            fn order(&self, other: &Self) -> Ordering {
                $order(self, other)
            }
        }

        impl Cell for Option<$rust> {
            const TYPE: ColumnType = $kind;
            const NULLABLE: bool = true;
            type Array = $array;

            fn collect<'a>(cells: impl Iterator<Item = &'a Self>) -> ArrayRef {
                Arc::new(cells.map(|cell| cell.as_ref().map($borrow)).collect::<$array>())
            }

            fn get(array: &Self::Array, row: usize) -> Self {
                array.is_valid(row).then(|| $own(array.value(row)))
            }

            fn order(&self, other: &Self) -> Ordering {
                match (self, other) {
                    (Some(a), Some(b)) => $order(a, b),
                    (a, b) => a.is_some().cmp(&b.is_some()),
                }
            }
        }
    };
}

cell!(u32, UInt32Array, ColumnType::U32, |cell: &u32| *cell, u32::from, u32::cmp);
cell!(u64, UInt64Array, ColumnType::U64, |cell: &u64| *cell, u64::from, u64::cmp);
cell!(f64, Float64Array, ColumnType::F64, |cell: &f64| *cell, f64::from, f64::total_cmp);
cell!(bool, BooleanArray, ColumnType::Bool, |cell: &bool| *cell, bool::from, bool::cmp);
cell!(String, StringArray, ColumnType::Text, String::clone, str::to_owned, String::cmp);

/// Refuses NaN: it has many bit patterns, so equal tables could have different bytes.
pub(super) fn refuse_nan(column: &str, array: &dyn Array) -> Result<(), Fault> {
    let Some(numbers) = array.as_any().downcast_ref::<Float64Array>() else { return Ok(()) };
    match numbers.iter().position(|value| value.is_some_and(f64::is_nan)) {
        Some(at) => Err(Fault::NotANumber { column: column.to_owned(), row: at + 1 }),
        None => Ok(()),
    }
}
