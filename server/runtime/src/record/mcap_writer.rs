//! An MCAP file while it is written. The index of its chunks waits in a temporary file, so a recording of days needs no
//! more memory than one of a minute; the library's writer keeps it in memory.
//!
//! Layout (MCAP 1.0): header, schemas and channels, then chunks, each with its message indexes, then the end of the
//! data, the summary and its offsets, and the footer.

use std::collections::BTreeMap;
use std::io::{self, Cursor, Seek, SeekFrom, Write};
use std::mem;

use binrw::BinWrite;
use mcap::records::{
    Channel, ChunkHeader, ChunkIndex, DataEnd, Header, MessageHeader, MessageIndex, MessageIndexEntry,
    SchemaHeader, Statistics, SummaryOffset, op,
};
use tempfile::SpooledTempFile;

/// A chunk ends when it has this many bytes, before compression.
const CHUNK: u64 = 1 << 20;

const COMPRESSION: &str = "zstd";
const LEVEL: i32 = 1;

/// Bytes before the content of a record: what it is, and its length.
pub(super) const PREFIX: usize = 1 + 8;

/// Length of the footer: two offsets and a checksum.
const FOOTER: u64 = 8 + 8 + 4;

/// Writes an MCAP file from its beginning to its end.
pub struct McapWriter<W: Write> {
    file: Counted<W>,
    chunk: Chunk,
    /// All schemas and channels, which the summary repeats.
    schemas: Vec<u8>,
    channels: Vec<u8>,
    chunk_indexes: SpooledTempFile,
    statistics: Statistics,
    /// A record on its way into the file.
    record: Vec<u8>,
}

impl<W: Write> McapWriter<W> {
    /// Begins a file; the index of its chunks waits in `chunk_indexes`, which is empty.
    ///
    /// # Errors
    /// What the disk says.
    pub fn begin(target: W, chunk_indexes: SpooledTempFile) -> io::Result<Self> {
        let mut writer = Self {
            file: Counted { target, count: 0, crc: crc32fast::Hasher::new() },
            chunk: Chunk::default(),
            schemas: Vec::new(),
            channels: Vec::new(),
            chunk_indexes,
            statistics: Statistics::default(),
            record: Vec::new(),
        };
        writer.file.write_all(mcap::MAGIC)?;
        let library = concat!("scindo ", env!("CARGO_PKG_VERSION")).to_owned();
        append(&mut writer.record, op::HEADER, &Header { profile: String::new(), library })?;
        writer.file.write_all(&writer.record)?;
        Ok(writer)
    }

    /// Adds a topic of protobuf messages that `descriptors` describe, and returns the number of its channel.
    ///
    /// # Errors
    /// What the disk says.
    pub fn add_topic(&mut self, topic: &str, message: &str, descriptors: &[u8]) -> io::Result<u16> {
        let id = self.statistics.schema_count;
        let (from_schema, from_channel) = (self.schemas.len(), self.channels.len());
        // Schema 0 means that there is none.
        let schema_id = id + 1;
        let header =
            SchemaHeader { id: schema_id, name: message.to_owned(), encoding: "protobuf".to_owned() };
        let length = u32::try_from(descriptors.len()).map_err(io::Error::other)?;
        begin_record(&mut self.schemas, op::SCHEMA, &header, size_of_val(&length) + descriptors.len())?;
        self.schemas.extend(length.to_le_bytes());
        self.schemas.extend_from_slice(descriptors);
        let message_encoding = "protobuf".to_owned();
        let metadata = BTreeMap::new();
        let channel = Channel { id, schema_id, topic: topic.to_owned(), message_encoding, metadata };
        append(&mut self.channels, op::CHANNEL, &channel)?;
        self.file.write_all(&self.schemas[from_schema..])?;
        self.file.write_all(&self.channels[from_channel..])?;
        self.statistics.schema_count += 1;
        self.statistics.channel_count += 1;
        self.chunk.indexes.push(MessageIndex { channel_id: id, records: Vec::new() });
        Ok(id)
    }

    /// Adds a message of a topic.
    ///
    /// # Errors
    /// What the disk says.
    ///
    /// # Panics
    /// No topic has this number.
    pub fn add(&mut self, header: &MessageHeader, data: &[u8]) -> io::Result<()> {
        let first = self.statistics.message_count == 0;
        self.chunk.add(header, data)?;
        let Statistics { message_count, message_start_time: start, message_end_time: end, .. } =
            &mut self.statistics;
        *message_count += 1;
        *start = if first { header.log_time } else { header.log_time.min(*start) };
        *end = header.log_time.max(*end);
        *self.statistics.channel_message_counts.entry(header.channel_id).or_default() += 1;
        if self.chunk.size >= CHUNK {
            self.end_chunk()?;
        }
        Ok(())
    }

    /// Hands all messages so far to the system.
    ///
    /// # Errors
    /// What the disk says.
    pub fn flush(&mut self) -> io::Result<()> {
        self.end_chunk()?;
        self.file.flush()
    }

    fn end_chunk(&mut self) -> io::Result<()> {
        let Some(packer) = self.chunk.packer.take() else { return Ok(()) };
        let packed = packer.finish()?;
        let header = ChunkHeader {
            message_start_time: self.chunk.start,
            message_end_time: self.chunk.end,
            uncompressed_size: self.chunk.size,
            uncompressed_crc: self.chunk.crc.clone().finalize(),
            compression: COMPRESSION.to_owned(),
            compressed_size: packed.len() as u64,
        };
        let chunk_start_offset = self.file.count;
        self.record.clear();
        begin_record(&mut self.record, op::CHUNK, &header, packed.len())?;
        self.file.write_all(&self.record)?;
        self.file.write_all(&packed)?;
        self.chunk.packed = packed;
        let index_offset = self.file.count;
        let mut message_index_offsets = BTreeMap::new();
        for index in self.chunk.indexes.iter_mut().filter(|index| !index.records.is_empty()) {
            message_index_offsets.insert(index.channel_id, self.file.count);
            self.record.clear();
            append(&mut self.record, op::MESSAGE_INDEX, index)?;
            self.file.write_all(&self.record)?;
            index.records.clear();
        }
        let index = ChunkIndex {
            message_start_time: header.message_start_time,
            message_end_time: header.message_end_time,
            chunk_start_offset,
            chunk_length: index_offset - chunk_start_offset,
            message_index_offsets,
            message_index_length: self.file.count - index_offset,
            compression: header.compression,
            compressed_size: header.compressed_size,
            uncompressed_size: header.uncompressed_size,
        };
        self.record.clear();
        append(&mut self.record, op::CHUNK_INDEX, &index)?;
        self.chunk_indexes.write_all(&self.record)?;
        self.statistics.chunk_count += 1;
        Ok(())
    }

    /// Writes the end of the file.
    ///
    /// # Errors
    /// What the disk says.
    pub fn finish(mut self) -> io::Result<W> {
        self.end_chunk()?;
        let data_section_crc = self.file.crc.clone().finalize();
        self.record.clear();
        append(&mut self.record, op::DATA_END, &DataEnd { data_section_crc })?;
        self.file.write_all(&self.record)?;

        self.file.crc = crc32fast::Hasher::new();
        let summary_start = self.file.count;
        let mut offsets = Vec::new();
        let mut group = |file: &Counted<W>, group_opcode, group_start| {
            let group_length = file.count - group_start;
            if group_length == 0 {
                return Ok(());
            }
            append(
                &mut offsets,
                op::SUMMARY_OFFSET,
                &SummaryOffset { group_opcode, group_start, group_length },
            )
        };
        let mut statistics = Vec::new();
        append(&mut statistics, op::STATISTICS, &self.statistics)?;
        for (opcode, records) in
            [(op::SCHEMA, &self.schemas), (op::CHANNEL, &self.channels), (op::STATISTICS, &statistics)]
        {
            let start = self.file.count;
            self.file.write_all(records)?;
            group(&self.file, opcode, start)?;
        }
        let start = self.file.count;
        self.chunk_indexes.seek(SeekFrom::Start(0))?;
        io::copy(&mut self.chunk_indexes, &mut self.file)?;
        group(&self.file, op::CHUNK_INDEX, start)?;

        let summary_offset_start = self.file.count;
        self.file.write_all(&offsets)?;
        // The checksum of the summary covers the footer up to the checksum itself.
        self.file.write_all(&[op::FOOTER])?;
        for number in [FOOTER, summary_start, summary_offset_start] {
            self.file.write_all(&number.to_le_bytes())?;
        }
        let crc = self.file.crc.clone().finalize();
        self.file.write_all(&crc.to_le_bytes())?;
        self.file.write_all(mcap::MAGIC)?;
        self.file.flush()?;
        Ok(self.file.target)
    }
}

/// The chunk that is being filled.
#[derive(Default)]
struct Chunk {
    /// `None` before its first message.
    packer: Option<zstd::Encoder<'static, Vec<u8>>>,
    /// The chunk before this one, whose room is used again.
    packed: Vec<u8>,
    /// Bytes so far, before compression.
    size: u64,
    crc: crc32fast::Hasher,
    /// Times of its earliest and latest message [ns since 1970].
    start: u64,
    end: u64,
    /// Where its messages lie, for each channel.
    indexes: Vec<MessageIndex>,
    /// The beginning of a message, up to its data.
    head: Vec<u8>,
}

impl Chunk {
    fn add(&mut self, header: &MessageHeader, data: &[u8]) -> io::Result<()> {
        let time = header.log_time;
        let packer = match &mut self.packer {
            Some(packer) => packer,
            none => {
                (self.size, self.crc) = (0, crc32fast::Hasher::new());
                (self.start, self.end) = (time, time);
                self.packed.clear();
                none.insert(zstd::Encoder::new(mem::take(&mut self.packed), LEVEL)?)
            }
        };
        (self.start, self.end) = (self.start.min(time), self.end.max(time));
        let entry = MessageIndexEntry { log_time: time, offset: self.size };
        self.indexes[usize::from(header.channel_id)].records.push(entry);
        self.head.clear();
        begin_record(&mut self.head, op::MESSAGE, header, data.len())?;
        for part in [&self.head[..], data] {
            packer.write_all(part)?;
            self.crc.update(part);
            self.size += part.len() as u64;
        }
        Ok(())
    }
}

/// Counts what is written, and has its checksum.
struct Counted<W> {
    target: W,
    count: u64,
    crc: crc32fast::Hasher,
}

impl<W: Write> Write for Counted<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.target.write(bytes)?;
        self.crc.update(&bytes[..written]);
        self.count += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.target.flush()
    }
}

/// Appends a record with nothing after its header.
fn append(bytes: &mut Vec<u8>, opcode: u8, header: &impl for<'a> BinWrite<Args<'a> = ()>) -> io::Result<()> {
    begin_record(bytes, opcode, header, 0)
}

/// Appends the beginning of a record: up to the `rest` bytes after its header, which the caller appends.
fn begin_record(
    bytes: &mut Vec<u8>,
    opcode: u8,
    header: &impl for<'a> BinWrite<Args<'a> = ()>,
    rest: usize,
) -> io::Result<()> {
    bytes.push(opcode);
    let at = bytes.len();
    bytes.extend([0; PREFIX - 1]);
    let from = bytes.len();
    let mut end = Cursor::new(&mut *bytes);
    end.set_position(from as u64);
    header.write_le(&mut end).map_err(io::Error::other)?;
    let length = (bytes.len() - from + rest) as u64;
    bytes[at..from].copy_from_slice(&length.to_le_bytes());
    Ok(())
}
