//! Records every tick as a line of CSV and as a point of the force plot. A separate thread writes, fed by a
//! bounded queue.
//!
//! The loop offers rows and never waits. When the queue is full, the row is dropped and counted.

use super::force_plot::Trace;
use super::row::LogRow;
use crate::constants::LOG_QUEUE_ROWS;
use crossbeam_channel::{Receiver, Sender, TryRecvError};
use std::io::{BufWriter, Write};
use std::path::Path;
use std::thread::JoinHandle;
use std::time::Duration;

/// How often the writer looks for rows. It polls so that the loop never has to wake it.
const POLL: Duration = Duration::from_millis(5);

/// First line of the file.
pub const HEADER: &str = "time_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s,tissue_x_n,tissue_y_n,tissue_z_n,\
                          force_x_n,force_y_n,force_z_n,contact_seq,contact_age_ms,epoch,energy_j,flags";

/// The loop's end of the log.
pub struct LogQueue(Sender<LogRow>);

impl LogQueue {
    /// Queues a row. Returns `false` if the queue was full. Never waits: the writer polls its end.
    pub fn offer(&mut self, row: &LogRow) -> bool {
        self.0.try_send(*row).is_ok()
    }
}

/// The writing thread. It ends when the queue is dropped.
pub struct Recorder {
    writer: JoinHandle<std::io::Result<(u64, Option<Trace>)>>,
}

impl Recorder {
    /// Creates the file and starts the writer, which also fills `trace`.
    pub fn create(file: Option<&Path>, trace: Option<Trace>) -> std::io::Result<(LogQueue, Self)> {
        let out: Box<dyn Write + Send> = match file {
            Some(file) => Box::new(BufWriter::with_capacity(1 << 16, std::fs::File::create(file)?)),
            None => Box::new(std::io::sink()),
        };
        let (sender, receiver) = crossbeam_channel::bounded(LOG_QUEUE_ROWS);
        let writer = std::thread::Builder::new()
            .name("haptic-log".into())
            .spawn(move || write(out, trace, &receiver))?;
        Ok((LogQueue(sender), Self { writer }))
    }

    /// Waits for the last row and returns the number of rows and the trace.
    pub fn finish(self) -> std::io::Result<(u64, Option<Trace>)> {
        self.writer.join().unwrap_or_else(|_| Err(std::io::Error::other("the log writer panicked")))
    }
}

fn write(
    mut out: impl Write,
    mut trace: Option<Trace>,
    rows: &Receiver<LogRow>,
) -> std::io::Result<(u64, Option<Trace>)> {
    writeln!(out, "{HEADER}")?;
    let mut count = 0;
    loop {
        match rows.try_recv() {
            Ok(row) => {
                write_row(&mut out, &row)?;
                if let Some(trace) = &mut trace {
                    trace.push(&row);
                }
                count += 1;
            }
            Err(TryRecvError::Empty) => std::thread::sleep(POLL),
            Err(TryRecvError::Disconnected) => break,
        }
    }
    out.flush()?;
    Ok((count, trace))
}

fn write_row(out: &mut impl Write, row: &LogRow) -> std::io::Result<()> {
    write!(out, "{:.6}", row.time_s)?;
    for v in [&row.position_m, &row.velocity_m_s, &row.tissue_n, &row.force_n] {
        write!(out, ",{:.7},{:.7},{:.7}", v.x, v.y, v.z)?;
    }
    let LogRow { contact_seq, contact_age_ms, epoch, energy_j, flags, .. } = row;
    writeln!(out, ",{contact_seq},{contact_age_ms:.3},{epoch},{energy_j:.9},{flags}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn row(seq: u64) -> LogRow {
        let zero = Vector3::zeros();
        LogRow {
            time_s: 0.001 * seq as f64,
            position_m: zero,
            velocity_m_s: zero,
            tissue_n: zero,
            force_n: Vector3::z(),
            contact_seq: seq,
            contact_age_ms: 1.5,
            round_trip_ms: 0.0,
            epoch: 2,
            energy_j: 0.0,
            flags: 3,
        }
    }

    #[test]
    fn rows_reach_the_file_in_order_with_as_many_fields_as_the_header() {
        let file = std::env::temp_dir().join(format!("scindo-haptic-log-{}.csv", std::process::id()));
        let (mut queue, recorder) = Recorder::create(Some(&file), Some(Trace::default())).unwrap();
        (1..=1000).for_each(|seq| assert!(queue.offer(&row(seq))));
        drop(queue);
        let (rows, trace) = recorder.finish().unwrap();
        assert_eq!((rows, trace.unwrap().rows()), (1000, 1000));
        let mut reader = csv::Reader::from_path(&file).unwrap();
        let columns = reader.headers().unwrap().len();
        let seqs: Vec<u64> = reader
            .records()
            .map(|r| {
                let r = r.unwrap();
                assert_eq!(r.len(), columns);
                r[13].parse().unwrap()
            })
            .collect();
        assert!(seqs.iter().copied().eq(1..=1000));
        std::fs::remove_file(file).unwrap();
    }

    #[test]
    fn a_full_queue_drops_and_does_not_wait() {
        let (sender, _receiver) = crossbeam_channel::bounded(2);
        let mut queue = LogQueue(sender);
        assert_eq!([1, 2, 3].map(|seq| queue.offer(&row(seq))), [true, true, false]);
    }
}
