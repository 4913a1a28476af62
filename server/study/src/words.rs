//! Numbers formatted for people.

/// A number with four significant digits and no trailing zeros.
pub fn short(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let digits = 3 - value.abs().log10().floor() as i32;
    let text = format!("{value:.*}", digits.clamp(0, 12) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A number with four significant digits and no trailing zeros; very small and very large ones as powers of ten.
pub fn compact(value: f64) -> String {
    let size = value.abs();
    if value == value.round() && size < 1e7 {
        return format!("{value:.0}");
    }
    if (1e-3..1e5).contains(&size) {
        let digits = (3 - size.log10().floor() as i32).clamp(0, 6) as usize;
        return trimmed(&format!("{value:.digits$}")).to_owned();
    }
    let text = format!("{value:.2e}");
    match text.split_once('e') {
        Some((mantissa, exponent)) => format!("{}e{exponent}", trimmed(mantissa)),
        None => text,
    }
}

/// A decimal number without trailing zeros in its fraction.
fn trimmed(text: &str) -> &str {
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { text }
}

/// A relative error in per cent with two significant digits.
pub fn percent(error: f64) -> String {
    if !error.is_finite() {
        return "–".to_owned();
    }
    let value = 100.0 * error;
    if value != 0.0 && value < 0.001 { format!("{value:.1e} %") } else { format!("{} %", two_digits(value)) }
}

fn two_digits(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let digits = (1 - value.abs().log10().floor() as i32).clamp(0, 6);
    format!("{value:.*}", digits as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_digits_are_enough() {
        assert_eq!(short(1234.6), "1235");
        assert_eq!(short(0.012346), "0.01235");
    }

    #[test]
    fn small_and_large_numbers_are_powers_of_ten() {
        assert_eq!(
            [3.0, 0.12345, 1.5, 1e-3, 1.5e-9, 1e-15, -2.664e-15, 1234.6, 99_999.7, 0.0].map(compact),
            ["3", "0.1235", "1.5", "0.001", "1.5e-9", "1e-15", "-2.66e-15", "1235", "100000", "0"]
                .map(str::to_owned)
        );
    }

    #[test]
    fn per_cents() {
        assert_eq!(percent(0.0312), "3.1 %");
        assert_eq!(percent(1.234), "123 %");
        assert_eq!(percent(0.00012), "0.012 %");
        assert_eq!(percent(3e-9), "3.0e-7 %");
    }
}
