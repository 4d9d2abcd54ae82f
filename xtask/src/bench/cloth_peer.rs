//! A cloth solver by others on the scenes that ours is timed on, as a program of its own (`xtask/peers/cloth`, where the scenes are
//! defined). Knows neither the peer's settings nor our solver.

use crate::places::in_workspace;
use serde_json::Value;
use std::process::{Command, Stdio};

/// What the peer said of a scene.
pub struct PeerFigures {
    /// Milliseconds of wall time per 1/600 s of simulated time.
    pub ms_per_step: f64,
    /// Mean of |length / length at rest - 1| over the edges along warp and weft.
    pub strain_mean: f64,
}

/// Builds the peer, where that is not done yet, and plays it a scene: `hanging` (about 20 s) or `folding` (about 2 minutes).
///
/// # Errors
/// When cargo cannot be started, the peer cannot be built (the first time, cargo loads its crates), fails, or says something else.
pub fn peer(scene: &str) -> Result<PeerFigures, String> {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.args(["run", "--quiet", "--release", "--locked", "--manifest-path"]);
    cargo.arg(in_workspace("xtask/peers/cloth/Cargo.toml")).arg("--target-dir").arg(in_workspace("target/peers"));
    cargo.args(["--", scene]).stderr(Stdio::inherit());
    let output = cargo.output().map_err(|error| format!("cannot start cargo for the cloth peer: {error}"))?;
    if !output.status.success() {
        return Err(format!(
            "the cloth peer was not built or did not play `{scene}`, see above ({}); to build it the first time, cargo needs the network",
            output.status
        ));
    }
    let said: Value = serde_json::from_slice(&output.stdout)
        .map_err(|error| format!("the cloth peer said no JSON of `{scene}`: {error}"))?;
    let figure =
        |key: &str| said[key].as_f64().ok_or_else(|| format!("the cloth peer said no {key} of `{scene}`: {said}"));
    Ok(PeerFigures { ms_per_step: figure("ms_per_step")?, strain_mean: figure("strain_mean")? })
}
