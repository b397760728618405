//! `hingecast import`

use super::{Outcome, Session};
use crate::cli::Import;
use hingecast::failure::Result;
use hingecast::prepare;
use hingecast_capture::Recording;
use hingecast_capture::import::{Config, Format, import};

pub fn run(session: &Session, args: &Import) -> Result<Outcome> {
    let mut sources = args.sources.clone();
    sources.extend(args.film.clone());
    let config = Config {
        format: Format::from_name(&args.format)?,
        min_confidence: args.min_confidence,
        every: args.every,
        max_views: args.max_views,
        film: args.film.as_ref().map(|_| args.film_pictures),
        masks: args.masks.clone(),
        mask_ids: args.mask_id.clone(),
    };
    let report = import(&sources, &args.out, &config, &session.ui.stage("import"))?;
    report.notes.iter().for_each(|note| session.ui.say(&format!("note: {note}")));
    session.ui.say(&format!(
        "imported {} frames in {} states -> {}",
        report.frames,
        report.states,
        report.recording.display()
    ));
    let mut recording = Recording::open_uncut(&report.recording)?;
    let (mut registration, mut states) = (None, report.states);
    if recording.film {
        let film = prepare::film(&mut recording, args.film_states, 0, &session.ui.stage("film"))?;
        session.ui.say(&prepare::sentence(&film.registration));
        prepare::film_sentences(&film).iter().for_each(|line| session.ui.say(line));
        (registration, states) = (Some(film.registration), recording.n_states);
    } else if !recording.registered && recording.n_states > 1 {
        let found = prepare::register(&mut recording, 0, &session.ui.stage("register"))?;
        let doubts = prepare::registration_doubts(&found);
        recording.doubts.extend(doubts.iter().cloned());
        recording.write()?;
        session.ui.say(&prepare::sentence(&found));
        doubts.iter().for_each(|doubt| session.ui.say(&format!("doubt: {doubt}")));
        registration = Some(found);
    }
    if prepare::Needs::of(&recording)?.masks {
        session.ui.say("no masks: build will look for the object; `hingecast mask` does it now and shows it");
    }
    session.ui.say(&format!("next: hingecast check {}", report.recording.display()));
    session.answer(&serde_json::json!({
        "recording": report.recording,
        "formats": report.formats,
        "states": states,
        "frames": recording.frames.len(),
        "notes": report.notes,
        "registration": registration,
    }))?;
    Ok(Outcome::Done)
}
