//! The integration tests of decks, one program: each further one would link everything again.

mod common;
mod decks;
mod febio;
mod febio_knee;
mod names;
mod opensim;
mod other_decks;
mod programs;
mod published_deck;
mod published_explicit;
mod published_quasistatic;
