//! One seed: two hands, one liar and a server in bad weather, and then in good weather.
//!
//! In the first part links lose, repeat, delay and spoil messages, partners freeze, vanish and come back, clocks jump.
//! In the second part nothing of that happens any more, and everybody must be able to work again.

use scindo_proto::{Chunk, KeyError, KeySpace};
use scindo_world::scene::SceneError;
use serde::Serialize;
use thiserror::Error;

use crate::chance::Chance;
use crate::checker::Checker;
use crate::hand::{Fate, HandClient};
use crate::network::{Hits, Line, MS, Packet, Weather};
use crate::rogue::Rogue;
use crate::table::{Mutant, SCENE_TOOL, STEP_MS, Table};

/// Length of the bad weather, and of the good one after it [ms].
const FOUL_MS: u64 = 2_000;
const FAIR_MS: u64 = 2_000;
/// When everybody cuts for the last time [ms].
const LAST_CUTS_MS: u64 = FOUL_MS + FAIR_MS - 900;
/// Period of contact models [ms].
const CONTACT_MS: u64 = 5;
/// After this time without a link the server's side removes the token of a client [ms].
const LEASE_MS: u64 = 600;

/// Why an episode cannot begin.
#[derive(Debug, Error)]
pub enum EpisodeError {
    /// The scene of the server.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A name.
    #[error(transparent)]
    Key(#[from] KeyError),
}

/// What an episode was.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Outcome {
    /// Seed of the random numbers, which repeats the episode.
    pub seed: u64,
    /// Messages on all links.
    pub messages: u64,
    /// Ticks of all hands.
    pub ticks: u64,
    /// Ticks in which a hand felt something.
    pub touched: u64,
    /// Cuts that were made.
    pub cuts: u64,
    /// Messages that the server refused.
    pub refused: u64,
    /// Faults by class.
    pub hits: Hits,
    /// The first rule that was broken.
    pub violation: Option<String>,
}

/// A hand and its link.
struct Seat {
    hand: HandClient,
    up: Line,
    down: Line,
    token: Token,
    last_tick_ns: u64,
}

/// Where the server's side is with the token of a client.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Token {
    /// It arrives at this time [ns].
    Comes(u64),
    There,
    /// The link is down since then [ns].
    Fading(u64),
    /// It is gone. The client comes back at this time [ns].
    Gone(u64),
}

struct Episode {
    chance: Chance,
    table: Table,
    checker: Checker,
    seats: Vec<Seat>,
    rogue: Rogue,
    rogue_up: Line,
    server_frozen_until_ns: u64,
    outcome: Outcome,
}

/// Runs the episode of `seed`, with a safeguard taken out if `mutant` names one.
///
/// # Errors
/// If the server cannot be set up.
pub fn run(seed: u64, mutant: Option<Mutant>) -> Result<Outcome, EpisodeError> {
    let mut episode = Episode::new(seed, mutant)?;
    for ms in 1..=FOUL_MS {
        episode.misfortune(ms * MS);
        episode.millisecond(ms);
        if episode.checker.violation.is_some() {
            return Ok(episode.end());
        }
    }
    episode.clear_up();
    let late = FOUL_MS + FAIR_MS;
    let mut heard = Vec::new();
    for ms in FOUL_MS + 1..=late {
        if ms == LAST_CUTS_MS {
            heard = episode.seats.iter().map(|seat| seat.hand.contacts()).collect();
            episode.last_cuts(ms * MS);
        }
        episode.millisecond(ms);
    }
    episode.all_works_again(&heard);
    Ok(episode.end())
}

impl Episode {
    fn new(seed: u64, mutant: Option<Mutant>) -> Result<Self, EpisodeError> {
        let mut chance = Chance::new(seed);
        let keys = KeySpace::new("scindo", "episode")?;
        let id = |text: &str| Chunk::new("id", text);
        let both_want_it = chance.happens(0.5);
        let tools = [id(SCENE_TOOL)?, id(if both_want_it { SCENE_TOOL } else { "probe" })?];
        let mut seats = Vec::new();
        for (number, (name, tool)) in ["left", "right"].into_iter().zip(tools).enumerate() {
            let mut hand = HandClient::new(&keys, id(name)?, tool, number + chance.between(0, 4) as usize);
            hand.believes_for_ever = matches!(mutant, Some(Mutant::NoValidity | Mutant::NoWatchdog));
            let (up, down) = (Weather::foul(&mut chance), Weather::foul(&mut chance));
            let token = Token::Comes(chance.between(0, 50) * MS);
            seats.push(Seat { hand, up: Line::new(up), down: Line::new(down), token, last_tick_ns: 0 });
        }
        let rogue_up = Line::new(Weather::foul(&mut chance));
        Ok(Self {
            table: Table::new(&keys, mutant)?,
            checker: Checker::default(),
            seats,
            rogue: Rogue::new(&keys, id("rogue")?),
            rogue_up,
            server_frozen_until_ns: 0,
            outcome: Outcome { seed, ..Outcome::default() },
            chance,
        })
    }

    /// What goes wrong in this millisecond.
    fn misfortune(&mut self, now_ns: u64) {
        let Self { chance, seats, outcome, checker, .. } = self;
        let hits = &mut outcome.hits;
        if chance.happens(1e-3) {
            hits.freezes += 1;
            self.server_frozen_until_ns = now_ns + chance.between(10, 400) * MS;
        }
        for (number, seat) in seats.iter_mut().enumerate() {
            if chance.happens(1e-3) {
                hits.freezes += 1;
                seat.hand.frozen_until_ns = now_ns + chance.between(1, 900) * MS;
            }
            if chance.happens(2e-4) {
                hits.jumps += 1;
                let hour = 3_600_000 * MS as i64;
                seat.hand.clock_ns = if chance.happens(0.5) { hour } else { -hour };
            }
            if chance.happens(1e-3) && !seat.up.is_cut {
                (seat.up.is_cut, seat.down.is_cut) = (true, true);
                if seat.token == Token::There {
                    seat.token = Token::Fading(now_ns);
                }
            } else if chance.happens(3e-3) && seat.up.is_cut {
                (seat.up.is_cut, seat.down.is_cut) = (false, false);
                if matches!(seat.token, Token::Fading(_)) {
                    seat.token = Token::There;
                }
            }
            if chance.happens(3e-4) {
                hits.restarts += 1;
                seat.hand.restart(now_ns, number);
                checker.restarted(seat.hand.id.as_str());
                if seat.token == Token::There {
                    seat.token = Token::Fading(now_ns);
                }
            }
            if chance.happens(2e-3) {
                (seat.up.weather, seat.down.weather) = (Weather::foul(chance), Weather::foul(chance));
            }
        }
    }

    fn millisecond(&mut self, ms: u64) {
        let now_ns = ms * MS;
        self.checker.at(now_ns);
        self.tokens(now_ns);
        for seat in &mut self.seats {
            let Seat { hand, up, down, .. } = seat;
            let (chance, outcome) = (&mut self.chance, &mut self.outcome);
            if now_ns < hand.frozen_until_ns {
                continue;
            }
            while let Some(packet) = down.receive(now_ns) {
                hand.hear(&packet, now_ns);
            }
            let elapsed_s = (now_ns - seat.last_tick_ns) as f64 * 1e-9;
            seat.last_tick_ns = now_ns;
            let output = hand.tick(now_ns, elapsed_s);
            outcome.ticks += 1;
            outcome.touched += u64::from(output.force_n.norm() > 0.0);
            self.checker.felt(hand, &output);
            let (_, pose) = hand.pose(now_ns);
            self.rogue.overhear(&pose, chance);
            up.send(pose, now_ns, chance, &mut outcome.hits);
            let mut cuts = hand.repeat(now_ns);
            if chance.happens(4e-3) && ms < LAST_CUTS_MS {
                cuts.push(hand.cut(now_ns, 0.018 * (2.0 * chance.uniform() - 1.0)));
            }
            for cut in cuts {
                self.rogue.overhear(&cut, chance);
                up.send(cut, now_ns, chance, &mut outcome.hits);
            }
        }
        if self.chance.happens(0.2)
            && let Some(lie) = self.rogue.lie(&mut self.chance)
        {
            self.outcome.hits.lies += 1;
            self.rogue_up.send(lie, now_ns, &mut self.chance, &mut self.outcome.hits);
        }
        if now_ns >= self.server_frozen_until_ns {
            self.serve(ms);
        }
    }

    /// The server's side of a millisecond.
    fn serve(&mut self, ms: u64) {
        let now_ns = ms * MS;
        let Self { table, checker, seats, rogue_up, chance, outcome, .. } = self;
        for up in seats.iter_mut().map(|seat| &mut seat.up).chain([rogue_up]) {
            while let Some(packet) = up.receive(now_ns) {
                table.receive(&packet, now_ns, checker);
            }
        }
        if ms.is_multiple_of(STEP_MS) {
            table.step(now_ns, checker);
        }
        let hits = &mut outcome.hits;
        let mut tell = |packet: &Packet, tool: &str| {
            // Whoever listens to a tool hears what is told to its holder.
            for seat in seats.iter_mut().filter(|seat| seat.hand.tool.as_str() == tool) {
                seat.down.send(packet.clone(), now_ns, chance, hits);
            }
        };
        if ms.is_multiple_of(CONTACT_MS) {
            table.contacts(now_ns).iter().for_each(|(tool, packet)| tell(packet, tool));
        }
        table.answers().iter().for_each(|(answer, packet)| tell(packet, &answer.tool_id));
    }

    /// Tokens arrive late, and go when a link was down for the lease.
    fn tokens(&mut self, now_ns: u64) {
        for seat in &mut self.seats {
            let id = seat.hand.id.clone();
            seat.token = match seat.token {
                Token::Comes(at) if now_ns >= at && !seat.up.is_cut => {
                    self.table.token(&id, true, now_ns, &mut self.checker);
                    Token::There
                }
                Token::Fading(since) if now_ns >= since + LEASE_MS * MS => {
                    self.table.token(&id, false, now_ns, &mut self.checker);
                    Token::Gone(now_ns + self.chance.between(1, 200) * MS)
                }
                Token::Gone(until) if now_ns >= until && !seat.up.is_cut => {
                    Token::Comes(now_ns + self.chance.between(0, 50) * MS)
                }
                other => other,
            };
        }
    }

    /// The sun comes out.
    fn clear_up(&mut self) {
        self.server_frozen_until_ns = 0;
        for seat in &mut self.seats {
            for line in [&mut seat.up, &mut seat.down] {
                (line.weather, line.is_cut) = (Weather::FAIR, false);
            }
            seat.hand.frozen_until_ns = 0;
        }
    }

    /// Everybody cuts once more.
    fn last_cuts(&mut self, now_ns: u64) {
        for (number, seat) in self.seats.iter_mut().enumerate() {
            let cut = seat.hand.cut(now_ns, 0.019 + 1e-4 * number as f64);
            seat.up.send(cut, now_ns, &mut self.chance, &mut self.outcome.hits);
        }
    }

    fn all_works_again(&mut self, heard: &[u64]) {
        let owners = self.table.owners();
        for (seat, heard) in self.seats.iter().zip(heard) {
            let hand = &seat.hand;
            let tool = hand.tool.as_str();
            let owner = owners.get(tool).map_or("nobody", String::as_str);
            let rivals = self.seats.iter().filter(|other| other.hand.tool == hand.tool).count();
            let holds = owner == hand.id.as_str();
            self.checker.expect(owner != "nobody", || format!("nobody holds '{tool}' in good weather"));
            self.checker.expect(holds || rivals > 1, || {
                format!("'{owner}' holds '{tool}', which only '{}' wants", hand.id)
            });
            let last = hand.cuts.values().next_back().map(|(_, fate)| fate);
            if holds {
                self.checker.expect(hand.contacts() > heard + 100, || {
                    format!(
                        "'{}' heard {} contacts in 0.9 s of good weather",
                        hand.id,
                        hand.contacts() - heard
                    )
                });
                let answered = matches!(last, Some(Fate::Applied | Fate::Refused(_)));
                self.checker.expect(answered, || format!("the last cut of '{}' is {last:?}", hand.id));
            }
            self.checker.told(hand);
        }
    }

    fn end(self) -> Outcome {
        Outcome {
            messages: self.outcome.hits.sent,
            cuts: self.checker.applied(),
            refused: self.table.refused(),
            violation: self.checker.violation.clone(),
            ..self.outcome
        }
    }
}
