//! Names of people, as others read them beside a tool.

/// Longest name of a person [characters].
pub const MAX_NAME_CHARS: usize = 32;

/// What a name may be.
pub const NAMES: &str = "at most 32 characters in one line";

/// Checks the name of a person; an empty one is none.
///
/// # Errors
/// What is left of it without characters that nobody sees.
pub fn check_name(name: &str) -> Result<(), String> {
    if name.chars().count() <= MAX_NAME_CHARS && name.chars().all(is_printed) {
        return Ok(());
    }
    Err(name.chars().filter(|&c| is_printed(c)).take(MAX_NAME_CHARS).collect())
}

/// False for controls, line ends, and marks that turn the direction of the text around them or take no room.
fn is_printed(c: char) -> bool {
    let hidden = ['\u{200b}'..='\u{200f}', '\u{2028}'..='\u{202e}', '\u{2060}'..='\u{206f}'];
    !c.is_control() && c != '\u{feff}' && !hidden.iter().any(|range| range.contains(&c))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_one_line_that_everybody_sees() {
        for good in ["", "Anna", "Dr. O'Neill", "Änne 王"] {
            assert_eq!(check_name(good), Ok(()));
        }
        assert_eq!(check_name("a\nb"), Err("ab".to_owned()));
        assert_eq!(check_name("\u{202e}annA"), Err("annA".to_owned()));
        assert_eq!(check_name(&"x".repeat(33)), Err("x".repeat(32)));
    }
}
