//! The same demonstrations with many settings: a grid, or random draws; several trainings at a
//! time, each as it would be alone.
//!
//! ```toml
//! mode = "grid"                 # or "random"
//! samples = 20                  # random: how many draws
//! seed = 0                      # random: of the draws
//! [settings]
//! learning_rate = [1e-4, 1e-3]
//! "net.rnn_hidden" = [100, 400]
//! "net.min_std" = { min = 1e-4, max = 1e-1, log = true }     # random only
//! ```
//! Every combination has a folder named after it, so that the same command resumes, and a changed
//! file keeps what it shares.

use super::{plot, resolve, train};
use hingecast::failure::{Failure, Result};
use hingecast::stage::write_json;
use hingecast_geom::Progress;
use hingecast_geom::staging::write_whole;
use hingecast_policy::Demos;
use hingecast_policy::train::{Preset, TrainConfig};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

/// The success rate, 0 to 1, of the policy in a folder. Asked again when the sweep runs again: keep
/// results that cost time.
pub type Score = dyn Fn(&Path) -> Result<f64> + Sync;

/// A sweep's combinations may not fill a disk by mistake.
const MOST: usize = 10_000;

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Mode {
    Grid,
    Random,
}

/// The file, as the module's head shows it; [`Sweep::read`] makes one.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sweep {
    mode: Mode,
    #[serde(default)]
    samples: usize,
    #[serde(default)]
    seed: u64,
    settings: BTreeMap<String, Values>,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
enum Values {
    List(Vec<toml::Value>),
    Span(Span),
}

/// Drawn evenly between the two, or evenly in the logarithm. Whole where both ends are whole.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Span {
    min: toml::Value,
    max: toml::Value,
    #[serde(default)]
    log: bool,
}

/// One row of the table.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Name of the policy's folder inside the sweep's, after its settings.
    pub folder: String,
    /// What this combination sets: key, such as `net.rnn_hidden`, and value.
    pub settings: BTreeMap<String, toml::Value>,
    /// At the last step. `None`: this training failed; `failed` says why.
    pub train_loss: Option<f64>,
    /// At the last step. `None`: it failed, or no demonstrations are kept for validation.
    pub valid_loss: Option<f64>,
    /// Success rate in rollouts, 0 to 1. `None`: it failed, or no rollouts were asked for.
    pub success: Option<f64>,
    /// Why the training, or its score, gave nothing. `None`: both are done.
    pub failed: Option<String>,
}

impl Sweep {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// No such file, not TOML, nothing to vary, spans in a grid or without a range, no or more than
    /// 10 000 combinations. Whether the settings exist is only known to [`run`].
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).map_err(Failure::io(path))?;
        let refuse = |what: String, place: &str| {
            let place = format!("{}{place}", path.display());
            Err(Failure::new(what, place, "docs/policy.md shows a sweep file"))
        };
        let sweep: Self = match toml::from_str(&text) {
            Ok(sweep) => sweep,
            Err(e) => return refuse(format!("not a sweep file: {}", e.message().replace('\n', "; ")), ""),
        };
        if sweep.settings.is_empty() {
            return refuse("nothing to vary".into(), ", settings: empty");
        }
        if sweep.mode == Mode::Random && !(1..=MOST).contains(&sweep.samples) {
            return refuse("a random sweep says how many draws".into(), &format!(", samples = {}", sweep.samples));
        }
        for (key, values) in &sweep.settings {
            let place = format!(", settings.{key}");
            match values {
                Values::List(list) if list.is_empty() => return refuse("no values to try".into(), &place),
                Values::Span(_) if sweep.mode == Mode::Grid => {
                    return refuse(
                        "a grid needs lists of values; min and max are for mode = \"random\"".into(),
                        &place,
                    );
                }
                Values::Span(span) if !span.is_usable() => {
                    return refuse("min must be below max, and above 0 with log".into(), &place);
                }
                _ => {}
            }
        }
        let grid = sweep.settings.values().map(|v| if let Values::List(l) = v { l.len() } else { 1 });
        let size = grid.fold(1usize, usize::saturating_mul);
        if sweep.mode == Mode::Grid && size > MOST {
            return refuse(format!("{size} combinations, {MOST} at most"), ", settings");
        }
        Ok(sweep)
    }

    /// Settings of each training, without doubles.
    fn combinations(&self) -> Vec<BTreeMap<String, toml::Value>> {
        let mut out = vec![BTreeMap::new()];
        if self.mode == Mode::Grid {
            for (key, values) in &self.settings {
                let Values::List(list) = values else { continue };
                let with = |base: &BTreeMap<String, toml::Value>, value: &toml::Value| {
                    let mut one = base.clone();
                    one.insert(key.clone(), value.clone());
                    one
                };
                out = out.iter().flat_map(|base| list.iter().map(move |value| with(base, value))).collect();
            }
        } else {
            let mut rng = fastrand::Rng::with_seed(self.seed);
            let mut draw = |values: &Values| match values {
                Values::List(list) => list[rng.usize(..list.len())].clone(),
                Values::Span(span) => span.draw(rng.f64()),
            };
            out = (0..self.samples)
                .map(|_| self.settings.iter().map(|(key, values)| (key.clone(), draw(values))).collect())
                .collect();
        }
        let mut names = std::collections::BTreeSet::new();
        out.retain(|settings| names.insert(folder_name(settings)));
        out
    }
}

impl Span {
    fn ends(&self) -> Option<[f64; 2]> {
        let number = |v: &toml::Value| v.as_float().or(v.as_integer().map(|i| i as f64));
        Some([number(&self.min)?, number(&self.max)?])
    }

    fn is_usable(&self) -> bool {
        self.ends().is_some_and(|[lo, hi]| lo < hi && hi.is_finite() && lo.is_finite() && (!self.log || lo > 0.0))
    }

    /// `at` in 0..1.
    fn draw(&self, at: f64) -> toml::Value {
        let [lo, hi] = self.ends().expect("checked when read");
        let value = if self.log { (lo.ln() + at * (hi / lo).ln()).exp() } else { lo + at * (hi - lo) };
        if self.min.is_integer() && self.max.is_integer() {
            return toml::Value::Integer((value.round() as i64).clamp(lo as i64, hi as i64));
        }
        // Three digits: names that people can read.
        toml::Value::Float(format!("{value:.2e}").parse().expect("a number"))
    }
}

/// `learning_rate=0.001,net.rnn_hidden=100`, with nothing in it that a file system dislikes.
fn folder_name(settings: &BTreeMap<String, toml::Value>) -> String {
    let pairs: Vec<String> = settings.iter().map(|(key, value)| format!("{key}={value}")).collect();
    let name: String = pairs
        .join(",")
        .chars()
        .filter(|c| !c.is_whitespace() && *c != '"')
        .map(|c| if c.is_ascii_alphanumeric() || ".,=_-+".contains(c) { c } else { '_' })
        .collect();
    if name.len() <= 150 { name } else { format!("{}-{}", &name[..110], hingecast::stage::stamp(&[&name])) }
}

/// Runs the sweep into `out`: a folder per combination, then `sweep.json`, `sweep.md` and
/// `sweep_<setting>.svg`. Answers the rows, best first: by success where `score` gives it (the
/// success rate of the policy in this folder), else by validation loss. Likelihood is no guide to
/// success, so a sweep without `score` says which settings fit, not which succeed. `preset`, `file`
/// and `set` are what all have in common, as for [`resolve`]; the trainings share `threads`.
///
/// # Errors
/// Settings that do not exist, disk trouble, Ctrl-C. A training that diverges is a row of the
/// table, not an error.
///
/// # Panics
/// A sweep that [`Sweep::read`] would refuse; where the system starts no more threads.
pub fn run(
    sweep: &Sweep,
    preset: Preset,
    file: Option<&Path>,
    set: &[String],
    demos: &Demos,
    out: &Path,
    threads: usize,
    progress: &Progress,
    score: Option<&Score>,
) -> Result<Vec<Row>> {
    // All settings are resolved before the first training begins: a typing error must not wait an
    // hour.
    let mut jobs = Vec::new();
    for settings in sweep.combinations() {
        let pairs = set.iter().cloned().chain(settings.iter().map(|(key, value)| format!("{key}={value}")));
        let config = resolve(preset, file, &pairs.collect::<Vec<_>>())?;
        jobs.push(Job { folder: out.join(folder_name(&settings)), settings, config });
    }
    std::fs::create_dir_all(out).map_err(Failure::io(out))?;
    // Marks the folder as ours before anything is in it.
    write_json(&out.join("sweep.json"), &Vec::<Row>::new())?;

    let workers = threads.clamp(1, jobs.len());
    let next = AtomicUsize::new(0);
    let done: Arc<Vec<AtomicUsize>> = Arc::new(jobs.iter().map(|_| AtomicUsize::new(0)).collect());
    let total = jobs.iter().map(|job| job.config.steps).sum();
    let rows = Mutex::new(Vec::with_capacity(jobs.len()));
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads((threads / workers).max(1)).build();
                let pool = pool.expect("threads can be started");
                while let Some((i, job)) = {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    jobs.get(i).map(|job| (i, job))
                } {
                    match pool.install(|| job.run(demos, &share_of(progress, &done, i, total), score)) {
                        Err(failure) if failure.cancelled => return,
                        row => rows.lock().unwrap_or_else(|e| e.into_inner()).push(job.row(row)),
                    }
                }
            });
        }
    });
    progress.check()?;
    let mut rows: Vec<Row> = rows.into_inner().unwrap_or_else(|e| e.into_inner());
    let rank = |row: &Row| row.success.map(|s| -s).or(row.valid_loss).or(row.train_loss).unwrap_or(f64::INFINITY);
    rows.sort_by(|a, b| rank(a).total_cmp(&rank(b)).then(a.folder.cmp(&b.folder)));
    write(&rows, out)?;
    Ok(rows)
}

/// What one training reports counts for the whole; when the person wants to stop, every training
/// hears it.
fn share_of(progress: &Progress, done: &Arc<Vec<AtomicUsize>>, i: usize, total: usize) -> Progress {
    let cancel = Arc::new(AtomicBool::new(false));
    let (flag, done, progress) = (cancel.clone(), done.clone(), progress.clone());
    let sink = move |at: usize, _: usize, note: &str| {
        done[i].store(at, Ordering::Relaxed);
        let sum = done.iter().map(|d| d.load(Ordering::Relaxed)).sum();
        flag.store(progress.report(sum, total, note).is_err(), Ordering::Relaxed);
    };
    Progress::new(sink, cancel)
}

struct Job {
    settings: BTreeMap<String, toml::Value>,
    config: TrainConfig,
    folder: PathBuf,
}

/// Losses of the last iterate, and the success rate.
struct Scores {
    train_loss: f64,
    valid_loss: Option<f64>,
    success: Option<f64>,
}

impl Job {
    fn run(&self, demos: &Demos, progress: &Progress, score: Option<&Score>) -> Result<Scores> {
        let last = train(demos, &self.config, &self.folder, progress)?.last();
        let success = score.map(|score| score(&self.folder)).transpose()?;
        Ok(Scores { train_loss: last.train, valid_loss: last.valid, success })
    }

    fn row(&self, scores: Result<Scores>) -> Row {
        let folder = self.folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let empty = Row {
            folder,
            settings: self.settings.clone(),
            train_loss: None,
            valid_loss: None,
            success: None,
            failed: None,
        };
        match scores {
            Ok(Scores { train_loss, valid_loss, success }) => {
                Row { train_loss: Some(train_loss), valid_loss, success, ..empty }
            }
            Err(failure) => Row { failed: Some(format!("{} ({})", failure.what, failure.place)), ..empty },
        }
    }
}

/// The rows of one sweep as a Markdown table: success in per cent, losses as they are, `-` for what
/// is not known.
///
/// # Panics
/// Rows that set other keys than the first: those of two sweeps.
pub fn table(rows: &[Row]) -> String {
    let keys: Vec<&String> = rows.first().map_or(Vec::new(), |row| row.settings.keys().collect());
    let mut out = String::from("|");
    keys.iter().for_each(|key| out += &format!(" {key} |"));
    out += " success | validation loss | training loss |\n|";
    out += &"---|".repeat(keys.len() + 3);
    for row in rows {
        out += "\n|";
        keys.iter().for_each(|key| out += &format!(" {} |", row.settings[*key]));
        let number = |v: Option<f64>| v.map_or("-".to_string(), |v| format!("{v:.4}"));
        let success = row.success.map_or("-".to_string(), |s| format!("{:.1} %", 100.0 * s));
        let _ = match &row.failed {
            Some(why) => write!(out, " failed: {why} | - | - |"),
            None => write!(out, " {success} | {} | {} |", number(row.valid_loss), number(row.train_loss)),
        };
    }
    out + "\n"
}

fn write(rows: &[Row], out: &Path) -> Result<()> {
    write_json(&out.join("sweep.json"), &rows)?;
    let save = |name: &str, text: String| {
        let path = out.join(name);
        write_whole(&path, text.as_bytes()).map_err(Failure::io(&path))
    };
    save("sweep.md", table(rows))?;
    let keys: Vec<&String> = rows.first().map_or(Vec::new(), |row| row.settings.keys().collect());
    for key in keys {
        save(&format!("sweep_{}.svg", key.replace('.', "_")), plot_of(rows, key))?;
    }
    Ok(())
}

/// Score against one setting: numbers on a line, logarithmic where they span a decade; words in a
/// row.
fn plot_of(rows: &[Row], key: &str) -> String {
    let (name, score): (&str, fn(&Row) -> Option<f64>) = match rows.iter().any(|row| row.success.is_some()) {
        true => ("success rate", |row| row.success),
        false if rows.iter().any(|row| row.valid_loss.is_some()) => ("validation loss", |row| row.valid_loss),
        false => ("training loss", |row| row.train_loss),
    };
    let number = |v: &toml::Value| v.as_float().or(v.as_integer().map(|i| i as f64));
    let numbers: Option<Vec<f64>> = rows.iter().map(|row| number(&row.settings[key])).collect();
    let (title, places) = match numbers {
        Some(v) => {
            let (lo, hi) = v.iter().fold((f64::INFINITY, 0.0f64), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
            match lo > 0.0 && hi >= 10.0 * lo {
                true => (format!("log10 {key}"), v.into_iter().map(f64::log10).collect()),
                false => (key.to_string(), v),
            }
        }
        None => {
            let words: Vec<String> = rows.iter().map(|row| row.settings[key].to_string()).collect();
            let mut distinct = words.clone();
            distinct.sort();
            distinct.dedup();
            let place = |word: &String| distinct.iter().position(|d| d == word).unwrap_or_default() as f64;
            let legend: Vec<String> = distinct.iter().enumerate().map(|(i, word)| format!("{i}: {word}")).collect();
            (format!("{key} ({})", legend.join(", ")), words.iter().map(place).collect())
        }
    };
    let points = rows.iter().zip(places).filter_map(|(row, x): (&Row, f64)| Some((x, score(row)?))).collect();
    plot::points(&title, name, points)
}

#[cfg(test)]
mod tests;
