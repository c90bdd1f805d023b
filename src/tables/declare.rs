//! The `table!` macro: one declaration from which struct, spec and conversions follow.

/// Declares a table: a row struct with public documented fields, its [`TableSpec`](crate::tables::TableSpec), and
/// [`Row`](crate::tables::Row) (with `keyed by`, also [`Keyed`](crate::tables::Keyed)).
///
/// The doc comments are the meanings that go into the Parquet metadata and `schemas/*.json`, so every field needs one.
/// After each type stands the unit in brackets: `"1"` for pure numbers, `""` where a unit makes no sense.
///
/// ```
/// use granulake::tables::Row;
///
/// granulake::table! {
///     /// One row per design point and parameter.
///     pub struct SampleRow in "samples" version 1 sorted by (point, parameter) {
///         /// Design point, counted from 1.
///         point: u32 ["1"],
///         /// Name of the parameter.
///         parameter: String [""],
///         /// Value of the parameter, in SI units.
///         value: f64 ["SI"],
///         /// Why there is no value.
///         reason: Option<String> [""],
///     }
/// }
///
/// let row = SampleRow { point: 1, parameter: "sliding_friction".into(), value: 0.4, reason: None };
/// let bytes = granulake::tables::io::to_parquet_bytes(&[row.clone()])?;
/// assert_eq!(granulake::tables::io::from_parquet_bytes::<SampleRow>("samples.parquet", bytes)?, [row]);
/// assert_eq!(SampleRow::SPEC.columns[2].unit, "SI");
/// # Ok::<(), granulake::tables::TableError>(())
/// ```
///
/// A table that is kept in a ledger names its key column, a `String` of 64 hexadecimal digits, before the sort key:
/// `pub struct RunRow in "runs" version 1 keyed by run_key sorted by (run_key) { … }`. A table that is split into files
/// by the values of a text column says so in the same place: `partitioned by experiment`.
#[macro_export]
macro_rules! table {
    (
        $(#[doc = $meaning:literal])*
        $vis:vis struct $Row:ident in $table:literal version $version:literal
            $(keyed by $key:ident)? $(partitioned by $part:ident)? sorted by ($($sort:ident),+ $(,)?)
        {
            $( $(#[doc = $doc:literal])* $field:ident : $type:ty [ $unit:literal ] ),+ $(,)?
        }
    ) => {
        $(#[doc = $meaning])*
        #[derive(Debug, Clone, PartialEq)]
        $vis struct $Row {
            $(
                $(#[doc = $doc])*
                #[doc = concat!("\n\nIn `[", $unit, "]`.")]
                pub $field: $type,
            )+
        }

        impl $crate::tables::Row for $Row {
            const SPEC: &'static $crate::tables::TableSpec = &$crate::tables::TableSpec {
                name: $table,
                version: $version,
                meaning: concat!($($meaning),*).trim_ascii(),
                columns: &[
                    $( $crate::tables::ColumnSpec::of::<$type>(stringify!($field), $unit, concat!($($doc),*)) ),+
                ],
                sorted_by: &[$(stringify!($sort)),+],
                keyed_by: $crate::tables::one_of(&[$(stringify!($key))?]),
                partitioned_by: $crate::tables::one_of(&[$(stringify!($part))?]),
            };

            fn to_batch(rows: &[Self]) -> Result<$crate::tables::RecordBatch, $crate::tables::TableError> {
                $crate::tables::to_batch(
                    Self::SPEC,
                    vec![$( <$type as $crate::tables::Cell>::collect(rows.iter().map(|row| &row.$field)) ),+],
                )
            }

            fn from_checked(
                checked: &$crate::tables::Checked,
                rows: std::ops::Range<usize>,
            ) -> Result<Vec<Self>, $crate::tables::TableError> {
                $( let $field = checked.column::<$type>(stringify!($field))?; )+
                let rows = rows.map(|row| Self { $( $field: <$type as $crate::tables::Cell>::get($field, row) ),+ });
                Ok(rows.collect())
            }

            fn partition(&self) -> &str {
                let named: &[&str] = &[$(self.$part.as_str())?];
                named.first().copied().unwrap_or_default()
            }

            fn order(&self, other: &Self) -> std::cmp::Ordering {
                std::cmp::Ordering::Equal
                    $( .then_with(|| $crate::tables::Cell::order(&self.$sort, &other.$sort)) )+
            }
        }

        $(
            impl $crate::tables::Keyed for $Row {
                const KEY: &'static str = stringify!($key);

                fn key(&self) -> &str {
                    &self.$key
                }
            }
        )?
    };
}
