//! Bodies and parts that nothing holds.

use nalgebra::Vector3;
use scindo_physics::element::Held;

use crate::body::SimBody;
use crate::quantity::{mass, percent};
use crate::scene::raw::RawIntegrator;
use crate::scene::{BodySpec, CheckedScene, MeshSource};

/// Share of gravity along an axis that counts as a pull.
const PULL: f64 = 0.01;

/// Most parts whose sizes are listed.
const LISTED: usize = 4;

const AXES: [&str; 3] = ["x", "y", "z"];

/// Says which parts of `body` hang on nothing, and which parts no element joins to the others.
/// `carried` tells whether something that the body touches may stop its fall.
pub(super) fn doubts(
    scene: &CheckedScene,
    (spec, carried): (&BodySpec, bool),
    body: &SimBody,
    doubts: &mut Vec<String>,
) {
    let (at, parts) = (format!("body.{}", spec.id), body.body.parts());
    let carried = carried && spec.mechanics.integrator != RawIntegrator::Static;
    if carried && parts.any_free() {
        return;
    }
    if parts.free.iter().all(|&free| free) {
        let (consequence, fix) = (consequence(scene, spec), suggestion(scene));
        let what = if spec.fixes.is_empty() { "it has no `fix`" } else { "its `fix` holds no part of it" };
        doubts.push(format!("{at}: nothing holds the body: {what}, and {consequence}. {fix}"));
    } else if parts.any_free() {
        doubts.push(format!("{at}: {}", loose_parts(scene, spec, body)));
    } else if parts.len() > 1 {
        doubts.push(format!(
            "{at}: its mesh consists of {} separate parts ({}); each is held{}",
            parts.len(),
            sizes(&parts.mass),
            remedy(spec)
        ));
    }
    pulled_along(scene, body, &at, doubts);
}

fn consequence(scene: &CheckedScene, spec: &BodySpec) -> &'static str {
    if spec.mechanics.integrator == RawIntegrator::Static {
        "a static body without support has no equilibrium, so its steps are refused"
    } else if scene.gravity_m_s2.norm() > 0.0 {
        "it falls without end"
    } else if spec.loads.is_empty() {
        "the first touch pushes it away"
    } else {
        "its loads push it away"
    }
}

/// A `fix` that would hold the body where gravity presses it, to be copied.
fn suggestion(scene: &CheckedScene) -> String {
    let g = scene.gravity_m_s2;
    let axis = g.iamax();
    // Held at its foot; without gravity the foot is below.
    let (from, to) = if g[axis] > 0.0 { (0.9, 1.0) } else { (0.0, 0.1) };
    let axis = if g.norm() > 0.0 { AXES[axis] } else { "z" };
    format!(
        "Hold it: [[body.fix]] with where = {{ slab = {{ axis = \"{axis}\", from = {from:?}, to = {to:?} }} }}"
    )
}

fn loose_parts(scene: &CheckedScene, spec: &BodySpec, body: &SimBody) -> String {
    let parts = body.body.parts();
    let free: Vec<f64> = (0..parts.len()).filter(|&p| parts.free[p]).map(|p| parts.mass[p]).collect();
    let which = if free.len() == 1 { "one of them" } else { "some of them" };
    format!(
        "its mesh consists of {} separate parts, and nothing holds {which} ({} of {}); {}{}",
        parts.len(),
        sizes(&free),
        mass(body.body.total_mass()),
        consequence(scene, spec),
        remedy(spec)
    )
}

/// "12 g, 3 g and 2 more": the largest first.
fn sizes(masses: &[f64]) -> String {
    let mut sorted = masses.to_vec();
    sorted.sort_by(|a, b| b.total_cmp(a));
    let total: f64 = sorted.iter().sum();
    let shown: Vec<String> =
        sorted.iter().take(LISTED).map(|m| format!("{} = {}", mass(*m), percent(m / total))).collect();
    let more = sorted.len().saturating_sub(LISTED);
    let rest = if more > 0 { format!(" and {more} smaller") } else { String::new() };
    format!("{}{rest}", shown.join(", "))
}

fn remedy(spec: &BodySpec) -> &'static str {
    match spec.mesh {
        MeshSource::Surface { .. } => {
            ". Hold it with another [[body.fix]], raise mesh.cells, or write mesh.parts = \"largest\" to drop it"
        }
        MeshSource::File { .. } => {
            ". Hold it with another [[body.fix]], join it in the file, or write mesh.parts = \"largest\" to drop it"
        }
        _ => "",
    }
}

/// A part that is held, but free to move where gravity pulls it.
fn pulled_along(scene: &CheckedScene, body: &SimBody, at: &str, doubts: &mut Vec<String>) {
    let (g, parts) = (scene.gravity_m_s2, body.body.parts());
    let (mut held, nothing) = (vec![Held::NOT; parts.len()], Vector3::zeros());
    for fixed in body.body.fixed_nodes() {
        let Some(&part) = parts.of_copy.get(fixed.node as usize) else { continue };
        let part = &mut held[part as usize];
        if !part.covers(&fixed.held) {
            *part = part.with(&nothing, &fixed.held, &nothing).0;
        }
    }
    let pull = |held: &Held| Some(g - held.part_of(&g)).filter(|pull| held.any() && pull.norm() > 0.0);
    let along = |held: &Held| match held.axes() {
        Some(_) => {
            let axis = (0..3).find(|&axis| pull(held).is_some_and(|p| p[axis].abs() > PULL * g.norm()))?;
            Some((AXES[axis].to_owned(), format!("Add {} to the `axes` of a fix", AXES[axis])))
        }
        None => {
            let way = pull(held).filter(|pull| pull.norm() > PULL * g.norm())?.normalize();
            let way = format!("[{:.2}, {:.2}, {:.2}]", way.x, way.y, way.z);
            Some((way, "If it is not meant to, hold it with another [[body.fix]]".to_owned()))
        }
    };
    if let Some((way, next)) = held.iter().find_map(along) {
        doubts.push(format!(
            "{at}: nothing holds it along {way}, although gravity pulls it that way; it slides away. {next}"
        ));
    }
}
