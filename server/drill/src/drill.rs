//! Hands under made-up contacts: whatever a server says, and however long it says nothing, the rules of the force hold.
//!
//! The server of an [`episode`](super::episode) sends contacts that make sense. Here they need not: planes,
//! stiffnesses, forces and limits come from the whole range of what a message can hold, and from beyond it. Between
//! them nothing is there for a while, because a hand feels nothing before it has been free. Nothing is simulated but
//! the hand and its client, so that 10⁹ ticks take minutes.

use scindo_proto::messages::{Contact, HapticContact, Pose, Vec3, Vec3f, haptic_contact};
use scindo_proto::{Chunk, KeySpace, encode, encoding};

use crate::chance::Chance;
use crate::checker::Checker;
use crate::device::HANDS;
use crate::episode::{EpisodeError, Outcome};
use crate::hand::HandClient;
use crate::network::{MS, Packet, spoiled};
use crate::table::{Mutant, SCENE_TOOL};

/// Ticks of one seed.
pub const TICKS: u64 = 20_000;
/// Most planes of a made-up contact: one more than a message may hold.
const PLANES: u64 = 7;

/// How long nothing is there, and how long something is [ms].
const FREE_MS: (u64, u64) = (200, 800);
const TOUCH_MS: (u64, u64) = (50, 2000);

/// Height of the wall [m], and its stiffness [N/m].
const WALL_M: f64 = 0.022;
const WALL_N_M: f32 = 300.0;

/// What a server that makes things up says for a while.
#[derive(Clone)]
enum Scene {
    /// Nothing is there, so that a hand that feels nothing yet may begin to.
    Free,
    Wall,
    /// Planes that are made up, and made up anew with the share of messages.
    MadeUp(Vec<Contact>, f64),
}

/// A server that makes its contacts up.
struct Inventor {
    chance: Chance,
    scene: Scene,
    /// When it changes [ns].
    scene_until_ns: u64,
    /// Share of scenes that are made up; the others are those of a wall, so that a hand has something to lose.
    invented: f64,
    /// Share of numbers that no server would send.
    nonsense: f64,
    /// Share of ticks before which something goes wrong.
    trouble: f64,
    /// Share of messages with wrong bits.
    spoilt: f64,
    /// Mean time between two messages [ms].
    period_ms: f64,
    /// Nothing comes before this time [ns].
    silent_until_ns: u64,
    seq: u64,
}

/// Runs the drill of `seed`, with a safeguard taken out if `mutant` names one.
///
/// # Errors
/// Never, unless the names of the drill are wrong.
pub fn run(seed: u64, mutant: Option<Mutant>) -> Result<Outcome, EpisodeError> {
    let mut chance = Chance::new(seed ^ 0xd1_11);
    let id = |text: &str| Chunk::new("id", text);
    let (keys, number) =
        (KeySpace::new("scindo", "drill")?, chance.between(0, HANDS.len() as u64 - 1) as usize);
    let mut hand = HandClient::new(&keys, id("hand")?, id(SCENE_TOOL)?, number);
    hand.believes_for_ever = matches!(mutant, Some(Mutant::NoValidity | Mutant::NoWatchdog));
    let (mut checker, mut outcome) = (Checker::default(), Outcome { seed, ..Outcome::default() });
    let mut server = Inventor::new(chance);
    let (mut now_ns, mut before_ns) = (0, 0);
    for _ in 0..TICKS {
        now_ns += MS + server.misfortune(&mut hand, &mut checker, now_ns, &mut outcome);
        checker.at(now_ns);
        if let Some(packet) = server.say(&mut hand, now_ns, &mut outcome) {
            hand.hear(&packet, now_ns);
        }
        let output = hand.tick(now_ns, (now_ns - before_ns) as f64 * 1e-9);
        before_ns = now_ns;
        outcome.ticks += 1;
        outcome.touched += u64::from(output.force_n.norm() > 0.0);
        checker.felt(&hand, &output);
        if checker.violation.is_some() {
            break;
        }
    }
    Ok(Outcome { messages: outcome.hits.sent, violation: checker.violation.take(), ..outcome })
}

/// The contact of a wall that the hand's path enters and leaves, with the normal +z.
fn wall(used: &Vec3) -> Contact {
    let depth = (WALL_M - used.z) as f32;
    let vector = |z: f32| Some(Vec3f { x: 0.0, y: 0.0, z });
    Contact {
        point_m: Some(Vec3f { x: used.x as f32, y: used.y as f32, z: WALL_M as f32 }),
        normal: vector(1.0),
        gap_m: -depth,
        force_n: vector(WALL_N_M * depth.max(0.0)),
        stiffness_n_m: WALL_N_M,
        feature_id: 1,
        ..Contact::default()
    }
}

impl Inventor {
    fn new(mut chance: Chance) -> Self {
        let invented = chance.uniform();
        // After trouble a hand feels nothing before it has left the tissue.
        let trouble = 1e-3 * chance.uniform().powi(4);
        let nonsense = 0.2 * chance.uniform().powi(3);
        let spoilt = 0.2 * chance.uniform().powi(2);
        let period_ms = 1.0 + 40.0 * chance.uniform().powi(2);
        let (scene, scene_until_ns) = (Scene::Free, FREE_MS.0 * MS);
        Self {
            chance,
            scene,
            scene_until_ns,
            invented,
            nonsense,
            trouble,
            spoilt,
            period_ms,
            silent_until_ns: 0,
            seq: 0,
        }
    }

    /// Goes on to another scene when it is time.
    fn turn(&mut self, used: &Vec3, now_ns: u64) {
        if now_ns < self.scene_until_ns {
            return;
        }
        let lasts_ms = if !matches!(self.scene, Scene::Free) && self.chance.happens(0.8) {
            self.scene = Scene::Free;
            FREE_MS
        } else {
            self.scene = if self.chance.happens(self.invented) {
                let unsteady = self.chance.uniform().powi(3);
                Scene::MadeUp(self.planes(used), unsteady)
            } else {
                Scene::Wall
            };
            TOUCH_MS
        };
        self.scene_until_ns = now_ns + self.chance.between(lasts_ms.0, lasts_ms.1) * MS;
    }

    fn planes(&mut self, used: &Vec3) -> Vec<Contact> {
        let count = self.chance.between(0, PLANES);
        (0..count).map(|_| self.plane(used, count)).collect()
    }

    /// What goes wrong before the next tick; how long the client stands still [ns].
    fn misfortune(
        &mut self,
        hand: &mut HandClient,
        checker: &mut Checker,
        now_ns: u64,
        outcome: &mut Outcome,
    ) -> u64 {
        let (chance, hits) = (&mut self.chance, &mut outcome.hits);
        if chance.happens(self.trouble) {
            self.silent_until_ns = now_ns + chance.between(1, 800) * MS;
        }
        if chance.happens(self.trouble) {
            hand.sees_server(chance.happens(0.9));
        }
        if chance.happens(2e-4) {
            hits.jumps += 1;
            hand.clock_ns = chance.between(0, 7_200_000 * MS) as i64 - 3_600_000 * MS as i64;
        }
        if chance.happens(1e-4) {
            hits.restarts += 1;
            hand.restart(now_ns, chance.between(0, HANDS.len() as u64 - 1) as usize);
            checker.restarted(hand.id.as_str());
        }
        if !chance.happens(self.trouble) {
            return 0;
        }
        hits.freezes += 1;
        chance.between(0, 900 * MS)
    }

    /// The message of this millisecond, if there is one.
    fn say(&mut self, hand: &mut HandClient, now_ns: u64, outcome: &mut Outcome) -> Option<Packet> {
        if now_ns < self.silent_until_ns || !self.chance.happens(1.0 / self.period_ms) {
            return None;
        }
        outcome.hits.sent += 1;
        let content = encode(&self.contact(hand, now_ns));
        let packet =
            Packet { key: String::new(), encoding: encoding::<HapticContact>(), content, is_sound: false };
        if !self.chance.happens(self.spoilt) {
            return Some(packet);
        }
        outcome.hits.spoiled += 1;
        Some(spoiled(&packet, &mut self.chance))
    }

    fn contact(&mut self, hand: &mut HandClient, now_ns: u64) -> HapticContact {
        // As a server that was started again counts from the beginning.
        self.seq = if self.chance.happens(1e-3) { 1 } else { self.seq + self.chance.between(0, 2) };
        let (pose, _) = hand.pose(now_ns);
        let knows_pose = !self.chance.happens(0.05);
        let tip = pose.pose.and_then(|pose| pose.position_m).unwrap_or_default();
        let away = |inventor: &mut Self, at: f64| at + f64::from(inventor.signed(1e-3));
        let used = Vec3 { x: away(self, tip.x), y: away(self, tip.y), z: away(self, tip.z) };
        let mode =
            if self.chance.happens(0.2) { haptic_contact::Mode::Hold } else { haptic_contact::Mode::Contact };
        self.turn(&used, now_ns);
        let invented = matches!(self.scene, Scene::MadeUp(..));
        let contacts = match self.scene.clone() {
            Scene::Free => Vec::new(),
            Scene::Wall => vec![wall(&used)],
            Scene::MadeUp(_, unsteady) if self.chance.happens(unsteady) => self.planes(&used),
            Scene::MadeUp(planes, _) => planes,
        };
        HapticContact {
            seq: self.seq,
            sim_step: self.seq,
            sim_time_s: now_ns as f64 * 1e-9,
            publish_unix_ns: now_ns,
            tool_seq_used: if knows_pose { pose.seq } else { 0 },
            tool_client_time_ns: pose.client_time_ns.saturating_sub(self.chance.between(0, 200) * MS),
            epoch: u32::from(invented) * self.chance.between(0, 3) as u32,
            tool_id: SCENE_TOOL.to_owned(),
            tool_pose_used: Some(Pose { position_m: Some(used), qw: 1.0, ..Pose::default() }),
            mode: mode.into(),
            contacts,
            validity_ms: if self.chance.happens(0.1) { self.number(10.0, 200.0) } else { 200.0 },
            max_force_n: if self.chance.happens(0.5) { 0.0 } else { self.number(0.1, 10.0) },
            max_stiffness_n_m: if self.chance.happens(0.5) { 0.0 } else { self.number(50.0, 1e4) },
            instant_stiffness_n_m: if self.chance.happens(0.5) { 0.0 } else { self.number(10.0, 1e4) },
            relaxed_stiffness_n_m: if self.chance.happens(0.5) { 0.0 } else { self.number(10.0, 1e4) },
            relaxation_s: if self.chance.happens(0.5) { 0.0 } else { self.number(1e-3, 1.0) },
            client_id: hand.id.to_string(),
            ..HapticContact::default()
        }
    }

    fn plane(&mut self, used: &Vec3, planes: u64) -> Contact {
        let raw = [(); 3].map(|()| self.signed(1.0));
        let length = raw.iter().map(|x| x * x).sum::<f32>().sqrt().max(1e-6);
        let [x, y, z] = raw.map(|x| x / length);
        let point = [used.x, used.y, used.z].map(|at| at as f32 + self.signed(5e-3));
        let place = Contact {
            point_m: Some(Vec3f { x: point[0], y: point[1], z: point[2] }),
            normal: Some(Vec3f { x, y, z }),
            gap_m: self.signed(3e-3),
            patch_radius_m: if self.chance.happens(0.5) { 0.0 } else { self.number(1e-4, 2e-2) },
            feature_id: self.chance.between(0, 4),
            ..Contact::default()
        };
        if self.chance.happens(0.1) {
            return Contact { edge_of: self.chance.between(1, planes) as u32, ..place };
        }
        Contact {
            force_n: Some(Vec3f { x: self.signed(2.0), y: self.signed(2.0), z: self.signed(2.0) }),
            surface_velocity_m_s: Some(Vec3f {
                x: self.signed(0.2),
                y: self.signed(0.2),
                z: self.signed(0.2),
            }),
            stiffness_n_m: self.number(10.0, 1e4),
            tangential_stiffness_n_m: self.number(10.0, 1e4),
            damping_ns_m: self.number(1e-2, 1e2),
            friction: self.number(1e-2, 1.0),
            ..place
        }
    }

    /// A number that is usually between two others, on a logarithmic scale.
    fn number(&mut self, least: f32, most: f32) -> f32 {
        if self.chance.happens(self.nonsense) {
            const ODD: [f32; 12] = [
                0.0,
                -1.0,
                f32::NAN,
                f32::INFINITY,
                f32::NEG_INFINITY,
                f32::MAX,
                f32::MIN_POSITIVE,
                1e-40,
                1e6,
                1e4,
                1e-6,
                1.0,
            ];
            return ODD[self.chance.between(0, ODD.len() as u64 - 1) as usize];
        }
        least * (most / least).powf(self.chance.uniform() as f32)
    }

    /// A number of either sign that is usually at most `most`.
    fn signed(&mut self, most: f32) -> f32 {
        let size = self.number(1e-3 * most, most);
        if self.chance.happens(0.5) { size } else { -size }
    }
}
