//! The threads that serve one team, or several that work side by side.

use super::gate::Gate;
use crate::storage::sync::{
    Arc, AtomicBool, LOOKS_BEFORE_SLEEP, LOOKS_BEFORE_WANDERING, Ordering, spin_loop, thread,
};

/// Threads, and the gates of the teams that they serve.
#[derive(Debug)]
pub(super) struct Threads {
    shared: Arc<Shared>,
    members: Vec<thread::JoinHandle<()>>,
}

#[derive(Debug)]
struct Shared {
    /// The gate of the team that leads; behind it those of the teams that work side by side.
    gates: Vec<Gate>,
    /// The team that each member helps first, as number of its gate.
    home: Vec<usize>,
    stop: AtomicBool,
}

/// What a member knows while it looks for work.
#[derive(Debug, Default)]
pub(super) struct Lookout {
    member: usize,
    /// The gate where it was let in last, or its home.
    at: usize,
    /// The last phase of each gate in which it has worked.
    done: Vec<u64>,
    idle: u32,
}

impl Threads {
    /// Threads for `members` members, the caller included, and a gate for a leading team and for each of the
    /// `sizes`. Members are at home where their share of the sizes is.
    pub(super) fn new(members: usize, sizes: &[usize]) -> std::io::Result<Self> {
        let members = members.max(1);
        let mut threads = Self::room(members, sizes);
        for member in 1..members {
            let shared = Arc::clone(&threads.shared);
            let thread = thread::Builder::new().name(format!("physics-{member}"));
            threads.members.push(thread.spawn(move || shared.serve(member))?);
        }
        Ok(threads)
    }

    /// No thread but the caller's.
    pub(super) fn alone() -> Self {
        Self::room(1, &[])
    }

    fn room(members: usize, sizes: &[usize]) -> Self {
        let shared = Arc::new(Shared {
            gates: (0..=sizes.len()).map(|_| Gate::new(members)).collect(),
            home: (0..members).map(|member| home(member, members, sizes)).collect(),
            stop: AtomicBool::new(false),
        });
        Self { shared, members: Vec::new() }
    }

    /// Number of members, the caller included.
    pub(super) fn count(&self) -> usize {
        self.members.len() + 1
    }

    pub(super) fn gate(&self, number: usize) -> &Gate {
        &self.shared.gates[number]
    }

    /// Wakes the members that sleep.
    pub(super) fn wake(&self) {
        self.members.iter().for_each(|member| member.thread().unpark());
    }

    /// A lookout for the caller, which helps as the last member: the first leads.
    pub(super) fn lookout(&self) -> Lookout {
        self.shared.lookout(self.members.len())
    }

    /// Helps one of the teams that work side by side, if one of them is in a phase.
    pub(super) fn help(&self, lookout: &mut Lookout) -> bool {
        self.shared.help(lookout)
    }
}

impl Drop for Threads {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Release);
        for member in self.members.drain(..) {
            member.thread().unpark();
            // A member that panicked has been reported by its team already.
            let _ = member.join();
        }
    }
}

impl Shared {
    fn lookout(&self, member: usize) -> Lookout {
        Lookout { member, at: self.home[member], done: vec![0; self.gates.len()], idle: 0 }
    }

    fn serve(&self, member: usize) {
        let mut lookout = self.lookout(member);
        while !self.stop.load(Ordering::Acquire) {
            // A team that nobody leads comes before help for others.
            if self.gates[0].help(member, &mut lookout.done[0]) {
                (lookout.at, lookout.idle) = (self.home[member], 0);
            } else if !self.help(&mut lookout) {
                if lookout.idle < LOOKS_BEFORE_SLEEP { spin_loop() } else { thread::park() }
            }
        }
    }

    /// Looks at the gates behind the first, beginning where `lookout` was let in last, and helps at the first
    /// that is open.
    fn help(&self, lookout: &mut Lookout) -> bool {
        let beside = self.gates.len() - 1;
        let reach = if lookout.idle < LOOKS_BEFORE_WANDERING { beside.min(1) } else { beside };
        for k in 0..reach {
            let gate = (lookout.at - 1 + k) % beside + 1;
            if self.gates[gate].help(lookout.member, &mut lookout.done[gate]) {
                (lookout.at, lookout.idle) = (gate, 0);
                return true;
            }
        }
        lookout.idle = lookout.idle.saturating_add(reach.max(1) as u32);
        false
    }
}

/// The gate of the team in whose share of all sizes the middle of the member's own share lies.
pub(super) fn home(member: usize, members: usize, sizes: &[usize]) -> usize {
    let total: u128 = sizes.iter().map(|&size| size as u128).sum();
    let middle = (2 * member as u128 + 1) * total;
    let mut end = 0;
    let within = |&size: &usize| {
        end += size as u128;
        middle < 2 * members as u128 * end
    };
    1 + sizes.iter().position(within).unwrap_or(0)
}
