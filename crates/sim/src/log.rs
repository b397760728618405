//! MuJoCo prints warnings; here they are collected, so that a twin which compiles with a warning
//! has a doubt.

use mujoco_rs::logging::set_log_handler;
use mujoco_rs::wrappers::mj_logging::{MjLogMessage, MjtLogLevel};
use std::sync::{Mutex, Once};

static MESSAGES: Mutex<Vec<String>> = Mutex::new(Vec::new());
static INSTALL: Once = Once::new();
/// MuJoCo's log is one for the process: whoever collects holds this.
static COLLECTING: Mutex<()> = Mutex::new(());

fn handler(message: &MjLogMessage) {
    if message.level() == MjtLogLevel::mjLOG_INFO {
        return; // compile times and the like
    }
    if let Ok(mut messages) = MESSAGES.lock() {
        messages.push(format!("{:?}: {}", message.level(), message.subject()));
    }
}

/// Runs `work` and answers what MuJoCo said meanwhile.
pub fn collect<T>(work: impl FnOnce() -> T) -> (T, Vec<String>) {
    let _alone = COLLECTING.lock().unwrap_or_else(|e| e.into_inner());
    // SAFETY: installed once, before this crate makes its first call into MuJoCo.
    INSTALL.call_once(|| unsafe { set_log_handler(handler) });
    let take = || std::mem::take(&mut *MESSAGES.lock().unwrap_or_else(|e| e.into_inner()));
    take();
    let value = work();
    (value, take())
}
