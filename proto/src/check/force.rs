//! Forces of contact: known kinds, finite values, unit normals.

use prost::Name as _;

use super::field::{Checked, In};
use crate::codec::{CountLimit, DecodeError, WireMessage};
use crate::limits::{MAX_FORCE_PAIRS, MAX_FORCE_POINTS, MAX_REPORT_BYTES, NORMAL_TOLERANCE};
use crate::messages::{ForcePair, ForcePoint, Forces, force_pair};

impl WireMessage for Forces {
    const MAX_BYTES: usize = MAX_REPORT_BYTES;
    const MAX_COUNTS: &'static [CountLimit] =
        &[CountLimit { tag: 5, field: "pairs", allowed: MAX_FORCE_PAIRS }];

    fn check(&self) -> Result<(), DecodeError> {
        let at = In(Self::NAME);
        at.finite("sim_time_s", self.sim_time_s)?;
        self.pairs.iter().try_for_each(|found| pair(at, found))
    }
}

fn pair(at: In, pair: &ForcePair) -> Checked {
    at.known::<force_pair::Kind>("pairs.kind", pair.kind)?;
    at.id("pairs.on", &pair.on)?;
    at.id("pairs.by", &pair.by)?;
    at.finite("pairs.deepest_m", pair.deepest_m)?;
    at.vec3("pairs.force_n", at.present("pairs.force_n", &pair.force_n)?, f64::MAX)?;
    at.finite("pairs.normal_n", pair.normal_n)?;
    at.at_most("pairs.points", pair.points.len(), MAX_FORCE_POINTS)?;
    pair.points.iter().try_for_each(|found| point(at, found))
}

fn point(at: In, point: &ForcePoint) -> Checked {
    at.vec3f("pairs.points.point_m", at.present("pairs.points.point_m", &point.point_m)?, f64::MAX)?;
    let normal = at.present("pairs.points.normal", &point.normal)?;
    at.vec3f("pairs.points.normal", normal, f64::MAX)?;
    let norm = [normal.x, normal.y, normal.z].map(|v| f64::from(v) * f64::from(v)).iter().sum::<f64>().sqrt();
    if (norm - 1.0).abs() > NORMAL_TOLERANCE {
        let allowed = format!("norm 1 within {NORMAL_TOLERANCE}");
        return Err(at.range("pairs.points.normal", format!("norm {norm}"), allowed));
    }
    at.finite("pairs.points.depth_m", f64::from(point.depth_m))?;
    at.finite("pairs.points.normal_n", f64::from(point.normal_n))?;
    let tangential = at.present("pairs.points.tangential_n", &point.tangential_n)?;
    at.vec3f("pairs.points.tangential_n", tangential, f64::MAX)
}
