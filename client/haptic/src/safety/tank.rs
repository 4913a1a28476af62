//! Energy tank: what a new contact model injects is paid for, or taken over slowly.
//!
//! A force f along a contact of stiffness k can give the hand back U = f²/(2k). Moving the tip changes U by the work of
//! the hand. A new model changes it for nothing: a hand that keeps still would be given energy. The tank holds what may
//! be given. Its level follows
//!
//! T ← T − f·Δx − ΔU + f·v_s Δt + P Δt,
//!
//! Δx: way of the tip while f was held; v_s: velocity of the tissue by itself, which pays for what it pushes; P: a small
//! allowance, so that a model which differs for good is taken over in the end. The force is scaled so that T never falls
//! below zero. Whatever U is, the sum T + U changes only by what was paid: without P and v_s, the hand can never
//! receive more than it gave and the first level of the tank.
//!
//! # Source
//! Franken, Stramigioli, Misra, Secchi, Macchelli, "Bilateral telemanipulation with time delays: a two-layer
//! approach", IEEE T-RO 27 (2011); Lee and Huang, "Passive-set-position-modulation framework", IEEE T-RO 26 (2010).

use crate::constants::{FREE_FORCE_N, MAX_JUMP_M, PERIOD_S};
use nalgebra::Vector3;

/// Level at the start of a touch [J].
const FIRST_J: f64 = 0.8e-3;
/// Largest level that dissipation may fill [J].
const MOST_J: f64 = 0.02;
/// The allowance P [W]. It fills the tank up to its first level.
const ALLOWANCE_W: f64 = 2e-3;
/// Least stiffness with which a force is charged [N/m]. Forces that no stiffness belongs to are charged by it.
const LEAST_STIFFNESS_N_M: f64 = 100.0;
/// After this many ticks without force the tank returns to its first level.
const FREE_TICKS: u32 = 100;

/// What the contact is like in this tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Charge {
    /// Stiffness along the force [N/m].
    pub stiffness_n_m: f64,
    /// Power with which the tissue pushes by itself [W].
    pub tissue_w: f64,
}

/// The tank of one device.
#[derive(Debug, Clone, Copy)]
pub struct EnergyTank {
    level_j: f64,
    stored_j: f64,
    force_n: Vector3<f64>,
    tip_m: Option<Vector3<f64>>,
    free_ticks: u32,
    is_open: bool,
}

impl Default for EnergyTank {
    fn default() -> Self {
        Self {
            level_j: FIRST_J,
            stored_j: 0.0,
            force_n: Vector3::zeros(),
            tip_m: None,
            free_ticks: 0,
            is_open: false,
        }
    }
}

impl EnergyTank {
    /// Lets everything pass; only for a mutation test.
    pub fn open(&mut self) {
        self.is_open = true;
    }

    /// What may still be given to the hand [J].
    pub fn level_j(&self) -> f64 {
        self.level_j
    }

    /// The part of `wanted_n` that is paid for, with the tip at `tip_m` [m], and whether it is all of it.
    pub fn pay(
        &mut self,
        wanted_n: Vector3<f64>,
        tip_m: Vector3<f64>,
        charge: &Charge,
    ) -> (Vector3<f64>, bool) {
        let way = self.tip_m.map_or_else(Vector3::zeros, |before| tip_m - before);
        // A jump is a fault of the device and no work of the hand.
        let way = if way.norm() <= MAX_JUMP_M { way } else { Vector3::zeros() };
        self.tip_m = Some(tip_m);
        self.level_j += self.stored_j - self.force_n.dot(&way) + PERIOD_S * charge.tissue_w.max(0.0);
        self.stored_j = 0.0;
        let asked_j = stored(&wanted_n, charge);
        let allowance = PERIOD_S * ALLOWANCE_W;
        if self.level_j - asked_j < FIRST_J {
            self.level_j += allowance.min(FIRST_J + asked_j - self.level_j);
        }
        if self.is_open || asked_j <= self.level_j {
            return (wanted_n, true);
        }
        (wanted_n * (self.level_j.max(0.0) / asked_j).sqrt(), false)
    }

    /// Accounts for the force that was really sent in this tick.
    pub fn observe(&mut self, force_n: &Vector3<f64>, charge: &Charge) {
        self.force_n = *force_n;
        self.stored_j = stored(force_n, charge);
        self.level_j = (self.level_j - self.stored_j).min(MOST_J);
        self.free_ticks = if force_n.norm() > FREE_FORCE_N { 0 } else { self.free_ticks.saturating_add(1) };
        if self.free_ticks > FREE_TICKS {
            self.level_j = FIRST_J;
        }
    }
}

/// U [J].
fn stored(force_n: &Vector3<f64>, charge: &Charge) -> f64 {
    0.5 * force_n.norm_squared() / charge.stiffness_n_m.max(LEAST_STIFFNESS_N_M)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CHARGE: Charge = Charge { stiffness_n_m: 400.0, tissue_w: 0.0 };

    /// Force at depth `z` [m] that was let through, with what the law asks for.
    fn at(tank: &mut EnergyTank, z: f64, wanted: f64, charge: &Charge) -> f64 {
        let (paid, _) = tank.pay(Vector3::z() * wanted, -Vector3::z() * z, charge);
        tank.observe(&paid, charge);
        paid.z
    }

    #[test]
    fn a_press_pays_for_itself() {
        let mut tank = EnergyTank::default();
        let depths = (0..400).map(|t| 5e-3 * (std::f64::consts::PI * f64::from(t) / 400.0).sin());
        for z in depths {
            assert_eq!(at(&mut tank, z, 400.0 * z, &CHARGE), 400.0 * z);
        }
        assert!(tank.level_j() > 0.5 * FIRST_J, "{}", tank.level_j());
    }

    #[test]
    fn a_force_out_of_nothing_is_taken_over_slowly() {
        let mut tank = EnergyTank::default();
        let first = at(&mut tank, 0.0, 2.0, &CHARGE);
        let paid = (2.0 * CHARGE.stiffness_n_m * (FIRST_J + PERIOD_S * ALLOWANCE_W)).sqrt();
        assert!((first - paid).abs() < 0.01, "{first}");
        let forces: Vec<f64> = (0..3000).map(|_| at(&mut tank, 0.0, 2.0, &CHARGE)).collect();
        assert!(forces.is_sorted() && forces[100] < 1.2 && forces[2999] == 2.0);
    }

    #[test]
    fn tissue_that_moves_pays_for_what_it_pushes() {
        // The surface rises at 20 mm/s under a hand that keeps still.
        let mut tank = EnergyTank::default();
        for t in 0..250 {
            let force = 400.0 * 2e-5 * f64::from(t);
            let charge = Charge { tissue_w: force * 0.02, ..CHARGE };
            assert_eq!(at(&mut tank, 0.0, force, &charge), force);
        }
    }

    /// Energy that a hand receives from a wall which is softer whenever the hand comes nearer [J].
    fn pumped(tank: &mut EnergyTank) -> f64 {
        let (mut received, mut before, mut force) = (0.0, 0.0, 0.0);
        for t in 0..1000 {
            let phase = 0.04 * f64::from(t);
            let z = 3e-3 * (1.0 - phase.cos());
            received -= force * (z - before);
            before = z;
            let stiffness = if phase.sin() > 0.0 { 100.0 } else { 400.0 };
            force = at(tank, z, stiffness * z, &Charge { stiffness_n_m: stiffness, tissue_w: 0.0 });
        }
        received
    }

    #[test]
    fn a_wall_that_changes_with_the_hand_gives_no_more_than_the_tank_has() {
        let (mut tank, mut open) = (EnergyTank::default(), EnergyTank::default());
        open.open();
        let most = FIRST_J + ALLOWANCE_W;
        let given = pumped(&mut tank);
        assert!(given <= most, "{given}");
        assert!(pumped(&mut open) > 10.0 * most);
    }
}
