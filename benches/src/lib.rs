//! Tasks and generators that the benches share. Holds no measurement itself.

pub mod classics;
