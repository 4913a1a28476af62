//! Checks of how bodies are drawn.

use crate::scene::checked::LookSpec;
use crate::scene::problem::Fault;
use crate::scene::raw::RawLook;

use super::Check;

impl Check<'_> {
    pub(super) fn look(&mut self, at: &str, look: Option<&RawLook>) -> LookSpec {
        let Some(look) = look else { return LookSpec { colour: None, opacity: 1.0, layers: Vec::new() } };
        let colour = look.colour.as_ref().map(|text| self.colour(format!("{at}.colour"), text));
        let mut layers: Vec<(f64, u32)> = Vec::new();
        for (i, layer) in look.layers.iter().enumerate() {
            if let Some(&(above, _)) = layers.last().filter(|(above, _)| *above >= layer.depth_m) {
                let what = format!("{} m does not lie below {above} m", layer.depth_m);
                self.conflict(
                    format!("{at}.layers.{i}.depth_m"),
                    what,
                    "list the layers from the skin inwards",
                );
            }
            layers.push((layer.depth_m, self.colour(format!("{at}.layers.{i}.colour"), &layer.colour)));
        }
        LookSpec { colour, opacity: look.opacity, layers }
    }

    /// 0xRRGGBB of `#rrggbb`.
    fn colour(&mut self, at: String, text: &str) -> u32 {
        let digits = text.strip_prefix('#').filter(|digits| digits.len() == 6);
        let digits = digits.filter(|digits| digits.bytes().all(|b| b.is_ascii_hexdigit()));
        digits.and_then(|digits| u32::from_str_radix(digits, 16).ok()).unwrap_or_else(|| {
            let (found, allowed) = (format!("`{text}`"), "# and six hexadecimal digits".to_owned());
            self.report(
                at,
                Fault::OutOfRange { found, allowed, next: "write for example \"#b5523f\"".to_owned() },
            );
            0
        })
    }
}
