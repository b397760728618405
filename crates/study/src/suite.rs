//! Suites of objects: which, under which names, and recorded once.

use crate::host::Host;
use hingecast::failure::{Failure, Result};
use hingecast::stage::write_json;
use hingecast_capture::object::ArticulatedObject;
use hingecast_capture::synth::{SynthConfig, SynthReport, may_be_replaced, synth};
use hingecast_geom::staging::remove_folder;
use std::path::{Path, PathBuf};

/// An object of a suite.
pub struct Named {
    /// As on the command line: a name, or a path.
    pub argument: String,
    /// What its folders are called; no path.
    pub name: String,
}

/// What the folders of an object are called: after its own folder, or its file without the
/// extension, wherever that lies; `object` where the path has no name of its own.
pub fn name_of(argument: &str) -> String {
    let path = Path::new(argument);
    let own = if path.is_file() { path.file_stem() } else { path.file_name() };
    own.map_or_else(|| "object".to_string(), |n| n.to_string_lossy().into_owned())
}

/// Objects of the suites, each suite sorted: `ours` (the samples), `real` (PartNet-Mobility, in
/// `$HINGECAST_DATA`), `all` (both, or the samples alone without that variable), else the name or
/// path of one object. What is not there, or would share a folder with another, is noticed now and
/// not after an hour.
///
/// # Errors
/// An object or the samples that are nowhere, `real` without `HINGECAST_DATA`, two objects of one
/// name.
pub fn objects(suite: &[String]) -> Result<Vec<Named>> {
    let mut objects: Vec<Named> = Vec::new();
    for argument in arguments(suite)? {
        ArticulatedObject::resolve(&argument)?;
        let name = name_of(&argument);
        if let Some(twin) = objects.iter().find(|o| o.name == name) {
            return Err(Failure::new(
                format!("two objects are named {name}"),
                format!("{} and {argument}", twin.argument),
                "give their folders instead of their files, or each an --out of its own",
            ));
        }
        objects.push(Named { argument, name });
    }
    Ok(objects)
}

fn arguments(suite: &[String]) -> Result<Vec<String>> {
    let mut out = Vec::new();
    for name in suite {
        match name.as_str() {
            "ours" => out.extend(listed(&ours()?)),
            "real" => out.extend(real()?),
            "all" => {
                out.extend(listed(&ours()?));
                out.extend(real().unwrap_or_default());
            }
            object => out.push(object.to_string()),
        }
    }
    Ok(out)
}

fn ours() -> Result<PathBuf> {
    let box_file = ArticulatedObject::resolve("hinged_box")?;
    let folder = if box_file.is_dir() { box_file } else { box_file.parent().unwrap_or(Path::new(".")).to_path_buf() };
    Ok(folder.parent().unwrap_or(Path::new(".")).to_path_buf())
}

fn real() -> Result<Vec<String>> {
    let hint = "set HINGECAST_DATA to the folder that holds partnet-mobility-dev";
    let data = std::env::var("HINGECAST_DATA").map_err(|_| Failure::new("no real objects", "HINGECAST_DATA", hint))?;
    Ok(listed(&Path::new(&data).join("partnet-mobility-dev")))
}

fn listed(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> =
        entries.filter(|e| e.path().is_dir()).map(|e| e.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// Records an object, by a name or a path.
///
/// # Errors
/// An object that cannot be loaded, an output folder that holds something else, disk trouble, the
/// wish to stop.
pub fn record(host: &Host, object: &str, config: &SynthConfig, out: &Path) -> Result<SynthReport> {
    let object = hingecast::objects::load(&ArticulatedObject::resolve(object)?)?;
    object.notes.iter().for_each(|note| host.watcher.say(&format!("note: {note}")));
    let report = synth(&object, config, out, &host.watcher.stage("record"))?;
    report.notes.iter().for_each(|note| host.watcher.say(&format!("note: {note}")));
    Ok(report)
}

/// Records, unless a recording with the same settings lies there. The settings are noted beside it,
/// in `RECORDING.synth.json`; that it is the same object, the caller's folders must tell.
///
/// # Errors
/// Those of [`record`]; a note that cannot be removed or written.
pub fn record_once(host: &Host, argument: &str, config: &SynthConfig, recording: &Path) -> Result<()> {
    let note = note_of(recording);
    let settings = serde_json::to_value(config).expect("plain data");
    let noted: Option<serde_json::Value> = std::fs::read(&note).ok().and_then(|b| serde_json::from_slice(&b).ok());
    if noted.as_ref() == Some(&settings) && recording.join("transforms.json").exists() {
        return Ok(());
    }
    // The old note must not stand beside the new recording, should this be killed between the two.
    if note.exists() {
        std::fs::remove_file(&note).map_err(Failure::io(&note))?;
    }
    record(host, argument, config, recording)?;
    write_json(&note, &settings)
}

/// Deletes what [`record_once`] recorded, and tells the watcher where it cannot. A folder without
/// its note, or one that holds anything else, stays: a recording may have been refused just because
/// of what lies there.
pub fn tidy(host: &Host, recording: &Path) {
    let note = note_of(recording);
    if !note.is_file() || !recording.is_dir() {
        return;
    }
    let removed = may_be_replaced(recording)
        .map_err(Failure::from)
        .and_then(|()| remove_folder(recording).map_err(Failure::io(recording)));
    match removed {
        Ok(()) => {
            let _ = std::fs::remove_file(note);
        }
        Err(failure) => host.watcher.say(&format!("kept {}: {}", recording.display(), failure.what)),
    }
}

/// The settings that a recording was made with, beside it.
fn note_of(recording: &Path) -> PathBuf {
    let mut name = recording.file_name().unwrap_or_default().to_os_string();
    name.push(".synth.json");
    recording.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder given by its path once was the folder that `--tidy` deletes.
    #[test]
    fn objects_given_by_paths_are_named_and_not_two_alike() {
        let dir = tempfile::tempdir().unwrap();
        let make = |shelf: &str| {
            let folder = dir.path().join(shelf).join("oven");
            std::fs::create_dir_all(&folder).unwrap();
            let text = "<mujoco><worldbody><geom type=\"sphere\" size=\"1\"/></worldbody></mujoco>";
            std::fs::write(folder.join("object.xml"), text).unwrap();
            folder.to_string_lossy().into_owned()
        };
        let (a, b) = (make("a"), make("b"));
        let named = objects(std::slice::from_ref(&a)).unwrap();
        assert_eq!((named[0].name.as_str(), named[0].argument.as_str()), ("oven", a.as_str()));
        assert_eq!(name_of(&format!("{a}/object.xml")), "object");
        let error = objects(&[a, b]).err().unwrap().to_string();
        assert!(error.contains("two objects are named oven") && error.lines().count() == 3, "{error}");
    }
}
