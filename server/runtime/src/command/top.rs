//! `scindo top` shows what a server does, until q is pressed.

use std::io::{IsTerminal as _, stdout};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use scindo_client::messages::Stats;
use scindo_client::{Latest, Link, LinkConfig, LinkError, Role};
use scindo_program::say;
use tokio::time::timeout;

use super::cli::TopArgs;
use crate::error::RuntimeError;
use crate::monitor::top::{View, report, screen};

/// How long a key may wait for its effect.
const PERIOD: Duration = Duration::from_millis(100);

/// How often the name of the scene is asked for; it may change.
const ASK: Duration = Duration::from_secs(5);

/// How long the first report may take.
const PATIENCE: Duration = Duration::from_secs(10);

/// Connects, and shows reports: on the screen, or as one object per line.
pub fn top(args: &TopArgs) -> Result<ExitCode, RuntimeError> {
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build();
    let runtime = runtime.map_err(failed("starting threads"))?;
    if !args.json && !args.once && !stdout().is_terminal() {
        return Err(RuntimeError::Option {
            option: "top",
            value: "a pipe or file".to_owned(),
            reason: "the screen needs a terminal".to_owned(),
            next: "Add --once or --json".to_owned(),
        });
    }
    runtime.block_on(watch(args))
}

fn failed(what: &'static str) -> impl Fn(std::io::Error) -> RuntimeError {
    move |error| RuntimeError::System { what: what.to_owned(), reason: error.to_string() }
}

async fn watch(args: &TopArgs) -> Result<ExitCode, RuntimeError> {
    let id = format!("top-{}", std::process::id());
    let mut config = LinkConfig::new(Role::Client, args.id.as_deref().unwrap_or(&id));
    config.realm.clone_from(&args.realm);
    config.session.clone_from(&args.session);
    config.zenoh_file.clone_from(&args.zenoh);
    if !args.connect.is_empty() || args.zenoh.is_some() {
        config.connect.clone_from(&args.connect);
    }
    let at = format!("{} at {}", args.session, config.connect.join(", "));
    let link = Link::connect(config).await?;
    let mut newest = link.stats().await?;
    let first = timeout(PATIENCE, newest.next()).await;
    let first = first.map_err(|_| LinkError::NoServer { key: at.clone() })??;
    let info = link.info().await?;
    let mut view = View { at, info, ..View::default() };
    view.take((*first).clone(), Instant::now());
    if args.json {
        return lines(args, &mut newest, &view).await;
    }
    if args.once {
        return once(&view);
    }
    let mut terminal = ratatui::try_init().map_err(failed("preparing the terminal"))?;
    let shown = tokio::task::block_in_place(|| show(&mut terminal, &link, &newest, &mut view));
    ratatui::restore();
    shown.map_err(failed("drawing")).map(|()| ExitCode::SUCCESS)
}

async fn lines(args: &TopArgs, newest: &mut Latest<Stats>, view: &View) -> Result<ExitCode, RuntimeError> {
    if let Some(stats) = &view.stats {
        say!("{}", report::json(stats));
    }
    if args.once {
        return Ok(ExitCode::SUCCESS);
    }
    loop {
        let stats = newest.next().await?;
        say!("{}", report::json(&stats));
    }
}

/// One screen as plain text.
fn once(view: &View) -> Result<ExitCode, RuntimeError> {
    let (width, height) = ratatui::crossterm::terminal::size().unwrap_or((110, 30));
    let backend = ratatui::backend::TestBackend::new(width, height);
    let mut terminal = match ratatui::Terminal::new(backend) {
        Ok(terminal) => terminal,
        Err(never) => match never {},
    };
    match terminal.draw(|frame| screen::draw(frame, view, Instant::now())) {
        Ok(frame) => {
            let cells = frame.buffer.content();
            for line in cells.chunks(usize::from(width).max(1)) {
                let line: String = line.iter().map(|cell| cell.symbol()).collect();
                say!("{}", line.trim_end());
            }
        }
        Err(never) => match never {},
    }
    Ok(ExitCode::SUCCESS)
}

fn show(
    terminal: &mut ratatui::DefaultTerminal,
    link: &Link,
    newest: &Latest<Stats>,
    view: &mut View,
) -> std::io::Result<()> {
    let here = tokio::runtime::Handle::current();
    let mut asked = Instant::now();
    loop {
        let now = Instant::now();
        if let Some(stats) = newest.get()
            && view.stats.as_ref().is_none_or(|known| known.publish_unix_ns != stats.publish_unix_ns)
        {
            view.take((*stats).clone(), now);
        }
        if asked.elapsed() > ASK {
            asked = now;
            // A server that is away is told by the age of its report.
            if let Ok(info) = here.block_on(link.info()) {
                view.info = info;
            }
        }
        terminal.draw(|frame| screen::draw(frame, view, now))?;
        if event::poll(PERIOD)? && ends(&event::read()?) {
            return Ok(());
        }
    }
}

/// q, Escape and Ctrl-C end the screen.
fn ends(event: &Event) -> bool {
    let Event::Key(key) = event else { return false };
    let interrupted = key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
    key.kind != KeyEventKind::Release
        && (interrupted || matches!(key.code, KeyCode::Char('q') | KeyCode::Esc))
}

#[cfg(test)]
mod tests {
    use ratatui::crossterm::event::KeyEvent;

    use super::*;

    #[test]
    fn q_ends_and_other_keys_do_not() {
        let press = |code, modifiers| ends(&Event::Key(KeyEvent::new(code, modifiers)));
        assert!(press(KeyCode::Char('q'), KeyModifiers::NONE));
        assert!(press(KeyCode::Char('c'), KeyModifiers::CONTROL));
        assert!(press(KeyCode::Esc, KeyModifiers::NONE));
        assert!(!press(KeyCode::Char('c'), KeyModifiers::NONE));
        assert!(!ends(&Event::Resize(80, 24)));
    }
}
