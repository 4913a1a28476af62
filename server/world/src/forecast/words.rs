//! A forecast in words that say what to set.

use std::fmt;

use super::{BodyForecast, Ending, Forecast, Source};
use crate::quantity::{digits, duration, length, mass};
use crate::scene::raw::{RawIntegrator, RawMethod};
use crate::scene::{BodySpec, CheckedScene};

/// Room above the iterations that were needed.
const ROOM: f64 = 1.3;

/// Adds what goes wrong to the warnings of `forecast`.
pub(super) fn warnings(scene: &CheckedScene, forecast: &mut Forecast) {
    let mut found = Vec::new();
    for (spec, body) in scene.bodies.iter().zip(&forecast.bodies) {
        let at = format!("body.{}", body.id);
        if body.refused_steps > 0 {
            found.push(format!(
                "{at}: {} of {} steps are refused or rolled back, and the body stands still in them; {}",
                body.refused_steps,
                forecast.steps,
                refusal(spec)
            ));
        }
        if body.unconverged_steps > 0 && !spec.mechanics.fixed_iterations {
            found.push(unconverged(&at, spec, body, forecast.steps));
        }
        if body.inverted_elements > 0 || body.least_volume_ratio <= 0.0 {
            let at_once = spec.displacement.is_constant();
            let displaced = at_once && spec.fixes.iter().any(|fix| fix.displacement_m.norm() > 0.0);
            let slower = if displaced {
                "; write displacement_over_s = 1 to apply displacements gradually"
            } else {
                ""
            };
            found.push(format!(
                "{at}: elements turn inside out (up to {}, smallest volume ratio {}): the body is too soft for \
                 its loads, or its mesh is too coarse; raise young_pa, take law = \"neo-hookean\", or hold more \
                 of it{slower}",
                body.inverted_elements.max(1),
                digits(body.least_volume_ratio)
            ));
        }
        if body.free_parts > 0 && !scene.cuts.is_empty() {
            found.push(format!(
                "{at}: nothing holds {} after the scheduled cuts ({})",
                if body.free_parts == 1 { "a part".into() } else { format!("{} parts", body.free_parts) },
                mass(body.free_mass_kg)
            ));
        }
    }
    forecast.warnings.extend(found);
}

fn refusal(spec: &BodySpec) -> &'static str {
    match spec.mechanics.integrator {
        RawIntegrator::Static => "a static body must be held in all directions",
        integrator if integrator.is_explicit() => {
            "this explicit integrator needs shorter steps; lower world.step_s, or write integrator = \"implicit-euler\""
        }
        _ => "lower world.step_s, or raise young_pa",
    }
}

fn unconverged(at: &str, spec: &BodySpec, body: &BodyForecast, steps: u64) -> String {
    let what = format!(
        "{at}: {} of {steps} steps end above the tolerance (residual up to {:.1e}, tolerance {:.0e}, {} iterations)",
        body.unconverged_steps, body.largest_residual, body.tolerance, body.iteration_limit
    );
    let next = match (body.needed_iterations, spec.mechanics.method) {
        (Some(needed), _) => {
            let set = two_digits(ROOM * f64::from(needed));
            format!("write solver.iterations = {set}")
        }
        (None, RawMethod::Cholesky | RawMethod::Relaxation) => {
            "raise solver.newton_steps or solver.iterations, shorten world.step_s, or loosen solver.tolerance"
                .into()
        }
        (None, _) => "more iterations alone do not help: loosen solver.tolerance, shorten world.step_s, or \
             write solver.method = \"cholesky\""
            .into(),
    };
    format!("{what}; {next}")
}

/// Rounded up to two digits.
fn two_digits(value: f64) -> u64 {
    let unit = 10f64.powf((value.log10().floor() - 1.0).max(0.0));
    ((value / unit).ceil() * unit) as u64
}

/// A few lines for people.
impl fmt::Display for Forecast {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ending = match self.ending {
            Ending::Rest => "it came to rest",
            Ending::End => "this is the whole run",
            Ending::Budget => "the time for the forecast was used up",
        };
        write!(
            f,
            "forecast from {} steps of the scene, up to {} of {}; {ending}",
            self.steps,
            duration(self.time_s),
            duration(self.end_s)
        )?;
        for body in &self.bodies {
            write!(f, "\n  {}: {}", body.id, motion(body, self.static_only))?;
            write!(f, "\n  {}: {}", body.id, convergence(body, self.steps))?;
        }
        let cost = &self.cost;
        write!(
            f,
            "\n  a step costs {} of processor time: {} while it moves, {} at the end, {} at worst",
            duration(1e-3 * cost.mean_ms),
            duration(1e-3 * cost.moving_ms),
            duration(1e-3 * cost.last_ms),
            duration(1e-3 * cost.largest_ms)
        )
    }
}

fn motion(body: &BodyForecast, is_static: bool) -> String {
    let moves = length(body.largest_displacement_m);
    let when = if is_static { String::new() } else { format!(", after {}", duration(body.largest_at_s)) };
    match body.displacement {
        Source::Steps => format!("moves by {moves} at most{when}"),
        Source::CoarseCopies => format!("moves by about {moves} at most{when}, estimated from coarse copies"),
        Source::AtLeast => format!("moves by more than {moves}; it was still moving"),
    }
}

fn convergence(body: &BodyForecast, steps: u64) -> String {
    if body.converges {
        let inverted = if body.inverted_elements > 0 { ", with inverted elements" } else { "" };
        return format!("every step converges, with {} iterations at most{inverted}", body.most_iterations);
    }
    format!("{} of {steps} steps do not converge", body.unconverged_steps + body.refused_steps)
}

#[cfg(test)]
mod tests {
    use super::two_digits;

    #[test]
    fn suggestions_have_two_digits() {
        assert_eq!(two_digits(7.2), 8);
        assert_eq!(two_digits(416.0), 420);
        assert_eq!(two_digits(1301.0), 1400);
    }
}
