//! Results of a run, as the terminal and `--json` show them.

use serde::Serialize;

use crate::statistics::{LinkReport, LoopReport};

/// All figures of a run.
#[derive(Debug, Serialize)]
pub struct Summary {
    /// Id of the tool that was held.
    pub tool: String,
    /// Name of the device model.
    pub device: &'static str,
    /// Clamp in force [N].
    pub force_limit_n: f64,
    /// Slew limit in force [N/s].
    pub slew_limit_n_s: f64,
    /// Figures of the loop.
    #[serde(rename = "loop")]
    pub loop_: LoopReport,
    /// Figures of the link.
    pub link: LinkReport,
    /// Number of rows in the log file; `None` without a log.
    pub log_rows: Option<u64>,
}

impl std::fmt::Display for Summary {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (l, n) = (&self.loop_, &self.link);
        writeln!(f, "tool {} on device {}, {:.1} s", self.tool, self.device, l.seconds)?;
        writeln!(
            f,
            "loop      {:7.1} Hz   late p50 {:.3} ms, p99 {:.3} ms, max {:.1} ms   missed {} of {}",
            l.rate_hz,
            l.lateness_ms.p50,
            l.lateness_ms.p99,
            l.lateness_ms.max,
            l.missed_ticks,
            l.ticks + l.missed_ticks
        )?;
        writeln!(
            f,
            "contact   {:7.1} Hz   lost {}, late {}, refused {}, longest gap {:.0} ms",
            n.contact_rate_hz, n.contacts_lost, n.contacts_late, n.contacts_refused, n.longest_contact_gap_ms
        )?;
        writeln!(
            f,
            "pose to contact      p50 {:.2} ms, p99 {:.2} ms, max {:.0} ms   ({} poses sent, {} withheld)",
            n.round_trip_ms.p50, n.round_trip_ms.p99, n.round_trip_ms.max, n.poses_sent, l.poses_withheld
        )?;
        writeln!(
            f,
            "pose behind the felt model   age p50 {:.2} ms, p99 {:.2} ms, max {:.0} ms",
            l.model_age_ms.p50, l.model_age_ms.p99, l.model_age_ms.max
        )?;
        write!(
            f,
            "force     max {:.2} N (limit {} N), largest step {:.4} N = {:.1} N/s (limit {} N/s), touched {:.1} s, device faults {}",
            l.max_force_n,
            self.force_limit_n,
            l.max_force_step_n,
            l.max_slew_n_s,
            self.slew_limit_n_s,
            l.touch_ticks as f64 * 1e-3,
            l.device_faults
        )
    }
}
