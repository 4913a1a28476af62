//! Makes experiments on octree cells without the program:
//! `cargo run --release -p scindo-study --example experiments -- OUT [quick] NAME…`.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use scindo_study::{Settings, run};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1);
    let out = PathBuf::from(words.next().unwrap_or_else(|| "experiments".to_owned()));
    let (quick, names): (Vec<String>, Vec<String>) = words.partition(|word| word == "quick");
    let settings = Settings {
        cases: if names.is_empty() { vec!["dick".to_owned()] } else { names },
        out,
        quick: !quick.is_empty(),
        within_s: None,
        budget_ms: None,
        seconds: None,
        only: Vec::new(),
        cells: Vec::new(),
        surface: None,
        stop: Arc::new(AtomicBool::new(false)),
    };
    let study =
        run(&settings, &mut |now| eprintln!("{} {}/{}: {}", now.case, now.done, now.total, now.what))?;
    println!("{}", settings.out.join("index.html").display());
    if study.has_results() { Ok(()) } else { Err("an experiment could not be made".into()) }
}
