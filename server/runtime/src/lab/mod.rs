//! A laboratory with certificates: who belongs to it, and what each may do.
//!
//! The common name of a client's certificate is its id on the wire. Everything that it publishes lies under keys with
//! this id, so the access control of zenoh holds what the inbox then holds again.

pub mod roles;

pub mod rules;

pub mod issue;

pub mod members;

pub mod folder;

pub mod files;

pub mod house;
