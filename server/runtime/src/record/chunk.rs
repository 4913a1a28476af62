//! A chunk of a recording: packed records, unpacked and checked as a whole before the first of them is used.

use std::io::Read;

use mcap::records::ChunkHeader;

use super::mcap_writer::PREFIX;

/// Longest record of a file, and longest chunk before it was packed [byte]: a checkpoint of the largest scenes.
pub(super) const LONGEST: usize = 4 << 30;

/// The records of a chunk, one after the other.
#[derive(Default)]
pub(super) struct Chunk {
    bytes: Vec<u8>,
    /// Where the next record begins.
    at: usize,
}

impl Chunk {
    /// Unpacks the content of a chunk in place of the one before. Memory grows with what there is, not with the size
    /// that the header claims.
    ///
    /// # Errors
    /// Words for what is wrong: how it is packed, its size, or its checksum.
    pub(super) fn unpack(&mut self, header: &ChunkHeader, packed: &[u8]) -> Result<(), String> {
        self.bytes.clear();
        self.at = 0;
        let size = header.uncompressed_size;
        if size > LONGEST as u64 {
            return Err(format!("a chunk claims to have {size} bytes; at most {LONGEST} are read"));
        }
        // One byte more than the header says shows that it is wrong.
        let unpacked = match header.compression.as_str() {
            "" => packed.take(size + 1).read_to_end(&mut self.bytes),
            "zstd" => zstd::Decoder::with_buffer(packed)
                .and_then(|unpacked| unpacked.take(size + 1).read_to_end(&mut self.bytes)),
            other => return Err(format!("a chunk is packed with {other:?}; zstd can be read")),
        };
        let found = unpacked.map_err(|error| format!("a chunk cannot be unpacked: {error}"));
        let found = found.inspect_err(|_| self.bytes.clear())?;
        let crc = header.uncompressed_crc;
        let broken = if found as u64 != size {
            "has another size than its header says"
        } else if crc != 0 && crc != crc32fast::hash(&self.bytes) {
            "does not match its checksum"
        } else {
            return Ok(());
        };
        self.bytes.clear();
        Err(format!("a chunk {broken}"))
    }

    /// Kind and content of the next record; `None` at the end.
    pub(super) fn next_record(&mut self) -> Option<Result<(u8, &[u8]), String>> {
        let rest = &self.bytes[self.at..];
        if rest.is_empty() {
            return None;
        }
        let record = rest.split_first_chunk::<PREFIX>().and_then(|(&[opcode, ref length @ ..], rest)| {
            let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
            Some((opcode, rest.get(..length)?))
        });
        match record {
            Some((_, content)) => self.at += PREFIX + content.len(),
            None => self.at = self.bytes.len(),
        }
        Some(record.ok_or_else(|| "a record in a chunk goes beyond its end".to_owned()))
    }
}
