//! How a [`StepSolver`] is saved: as its kind and its data.

use super::linearly_implicit::LinearlyImplicit;
use super::model_solver::ModelSolver;
use super::step_solver::StepSolver;
use crate::storage::saved::saved_as;

saved_as!(saved, Box, StepSolver, Linear(LinearlyImplicit), Model(ModelSolver));
