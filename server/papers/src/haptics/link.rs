//! One direction of a link on a virtual clock: constant delay, random loss from a seed, and worse.

use std::collections::VecDeque;

use scindo_drill::chance::Chance;

/// What else a bad network does to messages.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Faults {
    /// Nothing passes for a time, again and again: from start to start, and how long [ns].
    pub gaps_ns: Option<(u64, u64)>,
    /// Share of messages that others overtake, and how long they stay out [ns].
    pub late: (f64, u64),
    /// Share of messages that arrive twice.
    pub twice: f64,
}

/// Carries messages of one direction. Without faults they arrive in the order in which they were sent.
#[derive(Debug)]
pub struct Line<T> {
    delay_ns: u64,
    loss: f64,
    faults: Faults,
    chance: Chance,
    under_way: VecDeque<(u64, T)>,
}

impl<T: Clone> Line<T> {
    /// A line with a delay [ns] that loses the share `loss` of its messages.
    pub fn new(delay_ns: u64, loss: f64, seed: u64) -> Self {
        Self {
            delay_ns,
            loss,
            faults: Faults::default(),
            chance: Chance::new(seed),
            under_way: VecDeque::new(),
        }
    }

    /// The same line with faults.
    pub fn with(self, faults: Faults) -> Self {
        Self { faults, ..self }
    }

    /// Sends a message at `now_ns`.
    pub fn send(&mut self, message: T, now_ns: u64) {
        let Faults { gaps_ns, late, twice } = self.faults;
        let silent = gaps_ns.is_some_and(|(period, length)| now_ns % period >= period - length);
        if self.chance.uniform() < self.loss || silent {
            return;
        }
        let due = now_ns + self.delay_ns;
        if twice > 0.0 && self.chance.uniform() < twice {
            self.queue(due + self.delay_ns, message.clone());
        }
        let stays_out = late.0 > 0.0 && self.chance.uniform() < late.0;
        self.queue(due + if stays_out { late.1 } else { 0 }, message);
    }

    fn queue(&mut self, due_ns: u64, message: T) {
        let place = self.under_way.partition_point(|(other, _)| *other <= due_ns);
        self.under_way.insert(place, (due_ns, message));
    }

    /// The next message that has arrived by `now_ns`.
    pub fn receive(&mut self, now_ns: u64) -> Option<T> {
        let (due, _) = self.under_way.front()?;
        if *due > now_ns {
            return None;
        }
        self.under_way.pop_front().map(|(_, message)| message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_arrive_after_the_delay_and_the_share_is_lost() {
        let mut line = Line::new(5, 0.1, 7);
        (0..10_000u64).for_each(|i| line.send(i, i));
        assert_eq!(line.receive(4), None);
        let mut arrived = Vec::new();
        for now in 5..11_000 {
            while let Some(i) = line.receive(now) {
                assert_eq!(now, i + 5);
                arrived.push(i);
            }
        }
        assert!(arrived.is_sorted() && (8_900..9_100).contains(&arrived.len()), "{}", arrived.len());
    }

    #[test]
    fn a_bad_line_is_silent_for_a_time_and_lets_messages_overtake() {
        let faults = Faults { gaps_ns: Some((1000, 200)), late: (0.1, 30), twice: 0.1 };
        let mut line = Line::new(5, 0.0, 7).with(faults);
        let mut arrived: Vec<u64> = Vec::new();
        for now in 0..10_000 {
            line.send(now, now);
            while let Some(sent) = line.receive(now) {
                arrived.push(sent);
            }
        }
        assert!(arrived.iter().all(|sent| sent % 1000 < 800));
        assert!(!arrived.is_sorted());
        let count = arrived.len();
        arrived.sort_unstable();
        arrived.dedup();
        assert!((700..900).contains(&(count - arrived.len())), "{}", count - arrived.len());
    }
}
