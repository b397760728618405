//! Why a simulation cannot start, in three lines each. What a working model does wrong is a doubt
//! or a failed episode.

/// What / where / what to try.
#[derive(Debug, Clone, thiserror::Error)]
pub enum SimError {
    /// MuJoCo refuses a model.
    #[error(
        "MuJoCo cannot load the model: {what}\n  where: {path}\n  try: open it with `python -m mujoco.viewer --mjcf={path}`, or build the twin again"
    )]
    Load {
        /// The model file.
        path: String,
        /// What MuJoCo says, in one line.
        what: String,
    },
    /// A task, an object or an action that cannot be worked with.
    #[error("{what}\n  where: {place}\n  try: {hint}")]
    Task {
        /// What is wrong.
        what: String,
        /// File, field or argument.
        place: String,
        /// What to try.
        hint: String,
    },
}

impl SimError {
    pub(crate) fn load(path: &std::path::Path, e: impl std::fmt::Display) -> Self {
        let what = e.to_string().lines().collect::<Vec<_>>().join("; ");
        Self::Load { path: path.display().to_string(), what }
    }

    pub(crate) fn nothing_moves(place: impl Into<String>) -> Self {
        let hint = "look at the run's report for parts that were missed, or take another object";
        Self::task("nothing moves: the model has no hinge and no slide", place, hint)
    }

    pub(crate) fn task(what: impl Into<String>, place: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::Task { what: what.into(), place: place.into(), hint: hint.into() }
    }
}
