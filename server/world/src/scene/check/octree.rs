//! Bodies of octree cells.

use nalgebra::Vector3;
use scindo_physics::body::Arithmetic;
use scindo_physics::octree::{AdaptError, AdaptSettings};

use super::super::checked::{AdaptSpec, MeshSource, OctreeSpec};
use super::super::mechanics::Mechanics;
use super::super::problem::Fault;
use super::super::raw::*;
use super::Check;
use super::mechanics::word;

/// Adaptations from one estimate of the error to the next, where the scene does not say.
const ERROR_EVERY: u32 = 5;

impl Check<'_> {
    /// The cells of a body of octree cells; `None` for other elements.
    pub(super) fn octree(
        &mut self,
        at: &str,
        body: &RawBody,
        (mesh, mechanics): (&MeshSource, &Mechanics),
    ) -> Option<OctreeSpec> {
        if body.element != RawElement::Octree {
            if body.octree.is_some() {
                let what = format!("`octree` only goes with element octree, found {}", word(&body.element));
                self.conflict(format!("{at}.octree"), what, "remove it or write element = \"octree\"");
            }
            return None;
        }
        if body.mesh.parts == Some(RawParts::Largest) {
            let what = "`parts = \"largest\"` does not go with element octree";
            self.conflict(format!("{at}.mesh.parts"), what, "remove it, and drop small parts in the file");
        }
        let octree = body.octree.clone().unwrap_or_default();
        if octree.simulate_level > octree.levels {
            let what =
                format!("found {}, allowed: at most levels = {}", octree.simulate_level, octree.levels);
            self.conflict(format!("{at}.octree.simulate_level"), what, "raise octree.levels or write 0");
        }
        if octree.simulate_level > 0 {
            self.simulated(at, octree.simulate_level, mechanics);
        }
        let cells = match mesh {
            MeshSource::Box { min_m, max_m, cells, .. } => {
                self.cubes(&format!("{at}.mesh.box.cells"), max_m - min_m, *cells)
            }
            MeshSource::Surface { cells, .. } | MeshSource::Organ { cells, .. } => *cells,
            MeshSource::File { .. } => {
                let what = "found `octree` on a file of tetrahedra, allowed there: tet4, tet10";
                let next = "fill a surface: mesh = { surface = \"…\", cells = 64 }";
                self.conflict(format!("{at}.element"), what, next);
                0
            }
            MeshSource::Grid { .. } => {
                let what = "found `octree` on a grid, whose cells are not cubes";
                self.conflict(format!("{at}.element"), what, "give the block as mesh.box");
                0
            }
        };
        let adapt = octree
            .adapt
            .as_ref()
            .map(|adapt| self.adapt(&format!("{at}.octree.adapt"), adapt, octree.levels));
        let RawOctree { levels, simulate_level, .. } = octree;
        Some(OctreeSpec { cells: cells as u32, levels, simulate_level, adapt })
    }

    /// Refinement and coarsening of cells that are at most on level `levels`.
    fn adapt(&mut self, at: &str, raw: &RawAdapt, levels: u8) -> AdaptSpec {
        let &RawAdapt { level, distance_m, speed_m_s, error_sqrt_j, every_steps, error_every_steps } = raw;
        let settings = AdaptSettings { distance_m, speed_m_s, error: error_sqrt_j, level };
        if settings.is_off() {
            let meaning = "where cells are divided; at least one of distance_m, speed_m_s and error_sqrt_j is \
                           needed, such as distance_m = [0.01, 0.02]";
            let fault = Fault::MissingKey { key: "distance_m".into(), meaning: meaning.into() };
            self.report(at.to_owned(), fault);
        }
        if let Err(AdaptError { name, found, allowed }) = settings.check() {
            let key = if name == "error" { "error_sqrt_j" } else { name };
            let next = if name == "distance_m" {
                "cells are divided below the first and joined above the second"
            } else {
                "cells are divided above the first and joined below the second"
            };
            let (found, allowed) = (format!("{found:?}"), allowed.to_owned());
            self.report(format!("{at}.{key}"), Fault::OutOfRange { found, allowed, next: next.into() });
        }
        if level >= levels {
            let what =
                format!("found {level}, allowed: below levels = {levels}, or no cell is larger than that");
            self.conflict(
                format!("{at}.level"),
                what,
                "lower it, raise octree.levels, or remove octree.adapt",
            );
        }
        if error_every_steps.is_some() && error_sqrt_j.is_none() {
            let what = "`error_every_steps` only goes with `error_sqrt_j`";
            self.conflict(format!("{at}.error_every_steps"), what, "remove it, or give error_sqrt_j");
        }
        let error_every_steps = error_every_steps.unwrap_or(every_steps.saturating_mul(ERROR_EVERY));
        AdaptSpec { settings, every_steps, error_every_steps }
    }

    /// Whether the solver of a body can work on a coarse level.
    fn simulated(&mut self, at: &str, level: u8, m: &Mechanics) {
        let key = format!("{at}.octree.simulate_level");
        if !matches!(m.method, RawMethod::Multigrid | RawMethod::MgPcg) {
            let found = word(&m.method);
            let what = format!("found {level} with solver.method = `{found}`, allowed: multigrid, mg-pcg");
            return self.conflict(key, what, "write solver = { method = \"mg-pcg\" }, or simulate level 0");
        }
        // What else keeps multigrid from the fast path is said of the method.
        if m.why_general().is_none() && m.arithmetic() != Arithmetic::Single {
            let what = format!("found {level}, which is solved in single precision to 1e-7 at best");
            let next = "remove solver.precision and raise solver.tolerance, or simulate level 0";
            self.conflict(key, what, next);
        }
    }

    /// Cells of a box along its longest side, which must be cubes.
    fn cubes(&mut self, at: &str, extent: Vector3<f64>, cells: [usize; 3]) -> usize {
        let along = cells[extent.imax()];
        let h = extent.max() / along as f64;
        let fit = [0, 1, 2].map(|axis| (extent[axis] / h - 1e-6).ceil().max(1.0) as usize);
        if h > 0.0 && fit != cells {
            let what = format!("found {cells:?}, but the cells of an octree are cubes");
            self.conflict(at.to_owned(), what, &format!("write {fit:?}"));
        }
        along
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// What a body with this line is refused for.
    fn found(element: &str, line: &str) -> Vec<String> {
        let text = format!(
            "schema = 1\n[[body]]\nid = \"b\"\nelement = \"{element}\"\nyoung_pa = 1e4\npoisson = 0.3\n\
             density_kg_m3 = 1000\nmesh = {{ organ = {{ cells = 16 }} }}\n{line}"
        );
        let raw: RawScene = toml::from_str(&text).unwrap();
        let mut check = Check { raw: &raw, findings: Vec::new() };
        check.scene();
        check.findings.into_iter().map(|(path, fault)| format!("{path}: {fault}")).collect()
    }

    #[test]
    fn a_coarse_level_needs_multigrid() {
        for method in ["multigrid", "mg-pcg"] {
            let line = format!("solver = {{ method = \"{method}\" }}\noctree = {{ simulate_level = 2 }}");
            assert_eq!(found("octree", &line), [""; 0]);
            let tets = found("tet4", &format!("solver = {{ method = \"{method}\" }}"));
            assert!(tets[0].contains("allowed: octree"), "{tets:?}");
        }
        // What has no levels, or none that can be simulated alone.
        let refused = |line: &str, element: &str, words: &str| {
            let found = found(element, &format!("octree = {{ simulate_level = 1 }}\n{line}"));
            assert!(found.iter().any(|fault| fault.contains(words)), "{found:?}");
        };
        assert_eq!(found("octree", "octree = { simulate_level = 1 }"), [""; 0]);
        refused(
            "solver = { method = \"pcg\" }",
            "octree",
            "simulate_level: found 1 with solver.method = `pcg`, allowed: multigrid, mg-pcg",
        );
        refused("solver = { method = \"cg\" }", "octree", "solver.method = `cg`");
        refused("solver = { method = \"cholesky\" }", "octree", "write solver = { method = \"mg-pcg\" }");
        refused("integrator = \"symplectic-euler\"", "octree", "solver.method = `pcg`");
        refused(
            "solver = { method = \"mg-pcg\" }\nlaw = \"neo-hookean\"",
            "octree",
            "found `mg-pcg` with a law",
        );
        refused("solver = { method = \"mg-pcg\", tolerance = 1e-9 }", "octree", "single precision");
        refused("", "tet4", "`octree` only goes with element octree");
        let coarse = found("octree", "octree = { levels = 1, simulate_level = 2 }");
        assert!(coarse[0].contains("at most levels = 1"), "{coarse:?}");
    }
}
