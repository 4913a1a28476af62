//! The table as text, as JSON and as a page.

use std::fmt::Write as _;

use scindo_study::report::chart::{Chart, Line};
use scindo_study::report::frame::page;
use serde_json::{Value, json};

use super::trial::Trial;

/// One line of figures per cell, with what is out of bounds.
pub fn text(trial: &Trial) -> String {
    let (cell, f) = (&trial.cell, &trial.figures);
    let failures = trial.failures().join(", ");
    format!(
        "{:10} {:>4} ms {:>4.0} %  error {:5.1} % rms {:5.1} % p95 ({:.3} N)  step {:.3} N  energy {:6.2} mJ  \
         cycle {:.3} mm  age {:5.1} ms  {}",
        cell.hand.name,
        cell.delay_ms,
        1e2 * cell.loss,
        1e2 * f.error_rms,
        1e2 * f.error_p95,
        f.error_p95_n,
        f.step_n,
        1e3 * f.gain_j,
        1e3 * f.cycle_m,
        f.age_ms,
        if failures.is_empty() { "ok".to_owned() } else { format!("OUT: {failures}") }
    )
}

/// The table for programs.
pub fn json(trials: &[Trial]) -> Value {
    let cell = |trial: &Trial| {
        json!({
            "hand": trial.cell.hand.name,
            "hand_stiffness_n_m": trial.cell.hand.stiffness_n_m,
            "hand_damping_ns_m": trial.cell.hand.damping_ns_m,
            "hand_mass_kg": trial.cell.hand.mass_kg,
            "round_trip_ms": trial.cell.delay_ms,
            "loss": trial.cell.loss,
            "allowed_error": trial.cell.allowed(),
            "figures": trial.figures,
            "failures": trial.failures(),
        })
    };
    json!({ "cells": trials.iter().map(cell).collect::<Vec<_>>() })
}

/// Every tick of the cells without loss, as CSV.
pub fn ticks(trials: &[Trial]) -> String {
    let mut out = String::from(
        "hand,round_trip_ms,time_s,x_m,y_m,z_m,felt_x_n,felt_y_n,felt_z_n,true_x_n,true_y_n,true_z_n,age_ms\n",
    );
    for trial in trials.iter().filter(|trial| trial.cell.loss == 0.0) {
        for s in &trial.samples {
            let _ = write!(out, "{},{},{:.3}", trial.cell.hand.name, trial.cell.delay_ms, s.time_s);
            let [p, felt, truth] = [s.tip_m, s.felt_n, s.truth_n];
            let metres = p.iter().map(|x| format!(",{x:.6}"));
            let newtons = felt.iter().chain(truth.iter()).map(|f| format!(",{f:.4}"));
            metres.chain(newtons).for_each(|column| out += &column);
            let _ = writeln!(out, ",{:.1}", s.age_ms);
        }
    }
    out
}

/// The page, self-contained.
pub fn html(trials: &[Trial]) -> String {
    let failed = trials.iter().filter(|trial| !trial.failures().is_empty()).count();
    let mut body = format!(
        "<header>\n<h1>What the hand feels</h1>\n<p class=\"lead\">{} cells, {failed} out of bounds. Force of the \
         haptic client against the same tissue solved at 1 kHz without a link.</p>\n</header>\n{METHOD}\
         <section>\n<h2>Table</h2>\n<div class=\"scroll\"><table>\n<thead><tr><th>hand</th><th>round trip</th>\
         <th>loss</th><th>error, rms</th><th>error, p95</th><th>p95 [N]</th><th>largest step [N]</th>\
         <th>energy gained [mJ]</th><th>limit cycle [mm]</th><th>age [ms]</th><th>out of bounds</th></tr></thead>\n<tbody>\n",
        trials.len()
    );
    for trial in trials {
        let (cell, f) = (&trial.cell, &trial.figures);
        let _ = writeln!(
            body,
            "<tr><td>{}</td><td>{} ms</td><td>{:.0} %</td><td>{:.1} %</td><td>{:.1} %</td><td>{:.3}</td>\
             <td>{:.3}</td><td>{:.2}</td><td>{:.3}</td><td>{:.1}</td><td>{}</td></tr>",
            cell.hand.name,
            cell.delay_ms,
            1e2 * cell.loss,
            1e2 * f.error_rms,
            1e2 * f.error_p95,
            f.error_p95_n,
            f.step_n,
            1e3 * f.gain_j,
            1e3 * f.cycle_m,
            f.age_ms,
            trial.failures().join(", ")
        );
    }
    body +=
        "</tbody>\n</table></div>\n</section>\n<section>\n<h2>Force over time</h2>\n<div class=\"charts\">\n";
    for trial in trials.iter().filter(|trial| trial.cell.loss == 0.0) {
        let chart = forces(trial);
        let _ = writeln!(body, "<figure>{}<figcaption>{}</figcaption></figure>", chart.html(), chart.title);
    }
    body += "</div>\n</section>\n";
    page("what the hand feels", "", &body)
}

/// Felt and true force along the vertical, and across it.
fn forces(trial: &Trial) -> Chart {
    let title = format!("{}, {} ms", trial.cell.hand.name, trial.cell.delay_ms);
    let mut chart = Chart::new(&title, "time [s]", "force [N]");
    let line = |name: &str, of: &dyn Fn(&super::measures::Sample) -> f64| Line {
        name: name.to_owned(),
        points: trial.samples.iter().map(|s| [s.time_s, of(s)]).collect(),
    };
    chart.lines.push(line("felt", &|s| s.felt_n.z));
    chart.lines.push(line("true", &|s| s.truth_n.z));
    chart.lines.push(line("felt, across", &|s| s.felt_n.x));
    chart.lines.push(line("true, across", &|s| s.truth_n.x));
    chart
}

const METHOD: &str = "<section>\n<p>A hand of given impedance moves a simulated device (50 g, 3 N·s/m, encoder steps \
of 20 µm, amplifier lag of 1 ms) down to 4 mm below the surface of a soft pad, keeps still, slides by 10 mm and \
leaves. The server steps the pad every 10 ms and sends a contact model every 5 ms; poses and models take half the \
round trip each, and are lost at random. The truth is the same pad stepped every millisecond at the measured \
pose.</p>\n<p>Bounds: 95 % of the errors while touched at most 7 % of the force or 0.05 N up to a round trip of 20 ms, \
and 15 % up to 100 ms; force steps of at most 0.05 N per tick; the hand never receives 2 mJ more than it gave; the tip \
of a still hand moves by at most 0.1 mm about its drift.</p>\n</section>\n";
