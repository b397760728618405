//! Plots of a rollout as SVG: a rate with its interval, and how many episodes have succeeded by
//! when.

use crate::simulate::rollout::{STEP_SECS, WorldResult};
use hingecast::chart::{color, dot, legend, svg};
use hingecast::report::draw::PALETTE;
use plotters::prelude::*;

/// Of the palette: strong ones first, the base's grey late.
const ORDER: [usize; 8] = [7, 1, 3, 5, 6, 2, 4, 0];

pub(super) fn secs(steps: usize) -> f64 {
    steps as f64 * STEP_SECS
}

/// A rate and its interval [%] on a line from 0 to 100.
pub(super) fn interval(rate: f64, [lo, hi]: [f64; 2]) -> String {
    format!(
        "<svg width=\"208\" height=\"16\" viewBox=\"-4 -8 208 16\"><path d=\"M0 0H200M0 -3V3M100 -3V3M200 -3V3\" stroke=\"#ccc\"/>\
         <path d=\"M{:.1} 0H{:.1}\" stroke=\"#0072b2\" stroke-width=\"3\"/>\
         <circle cx=\"{:.1}\" cy=\"0\" r=\"4\" fill=\"#0072b2\"/></svg>",
        2.0 * lo,
        2.0 * hi,
        2.0 * rate
    )
}

/// Share of all episodes that have succeeded by a time, a line a world; a little farther than the
/// last success.
pub(super) fn success_over_time(results: &[WorldResult], horizon: usize) -> String {
    let last = results.iter().flat_map(|r| &r.results).filter(|e| e.won()).map(|e| e.steps).max();
    let until = last.map_or(horizon, |steps| (steps + steps / 4).min(horizon));
    svg((720, 300), |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(8)
            .x_label_area_size(32)
            .y_label_area_size(44)
            .build_cartesian_2d(0.0..secs(until), 0.0..104.0)?;
        chart.configure_mesh().x_desc("time, s").y_desc("% of the episodes").light_line_style(WHITE).draw()?;
        for (k, r) in results.iter().enumerate() {
            let color = color(PALETTE[ORDER[k % ORDER.len()]]);
            let line = LineSeries::new(steps_up(r, until), color.stroke_width(2));
            chart.draw_series(line)?.label(&r.name).legend(dot(color));
        }
        legend(&mut chart, SeriesLabelPosition::MiddleRight)
    })
}

/// (s, %) corners of the stairs: up at every success, flat between.
fn steps_up(r: &WorldResult, until: usize) -> Vec<(f64, f64)> {
    let mut times: Vec<usize> = r.results.iter().filter(|e| e.won()).map(|e| e.steps).collect();
    times.sort_unstable();
    let percent = |k: usize| 100.0 * k as f64 / r.episodes as f64;
    let mut out = vec![(0.0, 0.0)];
    for (k, &t) in times.iter().enumerate() {
        out.extend([(secs(t), percent(k)), (secs(t), percent(k + 1))]);
    }
    out.push((secs(until), percent(times.len())));
    out
}
