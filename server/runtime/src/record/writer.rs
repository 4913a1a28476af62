//! The thread that writes a recording: a bounded queue in, an MCAP file out, flushed every second.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded};
use mcap::records::MessageHeader;
use scindo_proto::FILE_DESCRIPTOR_SET;
use tempfile::{SpooledTempFile, spooled_tempfile, spooled_tempfile_in};

use super::mcap_writer::McapWriter;
use crate::error::RuntimeError;

/// Topics and the messages on them, in the order of their channels.
pub const TOPICS: [(&str, &str); 8] = [
    ("record/scene", "scindo.v1.RecordedScene"),
    ("record/step", "scindo.v1.RecordedStep"),
    ("record/order", "scindo.v1.RecordedOrder"),
    ("record/checkpoint", "scindo.v1.RecordedCheckpoint"),
    ("record/event", "scindo.v1.RecordedEvent"),
    ("record/stats", "scindo.v1.RecordedStats"),
    ("record/forces", "scindo.v1.RecordedForces"),
    ("record/surface", "scindo.v1.RecordedSurface"),
];

/// Messages and bytes that may wait to be written. A disk that is slower than this ends the recording.
const WAITING: usize = 65_536;
const WAITING_BYTES: usize = 1 << 30;
/// Bytes of the index of a recording's chunks that stay in memory, a few minutes of it; more waits in a temporary file.
const INDEX_IN_MEMORY: usize = 1 << 16;
/// The file is complete up to what was handed over this long ago.
const FLUSH: Duration = Duration::from_millis(500);

/// A message on its way into the file.
pub struct Item {
    /// Number of its topic in [`TOPICS`].
    pub topic: usize,
    /// When it was made [ns since 1970].
    pub unix_ns: u64,
    /// Encoded message.
    pub bytes: Vec<u8>,
}

/// The thread and the way to it.
pub struct WriterThread {
    queue: Option<Sender<Item>>,
    waiting: Arc<AtomicUsize>,
    thread: Option<JoinHandle<Result<(), String>>>,
    path: PathBuf,
}

impl WriterThread {
    /// Creates the file, which must not exist yet, and starts the thread.
    ///
    /// # Errors
    /// The file exists, or cannot be created.
    pub fn begin(path: &Path) -> Result<Self, RuntimeError> {
        let failed = |reason: String| RuntimeError::Recording { file: path.display().to_string(), reason };
        let file = File::create_new(path).map_err(|e| failed(e.to_string()))?;
        // On the disk of the recording, which has room for it.
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        let indexes = spooled_tempfile_in(INDEX_IN_MEMORY, folder.unwrap_or(Path::new(".")));
        let (writer, channels) = open(BufWriter::new(file), indexes).map_err(|e| failed(e.to_string()))?;
        let (queue, items) = bounded(WAITING);
        let waiting = Arc::new(AtomicUsize::new(0));
        let count = Arc::clone(&waiting);
        let thread = std::thread::Builder::new()
            .name("record".to_owned())
            .spawn(move || write(writer, channels, &items, &count))
            .map_err(|e| failed(e.to_string()))?;
        Ok(Self { queue: Some(queue), waiting, thread: Some(thread), path: path.to_owned() })
    }

    /// Hands a message over. `patient` waits for the disk; otherwise a full queue is an error.
    ///
    /// # Errors
    /// Why the recording ends here.
    pub fn send(&mut self, item: Item, patient: bool) -> Result<(), String> {
        let Some(queue) = &self.queue else { return Err("it has ended".to_owned()) };
        let bytes = item.bytes.len();
        let waiting = self.waiting.fetch_add(bytes, Ordering::Relaxed) + bytes;
        let sent = match patient {
            true => queue.send(item).is_ok(),
            false if waiting > WAITING_BYTES => false,
            false => queue.try_send(item).is_ok(),
        };
        if sent {
            return Ok(());
        }
        let written = self.close();
        Err(written
            .err()
            .unwrap_or_else(|| "the disk is too slow; messages waited until there was no room".into()))
    }

    /// Writes what waits, and the end of the file.
    ///
    /// # Errors
    /// What the disk says.
    pub fn end(&mut self) -> Result<(), RuntimeError> {
        let file = self.path.display().to_string();
        self.close().map_err(|reason| RuntimeError::Recording { file, reason })
    }

    fn close(&mut self) -> Result<(), String> {
        self.queue = None;
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(written)) => written,
            Some(Err(_)) => Err("the thread that writes has panicked".to_owned()),
            None => Ok(()),
        }
    }
}

impl Drop for WriterThread {
    fn drop(&mut self) {
        if let Err(reason) = self.close() {
            tracing::error!(file = %self.path.display(), "recording: {reason}");
        }
    }
}

/// A whole recording in memory, as the bytes of its file.
///
/// # Errors
/// What the system says.
pub fn in_memory(items: &[Item]) -> Result<Vec<u8>, String> {
    let words = |error: io::Error| error.to_string();
    let (mut writer, channels) = open(Vec::new(), spooled_tempfile(INDEX_IN_MEMORY)).map_err(words)?;
    for (sequence, Item { topic, unix_ns, bytes }) in (1..).zip(items) {
        let (channel_id, log_time) = (channels[*topic], unix_ns + u64::from(sequence));
        let header = MessageHeader { channel_id, sequence, log_time, publish_time: *unix_ns };
        writer.add(&header, bytes).map_err(words)?;
    }
    writer.finish().map_err(words)
}

/// Begins a recording, and adds a channel for every topic.
fn open<W: Write>(target: W, indexes: SpooledTempFile) -> io::Result<(McapWriter<W>, [u16; TOPICS.len()])> {
    let mut writer = McapWriter::begin(target, indexes)?;
    let mut channels = [0; TOPICS.len()];
    for (channel, (topic, name)) in channels.iter_mut().zip(TOPICS) {
        *channel = writer.add_topic(topic, name, FILE_DESCRIPTOR_SET)?;
    }
    Ok((writer, channels))
}

fn write(
    mut writer: McapWriter<BufWriter<File>>,
    channels: [u16; TOPICS.len()],
    items: &Receiver<Item>,
    waiting: &AtomicUsize,
) -> Result<(), String> {
    let words = |error: io::Error| error.to_string();
    let (mut sequence, mut last_ns) = (0u32, 0);
    let mut due = Instant::now() + FLUSH;
    loop {
        match items.recv_deadline(due) {
            Ok(Item { topic, unix_ns, bytes }) => {
                // Readers order by time, which a clock that is set back must not change.
                last_ns = unix_ns.max(last_ns + 1);
                sequence = sequence.wrapping_add(1);
                let (log_time, publish_time) = (last_ns, unix_ns);
                let header = MessageHeader { channel_id: channels[topic], sequence, log_time, publish_time };
                writer.add(&header, &bytes).map_err(words)?;
                waiting.fetch_sub(bytes.len(), Ordering::Relaxed);
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        if Instant::now() >= due {
            writer.flush().map_err(words)?;
            due = Instant::now() + FLUSH;
        }
    }
    writer.finish().map_err(words)?;
    Ok(())
}
