//! From the words of a scene to settings of a body.

use scindo_physics::body::PcgSettings;
use scindo_physics::material::Law;

use crate::scene::raw::{RawLaw, RawPrecision};
use crate::scene::{Fault, Mechanics};

/// When the linear solver stops.
pub fn linear(m: &Mechanics) -> PcgSettings {
    PcgSettings { iterations: m.iterations, tolerance: m.tolerance }
}

/// The constitutive law, or why there is no body with it.
pub fn law(m: &Mechanics) -> Result<Law, Fault> {
    let general = m.why_general().or((m.arithmetic() != RawPrecision::Single).then_some("this precision"));
    match (general, m.law) {
        (None, RawLaw::Linear) => Ok(Law::Linear),
        (None, RawLaw::Corotational) => Ok(Law::Corotational),
        (why, _) => Err(Fault::Unsupported {
            found: why.unwrap_or("this law").to_owned(),
            supported: vec!["what the fast path computes".into()],
        }),
    }
}
