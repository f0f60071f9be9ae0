//! `pointmill::testing`: what it finds, and that it finds nothing in stages that keep their
//! promises.

mod examples;
mod own;
mod wrong;
