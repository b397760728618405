//! Runs the real binary and keeps what it said.
#![allow(dead_code)]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// What a person who ran the command sees.
#[derive(Debug)]
pub struct Answer {
    pub command: String,
    /// `None`: ended by a signal.
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
}

impl Answer {
    /// Exit 0, or the whole transcript.
    pub fn done(self) -> Self {
        assert_eq!(self.code, Some(0), "{self}");
        self
    }

    /// The `--json` answer.
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|e| panic!("stdout is no JSON: {e}\n{self}"))
    }

    /// Exit 2, no panic, and three lines of which the first two hold `what` and `place`.
    pub fn refused(&self, what: &str, place: &str) {
        assert_eq!(self.code, Some(2), "{self}");
        assert!(!self.stderr.contains("panicked"), "{self}");
        let lines: Vec<&str> = self.stderr.lines().collect();
        assert_eq!(lines.len(), 3, "not three lines\n{self}");
        let heads = ["error: ", "  where: ", "  try: "];
        for (line, head) in lines.iter().zip(heads) {
            assert!(line.starts_with(head) && line.len() > head.len(), "'{line}' does not say '{head}'\n{self}");
        }
        assert!(lines[0].contains(what), "'{what}' is not in the first line\n{self}");
        assert!(lines[1].contains(place), "'{place}' is not in the second line\n{self}");
    }
}

impl std::fmt::Display for Answer {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let Self { command, code, stdout, stderr } = self;
        write!(f, "$ {command}\nexit {code:?}\n--- stdout\n{stdout}\n--- stderr\n{stderr}")
    }
}

/// The command with arguments split at spaces; finds the sample objects wherever it runs.
fn command(dir: &Path, line: &str) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hingecast"));
    command.args(line.split_whitespace()).current_dir(dir).env("HINGECAST_OBJECTS", objects()).stdin(Stdio::null());
    command
}

/// Runs `hingecast <line>` in `dir`. Paths in `line` hold no spaces.
pub fn hingecast(dir: &Path, line: &str) -> Answer {
    finish(line, command(dir, line).output().unwrap())
}

/// Starts `hingecast <line>` in `dir`.
pub fn start(dir: &Path, line: &str) -> Child {
    command(dir, line).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// The end of what [`start`] began.
pub fn wait(line: &str, child: Child) -> Answer {
    finish(line, child.wait_with_output().unwrap())
}

fn finish(line: &str, output: std::process::Output) -> Answer {
    Answer {
        command: format!("hingecast {line}"),
        code: output.status.code(),
        stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
        stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
    }
}

/// The repository's sample objects.
pub fn objects() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../objects").canonicalize().unwrap()
}

/// Records the hinged box: 5 states, 10 views, 80 pixels. As small as it can be and still be built
/// from.
pub fn tiny_recording(dir: &Path) -> PathBuf {
    hingecast(dir, "synth hinged_box -o rec --states 5 --views 10 --test-views 2 --size 80 -q").done();
    dir.join("rec")
}

/// Settings for a build in seconds: it shows the path, not the quality.
pub const TINY: &str = "--set fit.steps=40 --set fit.gaussians=1000 --set track.steps=30 --set parts.sample=400 \
                        --set twin.voxel=0.012 --set twin.max_hulls=8 --set twin.max_texels=0";

/// Flags of `synth`: a small picture of an object in a room, as people scan it.
pub const ROOM: &str = "--test-views 0 --camera 160,120,132,132,80,60 --scene room --masks none --trajectory walk";

/// All files below `folder`, as sorted relative paths.
pub fn files(folder: &Path) -> Vec<PathBuf> {
    fn walk(at: &Path, root: &Path, out: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(at).unwrap().flatten() {
            let path = entry.path();
            if path.is_dir() {
                walk(&path, root, out);
            } else {
                out.push(path.strip_prefix(root).unwrap().to_path_buf());
            }
        }
    }
    let mut out = Vec::new();
    walk(folder, folder, &mut out);
    out.sort();
    out
}

/// Both folders hold the same files with the same bytes, but for the times in `trace.json`.
pub fn assert_same_bytes(a: &Path, b: &Path) {
    assert_eq!(files(a), files(b), "{} and {} hold different files", a.display(), b.display());
    for file in files(a) {
        let read = |folder: &Path| {
            let bytes = std::fs::read(folder.join(&file)).unwrap();
            if file.ends_with("trace.json") { without_secs(&bytes) } else { bytes }
        };
        let same = read(a) == read(b);
        assert!(same, "{} differs between {} and {}", file.display(), a.display(), b.display());
    }
}

/// What passes did, without how long it took.
fn without_secs(trace: &[u8]) -> Vec<u8> {
    let mut records: Vec<serde_json::Value> = serde_json::from_slice(trace).unwrap();
    records.iter_mut().for_each(|r| r["secs"] = 0.into());
    serde_json::to_vec(&records).unwrap()
}

/// No NaN became null anywhere in `value`, but for the keys that may be absent.
pub fn assert_finite(value: &serde_json::Value, at: &str) {
    match value {
        serde_json::Value::Object(map) => map.iter().for_each(|(k, v)| {
            let absent = ["axis_pos", "pivot", "found_type"].contains(&k.as_str()) && v.is_null();
            if !absent {
                assert_finite(v, &format!("{at}.{k}"));
            }
        }),
        serde_json::Value::Array(list) => {
            list.iter().enumerate().for_each(|(i, v)| assert_finite(v, &format!("{at}[{i}]")))
        }
        serde_json::Value::Null => panic!("{at} is null: a number that is not finite"),
        _ => {}
    }
}
