//! Springs between two material points: of two bodies, or of one.

use nalgebra::Vector3;
use smallvec::SmallVec;

use super::springs::{SpringKind, SpringLaw};
use crate::element::MaterialPoint;

/// A spring between a point and a triangle of points, on two bodies or on one.
///
/// Its law is that of a [`PointSpring`](super::PointSpring) in the relative position y = x_a − Σ w_i x_i: the plane,
/// the target and the anchor of its kind are places of y. The force acts on the point, and its opposite on the
/// triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairSpring {
    /// Number of the point's body in the group, and of the triangle's.
    pub bodies: [u32; 2],
    /// The point.
    pub point: MaterialPoint,
    /// Corners of the triangle.
    pub corners: [MaterialPoint; 3],
    /// Barycentric coordinates w of the place on the triangle.
    pub barycentric: [f64; 3],
    /// Direction and rest position of y.
    pub kind: SpringKind,
    /// Stiffness k [N/m], ≥ 0.
    pub stiffness_n_m: f64,
    /// Largest force [N].
    pub max_force_n: f64,
}

impl PairSpring {
    /// y [m], with the positions of the nodes of each side's body.
    pub fn relative(&self, x: [&[Vector3<f64>]; 2]) -> Vector3<f64> {
        let corners = self.corners.iter().zip(self.barycentric);
        self.point.position(x[0]) - corners.map(|(corner, w)| w * corner.position(x[1])).sum::<Vector3<f64>>()
    }
}

/// One node that carries a pair spring, with its weight in y.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carrier {
    /// Number of its body in the group.
    pub body: u32,
    /// The node.
    pub copy: u32,
    /// Weight in y; negative on the triangle's side.
    pub weight: f64,
}

/// A pair spring in the course of one step.
#[derive(Clone, Debug)]
pub struct ActivePair {
    /// Nodes that carry it, each once.
    pub carriers: SmallVec<[Carrier; 16]>,
    /// Body and node with the largest weight on each side, which tell the parts.
    pub main: [(u32, u32); 2],
    /// Force, stiffness and mode by y.
    pub law: SpringLaw,
}

impl ActivePair {
    /// The spring on a group whose bodies have so many nodes; `None` if a number in it is unusable or a node does
    /// not exist.
    pub fn usable(spring: &PairSpring, nodes: impl Fn(u32) -> usize) -> Option<Self> {
        let law = SpringLaw::new(spring.kind, spring.stiffness_n_m, spring.max_force_n)?;
        let mut carriers: SmallVec<[Carrier; 16]> = SmallVec::new();
        let [a, b] = spring.bodies;
        let mut add = |body: u32, point: &MaterialPoint, share: f64| {
            for (&copy, w) in point.copies().iter().zip(point.weights()) {
                let weight = share * w;
                match carriers.iter_mut().find(|c| (c.body, c.copy) == (body, copy)) {
                    Some(known) => known.weight += weight,
                    None => carriers.push(Carrier { body, copy, weight }),
                }
            }
        };
        add(a, &spring.point, 1.0);
        for (corner, w) in spring.corners.iter().zip(spring.barycentric) {
            add(b, corner, -w);
        }
        let exists = |c: &Carrier| (c.copy as usize) < nodes(c.body) && c.weight.is_finite();
        let heaviest = spring.barycentric.iter().copied().enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?.0;
        let main = [(a, spring.point.main_copy()), (b, spring.corners[heaviest].main_copy())];
        carriers.iter().all(exists).then_some(Self { carriers, main, law })
    }
}
