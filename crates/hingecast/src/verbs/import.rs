//! `hingecast import`

use super::{Outcome, Session};
use crate::cli::Import;
use hingecast::failure::Result;

pub fn run(_: &Session, _: &Import) -> Result<Outcome> {
    Ok(Outcome::Done)
}
