//! A recording as a stream of messages, in the order in which they were written. A file without an end, as a
//! killed server leaves it, is read as far as it goes.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use prost::Message;
use scindo_proto::messages::{
    RecordedCheckpoint, RecordedEvent, RecordedForces, RecordedOrder, RecordedScene, RecordedStep,
};

use super::writer::TOPICS;
use crate::error::RuntimeError;

/// Most bytes that are read at a time.
const READ: usize = 1 << 20;

/// Longest record of a file [byte]: a checkpoint of the largest scenes.
const LONGEST: usize = 4 << 30;

/// A message of a recording.
#[derive(Debug)]
pub enum Recorded {
    /// What was simulated.
    Scene(RecordedScene),
    /// A step.
    Step(RecordedStep),
    /// What changed the simulation between two steps.
    Order(RecordedOrder),
    /// A complete state.
    Checkpoint(RecordedCheckpoint),
    /// Something worth telling.
    Event(RecordedEvent),
    /// Tools and their forces.
    Forces(RecordedForces),
}

/// Reads a recording from its beginning.
pub struct Recording {
    file: BufReader<File>,
    path: String,
    reader: LinearReader,
    /// Topic of every channel, as number in [`TOPICS`].
    channels: HashMap<u16, usize>,
    /// Why the file ends before its end, once it did.
    truncated: Option<String>,
    ended: bool,
}

impl Recording {
    /// Opens a file.
    ///
    /// # Errors
    /// The file cannot be read, or does not begin like an MCAP file.
    pub fn open(path: &Path) -> Result<Self, RuntimeError> {
        let name = path.display().to_string();
        let failed = |reason: String| RuntimeError::NoRecording { file: name.clone(), reason };
        let file = File::open(path).map_err(|e| failed(e.to_string()))?;
        let options = LinearReaderOptions::default()
            .with_skip_end_magic(false)
            .with_validate_chunk_crcs(true)
            .with_record_length_limit(LONGEST);
        Ok(Self {
            file: BufReader::with_capacity(READ, file),
            path: name,
            reader: LinearReader::new_with_options(options),
            channels: HashMap::new(),
            truncated: None,
            ended: false,
        })
    }

    /// The scene, which is the first message.
    ///
    /// # Errors
    /// There is none, so this is no recording of scindo.
    pub fn scene(&mut self) -> Result<RecordedScene, RuntimeError> {
        match self.next_message()? {
            Some(Recorded::Scene(scene)) => Ok(scene),
            _ => {
                let why = self.truncated.clone();
                Err(self.foreign(why.unwrap_or_else(|| "its first message is no record/scene".to_owned())))
            }
        }
    }

    /// The next message; `None` at the end.
    ///
    /// # Errors
    /// A message that cannot be decoded.
    pub fn next_message(&mut self) -> Result<Option<Recorded>, RuntimeError> {
        while !self.ended {
            let Some(event) = self.reader.next_event() else {
                self.ended = true;
                break;
            };
            match event {
                // Memory grows with what the file has, not with what a broken length claims.
                Ok(LinearReadEvent::ReadRequest(n)) => {
                    match self.file.read(self.reader.insert(n.min(READ))) {
                        Ok(read) => {
                            self.reader.notify_read(read);
                            if read == 0 {
                                self.end_early("it ends in the middle, as that of a server that was killed");
                            }
                        }
                        Err(error) => return Err(self.foreign(error.to_string())),
                    }
                }
                Ok(LinearReadEvent::Record { data, opcode }) => {
                    let record = match mcap::parse_record(opcode, data) {
                        Ok(record) => record,
                        Err(error) => {
                            let words = error.to_string();
                            self.end_early(&words);
                            break;
                        }
                    };
                    match record {
                        Record::Channel(channel) => {
                            let known = TOPICS.iter().position(|(topic, _)| *topic == channel.topic);
                            if let Some(topic) = known {
                                self.channels.insert(channel.id, topic);
                            }
                        }
                        Record::Message { header, data } => {
                            let Some(&topic) = self.channels.get(&header.channel_id) else { continue };
                            match decode(topic, &data) {
                                Ok(None) => {}
                                Ok(Some(message)) => return Ok(Some(message)),
                                Err(error) => {
                                    let reason = format!("a message on {}: {error}", TOPICS[topic].0);
                                    return Err(self.foreign(reason));
                                }
                            }
                        }
                        Record::Footer(_) => self.ended = true,
                        _ => {}
                    }
                }
                Err(error) => {
                    let words = error.to_string();
                    self.end_early(&words);
                }
            }
        }
        Ok(None)
    }

    /// Why the file ended before its end; `None` for a complete file, or before the last message was read.
    pub fn truncated(&self) -> Option<&str> {
        self.truncated.as_deref()
    }

    fn end_early(&mut self, why: &str) {
        self.ended = true;
        self.truncated = Some(why.to_owned());
    }

    fn foreign(&self, reason: String) -> RuntimeError {
        RuntimeError::NoRecording { file: self.path.clone(), reason }
    }
}

fn decode(topic: usize, data: &[u8]) -> Result<Option<Recorded>, prost::DecodeError> {
    Ok(Some(match topic {
        0 => Recorded::Scene(RecordedScene::decode(data)?),
        1 => Recorded::Step(RecordedStep::decode(data)?),
        2 => Recorded::Order(RecordedOrder::decode(data)?),
        3 => Recorded::Checkpoint(RecordedCheckpoint::decode(data)?),
        4 => Recorded::Event(RecordedEvent::decode(data)?),
        6 => Recorded::Forces(RecordedForces::decode(data)?),
        _ => return Ok(None),
    }))
}
