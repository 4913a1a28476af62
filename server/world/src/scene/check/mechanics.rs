//! Which elements, laws, integrators and solvers go together; everything else is refused here.

use scindo_physics::body::Arithmetic;
use scindo_physics::material::{Prony, PronyTerm};

use super::super::checked::{CellSplit, MeshSource};
use super::super::mechanics::{Mechanics, Newmark};
use super::super::raw::*;
use super::Check;

impl Check<'_> {
    /// How `body` is computed, or why it cannot be.
    pub(super) fn mechanics(&mut self, at: &str, body: &RawBody, mesh: &MeshSource) -> Mechanics {
        let newmark = body.newmark.clone().unwrap_or_default();
        let mechanics = Mechanics {
            element: body.element,
            cubes: mesh.has_cubes(),
            law: body.law,
            fibres: self.fibres(at, body),
            prony: Prony::new(
                body.prony.iter().map(|&RawProny { ratio, time_s }| PronyTerm { ratio, time_s }),
            ),
            pressed: body.load.iter().any(|load| load.pressure_pa.is_some()),
            integrator: body.integrator,
            sub_steps: body.sub_steps,
            most_stable_steps: body.most_stable_steps,
            spectral_radius: body.spectral_radius,
            newmark: Newmark { beta: newmark.beta, gamma: newmark.gamma },
            mass: body.mass,
            locking: body.locking,
            method: body.solver.method.unwrap_or_default(),
            method_is_default: body.solver.method.is_none(),
            precision: body.solver.precision,
            operator: body.solver.operator,
            cycle: body.solver.cycle,
            newton_steps: body.solver.newton_steps,
            iterations: body.solver.iterations,
            fixed_iterations: body.solver.fixed_iterations,
            tolerance: body.solver.tolerance,
            cutting: body.cut_method(),
            front: body.cutting.front,
            moves: body.cutting.moves.unwrap_or_default(),
            clean: body.cutting.clean.unwrap_or(true),
            loose: body.cutting.loose,
        }
        .with_method();
        self.cutting(at, &mechanics);
        self.moved_faces(at, body);
        self.element(at, mechanics.element, mesh);
        self.locking(at, &mechanics);
        self.mass(at, &mechanics);
        self.integrator(at, body);
        self.solver(at, &mechanics);
        self.precision(at, &mechanics);
        self.operator(at, &mechanics);
        self.viscoelasticity(at, &mechanics);
        mechanics
    }

    /// What a Prony series does not go with.
    fn viscoelasticity(&mut self, at: &str, m: &Mechanics) {
        if m.prony.is_empty() {
            return;
        }
        let changes = !matches!(m.cutting, RawCutMethod::Xfem | RawCutMethod::Links);
        let why = [
            (changes, word(&m.cutting), "cutting that keeps the elements", "write cutting.method = \"xfem\""),
            (
                m.integrator.is_explicit(),
                word(&m.integrator),
                "an implicit integrator",
                "write integrator = \"bdf2\"",
            ),
            (
                m.integrator == RawIntegrator::GeneralisedAlpha,
                word(&m.integrator),
                "forces at the end of a step",
                "write integrator = \"bdf2\"",
            ),
            (
                m.method == RawMethod::Relaxation,
                word(&m.method),
                "another solver of the static integrator",
                "write solver.method = \"pcg\"",
            ),
        ];
        for (_, found, allowed, next) in why.into_iter().filter(|why| why.0) {
            let what = format!("found with `{found}`, allowed: {allowed}");
            self.conflict(format!("{at}.prony"), what, next);
        }
    }

    fn cutting(&mut self, at: &str, m: &Mechanics) {
        let key = format!("{at}.cutting.method");
        if (m.cutting == RawCutMethod::Links) != (m.element == RawElement::Octree) {
            let (found, element) = (word(&m.cutting), word(&m.element));
            let (allowed, next) = match m.cutting {
                RawCutMethod::Links => ("octree", "write element = \"octree\", or remove cutting.method"),
                _ => ("tet4", "remove cutting.method; octree cells are cut along links"),
            };
            let what = format!("found `{found}` with {element}, allowed: {allowed}");
            return self.conflict(key, what, next);
        }
        if m.cutting.changes_mesh() && m.element != RawElement::Tet4 {
            let what = format!("found `{}` with {}, allowed: tet4", word(&m.cutting), word(&m.element));
            self.conflict(key, what, "choose tet4, whose mesh can be cut, or remove cutting.method");
        }
        if m.front == Some(RawFront::Calibrated)
            && (m.cutting, m.element) != (RawCutMethod::Xfem, RawElement::Tet4)
        {
            let found = word(&m.cutting);
            let what = format!(
                "found `calibrated` with {} and cutting.method = `{found}`, allowed: tet4 with xfem",
                word(&m.element)
            );
            let next = "remove cutting.front, or write element = \"tet4\" and cutting.method = \"xfem\"";
            self.conflict(format!("{at}.cutting.front"), what, next);
        }
        if m.loose == RawLoose::Pinned && !m.cutting.changes_mesh() {
            let what = format!("found `pinned` with {}, allowed: snap", word(&m.cutting));
            let next = "write cutting.method = \"snap\" or cutting.loose = \"free\"";
            self.conflict(format!("{at}.cutting.loose"), what, next);
        }
    }

    /// Only cuts along faces move nodes and have something to clean.
    fn moved_faces(&mut self, at: &str, body: &RawBody) {
        let given = [("moves", body.cutting.moves.is_some()), ("clean", body.cutting.clean.is_some())];
        let method = body.cut_method();
        for (key, _) in given.into_iter().filter(|(_, given)| *given && method != RawCutMethod::Snap) {
            let what = format!("found with {}, allowed: snap", word(&method));
            let next = format!("write cutting.method = \"snap\", or remove {key}");
            self.conflict(format!("{at}.cutting.{key}"), what, &next);
        }
    }

    /// The method of a scheduled cut is that of the body, which blades and clients cut too.
    pub(super) fn cut_method(&mut self, at: &str, cut: &RawCut, body: usize) {
        let Some(found) = cut.method else { return };
        let key = format!("{at}.method");
        let own = self.raw.body.get(body).map_or(found, RawBody::cut_method);
        if found != own {
            let what = format!(
                "found `{}`, but all cuts of `{}` are made by {}",
                word(&found),
                cut.body,
                word(&own)
            );
            let next = format!("remove it, or write [body.cutting] method = \"{}\"", word(&found));
            self.conflict(key, what, &next);
        }
    }

    fn element(&mut self, at: &str, element: RawElement, mesh: &MeshSource) {
        let hexahedra = mesh.split() == Some(CellSplit::Hex);
        if element == RawElement::Hex8 && !hexahedra {
            let what = "found `hex8` on a mesh of tetrahedra, allowed there: tet4, tet10";
            let next = "give mesh.box or mesh.grid the pattern `hex`, or choose tet4 or tet10";
            self.conflict(format!("{at}.element"), what, next);
        }
        // Octree cells are cubes, whatever the pattern.
        if !matches!(element, RawElement::Hex8 | RawElement::Octree) && hexahedra {
            let what = format!("found `{}` on the box pattern `hex`, allowed there: hex8", word(&element));
            let next = "write element = \"hex8\", or choose the pattern tet5, tet6 or oct6";
            self.conflict(format!("{at}.element"), what, next);
        }
    }

    fn locking(&mut self, at: &str, m: &Mechanics) {
        let key = format!("{at}.locking");
        let (needs, others) = match m.locking {
            RawLocking::None => return,
            RawLocking::NodeAveraged => (RawElement::Tet4, "selective on hex8, or tet10 without a remedy"),
            RawLocking::Selective => (RawElement::Hex8, "node-averaged on tet4, or tet10 without a remedy"),
        };
        let found = word(&m.locking);
        if m.element != needs {
            let what = format!("found `{found}` with {}, allowed: only {}", word(&m.element), word(&needs));
            self.conflict(key.clone(), what, &format!("take {others}"));
        }
        if !m.constitutive_law().splits() {
            let what = format!(
                "found `{found}` with `{}`, whose energy does not split into shape and volume; allowed: \
                 none",
                word(&m.law)
            );
            self.conflict(key, what, "choose linear, corotational or neo-hookean, or no remedy");
        }
    }

    fn mass(&mut self, at: &str, m: &Mechanics) {
        let of_pieces = matches!(m.mass, RawMass::Menouillard | RawMass::Floored);
        if of_pieces && m.element != RawElement::Tet4 {
            let what = format!("found `{}` with {}, allowed: only tet4", word(&m.mass), word(&m.element));
            self.conflict(format!("{at}.mass"), what, "write mass = \"lumped\", or take element = \"tet4\"");
        }
    }

    fn integrator(&mut self, at: &str, body: &RawBody) {
        if body.newmark.is_some() && body.integrator != RawIntegrator::Newmark {
            let what =
                format!("`newmark` only goes with integrator newmark, found {}", word(&body.integrator));
            self.conflict(format!("{at}.newmark"), what, "remove it or write integrator = \"newmark\"");
        }
        if body.spectral_radius.is_some() && body.integrator != RawIntegrator::GeneralisedAlpha {
            let what = format!(
                "`spectral_radius` only goes with integrator generalised-alpha, found {}",
                word(&body.integrator)
            );
            let next = "remove it or write integrator = \"generalised-alpha\"";
            self.conflict(format!("{at}.spectral_radius"), what, next);
        }
        if body.most_stable_steps.is_some() && !body.integrator.is_explicit() {
            let what = format!(
                "`most_stable_steps` only goes with explicit integrators, found {}",
                word(&body.integrator)
            );
            self.conflict(format!("{at}.most_stable_steps"), what, "remove it, or write sub_steps");
        }
        if body.integrator == RawIntegrator::Static && body.sub_steps > 1 {
            let what = format!("found {} in a static body, allowed: 1", body.sub_steps);
            self.conflict(format!("{at}.sub_steps"), what, "remove it; an equilibrium has no steps in time");
        }
        if body.integrator == RawIntegrator::Static {
            self.statics(at, body);
        }
    }

    fn statics(&mut self, at: &str, body: &RawBody) {
        let rayleigh = &body.rayleigh;
        if rayleigh.mass_1_s > 0.0 || rayleigh.stiffness_s > 0.0 {
            let what = "found damping in a static body, allowed: none";
            self.conflict(format!("{at}.rayleigh"), what, "remove it; nothing moves in an equilibrium");
        }
        if body.mass != RawMass::Lumped {
            let what = format!("found `{}` in a static body, allowed: lumped", word(&body.mass));
            self.conflict(format!("{at}.mass"), what, "remove it; an equilibrium has no inertia");
        }
        if body.fix.is_empty() {
            let what = "a static body is fixed nowhere, so it has no equilibrium";
            self.conflict(
                format!("{at}.integrator"),
                what,
                "add a [[body.fix]] or choose another integrator",
            );
        }
    }

    fn solver(&mut self, at: &str, m: &Mechanics) {
        let key = format!("{at}.solver.method");
        let found = word(&m.method);
        if matches!(m.method, RawMethod::Multigrid | RawMethod::MgPcg) {
            if m.element != RawElement::Octree && !(m.element == RawElement::Hex8 && m.cubes) {
                let allowed = "octree, or hex8 on a box of equal cubes";
                let what = format!("found `{found}` with {}, allowed: {allowed}", word(&m.element));
                return self.conflict(key, what, "write element = \"octree\", or choose cg, pcg or cholesky");
            }
            // Multigrid works on the kernels of the fast path; a step of an assembled model has no levels.
            if let Some(why) = m.why_general() {
                let what = format!("found `{found}` with {why}");
                return self.conflict(key, what, "change that, or choose cg, pcg or cholesky");
            }
        }
        if m.cycle != RawCycle::V && !matches!(m.method, RawMethod::Multigrid | RawMethod::MgPcg) {
            let what = format!(
                "found `{}` with solver.method = `{found}`, allowed: multigrid, mg-pcg",
                word(&m.cycle)
            );
            let next = "remove it, or write element = \"octree\" and solver.method = \"mg-pcg\"";
            return self.conflict(format!("{at}.solver.cycle"), what, next);
        }
        if m.method == RawMethod::TwoLevelPcg {
            if m.element != RawElement::Tet4 {
                let what = format!("found `{found}` with {}, allowed: tet4", word(&m.element));
                return self.conflict(key, what, "write element = \"tet4\", or choose another solver.method");
            }
            // Its coarse space is made for the kernels of the fast path.
            let precision =
                || (m.arithmetic() != Arithmetic::Single).then_some("precision other than single");
            if let Some(why) = m.why_general().or_else(precision) {
                let what = format!("found `{found}` with {why}");
                return self.conflict(key, what, "change that, or choose cg, pcg or cholesky");
            }
        }
        if m.method == RawMethod::Relaxation && m.integrator != RawIntegrator::Static {
            let what = format!("found `relaxation` with {}, allowed: static", word(&m.integrator));
            let next = "write integrator = \"static\", or choose cg, pcg or cholesky";
            return self.conflict(key, what, next);
        }
        if m.method == RawMethod::Relaxation && m.newton_steps.is_some() {
            let what = "`newton_steps` is given, but relaxation makes none";
            self.conflict(format!("{at}.solver.newton_steps"), what, "remove it");
        }
        if !m.integrator.is_explicit() {
            return;
        }
        let explicit = word(&m.integrator);
        if m.method != RawMethod::Pcg {
            let what = format!("found `{found}`, but {explicit} is explicit and solves no equations");
            self.conflict(key, what, "remove solver.method or choose an implicit integrator");
        }
        if m.newton_steps.is_some() {
            let what = format!("`newton_steps` is given, but {explicit} is explicit");
            self.conflict(format!("{at}.solver.newton_steps"), what, "remove it");
        }
    }

    fn precision(&mut self, at: &str, m: &Mechanics) {
        let key = format!("{at}.solver.precision");
        match m.precision {
            Some(RawPrecision::Single) => {
                if let Some(why) = m.why_general() {
                    let what = format!("found `single` with {why}, allowed: mixed, double");
                    let next = "single precision needs tet4, octree or hex8 on equal cubes, linear or corotational (any law with tet4), implicit-euler, bdf2 or newmark (static with the linear law, or octree), pcg, two-level-pcg or multigrid, \
                                lumped mass, no fibres, no viscoelasticity, no locking remedy and one Newton step";
                    self.conflict(key, what, next);
                }
            }
            Some(RawPrecision::Mixed) if m.method == RawMethod::Relaxation => {
                let what = "found `mixed` with relaxation, allowed: double";
                self.conflict(key, what, "relaxation has no inner solver to run in single precision");
            }
            Some(RawPrecision::Mixed) if m.integrator.is_explicit() => {
                let what = format!("found `mixed` with {}, allowed: double", word(&m.integrator));
                self.conflict(key, what, "an explicit step has no solver to run in single precision");
            }
            _ => {}
        }
    }

    fn operator(&mut self, at: &str, m: &Mechanics) {
        let Some(found) = m.operator else { return };
        if m.body_settings().has_cells() && found == RawOperator::Assembled {
            let what = format!("found `{}` with {}, allowed: matrix-free", word(&found), word(&m.element));
            return self.conflict(
                format!("{at}.solver.operator"),
                what,
                "remove it; cells share their matrix",
            );
        }
        if m.arithmetic() == Arithmetic::Single {
            if found == RawOperator::MatrixFree && !m.constitutive_law().is_hookean() {
                let what = format!("found `{}` with {}, allowed: assembled", word(&found), word(&m.law));
                let next = "remove it; a tangent that is nonlinear in the stretch is kept as blocks";
                self.conflict(format!("{at}.solver.operator"), what, next);
            }
            return;
        }
        let why = m.why_general().unwrap_or("the chosen precision");
        let what = format!("found `{}`, but the general path is taken, for {why}", word(&found));
        self.conflict(
            format!("{at}.solver.operator"),
            what,
            "remove it; only single precision offers this choice",
        );
    }

    /// Bodies whose mesh cannot be cut, against the cuts and blades of the scene.
    pub(super) fn cuttable(&mut self) {
        let raw = self.raw;
        let whole = |body: &&RawBody| body.element == RawElement::Hex8;
        for (i, cut) in raw.cut.iter().enumerate() {
            if let Some(body) = raw.body.iter().filter(whole).find(|body| body.id == cut.body) {
                let what = format!(
                    "the cut goes through body `{}` of {} elements, allowed: tet4, tet10, octree",
                    body.id,
                    word(&body.element)
                );
                self.conflict(
                    format!("cut.{i}.body"),
                    what,
                    "take tetrahedra or an octree in place of hex8, or remove the cut",
                );
            }
        }
        let Some(body) = raw.body.iter().find(whole) else { return };
        for tool in &raw.tool {
            if let Some(i) =
                tool.path.iter().position(|point| matches!(point.mode, RawMode::Cut | RawMode::Scalpel))
            {
                let what = format!(
                    "a blade cuts every body it meets, but body `{}` is of {} elements; allowed: tet4, tet10, octree",
                    body.id,
                    word(&body.element)
                );
                self.conflict(
                    format!("tool.{}.path.{i}.mode", tool.id),
                    what,
                    "take tetrahedra or an octree in place of hex8, or give the tool another mode",
                );
            }
        }
    }
}

/// A word of the format as it is written in a scene.
pub(super) fn word<T: serde::Serialize>(value: &T) -> String {
    serde_json::to_value(value).ok().and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default()
}
