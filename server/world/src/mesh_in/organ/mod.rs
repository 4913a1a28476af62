//! Built-in bodies: organ-like shapes from implicit surfaces, selected by name.
//!
//! The program triangulates them and fills the triangles with a lattice, on the same path as a surface file
//! of a user. They are generated whenever they are needed, so the program ships no mesh files.

mod distance;
mod shapes;

use nalgebra::Vector3;
use schemars::JsonSchema;
use scindo_physics::mesh::TetMesh;
use serde::{Deserialize, Serialize};

use super::implicit::triangulate;
use super::lattice::{LatticeReport, lattice_observed};
use super::progress::Observer;
use crate::format::{MeshInError, SurfaceMesh};

/// Built-in shapes, with their long axis along x, top towards +z, centred at x = y = 0.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Organ {
    /// Two lobes with a groove, 160 × 104 × 63 mm, from z = 0 up.
    #[default]
    Liver,
    /// A bean with a growth on one end, 112 × 66 × 48 mm, from z = 0 up.
    Kidney,
    /// A tube that forks, 120 × 84 × 20 mm, its axis at z = 0.
    Vessel,
    /// A thin dome over a ring, 132 × 132 × 38 mm, from z = 0 up.
    Diaphragm,
    /// A muscle between a tendon and three strands, 190 × 62 × 34 mm, its axis at z = 0.
    Tendon,
    /// A folded half dome, 132 × 92 × 62 mm, flat below at z = 0.
    Brain,
    /// The last joint of a finger, pad up, 62 × 36 × 30 mm, from z = 0 up.
    Fingertip,
}

/// A signed distance [m], the box that contains the shape [m], and the side of the cubes that triangulate it
/// [m].
struct Solid {
    distance: fn(&Vector3<f64>) -> f64,
    low: [f64; 3],
    high: [f64; 3],
    spacing_m: f64,
}

impl Organ {
    /// Every shape, in the order of the enumeration.
    pub const ALL: [Self; 7] = [
        Self::Liver,
        Self::Kidney,
        Self::Vessel,
        Self::Diaphragm,
        Self::Tendon,
        Self::Brain,
        Self::Fingertip,
    ];

    /// Name in scenes and on the command line, in kebab case.
    pub fn name(self) -> &'static str {
        match self {
            Self::Liver => "liver",
            Self::Kidney => "kidney",
            Self::Vessel => "vessel",
            Self::Diaphragm => "diaphragm",
            Self::Tendon => "tendon",
            Self::Brain => "brain",
            Self::Fingertip => "fingertip",
        }
    }

    /// The shape with this name, if there is one.
    pub fn of_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|organ| organ.name() == name)
    }

    fn solid(self) -> Solid {
        let (distance, low, high, spacing_m): (fn(&Vector3<f64>) -> f64, _, _, _) = match self {
            Self::Liver => (shapes::liver, [-0.1, -0.07, -0.02], [0.1, 0.07, 0.085], 0.004),
            Self::Kidney => (shapes::kidney, [-0.070, -0.060, -0.010], [0.070, 0.060, 0.060], 0.003),
            Self::Vessel => (shapes::vessel, [-0.070, -0.060, -0.020], [0.090, 0.060, 0.020], 0.0015),
            Self::Diaphragm => (shapes::diaphragm, [-0.075, -0.075, -0.006], [0.075, 0.075, 0.045], 0.002),
            Self::Tendon => (shapes::tendon, [-0.110, -0.040, -0.030], [0.110, 0.040, 0.030], 0.0025),
            Self::Brain => (shapes::brain, [-0.075, -0.055, -0.010], [0.075, 0.055, 0.070], 0.0022),
            Self::Fingertip => (shapes::fingertip, [-0.040, -0.025, -0.010], [0.040, 0.025, 0.040], 0.002),
        };
        Solid { distance, low, high, spacing_m }
    }

    /// Its triangulated surface [m].
    pub fn surface(self) -> SurfaceMesh {
        let Solid { distance, low, high, spacing_m } = self.solid();
        triangulate(self.name(), &distance, low.into(), high.into(), spacing_m)
    }

    /// The shape filled with a lattice of `cells` cubes along its longest side. Positions are in metres.
    ///
    /// # Errors
    /// If `cells` is outside the range of the lattice.
    pub fn mesh(self, cells: usize) -> Result<(TetMesh, LatticeReport), MeshInError> {
        self.observed(cells, &|_| ())
    }

    /// The same, with progress reports to `observer`.
    ///
    /// # Errors
    /// Those of [`Organ::mesh`].
    pub fn observed(
        self,
        cells: usize,
        observer: &Observer<'_>,
    ) -> Result<(TetMesh, LatticeReport), MeshInError> {
        lattice_observed(&self.surface(), cells, 1.0, observer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_organ_is_clean_smooth_and_of_organ_size() {
        let (mesh, report) = Organ::Liver.mesh(20).unwrap();
        assert!(report.surface.is_clean(), "{report}");
        let size = Vector3::from(report.surface.max_m) - Vector3::from(report.surface.min_m);
        assert!((0.14..0.18).contains(&size.x) && size.y < 0.11 && size.z < 0.07, "{size}");
        assert!(report.min_dihedral_deg > 8.0 && report.volume_error.abs() < 0.02, "{report}");
        assert_eq!((report.components, report.removed_tets), (1, 0));
        assert!(mesh.tets.len() > 5_000, "{}", mesh.tets.len());
    }

    #[test]
    fn every_shape_is_one_closed_body_of_the_size_it_is_said_to_have() {
        for (organ, length_m) in Organ::ALL.into_iter().zip([0.160, 0.112, 0.120, 0.132, 0.190, 0.132, 0.062])
        {
            let surface = organ.surface();
            let bound = |pick: fn(f64, f64) -> f64, start: f64| {
                surface.vertices.iter().map(|v| v.x).fold(start, pick)
            };
            let length = bound(f64::max, f64::MIN) - bound(f64::min, f64::MAX);
            let name = organ.name();
            assert!((length / length_m - 1.0).abs() < 0.06, "{name} is {length} m long");
            let cells = match organ {
                Organ::Diaphragm => 40,
                Organ::Vessel => 34,
                _ => 24,
            };
            let (_, report) = organ.mesh(cells).unwrap();
            assert!(report.surface.is_clean() && report.components == 1, "{name}: {report}");
            assert_eq!(Organ::of_name(name), Some(organ));
        }
    }
}
