//! The screen of `scindo top`.

use std::time::Instant;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Style, Stylize as _};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Paragraph, Row, Table};
use scindo_client::messages::{BodyStats, Stats, ToolStats};

use super::View;

/// Columns of the bar of a stage.
const BAR: usize = 40;

/// Draws `view` as it is at `now`.
pub fn draw(frame: &mut Frame<'_>, view: &View, now: Instant) {
    let Some(stats) = &view.stats else {
        let words = format!("{}: waiting for the first report", view.at);
        frame.render_widget(Paragraph::new(words), frame.area());
        return;
    };
    let rows = |count: usize| Constraint::Max(count as u16 + 2);
    let [head, stages, bodies, tools, rest, foot] = Layout::vertical([
        Constraint::Length(2),
        rows(stats.stages.len()),
        rows(stats.bodies.len() + 1),
        rows(stats.tools.len() + 1),
        Constraint::Fill(1),
        Constraint::Length(1),
    ])
    .areas(frame.area());
    let [clients, refused] = Layout::horizontal([Constraint::Fill(1), Constraint::Fill(1)]).areas(rest);
    draw_head(frame, head, view, (stats, now));
    draw_stages(frame, stages, view, stats);
    draw_bodies(frame, bodies, &stats.bodies);
    draw_tools(frame, tools, &stats.tools);
    draw_clients(frame, clients, stats);
    draw_refused(frame, refused, view, stats);
    frame.render_widget(Line::from("q ends").dim(), foot);
}

fn draw_head(frame: &mut Frame<'_>, area: Rect, view: &View, (stats, now): (&Stats, Instant)) {
    let state = match (view.late_s(now), stats.paused) {
        (Some(seconds), _) => format!("no report for {seconds} s").red().bold(),
        (None, true) => "paused".yellow(),
        (None, false) => "running".green(),
    };
    let factor = format!("{:.2} of real time", stats.real_time_factor);
    let keeps_up = stats.paused || stats.real_time_factor > 0.95;
    let title = Line::from(vec![
        "scindo ".bold(),
        view.info.scene_name.clone().into(),
        format!("  {}", view.at).dim(),
    ]);
    let line = Line::from(vec![
        state,
        format!("  {:.2} s simulated  {:.1} steps/s  ", stats.sim_time_s, stats.step_rate_hz).into(),
        if keeps_up { factor.into() } else { factor.yellow() },
        format!("  {} cuts", stats.cuts_applied).into(),
    ]);
    frame.render_widget(Paragraph::new(vec![title, line]), area);
}

fn draw_stages(frame: &mut Frame<'_>, area: Rect, view: &View, stats: &Stats) {
    // The sum of nothing would be -0.
    let whole = stats.stages.iter().fold(0.0, |sum: f32, stage| sum + stage.milliseconds);
    let step_ms = 1e3 * view.info.step_s;
    let largest = stats.stages.iter().map(|stage| stage.milliseconds).fold(f32::MIN_POSITIVE, f32::max);
    let lines = stats.stages.iter().map(|stage| {
        let bar = "█".repeat((BAR as f32 * stage.milliseconds / largest).round() as usize);
        let name = format!("{:<12}{:>9.3} ms  ", stage.name, stage.milliseconds);
        Line::from(vec![Span::raw(name), bar.cyan()])
    });
    let title = format!(" step {whole:.2} ms of {step_ms:.2} ms ");
    let block = Block::bordered().title(title);
    let style = if f64::from(whole) > step_ms { Style::new().fg(Color::Yellow) } else { Style::new() };
    let stages = Paragraph::new(lines.collect::<Vec<_>>());
    frame.render_widget(stages.block(block.border_style(style)), area);
}

fn draw_bodies(frame: &mut Frame<'_>, area: Rect, bodies: &[BodyStats]) {
    let row = |body: &BodyStats| {
        let troubled = [
            body.unconverged_steps,
            body.refused_steps,
            body.divided_steps,
            body.rolled_back_steps,
            body.unbalanced_steps,
        ];
        let row = Row::new([
            body.body_id.clone(),
            body.elements.to_string(),
            body.copies.to_string(),
            body.iterations.to_string(),
            format!("{:.1e}", body.residual),
            body.inverted.to_string(),
            troubled.map(|count| count.to_string()).join(" "),
        ]);
        // With a fixed number of iterations the scene has chosen not to converge.
        if (body.unconverged && !body.fixed_iterations) || body.inverted > 0 { row.yellow() } else { row }
    };
    let titles =
        ["body", "elements", "copies", "iterations", "residual", "inverted", "unconv refused div back unbal"];
    table(frame, area, &titles, bodies.iter().map(row));
}

fn draw_tools(frame: &mut Frame<'_>, area: Rect, tools: &[ToolStats]) {
    let row = |tool: &ToolStats| {
        Row::new([
            tool.tool_id.clone(),
            if tool.name.is_empty() { tool.owner.clone() } else { format!("{} ({})", tool.owner, tool.name) },
            format!("{:.0}", tool.pose_rate_hz),
            format!("{:.0}", tool.contact_rate_hz),
            known(tool.contact_age_ms),
            known(tool.pose_age_ms),
            format!("{:.2}", tool.force_n),
        ])
    };
    let titles = ["tool", "held by", "poses/s", "contacts/s", "age ms", "lag ms", "force N"];
    table(frame, area, &titles, tools.iter().map(row));
}

/// A time [ms]; 0 stands for one that nobody knows.
fn known(milliseconds: f32) -> String {
    if milliseconds > 0.0 { format!("{milliseconds:.1}") } else { "-".to_owned() }
}

fn table<'a>(frame: &mut Frame<'_>, area: Rect, titles: &[&'a str; 7], rows: impl Iterator<Item = Row<'a>>) {
    let widths = [3, 3, 2, 2, 2, 2, 4].map(Constraint::Fill);
    let header = Row::new(titles.map(|title| title.to_owned())).dim();
    frame.render_widget(Table::new(rows, widths).header(header).block(Block::bordered()), area);
}

fn draw_clients(frame: &mut Frame<'_>, area: Rect, stats: &Stats) {
    let lines =
        stats.clients.iter().map(|client| Line::from(format!("{:<8}{}", client.role, client.client_id)));
    let title = format!(" {} clients, {} surfaces watched ", stats.client_count, stats.surface_subscribers);
    let block = Block::bordered().title(title);
    frame.render_widget(Paragraph::new(lines.collect::<Vec<_>>()).block(block), area);
}

fn draw_refused(frame: &mut Frame<'_>, area: Rect, view: &View, stats: &Stats) {
    let lines = stats.refused.iter().enumerate().map(|(index, counter)| {
        let rate = view.refused_hz.get(index).copied().unwrap_or(0.0);
        let line = Line::from(format!("{:<20}{:>10}  {rate:.0}/s", counter.name, counter.count));
        if rate > 0.0 { line.yellow() } else { line }
    });
    let block = Block::bordered().title(" refused or lost ");
    frame.render_widget(Paragraph::new(lines.collect::<Vec<_>>()).block(block), area);
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::time::Duration;

    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use scindo_client::messages::{ClientStats, Counter, SessionInfo, StageTime};

    use super::*;

    fn stage(name: &str, milliseconds: f32) -> StageTime {
        StageTime { name: name.into(), milliseconds }
    }

    fn stats() -> Stats {
        Stats {
            sim_time_s: 12.345,
            step_rate_hz: 99.8,
            real_time_factor: 0.998,
            stages: vec![stage("deform", 2.0), stage("contact", 0.5)],
            bodies: vec![BodyStats {
                body_id: "liver".into(),
                iterations: 31,
                residual: 3e-4,
                divided_steps: 2,
                ..BodyStats::default()
            }],
            tools: vec![ToolStats {
                tool_id: "scalpel".into(),
                owner: "desk-17".into(),
                name: "Anna".into(),
                contact_rate_hz: 499.6,
                force_n: 1.25,
                ..ToolStats::default()
            }],
            refused: vec![Counter { name: "not-owner".into(), count: 40 }],
            clients: vec![ClientStats { client_id: "desk-17".into(), role: "haptic".into() }],
            client_count: 1,
            ..Stats::default()
        }
    }

    fn text(view: &View, now: Instant, (width, height): (u16, u16)) -> String {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| draw(frame, view, now)).unwrap();
        let cells = terminal.backend().buffer().content();
        let lines =
            cells.chunks(usize::from(width)).map(|line| line.iter().map(|cell| cell.symbol()).collect());
        lines.collect::<Vec<String>>().join("\n")
    }

    fn view(came: Instant) -> View {
        let info = SessionInfo { scene_name: "first cut".into(), step_s: 0.01, ..SessionInfo::default() };
        let mut view = View { at: "tcp/10.0.0.1:7447".into(), info, ..View::default() };
        view.take(stats(), came);
        view
    }

    #[test]
    fn a_report_stands_on_the_screen() {
        let start = Instant::now();
        let mut view = view(start);
        let mut later = stats();
        later.refused[0].count = 50;
        view.take(later, start + Duration::from_millis(500));
        let screen = text(&view, start + Duration::from_millis(600), (110, 30));
        for words in [
            "first cut",
            "tcp/10.0.0.1:7447",
            "running",
            "12.35 s simulated",
            "step 2.50 ms of 10.00 ms",
            "deform          2.000 ms",
            "liver",
            "31",
            "3.0e-4",
            "0 0 2 0",
            "desk-17 (Anna)",
            "500",
            "1.25",
            "1 clients",
            "20/s",
        ] {
            assert!(screen.contains(words), "{words} in\n{screen}");
        }
        let bars = |name: &str| screen.lines().find(|l| l.contains(name)).unwrap().matches('█').count();
        assert_eq!((bars("deform"), bars("contact ")), (BAR, BAR / 4));
    }

    #[test]
    fn silence_is_told() {
        let start = Instant::now();
        let screen = text(&view(start), start + Duration::from_secs(7), (110, 30));
        assert!(screen.contains("no report for 7 s") && !screen.contains("running"), "{screen}");
        let empty = View { at: "tcp/10.0.0.1:7447".into(), ..View::default() };
        assert!(text(&empty, start, (80, 5)).contains("waiting for the first report"));
    }

    #[test]
    fn no_window_is_too_small() {
        let start = Instant::now();
        for size in [(1, 1), (10, 3), (40, 8), (300, 100)] {
            text(&view(start), start, size);
        }
    }
}
