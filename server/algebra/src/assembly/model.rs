//! The discrete model: elements with their quadrature points, a law, and the pattern of the tangent.

use nalgebra::{Matrix3, Vector3};
use scindo_matter::element::{ElementKind, Point, Points, Spring, deformation_gradient};
use scindo_matter::material::{Fibres, Lame, Law, Region, Regions};

use super::averaging::NodeAverage;
use super::mass::{MassSharing, Products};
use super::point::PointLaw;
use super::scratch::Scratch;
use super::viscous::Viscous;
use super::{BlockCsr, ModelError, Volumetric};

/// A discretised elastic body in double precision.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct Model {
    pub(super) kind: ElementKind,
    pub(super) volumetric: Volumetric,
    /// The law with the body's own constants.
    pub(super) point: PointLaw,
    /// Families of fibres in all elements.
    pub(super) fibres: Fibres,
    /// Terms of a Prony series in all elements.
    pub(super) viscous: Viscous,
    /// Regions with other constants, and the region of every element (piece, where the mesh is cut).
    pub(super) regions: Regions,
    /// Density [kg/m³] of the body. Regions of another density stand for as much volume as would have their mass.
    pub(super) density_kg_m3: f64,
    pub(super) rest: Vec<Vector3<f64>>,
    /// Nodes of every element, `kind.nodes()` each.
    pub(super) connectivity: Vec<u32>,
    /// ∇N_a [1/m] at rest, per element, point, node.
    pub(super) gradients: Vec<Vector3<f64>>,
    /// Weights [m³], per element and point.
    pub(super) weights: Vec<f64>,
    /// Σ of the weights of an element [m³].
    pub(super) volumes: Vec<f64>,
    /// Mean of ∇N_a over the element [1/m], per element and node; for [`Volumetric::Selective`].
    pub(super) mean_gradients: Vec<Vector3<f64>>,
    pub(super) averaging: Option<NodeAverage>,
    pub(super) springs: Vec<Spring>,
    /// Volume that each node's lumped mass stands for [m³].
    pub(super) lumped: Vec<f64>,
    /// ∫ N_a dV of every node [m³].
    pub(super) integrals: Vec<f64>,
    pub(super) products: Products,
    /// How mass is shared, if not by the integrals of the shape functions.
    pub(super) sharing: Option<MassSharing>,
    /// The tangent's pattern, without blocks.
    pub(super) pattern: BlockCsr<f64>,
    /// Position in the tangent of every block (a, b) of every element.
    pub(super) slots: Vec<u32>,
    /// Incidence of node n: entries e · nodes + a, ascending, from `incident_first[n]` on.
    pub(super) incident_first: Vec<u32>,
    pub(super) incident: Vec<u32>,
    /// First block of every [`ROWS`](super::parallel::ROWS) rows of the tangent, and the end of the last.
    pub(super) row_bounds: Vec<u32>,
    pub(super) scratch: Scratch,
}

impl Model {
    /// Element type; fixed when the model is built.
    pub fn kind(&self) -> ElementKind {
        self.kind
    }

    /// How the volumetric energy is integrated; fixed when the model is built.
    pub fn volumetric(&self) -> Volumetric {
        self.volumetric
    }

    /// Constitutive law; fixed when the model is built.
    pub fn law(&self) -> Law {
        self.point.law
    }

    /// Lamé parameters [Pa] of the elements outside regions.
    pub fn lame(&self) -> Lame {
        self.point.lame
    }

    /// Changes the elastic constants outside regions and recomputes nothing else.
    pub fn set_lame(&mut self, lame: Lame) {
        self.point.lame = lame;
    }

    /// Whether the material becomes stiffer as it is stretched.
    pub fn stiffens(&self) -> bool {
        !self.fibres.is_empty() || !self.law().is_hookean()
    }

    /// Puts families of fibres into all elements.
    ///
    /// # Errors
    /// A constant of them out of range.
    pub fn with_fibres(mut self, fibres: Fibres) -> Result<Self, ModelError> {
        fibres.check()?;
        self.fibres = fibres;
        Ok(self)
    }

    /// Families of fibres in all elements.
    pub fn fibres(&self) -> &Fibres {
        &self.fibres
    }

    /// The law with the constants of element `e`.
    #[inline]
    pub(super) fn point_of(&self, e: usize) -> PointLaw {
        if self.regions.is_empty() {
            return self.point;
        }
        let PointLaw { law, lame } = self.point;
        PointLaw { law, lame: self.regions.lame(self.regions.of(e), lame) }
    }

    /// Gives the elements of regions the constants of these. `regions` has one entry per element (piece, where the
    /// mesh is cut).
    ///
    /// # Errors
    /// Another number of elements, or a remedy against locking that averages over neighbours, which may be of
    /// another region.
    pub fn with_regions(mut self, regions: Regions) -> Result<Self, ModelError> {
        regions.check_length(self.n_elements())?;
        if self.averaging.is_some() && !regions.is_empty() {
            return Err(ModelError::AveragedRegions);
        }
        self.regions = regions;
        self.weigh_regions();
        Ok(self)
    }

    /// Regions of other materials, by element (piece, where the mesh is cut).
    pub fn element_regions(&self) -> &Regions {
        &self.regions
    }

    /// Number of nodes (copies, where the mesh is cut).
    pub fn n_nodes(&self) -> usize {
        self.rest.len()
    }

    /// Rest positions [m], length n_nodes.
    pub fn rest(&self) -> &[Vector3<f64>] {
        &self.rest
    }

    /// Number of elements (pieces, where the mesh is cut).
    pub fn n_elements(&self) -> usize {
        self.volumes.len()
    }

    /// Nodes of element `e`.
    pub fn element(&self, e: usize) -> &[u32] {
        let N = self.kind.nodes();
        &self.connectivity[e * N..][..N]
    }

    /// Rest volume [m³] of element `e`; where the mesh is cut, that of the piece.
    pub fn volume(&self, e: usize) -> f64 {
        self.volumes[e]
    }

    /// Weights [m³] of the quadrature points of element `e`.
    pub fn weights(&self, e: usize) -> &[f64] {
        let Q = self.kind.points();
        &self.weights[e * Q..][..Q]
    }

    /// Rest gradients ∇N_a [1/m] at point `q` of element `e`, one per node.
    pub fn gradients(&self, e: usize, q: usize) -> &[Vector3<f64>] {
        let (N, Q) = (self.kind.nodes(), self.kind.points());
        &self.gradients[(e * Q + q) * N..][..N]
    }

    /// F at point `q` of element `e` for the positions `x` [m].
    pub fn deformation_gradient(&self, e: usize, q: usize, x: &[Vector3<f64>]) -> Matrix3<f64> {
        match self.kind {
            ElementKind::Tet4 => self.gradient_at::<4>(e, q, x),
            ElementKind::Tet10 => self.gradient_at::<10>(e, q, x),
            ElementKind::Hex8 | ElementKind::Octree => self.gradient_at::<8>(e, q, x),
        }
    }

    fn gradient_at<const N: usize>(&self, e: usize, q: usize, x: &[Vector3<f64>]) -> Matrix3<f64> {
        deformation_gradient::<N>(&self.positions(e, x), self.gradients(e, q))
    }

    /// Positions of the nodes of element `e`.
    #[inline]
    pub(super) fn positions<const N: usize>(&self, e: usize, x: &[Vector3<f64>]) -> [Vector3<f64>; N] {
        let nodes = &self.connectivity[e * N..][..N];
        std::array::from_fn(|a| x[nodes[a] as usize])
    }

    /// Calls `visit` with the nodes of every group that hangs together: elements and springs.
    pub fn for_groups(&self, visit: &mut dyn FnMut(&[u32])) {
        (0..self.n_elements()).for_each(|e| visit(self.element(e)));
        self.springs.iter().for_each(|spring| visit(&[spring.a, spring.b]));
    }

    /// One-dimensional springs between nodes, as given to [`with_springs`](Self::with_springs).
    pub fn springs(&self) -> &[Spring] {
        &self.springs
    }

    /// Replaces the springs and finds the pattern of the tangent anew.
    pub fn with_springs(mut self, springs: Vec<Spring>) -> Result<Self, ModelError> {
        let n = self.n_nodes();
        let usable = |s: &Spring| {
            let number = |v: f64| v.is_finite() && v >= 0.0;
            s.a != s.b
                && (s.a as usize) < n
                && (s.b as usize) < n
                && number(s.stiffness_n_m)
                && number(s.rest_length_m)
        };
        if let Some(spring) = springs.iter().position(|s| !usable(s)) {
            return Err(ModelError::Spring { spring });
        }
        self.springs = springs;
        self.find_pattern();
        Ok(self)
    }

    /// A zero matrix with the pattern of the tangent and of the consistent mass.
    pub fn pattern(&self) -> BlockCsr<f64> {
        let mut matrix = self.pattern.clone();
        matrix.blocks.resize(matrix.columns.len(), [0.0; 9]);
        matrix
    }

    /// Finds which blocks the tangent stores, and the position of those of each element.
    pub(super) fn find_pattern(&mut self) {
        let N = self.kind.nodes();
        let mut rows: Vec<Vec<u32>> = vec![Vec::new(); self.n_nodes()];
        for nodes in self.connectivity.chunks_exact(N) {
            for &a in nodes {
                rows[a as usize].extend_from_slice(nodes);
            }
        }
        for spring in &self.springs {
            rows[spring.a as usize].push(spring.b);
            rows[spring.b as usize].push(spring.a);
        }
        // Averaging couples every two nodes around a third.
        if let Some(averaging) = &self.averaging {
            for node in 0..self.rest.len() {
                let star = averaging.star(node);
                for &a in star {
                    rows[a as usize].extend_from_slice(star);
                }
            }
        }
        let mut pattern: BlockCsr<f64> = BlockCsr::with_rows(rows);
        pattern.blocks = Vec::new();
        self.slots.clear();
        // Positions are looked up once, so that assembly adds without searching.
        for nodes in self.connectivity.chunks_exact(N) {
            for &a in nodes {
                let row = pattern.row(a as usize);
                let columns = &pattern.columns[row.clone()];
                self.slots.extend(
                    nodes.iter().map(|b| (row.start + columns.partition_point(|column| column < b)) as u32),
                );
            }
        }
        self.pattern = pattern;
        self.find_incidence();
        self.find_row_bounds();
    }
}

impl Points for Model {
    fn for_points(&self, x: &[Vector3<f64>], visit: &mut dyn FnMut(Point<'_>)) {
        for element in 0..self.n_elements() {
            for (q, &weight) in self.weights(element).iter().enumerate() {
                let (nodes, gradients) = (self.element(element), self.gradients(element, q));
                let F = self.deformation_gradient(element, q, x);
                let region = self.regions.of(element);
                visit(Point { element, nodes, gradients, weight, F, region });
            }
        }
    }

    fn regions(&self) -> &[Region] {
        self.regions.constants()
    }
}
