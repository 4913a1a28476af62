//! Pressure on the deformed surface: −p n da, with n and da of the present configuration.
//!
//! The force on a node is f_a(x) = −p ∫ N_a n da. It depends on the positions and has the load stiffness ∂f/∂x. On a
//! closed surface it is −p ∂V/∂x of the enclosed volume V, so the load stiffness is symmetric. On a part of a surface
//! f differs from −p ∂V/∂x, where V is the volume between the part and a fixed point, by a term on its rim. Only this
//! term is not symmetric, and where the rim is held it does no work.
//!
//! # Source
//! Hibbitt 1979, "Some follower forces and load stiffness"; Schweizerhof, Ramm 1984, "Displacement dependent pressure
//! loads in nonlinear finite element analyses".

mod face;
mod follower;

pub use follower::Follower;

use nalgebra::Vector3;

use crate::assembly::BlockCsr;
use face::FacePoint;
use scindo_matter::element::MaterialPoint;

/// Triangles with pressures on them, bound to the nodes of a body.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct Pressure {
    /// Nodes of the triangles, one triangle after the other.
    points: Vec<MaterialPoint>,
    faces: Vec<Face>,
    /// Present pressure of every load [Pa].
    pascals: Vec<f64>,
}

/// A triangle under pressure.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
struct Face {
    /// First of its nodes in the list of points.
    first: u32,
    /// Whether it has six nodes, and not three.
    quadratic: bool,
    /// Part of the pressure that it carries: a quadrilateral consists of four triangles with half the pressure.
    part: f64,
    /// Number of its load.
    load: u32,
}

/// Does the same for every face under pressure: `$p` [Pa] is its pressure, `$N` its number of nodes and `$rule` the
/// quadrature points.
macro_rules! for_faces {
    ($self:ident, |$face:ident, $p:ident, $N:ident, $rule:ident| $body:block) => {
        // Without faces not even the rules are computed.
        let rules = (!$self.is_empty()).then(|| (face::linear(), face::quadratic()));
        for ($face, (linear, quadratic)) in $self.faces.iter().zip(rules.iter().cycle()) {
            let $p = $face.part * $self.pascals[$face.load as usize];
            if $p == 0.0 {
                continue;
            }
            if $face.quadratic {
                const $N: usize = 6;
                let $rule = &quadratic[..];
                $body
            } else {
                const $N: usize = 3;
                let $rule = &linear[..];
                $body
            }
        }
    };
}

impl Pressure {
    /// No pressure.
    pub fn none() -> &'static Self {
        static NONE: Pressure = Pressure { points: Vec::new(), faces: Vec::new(), pascals: Vec::new() };
        &NONE
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    /// Number of triangles that carry pressure.
    pub fn n_faces(&self) -> usize {
        self.faces.len()
    }

    /// Removes all faces and loads.
    pub fn clear(&mut self) {
        self.points.clear();
        self.faces.clear();
        self.pascals.clear();
    }

    /// Adds a load of `pascals` [Pa] without faces. Returns its number.
    pub fn add_load(&mut self, pascals: f64) -> u32 {
        self.pascals.push(pascals);
        self.pascals.len() as u32 - 1
    }

    /// Sets the present pressures [Pa], in the order of the loads.
    pub fn set_pascals(&mut self, pascals: impl Iterator<Item = f64>) {
        self.pascals.iter_mut().zip(pascals).for_each(|(now, next)| *now = next);
    }

    /// Adds a face to a load: a triangle (3 points), a bilinear quadrilateral (4, around it) or a quadratic triangle (6:
    /// corners, then the middles 01, 12, 20), counter-clockwise from outside. Other numbers of points are left out.
    ///
    /// The volume below a bilinear quadrilateral is the mean of those of its two divisions into triangles.
    pub fn add_face(&mut self, load: u32, points: &[MaterialPoint]) {
        let mut add = |points: &[MaterialPoint], part: f64| {
            let (first, quadratic) = (self.points.len() as u32, points.len() == 6);
            self.points.extend_from_slice(points);
            self.faces.push(Face { first, quadratic, part, load });
        };
        match *points {
            [a, b, c, d] => [[a, b, c], [a, c, d], [a, b, d], [b, c, d]].iter().for_each(|t| add(t, 0.5)),
            [_, _, _] | [_, _, _, _, _, _] => add(points, 1.0),
            _ => {}
        }
    }

    fn nodes<const N: usize>(&self, face: &Face) -> &[MaterialPoint] {
        &self.points[face.first as usize..face.first as usize + N]
    }

    fn positions<const N: usize>(&self, face: &Face, x: &[Vector3<f64>]) -> [Vector3<f64>; N] {
        let nodes = self.nodes::<N>(face);
        std::array::from_fn(|a| nodes[a].position(x))
    }

    fn scatter<const N: usize>(&self, face: &Face, values: &[Vector3<f64>; N], to: &mut [Vector3<f64>]) {
        for (point, value) in self.nodes::<N>(face).iter().zip(values) {
            point.carriers().for_each(|(c, w)| to[c] += w * value);
        }
    }

    /// Adds the force of the pressure on every node [N], with the nodes at `x` [m].
    pub fn add_forces(&self, x: &[Vector3<f64>], f: &mut [Vector3<f64>]) {
        for_faces!(self, |face, p, N, rule| {
            let (y, mut sum) = (self.positions::<N>(face, x), [Vector3::zeros(); N]);
            rule.iter().for_each(|point| point.add_flux(-p, &y, &mut sum));
            self.scatter(face, &sum, f);
        });
    }

    /// Work of the pressure [J] while the nodes go straight from `from` to `to` [m]. Exact: the force is quadratic in
    /// the positions, so Simpson's rule is.
    pub fn work(&self, from: &[Vector3<f64>], to: &[Vector3<f64>]) -> f64 {
        let mut work = 0.0;
        for_faces!(self, |face, p, N, rule| {
            let [y0, y1] = [from, to].map(|x| self.positions::<N>(face, x));
            let middle = std::array::from_fn(|a| 0.5 * (y0[a] + y1[a]));
            let d: [Vector3<f64>; N] = std::array::from_fn(|a| y1[a] - y0[a]);
            let swept = |y: &[Vector3<f64>; N]| rule.iter().map(|point| point.swept(y, &d)).sum::<f64>();
            work -= p * (swept(&y0) + 4.0 * swept(&middle) + swept(&y1)) / 6.0;
        });
        work
    }

    /// Σ p V [J], V the volume between a face and `apex` [m].
    pub fn potential(&self, x: &[Vector3<f64>], apex: &Vector3<f64>) -> f64 {
        let mut potential = 0.0;
        for_faces!(self, |face, p, N, rule| {
            let y = self.positions::<N>(face, x).map(|y| y - apex);
            potential += p * rule.iter().map(|point: &FacePoint<N>| point.volume(&y)).sum::<f64>();
        });
        potential
    }

    /// Adds the gradient of [`potential`](Self::potential) [N].
    pub fn add_gradient(&self, x: &[Vector3<f64>], apex: &Vector3<f64>, g: &mut [Vector3<f64>]) {
        for_faces!(self, |face, p, N, rule| {
            let y = self.positions::<N>(face, x).map(|y| y - apex);
            let mut sum = [Vector3::zeros(); N];
            rule.iter().for_each(|point| point.add_gradient(p, &y, &mut sum));
            self.scatter(face, &sum, g);
        });
    }

    /// Adds the second derivative of [`potential`](Self::potential) [N/m] to a matrix with the pattern of the body.
    fn add_hessian(&self, x: &[Vector3<f64>], apex: &Vector3<f64>, H: &mut BlockCsr<f64>) {
        for_faces!(self, |face, p, N, rule| {
            let y = self.positions::<N>(face, x).map(|y| y - apex);
            let nodes = self.nodes::<N>(face);
            for (a, b) in (0..N).flat_map(|a| (0..N).map(move |b| (a, b))).filter(|(a, b)| a != b) {
                let block: nalgebra::Matrix3<f64> =
                    rule.iter().map(|point| point.hessian(p, &y, (a, b))).sum();
                for (c, w) in nodes[a].carriers() {
                    for (d, v) in nodes[b].carriers() {
                        // All nodes of a face belong to one element, so the pattern has their blocks.
                        let Some(at) = H.position(c, d as u32) else { continue };
                        let entries = H.blocks[at].iter_mut().enumerate();
                        entries.for_each(|(e, h)| *h += w * v * block[(e / 3, e % 3)]);
                    }
                }
            }
        });
    }

    /// Mean of the nodes of all faces [m].
    fn centre(&self, x: &[Vector3<f64>]) -> Vector3<f64> {
        let sum: Vector3<f64> = self.points.iter().map(|point| point.position(x)).sum();
        sum / self.points.len().max(1) as f64
    }
}
