//! What `scindo`, `scindo-view`, `scindo-haptic` and `scindo-igtl` share: version, log, completions and man pages.

mod say;

mod seldom;

use std::io::{self, IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};

use clap::{Command, CommandFactory, Subcommand};
use clap_complete::Shell;
use tracing_subscriber::fmt::MakeWriter;
use tracing_subscriber::fmt::format::FmtSpan;
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;
use tracing_subscriber::{EnvFilter, Layer, Registry};

use seldom::Seldom;

/// The environment variable that chooses what is logged, such as `SCINDO_LOG=debug`.
pub const LOG_VARIABLE: &str = "SCINDO_LOG";

/// The environment variable that chooses the form of the log: `text` (default) or `json`, one object per line.
pub const FORMAT_VARIABLE: &str = "SCINDO_LOG_FORMAT";

/// Version and commit, such as `0.1.0 (1a2b3c4d5e)`. Only optimised builds in a repository know their commit, and those
/// that were told it by `SCINDO_COMMIT`.
pub const VERSION: &str = env!("SCINDO_VERSION");

/// Starts the log on standard error. `SCINDO_LOG` filters it; `default` is used if the variable is unset.
/// Spans, such as those of a step at the level `trace`, are a line with their duration when they end.
///
/// A directive that cannot be read is reported, and `default` is used.
pub fn start_log(default: &str) {
    let asked = std::env::var(LOG_VARIABLE).ok().filter(|words| !words.trim().is_empty());
    let filter = match asked.as_deref().map(EnvFilter::try_new) {
        Some(Ok(filter)) => filter,
        Some(Err(error)) => {
            let words = asked.unwrap_or_default();
            eprintln!(
                "warning: {LOG_VARIABLE}={words}: {error}; expected directives such as debug or warn,scindo=info"
            );
            EnvFilter::new(default)
        }
        None => EnvFilter::new(default),
    };
    let format = std::env::var(FORMAT_VARIABLE).unwrap_or_default();
    let lines = match &*format {
        "json" => json(io::stderr),
        "" | "text" => text(),
        _ => {
            eprintln!("warning: {FORMAT_VARIABLE}={format}: expected text or json; text is used");
            text()
        }
    };
    tracing_subscriber::registry().with(lines.with_filter(Seldom::default())).with(filter).init();
}

type Lines = Box<dyn Layer<Registry> + Send + Sync>;

/// Lines for people.
fn text() -> Lines {
    let lines = tracing_subscriber::fmt::layer().with_writer(io::stderr);
    lines.with_ansi(io::stderr().is_terminal()).with_target(false).with_span_events(FmtSpan::CLOSE).boxed()
}

/// Lines for programs: one object each, with `timestamp`, `level`, `target`, `message` and the fields of the event.
fn json<W>(writer: W) -> Lines
where
    W: for<'a> MakeWriter<'a> + Send + Sync + 'static,
{
    let lines = tracing_subscriber::fmt::layer().json().flatten_event(true).with_writer(writer);
    lines.with_span_events(FmtSpan::CLOSE).boxed()
}

/// The commands that describe a program to a shell and to `man`.
#[derive(Debug, Subcommand)]
pub enum Manual {
    /// Print completions for a shell; save them where the shell looks for them.
    Completions {
        /// The shell.
        #[arg(value_enum)]
        shell: Shell,
    },
    /// Write man pages, one per command.
    Man {
        /// Directory for the man pages; it is created if missing.
        directory: PathBuf,
    },
}

impl Manual {
    /// Writes completions or man pages of the program `P`.
    ///
    /// # Errors
    /// A file or the pipe cannot be written.
    pub fn run<P: CommandFactory>(&self) -> io::Result<()> {
        match self {
            Self::Completions { shell } => {
                // A reader may close its end early; the generator itself would panic at that.
                let text = completions(*shell, P::command());
                match io::stdout().write_all(&text) {
                    Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
                    written => written,
                }
            }
            Self::Man { directory } => man_pages(P::command(), directory),
        }
    }
}

fn completions(shell: Shell, mut program: Command) -> Vec<u8> {
    let name = program.get_name().to_owned();
    let mut text = Vec::new();
    clap_complete::generate(shell, &mut program, name, &mut text);
    text
}

fn man_pages(program: Command, directory: &Path) -> io::Result<()> {
    std::fs::create_dir_all(directory)?;
    clap_mangen::generate_to(program.disable_help_subcommand(true), directory)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::sync::{Arc, Mutex};

    use super::*;

    #[derive(Clone, Default)]
    struct Kept(Arc<Mutex<Vec<u8>>>);

    impl io::Write for Kept {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_line_for_programs_is_one_object_whatever_is_logged() {
        let kept = Kept::default();
        let writer = kept.clone();
        let log = tracing_subscriber::registry().with(json(move || writer.clone()));
        tracing::subscriber::with_default(log, || {
            tracing::warn!(name = "cut-failed", seq = 7, "a blade\nsaid \"no\"");
        });
        let line = String::from_utf8(kept.0.lock().unwrap().clone()).unwrap();
        assert_eq!(line.lines().count(), 1, "{line}");
        let object: serde_json::Value = serde_json::from_str(&line).unwrap();
        assert_eq!(
            (&object["level"], &object["name"], &object["seq"]),
            (&"WARN".into(), &"cut-failed".into(), &7.into())
        );
        assert_eq!(object["message"], "a blade\nsaid \"no\"");
    }

    #[test]
    fn the_version_begins_with_that_of_the_package() {
        assert_eq!(VERSION.split(' ').next(), Some(env!("CARGO_PKG_VERSION")));
    }

    #[derive(clap::Parser)]
    #[command(name = "example", version = "1.2.3")]
    struct Example {
        /// How sharp it is.
        #[arg(long)]
        sharpness: Option<f64>,
        #[command(subcommand)]
        manual: Option<Manual>,
    }

    #[test]
    fn every_shell_learns_every_option() {
        for shell in [Shell::Bash, Shell::Zsh, Shell::Fish, Shell::Elvish, Shell::PowerShell] {
            let text = String::from_utf8(completions(shell, Example::command())).unwrap();
            assert!(text.contains("sharpness") && text.contains("completions"), "{shell}");
        }
    }

    #[test]
    fn every_command_has_a_page() {
        let folder = tempfile::tempdir().unwrap();
        man_pages(Example::command(), &folder.path().join("man1")).unwrap();
        for (page, word) in [("example.1", "sharpness"), ("example-man.1", "DIRECTORY")] {
            let text = std::fs::read_to_string(folder.path().join("man1").join(page)).unwrap();
            assert!(text.contains(word), "{page}: {text}");
        }
    }
}
