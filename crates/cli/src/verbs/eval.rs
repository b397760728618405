//! `hingecast eval`

use super::{Outcome, Session, table};
use crate::cli::Eval;
use hingecast::eval::{Evaluation, evaluate};
use hingecast::failure::{Failure, Result};

pub fn run(session: &Session, args: &Eval) -> Result<Outcome> {
    // A typo is noticed now and not after the work.
    let bars = args.bars.iter().map(|text| Bar::read(text)).collect::<Result<Vec<_>>>()?;
    let evaluation = evaluate(&args.run, &args.truth, &session.ui.stage("eval"))?;
    session.ui.say(&table::detail(&evaluation));
    session.answer(&evaluation)?;
    let mut outcome = Outcome::Done;
    for (bar, text) in bars.iter().zip(&args.bars) {
        let (value, kept) = bar.judge(&evaluation);
        if !kept {
            session.ui.say(&format!("under the bar: {text}, measured {value:.4}"));
            outcome = Outcome::UnderBar;
        }
    }
    Ok(outcome)
}

/// What `--fail-under` asks for.
enum Bar {
    /// At most, degrees.
    AxisDeg(f64),
    /// At most, share of the diagonal.
    Pivot(f64),
    /// At least, dB.
    Psnr(f64),
    /// The part count must be right.
    Parts,
}

impl Bar {
    fn read(text: &str) -> Result<Self> {
        let wrong = || {
            let hint = "joint.axis_deg, joint.pivot, psnr or parts, for instance joint.axis_deg=1";
            Failure::new(format!("'{text}' is not a bar"), "--fail-under", hint)
        };
        let (key, limit) = text.split_once('=').ok_or_else(wrong)?;
        let limit: f64 = limit.parse().ok().filter(|l: &f64| l.is_finite()).ok_or_else(wrong)?;
        Ok(match key {
            "joint.axis_deg" => Self::AxisDeg(limit),
            "joint.pivot" => Self::Pivot(limit),
            "psnr" => Self::Psnr(limit),
            "parts" => Self::Parts,
            _ => return Err(wrong()),
        })
    }

    /// Measured value, and whether the bar is kept. Positive phrases: NaN keeps no bar.
    fn judge(&self, e: &Evaluation) -> (f64, bool) {
        match *self {
            Self::AxisDeg(limit) => (e.axis_max(), e.axis_max() <= limit),
            // Without a hinge there is no pivot to be off.
            Self::Pivot(limit) => e.pivot_max().map_or((0.0, true), |p| (p, p <= limit)),
            Self::Psnr(limit) => (e.first_state.psnr, e.first_state.psnr >= limit),
            Self::Parts => (e.found_parts as f64, e.parts_right()),
        }
    }
}
