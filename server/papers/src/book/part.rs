//! The parts of the book: studies that run on their own and leave a page and a report.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use scindo_study::bench::store::Origin;
use serde_json::json;

/// What a part runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A case or an experiment of the accuracy study.
    Accuracy,
    /// The hard cases.
    Stress,
    /// What a hand feels.
    Haptics,
    /// The effects of a scene that comes with the program.
    Effects,
}

/// A part of the book.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Part {
    /// Name, and that of its folder.
    pub name: String,
    /// What it runs.
    pub kind: Kind,
    /// What it shows.
    pub title: String,
}

/// Scenes whose effects are measured.
const SCENES: [&str; 4] = ["demonstration", "kidney", "brain", "fingertip"];

/// Parts of the accuracy study, those that papers need first. The quick form ends with the bar at rest.
const ACCURACY: [(&str, &str); 27] = [
    ("threads", "Threads, shares of a step, and the largest mesh in real time"),
    ("nienhuys", "Relaxation: Nienhuys' table 3.1 and figure 3.12"),
    ("nienhuys-cut", "Cuts along faces: Nienhuys' figures 3.13 to 3.16"),
    ("schoch", "Convergence on a half-cut beam: figure 10 of Schoch"),
    ("slits", "Six ways to cut: 1, 10 and 100 slits"),
    ("front", "The front of a cut inside elements, over its place in them"),
    ("enriched", "What an enriched element costs, by law"),
    ("slice", "A falling slice, linear beside nonlinear"),
    ("springs", "Masses and springs beside finite elements"),
    ("peers", "Steps of SOFA and MuJoCo beside scindo's"),
    ("dick-tables", "Octree cells: tables 1 and 2 of Dick"),
    ("dick-convergence", "Octree cells: rates of multigrid"),
    ("dick-sizes", "Octree cells: time per cell"),
    ("dick-layer", "Octree cells: a soft layer under stiff rods"),
    ("r1", "A block on a bench: error against time"),
    ("r2-tc1", "Schoch's half-cut beam: error against time"),
    ("bar-rest", "The drooping bar: error against time"),
    ("bar-motion", "The bar in motion: error against time"),
    ("cut-tc1", "Methods of cutting, under gravity"),
    ("cut-tc2force", "Methods of cutting, pulled by a force"),
    ("cut-tc2strip", "Methods of cutting, pulled at a strip"),
    ("dick-solvers", "Octree cells: error over time of solvers"),
    ("cells-cube", "Octree cells: the converged cube"),
    ("cells-elements", "Octree cells against tetrahedra at equal error"),
    ("cells-levels", "Octree cells: coarse levels as a dial"),
    ("cells-skin", "Octree cells: their surface beside the solid's own"),
    ("collision", "Methods of collision detection"),
];
/// How many of them the quick form has.
const QUICK: usize = 17;

/// The parts of a book, in the order in which they run.
pub fn parts(quick: bool) -> Vec<Part> {
    let accuracy = &ACCURACY[..if quick { QUICK } else { ACCURACY.len() }];
    let accuracy = accuracy.iter().map(|&(name, title)| (name.to_owned(), Kind::Accuracy, title.to_owned()));
    let effects = SCENES[..if quick { 2 } else { SCENES.len() }].iter();
    let effects = effects.map(|scene| {
        (format!("effects-{scene}"), Kind::Effects, format!("What the effects of `{scene}` cost"))
    });
    let others = [
        ("stress".to_owned(), Kind::Stress, "Hard cases".to_owned()),
        ("haptics".to_owned(), Kind::Haptics, "What a hand feels, by delay and loss".to_owned()),
    ];
    let all = accuracy.chain(others).chain(effects);
    all.map(|(name, kind, title)| Part { name, kind, title }).collect()
}

impl Part {
    /// The folder of the part in the directory of a book.
    pub fn folder(&self, book: &Path) -> PathBuf {
        book.join(&self.name)
    }

    /// The report of the part, for programs.
    pub fn report(&self, book: &Path) -> PathBuf {
        self.folder(book).join(match self.kind {
            Kind::Accuracy => "study.json",
            Kind::Stress => "stress.json",
            Kind::Haptics => "haptics.json",
            Kind::Effects => "effects.json",
        })
    }

    /// Whether the part has a page of its own.
    pub fn has_page(&self) -> bool {
        self.kind != Kind::Effects
    }

    /// The scene whose effects it measures.
    pub fn scene(&self) -> Option<&str> {
        self.name.strip_prefix("effects-").filter(|_| self.kind == Kind::Effects)
    }

    fn mark(&self, book: &Path) -> PathBuf {
        self.folder(book).join("done.json")
    }

    /// Whether an earlier run on this machine, of this build and in this form, has finished the part.
    pub fn is_done(&self, book: &Path, origin: &Origin, quick: bool) -> bool {
        let text = fs::read_to_string(self.mark(book)).unwrap_or_default();
        let mark: serde_json::Value = serde_json::from_str(&text).unwrap_or_default();
        mark["origin"] == json!(origin) && mark["quick"] == json!(quick) && self.report(book).exists()
    }

    /// Seconds that the part took when it was last finished.
    pub fn seconds(&self, book: &Path) -> Option<f64> {
        let mark: serde_json::Value =
            serde_json::from_str(&fs::read_to_string(self.mark(book)).ok()?).ok()?;
        mark["seconds"].as_f64()
    }

    /// Notes that the part is finished.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn finish(&self, book: &Path, origin: &Origin, quick: bool, seconds: f64) -> io::Result<()> {
        let mark = json!({ "origin": origin, "quick": quick, "seconds": seconds });
        fs::write(self.mark(book), format!("{mark:#}\n"))
    }
}
