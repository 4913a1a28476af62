//! Springs between material points and the world: contacts, grabs, tools.

use nalgebra::{Matrix3, Vector3};

use crate::element::MaterialPoint;
use crate::operator::Spring;

/// A spring on a material point x_p.
///
/// ```
/// # use nalgebra::Vector3;
/// # use scindo_physics::body::{Body, BodySettings};
/// # use scindo_physics::material::{Law, Material, Rayleigh};
/// # use scindo_physics::mesh::{BoxPattern, box_mesh};
/// use scindo_physics::body::{PointSpring, SpringKind};
/// use scindo_physics::element::MaterialPoint;
///
/// # let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(0.1), [2; 3], BoxPattern::Tet6);
/// # let (law, rayleigh) = (Law::Corotational, Rayleigh::default());
/// # let material = Material { young_pa: 1e4, poisson: 0.4, density_kg_m3: 1e3, rayleigh, law };
/// # let mut body = Body::new(mesh, material, BodySettings::default())?;
/// // Pulls the centre of one tetrahedron 1 cm upwards.
/// let point = MaterialPoint::in_tet(body.tets().unwrap().pieces()[0].copies, [0.25; 4]);
/// let above = point.position(body.positions()) + Vector3::new(0.0, 0.0, 0.01);
/// let pull = PointSpring {
///     point,
///     kind: SpringKind::Hold { target_m: above },
///     stiffness_n_m: 100.0,
///     max_force_n: 2.0,
/// };
/// body.step(0.01, Vector3::zeros(), &[pull]);
/// let force = body.spring_forces()[0]; // N, on the body
/// assert!(force.z > 0.0 && force.norm() <= 2.0);
/// # Ok::<(), scindo_physics::body::BodyError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointSpring {
    /// The point; its carriers are all of one piece.
    pub point: MaterialPoint,
    /// Direction and rest position.
    pub kind: SpringKind,
    /// Stiffness k [N/m], ≥ 0.
    pub stiffness_n_m: f64,
    /// Largest force [N]; a longer extension gives this force.
    pub max_force_n: f64,
}

/// Direction and rest position of a [`PointSpring`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpringKind {
    /// f = k · max(0, offset − n·x_p) n: keeps the point on the side n points to.
    OneSided {
        /// Unit normal n.
        normal: Vector3<f64>,
        /// Position of the plane along n [m].
        offset_m: f64,
    },
    /// f = k (target − x_p): holds the point in all directions.
    Hold {
        /// Where the point is pulled to [m].
        target_m: Vector3<f64>,
    },
}

/// Mode of a spring, fixed within one linear solve.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mode {
    Off,
    Linear,
    /// Constant force [N] of the largest size, in the direction it had when the cap was reached.
    Capped(Vector3<f64>),
}

/// Energy, force and stiffness of a spring at one position of its point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SpringResponse {
    /// Energy [J].
    pub energy: f64,
    /// Force on the body [N].
    pub force: Vector3<f64>,
    /// Minus the derivative of the force [N/m], positive semidefinite.
    pub stiffness: Matrix3<f64>,
}

/// A spring in the course of one step.
#[derive(Clone, Copy, Debug)]
pub struct ActiveSpring {
    spring: PointSpring,
    mode: Mode,
}

impl ActiveSpring {
    /// Starts a spring at the predicted positions; `None` if it is not [usable](Self::usable).
    pub fn new(spring: &PointSpring, predicted: &[Vector3<f64>]) -> Option<Self> {
        let mut active = Self::usable(spring, predicted.len())?;
        if active.pull(active.point(predicted)).is_none() {
            active.mode = Mode::Off;
        }
        Some(active)
    }

    /// A spring on a body of `n_copies`; `None` if a number in it is not finite, it has no normal, or a copy
    /// does not exist.
    pub fn usable(spring: &PointSpring, n_copies: usize) -> Option<Self> {
        let mut spring = *spring;
        let direction_ok = match &mut spring.kind {
            SpringKind::OneSided { normal, offset_m } => {
                let length = normal.norm();
                *normal /= length;
                *offset_m /= length;
                length > 1e-12 && length.is_finite() && offset_m.is_finite()
            }
            SpringKind::Hold { target_m } => target_m.iter().all(|t| t.is_finite()),
        };
        let usable = direction_ok
            && spring.point.copies().iter().all(|&c| (c as usize) < n_copies)
            && spring.point.weights().iter().all(|w| w.is_finite())
            && (0.0..=1e15).contains(&spring.stiffness_n_m)
            && spring.max_force_n >= 0.0;
        usable.then_some(Self { spring, mode: Mode::Linear })
    }

    /// x_p [m].
    pub fn point(&self, x: &[Vector3<f64>]) -> Vector3<f64> {
        self.spring.point.position(x)
    }

    /// Extension vector [m] at `point`, which k multiplies; `None` if a one-sided spring has no contact.
    fn pull(&self, point: Vector3<f64>) -> Option<Vector3<f64>> {
        match self.spring.kind {
            SpringKind::OneSided { normal, offset_m } => {
                let depth = offset_m - normal.dot(&point);
                (depth > 0.0).then(|| depth * normal)
            }
            SpringKind::Hold { target_m } => Some(target_m - point),
        }
    }

    /// Force on the body [N] at `point` in the present mode: what the linear solve assumes.
    pub fn force(&self, point: Vector3<f64>) -> Vector3<f64> {
        let PointSpring { kind, stiffness_n_m: k, .. } = self.spring;
        match (self.mode, kind) {
            (Mode::Off, _) => Vector3::zeros(),
            (Mode::Linear, SpringKind::OneSided { normal, offset_m }) => {
                k * (offset_m - normal.dot(&point)) * normal
            }
            (Mode::Linear, SpringKind::Hold { target_m }) => k * (target_m - point),
            (Mode::Capped(force), _) => force,
        }
    }

    /// Chooses the mode that fits `point`; returns whether it changed.
    pub fn choose_mode(&mut self, point: Vector3<f64>) -> bool {
        let before = self.mode;
        let PointSpring { stiffness_n_m: k, max_force_n, .. } = self.spring;
        self.mode = match self.pull(point) {
            None => Mode::Off,
            Some(pull) if k * pull.norm() > max_force_n => Mode::Capped(max_force_n * pull.normalize()),
            Some(_) => Mode::Linear,
        };
        if matches!((self.mode, before), (Mode::Capped(_), Mode::Capped(_))) {
            self.mode = before; // the force that the solve was made with
        }
        self.mode != before
    }

    /// k n nᵀ or k I [N/m] while the spring is linear, else 0.
    pub fn stiffness(&self) -> Matrix3<f64> {
        match (self.mode, self.spring.kind) {
            (Mode::Linear, SpringKind::OneSided { normal, .. }) => {
                self.spring.stiffness_n_m * normal * normal.transpose()
            }
            (Mode::Linear, SpringKind::Hold { .. }) => {
                Matrix3::from_diagonal_element(self.spring.stiffness_n_m)
            }
            _ => Matrix3::zeros(),
        }
    }

    /// Energy [J] of the spring with the point at `point`, whatever the mode: ½ k s² of the extension s,
    /// and beyond the cap f_max the line that continues it, f_max s − f_max²/(2k). It is convex, and its
    /// gradient is minus the force on the point [N].
    pub fn potential(&self, point: Vector3<f64>) -> SpringResponse {
        let PointSpring { kind, stiffness_n_m: k, max_force_n: cap, .. } = self.spring;
        let Some(pull) = self.pull(point) else { return SpringResponse::default() };
        let s = pull.norm();
        if k * s <= cap {
            let stiffness = match kind {
                SpringKind::OneSided { normal, .. } => k * normal * normal.transpose(),
                SpringKind::Hold { .. } => Matrix3::from_diagonal_element(k),
            };
            return SpringResponse { energy: 0.5 * k * s * s, force: k * pull, stiffness };
        }
        let direction = pull / s;
        let stiffness = match kind {
            SpringKind::OneSided { .. } => Matrix3::zeros(),
            SpringKind::Hold { .. } => cap / s * (Matrix3::identity() - direction * direction.transpose()),
        };
        SpringResponse { energy: cap * (s - 0.5 * cap / k), force: cap * direction, stiffness }
    }

    /// Stiffness k [N/m], whether or not the spring is in contact.
    pub fn stiffness_n_m(&self) -> f64 {
        self.spring.stiffness_n_m
    }

    /// The spring as a term h² k J Jᵀ of the operator; `None` unless it is linear.
    pub fn term(&self, h_squared: f64) -> Option<Spring> {
        let direction = match self.spring.kind {
            SpringKind::OneSided { normal, .. } => Some([normal.x as f32, normal.y as f32, normal.z as f32]),
            SpringKind::Hold { .. } => None,
        };
        (self.mode == Mode::Linear).then(|| Spring {
            point: self.spring.point.map(|w| w as f32),
            direction,
            stiffness: (h_squared * self.spring.stiffness_n_m) as f32,
        })
    }

    /// The copy with the largest weight, which tells the part of the point.
    pub fn main_copy(&self) -> usize {
        self.spring.point.main_copy() as usize
    }

    /// Copies and weights.
    pub fn carriers(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.spring.point.carriers()
    }
}
