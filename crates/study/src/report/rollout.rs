//! `index.html` of a rollout: doubts first, then rates, paired differences, how episodes ended and
//! pictures of each end. One folder, no network.

use super::rollout_plot;
use crate::simulate::record::outcome_name;
use crate::simulate::rollout::{EpisodeResult, WorldResult};
use crate::simulate::short;
use hingecast::escape::escape;
use hingecast::failure::{Failure, Result};
use hingecast::report::html::{doubts, head};
use hingecast_geom::staging::write_whole;
use hingecast_policy::statistics::Paired;
use hingecast_sim::{Outcome, TaskKind, TaskSpec};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Half of an interval, in points, from which on the page says that the episodes are few.
const WIDE_POINTS: f64 = 5.0;
/// A part that ends so far from where the first world's ends is told, mm: a finger's width.
const FAR_MM: f64 = 15.0;

/// Everything that the page tells.
pub struct RolloutReport<'a> {
    /// Folder of the policy.
    pub policy: &'a Path,
    /// What it was asked to do, in every world.
    pub task: &'a TaskSpec,
    /// As for [`rollout`](crate::simulate::rollout::rollout).
    pub seed: u64,
    /// How long all episodes took on the clock, s.
    pub secs: f64,
    /// The first world is what the others are compared with.
    pub results: &'a [WorldResult],
}

/// Writes `index.html` into `folder`, where the strips and `rollout.json` are; answers its path.
///
/// # Errors
/// When the folder cannot be written.
///
/// # Panics
/// Several worlds with different numbers of episodes, or with none.
pub fn write(report: &RolloutReport, folder: &Path) -> Result<PathBuf> {
    let path = folder.join("index.html");
    write_whole(&path, page(report).as_bytes()).map_err(Failure::io(&path))?;
    Ok(path)
}

fn page(report: &RolloutReport) -> String {
    let results = report.results;
    let mut out = head(&format!("{} in {} worlds", file_name(report.policy), results.len()));
    doubts(&mut out, &found_doubts(report));
    rates(&mut out, results);
    differences(&mut out, results);
    let _ = write!(out, "<h2>Time to success</h2>{}", rollout_plot::success_over_time(results, report.task.horizon));
    ends(&mut out, results);
    pictures(&mut out, results);
    settings(&mut out, report);
    out + "</html>\n"
}

/// What a reader of the bare rates might overlook.
fn found_doubts(report: &RolloutReport) -> Vec<String> {
    let mut out = Vec::new();
    let Some(first) = report.results.first() else { return out };
    if report.task.kind == TaskKind::HingedBox {
        out.push("This task can be solved by lifting the object: success says little about a twin.".into());
    }
    if 2 * first.successes < first.episodes {
        out.push(format!("The policy fails in most episodes of '{}': differences to it say little.", first.name));
    }
    let half = 50.0 * (first.interval[1] - first.interval[0]);
    if half > WIDE_POINTS {
        let n = first.episodes;
        out.push(format!("{n} episodes are few: the rate of '{}' is known to +-{half:.0} points.", first.name));
    }
    for r in &report.results[1.min(report.results.len())..] {
        if let Some(gap) = r.end_gap_mm.filter(|g| *g > FAR_MM) {
            out.push(format!(
                "In '{}' the part ends {gap:.0} mm from where it ends in '{}': a success there is another one.",
                r.name, first.name
            ));
        }
    }
    out
}

fn rates(out: &mut String, results: &[WorldResult]) {
    let _ = write!(
        out,
        "<h2>Success</h2><table><tr><th>world</th><th>successes</th><th>rate</th><th>95 % interval (Wilson)</th><th></th>\
         <th>as true</th><th>95 % interval</th><th></th><th>median time to success</th><th>moved, share of the true range</th><th>end apart</th></tr>"
    );
    for r in results {
        let share = |count: usize, [lo, hi]: [f64; 2]| {
            let (rate, lo, hi) = (100.0 * count as f64 / r.episodes as f64, 100.0 * lo, 100.0 * hi);
            let drawn = rollout_plot::interval(rate, [lo, hi]);
            format!("<td class=n>{rate:.1} %</td><td class=n>{lo:.1} .. {hi:.1} %</td><td>{drawn}</td>")
        };
        let secs = r.median_secs_to_success.map_or("-".into(), |s| format!("{s:.1} s"));
        let gap = r.end_gap_mm.map_or("-".into(), |g| format!("{g:.1} mm"));
        let _ = write!(
            out,
            "<tr><td>{}</td><td class=n>{} / {}</td>{}{}<td class=n>{secs}</td><td class=n>{:.2}</td><td class=n>{gap}</td></tr>",
            escape(&r.name),
            r.successes,
            r.episodes,
            share(r.successes, r.interval),
            share(r.as_true, r.as_true_interval),
            r.mean_moved,
        );
    }
    let _ = write!(
        out,
        "</table><p>As true: the part ended where the true joint would have it, to half a pad (8.5 mm at most). End apart: median distance of the grasped spot from where it ended in the first world, same seed, both \
         successes. A compliant arm opens many a wrong hinge; where the part then is tells it.</p>"
    );
}

fn differences(out: &mut String, results: &[WorldResult]) {
    let Some((first, others)) = results.split_first().filter(|(_, others)| !others.is_empty()) else { return };
    let name = escape(&first.name);
    let _ = write!(
        out,
        "<h2>Paired differences to '{name}', same seeds</h2><table><tr><th>world</th><th>{name} - world, points</th>\
         <th>95 % interval (Tango)</th><th>both succeed</th><th>only {name}</th><th>only this world</th><th>neither</th>\
         <th>P (McNemar, exact)</th></tr>"
    );
    let won = |r: &WorldResult| -> Vec<bool> { r.results.iter().map(EpisodeResult::won).collect() };
    for r in others {
        let pairs = Paired::count(&won(first), &won(r));
        let c = pairs.compare();
        let [lo, hi] = c.interval.map(|x| 100.0 * x);
        let _ = write!(
            out,
            "<tr><td>{}</td><td class=n>{:+.1}</td><td class=n>{lo:+.1} .. {hi:+.1}</td><td class=n>{}</td>\
             <td class=n>{}</td><td class=n>{}</td><td class=n>{}</td><td class=n>{}</td></tr>",
            escape(&r.name),
            100.0 * c.difference,
            pairs.both,
            pairs.only_first,
            pairs.only_second,
            pairs.neither,
            if c.p_value < 1e-3 { format!("{:.0e}", c.p_value) } else { format!("{:.3}", c.p_value) },
        );
    }
    let _ = write!(out, "</table>");
}

/// All kinds of end that came up, in their order: success first.
fn kinds(results: &[WorldResult]) -> std::collections::BTreeSet<Outcome> {
    results.iter().flat_map(|r| r.outcomes.keys().copied()).collect()
}

fn ends(out: &mut String, results: &[WorldResult]) {
    let kinds = kinds(results);
    let _ = write!(out, "<h2>How the episodes ended</h2><table><tr><th>world</th>");
    for kind in &kinds {
        let _ = write!(out, "<th>{}</th>", outcome_name(*kind));
    }
    let _ = write!(out, "</tr>");
    for r in results {
        let _ = write!(out, "<tr><td>{}</td>", escape(&r.name));
        for kind in &kinds {
            let _ = write!(out, "<td class=n>{}</td>", r.outcomes.get(kind).copied().unwrap_or(0));
        }
        let _ = write!(out, "</tr>");
    }
    let _ = write!(out, "</table>");
}

/// Six moments of the first episode of each kind of end, world after world.
fn pictures(out: &mut String, results: &[WorldResult]) {
    for kind in kinds(results) {
        let _ = write!(out, "<h2>Pictures: {}</h2>", outcome_name(kind));
        for r in results {
            let Some(strip) = r.strips.get(&kind) else { continue };
            let Some(episode) = r.results.iter().find(|e| e.outcome == kind) else { continue };
            let caption = format!(
                "{}: seed {}, {:.1} s, moved {:.2} of the true range; {} of {} episodes ended so",
                escape(&r.name),
                episode.seed,
                rollout_plot::secs(episode.steps),
                episode.moved,
                r.outcomes[&kind],
                r.episodes
            );
            let _ = write!(
                out,
                "<figure><img src=\"{}\" alt=\"{caption}\"><figcaption>{caption}</figcaption></figure>",
                escape(&file_name(strip))
            );
        }
    }
}

fn settings(out: &mut String, report: &RolloutReport) {
    let task = report.task;
    let [x, y, yaw] = task.spread;
    let episodes: usize = report.results.iter().map(|r| r.episodes).sum();
    let _ = write!(out, "<h2>Settings</h2><table>");
    let mut row = |name: &str, value: String| {
        let _ = write!(out, "<tr><td>{}</td><td>{value}</td></tr>", escape(name));
    };
    row("policy", code(report.policy));
    row(
        "task",
        format!(
            "{}, joint '{}', at most {:.0} s",
            task.kind.name(),
            escape(&task.joint),
            rollout_plot::secs(task.horizon)
        ),
    );
    row("size", format!("{} simulated metres per unit of the file", short(task.scale)));
    row(
        "grasp",
        format!(
            "{:.0} mm thick; the wrist {}",
            1e3 * task.width,
            if task.turn_wrist { "turns with the part" } else { "keeps level" }
        ),
    );
    row("place", format!("drawn +-{:.0} mm, +-{:.0} mm, +-{:.0} deg", 1e3 * x, 1e3 * y, yaw.to_degrees()));
    row("seed", format!("{}; episode k has the same seed in every world", report.seed));
    for r in report.results {
        let build = r.object.parent().and_then(Path::parent).map(|run| run.join("report/index.html"));
        let build = build.filter(|page| page.is_file());
        let link = build.map_or(String::new(), |page| format!(" (<a href=\"{}\">its report</a>)", file_url(&page)));
        row(&format!("world '{}'", r.name), code(&r.object) + &link);
    }
    let _ = write!(
        out,
        "</table><p>{episodes} episodes in {:.1} s, hingecast {}. Every episode: <a href=\"rollout.json\">rollout.json</a>.</p>",
        report.secs,
        env!("CARGO_PKG_VERSION")
    );
}

fn code(path: &Path) -> String {
    format!("<code>{}</code>", escape(&path.display().to_string()))
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// An absolute path as a link; what has a meaning in addresses is written as its number.
fn file_url(path: &Path) -> String {
    let plain = |b: u8| b.is_ascii_alphanumeric() || b"/-_.~".contains(&b);
    let bytes = path.as_os_str().as_encoded_bytes().iter();
    let text = bytes.map(|&b| if plain(b) { (b as char).to_string() } else { format!("%{b:02X}") });
    format!("file://{}", text.collect::<String>())
}
