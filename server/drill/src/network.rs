//! Links with faults between clients and the server.

use std::collections::VecDeque;

use bytes::Bytes;
use scindo::receive::Arrival;
use serde::Serialize;

use crate::chance::Chance;

/// One millisecond [ns].
pub const MS: u64 = 1_000_000;

/// A message on its way.
#[derive(Debug, Clone, PartialEq)]
pub struct Packet {
    /// Key to which it was published.
    pub key: String,
    /// Encoding that its sender states.
    pub encoding: String,
    /// The encoded message.
    pub content: Bytes,
    /// It is never spoiled. A wrong bit in the answer to a cut makes it another answer, which nobody could tell; TCP
    /// lets no such bit pass.
    pub is_sound: bool,
}

impl Arrival for Packet {
    fn key(&self) -> &str {
        &self.key
    }

    fn encoding(&self) -> String {
        self.encoding.clone()
    }

    fn length(&self) -> usize {
        self.content.len()
    }

    fn content(&self) -> Bytes {
        self.content.clone()
    }
}

/// How often what happened.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct Hits {
    /// Messages that were sent.
    pub sent: u64,
    /// Messages that were lost.
    pub lost: u64,
    /// Messages that arrived twice.
    pub repeated: u64,
    /// Messages that others overtook.
    pub overtaken: u64,
    /// Messages of which some bits were changed.
    pub spoiled: u64,
    /// Messages that a cut link swallowed.
    pub partitioned: u64,
    /// Times at which a client or the server stood still.
    pub freezes: u64,
    /// Times at which the clock of a client jumped.
    pub jumps: u64,
    /// Clients that vanished and came back.
    pub restarts: u64,
    /// Messages of liars.
    pub lies: u64,
}

impl Hits {
    /// Faults by class, with their names.
    pub fn classes(&self) -> [(&'static str, u64); 9] {
        [
            ("messages lost", self.lost),
            ("messages repeated", self.repeated),
            ("messages overtaken", self.overtaken),
            ("messages spoiled", self.spoiled),
            ("messages on a link that was down", self.partitioned),
            ("freezes", self.freezes),
            ("jumps of clocks", self.jumps),
            ("restarts of clients", self.restarts),
            ("lies", self.lies),
        ]
    }

    /// Adds those of another episode.
    pub fn add(&mut self, other: &Self) {
        let Self { sent, lost, repeated, overtaken, spoiled, partitioned, freezes, jumps, restarts, lies } =
            other;
        self.sent += sent;
        self.lost += lost;
        self.repeated += repeated;
        self.overtaken += overtaken;
        self.spoiled += spoiled;
        self.partitioned += partitioned;
        self.freezes += freezes;
        self.jumps += jumps;
        self.restarts += restarts;
        self.lies += lies;
    }
}

/// What a link does to messages.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Weather {
    /// Least and largest delay [ns].
    pub delay_ns: [u64; 2],
    /// Share of messages that are lost.
    pub loss: f64,
    /// Share that arrive twice.
    pub twice: f64,
    /// Share that are overtaken, and for how long they stay out [ns].
    pub late: (f64, u64),
    /// Share that arrive with changed bits.
    pub spoilt: f64,
}

impl Weather {
    /// A good local network.
    pub const FAIR: Self =
        Self { delay_ns: [MS / 2, MS], loss: 0.0, twice: 0.0, late: (0.0, 0), spoilt: 0.0 };

    /// Some bad weather.
    pub fn foul(chance: &mut Chance) -> Self {
        let worse = |chance: &mut Chance, most: f64| most * chance.uniform().powi(2);
        let least = chance.between(0, 20) * MS;
        Self {
            delay_ns: [least, least + chance.between(0, 30) * MS],
            loss: worse(chance, 0.4),
            twice: worse(chance, 0.3),
            late: (worse(chance, 0.2), chance.between(1, 400) * MS),
            spoilt: worse(chance, 0.1),
        }
    }
}

/// One direction of a link.
#[derive(Debug)]
pub struct Line {
    /// What it does to messages from now on.
    pub weather: Weather,
    /// Nothing passes.
    pub is_cut: bool,
    under_way: VecDeque<(u64, Packet)>,
    last_due_ns: u64,
}

impl Line {
    /// A line on which nothing is under way.
    pub fn new(weather: Weather) -> Self {
        Self { weather, is_cut: false, under_way: VecDeque::new(), last_due_ns: 0 }
    }

    /// Sends a packet at `now_ns`.
    pub fn send(&mut self, packet: Packet, now_ns: u64, chance: &mut Chance, hits: &mut Hits) {
        hits.sent += 1;
        if self.is_cut {
            hits.partitioned += 1;
            return;
        }
        let Weather { delay_ns, loss, twice, late, spoilt } = self.weather;
        if chance.happens(loss) {
            hits.lost += 1;
            return;
        }
        // What is sent on one link stays in order, unless it is overtaken.
        let due = (now_ns + chance.between(delay_ns[0], delay_ns[1])).max(self.last_due_ns);
        self.last_due_ns = due;
        if chance.happens(twice) {
            hits.repeated += 1;
            self.queue(due + chance.between(0, 300) * MS, packet.clone());
        }
        if !packet.is_sound && chance.happens(spoilt) {
            hits.spoiled += 1;
            self.queue(due, spoiled(&packet, chance));
        }
        let stays_out = chance.happens(late.0);
        hits.overtaken += u64::from(stays_out);
        self.queue(due + if stays_out { late.1 } else { 0 }, packet);
    }

    fn queue(&mut self, due_ns: u64, packet: Packet) {
        let place = self.under_way.partition_point(|(other, _)| *other <= due_ns);
        self.under_way.insert(place, (due_ns, packet));
    }

    /// The next packet that has arrived by `now_ns`.
    pub fn receive(&mut self, now_ns: u64) -> Option<Packet> {
        let due = self.under_way.front()?.0;
        if due > now_ns {
            return None;
        }
        self.under_way.pop_front().map(|(_, packet)| packet)
    }
}

/// The packet with some changed bits, cut off, or with another encoding.
pub fn spoiled(packet: &Packet, chance: &mut Chance) -> Packet {
    let mut bytes = packet.content.to_vec();
    match chance.between(0, 9) {
        0 => bytes.truncate(chance.between(0, bytes.len() as u64) as usize),
        1 => bytes.extend((0..chance.between(1, 5000)).map(|i| i as u8)),
        2 => return Packet { encoding: "application/json".into(), ..packet.clone() },
        _ => {
            for _ in 0..chance.between(1, 4) {
                if !bytes.is_empty() {
                    let at = chance.between(0, bytes.len() as u64 - 1) as usize;
                    bytes[at] ^= 1 << chance.between(0, 7);
                }
            }
        }
    }
    Packet { content: bytes.into(), ..packet.clone() }
}
