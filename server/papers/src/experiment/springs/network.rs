//! Masses and springs: the classical model of soft tissue, as a baseline.
//!
//! The nodes of a mesh are masses, the edges of its tetrahedra are springs. A step is implicit Euler's with the
//! stiffness at its beginning.
//!
//! # Source
//! Baraff, Witkin, Large steps in cloth simulation (1998); van Gelder, Approximate simulation of elastic membranes by
//! triangulated spring meshes (1998), for the stiffness of a spring.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};
use scindo_physics::mesh::TetMesh;

type V = Vector3<f64>;

/// A spring between two masses.
#[derive(Debug, Clone, Copy)]
struct Spring {
    ends: [u32; 2],
    /// Length at rest [m], and stiffness [N/m].
    rest_m: f64,
    k: f64,
    /// Direction from the first to the second end, stiffness along it and across it [N/m], and tension [N], of the
    /// present step.
    n: V,
    along: f64,
    across: f64,
    tension: f64,
}

/// Masses and springs on the nodes and edges of a mesh.
pub(super) struct Network {
    springs: Vec<Spring>,
    /// Masses [kg]; infinite where the node is held.
    mass: Vec<f64>,
    x: Vec<V>,
    v: Vec<V>,
    /// Viscosity: forces of damping are those of `beta_s` times the rate of the springs [s].
    beta_s: f64,
    solver: Cg,
}

/// Vectors of the conjugate gradients.
#[derive(Default)]
struct Cg {
    dv: Vec<V>,
    r: Vec<V>,
    z: Vec<V>,
    p: Vec<V>,
    q: Vec<V>,
    inverse: Vec<Matrix3<f64>>,
}

impl Network {
    /// The network of a mesh of a material with Young's modulus `young_pa` and this density; nodes for which `held` is
    /// true do not move. A spring has the stiffness E Σ V / L², over the tetrahedra around it.
    pub(super) fn new(
        mesh: &TetMesh,
        (young_pa, density_kg_m3): (f64, f64),
        beta_s: f64,
        held: impl Fn(&V) -> bool,
    ) -> Self {
        let x = mesh.nodes.clone();
        let mut mass = vec![0.0; x.len()];
        let mut volume_of: BTreeMap<[u32; 2], f64> = BTreeMap::new();
        for (e, tet) in mesh.tets.iter().enumerate() {
            let volume = mesh.volume(e);
            for (i, &n) in tet.iter().enumerate() {
                mass[n as usize] += 0.25 * density_kg_m3 * volume;
                for &m in &tet[i + 1..] {
                    *volume_of.entry([n.min(m), n.max(m)]).or_default() += volume;
                }
            }
        }
        let springs = volume_of.into_iter().map(|(ends, volume)| {
            let rest_m = (x[ends[1] as usize] - x[ends[0] as usize]).norm();
            let k = young_pa * volume / (rest_m * rest_m);
            Spring { ends, rest_m, k, n: V::zeros(), along: 0.0, across: 0.0, tension: 0.0 }
        });
        for (mass, x) in mass.iter_mut().zip(&x) {
            if held(x) {
                *mass = f64::INFINITY;
            }
        }
        let v = vec![V::zeros(); x.len()];
        Self { springs: springs.collect(), mass, x, v, beta_s, solver: Cg::default() }
    }

    /// Multiplies the stiffness of all springs.
    pub(super) fn scale(&mut self, factor: f64) {
        self.springs.iter_mut().for_each(|spring| spring.k *= factor);
    }

    /// Places of the masses [m].
    pub(super) fn positions(&self) -> &[V] {
        &self.x
    }

    /// A step of `h` seconds under `gravity` [m/s²], with at most this many iterations of conjugate gradients, until the
    /// residual has fallen by `tolerance`. Returns how far a mass moved at most [m].
    pub(super) fn step(&mut self, h: f64, gravity: V, (iterations, tolerance): (u32, f64)) -> f64 {
        self.linearise();
        let Self { springs, mass, x, v, beta_s, solver } = self;
        // (M + (h² + h β) K) Δv = h (f + M g) − (h² + h β) K v
        let scale = h * h + h * *beta_s;
        solver.begin(x.len());
        product(springs, v, &mut solver.q);
        for ((r, q), m) in solver.r.iter_mut().zip(&solver.q).zip(&*mass) {
            *r = if m.is_finite() { h * *m * gravity - scale * q } else { V::zeros() };
        }
        for s in springs.iter() {
            let [a, b] = s.ends.map(|n| n as usize);
            let force = h * s.tension * s.n;
            solver.r[a] += force;
            solver.r[b] -= force;
        }
        solver.solve(springs, mass, scale, (iterations, tolerance));
        let mut farthest = 0.0f64;
        for ((x, v), dv) in x.iter_mut().zip(v.iter_mut()).zip(&solver.dv) {
            *v += dv;
            *x += h * *v;
            farthest = farthest.max(h * v.norm());
        }
        farthest
    }

    /// Directions, stiffnesses and tensions at the present places.
    fn linearise(&mut self) {
        for s in &mut self.springs {
            let d = self.x[s.ends[1] as usize] - self.x[s.ends[0] as usize];
            let length = d.norm();
            s.n = d / length;
            s.tension = s.k * (length - s.rest_m);
            s.along = s.k;
            // Of a spring that is pressed together this would be negative.
            s.across = (s.tension / length).max(0.0);
        }
    }
}

/// q = K p.
fn product(springs: &[Spring], p: &[V], q: &mut [V]) {
    q.fill(V::zeros());
    for s in springs {
        let [a, b] = s.ends.map(|n| n as usize);
        let d = p[b] - p[a];
        let f = s.across * d + ((s.along - s.across) * s.n.dot(&d)) * s.n;
        q[a] -= f;
        q[b] += f;
    }
}

impl Cg {
    fn begin(&mut self, n: usize) {
        for list in [&mut self.dv, &mut self.r, &mut self.z, &mut self.p, &mut self.q] {
            list.clear();
            list.resize(n, V::zeros());
        }
    }

    /// Conjugate gradients for (M + scale K) Δv = r, preconditioned with the blocks of the masses.
    fn solve(&mut self, springs: &[Spring], mass: &[f64], scale: f64, (iterations, tolerance): (u32, f64)) {
        let Self { dv, r, z, p, q, inverse } = self;
        inverse.clear();
        inverse.resize(mass.len(), Matrix3::zeros());
        for s in springs {
            let across = Matrix3::from_diagonal_element(s.across);
            let block = scale * (across + (s.along - s.across) * s.n * s.n.transpose());
            s.ends.iter().for_each(|&n| inverse[n as usize] += block);
        }
        for (block, m) in inverse.iter_mut().zip(mass) {
            let own = *block + Matrix3::from_diagonal_element(*m);
            // Of a node that is held, the inverse is zero.
            *block = if m.is_finite() { own.try_inverse().unwrap_or_default() } else { Matrix3::zeros() };
        }
        let apply = |z: &mut [V], r: &[V]| {
            z.iter_mut().zip(r).zip(inverse.iter()).for_each(|((z, r), block)| *z = block * r);
        };
        apply(z, r);
        p.copy_from_slice(z);
        let mut rz = dot(r, z);
        let wanted = tolerance * tolerance * rz;
        for _ in 0..iterations {
            if rz <= wanted {
                return;
            }
            product(springs, p, q);
            for ((q, p), m) in q.iter_mut().zip(p.iter()).zip(mass) {
                *q = if m.is_finite() { *m * p + scale * *q } else { V::zeros() };
            }
            let alpha = rz / dot(p, q);
            for ((dv, r), (p, q)) in dv.iter_mut().zip(r.iter_mut()).zip(p.iter().zip(q.iter())) {
                *dv += alpha * p;
                *r -= alpha * q;
            }
            apply(z, r);
            let next = dot(r, z);
            p.iter_mut().zip(z.iter()).for_each(|(p, z)| *p = z + (next / rz) * *p);
            rz = next;
        }
    }
}

fn dot(a: &[V], b: &[V]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use scindo_physics::mesh::{BoxPattern, box_mesh};

    /// Where no mass moves any more, the springs carry the weight.
    #[test]
    fn springs_carry_the_weight() {
        let mesh = box_mesh(V::zeros(), V::repeat(0.1), [2; 3], BoxPattern::Tet5 { parity: false });
        let mut network = Network::new(&mesh, (1e5, 1e3), 0.01, |X| X.z < 1e-9);
        let gravity = V::new(0.0, 0.0, -9.81);
        let moved = (0..500).map(|_| network.step(0.02, gravity, (200, 1e-9))).last();
        assert!(moved.is_some_and(|moved| moved < 1e-9), "{moved:?}");
        network.linearise();
        let mut carried = 0.0;
        for s in &network.springs {
            let [low, high] = s.ends.map(|n| mesh.nodes[n as usize].z < 1e-9);
            if low != high {
                carried += s.tension * s.n.z * if low { -1.0 } else { 1.0 };
            }
        }
        let hanging: f64 = network.mass.iter().filter(|m| m.is_finite()).sum();
        assert!((carried / (hanging * 9.81) - 1.0).abs() < 1e-6, "{carried} of {}", hanging * 9.81);
    }
}
