//! Looks after the simulation thread: a step that keeps an order waiting is broken off, and a process that was
//! told to end does end.

use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::exchange::Exchange;

/// A step may keep an order waiting for this long before it is broken off.
pub const ORDER_PATIENCE: Duration = Duration::from_millis(400);

/// How often the thread looks.
const LOOK: Duration = Duration::from_millis(50);

/// Threads that were told to end may take this long.
pub const END_PATIENCE: Duration = Duration::from_millis(4000);

/// Looks after the threads until all have ended. If they do not in time after they were told to, `give_up` is
/// called with the reason: a program ends the process there.
pub fn run(exchange: &Arc<Exchange>, give_up: fn(&str)) {
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
