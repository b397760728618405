//! Damaged files for every reader. Each target makes a small valid folder, damages one file of it
//! over and over, and reads it: no panic, no hang, no absurd memory is allowed.
//!
//!     hingecast-fuzz [--seconds N] [--out FOLDER] [TARGET ...]
//!     hingecast-fuzz --replay TARGET FOLDER     # one folder, for a debugger
//!     hingecast-fuzz --list
//!
//! A target runs in a process of its own with 2 GiB of address space. What breaks a reader is left
//! as a folder, OUT/<target>/<panic|hang|death>-<n>; the damaged file goes into `found/<target>/`
//! once the reader is mended, and is then tried first in every run.
//! Mutations are seeded and know no coverage: the same seed tries the same files.

mod mutate;
mod samples;
mod targets;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use targets::{TARGETS, Target};

/// Longest that one file may take, seconds: a thousand times what any of them does.
const HANG: u64 = 10;
/// Address space of a worker, KiB. Every seed is below 100 KB.
const MEMORY_KIB: u64 = 2 * 1024 * 1024;
/// Least time of a target, seconds.
const LEAST: u64 = 5;
/// Deaths of one target after which it is left alone: more say nothing new.
const DEATHS: usize = 4;
/// What a worker says with its exit code.
const HUNG: i32 = 3;

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = args.iter().map(String::as_str).collect();
    match words[..] {
        ["--list"] => TARGETS.iter().for_each(|t| println!("{}", t.name)),
        ["--replay", name, folder] => {
            let answer = target(name).map(|t| (t.read)(Path::new(folder)));
            println!("{answer:?}");
        }
        ["--worker", name, seconds, seed, out] => {
            let (Some(t), Ok(seconds), Ok(seed)) = (target(name), seconds.parse(), seed.parse()) else {
                return ExitCode::from(2);
            };
            return worker(t, Duration::from_secs(seconds), seed, Path::new(out));
        }
        _ => return all(&words),
    }
    ExitCode::SUCCESS
}

fn target(name: &str) -> Option<&'static Target> {
    TARGETS.iter().find(|t| t.name == name)
}

/// Runs the named targets, or all, one after the other.
fn all(words: &[&str]) -> ExitCode {
    let (mut seconds, mut out, mut chosen) = (60u64, PathBuf::from("target/fuzz/artifacts"), Vec::new());
    let mut words = words.iter();
    while let Some(word) = words.next() {
        match *word {
            "--seconds" => match words.next().and_then(|n| n.parse().ok()) {
                Some(n) => seconds = n,
                None => return refuse("--seconds wants a whole number"),
            },
            "--out" => match words.next() {
                Some(folder) => out = PathBuf::from(folder),
                None => return refuse("--out wants a folder"),
            },
            name => match target(name) {
                Some(t) => chosen.push(t),
                None => return refuse(&format!("no target {name}")),
            },
        }
    }
    if chosen.is_empty() {
        chosen.extend(TARGETS);
    }
    let each = (seconds / chosen.len() as u64).max(LEAST);
    let broken = chosen.iter().filter(|t| !run(t, Duration::from_secs(each), &out)).count();
    if broken == 0 {
        return ExitCode::SUCCESS;
    }
    eprintln!("error: {broken} of {} targets broke a reader", chosen.len());
    eprintln!("  where: {}, a folder each, the message in note.txt", out.display());
    eprintln!("  try: hingecast-fuzz --replay TARGET FOLDER");
    ExitCode::FAILURE
}

fn refuse(what: &str) -> ExitCode {
    let names: Vec<&str> = TARGETS.iter().map(|t| t.name).collect();
    eprintln!("error: {what}\n  where: the arguments\n  try: targets are {}", names.join(" "));
    ExitCode::from(2)
}

/// One target for so long, begun anew after each death. True: nothing broke.
fn run(target: &Target, time: Duration, out: &Path) -> bool {
    let folder = out.join(target.name);
    let _ = std::fs::remove_dir_all(&folder);
    let exe = std::env::current_exe().expect("this program");
    let end = Instant::now() + time;
    let mut deaths = 0;
    while deaths < DEATHS {
        let left = end.saturating_duration_since(Instant::now()).as_secs();
        if left == 0 && deaths > 0 {
            break;
        }
        let mut command = Command::new("sh");
        command.args(["-c", &format!("ulimit -v {MEMORY_KIB}; exec \"$0\" \"$@\"")]).arg(&exe);
        command.args(["--worker", target.name, &left.max(1).to_string(), &deaths.to_string()]).arg(out);
        // One thread: others' stacks would take up the address space.
        command.env("RAYON_NUM_THREADS", "1").stderr(Stdio::piped());
        let output = command.output().expect("sh");
        print!("{}", String::from_utf8_lossy(&output.stdout));
        match output.status.code() {
            Some(0 | 1) => break,
            code => {
                let kind = if code == Some(HUNG) { "hang" } else { "death" };
                let kept = folder.join(format!("{kind}-{deaths}"));
                let _ = std::fs::rename(folder.join("work"), &kept);
                let stderr = String::from_utf8_lossy(&output.stderr);
                let tail: Vec<&str> = stderr.lines().rev().take(8).collect();
                let note: Vec<&str> = tail.into_iter().rev().collect();
                let note = format!("{}\n{}\n", output.status, note.join("\n"));
                println!("{:<14} {kind}: {}", target.name, note.trim().replace('\n', " | "));
                let _ = std::fs::write(kept.join("note.txt"), note);
                deaths += 1;
            }
        }
    }
    let _ = std::fs::remove_dir_all(folder.join("work"));
    let clean = std::fs::read_dir(&folder).map_or(true, |mut entries| entries.next().is_none());
    if clean {
        let _ = std::fs::remove_dir(&folder);
    }
    clean
}

/// Where the panic that is on its way began, and what it said.
static PANIC: Mutex<String> = Mutex::new(String::new());
/// Milliseconds since the start of the worker at which the file under test was begun; 0 = none.
static BEGUN: AtomicU64 = AtomicU64::new(0);

/// Damages and reads until the time is up. Exit code 1: it panicked somewhere.
fn worker(target: &Target, time: Duration, seed: u64, out: &Path) -> ExitCode {
    let start = Instant::now();
    let since = move || start.elapsed().as_millis() as u64 + 1;
    std::thread::spawn(move || {
        loop {
            std::thread::sleep(Duration::from_millis(200));
            let begun = BEGUN.load(Ordering::Relaxed);
            if begun != 0 && since() > begun + 1000 * HANG {
                eprintln!("one file took more than {HANG} s");
                std::process::exit(HUNG);
            }
        }
    });
    std::panic::set_hook(Box::new(|info| *PANIC.lock().expect("no panic here") = info.to_string()));
    let folder = out.join(target.name);
    let work = folder.join("work");
    let _ = std::fs::remove_dir_all(&work);
    (target.make)(&work);
    // None: it panicked.
    let read = || {
        BEGUN.store(since(), Ordering::Relaxed);
        let answer = std::panic::catch_unwind(|| (target.read)(&work)).ok();
        BEGUN.store(0, Ordering::Relaxed);
        answer
    };
    if !matches!(read(), Some(Ok(()))) {
        println!("{:<14} its own seed is refused: {:?} {}", target.name, (target.read)(&work), PANIC.lock().unwrap());
        let _ = std::fs::rename(&work, folder.join("seed-refused"));
        return ExitCode::from(1);
    }
    let seeds: Vec<(&str, Vec<u8>)> =
        target.damage.iter().map(|name| (*name, std::fs::read(work.join(name)).expect("a seed"))).collect();
    let mut found = known(target.name, &seeds);
    let mut rng = fastrand::Rng::with_seed(seed);
    let (mut tried, mut accepted, mut places) = (0u64, 0u64, BTreeSet::new());
    while start.elapsed() < time || !found.is_empty() {
        let (file, bytes) = found.pop().unwrap_or_else(|| {
            let (name, seed) = &seeds[rng.usize(..seeds.len())];
            let mut bytes = seed.clone();
            mutate::damage(&mut bytes, &mut rng);
            (name, bytes)
        });
        std::fs::write(work.join(file), &bytes).expect("the working folder");
        tried += 1;
        match read() {
            Some(answer) => accepted += u64::from(answer.is_ok()),
            None => {
                let note = PANIC.lock().expect("no panic here").clone();
                // The place alone: the numbers in the message differ from file to file.
                let place = note.lines().next().unwrap_or_default().to_string();
                if places.insert(place) {
                    println!("{:<14} {}", target.name, note.replace('\n', " "));
                    let kept = folder.join(format!("panic-{seed}-{}", places.len()));
                    copy(&work, &kept);
                    let _ = std::fs::write(kept.join("note.txt"), note);
                }
            }
        }
        let (_, seed) = seeds.iter().find(|(name, _)| *name == file).expect("one of them");
        std::fs::write(work.join(file), seed).expect("the working folder");
    }
    println!("{:<14} {tried} files, {accepted} of them read, {} panics", target.name, places.len());
    ExitCode::from(u8::from(!places.is_empty()))
}

/// Files that broke the reader once: `found/<target>/<anything>.<name of the file it stands for>`.
fn known<'a>(target: &str, seeds: &[(&'a str, Vec<u8>)]) -> Vec<(&'a str, Vec<u8>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("found").join(target);
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path()).collect();
    paths.sort();
    let as_seed = |path: &PathBuf| {
        let own = path.file_name()?.to_str()?;
        let base = |name: &str| Path::new(name).file_name().map(|n| format!(".{}", n.to_string_lossy()));
        let (name, _) = seeds.iter().find(|(name, _)| base(name).is_some_and(|base| own.ends_with(&base)))?;
        Some((*name, std::fs::read(path).ok()?))
    };
    paths.iter().filter_map(as_seed).collect()
}

/// A folder with its folders.
fn copy(from: &Path, to: &Path) {
    let _ = std::fs::create_dir_all(to);
    for entry in std::fs::read_dir(from).into_iter().flatten().flatten() {
        let (path, name) = (entry.path(), to.join(entry.file_name()));
        if path.is_dir() {
            copy(&path, &name);
        } else {
            let _ = std::fs::copy(&path, &name);
        }
    }
}
