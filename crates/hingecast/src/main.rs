//! The `hingecast` binary: flags and glue. Exit 0 done, 1 under the asked bar, 2 error, 130 stopped by Ctrl-C.

mod cli;
mod verbs;

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    let cli = cli::Cli::parse();
    match verbs::run(&cli) {
        Ok(verbs::Outcome::Done) => ExitCode::SUCCESS,
        Ok(verbs::Outcome::UnderBar) => ExitCode::from(1),
        Err(failure) => {
            if cli.json {
                let error = serde_json::json!({"error": failure.what, "where": failure.place, "try": failure.hint});
                println!("{error}");
            }
            eprintln!("{}: {failure}", if failure.cancelled { "stopped" } else { "error" });
            ExitCode::from(if failure.cancelled { 130 } else { 2 })
        }
    }
}
