//! One script run by the environment's Python: a mesh goes in as NPY, arrays come back, nothing that comes back is trusted. Knows neither
//! what the script does nor what its errors are called.

use super::MeshlabError;
use super::process::{self, Ended};
use crate::look::frames::npy_header_of;
use crate::source::npy;
use bytemuck::Pod;
use glam::DVec3;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

/// Vertices and triangles of the largest mesh; a scan of a person has some hundred thousand.
const MOST: usize = 20_000_000;
/// Nothing worn is so large; farther away numbers lose the tenth of a millimetre.
pub(super) const FARTHEST_M: f64 = 1e6;
/// Room for the header of an NPY file.
const HEADER_BYTES: u64 = 1 << 16;

/// Of numbers, and within bounds; the largest element of a vector says nothing of the others that are no numbers.
pub(super) fn is_place(position_m: DVec3) -> bool {
    position_m.is_finite() && position_m.abs().max_element() <= FARTHEST_M
}

/// What is wrong with a mesh before anything is started.
pub(super) fn check_mesh(positions_m: &[DVec3], triangles: &[[u32; 3]]) -> Result<(), String> {
    if positions_m.is_empty() || triangles.is_empty() {
        return Err("it has no triangles".to_owned());
    }
    if positions_m.len().max(triangles.len()) > MOST {
        return Err(format!(
            "it has {} vertices and {} triangles, more than {MOST}",
            positions_m.len(),
            triangles.len()
        ));
    }
    if let Some(i) = positions_m.iter().position(|&p| !is_place(p)) {
        return Err(format!("vertex {i} lies at {} m; is the unit right?", positions_m[i]));
    }
    if let Some(i) = triangles.iter().position(|t| t.iter().any(|&corner| corner as usize >= positions_m.len())) {
        return Err(format!("triangle {i} names a vertex that does not exist"));
    }
    Ok(())
}

/// Writes a mesh where a script looks for it: `positions.npy` and `triangles.npy`.
///
/// # Errors
/// They cannot be written.
pub fn write_mesh(folder: &Path, positions_m: &[DVec3], triangles: &[[u32; 3]]) -> Result<(), MeshlabError> {
    let numbers: Vec<f64> = positions_m.iter().flat_map(|p| p.to_array()).collect();
    let write = |name: &str, descr, rows, bytes: &[u8]| {
        let path = folder.join(name);
        let array = [&npy_header_of(descr, &[rows, 3]), bytes].concat();
        fs::write(&path, array).map_err(|error| MeshlabError::io(&path, &error))
    };
    write("positions.npy", "<f8", positions_m.len(), bytemuck::cast_slice(&numbers))?;
    write("triangles.npy", "<i4", triangles.len(), bytemuck::cast_slice(triangles))
}

/// Runs a script, by its name and text, with one line of JSON.
///
/// # Errors
/// It cannot be started.
pub fn run(
    python: &Path,
    folder: &Path,
    (name, text): (&str, &str),
    request: &serde_json::Value,
    limit: Duration,
) -> Result<Ended, MeshlabError> {
    let script = folder.join(name);
    fs::write(&script, text).map_err(|error| MeshlabError::io(&script, &error))?;
    // Absolute, because it runs elsewhere; links stay, for they are how Python finds its environment.
    let mut command = Command::new(std::path::absolute(python).map_err(|error| MeshlabError::io(python, &error))?);
    command.args(["-I", "-B"]).arg(&script).current_dir(folder);
    minimal_environment(&mut command, folder);
    process::run(&mut command, format!("{request}\n").as_bytes(), Some(limit))
        .map_err(|error| MeshlabError::io(python, &error))
}

/// No variable of the user's reaches Python or the libraries, but those without which a system loads none. One thread, so that sums
/// are always taken in one order.
fn minimal_environment(command: &mut Command, folder: &Path) {
    const KEPT: [&str; 3] = ["SystemRoot", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH"];
    const ONE_THREAD: [&str; 3] = ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"];
    command.env_clear();
    command.envs(KEPT.iter().filter_map(|name| Some((name, std::env::var_os(name)?))));
    command.envs(ONE_THREAD.map(|name| (name, "1")));
    command.envs([("LC_ALL", "C.UTF-8"), ("PYTHONNOUSERSITE", "1"), ("QT_QPA_PLATFORM", "offscreen")]);
    for name in ["HOME", "TMPDIR", "TEMP", "TMP"] {
        command.env(name, folder);
    }
}

/// An array that a script wrote: of elements as numpy names them, so many to a row, at most so many rows.
///
/// # Errors
/// What is wrong with it.
pub fn array<T: Pod>(folder: &Path, name: &str, descr: &str, row: usize, most: usize) -> Result<Vec<T>, String> {
    let path = folder.join(format!("{name}.npy"));
    let length = fs::metadata(&path).map_err(|error| format!("{name}.npy: {error}"))?.len();
    if length > (most * row * size_of::<T>()) as u64 + HEADER_BYTES {
        return Err(format!("{name}.npy is larger than the mesh that went in"));
    }
    let bytes = fs::read(&path).map_err(|error| format!("{name}.npy: {error}"))?;
    npy::read(&bytes, descr, row).map_err(|problem| format!("{name}.npy {problem}"))
}

pub(super) fn indices(numbers: &[i32], count: usize, what: &str) -> Result<Vec<u32>, String> {
    let index = |&number: &i32| u32::try_from(number).ok().filter(|&index| (index as usize) < count);
    let all: Option<Vec<u32>> = numbers.iter().map(index).collect();
    all.ok_or_else(|| format!("{what} does not exist"))
}
