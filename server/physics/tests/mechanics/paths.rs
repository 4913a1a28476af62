//! The tables of the README that say which settings take the fast path: computed here, compared with what is printed.
//!
//! After a change: `SCINDO_WRITE=1 cargo test -p scindo-physics --test mechanics paths`.

use std::fmt::Write;
use std::path::Path;

use scindo_physics::body::{BodySettings, ElementKind, MassKind, Method, Scheme, Volumetric};
use scindo_physics::integrator::Multistep;
use scindo_physics::material::{Fibre, Fibres, Law, Prony, PronyTerm};

/// Elements as a scene names them; hexahedra of equal cubes are a case of their own.
const ELEMENTS: [(&str, ElementKind, bool); 5] = [
    ("tet4", ElementKind::Tet4, false),
    ("hex8, equal cubes", ElementKind::Hex8, true),
    ("octree", ElementKind::Octree, false),
    ("tet10", ElementKind::Tet10, false),
    ("hex8, other boxes", ElementKind::Hex8, false),
];
const SCHEMES: [(&str, Scheme); 8] = [
    ("static", Scheme::Static),
    ("implicit-euler", Scheme::ImplicitEuler),
    ("bdf2", Scheme::Bdf2),
    ("newmark", Scheme::AVERAGE_ACCELERATION),
    ("generalised-alpha", Scheme::GeneralisedAlpha { spectral_radius: 0.8 }),
    ("symplectic-euler", Scheme::SymplecticEuler),
    ("midpoint", Scheme::Midpoint),
    ("rk4", Scheme::Rk4),
];

fn word(law: Law) -> &'static str {
    match law {
        Law::Linear => "linear",
        Law::Corotational => "corotational",
        Law::StVenantKirchhoff => "stvk",
        Law::NeoHookean => "neo-hookean",
    }
}

/// How a step of these settings is solved.
fn path(settings: &BodySettings, law: Law) -> String {
    settings.check(law).unwrap();
    match (settings.why_general(law), settings.scheme, law.rotates()) {
        (Some(_), ..) => "general".into(),
        (None, Scheme::Static, true) => "fast, with a line search".into(),
        (None, scheme, _) => match Multistep::solves(scheme, law) {
            1 => "fast".into(),
            solves => format!("fast, up to {solves} solves"),
        },
    }
}

/// Merges neighbours with the same value; their names are listed together.
fn grouped<T: PartialEq>(items: impl IntoIterator<Item = (String, T)>) -> Vec<(Vec<String>, T)> {
    let mut groups: Vec<(Vec<String>, T)> = Vec::new();
    for (name, value) in items {
        match groups.iter_mut().find(|(_, known)| *known == value) {
            Some((names, _)) => names.push(name),
            None => groups.push((vec![name], value)),
        }
    }
    groups
}

/// Element × law × integrator → path, with equal rows and equal columns merged.
fn table_of_paths() -> String {
    let cell = |(_, element, cubes): (&str, ElementKind, bool), law, scheme| {
        path(&BodySettings { element, cubes, scheme, ..BodySettings::default() }, law)
    };
    let every = || ELEMENTS.into_iter().flat_map(|element| Law::ALL.map(|law| (element, law)));
    let columns = grouped(SCHEMES.map(|(name, scheme)| {
        (format!("`{name}`"), every().map(|(element, law)| cell(element, law, scheme)).collect::<Vec<_>>())
    }));
    let laws = |element| {
        grouped(Law::ALL.map(|law| (format!("`{}`", word(law)), SCHEMES.map(|(_, s)| cell(element, law, s)))))
    };
    let heads: Vec<String> = columns.iter().map(|(names, _)| names.join(", ")).collect();
    let mut text =
        format!("| element | law | {} |\n|---|---|{}\n", heads.join(" | "), "---|".repeat(heads.len()));
    for (elements, laws) in grouped(ELEMENTS.map(|element| (element.0.to_owned(), laws(element)))) {
        for (names, cells) in &laws {
            let law = if laws.len() == 1 { "every law".to_owned() } else { names.join(", ") };
            let first = |names: &[String]| {
                SCHEMES.iter().position(|(name, _)| names[0] == format!("`{name}`")).unwrap()
            };
            let cells: Vec<String> = columns.iter().map(|(names, _)| cells[first(names)].clone()).collect();
            writeln!(text, "| {} | {law} | {} |", elements.join("; "), cells.join(" | ")).unwrap();
        }
    }
    text
}

/// Settings that the fast path does not know, with the reason that the program gives.
fn table_of_reasons() -> String {
    let plain = BodySettings::default();
    let fibres =
        Fibres::new([Fibre { direction: nalgebra::Vector3::x(), stiffness_pa: 1e4, stiffening: 0.0 }]);
    let prony = Prony::new([PronyTerm { ratio: 1.0, time_s: 1.0 }]);
    let still = BodySettings { scheme: Scheme::Static, element: ElementKind::Octree, ..plain };
    let cases = [
        ("`[[body.fibre]]`", BodySettings { fibres, ..plain }),
        ("`[[body.prony]]`", BodySettings { prony, ..plain }),
        ("`load.pressure_pa` with `static` and a law that rotates", BodySettings { pressed: true, ..still }),
        ("`solver.method = \"cg\"`", BodySettings { method: Method::Cg, ..plain }),
        ("`solver.method = \"cholesky\"`", BodySettings { method: Method::Cholesky, ..plain }),
        ("`solver.newton_steps` above 1", BodySettings { newton_steps: Some(2), ..plain }),
        ("`mass = \"consistent\"`", BodySettings { mass: MassKind::Consistent, ..plain }),
        ("`mass = \"menouillard\"`", BodySettings { mass: MassKind::Menouillard, ..plain }),
        ("`mass = \"floored\"`", BodySettings { mass: MassKind::Floored, ..plain }),
        ("`locking`", BodySettings { volumetric: Volumetric::NodeAveraged { kept: 0.05 }, ..plain }),
    ];
    assert_eq!(still.why_general(Law::Corotational), None);
    let mut text = "| key | reason that `scindo check` prints |\n|---|---|\n".to_owned();
    for (key, settings) in cases {
        let why =
            settings.why_general(Law::Corotational).unwrap_or_else(|| panic!("{key} takes the fast path"));
        writeln!(text, "| {key} | {why} |").unwrap();
    }
    text
}

/// Compares `table` with what stands between two comments of the README, or writes it there.
fn hold(name: &str, table: &str) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("README.md");
    let text = std::fs::read_to_string(&file).unwrap();
    let (before, rest) = text.split_once(&format!("<!-- {name}")).unwrap();
    let (comment, rest) = rest.split_once("-->\n").unwrap();
    let (printed, after) = rest.split_once(&format!("<!-- end of the {name} -->")).unwrap();
    if std::env::var_os("SCINDO_WRITE").is_some() {
        let text = format!("{before}<!-- {name}{comment}-->\n\n{table}\n<!-- end of the {name} -->{after}");
        return std::fs::write(file, text).unwrap();
    }
    assert!(
        printed.trim() == table.trim(),
        "the {name} is not up to date; write it with SCINDO_WRITE=1:\n{table}"
    );
}

#[test]
fn the_tables_of_the_paths_are_those_of_the_code() {
    hold("table of paths", &table_of_paths());
    hold("table of reasons", &table_of_reasons());
}
