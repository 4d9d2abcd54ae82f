//! Cleaning of scans with pymeshlab, which is GPL-3: it is neither linked nor bundled. It runs in a process of its own, from a virtual
//! environment that is made when a scan is first cleaned, and is spoken to by files and two lines of JSON. Knows no garment and
//! no stage; nothing else of the pipeline needs Python. In the same environment lives xatlas (MIT), which makes texture coordinates.

mod atlas;
mod clean;
pub mod environment;
mod process;
pub mod script;

pub use crate::source::clean_answer::{Border, CleanReport, Figures, Removed, Steps};
pub use atlas::{Atlas, AtlasSettings, atlas};
pub use clean::{Cleaned, Settings, clean};
pub use process::Ended;

use std::path::{Path, PathBuf};
use std::time::Duration;

/// Why no mesh was cleaned.
#[derive(Debug, thiserror::Error)]
pub enum MeshlabError {
    /// There is no Python.
    #[error(
        "cleaning scans needs Python (CPython {}) with pymeshlab, and there is no python3 in PATH: install it (Debian: apt install python3 python3-venv), \
         or clean the mesh elsewhere; nothing else needs it",
        environment::VERSIONS_TEXT
    )]
    NoPython,
    /// There are only others.
    #[error(
        "cleaning scans needs CPython {} for pymeshlab, and in PATH there is {found}: install another beside it, as python3.12 for example",
        environment::VERSIONS_TEXT
    )]
    UnfitPython {
        /// What there is, as it calls itself.
        found: String,
    },
    /// Python cannot make virtual environments.
    #[error(
        "cleaning scans needs a virtual environment for pymeshlab, and {python} cannot make one: install its modules venv and ensurepip \
         (Debian: apt install python3-venv){}",
        said(tail)
    )]
    NoVenv {
        /// The command.
        python: String,
        /// What it said last.
        tail: String,
    },
    /// pip failed.
    #[error(
        "{} needs {}, which could not be installed (about {} MB, once): is this machine on the network, and can pip reach its \
         package index (proxies and mirrors are set as for any pip)?{}{}",
        packages.purpose, packages.name, packages.load_mb, packages.system, said(tail)
    )]
    Pip {
        /// What was to be installed.
        packages: &'static environment::Packages,
        /// What it said last.
        tail: String,
    },
    /// Python is there, pymeshlab's libraries are not.
    #[error(
        "pymeshlab, which cleans scans, does not start: it needs shared libraries of the system (Debian: apt install libgl1 libopengl0 libglx0 libx11-6 \
         libfontconfig1 libgmp10){}",
        said(tail)
    )]
    SharedLibrary {
        /// What it said last.
        tail: String,
    },
    /// A file, folder or process of ours.
    #[error("{}: {problem}", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// What the system says.
        problem: String,
    },
    /// The mesh or a setting cannot be cleaned with.
    #[error("the mesh cannot be cleaned: {0}")]
    Unfit(String),
    /// The cleaning ran too long and was ended.
    #[error("cleaning took longer than {} s and was ended: allow it more, or give it a smaller mesh", limit.as_secs_f64())]
    TimedOut {
        /// The limit.
        limit: Duration,
    },
    /// The process ended otherwise than by an answer.
    #[error("the process that cleans with pymeshlab ended with {how}{}", said(tail))]
    Died {
        /// Exit code or signal.
        how: String,
        /// What it said last.
        tail: String,
    },
    /// xatlas is not there.
    #[error(
        "texture coordinates are made by xatlas, which has no wheel for this system (there is none for CPython 3.14 nor for Linux on ARM): use \
         another Python, as python3.12 for example, or unwrap the mesh elsewhere; packing coordinates that are there needs no xatlas"
    )]
    NoXatlas,
    /// The process that makes texture coordinates failed.
    #[error("the process that makes texture coordinates with xatlas {problem}{}", said(tail))]
    Atlas {
        /// How it ended, or what is wrong with its answer.
        problem: String,
        /// What it said last.
        tail: String,
    },
    /// What it gave back is not what it should be.
    #[error("the process that cleans with pymeshlab gave a wrong answer: {problem}{}", said(tail))]
    Answer {
        /// What is wrong.
        problem: String,
        /// What it said last.
        tail: String,
    },
}

impl MeshlabError {
    fn io(path: &Path, error: &std::io::Error) -> MeshlabError {
        MeshlabError::Io { path: path.to_owned(), problem: error.to_string() }
    }
}

/// The last lines of a process, as the end of a message.
fn said(tail: &str) -> String {
    match tail.trim_end() {
        "" => String::new(),
        tail => format!("\nIt said:\n  {}", tail.replace('\n', "\n  ")),
    }
}
