//! One cut body in all bases: the same displacements, different conditioning.

use nalgebra::{Matrix3, Vector3};
use scindo_physics::assembly::{BlockCsr, Model, Tangent, Volumetric};
use scindo_physics::cut::{BladeSweep, CutMesh};
use scindo_physics::element::FixedCopy;
use scindo_physics::integrator::StaticProblem;
use scindo_physics::material::Law;
use scindo_physics::mesh::{BoxPattern, TetMesh, box_mesh};
use scindo_physics::solver::{
    Curvature, LinearSettings, Method, Newton, NewtonSettings, Potential, Precision, StopReason,
};
use scindo_physics::team::Team;

use super::{clamped, material};
use crate::enrichment::bases::{System, condition_numbers};
use crate::enrichment::basis::{Enrichment, Side};
use crate::enrichment::enriched_tet::{EnrichedTet, UA};
use crate::enrichment::view::EnrichedView;

type V = Vector3<f64>;
const LAWS: [Law; 3] = [Law::Linear, Law::Corotational, Law::StVenantKirchhoff];
const DENSITY: f64 = 1000.0;

/// Π(C p): the same potential in the degrees of freedom of an enrichment.
struct InBasis<'a> {
    problem: StaticProblem<'a>,
    view: &'a EnrichedView,
}

impl InBasis<'_> {
    fn copies(&self, p: &[V]) -> Vec<V> {
        let mut q = p.to_vec();
        self.view.to_copies(&mut q);
        q
    }
}

impl Potential for InBasis<'_> {
    fn value(&mut self, team: &mut Team, p: &[V]) -> f64 {
        let q = self.copies(p);
        self.problem.value(team, &q)
    }

    fn gradient(&mut self, team: &mut Team, p: &[V], g: &mut [V]) -> f64 {
        let q = self.copies(p);
        let value = self.problem.gradient(team, &q, g);
        self.view.forces(g);
        value
    }

    fn pattern(&mut self) -> BlockCsr<f64> {
        self.view.matrix(&self.problem.pattern())
    }

    fn hessian(&mut self, team: &mut Team, p: &[V], curvature: Curvature, H: &mut BlockCsr<f64>) {
        let (q, mut K) = (self.copies(p), self.problem.pattern());
        self.problem.hessian(team, &q, curvature, &mut K);
        *H = self.view.matrix(&K);
    }

    fn loads(&mut self, loads: &mut [V]) {
        self.problem.loads(loads);
        self.view.forces(loads);
    }
}

/// A bar that stands on z = 0, of cells that no cut is aligned with.
fn bar(cells: [usize; 3]) -> TetMesh {
    let mut mesh = box_mesh(V::zeros(), V::new(0.04, 0.04, 0.1), cells, BoxPattern::Tet5 { parity: false });
    for X in &mut mesh.nodes {
        X.z += (0.17 * (X.y - 0.013) + 0.12 * (X.x - 0.008)) * (std::f64::consts::PI * X.z / 0.1).sin();
    }
    mesh
}

fn sweep(cut: &mut CutMesh, incision: u32, blades: [[V; 2]; 2]) {
    let x = cut.rest_positions();
    cut.sweep(&x, &BladeSweep { segments: blades.to_vec() }, incision).unwrap();
}

/// Cuts across from one side, down from the top, and a branch out of the first: nodes of up to four
/// copies.
fn much_cut() -> CutMesh {
    let mut cut = CutMesh::new(bar([4, 4, 9])).unwrap();
    let v = V::new;
    let across = |x: f64| [v(x, -0.01, 0.052), v(x, 0.05, 0.049)];
    sweep(&mut cut, 1, [across(-0.01), across(0.029)]);
    let down = |z: f64| [v(-0.01, 0.021, z), v(0.05, 0.019, z)];
    sweep(&mut cut, 2, [down(0.11), down(0.03)]);
    let branch = |x: f64, z: f64| [v(x, -0.01, z), v(x, 0.05, z)];
    sweep(&mut cut, 3, [branch(-0.01, 0.071), branch(0.026, 0.05)]);
    cut
}

/// Sideways gravity.
fn load(model: &Model) -> Vec<V> {
    model.shape_integrals().iter().map(|volume| V::new(DENSITY * 9.81 * volume, 0.0, 0.0)).collect()
}

#[test]
fn all_bases_give_the_same_displacements() {
    let cut = much_cut();
    let most = cut.copy_node().iter().map(|n| cut.copy_node().iter().filter(|m| *m == n).count()).max();
    for law in LAWS {
        let model = Model::tet4_cut(&cut, &material(2e4, 0.3, DENSITY, law), Volumetric::Full).unwrap();
        let load = load(&model);
        let fixed = clamped(&model, |X| X.z < 1e-9);
        let linear = LinearSettings {
            method: Method::Pcg,
            precision: Precision::Double,
            iterations: 20_000,
            tolerance: 1e-8,
        };
        let settings =
            NewtonSettings { steps: 60, tolerance: 1e-11, halvings: 12, curvature: Curvature::Exact, linear };
        let solve = |potential: &mut dyn Potential, fixed: &[FixedCopy], start: &[V]| {
            let (mut x, mut newton) = (start.to_vec(), Newton::new(settings));
            let report = newton.minimise(&mut Team::new(1).unwrap(), potential, &mut x, fixed);
            assert_eq!(report.stop, StopReason::Converged, "{law:?}: {report:?}");
            (x, report)
        };
        let (reference, report) = solve(&mut StaticProblem::new(&model, &load), &fixed, model.rest());
        let largest = reference.iter().zip(model.rest()).map(|(x, X)| (x - X).norm()).fold(0.0, f64::max);
        println!(
            "{law:?}, {} copies of {} nodes, at most {most:?}: moves by {largest:.4} m; on copies {} Newton \
             steps, {} iterations",
            cut.n_copies(),
            cut.mesh().nodes.len(),
            report.steps,
            report.linear_iterations
        );
        assert!(largest > 0.005);
        for enrichment in Enrichment::ALL {
            let view = EnrichedView::new(&cut, enrichment);
            let mut start = model.rest().to_vec();
            view.from_copies(&mut start);
            let fixed = view.fixed(&fixed).unwrap();
            let mut problem = InBasis { problem: StaticProblem::new(&model, &load), view: &view };
            let (mut x, report) = solve(&mut problem, &fixed, &start);
            view.to_copies(&mut x);
            let error = x.iter().zip(&reference).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max) / largest;
            println!(
                "  {enrichment:?}: off by {error:.1e}, {} Newton steps, {} iterations",
                report.steps, report.linear_iterations
            );
            assert!(error < 1e-7, "{law:?} {enrichment:?}: {error}");
        }
    }
}

/// Forces and stiffness of every element with two pieces, as the papers have them, against those of its
/// pieces on their copies.
#[test]
fn enriched_elements_of_the_papers_are_pieces_on_copies() {
    let v = V::new;
    let corners = [v(0.0, 0.0, 0.0), v(0.1, 0.01, 0.0), v(0.02, 0.11, 0.01), v(0.03, 0.02, 0.09)];
    for height in [0.02, 0.03, 0.05, 0.08] {
        let mesh = TetMesh { nodes: corners.to_vec(), tets: vec![[0, 1, 2, 3]] };
        let mut cut = CutMesh::new(mesh).unwrap();
        let blade = |x: f64| [v(x, -0.2, height - 0.06), v(x, 0.3, height + 0.05)];
        sweep(&mut cut, 1, [blade(-0.2), blade(0.3)]);
        assert_eq!(cut.pieces().len(), 2);
        // Above the plane z = height − 0.06 + 0.22 (y + 0.2).
        let sides =
            corners.map(|X| if X.z > height - 0.06 + 0.22 * (X.y + 0.2) { Side::Right } else { Side::Left });
        let own = |a: usize| a as u32;
        let above = cut
            .pieces()
            .iter()
            .find(|p| (0..4).all(|a| (p.copies[a] == own(a)) == (sides[a] == Side::Right)));
        let above = above.unwrap().fraction;
        for law in LAWS {
            let material = material(2e4, 0.3, DENSITY, law);
            let model = Model::tet4_cut(&cut, &material, Volumetric::Full).unwrap();
            let tet = EnrichedTet::new(&corners, material.lame(), sides, above).unwrap();
            for enrichment in [Enrichment::Heaviside, Enrichment::ShiftedHeaviside, Enrichment::OwnSide] {
                let opposite = |copy: u32| match sides[cut.copy_node()[copy as usize] as usize] {
                    Side::Left => Side::Right,
                    Side::Right => Side::Left,
                };
                let view = EnrichedView::oriented(cut.copy_node(), enrichment, opposite);
                let wave = |k: usize| 0.012 * V::from_fn(|r, _| ((7 * k + 3 * r) as f64 * 1.7).sin());
                let q = UA { u: std::array::from_fn(wave), a: std::array::from_fn(|i| wave(i + 4)) };
                // The added copy of every node.
                let added: [usize; 4] =
                    std::array::from_fn(|i| (4..8).find(|&c| cut.copy_node()[c] == i as u32).unwrap());
                let mut x = vec![V::zeros(); 8];
                for i in 0..4 {
                    (x[i], x[added[i]]) = (corners[i] + q.u[i], q.a[i]);
                }
                view.to_copies(&mut x);
                let mut f = vec![V::zeros(); 8];
                model.internal_forces(&x, &mut f);
                view.forces(&mut f);
                let expected = tet.forces(enrichment, law, &q);
                let scale = f.iter().map(V::norm).fold(0.0, f64::max);
                let mut K = model.pattern();
                model.tangent(
                    &x,
                    if law == Law::Corotational { Tangent::Held } else { Tangent::Exact },
                    &mut K,
                );
                let (K, J) = (view.matrix(&K), tet.tangent(enrichment, law, &q));
                let stiff = K.blocks.iter().flatten().fold(0.0_f64, |m, k| m.max(k.abs()));
                for i in 0..4 {
                    let error = (f[i] - expected.u[i]).norm() + (f[added[i]] - expected.a[i]).norm();
                    assert!(error < 1e-10 * scale, "{law:?} {enrichment:?}: force off by {error}");
                    for j in 0..4 {
                        let (a_i, a_j) = (added[i], added[j]);
                        for (found, expected) in [
                            (K.block(i, j as u32), J.uu[i][j]),
                            (K.block(i, a_j as u32), J.ua[i][j]),
                            (K.block(a_i, j as u32), J.au[i][j]),
                            (K.block(a_i, a_j as u32), J.aa[i][j]),
                        ] {
                            assert!((found - expected).norm() < 1e-10 * stiff, "{law:?} {enrichment:?}");
                        }
                    }
                }
            }
        }
    }
}

/// The masses of the copies seen in u and a: a block [[m_r + m_v, m_v], [m_v, m_v]] for every node with one
/// added copy in the shifted basis, and the mass of the body in every basis, lumped or consistent.
#[test]
fn masses_of_copies_are_two_by_two_blocks() {
    let cut = much_cut();
    let material = material(2e4, 0.3, DENSITY, Law::Linear);
    let model = Model::tet4_cut(&cut, &material, Volumetric::Full).unwrap();
    let m = model.lumped_mass(DENSITY);
    let total: f64 = m.iter().sum();
    let (mut lumped, mut consistent) = (model.pattern(), model.pattern());
    lumped.add_diagonal(1.0, &m);
    model.consistent_mass(DENSITY, &mut consistent);
    for enrichment in Enrichment::ALL {
        let view = EnrichedView::new(&cut, enrichment);
        let mut rigid = vec![V::x(); cut.n_copies()];
        view.from_copies(&mut rigid);
        for M in [&lumped, &consistent] {
            assert!((view.matrix(M).bilinear(&rigid, &rigid) / total - 1.0).abs() < 1e-12);
        }
    }
    let view = EnrichedView::new(&cut, Enrichment::ShiftedHeaviside);
    let M = view.matrix(&lumped);
    let mut checked = 0;
    for node in 0..cut.mesh().nodes.len() as u32 {
        let copies: Vec<u32> =
            (0..cut.n_copies() as u32).filter(|&c| cut.copy_node()[c as usize] == node).collect();
        let [real, added] = copies[..] else { continue };
        let (m_r, m_v) = (m[real as usize], m[added as usize]);
        for (row, column, expected) in
            [(real, real, m_r + m_v), (real, added, m_v), (added, real, m_v), (added, added, m_v)]
        {
            let off = M.block(row as usize, column) - Matrix3::from_diagonal_element(expected);
            assert!(off.norm() < 1e-15 * total);
        }
        checked += 1;
    }
    assert!(checked > 10, "{checked}");
}

/// On copies block-Jacobi leaves nothing of the slivers. The shifted enrichment costs about twice the
/// iterations; in that by H the two functions of a node become the same one with the sliver, which no
/// diagonal scaling can mend. Without preconditioner all suffer.
#[test]
fn conditioning_differs_between_the_bases() {
    let bases = [Enrichment::Substitution, Enrichment::ShiftedHeaviside, Enrichment::Heaviside];
    let mut scaled = Vec::new();
    for fraction in [1e-1, 1e-3, 1e-6, 1e-9] {
        let row = bases.map(|enrichment| {
            let small = System::new(4, fraction, enrichment).unwrap();
            let [plain, scaled] = condition_numbers(&small.K, &small.fixed);
            let system = System::new(6, fraction, enrichment).unwrap();
            let [cg, pcg] = [Method::Cg, Method::Pcg].map(|method| system.solve(method).unwrap().1);
            println!(
                "{enrichment:?}, slivers of {fraction:e}: condition {plain:.1e}, with block-Jacobi {scaled:.1e}; \
                 iterations {cg} and {pcg}"
            );
            (scaled, pcg)
        });
        scaled.push(row);
    }
    let (first, last) = (scaled[0], scaled[3]);
    let (copies, shifted, heaviside) = (0, 1, 2);
    assert!(last[copies].0 < 1.5 * first[copies].0 && last[copies].1 < first[copies].1 * 3 / 2);
    for row in &scaled {
        assert!(row[shifted].1 > row[copies].1);
    }
    assert!(last[heaviside].0 > 1e5 * last[copies].0);
}
