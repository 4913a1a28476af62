//! Watches the simulation thread. It breaks off a step that keeps an order waiting. It also makes sure that a
//! process ends after it was told to.

use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::exchange::Exchange;

/// A step is broken off when it keeps an order waiting for this long.
pub(super) const ORDER_PATIENCE: Duration = Duration::from_millis(400);

/// How often the thread checks.
const LOOK: Duration = Duration::from_millis(50);

/// Longest time that threads may take to end after they were told to.
pub(super) const END_PATIENCE: Duration = Duration::from_millis(4000);

/// Watches the threads until all have ended. If they take too long after they were told to end, it calls
/// `give_up` with the reason. A program ends its process there.
pub(super) fn run(exchange: &Arc<Exchange>, give_up: fn(&str)) {
    let mut told: Option<Instant> = None;
    while !exchange.closed() {
        std::thread::sleep(LOOK);
        exchange.break_off_after(ORDER_PATIENCE);
        if exchange.stopping() {
            let since = told.get_or_insert_with(Instant::now).elapsed();
            if since >= ORDER_PATIENCE {
                exchange.break_off();
            }
            if since >= END_PATIENCE {
                let who = if exchange.simulated() { "the network" } else { "a step" };
                give_up(&format!("{who} did not end within {:.0} s", END_PATIENCE.as_secs_f64()));
                return;
            }
        }
    }
}
