//! One object of an experiment: each step done, or found done.

use super::plan::Plan;
use super::steps::Steps;
use super::{Demonstrated, Row, TwinError, World};
use crate::host::Host;
use crate::simulate::record::record_on;
use crate::simulate::rollout::{EpisodeResult, episodes, strips};
use crate::simulate::twin_file;
use crate::suite;
use crate::training;
use hingecast::config::Method;
use hingecast::failure::{Failure, Result};
use hingecast::import_object::{ImportConfig, import};
use hingecast::report;
use hingecast::stage::{RunFolder, read_json, write_json};
use hingecast_capture::Recording;
use hingecast_capture::object::ArticulatedObject;
use hingecast_policy::Policy;
use hingecast_policy::demos::{read, write};
use hingecast_sim::trial::make_task;
use hingecast_sim::{Scene, SceneConfig, Spoil, SpotPath, TaskKind, TaskSpec, object};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Seeds of demonstrations and episodes: no policy is asked about a start that it was shown.
const DEMO_SEED: u64 = 0;
const EPISODE_SEED: u64 = 1;

/// A model file that the arm can act on, and the stamp of what it was made from.
#[derive(Clone)]
struct Model {
    file: PathBuf,
    stamp: String,
}

/// What the demonstrations' step leaves beside the HDF5 file.
#[derive(Serialize, Deserialize)]
struct Note {
    task: TaskSpec,
    demonstrated: Demonstrated,
}

/// Policies of all training seeds, with the task that they were made for.
struct Trained {
    task: TaskSpec,
    folders: Vec<PathBuf>,
    stamps: Vec<String>,
}

/// Of each training seed's policy.
type Episodes = Vec<Vec<EpisodeResult>>;

/// Or why not.
type Maybe<T> = std::result::Result<T, String>;

/// One object.
pub struct Cast<'a> {
    /// Builds and simulations run here.
    pub host: Host<'a>,
    /// What shall be done, the same for every object.
    pub plan: &'a Plan,
    /// As on the command line: a name, or a path.
    pub argument: &'a str,
    /// As in the table; also its folder among the plan's recordings and runs.
    pub name: &'a str,
    /// Folder of this object, there already: all that is made goes into it.
    pub root: PathBuf,
    /// Knows what is finished in `root`.
    pub steps: Steps<'a>,
    /// Empty at first; [`Cast::rows`] adds to it what was demonstrated.
    pub demonstrated: Vec<Demonstrated>,
}

impl Cast<'_> {
    /// Does what is not done yet; answers a row of the true object and one of each world of the
    /// plan.
    ///
    /// # Errors
    /// The wish to stop. Whatever else fails is a row that says why.
    ///
    /// # Panics
    /// A plan without training seeds, or without episodes.
    pub fn rows(&mut self) -> Result<Vec<Row>> {
        let plan = self.plan;
        let truth = self.object();
        let truth = match self.caught(truth)? {
            Ok(truth) => truth,
            Err(why) => return Ok(self.all_failed(&why)),
        };
        // First what decides whether there is anything to compare with.
        let trained = self.policies("true", &truth);
        let trained = match self.caught(trained)? {
            Ok(trained) => trained,
            Err(why) => return Ok(self.all_failed(&why)),
        };
        let first = self.world("true", &truth, &[], &truth, &trained, "true", plan.episodes);
        let (first, row) = match self.caught(first)? {
            Ok((episodes, error)) => {
                let row = Row::measured(self.name, "true", Some(error), &episodes, None);
                (episodes, row)
            }
            Err(why) => return Ok(self.all_failed(&why)),
        };
        let mut rows = vec![row];
        let recording = self.recording();
        let recording = self.caught(recording)?;
        let twin = self.twin(&recording, Method::Screw)?;
        let track = self.twin(&recording, Method::Track)?;
        for (name, world) in &plan.worlds {
            let n = plan.episodes_in(world);
            let made = match world {
                World::Back => self.back(&truth, &twin)?,
                World::Twin | World::Track => {
                    let model = if *world == World::Twin { &twin } else { &track };
                    match model {
                        Err(why) => Err(why.clone()),
                        Ok(model) => {
                            let made = self.world(name, model, &[], &truth, &trained, "true", n);
                            self.caught(made)?.map(|(episodes, error)| (episodes, Some(error)))
                        }
                    }
                }
                World::Spoiled(spoil) => {
                    let made = self.world(name, &truth, spoil, &truth, &trained, "true", n);
                    self.caught(made)?.map(|(episodes, error)| (episodes, Some(error)))
                }
            };
            rows.push(match made {
                // Another policy and another task: its episodes are no pairs with those of the
                // first.
                Ok((episodes, error)) => {
                    let pairs = (*world != World::Back).then_some(first.as_slice());
                    Row::measured(self.name, name, error, &episodes, pairs)
                }
                Err(why) => Row::failed(self.name, name, why),
            });
        }
        Ok(rows)
    }

    fn all_failed(&self, why: &str) -> Vec<Row> {
        let worlds = self.plan.worlds.iter().map(|(name, _)| name.as_str());
        ["true"].into_iter().chain(worlds).map(|world| Row::failed(self.name, world, why)).collect()
    }

    /// A failure becomes a sentence for the table; only the person's wish to stop goes up.
    fn caught<T>(&self, made: Result<T>) -> Result<Maybe<T>> {
        match made {
            Ok(value) => Ok(Ok(value)),
            Err(failure) if failure.cancelled => Err(failure),
            Err(failure) => {
                self.host.watcher.complain(&failure);
                Ok(Err(failure.what))
            }
        }
    }

    /// The true object for the simulator: as it is, or imported where the simulator cannot load it.
    fn object(&mut self) -> Result<Model> {
        let source = ArticulatedObject::resolve(self.argument)?;
        if let Ok(file) = object::model_file(&source) {
            let file = file.canonicalize().map_err(Failure::io(&file))?;
            let text = std::fs::read(&file).map_err(Failure::io(&file))?;
            return Ok(Model { file, stamp: hingecast::stage::stamp(&[&text]) });
        }
        let out = self.root.join("object");
        let config = ImportConfig::default();
        let watcher = self.host.watcher;
        let path = source.display().to_string();
        let stamp = self.steps.step("import", "import", &[&path, &config], &out.join("twin.json"), || {
            import(&source, &out, &config, &watcher.stage("import")).map(|_| ())
        })?;
        Ok(Model { file: twin_file(&out)?, stamp })
    }

    /// `None`: no world needs one.
    fn recording(&mut self) -> Result<Option<PathBuf>> {
        let plan = self.plan;
        if !plan.needs_recording() {
            return Ok(None);
        }
        if let Some(path) = plan.recordings.as_ref().map(|r| r.join(self.name)).filter(|p| p.is_dir()) {
            return Ok(Some(path));
        }
        let path = self.root.join("recording");
        let (host, argument, config) = (self.host, self.argument, &self.plan.synth);
        self.steps.step("record", "record", &[&argument, config], &path.join("transforms.json"), || {
            suite::record_once(&host, argument, config, &path)
        })?;
        Ok(Some(path))
    }

    /// The twin of the recording by one method, if a world asks for it.
    fn twin(&mut self, recording: &Maybe<Option<PathBuf>>, method: Method) -> Result<Maybe<Model>> {
        let plan = self.plan;
        let classical = method == Method::Track;
        if !(if classical { plan.has(&World::Track) } else { plan.needs_twin() }) {
            return Ok(Err("not asked for".into()));
        }
        let recording = match recording {
            Ok(Some(path)) => path.clone(),
            Ok(None) => return Ok(Err("not asked for".into())),
            Err(why) => return Ok(Err(why.clone())),
        };
        let made = self.build(&recording, classical);
        self.caught(made)
    }

    fn build(&mut self, recording: &Path, classical: bool) -> Result<Model> {
        let (host, plan) = (self.host, self.plan);
        let (kind, config) = if classical { ("track", &plan.track) } else { ("build", &plan.twin) };
        let finished = |run: &PathBuf| {
            RunFolder::open_finished(run).is_ok()
                && run.join("twin/robot.xml").is_file()
                && method_of(run) == Some(config.method)
        };
        if let Some(run) = plan.runs.iter().map(|r| r.join(self.name)).find(finished) {
            let stamps: Vec<String> = RunFolder::open(&run)?.record.stages.into_iter().map(|s| s.stamp).collect();
            return Ok(Model { file: twin_file(&run)?, stamp: hingecast::stage::stamp(&[&stamps]) });
        }
        let run = self.root.join(if classical { "run_track" } else { "run" });
        let fingerprint = Recording::open(recording)?.fingerprint()?;
        let stamp = self.steps.step(kind, kind, &[&fingerprint, config], &run.join("twin/robot.xml"), || {
            let folder = hingecast::build::build(recording, &run, config, &host.options(), host.watcher)?;
            report::write(&folder).map(|_| ())
        })?;
        Ok(Model { file: twin_file(&run)?, stamp })
    }

    /// Demonstrations on `model`, and a policy for every training seed.
    fn policies(&mut self, on: &str, model: &Model) -> Result<Trained> {
        let (host, plan, name) = (self.host, self.plan, self.name);
        let file = self.root.join(format!("demos_{on}.hdf5"));
        let note = file.with_extension("json");
        let n = plan.demos;
        let demos_stamp =
            self.steps.step("demos", &format!("demos {on}"), &[&model.stamp, &n, &DEMO_SEED], &note, || {
                let made = make_task(&model.file, TaskKind::Open, None, None)?;
                let progress = host.watcher.stage("demos");
                let (demos, recorded) = record_on(&model.file, &made.task, n, DEMO_SEED, &progress)?;
                write(&file, &demos)?;
                let demonstrated = Demonstrated {
                    object: name.to_string(),
                    on: on.to_string(),
                    joint: made.task.joint.clone(),
                    scale: made.task.scale,
                    kept: recorded.kept,
                    thrown_away: recorded.thrown_away,
                };
                // Last: where the note is, the demonstrations are whole.
                write_json(&note, &Note { task: made.task, demonstrated })
            })?;
        let Note { task, demonstrated } = read_json(&note)?;
        self.demonstrated.push(demonstrated);
        let mut trained = Trained { task, folders: Vec::new(), stamps: Vec::new() };
        for (k, config) in plan.training.iter().enumerate() {
            let folder = self.root.join(format!("policy_{on}_{k}"));
            let step = format!("train {on} {k}");
            let stamp =
                self.steps.step("train", &step, &[&demos_stamp, config], &folder.join("policy.json"), || {
                    let demos = read(&file)?;
                    training::train(&demos, config, &folder, &host.watcher.stage("train")).map(|_| ())
                })?;
            trained.folders.push(folder);
            trained.stamps.push(stamp);
        }
        Ok(trained)
    }

    /// Episodes of every policy on `model`, and how wrong its joint is. Pictures of the first
    /// policy's ends lie beside.
    fn world(
        &mut self,
        name: &str,
        model: &Model,
        spoil: &[Spoil],
        truth: &Model,
        trained: &Trained,
        on: &str,
        n: usize,
    ) -> Result<(Episodes, TwinError)> {
        let scene_of = |model: &Model, spoil: &[Spoil]| {
            let config = SceneConfig { object: model.file.clone(), spoil: spoil.to_vec(), visuals: false };
            Scene::new(&config, &trained.task)
        };
        let true_scene = scene_of(truth, &[])?;
        if true_scene.target.joint.slides && spoil.iter().any(|s| matches!(s, Spoil::Pivot(_))) {
            let hint = "leave this world out for objects that slide";
            return Err(Failure::new("a slide has no pivot to move", self.name, hint));
        }
        let (scene, way) = (scene_of(model, spoil)?, SpotPath::of(&true_scene));
        let error = TwinError::between(&way, &SpotPath::of(&scene));
        let host = self.host;
        let mut out = Vec::new();
        for (k, (folder, stamp)) in trained.folders.iter().zip(&trained.stamps).enumerate() {
            let place = self.root.join(format!("rollouts_{on}_{k}"));
            let file = place.join(format!("{}.json", name.replace(['=', ','], "_")));
            let step = format!("rollout {on} {k} {name}");
            self.steps.step(
                "rollout",
                &step,
                &[stamp, &model.stamp, &truth.stamp, &spoil, &n, &EPISODE_SEED],
                &file,
                || {
                    std::fs::create_dir_all(&place).map_err(Failure::io(&place))?;
                    let policy = Policy::load(folder)?;
                    let progress = host.watcher.stage("rollout");
                    let report = |done: usize| Ok(progress.report(done, n, name)?);
                    let results = episodes(&policy, &scene, &way, n, EPISODE_SEED, &report)?;
                    if k == 0 {
                        strips(&policy, &scene, &results, &file.with_extension(""), &host.watcher.stage("picture"))?;
                    }
                    write_json(&file, &results)
                },
            )?;
            out.push(read_json(&file)?);
        }
        Ok((out, error))
    }

    /// A policy from the twin on the true object.
    fn back(&mut self, truth: &Model, twin: &Maybe<Model>) -> Result<Maybe<(Episodes, Option<TwinError>)>> {
        let twin = match twin {
            Ok(twin) => twin,
            Err(why) => return Ok(Err(why.clone())),
        };
        let trained = self.policies("twin", twin);
        let trained = match self.caught(trained)? {
            Ok(trained) => trained,
            Err(why) => return Ok(Err(why)),
        };
        let made = self.world("back", truth, &[], truth, &trained, "twin", self.plan.episodes);
        Ok(self.caught(made)?.map(|(episodes, _)| (episodes, None)))
    }
}

/// By what method a run was built.
fn method_of(run: &Path) -> Option<Method> {
    let text = std::fs::read_to_string(run.join("config.toml")).ok()?;
    let table: toml::Table = text.parse().ok()?;
    table.get("method")?.clone().try_into().ok()
}
