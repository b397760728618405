//! Joints fitted to samples: values by asking all of them, the last digits by Gauss and Newton, and
//! the rival type of a joint.

pub mod axis_odds;
pub mod gauss_newton;
pub mod path;
pub mod question;
pub mod rival;
mod sweep_film;
pub mod sweep_values;
pub mod unknowns;
