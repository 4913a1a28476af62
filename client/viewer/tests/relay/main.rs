//! A viewer between a server and its pages.

#![allow(clippy::unwrap_used)]

mod coarse;
mod pages;
mod upstream;
