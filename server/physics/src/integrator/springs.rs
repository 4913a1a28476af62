//! Springs between material points and the world: contacts, grabs, tools.

use nalgebra::{Matrix3, Vector3};
use scindo_algebra::operator::Spring;
use scindo_matter::element::MaterialPoint;

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
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
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
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
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
    /// One-sided with dry friction: f_n as for [`OneSided`](Self::OneSided), and across n the force
    /// f_t = k_t (I − n nᵀ)(anchor − x_p), at most μ f_n of the same instant. A point that sticks is held by its
    /// anchor without creep; one that slips drags the anchor behind it (see [`PointSpring::after`]).
    Rough {
        /// Unit normal n.
        normal: Vector3<f64>,
        /// Position of the plane along n [m].
        offset_m: f64,
        /// Where the point sticks [m]; only its part across n counts.
        anchor_m: Vector3<f64>,
        /// Coefficient of friction μ.
        friction: f64,
        /// Stiffness across the normal k_t [N/m], at most k.
        tangential_n_m: f64,
        /// Bound μ f_n [N] at the start of the step, from which the search for that at its end begins; 0 where
        /// there was no contact.
        grip_n: f64,
    },
}

impl PointSpring {
    /// The kind with which the next step begins after one that left the point at `point` [m] and gave the force
    /// `force` [N]. The anchor of a rough spring stays while the point sticks, and is dragged along where it
    /// slipped. Other kinds stay as they are.
    pub fn after(&self, point: Vector3<f64>, force: Vector3<f64>) -> SpringKind {
        let mut kind = self.kind;
        if let SpringKind::Rough { normal, anchor_m, friction, tangential_n_m, grip_n, .. } = &mut kind {
            let push = force.dot(normal);
            let across = force - push * *normal;
            *anchor_m = if *tangential_n_m > 0.0 { point + across / *tangential_n_m } else { point };
            *grip_n = *friction * push.max(0.0);
        }
        kind
    }
}

/// Mode of a spring, fixed within one linear solve.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
enum Mode {
    Off,
    Linear,
    /// Linear along the normal, with friction at its bound across it.
    Slipping(Slip),
    /// Constant force [N] of the largest size, in the direction it had when the cap was reached.
    Capped(Vector3<f64>),
}

/// Friction at its bound, linearised. Across the direction t of slipping it turns with the point. Along t it is
/// constant (Newton's method) or, where that has not settled, a spring to the anchor that gives the bound where it was
/// linearised: such a spring never pushes a point past its anchor.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
struct Slip {
    /// Force [N] where it was linearised, along t.
    force: Vector3<f64>,
    /// Unit vector across t and the normal.
    across: Vector3<f64>,
    /// Bound over distance to the anchor [N/m].
    secant_n_m: f64,
    /// Whether it is constant along t.
    is_constant: bool,
}

impl Slip {
    /// Linearised where the anchor pulls back by `back` [m] in the plane of this normal, with the bound [N].
    fn new(back: Vector3<f64>, normal: &Vector3<f64>, bound: f64, is_constant: bool) -> Self {
        let distance = back.norm();
        let along = back / distance;
        let (force, across) = (bound * along, normal.cross(&along));
        Self { force, across, secant_n_m: bound / distance, is_constant }
    }

    /// Force [N] where the anchor pulls back by `back` [m].
    fn at(&self, back: Vector3<f64>) -> Vector3<f64> {
        match self.is_constant {
            true => self.force + self.secant_n_m * back.dot(&self.across) * self.across,
            false => self.secant_n_m * back,
        }
    }
}

/// Energy, force and stiffness of a spring at one position of its point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SpringResponse {
    /// Energy [J].
    pub energy: f64,
    /// Force on the body [N].
    pub force: Vector3<f64>,
    /// Minus the derivative of the force [N/m], positive semidefinite.
    pub stiffness: Matrix3<f64>,
}

/// After so many choices of a mode in a step, slipping is no longer searched with Newton's method.
const NEWTON_CHOICES: u8 = 4;
/// Change of a force that calls for another solve, relative to the largest force of all springs.
const NOTABLE_FORCE: f64 = 1e-3;
/// Change of a friction force, relative to its bound, that does not count as a change of mode.
const SAME_FRICTION: f64 = 1e-3;

/// The law of a spring in the course of one step: force and stiffness by the position of its point.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct SpringLaw {
    kind: SpringKind,
    /// k [N/m].
    stiffness_n_m: f64,
    max_force_n: f64,
    mode: Mode,
    /// Bound of the friction force [N], from the last position for which there was a solve.
    grip_n: f64,
    /// How often a mode was chosen in this step.
    choices: u8,
    /// Whether the bound of friction stays that of the last step.
    lagged: bool,
}

impl SpringLaw {
    /// The law of these numbers, with a normal of unit length; `None` if one of them cannot be used.
    pub(super) fn new(kind: SpringKind, stiffness_n_m: f64, max_force_n: f64) -> Option<Self> {
        let (mut kind, mut grip_n) = (kind, 0.0);
        let usable = match &mut kind {
            SpringKind::OneSided { normal, offset_m } => unit(normal, offset_m),
            SpringKind::Hold { target_m } => is_finite(target_m),
            SpringKind::Rough { normal, offset_m, anchor_m, friction, tangential_n_m, grip_n: bound } => {
                grip_n = *bound;
                unit(normal, offset_m)
                    && is_finite(anchor_m)
                    && (0.0..=1e3).contains(friction)
                    && (0.0..=1e15).contains(bound)
                    && (0.0..=stiffness_n_m).contains(tangential_n_m)
            }
        };
        let usable = usable && (0.0..=1e15).contains(&stiffness_n_m) && max_force_n >= 0.0;
        usable.then_some(Self {
            kind,
            stiffness_n_m,
            max_force_n,
            mode: Mode::Linear,
            grip_n,
            choices: 0,
            lagged: false,
        })
    }

    /// Begins a step with the point at `point`: off without contact, linear otherwise. Friction begins with the
    /// bound that the spring was given: the normal force at a predictor means nothing. What rubbed in the last step
    /// begins in contact, wherever its predictor is: that is farther away than stiff contact is deep.
    pub(super) fn begin(&mut self, point: Vector3<f64>) {
        self.mode = match self.pull(point) {
            None if self.grip_n <= 0.0 => Mode::Off,
            _ => self.stick_or_slip(point),
        };
    }

    /// The mode of a spring in contact at `point`, with the present bound of friction.
    fn stick_or_slip(&self, point: Vector3<f64>) -> Mode {
        match self.kind {
            SpringKind::Rough { normal, .. } if self.sticking(point).norm() > self.grip_n => {
                let back = self.back(point);
                let turned = matches!(self.mode, Mode::Slipping(slip) if slip.force.dot(&back) < 0.0);
                if turned && self.choices < NEWTON_CHOICES {
                    return Mode::Linear; // between slipping one way and the other lies sticking
                }
                Mode::Slipping(Slip::new(back, &normal, self.grip_n, self.choices < NEWTON_CHOICES))
            }
            _ => Mode::Linear,
        }
    }

    /// Extension vector [m] at `point`, which k multiplies; `None` if a one-sided spring has no contact.
    fn pull(&self, point: Vector3<f64>) -> Option<Vector3<f64>> {
        match self.kind {
            SpringKind::OneSided { normal, offset_m } | SpringKind::Rough { normal, offset_m, .. } => {
                let depth = offset_m - normal.dot(&point);
                (depth > 0.0).then(|| depth * normal)
            }
            SpringKind::Hold { target_m } => Some(target_m - point),
        }
    }

    /// (I − n nᵀ)(anchor − x_p) [m]; zero for springs without friction.
    fn back(&self, point: Vector3<f64>) -> Vector3<f64> {
        let SpringKind::Rough { normal, anchor_m, .. } = self.kind else { return Vector3::zeros() };
        let back = anchor_m - point;
        back - back.dot(&normal) * normal
    }

    /// k_t (I − n nᵀ)(anchor − x_p) [N] at `point`, as if it stuck; zero for springs without friction.
    fn sticking(&self, point: Vector3<f64>) -> Vector3<f64> {
        let SpringKind::Rough { tangential_n_m, .. } = self.kind else { return Vector3::zeros() };
        tangential_n_m * self.back(point)
    }

    /// Force of friction [N] at `point`, at most `bound`.
    fn friction(&self, point: Vector3<f64>, bound: f64) -> Vector3<f64> {
        let sticking = self.sticking(point);
        let size = sticking.norm();
        if size > bound { sticking * (bound / size) } else { sticking }
    }

    /// μ f_n [N] at `point`.
    fn bound(&self, point: Vector3<f64>) -> f64 {
        let SpringKind::Rough { friction, .. } = self.kind else { return 0.0 };
        let push = self.pull(point).map_or(0.0, |pull| self.stiffness_n_m * pull.norm());
        friction * push.min(self.max_force_n)
    }

    /// Takes the bound of friction of the [`potential`](Self::potential) from the normal force at `point`.
    /// Returns by how much it changed, relative to its size.
    pub(super) fn renew_grip(&mut self, point: Vector3<f64>) -> f64 {
        let before = self.grip_n;
        self.grip_n = self.bound(point);
        let size = self.grip_n.max(before);
        if size > 0.0 { (self.grip_n - before).abs() / size } else { 0.0 }
    }

    /// Force on the body [N] at `point` in the present mode: what the linear solve assumes.
    pub(super) fn force(&self, point: Vector3<f64>) -> Vector3<f64> {
        let k = self.stiffness_n_m;
        match (self.mode, self.kind) {
            (Mode::Off, _) => Vector3::zeros(),
            (Mode::Capped(force), _) => force,
            (_, SpringKind::Hold { target_m }) => k * (target_m - point),
            (
                mode,
                SpringKind::OneSided { normal, offset_m } | SpringKind::Rough { normal, offset_m, .. },
            ) => {
                let push = k * (offset_m - normal.dot(&point)) * normal;
                match mode {
                    Mode::Slipping(slip) => push + slip.at(self.back(point)),
                    _ => push + self.sticking(point),
                }
            }
        }
    }

    /// Chooses the mode that fits `point`, where a solve has ended; returns whether it changed. The bound of
    /// friction is that of the normal force there.
    pub(super) fn choose_mode(&mut self, point: Vector3<f64>) -> bool {
        let before = self.mode;
        self.choices = self.choices.saturating_add(1);
        // A spring that closes was not part of the solve. Its depth says nothing about its force.
        if !self.lagged {
            self.grip_n = if before == Mode::Off { 0.0 } else { self.bound(point) };
        }
        let (k, cap) = (self.stiffness_n_m, self.max_force_n);
        self.mode = match self.pull(point) {
            None => Mode::Off,
            Some(pull) if k * pull.norm() > cap => {
                Mode::Capped(cap * pull.normalize() + self.friction(point, self.grip_n))
            }
            Some(_) => self.stick_or_slip(point),
        };
        match (self.mode, before) {
            // The force that the solve was made with.
            (Mode::Capped(_), Mode::Capped(_)) => self.mode = before,
            (Mode::Slipping(now), Mode::Slipping(known))
                if (now.force - known.at(self.back(point))).norm() <= SAME_FRICTION * now.force.norm() =>
            {
                self.mode = before;
            }
            _ => {}
        }
        self.mode != before
    }

    /// Whether another mode at `point`, where a solve has ended, would change the force by a notable part of the
    /// largest force `scale` [N] of all springs.
    pub(super) fn would_change(&self, point: Vector3<f64>, scale: f64) -> bool {
        self.notable_change(point, scale) > 0.0
    }

    /// By how much another mode would change the force [N]; 0 if that is no notable part of `scale`.
    pub(super) fn notable_change(&self, point: Vector3<f64>, scale: f64) -> f64 {
        let mut next = *self;
        if !next.choose_mode(point) {
            return 0.0;
        }
        let change = (next.force(point) - self.force(point)).norm();
        if change > NOTABLE_FORCE * scale { change } else { 0.0 }
    }

    /// k n nᵀ, k I, or k n nᵀ + k_t (I − n nᵀ) [N/m] while the spring is linear, else without its constant part.
    pub(super) fn stiffness(&self) -> Matrix3<f64> {
        let k = self.stiffness_n_m;
        match (self.mode, self.kind) {
            (Mode::Off | Mode::Capped(_), _) => Matrix3::zeros(),
            (_, SpringKind::Hold { .. }) => Matrix3::from_diagonal_element(k),
            (_, SpringKind::OneSided { normal, .. }) => k * normal * normal.transpose(),
            (mode, SpringKind::Rough { normal, tangential_n_m, .. }) => {
                let along = normal * normal.transpose();
                let sideways = match mode {
                    Mode::Slipping(Slip { across, secant_n_m, is_constant: true, .. }) => {
                        secant_n_m * across * across.transpose()
                    }
                    Mode::Slipping(slip) => slip.secant_n_m * (Matrix3::identity() - along),
                    _ => tangential_n_m * (Matrix3::identity() - along),
                };
                k * along + sideways
            }
        }
    }

    /// Energy [J] of the spring with the point at `point`, whatever the mode: ½ k s² of the extension s,
    /// and beyond the cap f_max the line that continues it, f_max s − f_max²/(2k). It is convex, and its
    /// gradient is minus the force on the point [N]. Friction is bounded by the last
    /// [grip](Self::renew_grip).
    pub(super) fn potential(&self, point: Vector3<f64>) -> SpringResponse {
        let (k, cap) = (self.stiffness_n_m, self.max_force_n);
        let Some(pull) = self.pull(point) else { return SpringResponse::default() };
        let sideways = match self.kind {
            SpringKind::Rough { normal, anchor_m, tangential_n_m, .. } if tangential_n_m > 0.0 => {
                let back = anchor_m - point;
                let across = Matrix3::identity() - normal * normal.transpose();
                capped(across * back, (tangential_n_m, self.grip_n), across)
            }
            _ => SpringResponse::default(),
        };
        let stiff = match self.kind {
            SpringKind::Hold { .. } => Matrix3::identity(),
            SpringKind::OneSided { normal, .. } | SpringKind::Rough { normal, .. } => {
                normal * normal.transpose()
            }
        };
        let straight = capped(pull, (k, cap), stiff);
        SpringResponse {
            energy: straight.energy + sideways.energy,
            force: straight.force + sideways.force,
            stiffness: straight.stiffness + sideways.stiffness,
        }
    }

    /// Stiffness k [N/m], whether or not the spring is in contact.
    pub(super) fn stiffness_n_m(&self) -> f64 {
        self.stiffness_n_m
    }

    /// The directions of the present stiffness, `None` for all three, each with its size [N/m]; all are ≥ 0.
    pub(super) fn directions(&self) -> impl Iterator<Item = (Option<[f32; 3]>, f64)> + use<> {
        let k = self.stiffness_n_m;
        let single = |n: Vector3<f64>| Some([n.x as f32, n.y as f32, n.z as f32]);
        let found = match (self.mode, self.kind) {
            (Mode::Off | Mode::Capped(_), _) => [None, None],
            (_, SpringKind::Hold { .. }) => [Some((None, k)), None],
            (_, SpringKind::OneSided { normal, .. }) => [Some((single(normal), k)), None],
            (Mode::Slipping(slip), SpringKind::Rough { normal, .. }) if slip.is_constant => {
                [Some((single(normal), k)), Some((single(slip.across), slip.secant_n_m))]
            }
            (Mode::Slipping(slip), SpringKind::Rough { normal, .. }) => {
                [Some((single(normal), k - slip.secant_n_m)), Some((None, slip.secant_n_m))]
            }
            (Mode::Linear, SpringKind::Rough { normal, tangential_n_m, .. }) if tangential_n_m > 0.0 => {
                [Some((single(normal), k - tangential_n_m)), Some((None, tangential_n_m))]
            }
            (_, SpringKind::Rough { normal, .. }) => [Some((single(normal), k)), None],
        };
        found.into_iter().flatten()
    }
}

/// Energy, force and stiffness of an extension `pull` [m] with stiffness k [N/m] in the directions of `stiff`, up to
/// the force `cap` [N].
fn capped(pull: Vector3<f64>, (k, cap): (f64, f64), stiff: Matrix3<f64>) -> SpringResponse {
    let s = pull.norm();
    if k * s <= cap {
        return SpringResponse { energy: 0.5 * k * s * s, force: k * pull, stiffness: k * stiff };
    }
    let direction = pull / s;
    let turned = stiff - direction * direction.transpose();
    SpringResponse { energy: cap * (s - 0.5 * cap / k), force: cap * direction, stiffness: cap / s * turned }
}

/// Makes a plane's normal a unit vector; returns whether it can be used.
fn unit(normal: &mut Vector3<f64>, offset_m: &mut f64) -> bool {
    let length = normal.norm();
    *normal /= length;
    *offset_m /= length;
    length > 1e-12 && length.is_finite() && offset_m.is_finite()
}

fn is_finite(v: &Vector3<f64>) -> bool {
    v.iter().all(|c| c.is_finite())
}

/// A spring in the course of one step.
#[derive(Clone, Copy, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct ActiveSpring {
    point: MaterialPoint,
    law: SpringLaw,
}

impl ActiveSpring {
    /// Starts a spring at the predicted positions; `None` if it is not [usable](Self::usable).
    pub(super) fn new(spring: &PointSpring, predicted: &[Vector3<f64>]) -> Option<Self> {
        let mut active = Self::usable(spring, predicted.len())?;
        active.law.begin(active.point(predicted));
        Some(active)
    }

    /// A spring on a body of `n_copies`; `None` if a number in it is not finite, it has no normal, or a copy
    /// does not exist.
    pub(super) fn usable(spring: &PointSpring, n_copies: usize) -> Option<Self> {
        let PointSpring { point, kind, stiffness_n_m, max_force_n } = *spring;
        let exists = point.copies().iter().all(|&c| (c as usize) < n_copies);
        let usable = exists && point.weights().iter().all(|w| w.is_finite());
        let law = SpringLaw::new(kind, stiffness_n_m, max_force_n).filter(|_| usable)?;
        Some(Self { point, law })
    }

    /// x_p [m].
    pub(super) fn point(&self, x: &[Vector3<f64>]) -> Vector3<f64> {
        self.point.position(x)
    }

    /// Force, stiffness and mode by the position of the point.
    pub(super) fn law(&self) -> &SpringLaw {
        &self.law
    }

    /// Keeps the bound of friction of the last step; only for a mutation test.
    pub(super) fn lag(&mut self) {
        self.law.lagged = true;
    }

    /// See [`SpringLaw::choose_mode`].
    pub(super) fn choose_mode(&mut self, point: Vector3<f64>) -> bool {
        self.law.choose_mode(point)
    }

    /// See [`SpringLaw::renew_grip`].
    pub(super) fn renew_grip(&mut self, point: Vector3<f64>) -> f64 {
        self.law.renew_grip(point)
    }

    /// The spring as terms h² k J Jᵀ of the operator.
    pub(super) fn terms(&self, h_squared: f64) -> impl Iterator<Item = Spring> + use<> {
        let point = self.point.map(|w| w as f32);
        self.law.directions().map(move |(direction, k)| Spring {
            point,
            direction,
            stiffness: (h_squared * k) as f32,
        })
    }

    /// The copy with the largest weight, which tells the part of the point.
    pub(super) fn main_copy(&self) -> usize {
        self.point.main_copy() as usize
    }

    /// Copies and weights.
    pub(super) fn carriers(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.point.carriers()
    }
}
