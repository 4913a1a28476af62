//! How a [`StepSolver`] is saved: as its kind and its data.

use scindo_matter::storage::saved::saved_as;

use super::linearly_implicit::LinearlyImplicit;
use super::model_solver::ModelSolver;
use super::step_solver::StepSolver;

saved_as!(saved, Box, StepSolver, Linear(LinearlyImplicit), Model(ModelSolver));
