//! What `check` found, for a person who would rather look than read.

use super::raw_depths::RawDepths;
use super::sheet::{SHEET_CAPTION, write_contact_sheet};
use crate::escape::escape;
use crate::failure::{Failure, Result};
use crate::report::html::{doubts, head};
use glam::{DVec2, DVec3};
use hingecast_articulate::{Depths, OBJECT};
use hingecast_capture::check::CheckReport;
use hingecast_capture::{Recording, Split};
use hingecast_geom::staging::write_whole;
use std::fmt::Write as _;
use std::path::Path;

/// Points of a state in the picture from above, about.
const POINTS: usize = 1500;
/// Edge of the picture from above, pixels.
const EDGE: f64 = 640.0;

/// Writes the page, and the contact sheet beside it, as `NAME.png`.
///
/// # Errors
/// A picture that cannot be read, a file that cannot be written.
pub fn write_page(recording: &Path, report: &CheckReport, page: &Path) -> Result<()> {
    let mut out = head(&format!("check {}", recording.display()));
    doubts(&mut out, &report.summary().iter().map(ToString::to_string).collect::<Vec<_>>());
    if let Ok(recording) = Recording::open(recording) {
        let sheet = page.with_extension("png");
        write_contact_sheet(&recording, &sheet)?;
        let name = sheet.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let _ = write!(
            out,
            "<h2>Pictures and masks</h2><figure><img src=\"{0}\" alt=\"{0}\"><figcaption>{SHEET_CAPTION}</figcaption></figure>",
            escape(&name)
        );
        from_above(&mut out, &recording)?;
    }
    shared(&mut out, &report.shared);
    let _ = write!(out, "<h2>Frames</h2><table><tr><th>state<th>usable<th>partly hidden<th>occluded<th>held out</tr>");
    for s in &report.states {
        let _ = write!(
            out,
            "<tr><td class=n>{}<td class=n>{}<td class=n>{}<td class=n>{}<td class=n>{}</tr>",
            s.state, s.usable, s.partly_hidden, s.occluded, s.test
        );
    }
    let _ = writeln!(out, "</table></html>");
    write_whole(page, out.as_bytes()).map_err(Failure::io(page))
}

/// Which states disagree: how much of the surface of each the others see where it is.
fn shared(out: &mut String, shared: &[Vec<f64>]) {
    if shared.len() < 2 {
        return;
    }
    let heads: String = (0..shared.len()).map(|state| format!("<th>{state}")).collect();
    let _ = write!(out, "<h2>What agrees with what</h2><table><tr><th>state{heads}</tr>");
    for (state, row) in shared.iter().enumerate() {
        let _ = write!(out, "<tr><th>{state}");
        for (other, share) in row.iter().enumerate() {
            let percent = (100.0 * share).round();
            let hue = (120.0 * share).round();
            let _ = match other == state {
                true => write!(out, "<td>"),
                false => write!(out, "<td class=n style=\"background:hsl({hue} 70% 85%)\">{percent}"),
            };
        }
        let _ = write!(out, "</tr>");
    }
    let _ = write!(
        out,
        "</table><p>Of the surface of a state (row), the percentage that another (column) sees at the same place, against \
         what its own views do. What moved lowers it; a state that is low in its row and its column lies apart.</p>"
    );
}

/// All states' surfaces over each other and where their cameras stood, seen along up.
fn from_above(out: &mut String, recording: &Recording) -> Result<()> {
    let up = recording.up.normalize_or(DVec3::Z);
    let (a, b) = up.any_orthonormal_pair();
    let flat = |x: DVec3| DVec2::new(x.dot(a), -x.dot(b));
    let mut depths = RawDepths::masked(recording);
    let (mut surface, mut cameras) = (Vec::new(), Vec::new());
    for state in 0..recording.n_states {
        let Ok(views) = depths.views(state) else { continue };
        let step = (views.iter().map(|v| v.depth.len()).sum::<usize>() / POINTS).max(1);
        for view in &views {
            let w = view.camera.width;
            for i in (step / 2..view.depth.len()).step_by(step).filter(|&i| view.class[i] == OBJECT) {
                let uv = DVec2::new((i % w) as f64 + 0.5, (i / w) as f64 + 0.5);
                surface.push((state, flat(view.camera.unproject(uv, f64::from(view.depth[i])))));
            }
        }
    }
    for f in recording.frames.iter().filter(|f| f.split == Split::Train && !f.occluded) {
        cameras.push((f.state, flat(f.camera.centre())));
    }
    let all = surface.iter().chain(&cameras).map(|(_, x)| *x);
    let (lo, hi) = all.fold((DVec2::INFINITY, DVec2::NEG_INFINITY), |(lo, hi), x| (lo.min(x), hi.max(x)));
    if surface.is_empty() || !((hi - lo).max_element() > 0.0) {
        return Ok(());
    }
    let scale = (EDGE - 20.0) / (hi - lo).max_element();
    let hue = |state: usize| 360 * state / recording.n_states.max(1);
    let _ = write!(
        out,
        "<h2>From above</h2><figure><svg width=\"{EDGE}\" height=\"{EDGE}\" role=\"img\" aria-label=\"states from above\">"
    );
    for (points, radius, opacity) in [(&surface, 1.0, 0.5), (&cameras, 3.5, 0.9)] {
        for (state, x) in points {
            let p = (*x - lo) * scale + 10.0;
            let _ = write!(
                out,
                "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{radius}\" fill=\"hsl({} 80% 40% / {opacity})\"/>",
                p.x,
                p.y,
                hue(*state)
            );
        }
    }
    let _ = write!(out, "</svg><figcaption>Small: the surface inside the masks; large: cameras. A colour a state: ");
    for state in 0..recording.n_states {
        let _ = write!(out, "<span style=\"color:hsl({} 80% 40%)\">{state}</span> ", hue(state));
    }
    let _ = write!(out, "- what stands still should lie on itself, and cameras on all sides.</figcaption></figure>");
    Ok(())
}
