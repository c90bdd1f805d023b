//! Choices that have a name in configuration and tables: one macro that keeps the name and its inverse together.

/// A name that is not among the choices.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{name}` is not a {what}; choose one of {}", known.join(", "))]
pub struct UnknownName {
    /// What was to be named.
    pub what: &'static str,
    /// The name given.
    pub name: String,
    /// The names there are.
    pub known: &'static [&'static str],
}

/// Gives a plain enum `ALL`, `name()` and `FromStr`: `named!(Kind, "kind of metamodel", Ibm => "ibm", …)`.
macro_rules! named {
    ($type:ident, $what:literal, $($variant:ident => $name:literal),+) => {
        impl $type {
            /// Every choice, in order.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// Name in configuration and tables.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),+ }
            }
        }

        impl std::str::FromStr for $type {
            type Err = $crate::stats::naming::UnknownName;

            fn from_str(text: &str) -> Result<Self, Self::Err> {
                let unknown = || Self::Err { what: $what, name: text.to_owned(), known: &[$($name),+] };
                Self::ALL.iter().copied().find(|choice| choice.name() == text).ok_or_else(unknown)
            }
        }
    };
}
pub(crate) use named;
