//! `hingecast doctor`: what this machine has and lacks.

use super::{Outcome, Session};
use hingecast::failure::Result;
use hingecast_splat::Simd;

pub fn run(session: &Session) -> Result<Outcome> {
    let simd = format!("{:?}", Simd::best());
    let data = std::env::var("HINGECAST_DATA").ok();
    let mujoco = cfg!(feature = "mujoco");
    session.ui.say(&format!("threads          {}", session.threads));
    session.ui.say(&format!("vector kernels   {simd}"));
    session.ui.say(&format!(
        "MuJoCo           {}",
        if mujoco { "3.17.0, linked" } else { "not built in (feature `mujoco`)" }
    ));
    session.ui.say(&format!("real objects     {}", data.as_deref().unwrap_or("none: HINGECAST_DATA is not set")));
    session.answer(&serde_json::json!({ "threads": session.threads, "simd": simd, "mujoco": mujoco, "data": data }))?;
    Ok(Outcome::Done)
}
