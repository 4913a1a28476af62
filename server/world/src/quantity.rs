//! Quantities in words, with the unit and the digits that people read.

/// A length: `12.3 mm`, `0.42 m`.
pub fn length(metres: f64) -> String {
    let (unit, factor) = match metres.abs() {
        l if l >= 1.0 => ("m", 1.0),
        l if l >= 0.1 => ("cm", 1e2),
        l if l >= 1e-4 || l == 0.0 => ("mm", 1e3),
        _ => ("µm", 1e6),
    };
    format!("{} {unit}", digits(metres * factor))
}

/// A mass: `1.2 kg`, `34 g`.
pub fn mass(kilograms: f64) -> String {
    let (unit, factor) = match kilograms.abs() {
        m if m >= 1.0 => ("kg", 1.0),
        m if m >= 1e-3 => ("g", 1e3),
        _ => ("mg", 1e6),
    };
    format!("{} {unit}", digits(kilograms * factor))
}

/// A time: `1.5 s`, `40 ms`.
pub fn duration(seconds: f64) -> String {
    match seconds.abs() {
        s if s >= 100.0 => format!("{:.0} min", seconds / 60.0),
        s if s >= 1.0 || s == 0.0 => format!("{} s", digits(seconds)),
        s if s >= 1e-3 => format!("{} ms", digits(seconds * 1e3)),
        _ => format!("{} µs", digits(seconds * 1e6)),
    }
}

/// A size in memory: `2.7 GB`, `350 MB`.
pub fn memory(bytes: f64) -> String {
    if bytes >= 1e9 { format!("{} GB", digits(bytes / 1e9)) } else { format!("{} MB", digits(bytes / 1e6)) }
}

/// A share in percent: `16 %`, `0.4 %`.
pub fn percent(share: f64) -> String {
    format!("{} %", digits(100.0 * share))
}

/// Three digits, without a power of ten where a person would not write one.
pub fn digits(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-3..1e6).contains(&size) {
        return format!("{value:.2e}");
    }
    let places = if size > 0.0 { (2 - size.log10().floor() as i32).clamp(0, 5) as usize } else { 0 };
    let text = format!("{value:.places$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A point [m] with as many digits as one reads: four of its largest coordinate.
pub fn coordinates(point_m: &[f64; 3]) -> String {
    let largest = point_m.iter().fold(0.0, |largest: f64, c| largest.max(c.abs()));
    let digits = if largest > 0.0 { (3 - largest.log10().floor() as i32).clamp(0, 12) as usize } else { 0 };
    // As text and back: without the zeros at the end.
    let rounded = point_m.map(|c| format!("{c:.digits$}").parse().unwrap_or(c) + 0.0);
    format!("{rounded:?}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_have_the_unit_and_digits_that_people_read() {
        assert_eq!(length(0.012_34), "12.3 mm");
        assert_eq!(length(0.0), "0 mm");
        assert_eq!(length(1695.3), "1695 m");
        assert_eq!(length(0.148), "14.8 cm");
        assert_eq!(mass(0.0341), "34.1 g");
        assert_eq!(duration(0.02), "20 ms");
        assert_eq!(duration(400.0), "7 min");
        assert_eq!(memory(2.7e9), "2.7 GB");
        assert_eq!(percent(0.163), "16.3 %");
        assert_eq!(digits(-0.000_012), "-1.20e-5");
    }
    #[test]
    fn places_have_the_digits_one_reads() {
        assert_eq!(coordinates(&[-0.046_536_258, 0.0029, 0.0]), "[-0.04654, 0.0029, 0.0]");
        assert_eq!(coordinates(&[0.0, 12.345_67, -3.0]), "[0.0, 12.35, -3.0]");
        assert_eq!(coordinates(&[0.0, -1e-9, 0.2]), "[0.0, 0.0, 0.2]");
        assert_eq!(coordinates(&[0.0; 3]), "[0.0, 0.0, 0.0]");
    }
}
