//! The page: plain HTML with its style inside, readable without scripts.

use super::{Content, draw::PALETTE};
use crate::escape::escape;
use crate::stage::RunFolder;
use glam::DVec3;
use hingecast_articulate::PassRecord;
use hingecast_geom::{Certainty, JointKind};
use std::fmt::Write as _;

const STYLE: &str = "
body{font:15px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:1100px;padding:0 1rem;color:#222}
h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:2rem}
table{border-collapse:collapse}td,th{padding:.25rem .7rem;text-align:left;border-bottom:1px solid #ddd}
td.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}
img{max-width:100%;display:block;margin:.3rem 0}figure{margin:0 0 1rem}figcaption{color:#555;font-size:.9rem}
.doubts{background:#fff4e0;border-left:4px solid #e69f00;padding:.6rem 1rem}
.fine{background:#e9f6ec;border-left:4px solid #009e73;padding:.6rem 1rem}
.chip{display:inline-block;width:.9em;height:.9em;border-radius:2px;margin-right:.4em;vertical-align:-.1em}
code{background:#f4f4f4;padding:0 .25em}";

/// Below the joints.
const FOOTNOTE: &str = "Values count from the first state, where every joint is 0. * One standard deviation: of fits without some of the \
     views each where depth is noisy, else of the fit; twice of it holds the truth in about 95 %. What all views of the first \
     state have in common, such as its own drift, is not in it. Nats are units of log-likelihood: 1 nat worse is e times less \
     likely, 10 nats 22 000 times; a rival less than 10 behind is not refuted.";

/// The page up to its heading.
pub fn head(title: &str) -> String {
    format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>{0}</title><style>{STYLE}</style><h1>{0}</h1>",
        escape(title)
    )
}

pub(crate) fn page(run: &RunFolder, content: &Content) -> String {
    let mut out = head(&content.twin.name);
    out.push_str("<p><a href=\"view.html\">Move its parts</a>: surfaces, collision pieces, axes, states.</p>");
    doubts(&mut out, &run.record.doubts);
    let _ = write!(out, "<h2>Parts and axes on the photos</h2>");
    for (file, caption) in &content.overlays {
        let _ =
            write!(out, "<figure><img src=\"{file}\" alt=\"{caption}\"><figcaption>{caption}</figcaption></figure>");
    }
    if run.folder(crate::prepare::STAGE).join("masks.png").is_file() {
        let _ = write!(
            out,
            "<h2>Masks that were found</h2><figure><img src=\"../{}/masks.png\" alt=\"masks\"><figcaption>{}</figcaption></figure>",
            crate::prepare::STAGE,
            crate::prepare::SHEET_CAPTION
        );
    }
    joints(&mut out, content);
    let _ = write!(out, "<h2>Joint values per state</h2>{}<p>", content.plot);
    for j in &content.twin.tree.joints {
        let _ = write!(out, "{}{} &emsp;", chip(j.child), escape(&j.name));
    }
    let _ = write!(out, "</p>");
    parts(&mut out, content);
    let _ = write!(out, "<h2>Held-out pictures: photo, twin, difference x 4</h2>");
    if content.held_out.is_empty() {
        let _ = write!(out, "<p>The recording names no test frames (<code>test_filenames</code>).</p>");
    }
    for h in &content.held_out {
        let _ = write!(
            out,
            "<figure><img src=\"{}\" alt=\"held-out view\"><figcaption>state {}, PSNR {:.1} dB</figcaption></figure>",
            h.file, h.state, h.psnr
        );
    }
    passes(&mut out, &content.trace);
    time(&mut out, run);
    out + "</html>\n"
}

/// The box of doubts, or the one that says that there are none.
pub fn doubts(out: &mut String, doubts: &[String]) {
    if doubts.is_empty() {
        let _ = write!(out, "<div class=\"fine\">No doubts were found. That is not proof: look at the pictures.</div>");
        return;
    }
    let _ = write!(out, "<div class=\"doubts\"><b>Doubts</b><ul>");
    for d in doubts {
        let _ = write!(out, "<li>{}</li>", escape(d));
    }
    let _ = write!(out, "</ul></div>");
}

fn chip(part: usize) -> String {
    let [r, g, b] = PALETTE[part % PALETTE.len()];
    format!("<span class=\"chip\" style=\"background:rgb({r},{g},{b})\"></span>")
}

fn joints(out: &mut String, content: &Content) {
    let (tree, unit) = (&content.twin.tree, content.unit());
    let _ = write!(
        out,
        "<h2>Joints</h2><table><tr><th>joint</th><th>type</th><th>carries</th><th>on</th><th>axis</th><th>pivot, {unit}</th>\
         <th>range seen</th><th>limits</th><th>sure of axis *</th><th>of pivot *</th><th>of values *</th><th>rival</th></tr>"
    );
    for (k, j) in tree.joints.iter().enumerate() {
        let sure = content.twin.certainty.get(k).and_then(Option::as_ref);
        let kind = j.screw.kind;
        let limits = if kind == JointKind::Continuous { "none".into() } else { span(kind, j.limits, unit) };
        let pivot = if kind.turns() { three(j.screw.pivot) } else { "-".into() };
        let _ = write!(
            out,
            "<tr><td>{}</td><td>{kind:?}</td><td>{}{}</td><td>{}</td><td>{}</td><td>{pivot}</td><td>{}</td><td>{limits}</td>{}</tr>",
            escape(&j.name),
            chip(j.child),
            escape(&tree.parts[j.child]),
            escape(&tree.parts[j.parent]),
            three(j.screw.axis),
            span(kind, j.seen(), unit),
            certainty(kind, sure, unit)
        );
    }
    let _ = write!(out, "</table><p>{FOOTNOTE}</p>");
    for c in &tree.couplings {
        let [a, b] = [c.follower, c.leader].map(|j| escape(&tree.joints[j].name));
        let terms = c.polynomial.iter().enumerate().filter(|(k, x)| *k < 2 || **x != 0.0);
        let sign = |x: f64| if x < 0.0 && !fixed(x, 4).starts_with('-') { 0.0 } else { x };
        let terms: Vec<String> = terms.map(|(k, x)| format!("{:+.4} q<sup>{k}</sup>", sign(*x))).collect();
        let _ = write!(
            out,
            "<p><b>{a}</b> follows <b>{b}</b>: its value is {} of the other's q (radians, units).</p>",
            terms.join(" ")
        );
    }
}

/// Lowest and highest value, degrees or lengths.
fn span(kind: JointKind, [lo, hi]: [f64; 2], unit: &str) -> String {
    match kind {
        JointKind::Fixed => "-".to_string(),
        JointKind::Prismatic => format!("{} .. {} {unit}", fixed(lo, 4), fixed(hi, 4)),
        _ => format!("{} .. {} deg", fixed(lo.to_degrees(), 1), fixed(hi.to_degrees(), 1)),
    }
}

fn three(x: DVec3) -> String {
    x.to_array().map(|x| fixed(x, 4)).join(" ")
}

/// With so many decimals, and no sign before a zero.
pub fn fixed(x: f64, decimals: usize) -> String {
    let text = format!("{x:.decimals$}");
    let zero = text.bytes().all(|b| b"-0.".contains(&b));
    if zero { text.trim_start_matches('-').to_string() } else { text }
}

/// Four cells: standard deviations of axis, pivot and values; what else the joint might be.
fn certainty(kind: JointKind, sure: Option<&Certainty>, unit: &str) -> String {
    let Some(c) = sure else { return "<td>-</td><td>-</td><td>-</td><td>-</td>".to_string() };
    let (pivot, value) = match kind.turns() {
        true => (format!("{:.1e} {unit}", c.pivot), format!("{:.3} deg", c.value.to_degrees())),
        false => ("-".to_string(), format!("{:.1e} {unit}", c.value)),
    };
    format!(
        "<td class=n>{:.3} deg</td><td class=n>{pivot}</td><td class=n>{value}</td><td>{:?}: {:.0} nats worse</td>",
        c.axis_deg, c.rival, c.nats
    )
}

fn parts(out: &mut String, content: &Content) {
    let (unit, mass) = (content.unit(), if content.metric { "kg" } else { "density x units&sup3;" });
    let _ = write!(
        out,
        "<h2>Parts</h2><table><tr><th>part</th><th>faces</th><th>hulls</th><th>volume, {unit}&sup3;</th><th>mass, {mass}</th>\
         <th>closed</th></tr>"
    );
    for (i, p) in content.twin.parts.iter().enumerate() {
        let _ = write!(
            out,
            "<tr><td>{}{}</td><td class=n>{}</td><td class=n>{}</td><td class=n>{:.6}</td><td class=n>{:.3}</td><td>{}</td></tr>",
            chip(i),
            escape(&p.name),
            p.faces,
            p.collision.len(),
            p.volume,
            p.mass,
            if p.open_edges == 0 { "yes".to_string() } else { format!("{} open edges", p.open_edges) }
        );
    }
    let _ = write!(out, "</table>");
}

/// What the passes of the search did, those that changed nothing together in one line.
fn passes(out: &mut String, trace: &[PassRecord]) {
    if trace.is_empty() {
        return;
    }
    let _ = write!(
        out,
        "<h2>How the joints were settled</h2><p>Passes in order, with how well the tree explains what moved (nats, higher is \
         better; counted on a few hundred samples). <code>--set 'passes.skip=[\"name\"]'</code> leaves one out.</p>\
         <table><tr><th>pass</th><th>round</th><th>parts</th><th>nats before</th><th>after</th><th>seconds</th></tr>"
    );
    let idle = |r: &&PassRecord| r.nats[0] == r.nats[1] && !r.skipped;
    for r in trace.iter().filter(|r| !idle(r)) {
        let _ = write!(
            out,
            "<tr><td>{}{}</td><td class=n>{}</td><td class=n>{}</td><td class=n>{:.0}</td><td class=n>{:.0}</td>\
             <td class=n>{:.2}</td></tr>",
            escape(&r.pass),
            if r.skipped { " (skipped)" } else { "" },
            r.round,
            r.parts,
            r.nats[0],
            r.nats[1],
            r.secs
        );
    }
    let rest: Vec<&PassRecord> = trace.iter().filter(idle).collect();
    let secs: f64 = rest.iter().map(|r| r.secs).sum();
    let _ = write!(
        out,
        "<tr><td>{} others, which changed nothing</td><td></td><td></td><td></td><td></td><td class=n>{secs:.2}</td></tr></table>",
        rest.len()
    );
}

fn time(out: &mut String, run: &RunFolder) {
    let _ = write!(
        out,
        "<h2>Time and memory</h2><table><tr><th>stage</th><th>seconds</th><th>peak memory so far</th></tr>"
    );
    for s in &run.record.stages {
        let _ = write!(
            out,
            "<tr><td>{}</td><td class=n>{:.1}</td><td class=n>{:.2} GB</td></tr>",
            s.name,
            s.secs,
            s.peak_memory as f64 / 1e9
        );
    }
    let _ = write!(
        out,
        "<tr><td>all</td><td class=n>{:.1}</td><td class=n>{:.2} GB</td></tr></table><p>{} threads, hingecast {}, recording <code>{}</code></p>",
        run.record.total_secs(),
        run.record.peak_memory() as f64 / 1e9,
        run.record.threads,
        escape(&run.record.version),
        escape(&run.record.recording.display().to_string())
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Axes once read "-0.0000 1.0000 -0.0000".
    #[test]
    fn zeros_have_no_sign() {
        assert_eq!(three(DVec3::new(-1e-9, 1.0, -0.5)), "0.0000 1.0000 -0.5000");
        assert_eq!(span(JointKind::Revolute, [-1e-5, 1.0], "m"), "0.0 .. 57.3 deg");
    }
}
