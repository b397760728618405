//! Losses over steps, and scores over settings, as SVG plots.

use hingecast::chart::{color, dot, legend, svg};
use hingecast::report::draw::PALETTE;
use hingecast_policy::train::LossRecord;
use plotters::prelude::*;

/// A line or, without `lines`, points.
struct Series<'a> {
    name: &'a str,
    color: [u8; 3],
    points: Vec<(f64, f64)>,
    lines: bool,
}

/// Training and validation loss over steps.
pub fn losses(history: &[LossRecord]) -> String {
    let train = history.iter().map(|r| (r.step as f64, r.train)).collect();
    let valid = history.iter().filter_map(|r| Some((r.step as f64, r.valid?))).collect();
    let series = [
        Series { name: "training", color: PALETTE[7], points: train, lines: true },
        Series { name: "validation", color: PALETTE[1], points: valid, lines: true },
    ];
    chart(&series, "step", "loss")
}

/// Points with `x` and `y` as their axes' names.
pub fn points(x: &str, y: &str, points: Vec<(f64, f64)>) -> String {
    chart(&[Series { name: y, color: PALETTE[7], points, lines: false }], x, y)
}

/// Lowest and highest, a little apart even where all are equal.
fn range(values: impl Iterator<Item = f64>) -> std::ops::Range<f64> {
    let (lo, hi) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
    if !(lo <= hi) {
        return 0.0..1.0;
    }
    let margin = (0.04 * (hi - lo)).max(1e-9 * lo.abs()).max(1e-9);
    lo - margin..hi + margin
}

fn chart(series: &[Series], x: &str, y: &str) -> String {
    let all = || series.iter().flat_map(|s| &s.points);
    let (x_range, y_range) = (range(all().map(|p| p.0)), range(all().map(|p| p.1)));
    svg((720, 320), |area| {
        let mut chart = ChartBuilder::on(area)
            .margin(8)
            .x_label_area_size(32)
            .y_label_area_size(60)
            .build_cartesian_2d(x_range, y_range)?;
        // No trailing digits: 0.3, 200.
        let label = |v: &f64| ((v * 1e6).round() / 1e6).to_string();
        let mut mesh = chart.configure_mesh();
        mesh.x_desc(x).y_desc(y).x_label_formatter(&label).light_line_style(WHITE).draw()?;
        for Series { name, color: rgb, points, lines } in series {
            let color = color(*rgb);
            let drawn = if *lines {
                // A single validation has no line.
                if points.len() == 1 {
                    chart.draw_series([Circle::new(points[0], 3, color.filled())])?;
                }
                chart.draw_series(LineSeries::new(points.iter().copied(), color.stroke_width(2)))?
            } else {
                chart.draw_series(points.iter().map(|p| Circle::new(*p, 4, color.filled())))?
            };
            drawn.label(*name).legend(dot(color));
        }
        // One series is named by its axis, and a legend may hide a point.
        if series.len() > 1 {
            legend(&mut chart, SeriesLabelPosition::MiddleRight)?;
        }
        Ok(())
    })
}
