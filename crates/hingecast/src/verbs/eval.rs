//! `hingecast eval`

use super::{Outcome, Session, table};
use crate::cli::Eval;
use hingecast::eval::{Evaluation, evaluate};
use hingecast::failure::{Failure, Result};

pub fn run(session: &Session, args: &Eval) -> Result<Outcome> {
    let evaluation = evaluate(&args.run, &args.truth, &session.ui.stage("eval"))?;
    session.ui.say(&table::detail(&evaluation));
    session.answer(&evaluation);
    let mut outcome = Outcome::Done;
    for bar in &args.bars {
        let (value, limit, fine) = judge(&evaluation, bar)?;
        if !fine {
            session.ui.say(&format!("under the bar: {bar}, measured {value:.4} (asked {limit})"));
            outcome = Outcome::UnderBar;
        }
    }
    Ok(outcome)
}

/// Measured value, limit, kept.
fn judge(e: &Evaluation, bar: &str) -> Result<(f64, f64, bool)> {
    let wrong = || {
        let hint = "joint.axis_deg, joint.pivot, psnr or parts, for instance joint.axis_deg=1";
        Failure::new(format!("'{bar}' is not a bar"), "--fail-under", hint)
    };
    let (key, limit) = bar.split_once('=').ok_or_else(wrong)?;
    let limit: f64 = limit.parse().map_err(|_| wrong())?;
    Ok(match key {
        "joint.axis_deg" => (e.axis_max(), limit, e.axis_max() <= limit),
        "joint.pivot" => e.pivot_max().map_or((0.0, limit, true), |p| (p, limit, p <= limit)),
        "psnr" => (e.first_state.psnr, limit, e.first_state.psnr >= limit),
        "parts" => (e.found_parts as f64, limit, e.parts_right()),
        _ => return Err(wrong()),
    })
}
