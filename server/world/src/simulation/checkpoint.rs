//! Checkpoints: the complete state of a simulation as bytes, from which it goes on bit for bit.
//!
//! # What is in it
//! Everything that a later step reads: topology and its cuts, positions, velocities, history of the integrator,
//! rotations, factors and warm starts of the solvers, arrangements of surfaces, contacts with what they remember,
//! tools, cuts that wait, what can be undone, what sleeps, and the values that were changed while it ran. Measured
//! times and the messages of the last step are not.
//!
//! # Format
//! A header, then the state as [postcard] writes it, in the order of the fields of its types. That order is no
//! promise between versions: a checkpoint is read by the build that wrote it. A recording holds the inputs as well,
//! from which any build computes the state again.
//!
//! [postcard]: https://postcard.jamesmunns.com/wire-format

use serde::{Deserialize, Serialize};
use thiserror::Error;
use xxhash_rust::xxh3::{Xxh3, xxh3_128};

use super::cuts::Cuts;
use super::deform::Groups;
use super::dormant::Dormant;
use super::governor::Governor;
use super::sleep::Sleep;
use super::{Simulation, settle};
use crate::body::{BodySize, Probe, SimBody};
use crate::contact::Contacts;
use crate::report::BodyReport;
use crate::scene::Scene;
use crate::simulation::Plan;
use crate::tool::Tools;

/// First bytes of a checkpoint.
const MAGIC: [u8; 8] = *b"scindoCP";
/// Version of the header.
const FORMAT: u32 = 1;
/// The build whose types the state follows.
const BUILD: &str = concat!(env!("CARGO_PKG_VERSION"), "+", env!("SCINDO_STATE"));
/// Bytes of a hash of a state.
const HASH: usize = 16;
/// Vectors that are hashed at once.
const HASHED: usize = 64;
/// Longest name of a build.
const MOST_NAME: usize = 255;

/// Why a checkpoint was not written or read. The simulation is as it was.
#[derive(Debug, Error)]
pub enum CheckpointError {
    /// Not a checkpoint.
    #[error("these {bytes} bytes are no checkpoint: {why}; give one that scindo has written")]
    Foreign {
        /// Length.
        bytes: usize,
        /// What is missing.
        why: &'static str,
    },
    /// Written by another build.
    #[error(
        "the checkpoint was written by scindo {found}, and this is {BUILD}; read it with that build, or replay the \
         recording from its start"
    )]
    Build {
        /// The build that wrote it.
        found: String,
    },
    /// Bytes were changed or lost.
    #[error(
        "the checkpoint is damaged: its {bytes} bytes do not have the hash that it names; take another one"
    )]
    Damaged {
        /// Length of the state.
        bytes: usize,
    },
    /// The bytes do not make a state.
    #[error("the state of the checkpoint cannot be read: {0}")]
    State(#[from] postcard::Error),
    /// The scene that it belongs to is not valid here.
    #[error("the scene of the checkpoint: {0}")]
    Scene(String),
    /// It belongs to another scene.
    #[error(
        "the checkpoint is of the bodies {found:?}, and this scene has {expected:?}; start that scene first"
    )]
    Bodies {
        /// Names in the checkpoint.
        found: Vec<String>,
        /// Names in the scene.
        expected: Vec<String>,
    },
    /// The state that was read is not the one that was written.
    #[error(
        "the state at step {step} has the hash {found:032x} after reading, and had {expected:032x} before"
    )]
    Hash {
        /// Step of the checkpoint.
        step: u64,
        /// Hash after reading.
        found: u128,
        /// Hash before writing.
        expected: u128,
    },
}

/// The state as it is written.
#[derive(Serialize)]
struct Written<'a> {
    scene: String,
    hash: u128,
    bodies: &'a [SimBody],
    tools: &'a Tools,
    cuts: &'a Cuts,
    contacts: &'a Contacts,
    groups: &'a Groups,
    sleep: &'a Sleep,
    dormant: &'a Dormant,
    governor: &'a Governor,
    probes: &'a [Probe],
    reports: &'a [BodyReport],
    steps: u64,
}

/// The same as it is read.
#[derive(Deserialize)]
struct Read {
    scene: String,
    hash: u128,
    bodies: Vec<SimBody>,
    tools: Tools,
    cuts: Cuts,
    contacts: Contacts,
    groups: Groups,
    sleep: Sleep,
    dormant: Dormant,
    governor: Governor,
    probes: Vec<Probe>,
    reports: Vec<BodyReport>,
    steps: u64,
}

impl Simulation {
    /// Hash (XXH3, 128 bits) of the number of the step and of positions and velocities of all bodies: two
    /// simulations with the same hash have the same state, bit for bit.
    pub fn state_hash(&self) -> u128 {
        let mut hash = Xxh3::new();
        hash.update(&self.steps.to_le_bytes());
        for body in &self.bodies {
            let (x, v) = (body.body.positions(), body.body.velocities());
            hash.update(&(x.len() as u64).to_le_bytes());
            for vectors in [x, v] {
                for some in vectors.chunks(HASHED) {
                    let mut bytes = [[[0; 8]; 3]; HASHED];
                    for (to, from) in bytes.iter_mut().zip(some) {
                        *to = [from.x, from.y, from.z].map(f64::to_le_bytes);
                    }
                    hash.update(bytes[..some.len()].as_flattened().as_flattened());
                }
            }
        }
        hash.digest128()
    }

    /// The complete state between two steps.
    ///
    /// # Errors
    /// A part that cannot be written.
    pub fn checkpoint(&self) -> Result<Vec<u8>, CheckpointError> {
        let Self { bodies, tools, cuts, contacts, groups, sleep, dormant, governor, probes, .. } = self;
        let written = Written {
            scene: self.source.to_json().to_string(),
            hash: self.state_hash(),
            bodies,
            tools,
            cuts,
            contacts,
            groups,
            sleep,
            dormant,
            governor,
            probes,
            reports: &self.report.bodies,
            steps: self.steps,
        };
        let mut bytes = Vec::new();
        bytes.extend_from_slice(&MAGIC);
        bytes.extend_from_slice(&FORMAT.to_le_bytes());
        bytes.push(BUILD.len().min(MOST_NAME) as u8);
        bytes.extend_from_slice(&BUILD.as_bytes()[..BUILD.len().min(MOST_NAME)]);
        let at = bytes.len();
        bytes.extend_from_slice(&[0; HASH]);
        let mut bytes = postcard::to_extend(&written, bytes)?;
        let hash = xxh3_128(&bytes[at + HASH..]);
        bytes[at..at + HASH].copy_from_slice(&hash.to_le_bytes());
        Ok(bytes)
    }

    /// Goes on from a checkpoint of the same scene, whatever happened since; threads and stop flag stay.
    ///
    /// # Errors
    /// Bytes that are not what this build wrote for this scene. The simulation is as it was then.
    pub fn restore(&mut self, checkpoint: &[u8]) -> Result<(), CheckpointError> {
        let mut read: Read = postcard::from_bytes(state_of(checkpoint)?)?;
        let names = |bodies: &[SimBody]| bodies.iter().map(|body| body.id.to_string()).collect::<Vec<_>>();
        let (found, expected) = (names(&read.bodies), names(&self.bodies));
        if found != expected || read.probes.len() != self.probes.len() {
            return Err(CheckpointError::Bodies { found, expected });
        }
        let source = Scene::from_json_in(&read.scene, self.source.file(), self.source.base_dir())
            .map_err(|error| CheckpointError::Scene(error.to_string()))?;
        let mut other = std::mem::take(&mut read.bodies);
        std::mem::swap(&mut self.bodies, &mut other);
        let steps = std::mem::replace(&mut self.steps, read.steps);
        let hash = self.state_hash();
        if hash != read.hash {
            (self.bodies, self.steps) = (other, steps);
            return Err(CheckpointError::Hash { step: read.steps, found: hash, expected: read.hash });
        }
        for (body, other) in self.bodies.iter_mut().zip(&mut other) {
            body.body.take_team_of(&mut other.body);
            body.health = other.health.take();
            body.texture = other.texture.take();
            body.follow_epoch_of(other);
        }
        let Read { tools, cuts, mut contacts, groups, sleep, dormant, governor, probes, reports, .. } = read;
        contacts.take_obstacles_of(&mut self.contacts);
        self.scene = source.checked().clone();
        settle(&mut self.scene, &self.bodies);
        self.source = source;
        let sizes: Vec<BodySize> = self.bodies.iter().map(SimBody::size).collect();
        self.plan = Plan::new(&self.scene, &sizes);
        (self.tools, self.cuts, self.contacts, self.groups) = (tools, cuts, contacts, groups);
        (self.sleep, self.dormant, self.governor, self.probes) = (sleep, dormant, governor, probes);
        self.report.begin(self.steps, self.time_s());
        self.report.bodies = reports;
        Ok(())
    }
}

/// The state within the bytes of a checkpoint, once header and hash were checked.
fn state_of(checkpoint: &[u8]) -> Result<&[u8], CheckpointError> {
    let foreign = |why| CheckpointError::Foreign { bytes: checkpoint.len(), why };
    let rest = checkpoint.strip_prefix(&MAGIC).ok_or(foreign("they do not begin with `scindoCP`"))?;
    let ended = || foreign("they end within the header");
    let (format, rest) = rest.split_first_chunk::<4>().ok_or_else(ended)?;
    let (name, rest) = rest.split_first().ok_or_else(ended)?;
    let (name, rest) = rest.split_at_checked(usize::from(*name)).ok_or_else(ended)?;
    if u32::from_le_bytes(*format) != FORMAT || name != BUILD.as_bytes() {
        let found = String::from_utf8_lossy(name).chars().filter(|c| !c.is_control()).collect();
        return Err(CheckpointError::Build { found });
    }
    let (hash, state) = rest.split_first_chunk::<HASH>().ok_or_else(ended)?;
    if xxh3_128(state) != u128::from_le_bytes(*hash) {
        return Err(CheckpointError::Damaged { bytes: state.len() });
    }
    Ok(state)
}
