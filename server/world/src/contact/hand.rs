//! The contact of one tool: where tissue lets it be, where it presses, and what it holds.

use nalgebra::{Isometry3, Translation3, Vector3};

use crate::contact::compliance::Compliance;
use crate::contact::edge::{Edge, EdgeReport};
use crate::contact::grab::Grip;
use crate::contact::jaws::Jaws;
use crate::contact::press::Press;
use crate::contact::proxy::Proxy;
use crate::contact::rub::Rub;
use crate::contact::surface::ContactSurface;
use crate::inputs::{ToolMode, ToolShape};
use crate::snapshot::LimbSnapshot;
use crate::tool::compound::MAX_PARTS;
use crate::tool::geometry::core_radius;
use crate::tool::{Tool, compound};

/// Where one capsule of a compound tool may be, and where it presses.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
struct Limb {
    proxy: Proxy,
    press: Press,
    /// Force of the tissue on it in the last step [N].
    force_n: Vector3<f64>,
    /// The part of it that is friction [N].
    friction_n: Vector3<f64>,
}

/// The contact state of one tool, kept from step to step.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Hand {
    /// Number of the tool; see [`Tool::number`].
    tool: u64,
    hand_overs: u64,
    jumps: u64,
    proxy: Proxy,
    /// The edge of a blade that cuts with force.
    pub(super) edge: Option<Box<Edge>>,
    press: Press,
    /// The capsules of a compound tool, instead of `press`.
    limbs: Vec<Limb>,
    grip: Grip,
    /// The grip of forceps.
    pub(super) jaws: Option<Box<Jaws>>,
    /// Body that it touched last, and the compliance of its tissue; `None` before the first contact.
    compliance: Option<(usize, Compliance)>,
}

impl Hand {
    /// The state of a tool that has not touched anything yet.
    pub fn new(tool: &Tool) -> Self {
        Self {
            tool: tool.number(),
            hand_overs: 0,
            jumps: 0,
            proxy: Proxy::default(),
            edge: None,
            press: Press::new(),
            limbs: Vec::new(),
            grip: Grip::new(),
            jaws: None,
            compliance: None,
        }
    }

    /// Whether this is the hand on `tool`.
    pub fn is_on(&self, tool: &Tool) -> bool {
        self.tool == tool.number()
    }

    /// The pose to which the tissue restricts the tool.
    pub fn proxy_pose(&self) -> &Isometry3<f64> {
        self.proxy.pose()
    }

    /// What the edge of a blade that cuts with force has done; `None` for other tools.
    pub fn edge(&self) -> Option<EdgeReport> {
        self.edge.as_ref().map(|edge| edge.report())
    }

    /// Puts the proxy where the edge of a blade has got to.
    pub(super) fn seat(&mut self, pose: &Isometry3<f64>) {
        self.proxy.release(pose);
    }

    /// Where and how the tool presses; a compound tool presses with its [`limbs`](Self::limbs).
    pub fn press(&self) -> &Press {
        &self.press
    }

    /// Where and how the capsules of a compound tool press; none for other tools.
    pub fn limbs(&self) -> impl ExactSizeIterator<Item = &Press> {
        self.limbs.iter().map(|limb| &limb.press)
    }

    /// Takes the forces of the springs of each capsule of a compound tool on tissue [N].
    pub(super) fn feel(&mut self, on_tissue: &[Vector3<f64>; MAX_PARTS]) {
        for (limb, force) in self.limbs.iter_mut().zip(on_tissue) {
            limb.force_n = -force;
        }
    }

    /// Friction under a capsule of a compound tool, or under the tool itself.
    pub(super) fn rub_mut(&mut self, limb: u8) -> &mut Rub {
        match self.limbs.get_mut(usize::from(limb)) {
            Some(limb) => limb.press.rub_mut(),
            None => self.press.rub_mut(),
        }
    }

    /// Takes over the friction of the solve of a step, and returns the force on the tool [N].
    pub(super) fn settle_rub(&mut self, friction: f64) -> Vector3<f64> {
        self.press.rub_mut().settle(friction);
        let mut on_tissue = self.press.rub().force_n();
        for limb in &mut self.limbs {
            limb.press.rub_mut().settle(friction);
            limb.friction_n = -limb.press.rub().force_n();
            on_tissue -= limb.friction_n;
        }
        -on_tissue
    }

    /// The capsules of a compound tool that touches, for the local model.
    pub fn limbs_of(&self, tool: &Tool) -> impl Iterator<Item = LimbSnapshot> {
        let parts = compound::parts(tool.shape, tool.gap_m()).filter(|_| tool.touches());
        let limbs = parts.zip(&self.limbs);
        limbs.map(|(part, limb)| LimbSnapshot {
            part,
            proxy: *limb.proxy.pose(),
            force_n: limb.force_n,
            friction_n: limb.friction_n,
        })
    }

    /// How far the jaws of forceps are closed, 0 to 1.
    pub fn closed(&self, tool: &Tool) -> f64 {
        match (tool.shape, self.jaws.as_ref().and_then(|jaws| jaws.gap_m())) {
            (ToolShape::Forceps { opening_m, .. }, Some(gap_m)) => (1.0 - gap_m / opening_m).clamp(0.0, 1.0),
            _ => tool.closed,
        }
    }

    /// The tissue that the tool holds.
    pub fn grip(&self) -> &Grip {
        &self.grip
    }

    /// Centroid of the tissue in its grip [m]; `None` if it holds nothing.
    pub fn held_point(&self) -> Option<Vector3<f64>> {
        if let Some(jaws) = &self.jaws {
            return jaws.held_point();
        }
        let held = self.grip.held().1;
        let sum: Vector3<f64> = held.iter().map(|held| held.point).sum();
        (!held.is_empty()).then(|| sum / held.len() as f64)
    }

    /// Stiffness [N/m] of the tool's spring, `stiffness_n_m`, in series with the tissue: the change of force
    /// with the pose within a step. Before the first contact it is that of the spring alone.
    pub fn in_series_with(&self, stiffness_n_m: f64) -> f64 {
        self.compliance.map_or(stiffness_n_m, |(_, compliance)| compliance.in_series_with(stiffness_n_m))
    }

    /// Body that it touched last, and the compliance of its tissue in a step [m/N]; `None` before the first contact.
    pub fn tissue(&self) -> Option<(usize, f64)> {
        self.compliance.map(|(body, compliance)| (body, compliance.value()))
    }

    /// Releases everything, with the tool at `pose`.
    pub fn let_go(&mut self, pose: &Isometry3<f64>) {
        self.proxy.release(pose);
        self.press.release();
        self.release_limbs();
        self.grip.open();
        self.open_jaws();
        self.edge = None;
    }

    /// Puts the proxy at `pose` without a sweep; only for a mutation test.
    pub fn jump(&mut self, pose: &Isometry3<f64>) {
        self.proxy.release(pose);
    }

    /// Follows the tool to its present pose in a step of `h` seconds, and finds what it touches or holds there.
    pub fn follow(&mut self, tool: &Tool, surfaces: &[ContactSurface], h: f64) {
        if self.hand_overs != tool.hand_overs() {
            self.hand_overs = tool.hand_overs();
            self.let_go(&tool.pose);
        }
        if self.jumps != tool.jumps() {
            self.jumps = tool.jumps();
            self.edge = None;
            self.release_limbs();
            self.open_jaws();
            self.proxy.release(&tool.pose);
            self.press.slip();
        }
        if tool.mode != ToolMode::Grab {
            self.grip.open();
            self.open_jaws();
        }
        if tool.touches() && compound::count(tool.shape) > 0 {
            self.follow_with_limbs(tool, surfaces, h);
        } else if tool.touches() {
            self.proxy.ride(tool.shape, surfaces);
            self.proxy.follow(tool.shape, &tool.pose, surfaces);
            self.press.update(tool.shape, (self.proxy.pose(), &tool.pose), surfaces, h);
            if tool.friction > 0.0 {
                self.press.drag(tool.shape, &tool.pose);
            }
        } else {
            // The edge of a blade that cuts with force has a place of its own.
            if self.edge.is_none() {
                self.proxy.release(&tool.pose);
            }
            self.press.release();
            self.release_limbs();
            if tool.mode == ToolMode::Grab && matches!(tool.shape, ToolShape::Forceps { .. }) {
                self.jaws.get_or_insert_default().follow(tool, surfaces);
            } else if tool.mode == ToolMode::Grab {
                self.grip.hold(&tool.pose, core_radius(tool.shape), surfaces);
            }
        }
    }

    fn open_jaws(&mut self) {
        if let Some(jaws) = &mut self.jaws {
            jaws.open();
        }
    }

    fn release_limbs(&mut self) {
        for limb in &mut self.limbs {
            limb.proxy.release(&Isometry3::identity());
            limb.press.release();
        }
    }

    /// Follows with every capsule of a compound tool by itself. The proxy of the whole is displaced by the mean of those
    /// that touch.
    fn follow_with_limbs(&mut self, tool: &Tool, surfaces: &[ContactSurface], h: f64) {
        self.press.release();
        let count = compound::count(tool.shape);
        self.limbs.resize_with(count, || Limb {
            proxy: Proxy::default(),
            press: Press::new(),
            force_n: Vector3::zeros(),
            friction_n: Vector3::zeros(),
        });
        let (mut aside, mut touching) = (Vector3::zeros(), 0.0);
        for (limb, part) in self.limbs.iter_mut().zip(compound::parts(tool.shape, tool.gap_m())) {
            let device = tool.pose * part.pose;
            limb.proxy.ride(part.shape, surfaces);
            limb.proxy.follow(part.shape, &device, surfaces);
            limb.press.update(part.shape, (limb.proxy.pose(), &device), surfaces, h);
            if tool.friction > 0.0 {
                limb.press.drag(part.shape, &device);
            }
            if limb.press.normal().is_some() {
                aside += limb.proxy.pose().translation.vector - device.translation.vector;
                touching += 1.0;
            }
        }
        self.proxy.release(&(Translation3::from(aside / f64::max(touching, 1.0)) * tool.pose));
    }

    /// Records contact with `body` of Young's modulus `young_pa` [Pa] under a patch of `radius_m` [m]. If
    /// another body was touched last, the compliance starts from a first guess.
    pub fn meet(&mut self, body: usize, (young_pa, viscous): (f64, f64), radius_m: f64) {
        if self.compliance.is_none_or(|(known, _)| known != body) {
            self.compliance = Some((body, Compliance::new(young_pa, radius_m, viscous)));
        }
    }

    /// The learned compliance; `None` before the first contact.
    pub fn compliance(&mut self) -> Option<&mut Compliance> {
        self.compliance.as_mut().map(|(_, compliance)| compliance)
    }

    /// Discards the learned compliance.
    pub fn forget_compliance(&mut self) {
        self.compliance = None;
    }
}
