//! The list of hard cases, in order.

mod flaws;
mod blade;
mod branches;
mod cells;
mod cells_small;
mod critical_step;
mod falling;
mod crowd;
mod far;
mod growth;
mod input;
mod jab;
mod multigrid;
mod overload;
mod on_mesh;
mod ruined;
mod sliver;
mod soak;
mod spin;
mod stiff;
mod support;
mod touch;

use super::case::Case;

/// The cases of a simulation by itself: first the numbered ones, then those shown beside them. A program that
/// knows more, such as clients, adds its own.
pub const ALL: &[Case] = &[
    sliver::CASE,
    on_mesh::NODE,
    on_mesh::EDGE,
    on_mesh::FACE,
    branches::HALVED,
    branches::RANDOM,
    falling::FREED_NODE,
    falling::FRAGMENTS,
    branches::BRANCHES,
    growth::GROWTH,
    growth::AGAIN,
    branches::MOVING,
    branches::CLAMPED,
    ruined::INVERTED,
    ruined::COLLAPSED,
    ruined::FLATTENED,
    ruined::SCRAMBLED,
    spin::STEPS,
    spin::SPIN,
    spin::NEWMARK,
    stiff::LAYERS,
    stiff::INCOMPRESSIBLE,
    stiff::NEEDLES,
    jab::CASE,
    input::CASE,
    touch::LIPS,
    multigrid::BLADES,
    soak::CASE,
    overload::CASE,
    far::CASE,
    critical_step::CASE,
    cells_small::SLIVER,
    cells::ALIGNED,
    cells_small::HALVED,
    cells::BRANCHES,
    cells_small::FREED,
    cells::FALLING,
    cells_small::ADVANCE,
    cells::GROWTH,
    cells::ADAPTING,
    multigrid::PATCH,
    touch::INCLINE,
    touch::HIPPO,
    touch::NEEDLE,
    touch::WEDGED,
    touch::PRESSED,
    blade::PRESSED,
    crowd::CASE,
];
