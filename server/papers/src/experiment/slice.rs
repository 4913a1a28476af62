//! A slice that is cut off a cube, and falls and rotates: small strains beside large ones.
//!
//! # Source
//! Jeřábková 2007, section 3.1.2, figure 3.7.

use std::time::Instant;

use nalgebra::Vector3;
use scindo_physics::body::{Body, BodySettings, Outcome, PcgSettings, Scheme};
use scindo_physics::cut::BladeSweep;
use scindo_physics::material::{Law, Material, Rayleigh};
use scindo_physics::mesh::{BoxPattern, box_mesh};
use scindo_study::report::chart::{Chart, Line};
use scindo_study::report::result::Plots;
use scindo_study::report::result::{ExperimentResult, Table, Unit};
use scindo_study::report::view;

use crate::lab::{ExperimentBench, LAWS, Trouble, hold_left};

type V = Vector3<f64>;

/// Edge of the cube [m], and its cells, of five tetrahedra each, along an edge.
const SIDE_M: f64 = 0.1;
const CELLS: usize = 8;
/// Where the blade enters the upper side and leaves the lower one [m].
const CUT_M: [f64; 2] = [0.083, 0.071];
const STEP_S: f64 = 0.005;
/// The slice begins to turn at a speed by which it has turned by so much after so many steps [°].
const TURN_DEG: f64 = 60.0;
const STEPS: usize = 40;
/// Angles that are drawn and listed [°].
const SHOWN_DEG: [f64; 3] = [15.0, 30.0, 60.0];
const GRAVITY: V = V::new(0.0, 0.0, -9.81);

const MATERIAL: Material = Material {
    young_pa: 2e4,
    poisson: 0.4,
    density_kg_m3: 1000.0,
    rayleigh: Rayleigh { mass_1_s: 0.0, stiffness_s: 0.002 },
    law: Law::Linear,
};

/// The fall of a slice under one law.
struct Fall {
    body: Body,
    /// Part of the slice.
    part: u32,
    /// Volume of the slice at rest [m³].
    volume_m3: f64,
    steps: usize,
    seconds: f64,
}

/// The experiment.
///
/// # Errors
/// A body could not be made, a step was refused, or the user ended the study.
pub(super) fn slice(bench: &mut ExperimentBench<'_>) -> Result<ExperimentResult, Trouble> {
    let mut result = ExperimentResult {
        name: "slice",
        title: "A slice falls and rotates: linear beside nonlinear".into(),
        about: format!(
            "A slice is cut off a cube of 10 cm, falls, and turns by {TURN_DEG:.0}° in {:.1} s. Nothing deforms it, so it \
             should keep its volume. Cauchy's strain takes its rotation for a compression, and it grows as if that had to \
             be undone: by 1/cos² of its angle in equilibrium. The corotational law takes the rotation away first; Green's \
             strain (St Venant–Kirchhoff) and the stable neo-Hookean law do not see it.",
            STEPS as f64 * STEP_S
        ),
        ..ExperimentResult::default()
    };
    let mut table = Table::new(
        "Volume of the slice over that at rest",
        "By the angle that it has turned, and the mean time of a step on one thread.",
        &[
            ("after 15°", Unit::Times),
            ("after 30°", Unit::Times),
            ("after 60°", Unit::Times),
            ("step", Unit::Seconds),
        ],
    );
    let mut chart = Chart::new("Volume of the slice", "angle [°]", "volume over that at rest");
    for (law, name) in LAWS {
        bench.begin(format!("{name} law"), LAWS.len())?;
        let mut fall = Fall::begin(law)?;
        let (mut values, mut points) = (Vec::new(), vec![[0.0, 1.0]]);
        for angle in SHOWN_DEG {
            while fall.angle_deg() < angle - 1e-9 {
                fall.step()?;
                points.push([fall.angle_deg(), fall.growth()]);
            }
            values.push(Some(fall.growth()));
            if [Law::Linear, Law::StVenantKirchhoff].contains(&law) {
                let caption = format!("{name}, {angle:.0}°");
                result.pictures.push(view::body(&fall.body, caption));
            }
        }
        values.push(Some(fall.seconds / fall.steps as f64));
        table.row(name, &values);
        chart.lines.push(Line { name: name.into(), points });
    }
    result.tables.push(table);
    let caption = "What the slice grows by as it turns.";
    result.plots.push(Plots { caption: caption.into(), charts: vec![chart], ..Plots::default() });
    Ok(result)
}

impl Fall {
    fn begin(law: Law) -> Result<Self, Trouble> {
        let mesh = box_mesh(V::zeros(), V::repeat(SIDE_M), [CELLS; 3], BoxPattern::Tet5 { parity: false });
        let solver = PcgSettings { iterations: 500, tolerance: 1e-6 };
        let settings = BodySettings { scheme: Scheme::ImplicitEuler, solver, ..BodySettings::default() };
        let mut body = Body::new(mesh, Material { law, ..MATERIAL }, settings)?;
        hold_left(&mut body)?;
        let at = |x: f64, z: f64| [V::new(x, -0.01, z), V::new(x, SIDE_M + 0.01, z)];
        let [above, below] = CUT_M;
        // From a centimetre above the cube to one below it.
        let beyond = 0.1 * (above - below);
        let segments = vec![at(above + beyond, 1.1 * SIDE_M), at(below - beyond, -0.1 * SIDE_M)];
        body.cut(&BladeSweep { segments }, 1)?;
        let loose = body.parts().free.iter().position(|free| *free).ok_or("the slice is not loose")?;
        let mut fall = Self { body, part: loose as u32, volume_m3: 0.0, steps: 0, seconds: 0.0 };
        fall.volume_m3 = fall.volume();
        fall.turn()?;
        Ok(fall)
    }

    /// Gives the slice its angular velocity about the axis y through its centre.
    fn turn(&mut self) -> Result<(), Trouble> {
        let x = self.body.positions().to_vec();
        let is_slice = |copy: usize| self.body.parts().of_copy[copy] == self.part;
        let of_slice = || x.iter().zip(self.body.masses()).enumerate().filter(|(copy, _)| is_slice(*copy));
        let mass: f64 = of_slice().map(|(_, (_, m))| m).sum();
        let centre = of_slice().map(|(_, (x, m))| *m * x).sum::<V>() / mass;
        let omega = V::y() * (TURN_DEG.to_radians() / (STEPS as f64 * STEP_S));
        let v: Vec<V> = (0..x.len())
            .map(|copy| if is_slice(copy) { omega.cross(&(x[copy] - centre)) } else { V::zeros() })
            .collect();
        Ok(self.body.set_state(&x, &v)?)
    }

    fn step(&mut self) -> Result<(), Trouble> {
        let begun = Instant::now();
        let report = self.body.step(STEP_S, GRAVITY, &[]);
        self.seconds += begun.elapsed().as_secs_f64();
        self.steps += 1;
        match report.outcome {
            Outcome::Advanced => Ok(()),
            other => Err(format!("a step was refused: {other:?}").into()),
        }
    }

    /// The angle by which a rigid slice has turned.
    fn angle_deg(&self) -> f64 {
        TURN_DEG * self.steps as f64 / STEPS as f64
    }

    fn growth(&self) -> f64 {
        self.volume() / self.volume_m3
    }

    /// Volume within the surface of the slice [m³].
    fn volume(&self) -> f64 {
        let surface = self.body.surface();
        let x = self.body.positions();
        let of_copy = &self.body.parts().of_copy;
        let of_slice = surface.triangles.iter().filter(|corners| {
            of_copy[surface.vertices[corners[0] as usize].main_copy() as usize] == self.part
        });
        let six = |corners: &[u32; 3]| {
            let [a, b, c] = corners.map(|v| surface.vertices[v as usize].position(x));
            a.dot(&b.cross(&c))
        };
        of_slice.map(six).sum::<f64>() / 6.0
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn only_the_linear_law_sees_a_rotation() {
        for (law, name) in LAWS {
            let mut fall = Fall::begin(law).unwrap();
            (0..STEPS).for_each(|_| fall.step().unwrap());
            let growth = fall.growth();
            match law {
                Law::Linear => assert!(growth > 1.5, "{growth}"),
                _ => assert!((growth - 1.0).abs() < 0.02, "{name}: {growth}"),
            }
        }
    }
}
