//! Queries of a body's discretisation: elements, material points, copies, parts, rest positions.
//!
//! Nothing outside this crate reads the state of the cuts itself, so that any [`Space`](crate::space::Space)
//! can answer the same queries.

use nalgebra::Vector3;
use scindo_matter::cut::{Components, Flaws, Solid, Surface};
use scindo_matter::element::MaterialPoint;

use super::Body;
use crate::space::{RestPoint, Tets, VisitPiece};

impl Body {
    /// Topology epoch; rises with every cut that changes the surface and with every reset.
    pub fn epoch(&self) -> u32 {
        self.space.epoch()
    }

    /// The tetrahedra with their mesh and pieces, if the body consists of them.
    pub fn tets(&self) -> Option<&Tets> {
        self.space.tets()
    }

    /// Box around the body at rest, lower and upper corner [m].
    pub fn bounds(&self) -> [Vector3<f64>; 2] {
        self.space.bounds()
    }

    /// Side of a typical element at rest [m]: of the finest cells, or of a cube that consists of six
    /// tetrahedra of mean volume.
    pub fn element_size(&self) -> f64 {
        self.space.element_size()
    }

    /// Volume at rest [m³].
    pub fn rest_volume(&self) -> f64 {
        self.space.copy_volumes().iter().sum()
    }

    /// Finite elements of the uncut body.
    pub fn n_elements(&self) -> usize {
        self.space.n_elements()
    }

    /// Number of pieces that cuts made of the elements; that of the elements in a body that cannot be cut.
    pub fn n_pieces(&self) -> usize {
        self.space.n_pieces()
    }

    /// Number of nodes of the uncut body, including those that quadratic elements add.
    pub fn n_nodes(&self) -> usize {
        self.space.n_nodes()
    }

    /// Number of copies of the mesh's nodes, without the nodes that quadratic elements add. Each copy has
    /// its own degrees of freedom.
    pub fn n_copies(&self) -> usize {
        self.space.n_copies()
    }

    /// For every copy, the node of the mesh that it is a copy of.
    pub fn node_of_copy(&self) -> &[u32] {
        self.space.node_of_copy()
    }

    /// Calls `visit` for every part that fills the volume without overlap and moves with its own copies: its
    /// entry in [`cauchy_stresses`](Self::cauchy_stresses), its copies, and ∫ N_a dV [m³] over it for each of
    /// them.
    pub fn for_pieces(&self, visit: &mut VisitPiece<'_>) {
        self.space.for_pieces(visit);
    }

    /// Finds a material point by its rest position [m]. If it lies on a cut or between elements, `side` points
    /// to the side that it belongs to. `None` outside the body.
    pub fn locate(&self, point: Vector3<f64>, side: Option<Vector3<f64>>) -> Option<RestPoint> {
        self.space.locate(point, side)
    }

    /// Finds the material points that are at `points` [m] now: each in the element in which it lies deepest, `None`
    /// outside the body. While a [cut is under way](Self::is_being_cut) nothing is found.
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
    /// let mut found = Vec::new();
    /// body.material_at(&[Vector3::repeat(0.04), Vector3::repeat(0.2)], &mut found);
    /// let inside = found[0].expect("in the block");
    /// assert!((inside.position(body.positions()) - Vector3::repeat(0.04)).norm() < 1e-12);
    /// assert!(found[1].is_none());
    /// # Ok::<(), scindo_physics::body::BodyError>(())
    /// ```
    pub fn material_at(&mut self, points: &[Vector3<f64>], found: &mut Vec<Option<MaterialPoint>>) {
        found.clear();
        if self.is_being_cut() {
            found.resize(points.len(), None);
        } else {
            self.space.material_at(&self.state.x, points, found);
            found.resize(points.len(), None);
        }
    }

    /// Nodes and shape functions (Σ = 1) that carry a material point now. If cuts have replaced the mesh since
    /// it was located, its element is found again.
    pub fn carriers(&self, point: &mut RestPoint) -> Vec<(u32, f64)> {
        if let (Some(_), Some(tets)) = (&self.snap, self.space.tets()) {
            *point = tets.locate_again(point);
        }
        self.space.carriers(point)
    }

    /// The boundary of the elements and the lips of cuts, whatever skin is shown.
    pub fn element_surface(&self) -> &Surface {
        self.space.element_surface()
    }

    /// Whether [`cut`](Self::cut) and [`begin_cut`](Self::begin_cut) open the body.
    pub fn can_be_cut(&self) -> bool {
        self.space.can_be_cut()
    }

    /// Parts of the material that are connected through faces, and their rest volumes.
    pub fn components(&self) -> Components {
        self.space.components()
    }

    /// The material as tetrahedra or hexahedra that fill it without overlap, for export.
    pub fn solid(&self) -> Solid {
        self.space.solid()
    }

    /// Violations of the invariants of the cut state; beyond rounding there must be none, whatever was cut.
    pub fn flaws(&self) -> Flaws {
        self.space.flaws()
    }
}
