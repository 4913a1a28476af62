//! Closed-form quality of tetrahedra.

use super::{TET_EDGES, TET_FACES, TetMesh, tet_volume};
use nalgebra::Vector3;

/// Quality measures of one tet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TetQuality {
    /// Mean ratio 12 (3|V|)^⅔ / Σ l², with the sign of V: 1 regular, 0 flat, negative inverted.
    ///
    /// # Source
    /// Liu, Joe 1994, "Relationship between tetrahedron shape measures".
    pub mean_ratio: f64,
    /// Smallest of the six dihedral angles [rad].
    pub min_dihedral_rad: f64,
    /// Largest of the six dihedral angles [rad].
    pub max_dihedral_rad: f64,
}

/// Worst and mean quality of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshQuality {
    /// Smallest mean ratio, and the tet with it.
    pub min_mean_ratio: (f64, usize),
    /// Average mean ratio.
    pub mean_mean_ratio: f64,
    /// Smallest dihedral angle [rad].
    pub min_dihedral_rad: f64,
    /// Largest dihedral angle [rad].
    pub max_dihedral_rad: f64,
}

impl TetQuality {
    /// Quality of the tet with corners `x` [m].
    pub fn of(x: &[Vector3<f64>; 4]) -> Self {
        let volume = tet_volume(x);
        let edges_squared: f64 = TET_EDGES.iter().map(|&[a, b]| (x[b] - x[a]).norm_squared()).sum();
        let mean_ratio = if edges_squared > 0.0 {
            volume.signum() * 12.0 * (3.0 * volume.abs()).powf(2.0 / 3.0) / edges_squared
        } else {
            0.0
        };
        let normal = TET_FACES.map(|[a, b, c]| (x[b] - x[a]).cross(&(x[c] - x[a])));
        let mut min_dihedral_rad = std::f64::consts::PI;
        let mut max_dihedral_rad: f64 = 0.0;
        for [a, b] in TET_EDGES {
            // Interior angle between faces a and b: π minus the angle between outward normals.
            let (n, m) = (normal[a], normal[b]);
            let angle = n.cross(&m).norm().atan2(-n.dot(&m));
            min_dihedral_rad = min_dihedral_rad.min(angle);
            max_dihedral_rad = max_dihedral_rad.max(angle);
        }
        Self { mean_ratio, min_dihedral_rad, max_dihedral_rad }
    }
}

impl TetMesh {
    /// Worst and average quality over all tets.
    pub fn quality(&self) -> MeshQuality {
        let mut worst = MeshQuality {
            min_mean_ratio: (f64::INFINITY, 0),
            mean_mean_ratio: 0.0,
            min_dihedral_rad: f64::INFINITY,
            max_dihedral_rad: 0.0,
        };
        for e in 0..self.tets.len() {
            let q = TetQuality::of(&self.corners(e));
            if q.mean_ratio < worst.min_mean_ratio.0 {
                worst.min_mean_ratio = (q.mean_ratio, e);
            }
            worst.mean_mean_ratio += q.mean_ratio / self.tets.len() as f64;
            worst.min_dihedral_rad = worst.min_dihedral_rad.min(q.min_dihedral_rad);
            worst.max_dihedral_rad = worst.max_dihedral_rad.max(q.max_dihedral_rad);
        }
        worst
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_regular_tet_is_perfect() {
        let x = [
            Vector3::new(1.0, 1.0, 1.0),
            Vector3::new(-1.0, 1.0, -1.0),
            Vector3::new(1.0, -1.0, -1.0),
            Vector3::new(-1.0, -1.0, 1.0),
        ];
        let q = TetQuality::of(&x);
        assert!((q.mean_ratio.abs() - 1.0).abs() < 1e-14);
        let regular = (1.0_f64 / 3.0).acos();
        assert!((q.min_dihedral_rad - regular).abs() < 1e-12);
        assert!((q.max_dihedral_rad - regular).abs() < 1e-12);
    }

    #[test]
    fn flat_inverted_and_collapsed_tets_stay_finite() {
        let corner = [Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()];
        let q = TetQuality::of(&corner);
        assert!((q.max_dihedral_rad - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        let inverted = [corner[0], corner[2], corner[1], corner[3]];
        assert!((TetQuality::of(&inverted).mean_ratio + q.mean_ratio).abs() < 1e-14);
        let flat = [corner[0], corner[1], corner[2], Vector3::new(0.3, 0.3, 0.0)];
        assert_eq!(TetQuality::of(&flat).mean_ratio, 0.0);
        let point = TetQuality::of(&[corner[0]; 4]);
        assert!(point.mean_ratio == 0.0 && point.min_dihedral_rad.is_finite());
    }
}
