//! The haptic truth table: what the hand feels, by hand, delay and loss, against tissue solved at 1 kHz.
//!
//! Every trial couples the parts that a session couples, on one virtual clock: a simulated device in a hand
//! ([`device`](scindo_drill::device)), the client's own tick, a link with delay and loss ([`link`]), the server's step and contact
//! model ([`tissue`]). Beside them, the same tissue is solved every millisecond at the measured pose, without
//! a link: its force is the truth. Nothing sleeps, and chance comes from a seed, so a trial gives the same
//! figures on every run.
//!
//! [`trial`] runs one cell, [`measures`] reduces it to figures, [`table`] runs all cells, [`page`]
//! shows them.
//!
//! # Source
//! Delay lowers the stiffness that a client may render: Schuwerk, Xu, Freund, Steinbach 2015. Bound of a
//! sampled wall: Colgate and Schenkel 1997.

pub mod link;

pub mod tissue;

pub mod measures;

pub mod trial;

pub mod table;

pub mod cases;

pub mod page;
