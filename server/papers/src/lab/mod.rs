//! What experiments share: their surroundings, the laws, a clamp, a distance.

mod bench;

use nalgebra::Vector3;
use scindo_physics::body::Body;
use scindo_physics::material::Law;

pub use bench::{ExperimentBench, least};

/// Why an experiment or a case could not be made.
pub type Trouble = Box<dyn std::error::Error + Send + Sync>;

/// The laws, by their names in scenes.
pub const LAWS: [(Law, &str); 4] = [
    (Law::Linear, "linear"),
    (Law::Corotational, "corotational"),
    (Law::StVenantKirchhoff, "stvk"),
    (Law::NeoHookean, "neo-hookean"),
];

/// Holds the nodes of a body at x = 0.
///
/// # Errors
/// The body refuses.
pub fn hold_left(body: &mut Body) -> Result<(), Trouble> {
    let at_left = (0..).zip(body.rest_positions()).filter(|(_, X)| X.x < 1e-9);
    let held: Vec<u32> = at_left.map(|(n, _)| n).collect();
    Ok(body.fix(&held, [true; 3], Vector3::zeros())?)
}

/// ‖a − b‖ / ‖b‖; infinite if they are not of the same points.
pub fn distance(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    if a.len() != b.len() {
        return f64::INFINITY;
    }
    let sum = |of: &mut dyn Iterator<Item = f64>| of.sum::<f64>().sqrt();
    let apart = sum(&mut a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()));
    apart / sum(&mut b.iter().map(|b| b.norm_squared()))
}
