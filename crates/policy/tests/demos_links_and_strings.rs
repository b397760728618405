//! Demonstrations as others lay them out: links, masks, strings of every kind; shapes that lie.

use hingecast_policy::demos::{read, write};
use hingecast_policy::{Demos, Episode, PolicyError};
use rust_hdf5::format::LibverBound;
use rust_hdf5::{DatatypeMessage, H5File, H5Group};
use std::path::Path;

/// Link messages (what we write), and the symbol tables of files before HDF5 1.8, which h5py still
/// writes when nothing else is asked for.
const LAYOUTS: [Option<LibverBound>; 2] = [None, Some(LibverBound::Earliest)];

/// Three demonstrations, after `change` was made to them.
fn file(path: &Path, layout: Option<LibverBound>, change: impl Fn(&H5File)) {
    let options = H5File::options();
    let options = if let Some(bound) = layout { options.libver(bound) } else { options };
    let file = options.create(path).unwrap();
    let data = file.create_group("data").unwrap();
    data.set_attr_string("env_args", "{}").unwrap();
    for i in 0..3 {
        let demo = data.create_group(&format!("demo_{i}")).unwrap();
        table(&demo, "actions", 4, 7, 0.1 * f64::from(i));
        table(&demo.create_group("observations").unwrap(), "object", 4, 2, f64::from(i));
    }
    change(&file);
    file.close().unwrap();
}

fn table(group: &H5Group, name: &str, rows: usize, width: usize, value: f64) {
    let dataset = group.new_dataset::<f64>().shape([rows, width]).create(name).unwrap();
    dataset.write_raw(&vec![value; rows * width]).unwrap();
}

fn group(file: &H5File, path: &str) -> H5Group {
    file.root_group().group(path).unwrap()
}

/// `obs` of the demonstrations is a soft link, as `kind` says.
fn obs(file: &H5File, kind: &str) {
    for i in 0..3 {
        let target = kind.replace('#', &i.to_string());
        group(file, &format!("data/demo_{i}")).create_soft_link("obs", &target).unwrap();
    }
}

fn read_changed(layout: Option<LibverBound>, change: impl Fn(&H5File)) -> Result<Demos, PolicyError> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("d.hdf5");
    file(&path, layout, change);
    let demos = read(&path);
    if let Err(e) = &demos {
        assert_eq!(e.to_string().lines().count(), 3, "{e}");
        assert!(e.place.contains("d.hdf5, "), "{e}");
    }
    demos
}

/// h5py and robomimic do not notice a link; we said "data/demo_0/obs: not there".
#[test]
fn soft_links_are_followed() {
    for layout in LAYOUTS {
        for kind in ["/data/demo_#/observations", "observations", "./observations/", "/data//demo_#/./observations"] {
            let demos = read_changed(layout, |f| obs(f, kind)).unwrap();
            assert_eq!(demos.episodes[2].obs["object"], vec![vec![2.0; 2]; 4], "{kind}");
        }
        // A dataset, a demonstration, a mask, over two links.
        let demos = read_changed(layout, |f| {
            obs(f, "observations");
            let root = f.root_group();
            table(&root, "store", 4, 1, 0.5);
            root.create_soft_link("hop", "store").unwrap();
            group(f, "data/demo_1").create_soft_link("rewards", "/hop").unwrap();
            group(f, "data").create_soft_link("demo_3", "/data/demo_1").unwrap();
            let filters = f.create_group("filters").unwrap();
            filters.write_vlen_strings("train", &["demo_3", "demo_0"]).unwrap();
            root.create_soft_link("mask", "/filters").unwrap();
        });
        let demos = demos.unwrap();
        assert_eq!((demos.episodes.len(), &demos.episodes[1].rewards[..]), (4, &[0.5; 4][..]));
        assert_eq!(demos.episodes[3], demos.episodes[1]);
        assert_eq!(demos.masks["train"], ["demo_3", "demo_0"]);
    }
}

#[test]
fn hard_links_are_names_like_any_other() {
    let demos = read_changed(None, |f| {
        for i in 0..3 {
            let demo = group(f, &format!("data/demo_{i}"));
            demo.link("obs", &format!("data/demo_{i}/observations")).unwrap();
            demo.link("next_obs", &format!("data/demo_{i}/observations")).unwrap();
        }
    });
    let demos = demos.unwrap();
    assert_eq!(demos.episodes[1].obs["object"], vec![vec![1.0; 2]; 4]);
    assert_eq!(demos.episodes[1].obs, demos.episodes[1].next_obs);
}

/// As many as the HDF5 library follows: 16.
#[test]
fn circles_and_dead_ends_are_named() {
    let chain = |links: usize| {
        move |f: &H5File| {
            obs(f, "observations");
            let root = f.root_group();
            table(&root, "t0", 4, 1, 0.5);
            (1..links).for_each(|i| root.create_soft_link(&format!("t{i}"), &format!("t{}", i - 1)).unwrap());
            group(f, "data/demo_1").create_soft_link("rewards", &format!("/t{}", links - 1)).unwrap();
        }
    };
    for layout in LAYOUTS {
        let says = |change: &dyn Fn(&H5File), what: &str, place: &str| {
            let e = read_changed(layout, change).unwrap_err();
            assert!(e.what.starts_with(what) && e.place.ends_with(place), "{e}");
        };
        let there = "data/demo_0/obs: /data/demo_0/obs -> ";
        says(&|f| obs(f, "obs"), "links in a circle", &format!("{there}obs"));
        let two = |f: &H5File| {
            obs(f, "/a");
            f.create_soft_link("a", "/b").unwrap();
            f.create_soft_link("b", "/a").unwrap();
        };
        says(&two, "links in a circle", &format!("{there}/a"));
        says(&|f| obs(f, "/gone/obs"), "a link that leads nowhere", &format!("{there}/gone/obs"));
        // HDF5 has no name for the group above.
        says(&|f| obs(f, "../demo_0/observations"), "a link that leads nowhere", "../demo_0/observations");
        assert_eq!(read_changed(layout, chain(16)).unwrap().episodes[1].rewards, [0.5; 4]);
        says(&chain(17), "links in a circle, or more than 16", "/data/demo_1/rewards -> /t16");
    }
}

/// A file from elsewhere must not make us open other files, not even by a soft link to such a
/// link. It is there, and would be read.
#[test]
fn links_into_other_files_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let store = H5File::create(dir.path().join("store.hdf5")).unwrap();
    table(&store.root_group(), "rewards", 4, 1, 0.5);
    store.close().unwrap();
    for through in [false, true] {
        let path = dir.path().join("d.hdf5");
        file(&path, None, |f| {
            obs(f, "observations");
            let demo = group(f, "data/demo_1");
            if through {
                f.create_external_link("out", "store.hdf5", "/").unwrap();
                demo.create_soft_link("rewards", "/out/rewards").unwrap();
            } else {
                demo.create_external_link("rewards", "store.hdf5", "/rewards").unwrap();
            }
        });
        let e = read(&path).unwrap_err();
        assert_eq!(e.what, "a link into another file, which is not followed");
        assert!(e.place.contains("data/demo_1/rewards: ") && e.place.ends_with(" in store.hdf5"), "{e}");
    }
}

fn masks(names: &[(&'static str, &[&'static str])]) -> Result<Demos, PolicyError> {
    read_changed(None, |f| {
        obs(f, "observations");
        let group = f.create_group("mask").unwrap();
        names.iter().for_each(|(mask, names)| drop(group.write_vlen_strings(mask, names).unwrap()));
    })
}

/// Overlapping masks were taken without a word: what validated had been learnt by heart.
#[test]
fn masks_that_cannot_be_right_are_refused() {
    let says = |names: &[(&'static str, &[&'static str])], what: &str, place: &str| {
        let e = masks(names).unwrap_err();
        assert!(e.what == what && e.place.ends_with(place), "{e}");
    };
    let both = "demonstrations that both train and validate";
    let overlap: [(_, &[_]); 2] = [("train", &["demo_0", "demo_2", "demo_1"]), ("valid", &["demo_1", "demo_2"])];
    says(&overlap, both, "mask/train and mask/valid: demo_2, demo_1");
    says(&[("half", &["demo_2", "demo_2"])], "a mask names a demonstration twice", "mask/half: demo_2");
    let not_there = "a mask names a demonstration that is not there";
    says(&[("half", &["demo_2", "demo_3"])], not_there, "mask/half: demo_3");
    // Other subsets may share what they like.
    masks(&[("train", &["demo_0"]), ("20_percent", &["demo_0"])]).unwrap();
}

/// Written as NULL-terminated, NULL-padded and space-padded strings, ASCII and UTF-8.
#[test]
fn strings_of_fixed_length_are_read() {
    for layout in LAYOUTS {
        for (padding, fill) in [(0, 0), (1, 0), (2, b' ')] {
            for charset in [0, 1] {
                let filled = |text: &str, size: usize| {
                    let mut bytes = text.as_bytes().to_vec();
                    bytes.resize(size, fill);
                    bytes
                };
                let kind = |size: u32| DatatypeMessage::FixedString { size, padding, charset };
                let demos = read_changed(layout, |f| {
                    obs(f, "observations");
                    let text = filled("{\"env_name\": \"Lift\"}", 40);
                    group(f, "data").set_attr_typed("env_args", kind(40), text).unwrap();
                    let mask = f.create_group("mask").unwrap();
                    let names = mask.new_dataset::<u8>().datatype(kind(9)).shape([2]).create("train").unwrap();
                    names.write_raw_bytes(&[filled("demo_2", 9), filled("demo_0", 9)].concat()).unwrap();
                });
                let demos = demos.unwrap();
                assert_eq!(demos.env_args["env_name"], "Lift", "padding {padding}");
                assert_eq!(demos.masks["train"], ["demo_2", "demo_0"], "padding {padding}");
            }
        }
    }
}

/// Shapes are claims. A million billion rows of no numbers made a million billion empty rows.
#[test]
fn shapes_do_not_decide_how_much_memory_is_taken() {
    let e = read_changed(None, |f| {
        obs(f, "observations");
        let long = group(f, "data/demo_0/observations").new_dataset::<f64>();
        long.shape([1 << 33, 1]).chunk(&[1 << 22, 1]).create("long").unwrap();
    });
    let e = e.unwrap_err();
    assert_eq!(e.what, "a file that says it holds more than can be packed into it", "{e}");
    assert!(e.place.ends_with("data/demo_0/obs/long: shape [8589934592, 1]"), "{e}");
    for rows in [4, 1_000_000_000_000_000] {
        let e = read_changed(None, |f| {
            obs(f, "observations");
            let thin = group(f, "data/demo_0/observations").new_dataset::<f64>();
            thin.shape([rows, 0]).create("thin").unwrap();
        });
        let e = e.unwrap_err();
        assert_eq!(e.what, "rows without numbers");
        assert!(e.place.ends_with(&format!("data/demo_0/obs/thin: shape [{rows}, 0]")), "{e}");
    }
}

/// What we write: `H5Aread` of the HDF5 library could not read our attributes, since the base type
/// of their strings was a character instead of a byte. 0x10: whole number, one byte of 8 bits.
#[test]
fn our_strings_have_the_librarys_datatype() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("d.hdf5");
    // The letters that begin an object header may stand anywhere.
    let numbers: [u8; 8] = *b"OHDR\x02\x00\x78\x02";
    let episode = Episode {
        model_file: "<mujoco model=\"é\"/>".into(),
        actions: vec![[0.5; 7]; 3],
        obs: [("object".to_string(), vec![vec![f64::from_le_bytes(numbers)]; 3])].into(),
        ..Default::default()
    };
    let names = (0..12).map(|i| format!("demo_{i}")).collect();
    let masks = [("train".to_string(), names), ("valid".to_string(), Vec::new())].into();
    let demos = Demos { env_args: serde_json::json!({ "env_name": "é" }), episodes: vec![episode; 12], masks };
    write(&path, &demos).unwrap();
    assert_eq!(read(&path).unwrap(), demos);

    let bytes = std::fs::read(&path).unwrap();
    let count = |what: &[u8]| bytes.windows(what.len()).filter(|w| *w == what).count();
    assert_eq!(count(&[0x19, 1, 1, 0, 16, 0, 0, 0, 0x10, 0, 0, 0, 1, 0, 0, 0, 0, 0, 8, 0]), 13);
    assert_eq!((count(b"env_args\0"), count(b"model_file\0"), count(b"+str")), (1, 12, 0));
    // A string of 7 bytes filled up with zeros: the longest name of the mask.
    assert_eq!(count(&[0x13, 1, 0, 0, 7, 0, 0, 0]), 1);
}

/// HINGECAST_PYTHON names an interpreter with h5py: files with links that the HDF5 library wrote,
/// with the oldest, its usual and the newest layout; and our strings as it sees them.
#[test]
fn h5py_and_we_agree_on_links_and_strings() {
    let Ok(python) = std::env::var("HINGECAST_PYTHON") else {
        println!("skipped: HINGECAST_PYTHON names no interpreter with h5py, torch and robomimic");
        return;
    };
    let dir = tempfile::tempdir().unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts/policy_reference.py");
    let run = |verb: &str, path: &Path| {
        let said = std::process::Command::new(&python).arg(&script).arg(verb).arg(path).output().unwrap();
        assert!(said.status.success(), "{}", String::from_utf8_lossy(&said.stderr));
    };
    run("links", dir.path());
    let whole = read(&dir.path().join("plain_default.hdf5")).unwrap();
    let mut compared = 0;
    for entry in std::fs::read_dir(dir.path()).unwrap().flatten() {
        let demos = read(&entry.path()).unwrap_or_else(|e| panic!("{e}"));
        assert!(demos == whole, "{}", entry.path().display());
        compared += 1;
    }
    assert_eq!(compared, 15);
    let ours = dir.path().join("ours.hdf5");
    write(&ours, &whole).unwrap();
    run("strings", &ours);
}
