//! One direction of a link on a virtual clock: constant delay, random loss from a seed.

use std::collections::VecDeque;

/// Carries messages of one direction. Messages arrive in the order in which they were sent.
#[derive(Debug)]
pub struct Line<T> {
    delay_ns: u64,
    loss: f64,
    chance: u64,
    under_way: VecDeque<(u64, T)>,
}

impl<T> Line<T> {
    /// A line with a delay [ns] that loses the share `loss` of its messages.
    pub fn new(delay_ns: u64, loss: f64, seed: u64) -> Self {
        Self { delay_ns, loss, chance: seed, under_way: VecDeque::new() }
    }

    /// Sends a message at `now_ns`.
    pub fn send(&mut self, message: T, now_ns: u64) {
        if self.uniform() >= self.loss {
            self.under_way.push_back((now_ns + self.delay_ns, message));
        }
    }

    /// The next message that has arrived by `now_ns`.
    pub fn receive(&mut self, now_ns: u64) -> Option<T> {
        let (due, _) = self.under_way.front()?;
        if *due > now_ns {
            return None;
        }
        self.under_way.pop_front().map(|(_, message)| message)
    }

    /// SplitMix64, uniform in [0, 1).
    fn uniform(&mut self) -> f64 {
        self.chance = self.chance.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.chance;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
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
}
