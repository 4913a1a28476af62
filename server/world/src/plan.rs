//! The plan of effects: what a scene calls for, why, and what it costs.
