//! How an effect of the plan is switched off: by keys of the scene.

use scindo_world::scene::raw::{RawIntegrator, RawLaw, RawLocking};
use scindo_world::scene::{BodySpec, CheckedScene};

/// The keys that switch an effect off, or why there are none.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Switch {
    /// Overrides of the scene, as for `--set`.
    Keys(Vec<String>),
    /// The effect has no switch, for this reason.
    None(&'static str),
}

/// Whether the effect that `keys` switch off drives or opposes the motion by itself. A state in balance with it is far
/// from balance without it, and each step from there would be spent on the jump: such twins go their own way.
pub(super) fn drives(keys: &[String]) -> bool {
    let any = |part: &str| keys.iter().any(|key| key.contains(part));
    any("gravity_m_s2=") || any(".load=") || any(".integrator=")
}

/// Most steps that can be measured.
pub const MOST_STEPS: u32 = 9_999;

/// A period of adaptation that no measurement reaches [steps].
const NEVER: u32 = MOST_STEPS + 1;

/// The assignment that takes all damping from a body.
const UNDAMPED: &str = "rayleigh={ mass_1_s = 0.0, stiffness_s = 0.0 }";

/// The switch of the effect `name` of the plan.
pub(super) fn switch(name: &str, scene: &CheckedScene) -> Switch {
    let one = |key: &str| Switch::Keys(vec![key.to_owned()]);
    match name {
        "gravity" => one("world.gravity_m_s2=[0.0, 0.0, 0.0]"),
        "loads" => bodies(scene, "load=[]", |body| !body.loads.is_empty()),
        "inertia" => inertia(scene),
        "large rotation" => bodies(scene, "law=linear", |body| body.mechanics.law != RawLaw::Linear),
        "damping" => bodies(scene, UNDAMPED, is_damped),
        "locking remedy" => bodies(scene, "locking=none", |body| body.mechanics.locking != RawLocking::None),
        "error estimate" => one("effects.error_estimate=false"),
        "cutting" => one("effects.cutting=false"),
        "adaptation" => adaptation(scene),
        "self-collision" => one("effects.self_collision=false"),
        "governor" => Switch::None("it only acts in real time, which measurements do not keep"),
        "sleep" => one("effects.sleep=false"),
        "body-body contact" => one("effects.body_collision=false"),
        "obstacles" => one("effects.obstacles=false"),
        "probes" => one("probe=[]"),
        "energies" => one("effects.energy=false"),
        _ if name.starts_with("contact ") => one("effects.contact=false"),
        _ if name.starts_with("deformation ") => {
            Switch::None("it is what a body is there for; `scindo accuracy` compares ways to compute it")
        }
        _ => Switch::None("no key switches it"),
    }
}

fn bodies(scene: &CheckedScene, assignment: &str, has: impl Fn(&BodySpec) -> bool) -> Switch {
    let of = |body: &BodySpec| format!("body.{}.{assignment}", body.id);
    Switch::Keys(scene.bodies.iter().filter(|body| has(body)).map(of).collect())
}

/// Static bodies have no damping either.
fn inertia(scene: &CheckedScene) -> Switch {
    let moves = |body: &&BodySpec| body.mechanics.integrator != RawIntegrator::Static;
    let mut keys = Vec::new();
    for body in scene.bodies.iter().filter(moves) {
        keys.push(format!("body.{}.integrator=static", body.id));
        if is_damped(body) {
            keys.push(format!("body.{}.{UNDAMPED}", body.id));
        }
    }
    Switch::Keys(keys)
}

fn is_damped(body: &BodySpec) -> bool {
    body.damping_mass_1_s > 0.0 || body.damping_stiffness_s > 0.0
}

fn adaptation(scene: &CheckedScene) -> Switch {
    let mut keys = Vec::new();
    for body in &scene.bodies {
        let Some(adapt) = body.octree.and_then(|octree| octree.adapt) else { continue };
        keys.push(format!("body.{}.octree.adapt.every_steps={NEVER}", body.id));
        if adapt.settings.error.is_some() {
            keys.push(format!("body.{}.octree.adapt.error_every_steps={NEVER}", body.id));
        }
    }
    Switch::Keys(keys)
}
