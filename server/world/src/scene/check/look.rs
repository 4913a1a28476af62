//! Checks of how bodies are drawn.

use crate::scene::checked::{LookSpec, TextureMapping, TextureSpec};
use crate::scene::problem::Fault;
use crate::scene::raw::{RawLook, RawTexture};

use super::Check;

impl Check<'_> {
    pub(super) fn look(&mut self, at: &str, look: Option<&RawLook>) -> LookSpec {
        let Some(look) = look else {
            return LookSpec { colour: None, opacity: 1.0, layers: Vec::new(), texture: None };
        };
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
        let texture = look.texture.as_ref().map(|texture| self.texture(&format!("{at}.texture"), texture));
        LookSpec { colour, opacity: look.opacity, layers, texture }
    }

    fn texture(&mut self, at: &str, texture: &RawTexture) -> TextureSpec {
        let next = "keep `surface` for an image made for it, `repeat_m` for a pattern";
        if texture.surface.is_some() && texture.repeat_m.is_some() {
            self.conflict(format!("{at}.repeat_m"), "`repeat_m` does not go with `surface`", next);
        }
        if texture.scale.is_some() && texture.surface.is_none() {
            let next = "remove it; `scale` of the mesh applies to its texture too";
            self.conflict(format!("{at}.scale"), "`scale` only goes with `surface`", next);
        }
        let of_surface = || texture.surface.clone().map(|path| (path, texture.scale.unwrap_or(1.0)));
        let mapping =
            texture.repeat_m.map_or_else(|| TextureMapping::Surface(of_surface()), TextureMapping::Axes);
        TextureSpec { image: texture.image.clone(), mapping }
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
