//! Success against twin error: one point per object and world, one panel for each way to count.

use super::{Count, Row};
use hingecast::chart::{self, Area, Drawn, color, dot, svg};
use hingecast::report::draw::PALETTE;
use plotters::prelude::*;

/// Errors below this are drawn here: zero has no place on a logarithmic axis. Simulated mm.
const LEAST: f64 = 0.01;

/// SVG of two panels, success and as true (%), over [`TwinError::goal_mm`](super::TwinError), on a
/// logarithmic axis; each point with its 95 % interval. The true object, `back` and rows without
/// figures have no point.
pub fn success_against_error(rows: &[Row]) -> String {
    svg((1180, 460), |area| {
        let panels = area.split_evenly((1, 2));
        panel(&panels[0], rows, "success, %", |r| r.success.as_ref(), true)?;
        panel(&panels[1], rows, "as true, %", |r| r.as_true.as_ref(), false)
    })
}

fn panel(area: &Area, rows: &[Row], name: &str, count: impl Fn(&Row) -> Option<&Count>, legend: bool) -> Drawn {
    let most = rows.iter().filter_map(|r| Some(r.error?.goal_mm)).fold(100.0, f64::max);
    let mut chart = ChartBuilder::on(area)
        .margin(10)
        .x_label_area_size(36)
        .y_label_area_size(48)
        .build_cartesian_2d((LEAST * 0.7..most * 1.5).log_scale(), -4.0..104.0)?;
    chart
        .configure_mesh()
        .x_desc("where the task's end is off, mm (circle: our twin; triangle: classical; cross: spoiled)")
        .y_desc(name)
        .x_label_formatter(&|v: &f64| v.to_string())
        .y_label_formatter(&|v: &f64| format!("{v:.0}"))
        .light_line_style(WHITE)
        .draw()?;
    // What `as true` forgives: the axis is another distance, but of the same kind.
    let forgiven = 1e3 * hingecast_sim::path::TOLERANCE;
    chart.draw_series([PathElement::new([(forgiven, 0.0), (forgiven, 100.0)], BLACK.mix(0.3))])?;
    let mut objects: Vec<&str> = rows.iter().map(|r| r.object.as_str()).collect();
    objects.dedup();
    for (k, object) in objects.iter().enumerate() {
        // The first of the palette is the grey of the static part.
        let color = color(PALETTE[1 + k % (PALETTE.len() - 1)]);
        let points = rows.iter().filter(|row| row.object == *object).filter_map(|row| {
            let (count, error) = (count(row)?, row.error?);
            let rate = 100.0 * count.successes as f64 / row.episodes.max(1) as f64;
            Some((row, error.goal_mm.max(LEAST), rate, count.interval.map(|x| 100.0 * x)))
        });
        let points: Vec<_> = points.filter(|(row, ..)| row.world != "true").collect();
        for (row, x, y, [lo, hi]) in &points {
            chart.draw_series([PathElement::new([(*x, *lo), (*x, *hi)], color.mix(0.5))])?;
            match row.world.as_str() {
                "twin" => chart.draw_series([Circle::new((*x, *y), 6, color.filled())])?,
                "track" => chart.draw_series([TriangleMarker::new((*x, *y), 8, color.filled())])?,
                _ => chart.draw_series([Cross::new((*x, *y), 4, color.stroke_width(2))])?,
            };
        }
        // A line through the legend needs a series that draws nothing.
        let name = object.to_string();
        chart.draw_series(std::iter::empty::<Circle<(f64, f64), i32>>())?.label(name).legend(dot(color));
    }
    if legend {
        chart::legend(&mut chart, SeriesLabelPosition::LowerLeft)?;
    }
    Ok(())
}
