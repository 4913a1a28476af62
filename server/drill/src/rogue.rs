//! A client that lies: it names others in its messages, repeats what it has seen, and sends nonsense under its own
//! keys. Access control keeps it from the keys of others.

use scindo_proto::messages::{CutCommand, DeviceCapability, ToolSample};
use scindo_proto::{Chunk, KeySpace, Topic, encode, encoding};

use crate::chance::Chance;
use crate::network::{Packet, spoiled};

/// Packets of others that it remembers.
const MEMORY: usize = 32;

/// The liar.
pub struct Rogue {
    /// The client id under which it speaks.
    pub id: Chunk,
    keys: KeySpace,
    seen: Vec<Packet>,
}

impl Rogue {
    /// A liar that has seen nothing yet.
    pub fn new(keys: &KeySpace, id: Chunk) -> Self {
        Self { id, keys: keys.clone(), seen: Vec::with_capacity(MEMORY) }
    }

    /// Remembers some of what others send.
    pub fn overhear(&mut self, packet: &Packet, chance: &mut Chance) {
        if self.seen.len() < MEMORY {
            self.seen.push(packet.clone());
        } else if chance.happens(0.05) {
            let place = chance.between(0, MEMORY as u64 - 1) as usize;
            self.seen[place] = packet.clone();
        }
    }

    /// Its next message, if it has seen anything.
    pub fn lie(&self, chance: &mut Chance) -> Option<Packet> {
        if self.seen.is_empty() {
            return None;
        }
        let stolen = &self.seen[chance.between(0, self.seen.len() as u64 - 1) as usize];
        let topic = self.keys.parse(&stolen.key).ok()?;
        let own = self.id.clone();
        // The content of another client under its own key, for the tool of the other.
        let key = match topic {
            Topic::ToolPose(_, tool) => self.keys.key(&Topic::ToolPose(own, tool)),
            Topic::ToolCut(_, tool) => self.keys.key(&Topic::ToolCut(own, tool)),
            _ => return None,
        };
        let forged = Packet { key: key.clone(), ..stolen.clone() };
        Some(match chance.between(0, 5) {
            0 | 1 => forged,
            2 => spoiled(&forged, chance),
            3 => Packet {
                key,
                is_sound: false,
                encoding: encoding::<ToolSample>(),
                content: encode(&ToolSample {
                    seq: u64::MAX,
                    client_time_ns: u64::MAX,
                    client_id: self.id.to_string(),
                    tool_id: "scalpel".into(),
                    ..ToolSample::default()
                }),
            },
            4 => Packet {
                key,
                is_sound: false,
                encoding: encoding::<CutCommand>(),
                content: vec![0xff; chance.between(0, 200_000) as usize].into(),
            },
            _ => Packet {
                key,
                is_sound: false,
                encoding: encoding::<DeviceCapability>(),
                content: encode(&DeviceCapability::default()),
            },
        })
    }
}
