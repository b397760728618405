//! Joint values over states as an SVG plot.

use super::draw::PALETTE;
use crate::chart::{color, svg};
use hingecast_geom::KinematicTree;
use plotters::prelude::*;

/// Two panels' worth of lines in one: degrees for hinges, per cent of the diagonal for slides.
pub fn joint_values(tree: &KinematicTree, diagonal: f64) -> String {
    let n = tree.joints.iter().map(|j| j.values.len()).max().unwrap_or(0);
    if n == 0 {
        return String::new();
    }
    let series: Vec<(usize, Vec<(f64, f64)>)> = tree
        .joints
        .iter()
        .map(|j| {
            let unit = |v: f64| if j.screw.kind.turns() { v.to_degrees() } else { 100.0 * v / diagonal };
            (j.child, j.values.iter().enumerate().map(|(s, v)| (s as f64, unit(*v))).collect())
        })
        .collect();
    let all = || series.iter().flat_map(|s| s.1.iter().map(|p| p.1));
    let (lo, hi) = (all().fold(0.0, f64::min), all().fold(1.0, f64::max));
    svg((720, 260), |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(8)
            .x_label_area_size(32)
            .y_label_area_size(44)
            .build_cartesian_2d(0.0..(n - 1).max(1) as f64, lo..hi * 1.05)?;
        chart
            .configure_mesh()
            .x_desc("state")
            .y_desc("degrees (slides: % of the diagonal)")
            .light_line_style(WHITE)
            .draw()?;
        for (part, points) in &series {
            let color = color(PALETTE[part % PALETTE.len()]);
            chart.draw_series(LineSeries::new(points.iter().copied(), color.stroke_width(2)))?;
            chart.draw_series(points.iter().map(|p| Circle::new(*p, 3, color.filled())))?;
        }
        Ok(())
    })
}
