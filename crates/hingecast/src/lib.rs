//! A cast of a thing, with its hinges: a recording of an articulated object becomes a twin that a
//! simulator runs.
//!
//! The library behind the command line (`crates/cli`). It has no terminal: who calls it hands in a
//! [`Watcher`], which hears of stages and may wish them to stop, and `threads` are those of a pool
//! of its own.
//!
//! ```no_run
//! use hingecast::{Config, Options, Preset, Silent, artifacts::TwinFile, build};
//!
//! // The recording must be there; the run folder is new, empty, or a run: then finished stages are kept.
//! let config = Config::preset(Preset::Fast);
//! let run = build("rec".as_ref(), "run".as_ref(), &config, &Options::default(), &Silent)?;
//! for joint in &TwinFile::read(&run.root)?.tree.joints {
//!     println!("{}: {:?} along {}", joint.name, joint.screw.kind, joint.screw.axis);
//! }
//! println!("doubts: {:?}", run.record.doubts);
//! # Ok::<(), hingecast::Failure>(())
//! ```
//!
//! | where | what |
//! |---|---|
//! | [`mod@build`] | the driver: stages in order, each kept while its stamp fits |
//! | [`stages`] | one file a stage: plain data in, an artifact out |
//! | [`artifacts`] | the files of a run, one struct, one reader and one writer each |
//! | [`config`], [`overrides`] | settings; a person's corrections of joints |
//! | [`eval`] | a run against the truth: the only code that opens a truth folder |
//! | [`objects`] | objects of others, as their own simulators understand them |
//! | [`prepare`] | states registered, the object found, where the recording lacks it |
//! | [`report`] | the page of a run |
//!
//! Parts and joints are found by `hingecast_articulate::find`, which can be called on depth images
//! of your own: `examples/find_joints.rs`.

#![warn(missing_docs)]
// `ui` writes to the terminal, and nobody else.
#![deny(clippy::print_stdout, clippy::print_stderr)]

pub mod artifacts;
pub mod build;
pub mod chart;
pub mod config;
pub mod escape;
pub mod eval;
pub mod failure;
pub mod import_object;
pub mod memory;
pub mod objects;
pub mod overrides;
pub mod prepare;
pub mod report;
pub mod run_files;
pub mod stage;
pub mod stages;
pub mod view;
pub mod watcher;

pub use build::{Options, Stage, build};
pub use config::{Config, Method, Preset};
pub use failure::{Failure, Result};
pub use hingecast_articulate::MOST_STATES;
pub use watcher::{Silent, Watcher};
