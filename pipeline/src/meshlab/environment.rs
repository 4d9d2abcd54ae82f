//! Virtual environments, of pymeshlab and of what we are compared with: each made once per list of requirements, by the user's own Python
//! and pip, in the cache. Knows nothing of meshes.

use super::MeshlabError;
use super::process::{self, last_lines};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What is installed into one environment.
#[derive(Debug)]
pub struct Packages {
    /// The text of requirements.txt: versions and hashes.
    pub requirements: &'static str,
    /// The folder of the cache for such environments.
    pub folder: &'static str,
    /// The package that is wanted.
    pub name: &'static str,
    /// What it is good for, as in: cleaning scans needs pymeshlab.
    pub purpose: &'static str,
    /// The same, as in: pymeshlab, which cleans scans.
    pub does: &'static str,
    /// All that is installed and how large it is, as a person is told before waiting.
    pub all: &'static str,
    /// How much is loaded, MB.
    pub load_mb: u32,
    /// What the system must have.
    pub system: &'static str,
}

/// What cleans scans.
pub const PYMESHLAB: Packages = Packages {
    requirements: include_str!("requirements.txt"),
    folder: "meshlab",
    name: "pymeshlab",
    purpose: "cleaning scans",
    does: "cleans scans",
    all: "pymeshlab and numpy (about 130 MB to load, 400 MB on disk, once)",
    load_mb: 130,
    system: " On Linux its files need glibc 2.35 or newer (Debian 12, Ubuntu 22.04).",
};
/// The versions of CPython for which pymeshlab has wheels.
const MINORS: std::ops::RangeInclusive<u32> = 10..=14;
/// The same in words.
pub(super) const VERSIONS_TEXT: &str = "3.10 to 3.14";
/// What Python may be called. The plain name first: it is the one that people mean.
const NAMES: [&str; 7] = ["python3", "python3.13", "python3.12", "python3.11", "python3.10", "python3.14", "python"];
/// Name, version and whether virtual environments can be made.
const PROBE: &str = "import sys\n\
    print(sys.implementation.name, *sys.version_info[:2])\n\
    import venv, ensurepip\n\
    print('whole')";

/// Where the environment of these requirements lies, made or not.
#[must_use]
pub fn folder(cache: &Path, packages: &Packages) -> PathBuf {
    let hash = blake3::hash(packages.requirements.as_bytes()).to_hex();
    cache.join(packages.folder).join(&hash[..16])
}

/// The Python of the environment, if it has been made.
#[must_use]
pub fn existing(cache: &Path, packages: &Packages) -> Option<PathBuf> {
    Some(python_in(&folder(cache, packages))).filter(|python| python.is_file())
}

fn python_in(folder: &Path) -> PathBuf {
    folder.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" })
}

/// The Python of the environment, which is made where it does not exist yet: then `progress` is told what happens, line by line.
///
/// # Errors
/// No fitting Python, no network, no room: what is missing and what to do.
pub fn python(cache: &Path, packages: &'static Packages, progress: &dyn Fn(&str)) -> Result<PathBuf, MeshlabError> {
    if let Some(python) = existing(cache, packages) {
        return Ok(python);
    }
    let folder = folder(cache, packages);
    let room = folder.parent().expect("it lies in the cache");
    fs::create_dir_all(room).map_err(|error| MeshlabError::io(room, &error))?;
    let _lock = lock(room, packages, progress)?;
    // Another process may have made it meanwhile.
    if let Some(python) = existing(cache, packages) {
        return Ok(python);
    }
    let base = base_python()?;
    // Beside its place, so that half an environment is never taken for a whole one. What a killed one left goes.
    let beside = folder.with_extension("part");
    if beside.exists() {
        fs::remove_dir_all(&beside).map_err(|error| MeshlabError::io(&beside, &error))?;
    }
    let made = install(base, &beside, packages, progress);
    if made.is_ok() {
        fs::rename(&beside, &folder).map_err(|error| MeshlabError::io(&folder, &error))?;
    } else {
        let _ = fs::remove_dir_all(&beside);
    }
    made.map(|()| python_in(&folder))
}

/// Lets one process at a time make environments. The system lets go of the lock when the process ends, however it does.
fn lock(room: &Path, packages: &Packages, progress: &dyn Fn(&str)) -> Result<fs::File, MeshlabError> {
    let path = room.join("lock");
    let io = |error| MeshlabError::io(&path, &error);
    let mut file =
        fs::OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path).map_err(io)?;
    match file.try_lock() {
        Ok(()) => {}
        Err(fs::TryLockError::WouldBlock) => {
            let owner = fs::read_to_string(&path).unwrap_or_default();
            progress(&format!("another program ({}) installs {}; this one waits for it", owner.trim(), packages.name));
            file.lock().map_err(io)?;
        }
        Err(fs::TryLockError::Error(error)) => return Err(io(error)),
    }
    file.set_len(0).and_then(|()| writeln!(file, "process {}", std::process::id())).map_err(io)?;
    Ok(file)
}

/// The first Python in PATH that fits.
fn base_python() -> Result<&'static str, MeshlabError> {
    let mut first_problem = None;
    for name in NAMES {
        // Isolated: neither the current folder nor the user's own modules take part.
        let Ok(ended) = process::run(Command::new(name).args(["-I", "-c", PROBE]), b"", None) else { continue };
        let said = String::from_utf8_lossy(&ended.stdout);
        let mut words = said.split_whitespace();
        let found = [words.next(), words.next(), words.next()].map(Option::unwrap_or_default);
        let fits =
            found[0] == "cpython" && found[1] == "3" && found[2].parse().is_ok_and(|minor| MINORS.contains(&minor));
        let problem = match (fits, words.next()) {
            (true, Some("whole")) => return Ok(name),
            (true, _) => MeshlabError::NoVenv { python: name.to_owned(), tail: ended.tail },
            // A stand-in that only points to a shop, or nothing that we know.
            (false, _) if found[0].is_empty() => continue,
            (false, _) => MeshlabError::UnfitPython { found: format!("{} {}.{}", found[0], found[1], found[2]) },
        };
        first_problem.get_or_insert(problem);
    }
    Err(first_problem.unwrap_or(MeshlabError::NoPython))
}

fn install(
    base: &str,
    beside: &Path,
    packages: &'static Packages,
    progress: &dyn Fn(&str),
) -> Result<(), MeshlabError> {
    let Packages { name, does, all, .. } = packages;
    let start = |error: std::io::Error| MeshlabError::io(beside, &error);
    progress(&format!("making a virtual environment for {name}, which {does}, with {base}"));
    let ended = process::run(Command::new(base).args(["-I", "-m", "venv"]).arg(beside), b"", None).map_err(start)?;
    if !ended.status.is_some_and(|status| status.success()) {
        let tail = format!("{}\n{}", last_lines(&ended.stdout), ended.tail);
        return Err(MeshlabError::NoVenv { python: base.to_owned(), tail: tail.trim().to_owned() });
    }
    let requirements = beside.join("requirements.txt");
    fs::write(&requirements, packages.requirements).map_err(|error| MeshlabError::io(&requirements, &error))?;
    progress(&format!("installing {all}"));
    let mut pip = Command::new(python_in(beside));
    pip.args(["-I", "-m", "pip", "install", "--no-input", "--disable-pip-version-check", "--progress-bar", "off"]);
    pip.args(["--require-hashes", "--only-binary", ":all:", "-r"]).arg(&requirements);
    let ended = process::run(&mut pip, b"", None).map_err(start)?;
    if !ended.status.is_some_and(|status| status.success()) {
        return Err(MeshlabError::Pip { packages, tail: ended.tail });
    }
    progress(&format!("{name} is installed"));
    Ok(())
}
