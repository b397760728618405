//! `hingecast mask`

use super::{Outcome, Session};
use crate::cli::Mask;
use hingecast::failure::{Failure, Result};
use hingecast::prepare;
use hingecast::prepare::Wanted;
use hingecast_capture::Recording;
use hingecast_capture::recording::masked;
use hingecast_geom::staging::Staging;
use std::path::Path;

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
    let folder = masked::free_folder(&recording);
    let staging = Staging::new(&folder).map_err(Failure::io(&folder))?;
    let progress = session.ui.stage("mask");
    // Cameras that drifted are corrected for the search alone: the poses of the recording stay.
    let mut settled = recording.clone();
    prepare::settle(&mut settled, false, &progress)?;
    let report = prepare::find_masks(&mut settled, &wanted, &staging.path(), args.seed, &progress)?;
    drop(progress);
    let sheet = folder.with_extension("png");
    prepare::write_contact_sheet(&settled, &sheet)?;
    staging.finish().map_err(Failure::io(&folder))?;
    for (frame, found) in recording.frames.iter_mut().zip(settled.frames) {
        frame.mask = found.mask.as_deref().and_then(Path::file_name).map(|name| folder.join(name));
        frame.mask_ids = found.mask_ids;
    }
    // Last: a recording points to masks that are all there.
    masked::write(&recording)?;
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
