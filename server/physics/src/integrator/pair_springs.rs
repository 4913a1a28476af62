//! Springs between two material points: of two bodies, or of one.

use nalgebra::{Matrix3, Vector3};
use scindo_algebra::operator::{Padded, padded};
use scindo_matter::element::MaterialPoint;
use smallvec::SmallVec;

use super::springs::{SpringKind, SpringLaw};

/// A spring between a point and a triangle of points, on two bodies or on one.
///
/// Its law is that of a [`PointSpring`](super::PointSpring) in the relative position y = x_a − Σ w_i x_i: the plane,
/// the target and the anchor of its kind are places of y. The force acts on the point, and its opposite on the
/// triangle.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PairSpring {
    /// Number of the point's body in the group, and of the triangle's.
    pub bodies: [u32; 2],
    /// The material point that it pulls at.
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
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Carrier {
    /// Number of its body in the group.
    pub body: u32,
    /// The node.
    pub copy: u32,
    /// Weight in y; negative on the triangle's side.
    pub weight: f64,
}

/// A pair spring in the course of one step.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct ActivePair {
    /// Nodes that carry it, each once.
    pub carriers: SmallVec<[Carrier; 16]>,
    /// Body and node with the largest weight on each side, which tell the parts.
    pub main: [(u32, u32); 2],
    /// y with the present positions [m].
    pub y: Vector3<f64>,
    /// Force, stiffness and mode by y.
    pub law: SpringLaw,
}

impl ActivePair {
    /// The spring on a group whose bodies have so many nodes; `None` if a number in it is unusable or a node does
    /// not exist.
    pub(super) fn usable(spring: &PairSpring, nodes: impl Fn(u32) -> usize) -> Option<Self> {
        let law = SpringLaw::new(spring.kind, spring.stiffness_n_m, spring.max_force_n)?;
        let mut carriers: SmallVec<[Carrier; 16]> = SmallVec::new();
        let [a, b] = spring.bodies;
        let mut add = |body: u32, point: &MaterialPoint, share: f64| {
            // A place on an edge or at a corner of the triangle has no part of its other corners.
            for (&copy, w) in point.copies().iter().zip(point.weights()).filter(|_| share != 0.0) {
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
        carriers.iter().all(exists).then_some(Self { carriers, main, y: Vector3::zeros(), law })
    }
}

/// The products of pair springs with vectors, arranged for one linear solve. Springs without stiffness are left out.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct PairTerms {
    terms: Vec<PairTerm>,
    /// Nodes and weights of all terms, one after another.
    carriers: Vec<(u32, f32)>,
}

/// s k J Jᵀ of one spring.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
struct PairTerm {
    bodies: [u32; 2],
    /// Where the carriers on the first body end, and those on the second.
    ends: [u32; 2],
    /// Columns of s k.
    stiffness: [Padded; 3],
}

/// A term as a product needs it.
#[derive(Clone, Copy, Debug)]
pub(super) struct PairProduct<'a> {
    stiffness: &'a [Padded; 3],
    sides: [(u32, &'a [(u32, f32)]); 2],
}

impl<'a> PairProduct<'a> {
    /// J: the bodies, with their nodes and weights. A spring within one body has one side.
    #[inline]
    pub(super) fn sides(&self) -> impl Iterator<Item = (u32, &'a [(u32, f32)])> + use<'a> {
        self.sides.into_iter().filter(|side| !side.1.is_empty())
    }

    /// s k y.
    #[inline]
    pub(super) fn force(&self, y: &Padded) -> Padded {
        let [a, b, c] = self.stiffness;
        std::array::from_fn(|i| a[i] * y[0] + b[i] * y[1] + c[i] * y[2])
    }
}

impl PairTerms {
    /// Takes the springs in their present modes, with the factor `s` of each body's stiffness.
    pub(super) fn arrange(&mut self, pairs: &[ActivePair], s: impl Fn(u32) -> f64) {
        self.terms.clear();
        self.carriers.clear();
        for pair in pairs {
            let [a, b] = pair.main.map(|(body, _)| body);
            let stiffness = s(a) * pair.law.stiffness();
            if stiffness == Matrix3::zeros() {
                continue;
            }
            self.carriers.extend(pair.carriers.iter().map(|c| (c.copy, c.weight as f32)));
            let end = self.carriers.len();
            // The carriers on the first body come first.
            let second = pair.carriers.iter().filter(|c| c.body != a).count();
            let ends = [(end - second) as u32, end as u32];
            let stiffness = [0, 1, 2].map(|j| padded(&stiffness.column(j).into()));
            self.terms.push(PairTerm { bodies: [a, b], ends, stiffness });
        }
    }

    /// All terms, in the order of the springs.
    pub(super) fn iter(&self) -> impl Iterator<Item = PairProduct<'_>> {
        let mut start = 0;
        self.terms.iter().map(move |PairTerm { bodies, ends: [middle, end], stiffness }| {
            let (middle, end) = (*middle as usize, *end as usize);
            let sides = [&self.carriers[start..middle], &self.carriers[middle..end]];
            start = end;
            PairProduct { stiffness, sides: [(bodies[0], sides[0]), (bodies[1], sides[1])] }
        })
    }
}
