//! Pressure on the surface of a body.
//!
//! The force is −p n da of the present configuration, except with the linear law: its strains are those of the rest
//! configuration, and so are n and da. How the force follows the surface depends on the way of a step:
//!
//! - On the general path it is a part of Newton's method, with its load stiffness
//!   ([`scindo_algebra::assembly::pressure`]), and explicit schemes evaluate it in every stage. Their critical step leaves
//!   the load stiffness out, which is about p/E of the elastic one.
//! - On the fast path it is that at the predicted positions x + h v, and a dead load within the step. The error of
//!   this lag falls with h². In a strip that bends by its own length it is an eighteenth of the error of BDF2, a
//!   two-hundredth of that of implicit Euler, and 1.3 times that of Newmark's method (20 ms). It costs a pass over the
//!   nodes and the faces under pressure per step.

use nalgebra::Vector3;
use scindo_matter::material::Law;

use super::{Body, BodyError, Scheme};

/// A pressure as requested; cuts do not change it.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub(super) struct PressureLoad {
    /// Whether a face whose nodes all are `true` carries it, by node of the uncut body.
    selected: Vec<bool>,
    /// The whole pressure [Pa], and the share of it that acts.
    pascals: f64,
    share: f64,
}

impl Body {
    /// Adds a pressure [Pa] on the skin faces all of whose nodes are in `nodes`. It pushes into the tissue; a negative one
    /// pulls. The force −p n da follows the deformed surface: n and da are those of the present configuration, with
    /// the linear law those of the rest configuration. A share of it acts that
    /// [`set_pressure_shares`](Self::set_pressure_shares) sets; it is 1 at first.
    ///
    /// After cuts, what is left of the skin stays loaded. The lips of cuts carry no pressure. The skin of octree cells
    /// are their faces at the boundary, steps where it is inclined.
    ///
    /// # Errors
    /// A pressure of 10¹² Pa or more, nodes that do not exist, a selection without faces, cuts that change the mesh, and,
    /// with a law that is not linear, relaxation and equilibria on the fast path.
    ///
    /// # Source
    /// Bonet, Wood 2008, "Nonlinear Continuum Mechanics for Finite Element Analysis", §8.5.
    ///
    /// ```
    /// # use nalgebra::Vector3;
    /// # use scindo_physics::body::{Body, BodySettings};
    /// # use scindo_physics::material::{Law, Material, Rayleigh};
    /// # use scindo_physics::mesh::{BoxPattern, box_mesh};
    /// # let mesh = box_mesh(Vector3::zeros(), Vector3::repeat(0.1), [2; 3], BoxPattern::Tet6);
    /// # let (law, rayleigh) = (Law::Corotational, Rayleigh::default());
    /// # let material = Material { young_pa: 1e4, poisson: 0.4, density_kg_m3: 1e3, rayleigh, law };
    /// # let mut body = Body::new(mesh, material, BodySettings::default())?;
    /// let top = (0..).zip(body.rest_positions()).filter(|(_, rest)| rest.z == 0.1);
    /// let top: Vec<u32> = top.map(|(node, _)| node).collect();
    /// body.add_pressure(&top, 500.0)?; // Pa, on 0.01 m²
    /// let force: Vector3<f64> = body.pressure_forces().iter().sum();
    /// assert!((force - Vector3::new(0.0, 0.0, -5.0)).norm() < 1e-9);
    /// # Ok::<(), scindo_physics::body::BodyError>(())
    /// ```
    pub fn add_pressure(&mut self, nodes: &[u32], pressure_pa: f64) -> Result<(), BodyError> {
        let (what, follows) = ("pressure on the surface", self.material.law != Law::Linear);
        let refused = |with, instead| Err(BodyError::Combination { what, with, instead });
        let selected = self.selection(nodes, ("pressure_pa", &Vector3::repeat(pressure_pa)))?;
        if self.snap.is_some() {
            return refused("cutting that changes the mesh", "cutting method xfem");
        }
        if self.settings.relaxation && follows {
            return refused("relaxation of a law that is not linear", "another solver");
        }
        // Nothing moves between their solves, so the force would be that of the last step.
        if self.settings.scheme == Scheme::Static && follows && self.is_fast() {
            return refused("equilibria on the fast path", "settings with `pressed`, or mixed precision");
        }
        let mut faces = 0;
        self.space.for_skin_faces(&selected, &mut |_| faces += 1);
        if faces == 0 {
            return Err(BodyError::NoSkinFace { pressure_pa });
        }
        self.boundary.pressures.push(PressureLoad { selected, pascals: pressure_pa, share: 1.0 });
        self.follow_boundary();
        Ok(())
    }

    /// Sets how much of every [pressure](Self::add_pressure) acts from now on, in the order in which they were added.
    /// Those without an entry keep their share. Allocates nothing.
    pub fn set_pressure_shares(&mut self, shares: impl Iterator<Item = f64>) {
        let mut changed = false;
        for (load, share) in self.boundary.pressures.iter_mut().zip(shares) {
            changed |= load.share != share;
            load.share = share;
        }
        if changed {
            self.pressure.set_pascals(self.boundary.pressures.iter().map(|load| load.share * load.pascals));
            self.gather_loads();
        }
    }

    /// Force of the pressures on every node [N] in the present state.
    pub fn pressure_forces(&self) -> Vec<Vector3<f64>> {
        let mut force = vec![Vector3::zeros(); self.rest.len()];
        let follows = self.material.law != Law::Linear;
        self.pressure.add_forces(if follows { &self.state.x } else { &self.rest }, &mut force);
        force
    }

    /// The discretisation, for tests of parts below the body.
    #[cfg(test)]
    pub(crate) fn discretisation(&self) -> &dyn crate::space::Space {
        &*self.space
    }

    /// Load on every node in the present state [N], with the pressure, gravity not included.
    pub fn present_loads(&self) -> Vec<Vector3<f64>> {
        let mut loads = self.load.clone();
        if self.pressure_is_implicit() {
            self.pressure.add_forces(&self.state.x, &mut loads);
        }
        loads
    }

    /// Whether the force of the pressure is a part of the step, and not of the dead loads.
    pub(super) fn pressure_is_implicit(&self) -> bool {
        self.material.law != Law::Linear && !self.is_fast()
    }

    /// Whether the force of the pressure is a dead load that every step renews.
    pub(super) fn pressure_lags(&self) -> bool {
        !self.pressure.is_empty() && self.material.law != Law::Linear && self.is_fast()
    }

    /// Binds the pressures to the skin as it is cut now.
    pub(super) fn bind_pressures(&mut self) {
        self.pressure.clear();
        for load in &mut self.boundary.pressures {
            let number = self.pressure.add_load(load.share * load.pascals);
            let pressure = &mut self.pressure;
            self.space.for_skin_faces(&load.selected, &mut |points| pressure.add_face(number, points));
        }
    }

    /// Sums the dead loads of all nodes, with the pressure where it is one.
    pub(super) fn gather_loads(&mut self) {
        self.boundary.node_loads(&*self.space, self.rest.len(), &mut self.load);
        if self.material.law == Law::Linear {
            self.pressure.add_forces(&self.rest, &mut self.load);
        } else if self.pressure_lags() {
            self.pressure.add_forces(&self.state.x, &mut self.load);
        }
    }

    /// Takes the pressure at the positions to which the velocities lead within `dt_s` [s].
    pub(super) fn predict_pressure(&mut self, dt_s: f64) {
        if !self.pressure_lags() {
            return;
        }
        self.boundary.node_loads(&*self.space, self.rest.len(), &mut self.load);
        self.ahead.clear();
        self.ahead.extend(self.state.x.iter().zip(&self.state.v).map(|(x, v)| x + dt_s * v));
        self.pressure.add_forces(&self.ahead, &mut self.load);
    }
}
