//! Text and times for HTML and SVG.

/// Escapes text for HTML and SVG.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Converts prose to HTML; text in backticks becomes code.
pub fn prose(text: &str) -> String {
    let part =
        |(i, part): (usize, &str)| if i % 2 == 1 { format!("<code>{part}</code>") } else { part.to_owned() };
    escape(text).split('`').enumerate().map(part).collect()
}

/// A time for people: three digits, in seconds from 1000 ms on.
pub fn time(milliseconds: f64) -> String {
    if !milliseconds.is_finite() || milliseconds <= 0.0 {
        return "–".to_owned();
    }
    let (value, unit) = if milliseconds >= 999.5 { (milliseconds / 1e3, "s") } else { (milliseconds, "ms") };
    let digits = (2 - value.log10().floor() as i32).clamp(0, 3) as usize;
    format!("{value:.digits$} {unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_in_backticks_is_code() {
        assert_eq!(prose("`xfem` & no"), "<code>xfem</code> &amp; no");
    }

    #[test]
    fn times_for_people() {
        assert_eq!(time(0.01234), "0.012 ms");
        assert_eq!(time(1.234), "1.23 ms");
        assert_eq!(time(123.4), "123 ms");
        assert_eq!(time(12345.0), "12.3 s");
        assert_eq!(time(f64::NAN), "–");
    }
}
