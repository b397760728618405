//! What all our charts share: SVG in a string, colours, marks and frames of legends.

use plotters::coord::Shift;
use plotters::prelude::*;
use std::error::Error;

/// What is drawn on: an SVG text.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// Of a drawing function.
pub type Drawn = Result<(), Box<dyn Error>>;

/// The SVG that `draw` paints on white, width x height in pixels.
pub fn svg(size: (u32, u32), draw: impl FnOnce(&Area) -> Drawn) -> String {
    let mut out = String::new();
    {
        let area = SVGBackend::with_string(&mut out, size).into_drawing_area();
        let all = || -> Drawn {
            area.fill(&WHITE)?;
            draw(&area)?;
            Ok(area.present()?)
        };
        // Drawing into a string cannot fail.
        let _ = all();
    }
    out
}

/// 8-bit sRGB as the plotting library has it.
pub fn color([r, g, b]: [u8; 3]) -> RGBColor {
    RGBColor(r, g, b)
}

/// A legend's mark.
pub fn dot(color: RGBColor) -> impl Fn((i32, i32)) -> Circle<(i32, i32), i32> {
    move |(x, y)| Circle::new((x + 8, y), 4, color.filled())
}

/// The legend of the series that have a label.
pub fn legend<'a, X: Ranged, Y: Ranged>(
    chart: &mut ChartContext<'a, SVGBackend<'a>, Cartesian2d<X, Y>>,
    place: SeriesLabelPosition,
) -> Drawn {
    let mut labels = chart.configure_series_labels();
    Ok(labels.position(place).background_style(WHITE.mix(0.8)).border_style(BLACK.mix(0.3)).draw()?)
}
