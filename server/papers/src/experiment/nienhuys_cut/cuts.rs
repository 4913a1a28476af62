//! One body, cut in one of several ways, and what the cut did.

use std::time::Instant;

use nalgebra::Vector3;
use scindo_physics::assembly::Tangent;
use scindo_physics::body::{
    Body, BodySettings, CuttingMethod, LooseRule, PcgSettings, Scheme, StaticSettings,
};
use scindo_physics::cut::BladeSweep;
use scindo_physics::cut::remesh::{Moves, SnapReport, SnapSettings};
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::TetMesh;

use crate::experiment::nienhuys::{Start, gradients};
use crate::lab::Trouble;

type V = Vector3<f64>;

/// Printed: ν; from figure 3.12 on the thesis stops at ‖r‖ < 1e-3 ‖f‖. Modulus and force are not printed.
const POISSON: f64 = 0.25;
const YOUNG_PA: f64 = 2e4;
const TO: f64 = 1e-3;

/// A way to cut along faces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Way {
    /// In words.
    pub name: &'static str,
    pub snap: SnapSettings,
}

/// The ways, the jagged one first.
pub(super) const WAYS: [Way; 4] = [
    Way { name: "no node moves", snap: SnapSettings { moves: Moves::None, clean: true } },
    Way { name: "sound moves only", snap: SnapSettings { moves: Moves::Sound, clean: true } },
    Way { name: "pressed, not cleaned", snap: SnapSettings { moves: Moves::Press, clean: false } },
    Way { name: "pressed and cleaned", snap: SnapSettings { moves: Moves::Press, clean: true } },
];

/// What cuts did to a body.
pub(super) struct Made {
    /// The body after the cuts.
    pub body: Body,
    /// Sums over all cuts.
    pub report: SnapReport,
    /// Time of the cuts [s].
    pub cut_s: f64,
}

impl Made {
    /// Largest distance [m] of a node of the lips from the nearest of the `planes`, each a point and a unit normal. Held
    /// nodes do not count: no cut moves them.
    pub(super) fn off_m(&self, planes: &[[V; 2]]) -> f64 {
        let surface = self.body.surface();
        let lips = surface.triangles.iter().zip(&surface.tags).filter(|(_, tag)| **tag > 0);
        let rest = self.body.rest_positions();
        let held: Vec<V> = self.body.fixed_nodes().iter().map(|fixed| rest[fixed.node as usize]).collect();
        let is_free = |v: &u32| !held.contains(&surface.vertices[*v as usize].position(rest));
        let distance = |v: u32| {
            let x = surface.vertices[v as usize].position(self.body.positions());
            planes.iter().map(|[p, n]| (x - p).dot(n).abs()).fold(f64::INFINITY, f64::min)
        };
        lips.flat_map(|(triangle, _)| *triangle).filter(is_free).map(distance).fold(0.0, f64::max)
    }

    /// Number of degenerate elements of the whole mesh.
    pub(super) fn flat(&self) -> usize {
        let Some(tets) = self.body.tets() else { return 0 };
        let mesh = tets.mesh();
        let x = |tet: &[u32; 4]| tet.map(|n| mesh.nodes[n as usize]);
        mesh.tets.iter().filter(|tet| super::delaunay::flatness(&x(tet)) < super::printed_rules::FLAT).count()
    }
}

/// A body of linear elasticity whose nodes that `is_held` names are fixed.
///
/// # Errors
/// A mesh that is none.
pub(super) fn body(mesh: TetMesh, snap: SnapSettings, is_held: impl Fn(&V) -> bool) -> Result<Body, Trouble> {
    let rayleigh = Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 };
    let material =
        Material { young_pa: YOUNG_PA, poisson: POISSON, density_kg_m3: 1e3, law: Law::Linear, rayleigh };
    let settings = BodySettings {
        cutting: CuttingMethod::Snap,
        snap,
        loose: LooseRule::Pinned,
        scheme: Scheme::ImplicitEuler,
        ..BodySettings::default()
    };
    let mut body = Body::new(mesh, material, settings)?;
    let held: Vec<u32> = nodes(&body, is_held);
    body.fix(&held, [true; 3], V::zeros())?;
    Ok(body)
}

/// Numbers of the nodes whose rest positions are wanted.
pub(super) fn nodes(body: &Body, is_wanted: impl Fn(&V) -> bool) -> Vec<u32> {
    (0..).zip(body.rest_positions()).filter(|(_, X)| is_wanted(X)).map(|(n, _)| n).collect()
}

/// Solves for the equilibrium of a body before cuts, far more closely than what is measured afterwards.
///
/// # Errors
/// A solve that does not converge.
pub(super) fn settle(body: &mut Body) -> Result<(), Trouble> {
    let linear = PcgSettings { iterations: 20_000, tolerance: 1e-9 };
    let settings = StaticSettings { tolerance: 1e-6, newton_steps: 20, linear };
    match body.solve_static(V::zeros(), &settings)?.converged {
        true => Ok(()),
        false => Err("the body does not come to rest before the cut".into()),
    }
}

/// Makes the cuts, one incision each.
///
/// # Errors
/// A sweep that is none.
pub(super) fn make(mut body: Body, blades: &[BladeSweep]) -> Result<Made, Trouble> {
    let mut report = SnapReport::default();
    let mut cut_s = 0.0;
    for (incision, blade) in (1..).zip(blades) {
        let begun = Instant::now();
        body.cut(blade, incision)?;
        cut_s += begun.elapsed().as_secs_f64();
        let of = *body.snap_report().ok_or("the body is not cut along faces")?;
        report.faces += of.faces;
        report.moved += of.moved;
        report.refused += of.refused;
        report.flattened += of.flattened;
        report.collapses += of.collapses;
        report.splits += of.splits;
        report.degenerate += of.degenerate;
    }
    Ok(Made { body, report, cut_s })
}

/// Iterations of plain and of preconditioned conjugate gradients until the body is at rest again, from where it is.
/// It is moved there.
///
/// # Errors
/// More iterations than any mesh here needs.
pub(super) fn relax(body: &mut Body) -> Result<[u32; 2], Trouble> {
    let model = body.discrete_model()?;
    let mut K = model.pattern();
    model.tangent(model.rest(), Tangent::Exact, &mut K);
    let mut held = vec![false; body.rest_positions().len()];
    body.fixed_nodes().iter().for_each(|fixed| held[fixed.node as usize] = true);
    let u: Vec<V> = body.positions().iter().zip(body.rest_positions()).map(|(x, X)| x - X).collect();
    let start = Start { u: &u, f: body.loads() };
    let (_, blocks) = gradients(&K, &held, start, TO, true)?;
    let (u, plain) = gradients(&K, &held, start, TO, false)?;
    let x: Vec<V> = u.iter().zip(body.rest_positions()).map(|(u, X)| u + X).collect();
    body.set_state(&x, &vec![V::zeros(); x.len()])?;
    Ok([plain, blocks])
}
