//! Tools, obstacles and bodies meet: everything becomes springs for the solve.

use super::Simulation;
use crate::report::Level;

impl Simulation {
    /// Finds what acts on the bodies in this step. A surface that nothing can meet stays where it was.
    pub(super) fn touch(&mut self) {
        self.dormant.follow(&self.bodies);
        let h = self.scene.step_s;
        self.contacts.watch(&self.bodies, h);
        let tools = self.tools.any_active();
        for (i, body) in self.bodies.iter_mut().enumerate() {
            if !self.contacts.needs_surface(i, (tools, self.dormant.is_asleep(i))) {
                continue;
            }
            let (shown, positions) = body.surface_now();
            let (epoch, surface) = (shown.epoch(), (shown.surface(), shown.rest_positions()));
            if let Err(error) = self.contacts.update_surface(i, epoch, surface, positions) {
                self.report.tell(Level::Error, "contact-surface", &body.id, error.to_string());
            }
        }
        self.contacts.detect(&self.tools, h);
        self.contacts.press_edges(&self.tools, &mut self.bodies);
        self.dormant.disturb(&self.contacts);
        self.contacts.meet(&self.bodies, self.dormant.asleep(), h);
        self.dormant.join(&self.contacts);
        for (i, body) in self.bodies.iter().enumerate().filter(|(i, _)| !self.dormant.is_asleep(*i)) {
            self.contacts.rest(i, body, h, self.scene.gravity_m_s2);
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::inputs::Inputs;
    use crate::scene::Scene;

    /// A block over the floor and two blocks over each other, far from it; `lines` are more of the first.
    fn start(effects: &str, lines: &str) -> Simulation {
        let block = |id: &str, [x, z]: [f64; 2], lines: &str| {
            let (u, w) = (x + 0.06, z + 0.06);
            format!(
                r#"
                [[body]]
                id = "{id}"
                mesh = {{ box = {{ min_m = [{x}, 0, {z}], max_m = [{u}, 0.06, {w}], cells = [6, 6, 6] }} }}
                young_pa = 2e4
                poisson = 0.4
                density_kg_m3 = 1000
                rayleigh = {{ stiffness_s = 0.01 }}
                {lines}
            "#
            )
        };
        let text = format!(
            r#"
            schema = 1
            world = {{ gravity_m_s2 = [0, 0, -9.81], step_s = 0.01 }}
            effects = {{ {effects} }}
            [[obstacle]]
            id = "floor"
            half_space = {{ point_m = [0, 0, 0], normal = [0, 0, 1] }}
        "#
        );
        let blocks =
            [block("first", [0.0, 0.0], lines), block("low", [0.3, 0.0], ""), block("high", [0.31, 0.3], "")];
        let scene = Scene::from_toml(&(text + &blocks.concat())).unwrap();
        Simulation::new(&scene, Path::new("")).unwrap()
    }

    /// Per body the steps in which its surface did not follow.
    fn left(sim: &mut Simulation, steps: usize) -> [usize; 3] {
        let mut left = [0; 3];
        for _ in 0..steps {
            sim.step(&Inputs::default());
            (0..3).for_each(|i| left[i] += usize::from(sim.contacts.is_left(i)));
        }
        left
    }

    #[test]
    fn surfaces_follow_where_something_can_be_met() {
        let mut sim = start("body_collision = true", "");
        // The third block falls on the second one within 22 steps.
        assert_eq!(left(&mut sim, 18), [18; 3]);
        left(&mut sim, 4);
        assert_eq!(left(&mut sim, 10), [10, 0, 0]);
    }

    /// The first block is cut, and held on both sides of its wound, which is open from 0.1 s to 0.6 s.
    const WOUND: &str = r#"
        displacement_table = [[0, 0], [0.1, 1], [0.5, 1], [0.6, 0], [2, 0]]
        [[body.fix]]
        where = { slab = { axis = "x", from = 0.0, to = 0.01 } }
        displacement_m = [-0.01, 0, 0]
        [[body.fix]]
        where = { slab = { axis = "x", from = 0.99, to = 1.0 } }
        displacement_m = [0.01, 0, 0]
        [[cut]]
        body = "first"
        sweep_m = [[[0.031, -0.01, 0.07], [0.031, -0.01, 0.021]], [[0.031, 0.07, 0.07], [0.031, 0.07, 0.021]]]
    "#;

    #[test]
    fn an_open_wound_stays_where_it_was() {
        let mut sim = start("self_collision = true", WOUND);
        let [opening, ..] = left(&mut sim, 20);
        let [open, ..] = left(&mut sim, 28);
        left(&mut sim, 12);
        let [closed, ..] = left(&mut sim, 40);
        assert!(opening < 15, "{opening}");
        assert_eq!([open, closed], [28, 0]);
    }

    /// A tool far away lets all surfaces follow in all steps.
    #[test]
    fn surfaces_that_stay_change_no_bit() {
        let tool = r#"
            [[tool]]
            id = "far"
            shape = { sphere = { radius_m = 0.01 } }
            path = [{ at_s = 0.0, tip_m = [5, 5, 5] }, { at_s = 2.0, tip_m = [5, 5, 6] }]
        "#;
        let effects = "body_collision = true, self_collision = true, sleep = true";
        let [mut without, mut with] = ["", tool].map(|tool| start(effects, &format!("{WOUND}{tool}")));
        let (mut stayed, mut met) = ([0; 3], 0);
        for step in 0..140 {
            let all = left(&mut without, 1);
            (0..3).for_each(|i| stayed[i] += all[i]);
            assert_eq!(left(&mut with, 1), [0; 3]);
            met += usize::from(!without.touch_reports().is_empty());
            assert_eq!(without.touch_reports(), with.touch_reports(), "step {step}");
            for (one, other) in without.bodies.iter().zip(&with.bodies) {
                assert!(one.body.positions() == other.body.positions(), "step {step}");
            }
        }
        assert!(stayed.iter().all(|steps| *steps > 10) && met > 50, "{stayed:?} {met}");
    }
}
