//! References that are stored, or extrapolated from a plan of runs.

use super::richardson::{Limit, extrapolate};
use super::value::Reference;
use crate::case::{Case, Plan, Truth};
use crate::design::Configuration;
use crate::design::axes::{Factor, Setting};
use crate::trial::Trial;
use crate::trial::series::Series;

/// Takes a stored reference, or computes one with `run`. The reference of a scene uses all the time it is
/// given: see [`Climb`](super::climb::Climb).
///
/// # Errors
/// The reason why none could be computed.
pub fn settle(
    case: &Case,
    run: &mut dyn FnMut(&Configuration) -> Option<Trial>,
) -> Result<Reference, String> {
    match &case.truth {
        Truth::Known { series, goal, error_bar, law, source } => Ok(Reference {
            series: series.clone(),
            goal: *goal,
            error_bar: *error_bar,
            law: law.clone(),
            source: source.clone(),
        }),
        Truth::Extrapolated { law, plans } => {
            let mut why = "nothing to compute it from".to_owned();
            for plan in plans {
                match follow(plan, law, run) {
                    Ok(reference) => return Ok(reference),
                    Err(reason) => why = reason,
                }
            }
            Err(why)
        }
        Truth::Refined { .. } => Err("it is climbed level by level".to_owned()),
    }
}

/// The limit of the mesh at the coarsest step, plus the change by finer steps on the coarsest mesh: u(0,0) ≈
/// u(h→0, Δt₁) + u(h₁, Δt→0) − u(h₁, Δt₁).
fn follow(
    plan: &Plan,
    law: &str,
    run: &mut dyn FnMut(&Configuration) -> Option<Trial>,
) -> Result<Reference, String> {
    let mut solve = |mesh: Option<&Setting>, step: Option<&Setting>| -> Result<Series, String> {
        let mut configuration = plan.configuration.clone();
        for (factor, setting) in [(Factor::Mesh, mesh), (Factor::Step, step)] {
            if let Some(setting) = setting {
                configuration = configuration.with(factor, setting);
            }
        }
        let trial = run(&configuration).ok_or("interrupted")?;
        if trial.is_done() {
            Ok(trial.series)
        } else {
            Err(format!("{}: {}", configuration.words(), trial.reason))
        }
    };
    let (coarsest, first) = (plan.meshes.as_ref().map(|m| &m[0]), plan.steps.as_ref().map(|s| &s[0]));
    let start = solve(coarsest, first)?;
    let in_space = match &plan.meshes {
        None => None,
        Some([_, b, c]) => {
            let (u2, u3) = (solve(Some(b), first)?, solve(Some(c), first)?);
            // The size of a mesh setting is its number of cells along an edge. The element size is the
            // inverse.
            let sizes = plan.meshes.as_ref().map(|m| [1.0 / m[0].size, 1.0 / m[1].size, 1.0 / m[2].size]);
            sizes.and_then(|sizes| extrapolate(sizes, [&start, &u2, &u3]))
        }
    };
    let in_time = match &plan.steps {
        None => None,
        Some([a, b, c]) => {
            let (u2, u3) = (solve(coarsest, Some(b))?, solve(coarsest, Some(c))?);
            extrapolate([a.size, b.size, c.size], [&start, &u2, &u3])
        }
    };
    Ok(together(plan, law, &start, in_space, in_time))
}

fn together(plan: &Plan, law: &str, start: &Series, space: Option<Limit>, time: Option<Limit>) -> Reference {
    let mut series = start.clone();
    let mut bar = 0.0_f64;
    let mut words = vec![format!("Richardson extrapolation ({law}, {})", plan.words)];
    let limits = [(space, &plan.meshes, "meshes"), (time, &plan.steps, "steps")];
    for (limit, sizes, what) in limits {
        let Some((limit, sizes)) = limit.zip(sizes.as_ref()) else { continue };
        series = series.combine(1.0, &limit.value.minus(start), 1.0);
        bar = bar.hypot(limit.error_bar);
        let order = if limit.plausible {
            format!("observed order {:.2}", limit.order)
        } else {
            "no order observed, first order assumed".to_owned()
        };
        let labels = sizes.iter().map(|s| s.label.as_str()).collect::<Vec<_>>().join(", ");
        words.push(format!("{what} {labels}: {order}, ± {:.2} %", 100.0 * limit.error_bar));
    }
    if words.len() == 1 {
        words = vec![
            "The scene’s own mesh, solved to a tight tolerance; the error of the mesh is not part of this study"
                .to_owned(),
        ];
    }
    Reference { series, goal: None, error_bar: bar, law: law.to_owned(), source: words.join("; ") }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::design::axes::{block, step};
    use crate::trial::{Cost, Status};

    /// u = 2 + 3/n² + 4 Δt, at every frame.
    fn model(configuration: &Configuration) -> Trial {
        let n = configuration.setting(Factor::Mesh).unwrap().size;
        let h = configuration.setting(Factor::Step).unwrap().size;
        let u = 2.0 + 3.0 / (n * n) + 4.0 * h;
        let series = Series { frames: vec![1, 2], displacement_m: vec![u, 2.0 * u], energy_j: vec![u, u] };
        let cost = Cost::default();
        Trial { series, cost, ..Trial { status: Status::Done, ..Trial::refused(String::new()) } }
    }

    fn plan() -> Plan {
        Plan {
            configuration: Configuration { choices: Vec::new() },
            meshes: Some([4, 6, 8].map(|n| block("b", [n, 1, 1]))),
            steps: Some([0.04, 0.02, 0.01].map(step)),
            words: "test".into(),
        }
    }

    #[test]
    fn space_and_time_are_extrapolated_together() {
        let mut runs = 0;
        let reference = follow(&plan(), "linear", &mut |c| {
            runs += 1;
            Some(model(c))
        })
        .unwrap();
        assert_eq!(runs, 5);
        assert!((reference.series.displacement_m[0] - 2.0).abs() < 1e-9);
        assert!((reference.series.displacement_m[1] - 4.0).abs() < 1e-9);
        assert!(reference.error_bar > 0.0 && reference.source.contains("order 2.00"));
    }

    #[test]
    fn a_failing_run_says_why() {
        let error = follow(&plan(), "linear", &mut |_| Some(Trial::refused("no bdf2".into()))).unwrap_err();
        assert!(error.contains("no bdf2"));
    }
}
