//! What every page is made of: its frame, plots, charts, pictures of bodies, and tables of measured values.

pub mod html;

pub mod style;

pub mod interactive;

pub mod scale;

pub mod plot;

pub mod chart;

pub mod view;

pub mod result;

pub mod section;

pub mod frame;
