//! The mechanics held against independent solutions: analytic values, other people's codes, and
//! properties that every discretisation must have. All of it is in the tests.
