//! `hingecast mask`

use super::{Outcome, Session};
use crate::cli::Mask;
use hingecast::failure::{Failure, Result};
use hingecast::prepare;
use hingecast::prepare::Wanted;
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
    let wanted = wanted(args, &recording)?;
    let folder = masked::new_folder(&recording)?;
    let progress = session.ui.stage("mask");
    // Cameras that drifted are corrected for the search alone: the poses of the recording stay.
    let mut settled = recording.clone();
    prepare::settle(&mut settled, false, &progress)?;
    let report = prepare::find_masks(&mut settled, &wanted, &folder, args.seed, &progress)?;
    drop(progress);
    for (frame, found) in recording.frames.iter_mut().zip(settled.frames) {
        (frame.mask, frame.mask_ids) = (found.mask, found.mask_ids);
    }
    masked::write(&recording)?;
    let sheet = folder.with_extension("png");
    prepare::contact_sheet(&recording)?.save(&sheet).map_err(Failure::io(&sheet))?;
    report.doubts.iter().for_each(|d| session.ui.say(&format!("doubt: {d}")));
    session.ui.say(&format!("masks -> {}\nlook: {}", folder.display(), sheet.display()));
    session.answer(&serde_json::json!({ "masks": folder, "sheet": sheet, "report": report }))?;
    Ok(Outcome::Done)
}

/// What a person says about where the object is.
fn wanted(args: &Mask, recording: &Recording) -> Result<Wanted> {
    let refused = |flag: &str, text: &str, hint: &str| Failure::new("not understood", format!("{flag} {text}"), hint);
    if let Some(text) = &args.r#box {
        let hint = "six numbers, world frame, scene units: --box X0,Y0,Z0,X1,Y1,Z1, lowest and highest corner";
        let numbers: Option<Vec<f32>> = text.split(',').map(|x| x.trim().parse().ok()).collect();
        let six: Option<[f32; 6]> = numbers.and_then(|n| n.try_into().ok());
        let good = |n: &[f32; 6]| (0..3).all(|k| n[k].is_finite() && n[k + 3].is_finite() && n[k] < n[k + 3]);
        let [a, b, c, d, e, f] = six.filter(good).ok_or_else(|| refused("--box", text, hint))?;
        return Ok(Wanted::InBox([a, b, c], [d, e, f]));
    }
    let Some(text) = &args.at else { return Ok(Wanted::Moving) };
    let hint = "a picture and a pixel on the object: --at rgb/s000_v003.png:U,V";
    let parsed = text.rsplit_once(':').and_then(|(picture, pixel)| {
        let (u, v) = pixel.split_once(',')?;
        Some((picture, [u.trim().parse().ok()?, v.trim().parse().ok()?]))
    });
    let (picture, pixel) = parsed.ok_or_else(|| refused("--at", text, hint))?;
    Ok(Wanted::At(prepare::place_at(recording, picture, pixel)?))
}
