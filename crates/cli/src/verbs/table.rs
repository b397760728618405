//! Tables on the terminal.

use hingecast::eval::Evaluation;
use std::fmt::Write as _;

/// Everything about one run.
pub fn detail(e: &Evaluation) -> String {
    let mut out = format!(
        "{}: parts {} of {}, joint types {:.0} %, parents {:.0} %, diagonal {:.3}\n",
        e.object,
        e.found_parts,
        e.true_parts,
        100.0 * e.joint_type_accuracy,
        100.0 * e.tree_accuracy,
        e.diagonal
    );
    let _ = writeln!(
        out,
        "{:<14} {:>10} {:>10} {:>9} {:>10} {:>10} {:>9} {:>9} {:>10}",
        "joint", "true", "found", "axis deg", "pivot", "motion", "state", "range", "sweep max"
    );
    for j in &e.joints {
        let found = j.found_type.map_or("none".to_string(), |k| format!("{k:?}").to_lowercase());
        let _ = writeln!(
            out,
            "{:<14} {:>10} {:>10} {:>9.3} {:>10} {:>10.4} {:>9.4} {:>9.4} {:>10.4}",
            j.name,
            format!("{:?}", j.true_type).to_lowercase(),
            found,
            j.axis_deg,
            j.pivot.map_or("-".to_string(), |p| format!("{p:.5}")),
            j.motion_mean,
            j.state_mean,
            j.range_error,
            j.sweep_max
        );
    }
    let _ = writeln!(
        out,
        "{:<14} {:>9} {:>9} {:>9} {:>9} {:>8} {:>9} {:>7}",
        "surface", "CD", "floor", "CD seen", "floor", "F 1 %", "precision", "recall"
    );
    for s in &e.surfaces {
        let _ = writeln!(
            out,
            "{:<14} {:>9.3} {:>9.3} {:>9.3} {:>9.3} {:>8.3} {:>9.3} {:>7.3}",
            s.part, s.chamfer, s.floor, s.visible_chamfer, s.visible_floor, s.f_score, s.precision, s.recall
        );
    }
    let _ = writeln!(
        out,
        "(pivot, sweep: scene units; motion, state, range: degrees, of slides scene units; CD: 1e-3 square units, floor: what \
         sampling alone gives; docs/metrics.md defines them)"
    );
    for (name, p) in [("first state", &e.first_state), ("other states", &e.other_states)] {
        if p.pictures == 0 {
            let _ = writeln!(out, "{name:<13} no held-out pictures");
            continue;
        }
        let _ = writeln!(
            out,
            "{name:<13} {} held-out pictures: PSNR {:.2} dB, SSIM {:.4}, depth MAE {:.5} ({:.3} % of diagonal), mask IoU {:.4}, part mIoU {:.4}",
            p.pictures,
            p.psnr,
            p.ssim,
            p.depth_mae,
            100.0 * p.depth_mae / e.diagonal,
            p.mask_iou,
            p.label_miou
        );
    }
    let _ = write!(
        out,
        "all stages took {:.0} s, peak memory {:.2} GB, {} doubts",
        e.build_secs,
        e.peak_memory_gb,
        e.doubts.len()
    );
    out
}

/// One line per object, Markdown.
pub fn overview(evaluations: &[Evaluation]) -> String {
    let mut out = String::from(
        "| object | parts | types | axis deg (max) | pivot % (max) | motion | CD seen / floor (worst) | PSNR | depth MAE % | part mIoU | s | GB |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for e in evaluations {
        let motion: Vec<String> =
            e.joints
                .iter()
                .map(|j| {
                    if j.true_type.turns() {
                        format!("{:.2}°", j.motion_mean)
                    } else {
                        format!("{:.4}", j.motion_mean)
                    }
                })
                .collect();
        let worst = e
            .surfaces
            .iter()
            .max_by(|a, b| (a.visible_chamfer / a.visible_floor).total_cmp(&(b.visible_chamfer / b.visible_floor)));
        let _ = writeln!(
            out,
            "| {} | {} of {} | {:.0} % | {:.2} | {} | {} | {} | {:.1} | {:.3} | {:.3} | {:.0} | {:.2} |",
            e.object,
            e.found_parts,
            e.true_parts,
            100.0 * e.joint_type_accuracy,
            e.axis_max(),
            e.pivot_max().map_or("-".into(), |p| format!("{:.2}", 100.0 * p)),
            motion.join(", "),
            worst.map_or("-".into(), |s| format!("{:.2} / {:.2}", s.visible_chamfer, s.visible_floor)),
            e.first_state.psnr,
            100.0 * e.first_state.depth_mae / e.diagonal,
            e.first_state.label_miou,
            e.build_secs,
            e.peak_memory_gb
        );
    }
    out
}
