//! The `hingecast` binary: flags and glue. Exit 0 done, 1 under the asked bar, 2 error, 130 stopped
//! by Ctrl-C.

// `ui` writes to the terminal, and nobody else.
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod cli;
mod ui;
mod verbs;

use crate::ui::{answer, tell};
use clap::Parser;
use clap::error::{ContextKind, ErrorKind};
use hingecast::failure::Failure;
use std::process::ExitCode;

fn main() -> ExitCode {
    if let Err(failure) = readable_names() {
        return refuse(&failure, std::env::args_os().any(|a| a == "--json"));
    }
    let cli = match cli::Cli::try_parse() {
        Ok(cli) => cli,
        Err(e) if matches!(e.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) => e.exit(),
        Err(e) if e.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => e.exit(),
        Err(e) => return refuse(&misused(&e), std::env::args().any(|a| a == "--json")),
    };
    match verbs::run(&cli) {
        Ok(verbs::Outcome::Done) => ExitCode::SUCCESS,
        Ok(verbs::Outcome::UnderBar) => ExitCode::from(1),
        Err(failure) => refuse(&failure, cli.json),
    }
}

/// Run files, recordings and answers are JSON and hold paths: names that are not UTF-8 are refused
/// before anything is written.
fn readable_names() -> Result<(), Failure> {
    let strange = |name: &std::ffi::OsStr, place: &str| {
        let shown = name.to_string_lossy().into_owned();
        Failure::new(
            format!("a name is not UTF-8: {shown}"),
            place,
            "rename it: letters of any language are fine as UTF-8",
        )
    };
    if let Some(argument) = std::env::args_os().find(|a| a.to_str().is_none()) {
        return Err(strange(&argument, "the command line"));
    }
    match std::env::current_dir() {
        Ok(folder) if folder.to_str().is_none() => Err(strange(folder.as_os_str(), "the folder that you are in")),
        _ => Ok(()),
    }
}

fn refuse(failure: &Failure, json: bool) -> ExitCode {
    if json {
        let error = serde_json::json!({"error": failure.what, "where": failure.place, "try": failure.hint});
        // The exit code says already that it went wrong.
        let _ = answer(&error.to_string());
    }
    tell(&format!("{}: {failure}", if failure.cancelled { "stopped" } else { "error" }));
    ExitCode::from(if failure.cancelled { 130 } else { 2 })
}

/// clap's complaint in our three lines.
fn misused(e: &clap::Error) -> Failure {
    let text = e.render().to_string();
    let paragraph = text.split("\n\n").next().unwrap_or_default();
    let lines: Vec<&str> = paragraph.lines().map(str::trim).collect();
    let what = lines.join(" ").trim_start_matches("error: ").to_string();
    let verb = std::env::args().nth(1).filter(|a| !a.starts_with('-')).unwrap_or_default();
    let command = format!("hingecast {verb}").trim_end().to_string();
    let near = [ContextKind::SuggestedArg, ContextKind::SuggestedSubcommand, ContextKind::SuggestedValue];
    let near = near.iter().find_map(|kind| e.get(*kind)).map(|v| format!("{v}, or ")).unwrap_or_default();
    // An unknown verb has no help of its own.
    let help = if e.kind() == ErrorKind::InvalidSubcommand { "hingecast" } else { &command };
    Failure::new(what, &command, format!("{near}{help} --help"))
}
