//! Checks a recording: `cargo run --release -p hingecast-capture --example check -- REC [--fix]`.

use hingecast_capture::check::{check, fix};
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let path = Path::new(args.first().ok_or("check REC [--fix]")?);
    let start = std::time::Instant::now();
    let report = check(path, &Default::default())?;
    for finding in report.summary() {
        println!("{finding}");
    }
    if args.iter().any(|a| a == "--fix") {
        fix(path, &report)?.iter().for_each(|line| println!("{line}"));
    }
    let usable: Vec<usize> = report.states.iter().map(|s| s.usable).collect();
    println!("usable frames per state: {usable:?} ({:.1} s)", start.elapsed().as_secs_f64());
    Ok(())
}
