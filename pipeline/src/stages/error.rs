//! How a stage says that it gave up.

/// Why a garment could not be built although its source passed every check.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{stage}: {problem}")]
pub struct StageError {
    /// The stage that gave up.
    pub stage: &'static str,
    /// What is wrong, naming the element (target, vertex).
    pub problem: String,
}

impl StageError {
    /// An error of a stage.
    #[must_use]
    pub fn new(stage: &'static str, problem: impl Into<String>) -> StageError {
        StageError { stage, problem: problem.into() }
    }
}
