//! Units at the border: `"5.02 mm"` becomes 0.00502 on the way in, and 0.00502 becomes `5.02 mm` on the way out.
//!
//! Inside, every number is SI (m, kg, s, N, Pa), except angles, which are in degrees wherever a unit says `deg`.
//! Takes texts and the unit that is expected; gives numbers, or says what was expected instead. A decimal prefix moves
//! the decimal point of the *text*, so that `"5.02 mm"` and `0.00502` are the same bits and give the same key.
//! Deliberately no unit types inside the code: names, docs and table columns carry the units there.

/// Why a text is not a value in the expected unit.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum UnitError {
    /// The text does not begin with a number.
    #[error("`{0}` is not a number{1}; write one such as 5.02 or \"5.02 mm\"")]
    NotANumber(String, &'static str),
    /// The number is too large for a `f64`, infinite or NaN.
    #[error("`{0}` is not finite; give a finite number")]
    NotFinite(String),
    /// A unit that is not known.
    #[error("unit `{unit}` is not known; {expected} is expected here")]
    Unknown {
        /// The unit as written.
        unit: String,
        /// What was expected, in words.
        expected: String,
    },
    /// A known unit of another dimension.
    #[error("`{given}` is {dimension}, but {expected} is expected here")]
    Dimension {
        /// The value as written.
        given: String,
        /// Its dimension, in words.
        dimension: String,
        /// What was expected, in words.
        expected: String,
    },
}

/// Exponents of metre, kilogram, second and angle.
type Dimension = [i32; 4];

/// A unit as `scale * 10^exponent` of the base unit (m, kg, s, deg) of its dimension.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Unit {
    dimension: Dimension,
    scale: f64,
    exponent: i32,
}

/// Degrees in a radian.
const DEGREES_PER_RADIAN: f64 = 180.0 / std::f64::consts::PI;

/// Symbol, whether a prefix may stand before it, dimension, scale, exponent of ten.
const ATOMS: &[(&str, bool, Dimension, f64, i32)] = &[
    ("m", true, [1, 0, 0, 0], 1.0, 0),
    ("g", true, [0, 1, 0, 0], 1.0, -3),
    ("t", false, [0, 1, 0, 0], 1.0, 3),
    ("s", true, [0, 0, 1, 0], 1.0, 0),
    ("min", false, [0, 0, 1, 0], 60.0, 0),
    ("h", false, [0, 0, 1, 0], 3600.0, 0),
    ("Hz", true, [0, 0, -1, 0], 1.0, 0),
    ("N", true, [1, 1, -2, 0], 1.0, 0),
    ("Pa", true, [-1, 1, -2, 0], 1.0, 0),
    ("J", true, [2, 1, -2, 0], 1.0, 0),
    ("W", true, [2, 1, -3, 0], 1.0, 0),
    ("l", true, [3, 0, 0, 0], 1.0, -3),
    ("L", true, [3, 0, 0, 0], 1.0, -3),
    ("deg", false, [0, 0, 0, 1], 1.0, 0),
    ("°", false, [0, 0, 0, 1], 1.0, 0),
    ("rad", true, [0, 0, 0, 1], DEGREES_PER_RADIAN, 0),
    ("1", false, [0; 4], 1.0, 0),
    ("%", false, [0; 4], 1.0, -2),
];

const PREFIXES: &[(&str, i32)] =
    &[("G", 9), ("M", 6), ("k", 3), ("d", -1), ("c", -2), ("m", -3), ("u", -6), ("µ", -6), ("μ", -6), ("n", -9)];

/// Words for the dimensions that occur, with an example.
const WORDS: &[(Dimension, &str, &str)] = &[
    ([0; 4], "a plain number", "0.3\" or \"12 %"),
    ([1, 0, 0, 0], "a length", "5.02 mm"),
    ([2, 0, 0, 0], "an area", "1 cm2"),
    ([3, 0, 0, 0], "a volume", "5 l"),
    ([0, 1, 0, 0], "a mass", "1.2 kg"),
    ([0, 0, 1, 0], "a time", "1.65 s"),
    ([0, 0, -1, 0], "a rate", "50 Hz"),
    ([1, 0, -1, 0], "a speed", "0.5 m/s"),
    ([1, 0, -2, 0], "an acceleration", "9.81 m/s2"),
    ([-3, 1, 0, 0], "a density", "2742 kg/m3"),
    ([-1, 1, -2, 0], "a pressure", "70 MPa"),
    ([0, 1, -2, 0], "a stiffness", "368 kN/m"),
    ([1, 1, -2, 0], "a force", "10 N"),
    ([2, 1, -2, 0], "an energy", "1 J"),
    ([0, 1, -1, 0], "a mass flow", "3.68 kg/s"),
    ([0, 0, 0, 1], "an angle", "30 deg"),
];

/// Reads a finite number without a unit, such as a cell of a table.
///
/// # Errors
/// [`UnitError`] for what is not a finite number, or has anything behind it.
pub fn plain(text: &str) -> Result<f64, UnitError> {
    let text = text.trim();
    match split(text) {
        (number, "") => number_text(number, text),
        _ => Err(UnitError::NotANumber(text.to_owned(), "")),
    }
}

/// Reads a value with or without a unit, e.g. `parse("5.02 mm", "m") == Ok(0.00502)`; a plain number is in `expected`.
///
/// # Errors
/// [`UnitError`] for what is not a finite number, not a unit, or a unit of another dimension than `expected`.
pub fn parse(text: &str, expected: &str) -> Result<f64, UnitError> {
    let text = text.trim();
    let (number, unit) = split(text);
    let plain = number_text(number, text)?;
    if unit.is_empty() { Ok(plain) } else { rescale(number, unit, text, expected) }
}

/// Converts a value given in `unit` to `expected`, e.g. `convert(41.4, "deg", "deg") == Ok(41.4)`.
/// An empty unit and `-` mean a plain number.
///
/// # Errors
/// [`UnitError`] for a value that is not finite, a unit that is not known or of another dimension.
pub fn convert(value: f64, unit: &str, expected: &str) -> Result<f64, UnitError> {
    let number = canonical(value);
    let unit = match unit.trim() {
        "" | "-" => "1",
        other => other,
    };
    let given = with_unit(&number, unit);
    if !value.is_finite() {
        return Err(UnitError::NotFinite(given));
    }
    rescale(&number, unit, &given, expected)
}

/// Whether `unit` is one that [`parse`] understands.
pub fn is_known(unit: &str) -> bool {
    unit_of(unit).is_some()
}

/// The shortest decimal text that reads back as exactly this number, with -0 as 0: the form used in keys and tables.
pub fn canonical(value: f64) -> String {
    format!("{}", if value == 0.0 { 0.0 } else { value })
}

/// A number with `digits` significant digits, in plain notation where that is readable, else with an exponent.
///
/// Rust formats with correct rounding and without locale, so the text is the same on every machine.
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return "n/a".to_owned();
    }
    let last = digits.max(1) - 1;
    let scientific = format!("{:.last$e}", if value == 0.0 { 0.0 } else { value });
    let exponent = decade(&scientific);
    match exponent {
        -4..0 => format!("{value:.*}", last + exponent.unsigned_abs() as usize),
        0..6 => format!("{:.*}", last.saturating_sub(exponent as usize), rounded(&scientific, value)),
        _ => scientific,
    }
}

/// A value with its unit and four significant digits, in the handiest decimal multiple: `0.00502, "m"` → `5.020 mm`.
pub fn format(value: f64, unit: &str) -> String {
    let (shift, name) = handy(value, unit);
    with_unit(&significant(shifted(value, shift), 4), name)
}

/// A value and its standard deviation to the same decimal place: `25.43, 2.09, "deg"` → `25.43 ± 2.09 deg`.
/// The deviation has three significant digits.
pub fn format_with_sd(value: f64, sd: f64, unit: &str) -> String {
    if !(value.is_finite() && sd.is_finite() && sd > 0.0) {
        return format!("{} ± {}", significant(value, 4), with_unit(&significant(sd, 3), unit));
    }
    let places = (2 - decade(&format!("{sd:.2e}"))).clamp(0, 12) as usize;
    format!("{value:.places$} ± {}", with_unit(&format!("{sd:.places$}"), unit))
}

/// The expected dimension in words with an example, for messages: ``a length such as "5.02 mm"``.
pub fn describe(unit: &str) -> String {
    match unit_of(unit).and_then(|unit| words(unit.dimension)) {
        Some((name, example)) => format!("{name} such as \"{example}\""),
        None => format!("a value in {unit}"),
    }
}

/// Splits `5.02 mm` behind its number. An `e` belongs to the number only when digits follow.
fn split(text: &str) -> (&str, &str) {
    let bytes = text.as_bytes();
    let mut end = sign(bytes, 0);
    end = digits(bytes, end, true);
    if bytes.get(end).is_some_and(|b| matches!(b, b'e' | b'E')) {
        let first = sign(bytes, end + 1);
        let last = digits(bytes, first, false);
        end = if last > first { last } else { end };
    }
    (&text[..end], text[end..].trim())
}

fn sign(bytes: &[u8], at: usize) -> usize {
    at + usize::from(bytes.get(at).is_some_and(|b| matches!(b, b'+' | b'-')))
}

fn digits(bytes: &[u8], from: usize, point: bool) -> usize {
    let inside = |b: &&u8| b.is_ascii_digit() || (point && **b == b'.');
    from + bytes.get(from..).map_or(0, |rest| rest.iter().take_while(inside).count())
}

fn number_text(number: &str, whole: &str) -> Result<f64, UnitError> {
    let comma = if whole.contains(',') { " (decimals take a point, not a comma)" } else { "" };
    let value: f64 = number.parse().map_err(|_| UnitError::NotANumber(whole.to_owned(), comma))?;
    if !comma.is_empty() {
        return Err(UnitError::NotANumber(whole.to_owned(), comma));
    }
    if value.is_finite() { Ok(value) } else { Err(UnitError::NotFinite(whole.to_owned())) }
}

/// The number `text` in `unit`, expressed in `expected`. `given` is the whole input, for the message.
fn rescale(text: &str, unit: &str, given: &str, expected: &str) -> Result<f64, UnitError> {
    let unknown = || UnitError::Unknown { unit: unit.to_owned(), expected: describe(expected) };
    let from = unit_of(unit).ok_or_else(unknown)?;
    let to = unit_of(expected).ok_or_else(unknown)?;
    if from.dimension != to.dimension {
        return Err(mismatch(from.dimension, given, expected));
    }
    let moved = move_point(text, from.exponent - to.exponent);
    let value = if from.scale == to.scale { moved } else { moved * (from.scale / to.scale) };
    if value.is_finite() { Ok(value) } else { Err(UnitError::NotFinite(given.to_owned())) }
}

fn mismatch(dimension: Dimension, given: &str, expected: &str) -> UnitError {
    let name = words(dimension).map_or("of another dimension", |(name, _)| name);
    UnitError::Dimension { given: given.to_owned(), dimension: name.to_owned(), expected: describe(expected) }
}

fn words(dimension: Dimension) -> Option<(&'static str, &'static str)> {
    WORDS.iter().find(|(known, ..)| *known == dimension).map(|&(_, name, example)| (name, example))
}

/// `text * 10^shift` by changing the exponent of the text, so that the result is the correctly rounded decimal.
/// A text that is no number gives NaN, which callers refuse.
fn move_point(text: &str, shift: i32) -> f64 {
    let (mantissa, exponent) = text.split_once(['e', 'E']).unwrap_or((text, "0"));
    match exponent.parse::<i32>().ok().and_then(|e| e.checked_add(shift)) {
        Some(exponent) => format!("{mantissa}e{exponent}").parse().unwrap_or(f64::NAN),
        None => text.parse().unwrap_or(f64::NAN),
    }
}

fn shifted(value: f64, shift: i32) -> f64 {
    if value.is_finite() { move_point(&canonical(value), shift) } else { value }
}

/// Reads `kg/m3`, `N/m`, `kN/m`, `m/s^2`, `g/cm³`: atoms joined by `*` or `·`, each `/` dividing by the atom behind it.
fn unit_of(text: &str) -> Option<Unit> {
    let mut total = Unit { dimension: [0; 4], scale: 1.0, exponent: 0 };
    for (index, part) in text.trim().split('/').enumerate() {
        for (place, factor) in part.split(['*', '·']).enumerate() {
            let divides = index > 0 && place == 0;
            total = times(total, power_of(factor.trim())?, if divides { -1 } else { 1 });
        }
    }
    Some(total)
}

fn times(unit: Unit, (factor, power): (Unit, i32), sign: i32) -> Unit {
    let power = power * sign;
    let mut dimension = unit.dimension;
    for (sum, exponent) in dimension.iter_mut().zip(factor.dimension) {
        *sum += exponent * power;
    }
    let mut scale = unit.scale;
    for _ in 0..power.unsigned_abs() {
        scale = if power > 0 { scale * factor.scale } else { scale / factor.scale };
    }
    Unit { dimension, scale, exponent: unit.exponent + factor.exponent * power }
}

/// An atom and its power from 1 to 3: `m3`, `m^3`, `m³`.
fn power_of(text: &str) -> Option<(Unit, i32)> {
    const POWERS: &[(&str, i32)] = &[("^2", 2), ("^3", 3), ("²", 2), ("³", 3), ("2", 2), ("3", 3)];
    let named = |suffix: &str| text.strip_suffix(suffix).and_then(atom);
    let powered = POWERS.iter().find_map(|&(suffix, power)| named(suffix).map(|unit| (unit, power)));
    atom(text).map(|unit| (unit, 1)).or(powered)
}

fn atom(text: &str) -> Option<Unit> {
    let plain = |symbol: &str| ATOMS.iter().find(|(known, ..)| *known == symbol);
    if let Some(&(_, _, dimension, scale, exponent)) = plain(text) {
        return Some(Unit { dimension, scale, exponent });
    }
    PREFIXES.iter().find_map(|&(prefix, shift)| {
        let &(_, prefixed, dimension, scale, exponent) = plain(text.strip_prefix(prefix)?)?;
        prefixed.then_some(Unit { dimension, scale, exponent: exponent + shift })
    })
}

/// Which power of ten and which name make `value` easiest to read.
fn handy(value: f64, unit: &str) -> (i32, &str) {
    let size = value.abs();
    match unit {
        "m" if size < 1e-3 && size > 0.0 => (6, "µm"),
        "m" if size < 1.0 && size > 0.0 => (3, "mm"),
        "kg" if size < 1e-3 && size > 0.0 => (6, "mg"),
        "kg" if size < 1.0 && size > 0.0 => (3, "g"),
        "s" if size < 1e-3 && size > 0.0 => (6, "µs"),
        "s" if size < 1.0 && size > 0.0 => (3, "ms"),
        "Pa" if size >= 1e6 => (-6, "MPa"),
        "Pa" if size >= 1e3 => (-3, "kPa"),
        "N/m" if size >= 1e3 => (-3, "kN/m"),
        _ => (0, unit),
    }
}

/// A number with its unit; a bare number where that is `1` or none.
pub fn with_unit(number: &str, unit: &str) -> String {
    if unit == "1" || unit.is_empty() { number.to_owned() } else { format!("{number} {unit}") }
}

/// The exponent in a text such as `1.47e3`.
fn decade(scientific: &str) -> i32 {
    scientific.split_once('e').and_then(|(_, exponent)| exponent.parse().ok()).unwrap_or(0)
}

/// The value of the rounded text: 1473.14 with two digits is 1500, not 1473.
fn rounded(scientific: &str, value: f64) -> f64 {
    scientific.parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_with_units_become_the_same_bits_as_their_si_literals() {
        let cases = [
            ("5.02 mm", "m", 0.00502),
            ("5.02mm", "m", 0.00502),
            ("1.39 mm", "m", 0.00139),
            ("70 MPa", "Pa", 70e6),
            ("7e1 MPa", "Pa", 70e6),
            ("2742 kg/m3", "kg/m3", 2742.0),
            ("2.742 g/cm3", "kg/m3", 2742.0),
            ("2.742 g/cm³", "kg/m3", 2742.0),
            ("2.742 t/m^3", "kg/m3", 2742.0),
            ("368 kN/m", "N/m", 368e3),
            ("30 deg", "deg", 30.0),
            ("30°", "deg", 30.0),
            ("0.3", "1", 0.3),
            (" 1.65 s ", "s", 1.65),
            ("12 %", "1", 0.12),
            ("6.3 µs", "s", 6.3e-6),
            ("5 l", "m3", 0.005),
            ("-2.5e-1 cm", "m", -0.0025),
            ("2 min", "s", 120.0),
            ("3.6 kg/h", "kg/s", 0.001),
            ("72 mN*m", "J", 0.072),
        ];
        for (text, unit, value) in cases {
            assert_eq!(parse(text, unit), Ok(value), "{text} in {unit}");
        }
    }

    #[test]
    fn radians_and_degrees_convert_both_ways() {
        let right = parse("1.5707963267948966 rad", "deg").unwrap();
        assert!((right - 90.0).abs() < 1e-12, "{right}");
        let back = parse("90 deg", "rad").unwrap();
        assert!((back - std::f64::consts::FRAC_PI_2).abs() < 1e-15, "{back}");
    }

    #[test]
    fn a_wrong_dimension_says_which_was_expected() {
        let message = |text, unit| parse(text, unit).unwrap_err().to_string();
        assert_eq!(message("70 MPa", "m"), "`70 MPa` is a pressure, but a length such as \"5.02 mm\" is expected here");
        assert_eq!(
            message("5 mm", "1"),
            "`5 mm` is a length, but a plain number such as \"0.3\" or \"12 %\" is expected here"
        );
        assert_eq!(
            message("5 furlong", "m"),
            "unit `furlong` is not known; a length such as \"5.02 mm\" is expected here"
        );
        assert!(message("3 kg2*m", "m").contains("of another dimension"));
    }

    #[test]
    fn what_is_not_a_finite_number_is_refused() {
        for text in ["", "mm", "nan", "inf m", "-", "e5", ".", "1.2.3 m", "0x10", "--1", "5,02 mm", "1e999"] {
            assert!(parse(text, "m").is_err(), "{text} was accepted");
        }
        assert!(parse("5,02 mm", "m").unwrap_err().to_string().contains("a point, not a comma"));
        assert!(parse("1e308 Mm", "m").unwrap_err().to_string().contains("not finite"));
        assert!(convert(f64::NAN, "m", "m").is_err());
        assert_eq!(plain(" -1.5e3 "), Ok(-1500.0));
        assert!(["12 %", "1 1", "nan", "", "1;2"].iter().all(|text| plain(text).is_err()));
    }

    #[test]
    fn measured_values_convert_by_their_unit_column() {
        assert_eq!(convert(41.4, "deg", "deg"), Ok(41.4));
        assert_eq!(convert(1.4731, "g/cm3", "kg/m3"), Ok(1473.1));
        assert_eq!(convert(912.0, "", "1"), Ok(912.0));
        assert_eq!(convert(912.0, "-", "1"), Ok(912.0));
        assert_eq!(convert(1e300, "mm", "m"), Ok(1e297));
        assert!(convert(5.0, "deg", "kg/m3").unwrap_err().to_string().contains("2742 kg/m3"));
    }

    #[test]
    fn every_decimal_multiple_of_an_atom_has_its_own_meaning() {
        let symbols: Vec<&str> = ATOMS.iter().map(|atom| atom.0).collect();
        for (prefix, _) in PREFIXES {
            for &(symbol, prefixed, ..) in ATOMS {
                let joined = format!("{prefix}{symbol}");
                assert!(!prefixed || !symbols.contains(&joined.as_str()), "{joined} is ambiguous");
            }
        }
        assert!(["mmin", "kdeg", "k%", "", "m5", "m-3", "/s", "kg//m"].iter().all(|unit| !is_known(unit)));
        assert!(["1", "1/s", "mrad", "Hz", "kg*m/s2"].iter().all(|unit| is_known(unit)));
    }

    #[test]
    fn numbers_are_written_with_sensible_digits() {
        let cases = [
            (0.00502, "m", "5.020 mm"),
            (0.00000063, "m", "0.6300 µm"),
            (1473.14, "kg/m3", "1473 kg/m3"),
            (24.153, "deg", "24.15 deg"),
            (70e6, "Pa", "70.00 MPa"),
            (0.5513, "1", "0.5513"),
            (6.3e-6, "s", "6.300 µs"),
            (0.0, "m", "0.000 m"),
            (-0.0, "1", "0.000"),
            (f64::NAN, "kg", "n/a kg"),
            (4.2e-9, "1", "4.200e-9"),
            (-31.4159, "deg", "-31.42 deg"),
            (999_999.0, "1", "1.000e6"),
        ];
        for (value, unit, text) in cases {
            assert_eq!(format(value, unit), text);
        }
        assert_eq!(significant(1473.14, 2), "1500");
        assert_eq!(significant(9.9996, 4), "10.00");
    }

    #[test]
    fn a_value_and_its_deviation_end_at_the_same_place() {
        assert_eq!(format_with_sd(25.43, 2.09, "deg"), "25.43 ± 2.09 deg");
        assert_eq!(format_with_sd(1473.1, 10.94, "kg/m3"), "1473.1 ± 10.9 kg/m3");
        assert_eq!(format_with_sd(3.68, 0.025, "kg/s"), "3.6800 ± 0.0250 kg/s");
        assert_eq!(format_with_sd(3.68, f64::NAN, "kg/s"), "3.680 ± n/a kg/s");
    }

    #[test]
    fn canonical_text_reads_back_to_the_same_bits() {
        for value in [0.1, 1.0 / 3.0, 1e-300, 5e-324, f64::MAX, 2742.0, -0.0] {
            let back: f64 = canonical(value).parse().unwrap();
            assert_eq!(back.to_bits(), if value == 0.0 { 0 } else { value.to_bits() });
        }
    }
}
