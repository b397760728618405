//! `hingecast mask`

use super::{Outcome, Session};
use crate::cli::Mask;
use hingecast::failure::{Failure, Result};
use hingecast::prepare;
use hingecast_capture::Recording;
use hingecast_capture::recording::masked;

pub fn run(session: &Session, args: &Mask) -> Result<Outcome> {
    let mut recording = Recording::open(&args.recording)?;
    if !recording.registered {
        let hint = "hingecast import brings scans into one frame: hingecast import SCAN SCAN ... -o RECORDING";
        let what = "the states have a world each: register them first";
        return Err(Failure::new(what, recording.root.display().to_string(), hint));
    }
    if let Some(i) = recording.frames.iter().position(|f| f.mask.is_some()) {
        let hint = "the recording has masks already: take mask_path out of transforms.json to look for the object anew";
        let place = format!("{}: frames[{i}].mask_path", recording.root.display());
        return Err(Failure::new("nothing was written", place, hint));
    }
    let folder = masked::new_folder(&recording)?;
    let report = prepare::find_masks(&mut recording, &folder, args.seed, &session.ui.stage("mask"))?;
    masked::write(&recording)?;
    let sheet = folder.with_extension("png");
    prepare::contact_sheet(&recording)?.save(&sheet).map_err(Failure::io(&sheet))?;
    report.doubts.iter().for_each(|d| session.ui.say(&format!("doubt: {d}")));
    session.ui.say(&format!("masks -> {}\nlook: {}", folder.display(), sheet.display()));
    session.answer(&serde_json::json!({ "masks": folder, "sheet": sheet, "report": report }))?;
    Ok(Outcome::Done)
}
