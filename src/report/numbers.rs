//! Numbers as text: digits according to uncertainty, the same bytes on every machine.
//!
//! Takes SI values and gives plain ASCII-minus text; the HTML renderer turns a minus sign before a digit into the
//! typographic one. Nothing here prints NaN or an infinity: what is not a number becomes [`MISSING`].
//! Exponents are read from Rust's own shortest decimal text, so no logarithm is involved.

/// Stands where a value is missing.
pub const MISSING: &str = "—";

/// Decimals are capped here; a smaller uncertainty is an exact number in disguise.
const MOST_DECIMALS: i32 = 9;

/// Fixed number of decimals, without a negative zero.
pub fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return MISSING.to_string();
    }
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(rest) if is_zero(rest) => rest.to_string(),
        _ => text,
    }
}

/// Fixed number of significant digits; very large and very small numbers as mantissa × power of ten.
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return MISSING.to_string();
    }
    if value == 0.0 {
        return "0".to_string();
    }
    let precision = digits.max(1) - 1;
    let (mantissa, exponent) = scientific(value, precision);
    if (-4..=6).contains(&exponent) {
        let decimals = (precision as i32 - exponent).max(0);
        return fixed(value, decimals as usize);
    }
    format!("{mantissa}×10{}", superscript(exponent))
}

/// [`significant`] without trailing zeros, for settings and printed values.
pub fn trimmed(value: f64, digits: usize) -> String {
    let text = significant(value, digits);
    if text.contains('.') && !text.contains('×') {
        return text.trim_end_matches('0').trim_end_matches('.').to_string();
    }
    text
}

/// `mean ± sd` of repetitions: three significant digits of the standard deviation, as the paper prints them.
pub fn spread(mean: f64, sd: f64) -> String {
    match decimals_of(sd) {
        Some(decimals) => format!("{} ± {}", fixed(mean, decimals + 1), fixed(sd, decimals + 1)),
        None => significant(mean, 4),
    }
}

/// A value with as many decimals as its uncertainty (a standard error or half an interval) carries: two significant
/// digits of the uncertainty. Four significant digits of the value where there is none.
pub fn to_uncertainty(value: f64, uncertainty: f64) -> String {
    match decimals_of(uncertainty) {
        Some(decimals) => fixed(value, decimals),
        None => significant(value, 4),
    }
}

/// `value ± uncertainty`, both with the same decimals.
pub fn plus_minus(value: f64, uncertainty: f64) -> String {
    match decimals_of(uncertainty) {
        Some(decimals) => format!("{} ± {}", fixed(value, decimals), fixed(uncertainty, decimals)),
        None => significant(value, 4),
    }
}

/// `value [lower, upper]`, all with the decimals that half the interval carries.
pub fn with_interval(value: f64, lower: f64, upper: f64) -> String {
    match decimals_of((upper - lower) / 2.0) {
        Some(decimals) => {
            format!("{} [{}, {}]", fixed(value, decimals), fixed(lower, decimals), fixed(upper, decimals))
        }
        None => significant(value, 4),
    }
}

/// A signed percentage without the sign `%`, as in the paper's tables: two decimals, fewer from 100 on.
pub fn percent(value: f64) -> String {
    let decimals = match value.abs() {
        size if size >= 1000.0 => 0,
        size if size >= 100.0 => 1,
        _ => 2,
    };
    signed(fixed(value, decimals))
}

/// `+1.23 [-0.40, +2.86]` in per cent.
pub fn percent_interval(value: f64, lower: f64, upper: f64) -> String {
    format!("{} [{}, {}]", percent(value), percent(lower), percent(upper))
}

/// A signed number with a fixed number of decimals.
pub fn signed_fixed(value: f64, decimals: usize) -> String {
    signed(fixed(value, decimals))
}

/// A p-value as a comparison: `p = 0.034`, `p < 0.001`.
pub fn p_is(p: f64) -> String {
    let text = p_value(p);
    if text.starts_with('<') { format!("p {text}") } else { format!("p = {text}") }
}

/// A p-value: three decimals, `< 0.001` below.
pub fn p_value(p: f64) -> String {
    if p.is_finite() && p < 0.001 { "< 0.001".to_string() } else { fixed(p, 3) }
}

/// A natural logarithm of odds in words: `about 20 : 1`.
pub fn odds(ln_odds: f64) -> String {
    if !ln_odds.is_finite() {
        return MISSING.to_string();
    }
    let ratio = significant(libm::exp(ln_odds.abs()), 2);
    if ln_odds >= 0.0 { format!("about {ratio} : 1") } else { format!("about 1 : {ratio}") }
}

/// A count with commas between thousands.
pub fn count(number: usize) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (position, digit) in digits.chars().enumerate() {
        if position > 0 && (digits.len() - position).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// Decimals at which an uncertainty shows two significant digits; none when it is not a positive number.
pub fn decimals_of(uncertainty: f64) -> Option<usize> {
    if !uncertainty.is_finite() || uncertainty <= 0.0 {
        return None;
    }
    let (_, exponent) = scientific(uncertainty, 1);
    Some((1 - exponent).clamp(0, MOST_DECIMALS) as usize)
}

/// Mantissa text and exponent of the rounded value.
pub fn scientific(value: f64, precision: usize) -> (String, i32) {
    let text = format!("{value:.precision$e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    (mantissa.to_string(), exponent.parse().unwrap_or(0))
}

fn signed(text: String) -> String {
    let positive = !text.starts_with('-') && text != MISSING && !is_zero(&text);
    if positive { format!("+{text}") } else { text }
}

fn is_zero(text: &str) -> bool {
    text.chars().all(|c| c == '0' || c == '.')
}

fn superscript(exponent: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raise = |c: char| c.to_digit(10).map_or('⁻', |digit| DIGITS[digit as usize]);
    exponent.to_string().chars().map(raise).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_follow_the_uncertainty() {
        assert_eq!(with_interval(25.4321, 24.8432, 26.0211), "25.43 [24.84, 26.02]");
        assert_eq!(plus_minus(1473.12, 10.94), "1473 ± 11");
        assert_eq!(plus_minus(0.55131, 0.0123), "0.551 ± 0.012");
        assert_eq!(to_uncertainty(2763.5, 250.0), "2764");
        assert_eq!(plus_minus(2.71951, 0.0), "2.720");
        assert_eq!(spread(1473.1, 10.94), "1473.1 ± 10.9");
        assert_eq!(spread(25.43, 2.09), "25.43 ± 2.09");
        assert_eq!(decimals_of(0.0996), Some(2), "rounds up to 0.10 before the digits are counted");
    }

    #[test]
    fn what_is_not_a_number_is_a_dash() {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(fixed(value, 2), MISSING);
            assert_eq!(significant(value, 3), MISSING);
            assert_eq!(percent(value), MISSING);
            assert_eq!(p_value(value), MISSING);
            assert_eq!(odds(value), MISSING);
            assert_eq!(decimals_of(value), None);
        }
    }

    #[test]
    fn signs_and_zeros() {
        assert_eq!(percent(-0.001), "0.00");
        assert_eq!(percent(5.191), "+5.19");
        assert_eq!(percent(-13.17), "-13.17");
        assert_eq!(percent(1234.5), "+1234");
        assert_eq!(signed_fixed(0.0, 1), "0.0");
    }

    #[test]
    fn extremes_use_powers_of_ten() {
        assert_eq!(significant(1.234e-9, 3), "1.23×10⁻⁹");
        assert_eq!(significant(123_456.0, 3), "123456");
        assert_eq!(significant(0.000_123_45, 3), "0.000123");
        assert_eq!(odds(-3.0), "about 1 : 20");
        assert_eq!(count(1_234_567), "1,234,567");
        assert_eq!(count(950), "950");
        assert_eq!(trimmed(0.1, 5), "0.1");
        assert_eq!(trimmed(2767.0, 5), "2767");
        assert_eq!(p_is(0.0004), "p < 0.001");
        assert_eq!(p_is(0.034), "p = 0.034");
    }
}
