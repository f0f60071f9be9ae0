//! The command: its arguments, words and events.

mod accept;
mod angles;
mod check;
mod compare;
mod deep;
mod errors;
mod events;
mod interrupt;
mod names;
mod page;
mod picture;
mod plan;
mod preview;
mod reproduce;
mod rules;
mod size;
mod streams;
mod tools;
mod validate;
mod values;
mod verify;
mod words;
