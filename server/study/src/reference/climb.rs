//! A reference that uses the time it is given: mesh and step are refined together, level by level.
//!
//! On level i the mesh is f_i times finer than the scene's. The frame is divided into n_i steps with n_i ∝
//! f_i, so that all errors vanish along the ladder, including the mixed ones. Pilot runs on the coarsest mesh
//! choose n_0 so that mesh and step leave errors of similar size. The pilots continue to much shorter steps
//! than those chosen. The reason is that steps which damp a vibration away agree with each other, but not
//! with the scene. The error that the step leaves at the finest level is added to the error bar. Finished
//! levels are never thrown away: the reference is the [`limit`](super::limit) of all of them.

use super::limit::{Limit, UNKNOWN, limit};
use super::value::Reference;
use crate::bench::runner::{Ask, PATIENCE, Runner, fits};
use crate::case::Ladder;
use crate::design::Configuration;
use crate::design::axes::step;
use crate::trial::Trial;
use crate::trial::series::Series;
use crate::trial::sight::{SAME, Sight, largest_change};
use crate::words::percent;

/// Most steps per frame on the coarsest mesh.
const MOST_STEPS: u32 = 16;

/// A reference with this relative error bar is good enough.
const ENOUGH: f64 = 2e-3;

/// A finished level.
#[derive(Debug, Clone)]
struct Rung {
    size: f64,
    words: String,
    series: Series,
    seen: Vec<Sight>,
}

/// A ladder that is being climbed.
#[derive(Debug)]
pub struct Climb<'a> {
    ladder: &'a Ladder,
    law: &'a str,
    /// Steps per frame on the coarsest mesh.
    n0: u32,
    /// Error that n_0 steps per frame leave on the coarsest mesh, in the norm of [`Series`].
    by_step: f64,
    rungs: Vec<Rung>,
    /// Reason why no further level can follow.
    over: Option<String>,
}

impl<'a> Climb<'a> {
    /// Makes the pilot runs and the first level, and reserves `keep_s` of the study's time. `None` if the
    /// study must end before there is a level.
    ///
    /// # Errors
    /// The reason why the first run gave no result.
    pub fn start(
        ladder: &'a Ladder,
        law: &'a str,
        runner: &mut dyn Runner,
        keep_s: f64,
    ) -> Result<Option<Self>, String> {
        let cap_s = runner.left_s() - keep_s;
        let Some(first) = runner.run(&ladder.at(0, 1), Ask { timed: false, cap_s }) else { return Ok(None) };
        if !usable(&first) {
            return Err(format!("{}: {}", ladder.words, first.reason));
        }
        let mut climb = Self { ladder, law, n0: 1, by_step: 0.0, rungs: Vec::new(), over: None };
        climb.choose_steps(&first.series, runner, keep_s);
        climb.push(0, first);
        if climb.n0 > 1 {
            // The pilots have already run the first level with its n0 steps. This finds that run again.
            climb.rungs.clear();
            climb.up(runner, keep_s);
        }
        Ok(Some(climb))
    }

    /// Chooses the fewest steps per frame whose error is no larger than that of the mesh. The error is
    /// measured against the shortest steps that the time allows.
    fn choose_steps(&mut self, first: &Series, runner: &mut dyn Runner, keep_s: f64) {
        if self.ladder.step_s.is_none() || self.ladder.meshes.len() < 2 {
            return;
        }
        let Some(finer) = self.pilot(1, 1, runner, keep_s) else { return };
        let by_mesh = finer.minus(first).norm();
        let mut pilots = vec![first.clone()];
        while 1 << pilots.len() <= MOST_STEPS
            && let Some(next) = self.pilot(0, 1 << pilots.len(), runner, keep_s)
        {
            pilots.push(next);
        }
        (self.n0, self.by_step) = fewest_steps(&pilots, by_mesh);
    }

    /// A pilot run, if it takes no more than a tenth of the available time.
    fn pilot(&self, mesh: usize, n: u32, runner: &mut dyn Runner, keep_s: f64) -> Option<Series> {
        let configuration = self.ladder.at(mesh, n);
        let allowed_s = 0.1 * (runner.left_s() - keep_s);
        if runner.forecast_s(&configuration, false) > allowed_s {
            return None;
        }
        let trial = runner.run(&configuration, Ask { timed: false, cap_s: 2.0 * allowed_s })?;
        usable(&trial).then_some(trial.series)
    }

    /// Adds levels while they fit into the time less `keep_s` and the error bar is too large.
    pub fn climb(&mut self, runner: &mut dyn Runner, keep_s: f64) {
        while self.over.is_none() && self.bar() > ENOUGH {
            let Some(next) = self.next() else { break };
            if !fits(runner, &next, false, keep_s) || !self.up(runner, keep_s) {
                break;
            }
        }
    }

    /// The configuration of the next level, if there is one.
    pub fn next(&self) -> Option<Configuration> {
        let i = self.rungs.len();
        (i < self.ladder.levels()).then(|| {
            let (mesh, n) = self.ladder.level(i, self.n0);
            self.ladder.at(mesh, n)
        })
    }

    /// Adds one level; false if there is none.
    fn up(&mut self, runner: &mut dyn Runner, keep_s: f64) -> bool {
        let Some(next) = self.next() else { return false };
        let room_s = (runner.left_s() - 0.5 * keep_s).max(0.1);
        let forecast_s = runner.forecast_s(&next, false);
        let cap_s = if forecast_s > 0.0 { room_s.min((PATIENCE * forecast_s).max(1.0)) } else { room_s };
        let Some(trial) = runner.run(&next, Ask { timed: false, cap_s }) else {
            self.over = Some("interrupted".to_owned());
            return false;
        };
        if usable(&trial) {
            self.push(self.rungs.len(), trial);
            return true;
        }
        self.over = Some(format!("{}: {}", next.words(), trial.reason));
        false
    }

    fn push(&mut self, i: usize, trial: Trial) {
        let (mesh, n) = self.ladder.level(i, self.n0);
        let mut words = Vec::new();
        words.extend(self.ladder.meshes.get(mesh).map(|setting| setting.label.clone()));
        words.extend(self.ladder.step_s.map(|frame_s| step(frame_s / f64::from(n)).label));
        self.rungs.push(Rung {
            size: self.ladder.size(i, self.n0),
            words: words.join(" at "),
            series: trial.series,
            seen: trial.seen,
        });
    }

    /// Regions of the finest level.
    pub fn seen(&self) -> &[Sight] {
        self.rungs.last().map_or(&[], |rung| &rung.seen)
    }

    /// Largest change of the regions over the last levels.
    fn wander(&self) -> f64 {
        let last = &self.rungs[self.rungs.len().saturating_sub(3)..];
        let pairs = last.windows(2).filter_map(|pair| Some(largest_change(&pair[0].seen, &pair[1].seen)?.2));
        pairs.fold(0.0, f64::max)
    }

    fn limit(&self) -> Option<Limit> {
        let levels: Vec<(f64, &Series)> = self.rungs.iter().map(|rung| (rung.size, &rung.series)).collect();
        limit(&levels, self.wander() <= SAME)
    }

    /// Present relative error bar.
    pub fn bar(&self) -> f64 {
        self.limit().map_or(UNKNOWN, |limit| self.with_step(&limit))
    }

    /// The error bar of a limit plus the error that the step leaves at the finest level. That error is
    /// assumed to be of first order, the worst case.
    fn with_step(&self, limit: &Limit) -> f64 {
        let finest = self.ladder.level(self.rungs.len().saturating_sub(1), self.n0).1;
        limit.error_bar + self.by_step * f64::from(self.n0) / f64::from(finest) / limit.value.norm()
    }

    /// The reference from the finished levels.
    ///
    /// # Errors
    /// Nothing moves.
    pub fn reference(&self) -> Result<Reference, String> {
        let Some(limit) = self.limit() else {
            return Err("no probe moves in this scene, so there is no error to measure; give it a load, a \
                        cut, a tool or gravity, or a probe where it moves"
                .to_owned());
        };
        let levels: Vec<&str> = self.rungs.iter().map(|rung| rung.words.as_str()).collect();
        let mut words = format!("{}; levels {}", self.ladder.words, levels.join(", "));
        words += &match (self.rungs.len(), limit.order) {
            (1, _) => ". Only this run ended, so its own error is not known".to_owned(),
            (_, Some(order)) => format!(". Extrapolated with the observed order {order:.1}"),
            (_, None) => {
                ". There is no plausible order, so this is the finest level with the spread of the levels as its \
                error bar".to_owned()
            }
        };
        if self.wander() > SAME {
            words += &format!(
                ". The regions that are held or loaded change by up to {} from level to level",
                percent(self.wander())
            );
        }
        if self.ladder.meshes.len() < 2 {
            words += ". The mesh cannot be refined, so its error is not part of this study";
        }
        if let Some(why) = self.over.as_ref().filter(|why| *why != "interrupted") {
            words += &format!(". The next level gave no result ({why})");
        }
        Ok(Reference {
            error_bar: self.with_step(&limit),
            series: limit.value,
            goal: None,
            law: self.law.to_owned(),
            source: words,
        })
    }
}

/// Among runs with 1, 2, 4, … steps per frame, the fewest whose error is at most half of `by_mesh`, and that
/// error. The error is the distance to the last run. The last run's own error is taken as its distance to the
/// run before it.
fn fewest_steps(pilots: &[Series], by_mesh: f64) -> (u32, f64) {
    let [.., before, last] = pilots else { return (1, 0.0) };
    let own = last.minus(before).norm();
    let error = |run: &Series| last.minus(run).norm().max(own);
    let enough = pilots.iter().position(|run| error(run) <= 0.5 * by_mesh).unwrap_or(pilots.len() - 1);
    (1 << enough, error(&pilots[enough]))
}

/// Whether a run may be part of a reference: it ended, and its solver converged.
fn usable(trial: &Trial) -> bool {
    trial.is_done() && trial.reason.is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Amplitude that implicit Euler leaves of a vibration with n steps per frame; 1 without damping.
    fn damped(n: u32) -> Series {
        let u = 0.2 + 0.8 * (-12.0 / f64::from(n)).exp();
        Series { frames: vec![0], displacement_m: vec![u, 0.0, 0.0], energy_j: vec![u] }
    }

    #[test]
    fn steps_that_damp_a_vibration_away_are_not_enough_because_they_agree() {
        let pilots = [1, 2, 4, 8, 16].map(damped);
        assert!(pilots[1].minus(&pilots[0]).norm() < 0.01, "the longest steps agree");
        let (n0, error) = fewest_steps(&pilots, 0.1);
        assert_eq!(n0, 16);
        assert!((error - pilots[4].minus(&pilots[3]).norm()).abs() < 1e-12);
        assert_eq!(fewest_steps(&pilots, 10.0).0, 1);
        assert_eq!(fewest_steps(&pilots[..1], 0.1), (1, 0.0));
    }
}
