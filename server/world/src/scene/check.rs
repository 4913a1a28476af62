//! From a scene's tree to ready objects: what the schema cannot say is checked here.

mod cut;

mod held;

mod look;

mod material;

mod mechanics;

mod obstacle;

mod octree;

use std::collections::BTreeSet;

use nalgebra::{Unit, Vector3};
use scindo_collision::Method;

use crate::inputs::{MAX_OBSTACLES, MAX_TOOLS, ToolMode};
use crate::mesh_in::Organ;

use super::checked::*;
use super::course::Course;
use super::problem::{Fault, nearest_word};
use super::raw::*;
use super::schema::{Finding, json_schema, validate};
use super::source::Node;

/// Parts of each edge of a divided skin, unless the scene says otherwise.
const DIVISIONS: u32 = 4;
/// Most tetrahedra a box may have; more would not fit the memory of an ordinary machine.
const MAX_BOX_CELLS: u64 = 8_000_000;

/// Checks a tree and turns it into ready objects, or says everything that is wrong with it.
pub(crate) fn check(tree: &Node) -> Result<CheckedScene, Vec<Finding>> {
    let findings = validate(&json_schema(), tree);
    if !findings.is_empty() {
        return Err(findings);
    }
    let raw: RawScene = serde_json::from_value(tree.to_json())
        .map_err(|error| vec![(String::new(), Fault::Syntax { message: error.to_string() })])?;
    let mut check = Check { raw: &raw, findings: Vec::new() };
    let scene = check.scene();
    if check.findings.is_empty() { Ok(scene) } else { Err(check.findings) }
}

struct Check<'a> {
    raw: &'a RawScene,
    findings: Vec<Finding>,
}

impl Check<'_> {
    fn report(&mut self, path: String, fault: Fault) {
        self.findings.push((path, fault));
    }

    fn conflict(&mut self, path: String, what: impl Into<String>, next: &str) {
        self.report(path, Fault::Conflict { what: what.into(), next: next.to_owned() });
    }

    fn scene(&mut self) -> CheckedScene {
        let raw = self.raw;
        self.unique("body", "bodies", raw.body.iter().map(|b| b.id.as_str()));
        self.unique("obstacle", "obstacles", raw.obstacle.iter().map(|o| o.id.as_str()));
        self.unique("probe", "probes", raw.probe.iter().map(|p| p.id.as_str()));
        self.unique("tool", "tools", raw.tool.iter().map(|t| t.id.as_str()));
        if raw.tool.len() > MAX_TOOLS {
            let what = format!("{} tools, allowed: at most {MAX_TOOLS}", raw.tool.len());
            self.conflict("tool".into(), what, "remove some");
        }
        if raw.obstacle.len() > MAX_OBSTACLES {
            let what = format!("{} obstacles, allowed: at most {MAX_OBSTACLES}", raw.obstacle.len());
            self.conflict("obstacle".into(), what, "join some of them to one surface");
        }
        self.cuttable();
        let bodies: Vec<BodySpec> = raw.body.iter().map(|body| self.body(body)).collect();
        self.touch(&bodies);
        CheckedScene {
            name: raw.name.clone(),
            description: raw.description.clone().unwrap_or_default(),
            seed: raw.seed,
            gravity_m_s2: Vector3::from(raw.world.gravity_m_s2),
            step_s: raw.world.step_s,
            body_contact: [raw.world.contact.friction, raw.world.contact.stiffness],
            broad_phase: broad_phase(raw.world.contact.broad_phase),
            bodies,
            obstacles: raw.obstacle.iter().map(|obstacle| self.obstacle(obstacle)).collect(),
            cuts: raw.cut.iter().enumerate().map(|(i, cut)| self.cut(i, cut)).collect(),
            probes: raw.probe.iter().map(|probe| self.probe(probe)).collect(),
            tools: raw.tool.iter().map(|tool| self.tool(tool)).collect(),
            effects: self.effects(),
            publish: PublishRates {
                surface_hz: raw.publish.surface_hz,
                contact_hz: raw.publish.contact_hz,
                stats_hz: raw.publish.stats_hz,
            },
            series_steps: raw.results.series_steps,
        }
    }

    fn unique<'b>(&mut self, table: &str, among: &'static str, ids: impl Iterator<Item = &'b str>) {
        let mut seen = BTreeSet::new();
        for (index, id) in ids.enumerate() {
            if !seen.insert(id) {
                self.report(format!("{table}.{index}.id"), Fault::DuplicateId { id: id.to_owned(), among });
            }
        }
    }

    fn body(&mut self, body: &RawBody) -> BodySpec {
        let at = format!("body.{}", body.id);
        let mesh = self.mesh(&format!("{at}.mesh"), body);
        let mechanics = self.mechanics(&at, body, &mesh);
        let octree = self.octree(&at, body, (&mesh, &mechanics));
        if body.cutting.front == Some(RawFront::Calibrated) && body.cutting.toughness_j_m2.is_some() {
            let what = "a cut that goes on ahead of the blade opens what no edge has pressed on, so its work is not that of \
                        cutting.toughness_j_m2";
            let next = "remove cutting.front or cutting.toughness_j_m2";
            self.conflict(format!("{at}.cutting.front"), what, next);
        }
        self.inclined(&at, body);
        BodySpec {
            id: body.id.clone(),
            skin: body.skin.as_ref().map(|skin| self.skin(&at, skin, body)),
            largest_part: body.mesh.parts == Some(RawParts::Largest),
            mesh,
            octree,
            materials: self.materials(&at, body),
            mechanics,
            young_pa: body.young_pa,
            poisson: body.poisson,
            density_kg_m3: body.density_kg_m3,
            damping_mass_1_s: body.rayleigh.mass_1_s,
            damping_stiffness_s: body.rayleigh.stiffness_s,
            toughness_j_m2: body.cutting.toughness_j_m2.unwrap_or(0.0),
            velocity_m_s: Vector3::from(body.velocity_m_s),
            fixes: self.fixes(&at, &body.fix),
            displacement: self.course(
                &at,
                ("displacement_over_s", body.displacement_over_s),
                ("displacement_table", &body.displacement_table),
            ),
            loads: self.loads(&at, body),
            look: self.look(&format!("{at}.look"), body.look.as_ref()),
        }
    }

    fn skin(&mut self, at: &str, skin: &RawSkin, body: &RawBody) -> SkinSpec {
        if body.cut_method().changes_mesh() {
            let next = "write cutting.method = \"xfem\", or remove the skin";
            let found = mechanics::word(&body.cut_method());
            let what = format!(
                "found a skin with cutting.method = `{found}`, which changes the mesh below it; allowed: xfem"
            );
            self.conflict(format!("{at}.skin"), what, next);
        }
        let own = skin.triangles == RawSkinTriangles::Own;
        match body.element {
            RawElement::Tet4 => {}
            RawElement::Octree if own => {
                if skin.snapping != 0.0 {
                    let what = "a skin of cells is not moved onto cuts";
                    self.conflict(format!("{at}.skin.snapping"), what, "remove it");
                }
            }
            RawElement::Octree => {
                let next = "write triangles = \"own\", or remove the skin";
                let what = "the surface of cells has no faces of elements to divide";
                self.conflict(format!("{at}.skin"), what, next);
            }
            _ => {
                let next = "write element = \"tet4\", or remove the skin";
                self.conflict(format!("{at}.skin"), "a skin needs linear tetrahedra or cells", next);
            }
        }
        if skin.scale.is_some() && skin.surface.is_none() {
            let next = "remove it; `scale` of the mesh applies to its skin too";
            self.conflict(format!("{at}.skin.scale"), "`scale` only goes with `surface`", next);
        }
        if own && skin.divisions.is_some() {
            let next = "remove it, or write triangles = \"divided\"";
            self.conflict(format!("{at}.skin.divisions"), "triangles = `own` are not divided", next);
        }
        if own && skin.surface.is_none() && body.mesh.surface.is_none() && body.mesh.organ.is_none() {
            let next = "add `surface` with an .obj, .stl or .ply file, or write triangles = \"divided\"";
            let what = "the mesh was not made from a surface, so the skin has no triangles of its own";
            self.conflict(format!("{at}.skin.triangles"), what, next);
        }
        SkinSpec {
            divisions: (!own).then_some(skin.divisions.unwrap_or(DIVISIONS) as usize),
            snapping: skin.snapping,
            surface: skin.surface.clone().map(|path| (path, skin.scale.unwrap_or(1.0))),
        }
    }

    fn mesh(&mut self, at: &str, body: &RawBody) -> MeshSource {
        let mesh = &body.mesh;
        if mesh.cells.is_some() && mesh.surface.is_none() {
            let next = "a box has its own `cells`; a volumetric file brings its elements";
            self.conflict(format!("{at}.cells"), "`cells` only goes with `surface`", next);
        }
        if mesh.scale.is_some() && mesh.surface.is_none() && mesh.file.is_none() {
            let next = "give box and organ in metres";
            self.conflict(format!("{at}.scale"), "`scale` only goes with `file` or `surface`", next);
        }
        if mesh.weld.is_some() && mesh.file.is_none() {
            let next = "a surface is filled with a lattice, which has no coincident nodes";
            self.conflict(format!("{at}.weld"), "`weld` only goes with `file`", next);
        }
        if mesh.parts.is_some() && mesh.surface.is_none() && mesh.file.is_none() {
            let next = "box, grid and organ have one part";
            self.conflict(format!("{at}.parts"), "`parts` only goes with `file` or `surface`", next);
        }
        let scale = mesh.scale.unwrap_or(1.0);
        if let Some(path) = &mesh.file {
            return MeshSource::File { path: path.clone(), scale, weld: mesh.weld != Some(false) };
        }
        if let Some(path) = &mesh.surface {
            if mesh.cells.is_none() {
                let meaning =
                    "lattice cells along the longest side of the surface, 16 to 48 for real time".into();
                self.report(at.to_owned(), Fault::MissingKey { key: "cells".into(), meaning });
            }
            return MeshSource::Surface {
                path: path.clone(),
                cells: mesh.cells.unwrap_or(2) as usize,
                scale,
            };
        }
        if let Some(block) = &mesh.r#box {
            return self.block(&format!("{at}.box"), block, body.element == RawElement::Octree);
        }
        if let Some(grid) = &mesh.grid {
            return self.grid(&format!("{at}.grid"), grid);
        }
        let organ = mesh.organ.as_ref();
        let shape = organ.map_or(Organ::default(), |organ| organ.shape);
        MeshSource::Organ { shape, cells: organ.map_or(4, |organ| organ.cells) as usize }
    }

    fn block(&mut self, at: &str, block: &RawBox, octree: bool) -> MeshSource {
        self.rising_corners(at, block.min_m, block.max_m, true);
        // Most cells of an octree are joined to larger ones.
        if !octree {
            self.cell_count(&format!("{at}.cells"), block.cells.map(u64::from));
        }
        MeshSource::Box {
            min_m: Vector3::from(block.min_m),
            max_m: Vector3::from(block.max_m),
            cells: block.cells.map(|n| n as usize),
            split: split(block.pattern),
        }
    }

    fn grid(&mut self, at: &str, grid: &RawGrid) -> MeshSource {
        let lines_m = [&grid.x_m, &grid.y_m, &grid.z_m];
        for (name, lines) in ["x_m", "y_m", "z_m"].into_iter().zip(lines_m) {
            if let Some(i) = (1..lines.len()).find(|&i| lines[i] <= lines[i - 1]) {
                let what = format!("{} does not lie above {}", lines[i], lines[i - 1]);
                self.conflict(format!("{at}.{name}.{i}"), what, "give the coordinates in ascending order");
            }
        }
        self.cell_count(at, lines_m.map(|lines| lines.len() as u64 - 1));
        MeshSource::Grid { lines_m: lines_m.map(Clone::clone), split: split(grid.pattern) }
    }

    fn cell_count(&mut self, at: &str, cells: [u64; 3]) {
        let cells: u64 = cells.iter().product();
        if cells > MAX_BOX_CELLS {
            let what = format!("found {cells} cells, allowed: at most {MAX_BOX_CELLS}");
            self.conflict(at.to_owned(), what, "use fewer cells");
        }
    }

    fn rising_corners(&mut self, at: &str, min: Vec3, max: Vec3, strictly: bool) {
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            if min[axis] > max[axis] || (strictly && min[axis] == max[axis]) {
                let what = format!("max_m lies below min_m along {name}: {} and {}", max[axis], min[axis]);
                self.conflict(at.to_owned(), what, "give the lower corner as min_m");
            }
        }
    }

    fn fixes(&mut self, at: &str, fixes: &[RawFix]) -> Vec<FixSpec> {
        let fix = |(i, fix): (usize, &RawFix)| FixSpec {
            region: self.region(&format!("{at}.fix.{i}.where"), &fix.r#where),
            held: self.held(&format!("{at}.fix.{i}"), fix),
            displacement_m: Vector3::from(fix.displacement_m),
        };
        fixes.iter().enumerate().map(fix).collect()
    }

    fn loads(&mut self, at: &str, body: &RawBody) -> Vec<LoadSpec> {
        let mut loads = Vec::new();
        for (i, load) in body.load.iter().enumerate() {
            let at = format!("{at}.load.{i}");
            let course = self.course(&at, ("ramp_s", load.ramp_s), ("table", &load.table));
            if load.pressure_pa.is_some() {
                self.pressure(&at, load, body);
            } else if !course.is_constant() && body.cut_method().changes_mesh() {
                let what = format!(
                    "found a load that changes over time with cutting.method = `{}`, which changes the mesh; allowed \
                     there: constant loads",
                    mechanics::word(&body.cut_method())
                );
                self.conflict(
                    at.clone(),
                    what,
                    "write cutting.method = \"xfem\", or remove ramp_s and table",
                );
            }
            loads.push(LoadSpec {
                region: self.region(&format!("{at}.where"), &load.r#where),
                kind: match load.pressure_pa {
                    Some(pressure_pa) => LoadKind::Pressure { pressure_pa },
                    None => LoadKind::Force {
                        force_n: load.force_n.map_or(Vector3::zeros(), Vector3::from),
                        share: load.share.map(|share| match share {
                            RawShare::Area => Share::Area,
                            RawShare::Volume => Share::Volume,
                        }),
                    },
                },
                course,
            });
        }
        loads
    }

    /// What a pressure does not go with.
    fn pressure(&mut self, at: &str, load: &RawLoad, body: &RawBody) {
        let key = format!("{at}.pressure_pa");
        if load.share.is_some() {
            let what = "found `share` beside pressure_pa, which acts on faces; allowed with force_n only";
            self.conflict(format!("{at}.share"), what, "remove it");
        }
        if body.cut_method().changes_mesh() {
            let what = format!(
                "found a pressure with cutting.method = `{}`, which changes the mesh; allowed there: constant forces",
                mechanics::word(&body.cut_method())
            );
            self.conflict(key, what, "write cutting.method = \"xfem\", or give a force_n");
        }
    }

    /// What share of a value acts when, by one of two keys: the time over which it grows, or a table.
    fn course(&mut self, at: &str, ramp: (&str, f64), table: (&str, &[[f64; 2]])) -> Course {
        let ((ramp_key, ramp_s), (table_key, points)) = (ramp, table);
        if points.is_empty() {
            return Course::ramp(ramp_s);
        }
        let at = format!("{at}.{table_key}");
        if ramp_s != 0.0 {
            let what = format!("found {table_key} beside {ramp_key}, allowed: one of them");
            self.conflict(at.clone(), what, "write the growth into the table");
        }
        let finite = |[t, share]: &[f64; 2]| (0.0..=1e6).contains(t) && share.abs() <= 1e6;
        if let Some(i) = points.iter().position(|point| !finite(point)) {
            let what = format!(
                "found {:?}, allowed: a time from 0 to 1e6 s and a share from -1e6 to 1e6",
                points[i]
            );
            self.conflict(
                format!("{at}.{i}"),
                what,
                "give each point as [time in seconds, share of the full value]",
            );
        }
        if let Some(i) = (1..points.len()).find(|&i| points[i][0] <= points[i - 1][0]) {
            let what = format!("the time {} does not lie above {}", points[i][0], points[i - 1][0]);
            self.conflict(format!("{at}.{i}"), what, "let the times rise");
        }
        Course::table(points.to_vec())
    }

    fn region(&mut self, at: &str, raw: &RawWhere) -> Region {
        if let Some(region) = &raw.r#box {
            self.rising_corners(&format!("{at}.box"), region.min_m, region.max_m, false);
            return Region::Box { min_m: Vector3::from(region.min_m), max_m: Vector3::from(region.max_m) };
        }
        if let Some(ball) = &raw.sphere {
            return Region::Ball { centre_m: Vector3::from(ball.centre_m), radius_m: ball.radius_m };
        }
        if let Some(half) = &raw.half_space {
            let normal = self.direction(&format!("{at}.half_space.normal"), half.normal);
            return Region::HalfSpace { point_m: Vector3::from(half.point_m), normal };
        }
        let (axis, from, to) = raw.slab.as_ref().map_or((0, 0.0, 1.0), |s| (s.axis as usize, s.from, s.to));
        if from > to {
            let what = format!("`from` {from} lies above `to` {to}");
            self.conflict(format!("{at}.slab"), what, "swap them");
        }
        Region::Slab { axis, from, to }
    }

    /// A direction of any length but zero.
    fn direction(&mut self, at: &str, raw: Vec3) -> Unit<Vector3<f64>> {
        Unit::try_new(Vector3::from(raw), 1e-300).unwrap_or_else(|| {
            self.conflict(
                at.to_owned(),
                "the direction has zero length",
                "give a direction such as [0, 0, 1]",
            );
            Vector3::z_axis()
        })
    }

    fn body_named(&mut self, at: String, name: &str) -> usize {
        let bodies = &self.raw.body;
        bodies.iter().position(|body| body.id == name).unwrap_or_else(|| {
            let suggestion = nearest_word(name, bodies.iter().map(|body| body.id.as_str()));
            let known = bodies.iter().map(|body| body.id.clone()).collect();
            self.report(at, Fault::UnknownName { what: "body", found: name.to_owned(), suggestion, known });
            0
        })
    }

    fn probe(&mut self, probe: &RawProbe) -> ProbeSpec {
        let at = format!("probe.{}", probe.id);
        ProbeSpec {
            id: probe.id.clone(),
            body: self.body_named(format!("{at}.body"), &probe.body),
            point_m: Vector3::from(probe.point_m),
            side: probe.side.map(|side| self.direction(&format!("{at}.side"), side)),
        }
    }

    fn tool(&mut self, tool: &RawTool) -> ToolSpec {
        let at = format!("tool.{}", tool.id);
        let path: Vec<PathPoint> =
            tool.path.iter().enumerate().map(|(i, point)| self.path_point(&at, i, tool, point)).collect();
        for (i, pair) in path.windows(2).enumerate() {
            if pair[1].at_s <= pair[0].at_s {
                let what = format!("{} s does not come after {} s", pair[1].at_s, pair[0].at_s);
                self.conflict(
                    format!("{at}.path.{}.at_s", i + 1),
                    what,
                    "give the times of a path in ascending order",
                );
            }
        }
        if let (Some(repeat), Some(last)) = (tool.repeat_s, path.last())
            && repeat < last.at_s
        {
            let what = format!("the path ends at {} s, after repeat_s = {repeat} s", last.at_s);
            self.conflict(format!("{at}.repeat_s"), what, "repeat after the last point");
        }
        if self.raw.effects.contact == Some(false) && !path.is_empty() {
            let next = "remove the path or effects.contact";
            self.conflict(format!("{at}.path"), "effects.contact = false, but the tool has a path", next);
        }
        ToolSpec {
            id: tool.id.clone(),
            shape: tool.shape.geometry(),
            stiffness_n_m: tool.stiffness_n_m,
            max_force_n: tool.max_force_n,
            friction: tool.friction,
            path,
            repeat_s: tool.repeat_s,
        }
    }

    fn path_point(&mut self, at: &str, index: usize, tool: &RawTool, point: &RawPathPoint) -> PathPoint {
        let at = format!("{at}.path.{index}");
        if point.mode == RawMode::Cut && tool.shape.blade.is_none() {
            self.conflict(format!("{at}.mode"), "only a blade can cut", "give the tool the shape of a blade");
        }
        if matches!(point.mode, RawMode::Cut | RawMode::Scalpel) && self.raw.effects.cutting == Some(false) {
            let next = "remove the mode or effects.cutting";
            self.conflict(format!("{at}.mode"), "effects.cutting = false, but the tool cuts", next);
        }
        let toward = self.direction(&format!("{at}.toward"), point.toward);
        let across = point.across.map(|across| self.direction(&format!("{at}.across"), across));
        if across.is_some_and(|across| across.cross(&toward).norm() < 1e-3) {
            let what =
                format!("{:?} is along the shaft, {:?}", point.across.unwrap_or_default(), point.toward);
            self.conflict(format!("{at}.across"), what, "give a vector across `toward`");
        }
        PathPoint {
            at_s: point.at_s,
            tip_m: Vector3::from(point.tip_m),
            toward,
            across,
            mode: match point.mode {
                RawMode::Hover => ToolMode::Hover,
                RawMode::Touch => ToolMode::Touch,
                RawMode::Grab => ToolMode::Grab,
                RawMode::Cut => ToolMode::Cut,
                RawMode::Scalpel => ToolMode::Scalpel,
            },
        }
    }

    fn effects(&mut self) -> EffectSwitches {
        let raw = &self.raw.effects;
        let other = self.raw.body.iter().find(|body| body.element != RawElement::Tet4);
        if let (Some(true), Some(body)) = (raw.error_estimate, other) {
            let what = format!(
                "found true, but only tet4 has an error estimate, and body `{}` has other elements",
                body.id
            );
            self.conflict(
                "effects.error_estimate".into(),
                what,
                "write element = \"tet4\" or remove the effect",
            );
        }
        let unknown = |b: &&RawBody| !b.fibre.is_empty() || !b.prony.is_empty();
        if let (Some(true), Some(body)) = (raw.error_estimate, self.raw.body.iter().find(unknown)) {
            let (id, has) = (&body.id, if body.fibre.is_empty() { "viscoelasticity" } else { "fibres" });
            let what = format!("found true, but body `{id}` has {has}, which the estimate does not know");
            self.conflict("effects.error_estimate".into(), what, &format!("remove the effect, or the {has}"));
        }
        if raw.cutting_force == Some(true) && self.raw.body.iter().all(|b| b.cutting.toughness_j_m2.is_none())
        {
            self.conflict(
                "effects.cutting_force".into(),
                "found true, but no body has a toughness",
                "give a body cutting.toughness_j_m2, or remove the effect",
            );
        }
        EffectSwitches {
            cutting: raw.cutting,
            cutting_force: raw.cutting_force,
            contact: raw.contact,
            obstacles: raw.obstacles,
            body_collision: raw.body_collision,
            self_collision: raw.self_collision,
            sleep: raw.sleep,
            governor: raw.governor,
            energy: raw.energy,
            error_estimate: raw.error_estimate,
        }
    }
}

fn split(pattern: RawPattern) -> CellSplit {
    match pattern {
        RawPattern::Tet5 => CellSplit::Five,
        RawPattern::Tet6 => CellSplit::Six,
        RawPattern::Oct6 => CellSplit::Octahedral,
        RawPattern::Hex => CellSplit::Hex,
    }
}

fn broad_phase(method: RawBroadPhase) -> Method {
    match method {
        RawBroadPhase::AabbTree => Method::AabbTree,
        RawBroadPhase::Octree => Method::Octree,
        RawBroadPhase::SphereTree => Method::SphereTree,
        RawBroadPhase::SpatialHash => Method::SpatialHash,
        RawBroadPhase::ParryBvh => Method::ParryBvh,
    }
}
