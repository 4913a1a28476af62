//! A discretisation and its stiffness from another crate make a body as those of this crate do.

use std::any::Any;
use std::borrow::Cow;

use nalgebra::{Matrix3, Vector3};
use scindo_physics::assembly::{Model, ModelError, Volumetric};
use scindo_physics::body::{Body, BodySettings, CuttingMethod, OperatorChoice, Scheme};
use scindo_physics::cut::{
    BladeSweep, Components, CutError, CutMesh, CutReport, Flaws, IncisionMark, Solid, Surface, Work,
};
use scindo_physics::element::ElementKind;
use scindo_physics::element::{Point, Points, Simd};
use scindo_physics::material::{Law, Material};
use scindo_physics::mesh::{BoxPattern, MeshError, TetMesh, box_mesh};
use scindo_physics::operator::{
    Block6, Direction, ElasticUpdate, Padded, Place, StiffModes, Stiffness, Tension,
};
use scindo_physics::skin::{OwnSurface, Skin, SkinError, SkinSettings, SkinShape};
use scindo_physics::space::{RestPoint, Space, Tets, VisitPiece};
use scindo_physics::team::Team;

use super::{DOWN, SOFT, left_face, settings};

/// A block of 2×6×2 cubes of 0.05 m.
fn block() -> TetMesh {
    box_mesh(Vector3::zeros(), Vector3::new(0.1, 0.3, 0.1), [2, 6, 2], BoxPattern::Tet6)
}

/// From its base sideways through half of the block.
fn blade() -> BladeSweep {
    let segment = |x: f64| [Vector3::new(x, 0.16, -0.01), Vector3::new(x, 0.16, 0.11)];
    BladeSweep { segments: vec![segment(-0.01), segment(0.06)] }
}

/// Whether every position of a hanging block is the same to the bit, before and after a cut.
fn assert_same_motion(law: Law, scheme: Scheme, fast: bool, says: bool) {
    let material = Material { young_pa: 2e3, law, ..SOFT };
    let settings = BodySettings { scheme, ..settings(200, 1e-6) };
    let own = Body::new(block(), material, settings).unwrap();
    let foreign = Lattice { tets: Tets::linear(CutMesh::new(block()).unwrap()), says };
    let foreign = Body::of_space(Box::new(foreign), material, settings).unwrap();
    let mut bodies = [own, foreign];
    for body in &mut bodies {
        assert_eq!(body.is_fast(), fast);
        let held = left_face(body);
        body.fix(&held, [true; 3], Vector3::zeros()).unwrap();
    }
    let mut moved = 0.0_f64;
    for step in 0..10 {
        for body in &mut bodies {
            if step == 4 {
                assert!(!body.cut(&blade(), 1).unwrap().new_copies.is_empty());
            }
            body.step(0.01, DOWN, &[]);
            let pairs = body.positions().iter().zip(body.rest_positions());
            moved = pairs.map(|(x, X)| (x - X).norm()).fold(moved, f64::max);
        }
        assert_eq!(bodies[0].positions(), bodies[1].positions(), "{law:?} {scheme:?} step {step}");
    }
    assert!(moved > 1e-2, "{law:?} {scheme:?}: {moved} m");
}

#[test]
fn a_foreign_space_moves_like_the_one_it_hands_on_to() {
    for says in [true, false] {
        assert_same_motion(Law::Corotational, Scheme::ImplicitEuler, true, says);
        assert_same_motion(Law::NeoHookean, Scheme::ImplicitEuler, true, says);
        assert_same_motion(Law::NeoHookean, Scheme::SymplecticEuler, false, says);
    }
}

/// Whoever asks about any body gets the same answers from one whose tetrahedra are hidden.
#[test]
fn a_space_without_tetrahedra_answers_what_any_body_is_asked() {
    let foreign = |says| {
        let space = Lattice { tets: Tets::linear(CutMesh::new(block()).unwrap()), says };
        let mut body = Body::of_space(Box::new(space), SOFT, settings(200, 1e-6)).unwrap();
        let held = left_face(&body);
        body.fix(&held, [true; 3], Vector3::zeros()).unwrap();
        body.cut(&blade(), 1).unwrap();
        for _ in 0..3 {
            body.step(0.01, DOWN, &[]);
        }
        body
    };
    let [own, hidden] = [true, false].map(foreign);
    assert!(own.tets().is_some() && hidden.tets().is_none());
    assert_eq!(own.bounds(), hidden.bounds());
    assert_eq!(own.element_size(), hidden.element_size());
    assert_eq!((own.n_elements(), own.n_pieces()), (hidden.n_elements(), hidden.n_pieces()));
    assert!(own.n_pieces() > own.n_elements() && hidden.can_be_cut());
    assert_eq!(own.cauchy_stresses(), hidden.cauchy_stresses());
    assert_eq!((own.solid(), own.swept_area(&blade())), (hidden.solid(), hidden.swept_area(&blade())));
    let lip = |side: Vector3<f64>, body: &Body| {
        let mut point = body.locate(Vector3::new(0.02, 0.16, 0.05), Some(side)).unwrap();
        body.carriers(&mut point)
    };
    assert_eq!(lip(Vector3::y(), &own), lip(Vector3::y(), &hidden));
    assert_ne!(lip(Vector3::y(), &own), lip(-Vector3::y(), &own), "the lips move apart");
    assert!(own.locate(Vector3::new(0.02, 0.31, 0.05), None).is_none());
}

/// The energy balance of Newmark's method asks the stiffness for the energy.
#[test]
fn a_foreign_stiffness_balances_the_energy_of_newmarks_method() {
    assert_same_motion(Law::Corotational, Scheme::Newmark { beta: 0.25, gamma: 0.5 }, true, true);
}

/// Cutting along faces makes new tetrahedra, which no other space could take over.
#[test]
fn a_foreign_space_is_not_cut_along_faces() {
    let space = Box::new(Lattice { tets: Tets::linear(CutMesh::new(block()).unwrap()), says: true });
    let settings = BodySettings { cutting: CuttingMethod::Snap, ..settings(200, 1e-6) };
    let error = Body::of_space(space, SOFT, settings).unwrap_err().to_string();
    assert!(error.contains("cutting that changes the mesh"), "{error}");
}

/// Hands everything on to tetrahedra.
#[derive(Clone, Debug)]
struct Lattice {
    tets: Tets,
    /// Whether it says that it consists of tetrahedra.
    says: bool,
}

/// Hands everything on to the stiffness of tetrahedra, but numbers the places of pieces itself.
#[derive(Debug)]
struct Kernel {
    elastic: Box<dyn Stiffness>,
    places: Vec<Place>,
}

impl Stiffness for Kernel {
    fn update(
        &mut self,
        team: &mut Team,
        with: &ElasticUpdate,
        positions: &[Vector3<f64>],
        tension: Option<&Tension<'_>>,
    ) -> usize {
        self.elastic.update(team, with, positions, tension)
    }

    fn energy(&mut self, team: &mut Team, with: &ElasticUpdate, positions: &[Vector3<f64>]) -> Option<f64> {
        self.elastic.energy(team, with, positions)
    }

    fn forces(&self, block: usize, f: &mut [Padded]) {
        self.elastic.forces(block, f);
    }

    fn diagonals(&self, block: usize, diagonal: &mut [Block6]) {
        self.elastic.diagonals(block, diagonal);
    }

    fn version(&self) -> u64 {
        self.elastic.version()
    }

    fn multiply(&mut self, team: &mut Team, x: &[Padded]) {
        self.elastic.multiply(team, x);
    }

    fn multiply_damping(&mut self, team: &mut Team, x: &[Padded]) {
        self.elastic.multiply_damping(team, x);
    }

    fn multiply_direction(&mut self, team: &mut Team, z: &[Padded], beta: f32) {
        self.elastic.multiply_direction(team, z, beta);
    }

    fn add_products(&self, block: usize, y: &mut [Padded]) {
        self.elastic.add_products(block, y);
    }

    fn advance(&self, block: usize, with: &Direction<'_>, p: &mut [Padded], q: &mut [Padded]) -> f64 {
        self.elastic.advance(block, with, p, q)
    }

    fn set_choice(&mut self, choice: OperatorChoice) {
        self.elastic.set_choice(choice);
    }

    fn choice(&self) -> OperatorChoice {
        self.elastic.choice()
    }

    fn places(&self) -> Cow<'_, [Place]> {
        (0..self.places.len() as u32).map(|lane| Place { chunk: 7, batch: 7, lane }).collect()
    }

    fn rotation(&self, place: Place) -> Matrix3<f32> {
        self.elastic.rotation(self.places[place.lane as usize])
    }
}

impl Points for Lattice {
    fn for_points(&self, x: &[Vector3<f64>], visit: &mut dyn FnMut(Point<'_>)) {
        self.tets.for_points(x, visit);
    }
}

impl Space for Lattice {
    fn kind(&self) -> ElementKind {
        self.tets.kind()
    }

    fn can_be_cut(&self) -> bool {
        self.tets.can_be_cut()
    }

    fn can_carry_skin(&self, own: bool) -> bool {
        self.tets.can_carry_skin(own)
    }

    fn tets(&self) -> Option<&Tets> {
        self.says.then_some(&self.tets)
    }

    fn bounds(&self) -> [Vector3<f64>; 2] {
        self.tets.bounds()
    }

    fn element_size(&self) -> f64 {
        self.tets.element_size()
    }

    fn n_elements(&self) -> usize {
        self.tets.n_elements()
    }

    fn n_nodes(&self) -> usize {
        self.tets.n_nodes()
    }

    fn node_of_copy(&self) -> &[u32] {
        self.tets.node_of_copy()
    }

    fn copies_with_node(&self, node: u32) -> Vec<u32> {
        self.tets.copies_with_node(node)
    }

    fn rest_positions(&self) -> Vec<Vector3<f64>> {
        self.tets.rest_positions()
    }

    fn copy_volumes(&self) -> &[f64] {
        self.tets.copy_volumes()
    }

    fn areas(&self, selected: &[bool]) -> Vec<f64> {
        self.tets.areas(selected)
    }

    fn volumes(&self, selected: &[bool]) -> Vec<f64> {
        self.tets.volumes(selected)
    }

    fn n_pieces(&self) -> usize {
        self.tets.n_pieces()
    }

    fn for_pieces(&self, visit: &mut VisitPiece<'_>) {
        self.tets.for_pieces(visit);
    }

    fn for_groups(&self, visit: &mut dyn FnMut(&[u32])) {
        self.tets.for_groups(visit);
    }

    fn has_changed(&self) -> bool {
        self.tets.has_changed()
    }

    fn for_changed_groups(&self, visit: &mut dyn FnMut(&[u32])) {
        self.tets.for_changed_groups(visit);
    }

    fn for_groups_around(&self, copy: u32, visit: &mut dyn FnMut(&[u32])) {
        self.tets.for_groups_around(copy, visit);
    }

    fn locate(&self, point: Vector3<f64>, side: Option<Vector3<f64>>) -> Option<RestPoint> {
        self.tets.locate(point, side)
    }

    fn carriers(&self, point: &RestPoint) -> Vec<(u32, f64)> {
        self.tets.carriers(point)
    }

    fn components(&self) -> Components {
        self.tets.components()
    }

    fn solid(&self) -> Solid {
        self.tets.solid()
    }

    fn flaws(&self) -> Flaws {
        self.tets.flaws()
    }

    fn epoch(&self) -> u32 {
        self.tets.epoch()
    }

    fn set_epoch(&mut self, epoch: u32) {
        self.tets.set_epoch(epoch);
    }

    fn surface(&self) -> &Surface {
        self.tets.surface()
    }

    fn element_surface(&self) -> &Surface {
        self.tets.element_surface()
    }

    fn incision_marks(&self) -> Vec<IncisionMark> {
        self.tets.incision_marks()
    }

    fn skin(&self) -> Option<&Skin> {
        self.tets.skin()
    }

    fn put_on_skin(
        &mut self,
        settings: SkinSettings,
        own: Option<&OwnSurface<'_>>,
        shape: &mut SkinShape<'_>,
    ) -> Result<(), SkinError> {
        self.tets.put_on_skin(settings, own, shape)
    }

    fn spoil_skin(&mut self) {
        self.tets.spoil_skin();
    }

    fn swept_area(&self, x: &[Vector3<f64>], blade: &BladeSweep) -> f64 {
        self.tets.swept_area(x, blade)
    }

    fn cut(
        &mut self,
        team: &mut Team,
        x: &[Vector3<f64>],
        blade: &BladeSweep,
        incision: u32,
    ) -> Result<CutReport, CutError> {
        self.tets.cut(team, x, blade, incision)
    }

    fn begin_cut(
        &mut self,
        team: &mut Team,
        x: &[Vector3<f64>],
        blade: &BladeSweep,
        incision: u32,
    ) -> Result<(), CutError> {
        self.tets.begin_cut(team, x, blade, incision)
    }

    fn go_on_cutting(&mut self, team: &mut Team, work: &mut Work) -> Option<CutReport> {
        self.tets.go_on_cutting(team, work)
    }

    fn is_being_cut(&self) -> bool {
        self.tets.is_being_cut()
    }

    fn reset(&mut self) -> Result<(), MeshError> {
        self.tets.reset()
    }

    fn boxed_clone(&self) -> Box<dyn Space> {
        Box::new(self.clone())
    }

    fn bytes(&self) -> usize {
        self.tets.bytes()
    }

    fn stiffness(&self, simd: Simd) -> Option<Box<dyn Stiffness>> {
        let elastic = self.tets.stiffness(simd)?;
        Some(Box::new(Kernel { places: elastic.places().into_owned(), elastic }))
    }

    fn follow_stiffness(&self, stiffness: &mut dyn Stiffness) {
        let kernel = (stiffness as &mut dyn Any).downcast_mut::<Kernel>().unwrap();
        self.tets.follow_stiffness(&mut *kernel.elastic);
        kernel.places = kernel.elastic.places().into_owned();
    }

    fn stiff_modes(&self) -> Option<StiffModes> {
        self.tets.stiff_modes()
    }

    fn model(&self, material: &Material, volumetric: Volumetric) -> Result<Model, ModelError> {
        self.tets.model(material, volumetric)
    }

    fn follow_model(&self, model: &mut Model, material: &Material) {
        self.tets.follow_model(model, material);
    }
}
