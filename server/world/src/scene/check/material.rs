//! Regions of another material.

use nalgebra::Vector3;
use scindo_physics::material::{Fibre, Fibres};

use super::super::checked::{MaterialPlace, MaterialSpec};
use super::super::problem::Fault;
use super::super::raw::*;
use super::Check;

/// Length of a direction below which it says nothing.
const SHORTEST: f64 = 1e-9;

impl Check<'_> {
    /// Regions of another material.
    pub(super) fn materials(&mut self, at: &str, body: &RawBody) -> Vec<MaterialSpec> {
        if body.material.is_empty() {
            return Vec::new();
        }
        let tets = matches!(body.element, RawElement::Tet4 | RawElement::Tet10);
        if tets && body.cut_method().changes_mesh() {
            let what = "cutting.method makes new elements, which would have no material";
            self.conflict(format!("{at}.material"), what, "write cutting.method = \"xfem\"");
        }
        if body.locking == RawLocking::NodeAveraged {
            let what = "node-averaged volume would be averaged over elements of different materials";
            let next = "write locking = \"none\" with element = \"tet10\", or remove [[body.material]]";
            self.conflict(format!("{at}.material"), what, next);
        }
        body.material.iter().enumerate().map(|(i, raw)| self.material(at, i, raw, body)).collect()
    }

    /// Families of fibres.
    pub(super) fn fibres(&mut self, at: &str, body: &RawBody) -> Fibres {
        let mut families = Vec::new();
        for (i, raw) in body.fibre.iter().enumerate() {
            let direction = Vector3::from(raw.direction);
            if direction.norm() < SHORTEST {
                let (found, allowed) = (format!("{:?}", raw.direction), "a vector with a length".to_owned());
                let next = "write for example [1, 0, 0]".to_owned();
                self.report(format!("{at}.fibre.{i}.direction"), Fault::OutOfRange { found, allowed, next });
                continue;
            }
            if raw.stiffening > 0.0 && body.law == RawLaw::Linear {
                let what =
                    "fibres do not stiffen in the linear law, whose stress is linear in the displacement";
                let next = "remove it, or write law = \"corotational\"";
                self.conflict(format!("{at}.fibre.{i}.stiffening"), what, next);
            }
            let (stiffness_pa, stiffening) = (raw.stiffness_pa, raw.stiffening);
            families.push(Fibre { direction, stiffness_pa, stiffening });
        }
        Fibres::new(families)
    }

    fn material(&mut self, at: &str, i: usize, raw: &RawMaterial, body: &RawBody) -> MaterialSpec {
        let at = format!("{at}.material.{i}");
        if raw.scale.is_some() && raw.surface.is_none() {
            let what = "`scale` only goes with `surface`";
            self.conflict(format!("{at}.scale"), what, "give other regions in metres");
        }
        if raw.array.is_some() && raw.group.is_none() {
            let what = "`array` only goes with `group`";
            self.conflict(format!("{at}.array"), what, "write group = \"1\" beside it, or remove it");
        }
        if raw.group.is_some() && body.mesh.file.is_none() {
            let what = "only a file of tetrahedra has groups";
            self.conflict(format!("{at}.group"), what, "give the region by `where` or `surface`");
        }
        if raw.young_pa.is_none() && raw.poisson.is_none() && raw.density_kg_m3.is_none() {
            let what = "the region has the material of the body";
            self.conflict(at.clone(), what, "give young_pa, poisson or density_kg_m3, or remove it");
        }
        let place = match (&raw.surface, &raw.group, &raw.r#where) {
            (Some(path), _, _) => {
                MaterialPlace::Surface { path: path.clone(), scale: raw.scale.unwrap_or(1.0) }
            }
            (None, Some(group), _) => MaterialPlace::Group { group: group.clone(), array: raw.array.clone() },
            (None, None, region) => {
                let region = region.clone().unwrap_or_default();
                MaterialPlace::Region(self.region(&format!("{at}.where"), &region))
            }
        };
        MaterialSpec {
            place,
            young_pa: raw.young_pa.unwrap_or(body.young_pa),
            poisson: raw.poisson.unwrap_or(body.poisson),
            density_kg_m3: raw.density_kg_m3.unwrap_or(body.density_kg_m3),
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// What a body with these lines is refused for.
    fn found(mesh: &str, lines: &str) -> Vec<String> {
        let text = format!(
            "schema = 1\n[[body]]\nid = \"b\"\nyoung_pa = 1e4\npoisson = 0.3\ndensity_kg_m3 = 1000\n\
             mesh = {mesh}\n{lines}"
        );
        let raw: RawScene = toml::from_str(&text).unwrap();
        let mut check = Check { raw: &raw, findings: Vec::new() };
        check.scene();
        check.findings.into_iter().map(|(path, fault)| format!("{path}: {fault}")).collect()
    }

    #[test]
    fn regions_go_with_what_keeps_elements_apart() {
        let (organ, file) = ("{ organ = { cells = 16 } }", "{ file = \"a.msh\" }");
        let slab =
            "[[body.material]]\nyoung_pa = 1e5\nwhere = { slab = { axis = \"z\", from = 0.5, to = 1.0 } }";
        for element in ["tet4", "tet10", "octree"] {
            assert_eq!(found(organ, &format!("element = \"{element}\"\n{slab}")), [""; 0], "{element}");
        }
        let refused = |mesh: &str, lines: &str, words: &str| {
            let found = found(mesh, lines);
            assert!(found.iter().any(|fault| fault.contains(words)), "{found:?}");
        };
        refused(organ, &format!("cutting = {{ method = \"snap\" }}\n{slab}"), "makes new elements");
        let averaged = format!("law = \"neo-hookean\"\nlocking = \"node-averaged\"\n{slab}");
        refused(organ, &averaged, "averaged over elements of different materials");
        let group = "[[body.material]]\nyoung_pa = 1e5\ngroup = \"tumour\"";
        assert_eq!(found(file, group), [""; 0]);
        assert_eq!(found(file, &group.replace("\"tumour\"", "\"2\"\narray = \"label\"")), [""; 0]);
        refused(organ, group, "material.0.group: only a file of tetrahedra has groups");
        refused(file, &format!("{slab}\narray = \"label\""), "`array` only goes with `group`");
        refused(file, "[[body.material]]\ngroup = \"1\"", "the region has the material of the body");
    }
}
