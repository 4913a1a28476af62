//! Surfaces: array lengths agree with counts, positions are finite, triangles refer to existing vertices.

use prost::Name as _;

use super::field::{Checked, In};
use crate::codec::{DecodeError, WireMessage};
use crate::limits::{
    MARK_BYTES, MAX_FIELD_BYTES, MAX_FRAME_BYTES, MAX_KEYFRAME_BYTES, MAX_MARKS, MAX_TOPOLOGY_BYTES,
    MAX_TRIANGLES, MAX_VERTICES, POSITION_BYTES, TAG_BYTES, TEXTURE_BYTES, TRIANGLE_BYTES, VALUE_BYTES,
};
use crate::messages::{SurfaceField, SurfaceFrame, SurfaceKeyframe, SurfaceTopology};

impl WireMessage for SurfaceFrame {
    const MAX_BYTES: usize = MAX_FRAME_BYTES;

    fn check(&self) -> Result<(), DecodeError> {
        let at = In(Self::NAME);
        at.id("body_id", &self.body_id)?;
        at.finite("sim_time_s", self.sim_time_s)?;
        at.at_most("vertex_count", self.vertex_count as usize, MAX_VERTICES as usize)?;
        array_length(at, "positions", self.positions.len(), self.vertex_count, POSITION_BYTES)?;
        at.at_most("mark_count", self.mark_count as usize, MAX_MARKS as usize)?;
        array_length(at, "marks", self.marks.len(), self.mark_count, MARK_BYTES)?;
        for (field, array) in [("positions", &self.positions), ("marks", &self.marks)] {
            if let Some(found) = first_non_finite(array) {
                return at.finite(field, found);
            }
        }
        Ok(())
    }
}

impl WireMessage for SurfaceTopology {
    const MAX_BYTES: usize = MAX_TOPOLOGY_BYTES;

    fn check(&self) -> Result<(), DecodeError> {
        let at = In(Self::NAME);
        at.id("body_id", &self.body_id)?;
        at.finite("sim_time_s", self.sim_time_s)?;
        at.at_most("vertex_count", self.vertex_count as usize, MAX_VERTICES as usize)?;
        let triangles = self.triangle_count;
        at.at_most("triangle_count", triangles as usize, MAX_TRIANGLES as usize)?;
        array_length(at, "triangles", self.triangles.len(), triangles, TRIANGLE_BYTES)?;
        array_length(at, "tags", self.tags.len(), triangles, TAG_BYTES)?;
        if !self.rest_positions.is_empty() {
            array_length(at, "rest_positions", self.rest_positions.len(), self.vertex_count, POSITION_BYTES)?;
        }
        if let Some(found) = first_non_finite(&self.rest_positions) {
            return at.finite("rest_positions", found);
        }
        for (field, bits) in [("held", &self.held), ("hangs", &self.hangs)] {
            if !bits.is_empty() {
                array_length(at, field, bits.len(), self.vertex_count.div_ceil(8), 1)?;
            }
        }
        if !self.texture_coordinates.is_empty() {
            let skin = words(&self.tags).filter(|tag| *tag == [0; 4]).count() as u32;
            array_length(at, "texture_coordinates", self.texture_coordinates.len(), skin, TEXTURE_BYTES)?;
        }
        if let Some(found) = first_non_finite(&self.texture_coordinates) {
            return at.finite("texture_coordinates", found);
        }
        match largest_index(&self.triangles) {
            Some(index) if index >= self.vertex_count => {
                let allowed = format!("below vertex_count = {}", self.vertex_count);
                Err(at.range("triangles", index, allowed))
            }
            _ => Ok(()),
        }
    }
}

impl WireMessage for SurfaceField {
    const MAX_BYTES: usize = MAX_FIELD_BYTES;

    fn check(&self) -> Result<(), DecodeError> {
        let at = In(Self::NAME);
        at.id("body_id", &self.body_id)?;
        at.id("name", &self.name)?;
        at.finite("sim_time_s", self.sim_time_s)?;
        at.at_most("vertex_count", self.vertex_count as usize, MAX_VERTICES as usize)?;
        array_length(at, "values", self.values.len(), self.vertex_count, VALUE_BYTES)?;
        first_non_finite(&self.values).map_or(Ok(()), |found| at.finite("values", found))
    }
}

impl WireMessage for SurfaceKeyframe {
    const MAX_BYTES: usize = MAX_KEYFRAME_BYTES;

    fn check(&self) -> Result<(), DecodeError> {
        let at = In(Self::NAME);
        let topology = at.present("topology", &self.topology)?;
        let frame = at.present("frame", &self.frame)?;
        topology.check()?;
        frame.check()?;
        if topology.body_id != frame.body_id {
            let allowed = format!("topology.body_id = '{}'", topology.body_id);
            return Err(at.range("frame.body_id", &frame.body_id, allowed));
        }
        if topology.epoch != frame.epoch {
            let allowed = format!("topology.epoch = {}", topology.epoch);
            return Err(at.range("frame.epoch", frame.epoch, allowed));
        }
        if topology.vertex_count != frame.vertex_count {
            let allowed = format!("topology.vertex_count = {}", topology.vertex_count);
            return Err(at.range("frame.vertex_count", frame.vertex_count, allowed));
        }
        Ok(())
    }
}

fn array_length(at: In, field: &'static str, bytes: usize, count: u32, size: usize) -> Checked {
    let expected = count as usize * size;
    if bytes == expected {
        return Ok(());
    }
    let allowed = format!("{expected} bytes ({count} x {size})");
    Err(at.range(field, format!("{bytes} bytes"), allowed))
}

fn words(bytes: &[u8]) -> impl Iterator<Item = [u8; 4]> {
    bytes.chunks_exact(4).map(|w| [w[0], w[1], w[2], w[3]])
}

fn first_non_finite(positions: &[u8]) -> Option<f64> {
    words(positions).map(f32::from_le_bytes).find(|v| !v.is_finite()).map(f64::from)
}

fn largest_index(triangles: &[u8]) -> Option<u32> {
    words(triangles).map(u32::from_le_bytes).max()
}
