//! What is in a file of demonstrations: a list, a plot, and a replay that must reproduce the
//! recorded states to the bit.

use super::record::WorldArgs;
use hingecast::chart::svg;
use hingecast::failure::{Failure, Result};
use hingecast_geom::Progress;
use hingecast_policy::{Demos, Episode};
use hingecast_sim::{Env, Scene, SceneConfig, Start};
use plotters::prelude::*;
use rayon::prelude::*;
use serde::Serialize;

/// What came out of a replay.
#[derive(Clone, Debug, Serialize)]
pub struct Replayed {
    /// Episodes in the file.
    pub episodes: usize,
    /// Episodes of which every state came out with the same bits.
    pub equal: usize,
    /// Index of the first episode that did not, and its first step that differs, both from 0;
    /// `None` when all are equal.
    pub first_difference: Option<(usize, usize)>,
    /// Episodes whose replay ends in success.
    pub successes: usize,
}

/// Runs the recorded actions again from the recorded starts, episodes in parallel.
///
/// # Errors
/// When the object is gone or another one now, the file has no states or does not say where the
/// object stood, an action is not finite, or the person stops it.
pub fn replay(demos: &Demos, world: &WorldArgs, progress: &Progress) -> Result<Replayed> {
    let config = SceneConfig { object: world.object.clone(), spoil: Vec::new(), visuals: false };
    let scene = Scene::new(&config, &world.task)?;
    let done = std::sync::atomic::AtomicUsize::new(0);
    let results: Vec<Result<(Option<usize>, bool)>> = demos
        .episodes
        .par_iter()
        .enumerate()
        .map_init(
            || Env::new(&scene),
            |env, (i, episode)| {
                let k = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                progress.report(k, demos.episodes.len(), "")?;
                one(env, episode, i)
            },
        )
        .collect();
    let mut out = Replayed { episodes: results.len(), equal: 0, first_difference: None, successes: 0 };
    for (i, result) in results.into_iter().enumerate() {
        let (difference, success) = result?;
        out.equal += usize::from(difference.is_none());
        out.successes += usize::from(success);
        out.first_difference = out.first_difference.or(difference.map(|t| (i, t)));
    }
    Ok(out)
}

fn one(env: &mut Env, episode: &Episode, index: usize) -> Result<(Option<usize>, bool)> {
    let first = episode.states.first().ok_or_else(|| {
        Failure::new(
            "there are no states to replay from",
            format!("data/demo_{index}/states"),
            "record again: hingecast demos",
        )
    })?;
    if episode.model_file.is_empty() {
        return Err(Failure::new(
            "it is not known where the object stood",
            format!("data/demo_{index}, attribute model_file: not there"),
            "copy the attribute from the file that this one was made from, or record again: hingecast demos",
        ));
    }
    let place = Scene::place_in(&episode.model_file)?;
    env.start_from(&Start { place, state: first.clone() })?;
    let mut difference = None;
    for (t, (action, state)) in episode.actions.iter().zip(&episode.states).enumerate() {
        let same = env.state().iter().zip(state).all(|(a, b)| a.to_bits() == b.to_bits());
        if !same && difference.is_none() {
            difference = Some(t);
        }
        env.step(action)?;
    }
    Ok((difference, env.success()))
}

/// Axis title that stands in every [`plot()`], and tells it from other pictures.
pub const HEIGHT: &str = "gripper height, m";

/// Height of the gripper (m, world frame) over time (s) as SVG, every episode a line: pauses,
/// speeds and second tries show. Empty when no episode has `robot0_eef_pos`, or the height never
/// changes.
pub fn plot(demos: &Demos) -> String {
    let key = "robot0_eef_pos";
    let lines: Vec<Vec<(f64, f64)>> = demos
        .episodes
        .iter()
        .filter_map(|e| e.obs.get(key))
        .map(|rows| {
            let seconds = |t: usize| t as f64 / 20.0;
            rows.iter().enumerate().map(|(t, p)| (seconds(t), p.get(2).copied().unwrap_or(0.0))).collect()
        })
        .collect();
    let all = || lines.iter().flatten();
    let longest = all().map(|p| p.0).fold(1.0, f64::max);
    let (lo, hi) = all().fold((f64::MAX, f64::MIN), |(lo, hi), p| (lo.min(p.1), hi.max(p.1)));
    if lines.is_empty() || !(lo < hi) {
        return String::new();
    }
    svg((900, 360), |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(8)
            .x_label_area_size(32)
            .y_label_area_size(52)
            .build_cartesian_2d(0.0..longest, lo..hi)?;
        chart.configure_mesh().x_desc("time, s").y_desc(HEIGHT).light_line_style(WHITE).draw()?;
        for line in &lines {
            chart.draw_series(LineSeries::new(line.iter().copied(), BLUE.mix(0.25)))?;
        }
        Ok(())
    })
}
