//! The stages of the examples, which have tests of their own to be copied.

#[path = "../../examples/09_own_column.rs"]
#[allow(dead_code, reason = "an example runs as a program of its own")]
mod own_column;
#[path = "../../examples/08_own_stage.rs"]
#[allow(dead_code, reason = "an example runs as a program of its own")]
mod own_stage;
