//! Shapes of tools as words of a command line.

use scindo_proto::messages::{ToolShape, tool_shape};

/// Reads `sphere:RADIUS`, `capsule:RADIUS:LENGTH` or `blade:LENGTH:THICKNESS` [m].
///
/// # Errors
/// Another word, or a length that is not above 0 and at most 10 m.
pub fn parse_shape(text: &str) -> Result<ToolShape, String> {
    let mut parts = text.split(':');
    let kind = parts.next().unwrap_or_default();
    let numbers: Vec<f64> =
        parts.filter_map(|n| n.parse().ok()).filter(|n: &f64| *n > 0.0 && *n <= 10.0).collect();
    let kind = match (kind, &numbers[..]) {
        ("sphere", [radius_m]) => tool_shape::Kind::Sphere(tool_shape::Sphere { radius_m: *radius_m }),
        ("capsule", [radius_m, length_m]) => {
            tool_shape::Kind::Capsule(tool_shape::Capsule { radius_m: *radius_m, length_m: *length_m })
        }
        ("blade", [length_m, thickness_m]) => {
            tool_shape::Kind::Blade(tool_shape::Blade { length_m: *length_m, thickness_m: *thickness_m })
        }
        _ => {
            return Err(
                "expected sphere:RADIUS, capsule:RADIUS:LENGTH or blade:LENGTH:THICKNESS in metres".into()
            );
        }
    };
    Ok(ToolShape { kind: Some(kind) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shape_has_all_its_lengths() {
        let blade = tool_shape::Blade { length_m: 0.04, thickness_m: 0.001 };
        let shape = ToolShape { kind: Some(tool_shape::Kind::Blade(blade)) };
        assert_eq!(parse_shape("blade:0.04:0.001"), Ok(shape));
        for text in ["box:1", "sphere", "sphere:-1", "blade:0.04", "sphere:11"] {
            assert!(parse_shape(text).is_err(), "{text}");
        }
    }
}
