use super::*;
use hingecast_policy::Episode;

fn read(text: &str) -> Result<Sweep> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("sweep.toml");
    std::fs::write(&path, text).unwrap();
    Sweep::read(&path)
}

const GRID: &str = "mode = 'grid'\n[settings]\nlearning_rate = [1e-3, 1e-2]\n'net.rnn_hidden' = [4, 8]\n";

#[test]
fn a_grid_is_every_combination_once() {
    let names: Vec<String> = read(GRID).unwrap().combinations().iter().map(folder_name).collect();
    let all = ["0.001,net.rnn_hidden=4", "0.001,net.rnn_hidden=8", "0.01,net.rnn_hidden=4", "0.01,net.rnn_hidden=8"];
    assert_eq!(names, all.map(|n| format!("learning_rate={n}")));
}

#[test]
fn random_draws_stay_in_their_spans_and_follow_the_seed() {
    let text = |seed: u64| {
        format!(
            "mode = 'random'\nsamples = 40\nseed = {seed}\n[settings]\nbatch = {{ min = 10, max = 20 }}\n\
             learning_rate = {{ min = 1e-4, max = 1e-2, log = true }}\n'net.head' = ['gmm', 'gaussian']\n"
        )
    };
    let draws = read(&text(1)).unwrap().combinations();
    assert_eq!(draws.len(), 40);
    let rates: Vec<f64> = draws.iter().map(|d| d["learning_rate"].as_float().unwrap()).collect();
    assert!(rates.iter().all(|r| (1e-4..=1e-2).contains(r)));
    // In the logarithm: about half below the geometric mean.
    assert!((12..28).contains(&rates.iter().filter(|r| **r < 1e-3).count()), "{rates:?}");
    assert!(draws.iter().all(|d| (10..=20).contains(&d["batch"].as_integer().unwrap())));
    assert_eq!(draws, read(&text(1)).unwrap().combinations());
    assert_ne!(draws, read(&text(2)).unwrap().combinations());
}

#[test]
fn odd_files_are_refused_by_field() {
    let says = |text: &str, place: &str| {
        let e = read(text).unwrap_err();
        assert!(e.place.ends_with(place), "{e}");
    };
    says("mode = 'gird'", "sweep.toml");
    says("mode = 'grid'\n[settings]\n", ", settings: empty");
    says("mode = 'grid'\n[settings]\nseed = []\n", ", settings.seed");
    says("mode = 'grid'\n[settings]\nseed = {min = 1, max = 2}\n", ", settings.seed");
    says("mode = 'random'\n[settings]\nseed = [1]\n", ", samples = 0");
    says("mode = 'random'\nsamples = 3\n[settings]\nseed = {min = 2, max = 1}\n", ", settings.seed");
}

fn demos() -> Demos {
    let episode = |i: usize| Episode {
        actions: (0..6).map(|t| [0.1 * ((i + t) % 5) as f64; 7]).collect(),
        obs: [("object".to_string(), (0..6).map(|t| vec![((i + t) % 5) as f64]).collect())].into(),
        ..Default::default()
    };
    Demos { episodes: (0..12).map(episode).collect(), ..Default::default() }
}

/// Two at a time, ranked by what the closure says; one that cannot be trained is a row; once
/// more changes nothing.
#[test]
fn a_sweep_trains_scores_and_resumes() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("sweep");
    let sweep = read(&GRID.replace("[4, 8]", "[4, 8]\n'net.min_std' = [0.01, 0.1]")).unwrap();
    let set = ["obs=['object']", "steps=30", "batch=20"].map(String::from);
    let score = |folder: &Path| {
        let policy = hingecast_policy::Policy::load(folder)?;
        Ok(if policy.net.config.rnn_hidden == 8 { 0.9 } else { 0.5 })
    };
    let go = |score: Option<&Score>, threads: usize| {
        run(&sweep, Preset::BcRnnFast, None, &set, &demos(), &out, threads, &Progress::default(), score).unwrap()
    };
    let rows = go(Some(&score), 3);
    assert_eq!(rows.len(), 8);
    assert!(rows[..4].iter().all(|r| r.success == Some(0.9) && r.folder.contains("rnn_hidden=8")), "{rows:?}");
    let weights = std::fs::read(out.join(&rows[0].folder).join("policy.safetensors")).unwrap();
    for file in ["sweep.json", "sweep.md", "sweep_learning_rate.svg", "sweep_net_rnn_hidden.svg"] {
        assert!(out.join(file).is_file(), "{file}");
    }
    assert!(table(&rows).lines().nth(2).unwrap().contains("90.0 %"));
    let again = go(None, 1);
    assert!(again.windows(2).all(|w| w[0].valid_loss <= w[1].valid_loss), "{again:?}");
    let best = again.iter().find(|r| r.folder == rows[0].folder).unwrap();
    assert_eq!((best.train_loss, best.valid_loss), (rows[0].train_loss, rows[0].valid_loss));
    assert_eq!(weights, std::fs::read(out.join(&rows[0].folder).join("policy.safetensors")).unwrap());

    let e = run(&sweep, Preset::BcRnnFast, None, &["stepz=3".into()], &demos(), &out, 1, &Progress::default(), None);
    assert!(e.unwrap_err().what.contains("stepz"));
    let failing = |_: &Path| Err(Failure::new("no arm", "here", "there"));
    let rows = go(Some(&failing), 2);
    assert!(rows.iter().all(|r| r.failed.as_deref() == Some("no arm (here)")), "{rows:?}");
}
