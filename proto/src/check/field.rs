//! Checks of single fields.

use crate::codec::DecodeError;
use crate::key::is_chunk;
use crate::limits::{
    MAX_COORDINATE_M, MAX_FRICTION, MAX_GRIP_N, MAX_ID_BYTES, MAX_TEXT_BYTES, MAX_TOOL_M,
    QUATERNION_TOLERANCE,
};
use crate::messages::{Error, Pose, ToolShape, Vec3, Vec3f, tool_shape::Kind};
use crate::name::{NAMES, check_name};

/// Name of the message under check, which every error states.
#[derive(Clone, Copy)]
pub(super) struct In(pub &'static str);

pub(super) type Checked = Result<(), DecodeError>;

impl In {
    pub(super) fn range(
        self,
        field: &'static str,
        found: impl ToString,
        allowed: impl ToString,
    ) -> DecodeError {
        DecodeError::OutOfRange {
            message: self.0,
            field,
            found: found.to_string(),
            allowed: allowed.to_string(),
        }
    }

    pub(super) fn present<'a, T>(
        self,
        field: &'static str,
        value: &'a Option<T>,
    ) -> Result<&'a T, DecodeError> {
        value.as_ref().ok_or(DecodeError::Missing { message: self.0, field })
    }

    pub(super) fn id(self, field: &'static str, id: &str) -> Checked {
        if is_chunk(id) {
            return Ok(());
        }
        let found: String = id.chars().take(MAX_ID_BYTES).collect();
        let allowed = format!("1 to {MAX_ID_BYTES} characters of a-z, 0-9, _ and -");
        Err(self.range(field, format!("'{found}'"), allowed))
    }

    /// An id that may be left empty.
    pub(super) fn optional_id(self, field: &'static str, id: &str) -> Checked {
        if id.is_empty() {
            return Ok(());
        }
        self.id(field, id)
    }

    /// Name of a person, or none: one line that others may read.
    pub(super) fn name(self, field: &'static str, name: &str) -> Checked {
        check_name(name).map_err(|found| self.range(field, format!("'{found}'"), NAMES))
    }

    pub(super) fn text(self, field: &'static str, text: &str) -> Checked {
        self.at_most(field, text.len(), MAX_TEXT_BYTES)
    }

    pub(super) fn at_most(self, field: &'static str, found: usize, allowed: usize) -> Checked {
        if found <= allowed {
            return Ok(());
        }
        Err(DecodeError::TooLarge { message: self.0, field, found, allowed })
    }

    pub(super) fn finite(self, field: &'static str, value: f64) -> Checked {
        if value.is_finite() {
            return Ok(());
        }
        Err(DecodeError::NonFinite { message: self.0, field, found: value })
    }

    /// Finite and at most `bound` in magnitude.
    pub(super) fn within(self, field: &'static str, value: f64, bound: f64) -> Checked {
        self.finite(field, value)?;
        if value.abs() <= bound {
            return Ok(());
        }
        Err(self.range(field, value, format!("magnitude up to {bound}")))
    }

    /// Finite, not negative, at most `bound`.
    pub(super) fn positive(self, field: &'static str, value: f64, bound: f64) -> Checked {
        self.finite(field, value)?;
        if (0.0..=bound).contains(&value) {
            return Ok(());
        }
        Err(self.range(field, value, format!("0 to {bound}")))
    }

    pub(super) fn vec3(self, field: &'static str, v: &Vec3, bound: f64) -> Checked {
        [v.x, v.y, v.z].into_iter().try_for_each(|c| self.within(field, c, bound))
    }

    pub(super) fn optional_vec3(self, field: &'static str, v: &Option<Vec3>, bound: f64) -> Checked {
        v.as_ref().map_or(Ok(()), |v| self.vec3(field, v, bound))
    }

    pub(super) fn vec3f(self, field: &'static str, v: &Vec3f, bound: f64) -> Checked {
        [v.x, v.y, v.z].into_iter().try_for_each(|c| self.within(field, f64::from(c), bound))
    }

    pub(super) fn pose(self, pose: &Pose) -> Checked {
        let position = self.present("pose.position_m", &pose.position_m)?;
        self.vec3("pose.position_m", position, MAX_COORDINATE_M)?;
        let q = [pose.qx, pose.qy, pose.qz, pose.qw];
        q.into_iter().try_for_each(|c| self.finite("pose.orientation", c))?;
        let norm = q.into_iter().map(|c| c * c).sum::<f64>().sqrt();
        if (norm - 1.0).abs() <= QUATERNION_TOLERANCE {
            return Ok(());
        }
        let allowed = format!("norm 1 within {QUATERNION_TOLERANCE}");
        Err(self.range("pose.orientation", format!("norm {norm}"), allowed))
    }

    pub(super) fn shape(self, shape: &ToolShape) -> Checked {
        let size = |field, value: f64| {
            self.finite(field, value)?;
            if value > 0.0 && value <= MAX_TOOL_M {
                return Ok(());
            }
            Err(self.range(field, value, format!("above 0, up to {MAX_TOOL_M}")))
        };
        match self.present("shape.kind", &shape.kind)? {
            Kind::Sphere(s) => size("shape.sphere.radius_m", s.radius_m),
            Kind::Capsule(c) => {
                size("shape.capsule.radius_m", c.radius_m)?;
                size("shape.capsule.length_m", c.length_m)
            }
            Kind::Blade(b) => {
                size("shape.blade.length_m", b.length_m)?;
                self.positive("shape.blade.thickness_m", b.thickness_m, MAX_TOOL_M)
            }
            Kind::Forceps(f) => {
                size("shape.forceps.radius_m", f.radius_m)?;
                size("shape.forceps.length_m", f.length_m)?;
                size("shape.forceps.opening_m", f.opening_m)?;
                self.positive("shape.forceps.grip_force_n", f.grip_force_n, MAX_GRIP_N)?;
                self.positive("shape.forceps.friction", f.friction, MAX_FRICTION)
            }
            Kind::Retractor(r) => {
                size("shape.retractor.radius_m", r.radius_m)?;
                size("shape.retractor.length_m", r.length_m)?;
                size("shape.retractor.width_m", r.width_m)?;
                size("shape.retractor.height_m", r.height_m)
            }
            Kind::Hook(h) => {
                size("shape.hook.radius_m", h.radius_m)?;
                size("shape.hook.length_m", h.length_m)?;
                size("shape.hook.reach_m", h.reach_m)?;
                size("shape.hook.point_m", h.point_m)
            }
        }
    }

    pub(super) fn error(self, error: &Option<Error>) -> Checked {
        let Some(error) = error else { return Ok(()) };
        self.text("error.code", &error.code)?;
        self.text("error.message", &error.message)?;
        self.text("error.hint", &error.hint)
    }

    /// A value of a protobuf enum that this version knows.
    pub(super) fn known<T: TryFrom<i32>>(self, field: &'static str, value: i32) -> Checked {
        match T::try_from(value) {
            Ok(_) => Ok(()),
            Err(_) => Err(self.range(field, value, "a value of scindo.v1")),
        }
    }
}
