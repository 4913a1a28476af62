//! The files of recordings: what is in them, and what writing them holds in memory.

use std::io;
use std::sync::Arc;

use mcap::records::{MessageHeader, MessageIndexEntry, Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{Channel, MessageStream, Summary};
use scindo::record::mcap_writer::McapWriter;
use scindo_allocations::held_bytes;
use tempfile::spooled_tempfile;

const TOPICS: [&str; 3] = ["a", "b", "c"];

/// Bytes that cannot be packed away, of a length of their own.
fn data(n: u32) -> Vec<u8> {
    let length = if n == 50 { 3 << 20 } else { n as usize % 300 };
    let mut random = fastrand::Rng::with_seed(u64::from(n));
    std::iter::repeat_with(|| random.u8(..)).take(length).collect()
}

fn header(n: u32) -> MessageHeader {
    // Not in the order of time.
    let log_time = 1000 + u64::from(n ^ 3);
    MessageHeader { channel_id: (n % 3) as u16, sequence: n, log_time, publish_time: u64::from(n) }
}

fn begin<W: io::Write>(target: W) -> McapWriter<W> {
    let mut writer = McapWriter::begin(target, spooled_tempfile(100)).unwrap();
    for (n, topic) in (0..).zip(TOPICS) {
        assert_eq!(writer.add_topic(topic, "test.Message", &[n; 50]).unwrap(), u16::from(n));
    }
    writer
}

/// `count` messages, flushed after every `each`.
fn file(count: u32, each: u32) -> Vec<u8> {
    let mut writer = begin(Vec::new());
    for n in 0..count {
        writer.add(&header(n), &data(n)).unwrap();
        if n % each == each - 1 {
            writer.flush().unwrap();
        }
    }
    writer.finish().unwrap()
}

/// All records, with every checksum held against what was read.
fn records(file: &[u8]) -> Vec<Record<'static>> {
    let options = LinearReaderOptions::default()
        .with_emit_chunks(true)
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true)
        .with_check_finishes_after_end_magic(true);
    let (mut reader, mut rest, mut found) = (LinearReader::new_with_options(options), file, Vec::new());
    while let Some(event) = reader.next_event() {
        match event.unwrap() {
            LinearReadEvent::ReadRequest(n) => {
                let read = io::Read::read(&mut rest, reader.insert(n)).unwrap();
                reader.notify_read(read);
            }
            LinearReadEvent::Record { data, opcode } => {
                found.push(mcap::parse_record(opcode, data).unwrap().into_owned());
            }
        }
    }
    found
}

#[test]
fn the_library_reads_every_message_and_finds_each_by_the_index() {
    let file = file(200, 20);
    let messages: Vec<_> = MessageStream::new(&file).unwrap().map(Result::unwrap).collect();
    assert_eq!(messages.len(), 200);
    for (n, message) in (0..).zip(&messages) {
        let header = header(n);
        assert_eq!((message.sequence, message.log_time), (n, header.log_time));
        assert_eq!(message.publish_time, header.publish_time);
        assert_eq!(message.channel.topic, TOPICS[usize::from(header.channel_id)]);
        let schema = message.channel.schema.as_ref().unwrap();
        assert_eq!(
            (&schema.name[..], &schema.data[..]),
            ("test.Message", &[header.channel_id as u8; 50][..])
        );
        assert_eq!(message.data, data(n));
    }

    let summary = Summary::read(&file).unwrap().unwrap();
    let statistics = summary.stats.clone().unwrap();
    assert_eq!((statistics.message_count, statistics.schema_count, statistics.channel_count), (200, 3, 3));
    assert_eq!((statistics.message_start_time, statistics.message_end_time), (1000, 1199));
    assert_eq!(
        statistics.channel_message_counts.into_iter().collect::<Vec<_>>(),
        [(0, 67), (1, 67), (2, 66)]
    );
    // The long message ends a chunk of its own accord.
    assert_eq!((summary.chunk_indexes.len(), statistics.chunk_count), (11, 11));
    let mut seen = [false; 200];
    for chunk in &summary.chunk_indexes {
        let times = chunk.message_start_time..=chunk.message_end_time;
        let indexes = summary.read_message_indexes(&file, chunk).unwrap();
        let of_channel = |(channel, entries): (Arc<Channel<'_>>, Vec<MessageIndexEntry>)| {
            let topic = channel.topic.clone();
            entries.into_iter().map(move |entry| (topic.clone(), entry))
        };
        let mut entries: Vec<_> = indexes.into_iter().flat_map(of_channel).collect();
        entries.sort_unstable_by_key(|(_, entry)| entry.offset);
        for (topic, entry) in entries {
            let message = summary.seek_message(&file, chunk, &entry).unwrap();
            assert_eq!((&message.channel.topic, message.log_time), (&topic, entry.log_time));
            assert!(times.contains(&entry.log_time));
            assert!(!std::mem::replace(&mut seen[message.sequence as usize], true));
        }
    }
    assert!(seen.iter().all(|seen| *seen));
}

#[test]
fn checksums_hold_and_the_summary_lies_where_the_footer_says() {
    for file in [file(200, 20), file(0, 1)] {
        let records = records(&file);
        let Some(Record::Footer(footer)) = records.last() else { panic!("{:?}", records.last()) };
        assert_ne!(footer.summary_crc, 0);
        assert!(records.iter().any(|r| matches!(r, Record::DataEnd(end) if end.data_section_crc != 0)));
        let mut end = footer.summary_start;
        for record in &records {
            let Record::SummaryOffset(group) = record else { continue };
            assert_eq!(group.group_start, end, "groups follow each other");
            assert_eq!(file[usize::try_from(group.group_start).unwrap()], group.group_opcode);
            end += group.group_length;
        }
        assert_eq!(end, footer.summary_offset_start);
        let chunks = records.iter().filter(|record| record.opcode() == op::CHUNK).count();
        assert_eq!(chunks, if records.len() > 30 { 11 } else { 0 });
    }
}

#[test]
fn an_index_of_many_chunks_is_not_held_in_memory() {
    let mut writer = begin(io::sink());
    let mut held_after = |chunks: u32| {
        for n in 0..chunks {
            writer.add(&header(n % 40), &[7; 40]).unwrap();
            writer.flush().unwrap();
        }
        held_bytes()
    };
    let before = held_after(2000);
    assert_eq!(held_after(3000), before);
    writer.finish().unwrap();
    assert!(before > 1000, "{before} bytes held: nothing is counted");
}
