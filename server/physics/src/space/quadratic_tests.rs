//! Cut quadratic tetrahedra against exact solutions.

use std::sync::Arc;

use nalgebra::{Matrix3, Vector3};
use scindo_algebra::assembly::{Model, Volumetric};
use scindo_algebra::solver::{
    Curvature, LinearSettings, LinearSolver, Method, Newton, NewtonSettings, Precision, StopReason,
};
use scindo_matter::cut::BladeSweep;
use scindo_matter::element::quadrature::tet_degree_5;
use scindo_matter::element::tet10;
use scindo_matter::element::{FixedCopy, Held};
use scindo_matter::material::{Law, Material, Rayleigh};
use scindo_matter::mesh::{BoxPattern, box_mesh};
use scindo_matter::team::Team;

use super::{Space, Tets};
use crate::integrator::{StaticProblem, find_equilibrium};

/// A plane through a block, tilted against all its axes.
const NORMAL: Vector3<f64> = Vector3::new(0.21, 0.34, 1.0);
const THROUGH: Vector3<f64> = Vector3::new(0.5, 0.5, 0.47);

fn height(X: &Vector3<f64>) -> f64 {
    NORMAL.dot(&(X - THROUGH))
}

/// A unit cube of `cells`³ cubes, cut along the plane from x = −0.1 to `end`.
fn block(cells: usize, end: f64) -> Tets {
    let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(1.0), [cells; 3], BoxPattern::Tet6);
    let mut tets = Tets::quadratic(mesh).unwrap();
    let on_plane = |x: f64, y: f64| {
        let at = Vector3::new(x, y, 0.0);
        at + Vector3::z() * -height(&at) / NORMAL.z
    };
    let blade = |x: f64| [on_plane(x, -0.1), on_plane(x, 1.1)];
    let sweep = BladeSweep { segments: vec![blade(-0.1), blade(end)] };
    let x = tets.rest_positions();
    let report = tets.cut(&mut Team::alone(), &x, &sweep, 1).unwrap();
    assert!(report.elements_cut > 0 && report.new_copies.len() > 2 * report.elements_cut / 3);
    tets
}

fn material(law: Law) -> Material {
    let rayleigh = Rayleigh { mass_1_s: 0.0, stiffness_s: 0.0 };
    Material { young_pa: 2.5, poisson: 0.3, density_kg_m3: 1.0, rayleigh, law }
}

fn is_on_skin(X: &Vector3<f64>) -> bool {
    X.iter().any(|c| *c < 1e-9 || *c > 1.0 - 1e-9)
}

/// For every number, whether it belongs to material above the plane.
fn sides(tets: &Tets, model: &Model) -> Vec<bool> {
    let mut above = vec![false; model.n_nodes()];
    for p in 0..model.n_elements() {
        let mut mean = 0.0;
        let corners = tets.mesh().corners(tets.pieces()[p].element as usize);
        for (barycentric, part) in tets.cut.piece_fragments(p) {
            let heights = barycentric.map(|w| corners.iter().zip(w).map(|(X, w)| w * height(X)).sum::<f64>());
            mean += part * heights.iter().sum::<f64>();
        }
        if mean > 0.0 {
            model.element(p).iter().for_each(|&n| above[n as usize] = true);
        }
    }
    above
}

/// Uniaxial stress along a cut needs no traction on its lips: cut or not, the deformation is the same everywhere.
#[test]
fn stress_along_a_cut_passes_the_patch_test() {
    let n = NORMAL.normalize();
    let t = n.cross(&Vector3::new(0.3, -1.0, 0.2)).normalize();
    let turn = nalgebra::Rotation3::from_scaled_axis(Vector3::new(0.3, -0.5, 0.4)).into_inner();
    for (law, end) in [Law::Linear, Law::Corotational, Law::StVenantKirchhoff]
        .into_iter()
        .flat_map(|law| [(law, 1.1), (law, 0.55)])
    {
        let material = material(law);
        let strain =
            0.2 * ((1.0 + material.poisson) * t * t.transpose() - material.poisson * Matrix3::identity());
        let F = match law {
            Law::Linear => Matrix3::identity() + strain,
            Law::Corotational => turn * (Matrix3::identity() + strain),
            // E is the same strain, so the stretches are √(1 + 2E).
            _ => {
                let [along, across] = [0.2, -0.2 * material.poisson].map(|E: f64| (1.0 + 2.0 * E).sqrt());
                turn * (across * Matrix3::identity() + (along - across) * t * t.transpose())
            }
        };
        let tets = block(3, end);
        let model = tets.model(&material, Volumetric::Full).unwrap();
        let exact: Vec<Vector3<f64>> = model.rest().iter().map(|X| F * X).collect();
        let held = |(n, X): (u32, &Vector3<f64>)| {
            let position_m = exact[n as usize].into();
            is_on_skin(X).then_some(FixedCopy { copy: n, held: Held::FULLY, position_m })
        };
        let fixed: Vec<FixedCopy> = (0..).zip(model.rest()).filter_map(held).collect();
        let mut x = exact.clone();
        for (x, k) in x.iter_mut().zip(0..) {
            *x += 0.01 * Vector3::from_fn(|axis, _| f64::sin(f64::from(7 * k + axis as u32)));
        }
        fixed.iter().for_each(|f| x[f.copy as usize] = f.position_m.into());
        let linear = LinearSettings {
            method: Method::Cholesky,
            precision: Precision::Double,
            iterations: 20,
            tolerance: 1e-12,
        };
        let settings = NewtonSettings {
            tolerance: 1e-11,
            curvature: Curvature::Exact,
            linear,
            ..NewtonSettings::default()
        };
        let load = vec![Vector3::zeros(); x.len()];
        let mut problem = StaticProblem::new(&model, &load);
        let (mut newton, mut team) = (Newton::new(settings), Team::new(1).unwrap());
        let report = find_equilibrium(&mut newton, &mut team, &mut problem, &fixed, &mut x);
        let wrong = x.iter().zip(&exact).map(|(x, exact)| (x - exact).norm()).fold(0.0, f64::max);
        assert!(wrong < 1e-8, "{law:?} to {end}: {wrong} m, {report:?}");
        assert!(fixed.len() < x.len() && tets.n_pieces() > tets.n_elements());
    }
}

/// A displacement u = a sin(k·X + φ) of linear material.
struct Wave {
    a: Vector3<f64>,
    k: Vector3<f64>,
    phase: f64,
}

impl Wave {
    fn at(&self, X: &Vector3<f64>) -> Vector3<f64> {
        self.a * (self.k.dot(X) + self.phase).sin()
    }

    fn gradient(&self, X: &Vector3<f64>) -> Matrix3<f64> {
        self.a * self.k.transpose() * (self.k.dot(X) + self.phase).cos()
    }

    /// −div σ [N/m³].
    fn body_force(&self, X: &Vector3<f64>, mu: f64, lambda: f64) -> Vector3<f64> {
        let across = mu * self.k.norm_squared() * self.a + (lambda + mu) * self.k.dot(&self.a) * self.k;
        across * (self.k.dot(X) + self.phase).sin()
    }
}

const BELOW: Wave = Wave { a: Vector3::new(0.1, -0.06, 0.08), k: Vector3::new(1.3, 0.7, -1.1), phase: 0.4 };
const ABOVE: Wave = Wave { a: Vector3::new(-0.05, 0.09, 0.04), k: Vector3::new(-0.6, 1.5, 0.9), phase: 1.9 };

/// Error of the solution [m] in the L² norm, its iterations with block-Jacobi, and how many numbers there are, on
/// a block whose two parts move apart by different waves.
fn error_of_waves(cells: usize) -> (f64, u32, usize) {
    let material = material(Law::Linear);
    let (mu, lambda) = (material.lame().mu, material.lame().lambda);
    let tets = block(cells, 1.1);
    let model = tets.model(&material, Volumetric::Full).unwrap();
    let above = sides(&tets, &model);
    let wave = |above: bool| if above { &ABOVE } else { &BELOW };
    let displaced = |n: usize| model.rest()[n] + wave(above[n]).at(&model.rest()[n]);
    // Copies on the other side of the cut carry a part of the skin too: they are held at the smooth continuation.
    let held = |(n, X): (u32, &Vector3<f64>)| {
        let position_m = displaced(n as usize).into();
        is_on_skin(X).then_some(FixedCopy { copy: n, held: Held::FULLY, position_m })
    };
    let fixed: Vec<FixedCopy> = (0..).zip(model.rest()).filter_map(held).collect();
    let mut load = vec![Vector3::zeros(); model.n_nodes()];
    for_material(&tets, &mut |p, xi, X, volume| {
        let side = above[model.element(p)[0] as usize];
        let f = volume * wave(side).body_force(&X, mu, lambda);
        model.element(p).iter().zip(tet10::shape(&xi)).for_each(|(&n, N)| load[n as usize] += N * f);
    });
    for_lips(&tets, &mut |p, xi, X, dA| {
        let side = above[model.element(p)[0] as usize];
        let gradient = wave(side).gradient(&X);
        let strain = 0.5 * (gradient + gradient.transpose());
        let f = (2.0 * mu * strain + lambda * strain.trace() * Matrix3::identity()) * dA;
        model.element(p).iter().zip(tet10::shape(&xi)).for_each(|(&n, N)| load[n as usize] += N * f);
    });
    let mut K = model.pattern();
    model.tangent(model.rest(), scindo_matter::material::Tangent::Exact, &mut K);
    let mut u = vec![Vector3::zeros(); model.n_nodes()];
    fixed
        .iter()
        .for_each(|f| u[f.copy as usize] = Vector3::from(f.position_m) - model.rest()[f.copy as usize]);
    let solve = |method, u: &mut Vec<Vector3<f64>>| {
        let (precision, iterations) = (Precision::Double, 20_000);
        let mut solver =
            LinearSolver::new(LinearSettings { method, precision, iterations, tolerance: 1e-10 });
        solver.set_stiff_modes(tets.stiff_modes().map(Arc::new));
        solver.set_matrix(&K, &fixed);
        let report = solver.solve(&mut Team::new(1).unwrap(), &K, &load, u, None);
        assert_eq!(report.stop, StopReason::Converged, "{report:?}");
        report.iterations
    };
    let iterations = solve(Method::Pcg, &mut u);
    let mut squared = 0.0;
    for_material(&tets, &mut |p, xi, X, volume| {
        let nodes = model.element(p);
        let found: Vector3<f64> = nodes.iter().zip(tet10::shape(&xi)).map(|(&n, N)| N * u[n as usize]).sum();
        squared += volume * (found - wave(above[nodes[0] as usize]).at(&X)).norm_squared();
    });
    (squared.sqrt(), iterations, model.n_nodes())
}

/// Calls `visit` with piece, reference coordinates, place [m] and volume [m³] of points that fill the material.
fn for_material(tets: &Tets, visit: &mut dyn FnMut(usize, Vector3<f64>, Vector3<f64>, f64)) {
    for p in 0..tets.n_pieces() {
        let e = tets.pieces()[p].element as usize;
        let corners = tets.mesh().corners(e);
        for (barycentric, part) in tets.cut.piece_fragments(p) {
            for (xi, w) in tet_degree_5() {
                let L = [1.0 - xi.x - xi.y - xi.z, xi.x, xi.y, xi.z];
                let at: [f64; 4] = std::array::from_fn(|a| (0..4).map(|v| L[v] * barycentric[v][a]).sum());
                let X = corners.iter().zip(at).map(|(X, w)| w * X).sum();
                visit(p, Vector3::new(at[1], at[2], at[3]), X, w * part * tets.mesh().volume(e));
            }
        }
    }
}

/// Calls `visit` with piece, reference coordinates, place [m] and outward area [m²] of points on the lips of cuts.
fn for_lips(tets: &Tets, visit: &mut dyn FnMut(usize, Vector3<f64>, Vector3<f64>, Vector3<f64>)) {
    for p in 0..tets.n_pieces() {
        let corners = tets.mesh().corners(tets.pieces()[p].element as usize);
        let place = |at: &[f64; 4]| corners.iter().zip(at).map(|(X, w)| *w * X).sum::<Vector3<f64>>();
        for triangle in tets.cut.lip_fragments(p) {
            let X = triangle.each_ref().map(place);
            let area = 0.5 * (X[1] - X[0]).cross(&(X[2] - X[0]));
            // Six points, exact to degree 4 (Strang, Fix 1973).
            for (a, w) in [
                (0.445_948_490_915_965, 0.223_381_589_678_011),
                (0.091_576_213_509_771, 0.109_951_743_655_322),
            ] {
                for k in 0..3 {
                    let L: [f64; 3] = std::array::from_fn(|v| if v == k { 1.0 - 2.0 * a } else { a });
                    let at: [f64; 4] = std::array::from_fn(|n| (0..3).map(|v| L[v] * triangle[v][n]).sum());
                    visit(p, Vector3::new(at[1], at[2], at[3]), place(&at), w * area);
                }
            }
        }
    }
}

#[test]
fn the_error_falls_with_the_third_power_of_the_element_size() {
    let found = [2, 4, 8].map(error_of_waves);
    let order = (found[1].0 / found[2].0).log2();
    assert!(order > 2.8, "{order}: error, iterations and numbers {found:?}");
    assert!(found[2].1 < 400, "{found:?}");
}

/// Iterations of block-Jacobi CG for the weight of a block that stands on its base, cut by a plane of this normal
/// through this place.
fn iterations(cells: usize, normal: &Vector3<f64>, through: &Vector3<f64>) -> u32 {
    let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(1.0), [cells; 3], BoxPattern::Tet6);
    let mut tets = Tets::quadratic(mesh).unwrap();
    let on_plane = |x: f64, y: f64| {
        let at = Vector3::new(x, y, 0.0);
        at + Vector3::z() * (normal.dot(&(through - at)) / normal.z)
    };
    let blade = |x: f64| [on_plane(x, -0.1), on_plane(x, 1.1)];
    let x = tets.rest_positions();
    // Not through the last cells, so that the block stays whole.
    tets.cut(&mut Team::alone(), &x, &BladeSweep { segments: vec![blade(-0.1), blade(0.7)] }, 1).unwrap();
    let model = tets.model(&material(Law::Linear), Volumetric::Full).unwrap();
    let held = |(n, X): (u32, &Vector3<f64>)| {
        (X.z == 0.0).then_some(FixedCopy { copy: n, held: Held::FULLY, position_m: (*X).into() })
    };
    let fixed: Vec<FixedCopy> = (0..).zip(model.rest()).filter_map(held).collect();
    let load: Vec<Vector3<f64>> = model.shape_integrals().iter().map(|v| -*v * Vector3::z()).collect();
    let mut K = model.pattern();
    model.tangent(model.rest(), scindo_matter::material::Tangent::Exact, &mut K);
    let (method, precision) = (Method::Pcg, Precision::Mixed);
    let settings = LinearSettings { method, precision, iterations: 20_000, tolerance: 1e-8 };
    let mut solver = LinearSolver::new(settings);
    solver.set_stiff_modes(tets.stiff_modes().map(Arc::new));
    solver.set_matrix(&K, &fixed);
    let mut u = vec![Vector3::zeros(); load.len()];
    let report = solver.solve(&mut Team::new(1).unwrap(), &K, &load, &mut u, None);
    assert!(report.iterations == 20_000 || report.stop == StopReason::Converged, "{report:?}");
    report.iterations
}

/// However thin the pieces are, the solution costs as many iterations.
#[test]
fn thin_pieces_cost_no_iterations() {
    let uncut = iterations(4, &Vector3::z(), &Vector3::new(0.5, 0.5, 1.5));
    // Along a layer of nodes, along edges of one, across it, and across all edges.
    let normals = [[0.0, 0.0], [0.3, 0.0], [1.0, 0.01], [0.21, 0.34]];
    for [x, y] in normals {
        let mut counts = Vec::new();
        for thickness in [1e-1_f64, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10, 1e-12] {
            let through = Vector3::new(0.5, 0.5, 0.5 + 0.25 * thickness);
            let normal = Vector3::new(x, y * thickness.max(0.01), 1.0);
            counts.push(iterations(4, &normal, &through));
        }
        assert!(counts.iter().all(|&n| n < 3 * uncut), "{x} {y}: {counts:?}, uncut {uncut}");
    }
}
