//! What is written appears whole or not at all, and nobody's files are lost on the way.

use hingecast_geom::staging::{Staging, is_temporary, probe, sweep_folder, write_through, write_whole};
use std::fs;
use std::path::{Path, PathBuf};

/// No system has so many processes.
const DEAD: &str = ".rec.hingecast-4294967295-0123456789abcdef";

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

fn fill(target: &Path, text: &str) {
    let staging = Staging::new(target).unwrap();
    fs::create_dir(staging.path().join("rgb")).unwrap();
    fs::write(staging.path().join("rgb/a.png"), text).unwrap();
    staging.finish().unwrap();
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap()
}

#[test]
fn a_folder_replaces_the_one_before_and_leaves_nothing_beside() {
    let dir = tempfile::tempdir().unwrap();
    let target = dir.path().join("v1.2");
    // Once, these were taken for leftovers and deleted.
    for neighbour in ["v1.2.part", "v1.2.tmp", "v1.tmp"] {
        fs::create_dir(dir.path().join(neighbour)).unwrap();
        fs::write(dir.path().join(neighbour).join("thesis.tex"), "years").unwrap();
    }
    fill(&target, "first");
    fs::write(target.join("old"), "").unwrap();
    fill(&target, "second");
    assert_eq!(read(&target.join("rgb/a.png")), "second");
    assert_eq!(names(&target), ["rgb"]);
    assert_eq!(names(dir.path()), ["v1.2", "v1.2.part", "v1.2.tmp", "v1.tmp"]);
}

#[test]
fn what_is_given_up_leaves_the_old_folder() {
    let dir = tempfile::tempdir().unwrap();
    let target = dir.path().join("rec");
    fill(&target, "first");
    let staging = Staging::new(&target).unwrap();
    fs::write(staging.path().join("half"), "").unwrap();
    assert_eq!(names(dir.path()).len(), 2);
    drop(staging);
    assert_eq!(names(dir.path()), ["rec"]);
    assert_eq!(read(&target.join("rgb/a.png")), "first");
}

#[cfg(unix)]
#[test]
fn a_link_stays_a_link() {
    let dir = tempfile::tempdir().unwrap();
    fs::create_dir(dir.path().join("disk")).unwrap();
    let (target, link) = (dir.path().join("disk/rec"), dir.path().join("rec"));
    fill(&target, "first");
    std::os::unix::fs::symlink(&target, &link).unwrap();
    fill(&link, "second");
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert_eq!(read(&target.join("rgb/a.png")), "second");
    let (file, link) = (dir.path().join("disk/a.json"), dir.path().join("a.json"));
    write_whole(&file, b"1").unwrap();
    std::os::unix::fs::symlink(&file, &link).unwrap();
    write_whole(&link, b"2").unwrap();
    assert_eq!(read(&file), "2");
}

/// A folder as a killed process leaves it.
fn leftover(dir: &Path, name: &str, mark: bool, contents: &[&str]) -> PathBuf {
    let container = dir.join(name);
    fs::create_dir(&container).unwrap();
    if mark {
        fs::write(container.join("hingecast-staging"), "").unwrap();
    }
    for content in contents {
        fs::create_dir(container.join(content)).unwrap();
        fs::write(container.join(content).join("a"), *content).unwrap();
    }
    container
}

#[test]
fn leftovers_go_if_they_are_ours_and_dead() {
    let dir = tempfile::tempdir().unwrap();
    let target = dir.path().join("rec");
    let alive = format!(".rec.hingecast-{}-0123456789abcdef", std::process::id());
    let unmarked = leftover(dir.path(), DEAD, false, &["new"]);
    let alive = leftover(dir.path(), &alive, true, &["new"]);
    let others = leftover(dir.path(), ".other.hingecast-4294967295-0123456789abcdef", true, &["new"]);
    let persons = leftover(dir.path(), ".rec.hingecast-notes-2024", true, &["new"]);
    let dead = leftover(dir.path(), ".rec.hingecast-4294967295-fedcba9876543210", true, &["new", "gone"]);
    let empty = leftover(dir.path(), ".rec.hingecast-4294967295-aaaaaaaaaaaaaaaa", false, &[]);
    fill(&target, "new");
    assert!([&unmarked, &alive, &others, &persons].iter().all(|path| path.join("new/a").is_file()));
    assert!(!dead.exists() && !empty.exists());
}

#[test]
fn a_lock_says_that_somebody_lives_whose_process_is_not_seen() {
    let dir = tempfile::tempdir().unwrap();
    let other = leftover(dir.path(), DEAD, true, &["new"]);
    let lock = fs::File::open(other.join("hingecast-staging")).unwrap();
    lock.lock().unwrap();
    fill(&dir.path().join("rec"), "new");
    assert!(other.exists());
    drop(lock);
    fill(&dir.path().join("rec"), "new");
    assert!(!other.exists());
}

#[test]
fn an_old_folder_that_was_renamed_away_comes_back() {
    let dir = tempfile::tempdir().unwrap();
    let target = dir.path().join("rec");
    leftover(dir.path(), DEAD, true, &["new", "old"]);
    // Killed between the two renames; the next process then fails before it is done.
    drop(Staging::new(&target).unwrap());
    assert_eq!(read(&target.join("a")), "old");
    assert_eq!(names(dir.path()), ["rec"]);
}

#[test]
fn files_are_written_whole() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.json");
    fs::write(dir.path().join("a.json.tmp"), "years").unwrap();
    fs::write(dir.path().join(".a.json.hingecast-4294967295-0123456789abcdef"), "half").unwrap();
    write_whole(&path, b"1").unwrap();
    write_through(&path, |at| fs::write(at, "2")).unwrap();
    let failed = write_through(&path, |at| {
        fs::write(at, "3")?;
        Err(std::io::Error::other("no"))
    });
    assert!(failed.is_err());
    probe(&path).unwrap();
    assert!(probe(&dir.path().join("nowhere/a.json")).is_err());
    assert_eq!(read(&path), "2");
    assert_eq!(names(dir.path()), ["a.json", "a.json.tmp"]);
    assert_eq!(read(&dir.path().join("a.json.tmp")), "years");
    let half = dir.path().join(".b.hingecast-4294967295-0123456789abcdef");
    fs::write(&half, "half").unwrap();
    assert!(is_temporary(half.file_name().unwrap()) && !is_temporary("a.json.tmp".as_ref()));
    sweep_folder(dir.path());
    assert_eq!(names(dir.path()), ["a.json", "a.json.tmp"]);
}
