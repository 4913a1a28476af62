//! A recording as a stream of messages, in the order in which they were written. A file without an end, as a
//! killed server leaves it, is read as far as it goes.

use std::collections::HashMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use prost::Message;
use scindo_proto::messages::{
    RecordedCheckpoint, RecordedEvent, RecordedForces, RecordedOrder, RecordedScene, RecordedStep,
};

use super::chunk::{Chunk, LONGEST};
use super::writer::TOPICS;
use crate::error::RuntimeError;

/// Most bytes that are read at a time. Room for them is cleared first, however few there are.
const READ: usize = 1 << 16;

/// Number of the topic of checkpoints in [`TOPICS`].
const CHECKPOINT: usize = 3;

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

/// Reads a recording from its beginning, from a file or from anything else.
pub struct Recording<R = File> {
    file: BufReader<R>,
    path: String,
    reader: LinearReader,
    /// The chunk that is being read.
    chunk: Chunk,
    /// Whether chunks are handed on as they are.
    packed: bool,
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
    /// The file cannot be opened.
    pub fn open(path: &Path) -> Result<Self, RuntimeError> {
        Self::open_with(path, false)
    }

    /// `packed`: chunks are not unpacked.
    fn open_with(path: &Path, packed: bool) -> Result<Self, RuntimeError> {
        let name = path.display().to_string();
        let failed =
            |e: std::io::Error| RuntimeError::NoRecording { file: name.clone(), reason: e.to_string() };
        let file = File::open(path).map_err(failed)?;
        Ok(Self::read_with(file, name, packed))
    }
}

impl<R: Read> Recording<R> {
    /// Reads a recording that is called `name` in errors.
    pub fn read(from: R, name: String) -> Self {
        Self::read_with(from, name, false)
    }

    fn read_with(from: R, name: String, packed: bool) -> Self {
        let options = LinearReaderOptions::default()
            .with_skip_end_magic(false)
            .with_emit_chunks(true)
            .with_record_length_limit(LONGEST);
        Self {
            file: BufReader::with_capacity(READ, from),
            path: name,
            reader: LinearReader::new_with_options(options),
            chunk: Chunk::default(),
            packed,
            channels: HashMap::new(),
            truncated: None,
            ended: false,
        }
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
        self.next_of(|channels, record| match record {
            Record::Channel(channel) => {
                let known = TOPICS.iter().position(|(topic, _)| *topic == channel.topic);
                if let Some(topic) = known {
                    channels.insert(channel.id, topic);
                }
                Ok(None)
            }
            Record::Message { header, data } => match channels.get(&header.channel_id) {
                Some(&topic) => {
                    let words = |error| format!("a message on {}: {error}", TOPICS[topic].0);
                    decode(topic, &data).map_err(words)
                }
                None => Ok(None),
            },
            _ => Ok(None),
        })
    }

    /// The next record of which `take` makes something; `None` at the end. It also gets the channels.
    fn next_of<T>(
        &mut self,
        mut take: impl FnMut(&mut HashMap<u16, usize>, Record<'_>) -> Result<Option<T>, String>,
    ) -> Result<Option<T>, RuntimeError> {
        while !self.ended {
            while let Some(record) = self.chunk.next_record() {
                let record = record.and_then(|(opcode, content)| parse(opcode, content));
                match record.map(|record| record.map_or(Ok(None), |r| take(&mut self.channels, r))) {
                    Ok(Ok(None)) => {}
                    Ok(Ok(taken)) => return Ok(taken),
                    Ok(Err(reason)) => return Err(self.foreign(reason)),
                    Err(broken) => {
                        self.end_early(&broken);
                        return Ok(None);
                    }
                }
            }
            let Some(event) = self.reader.next_event() else {
                self.ended = true;
                break;
            };
            let broken = match event {
                // Memory grows with what the file has, not with what a broken length claims.
                Ok(LinearReadEvent::ReadRequest(n)) => {
                    match self.file.read(self.reader.insert(n.min(READ))) {
                        Ok(0) => "it ends in the middle, as that of a server that was killed".to_owned(),
                        Ok(read) => {
                            self.reader.notify_read(read);
                            continue;
                        }
                        Err(error) => return Err(self.foreign(error.to_string())),
                    }
                }
                Ok(LinearReadEvent::Record { opcode: op::FOOTER, .. }) => {
                    self.ended = true;
                    break;
                }
                Ok(LinearReadEvent::Record { data, opcode }) => match parse(opcode, data) {
                    Ok(Some(Record::Chunk { header, data })) if !self.packed => {
                        match self.chunk.unpack(&header, &data) {
                            Ok(()) => continue,
                            Err(broken) => broken,
                        }
                    }
                    Ok(Some(record)) => match take(&mut self.channels, record) {
                        Ok(None) => continue,
                        Ok(taken) => return Ok(taken),
                        Err(reason) => return Err(self.foreign(reason)),
                    },
                    Ok(None) => continue,
                    Err(broken) => broken,
                },
                Err(error) => error.to_string(),
            };
            self.end_early(&broken);
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

/// The scene and the newest checkpoint of a recording. Unpacks only the chunks that hold them, so that a server which
/// was killed after hours goes on within seconds.
///
/// # Errors
/// No recording, or one without a checkpoint.
pub fn newest_checkpoint(path: &Path) -> Result<(RecordedScene, RecordedCheckpoint), RuntimeError> {
    let mut recording = Recording::open(path)?;
    let scene = recording.scene()?;
    let is_checkpoint = |channel| recording.channels.get(&channel) == Some(&CHECKPOINT);
    let mut packed = Recording::open_with(path, true)?;
    // The last chunk, and the last one whose index tells of checkpoints.
    let (mut last, mut found) = (None, None);
    packed.next_of(|_, record| {
        match record {
            Record::Chunk { header, data } => last = Some((header, data.into_owned())),
            Record::MessageIndex(index) if is_checkpoint(index.channel_id) && !index.records.is_empty() => {
                found = last.take().or(found.take());
            }
            _ => {}
        }
        Ok(None::<()>)
    })?;
    let (header, data) = found.ok_or_else(|| packed.foreign("it holds no checkpoint".to_owned()))?;
    let (mut chunk, mut newest) = (Chunk::default(), None);
    chunk.unpack(&header, &data).map_err(|words| packed.foreign(words))?;
    while let Some(record) = chunk.next_record() {
        let record = record.and_then(|(opcode, content)| parse(opcode, content));
        if let Some(Record::Message { header, data }) = record.map_err(|words| packed.foreign(words))?
            && is_checkpoint(header.channel_id)
        {
            newest = Some(data.into_owned());
        }
    }
    let newest = newest.ok_or_else(|| packed.foreign("it holds no checkpoint".to_owned()))?;
    let checkpoint = RecordedCheckpoint::decode(&newest[..]).map_err(|e| packed.foreign(e.to_string()))?;
    Ok((scene, checkpoint))
}

/// A record of a kind that is read here; `None` for others, about whose content nothing is assumed.
fn parse(opcode: u8, content: &[u8]) -> Result<Option<Record<'_>>, String> {
    match opcode {
        op::CHANNEL | op::MESSAGE | op::CHUNK | op::MESSAGE_INDEX => {
            mcap::parse_record(opcode, content).map(Some).map_err(|error| error.to_string())
        }
        _ => Ok(None),
    }
}

fn decode(topic: usize, data: &[u8]) -> Result<Option<Recorded>, prost::DecodeError> {
    Ok(Some(match topic {
        0 => Recorded::Scene(RecordedScene::decode(data)?),
        1 => Recorded::Step(RecordedStep::decode(data)?),
        2 => Recorded::Order(RecordedOrder::decode(data)?),
        CHECKPOINT => Recorded::Checkpoint(RecordedCheckpoint::decode(data)?),
        4 => Recorded::Event(RecordedEvent::decode(data)?),
        6 => Recorded::Forces(RecordedForces::decode(data)?),
        _ => return Ok(None),
    }))
}
