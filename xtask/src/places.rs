//! Where packs, sources and outputs lie, and how a verb ends: what the verbs that show and measure share.

use kitsuke::Pack;
use kitsuke::fit::{FitData, Fitter};
use kitsuke_pipeline::Workshop;
use kitsuke_pipeline::catalog::CatalogError;
use kitsuke_pipeline::{catalog, ir};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// A path of the workspace as seen from the current folder, which may lie inside the workspace; the path as it is where
/// no folder above holds `assets-src`.
pub fn in_workspace(path: &str) -> PathBuf {
    let here = std::env::current_dir().unwrap_or_default();
    let depth = here.ancestors().position(|folder| folder.join("assets-src").is_dir()).unwrap_or(0);
    std::iter::repeat_n("..", depth).chain([path]).collect()
}

/// Folders, as options of a verb.
#[derive(clap::Args)]
pub struct Places {
    /// The folder of built packs
    #[arg(long, value_name = "DIR", default_value_os_t = in_workspace("catalog"))]
    pub catalog: PathBuf,
    /// The folder with one folder per kimono
    #[arg(long, value_name = "DIR", default_value_os_t = in_workspace("assets-src"))]
    pub assets: PathBuf,
}

impl Places {
    /// Opens the pack of an ID, or the pack at a path.
    pub fn open(&self, id_or_path: &str) -> Result<Pack, String> {
        let (path, bytes) = self.read_pack(id_or_path)?;
        Pack::open(&bytes).map_err(|error| format!("{} cannot be opened: {error}", path.display()))
    }

    /// What fits an open pack's kimono, by the rule sets of the pack.
    pub fn fitter(&self, pack: &Pack) -> Result<Fitter, String> {
        Fitter::new(pack.garment(), self.fit_data(pack)?).map_err(|error| error.to_string())
    }

    /// The sizes of an open pack's kimono.
    pub fn fit_data(&self, pack: &Pack) -> Result<FitData, String> {
        let data = pack.fit_data().map_err(|error| error.to_string())?;
        data.ok_or_else(|| {
            "this kimono has no sizes, so it cannot be fitted: give it a size table (garment.toml, sizes)".into()
        })
    }

    /// The path and the bytes of the pack of an ID, or of the pack at a path.
    pub fn read_pack(&self, id_or_path: &str) -> Result<(PathBuf, Vec<u8>), String> {
        let path = match Path::new(id_or_path) {
            path if path.is_file() => path.to_owned(),
            _ => catalog::pack_path(&self.catalog, id_or_path),
        };
        let bytes = fs::read(&path).map_err(|error| match error.kind() {
            std::io::ErrorKind::NotFound => match catalog::garment_ids(&self.assets, &[id_or_path.to_owned()]) {
                Err(error @ CatalogError::Unknown { .. }) => error.to_string(),
                _ => format!("there is no pack {}: run cargo xtask build-catalog", path.display()),
            },
            _ => format!("cannot read {}: {error}", path.display()),
        })?;
        Ok((path, bytes))
    }

    /// What a garment was made from; `None`, with a printed line, where that cannot be read.
    pub fn source(&self, id: &str) -> Option<ir::Garment> {
        self.source_with(id, &in_workspace("target/kitsuke-cache"))
    }

    /// [`Places::source`] for a verb that was told where earlier results lie.
    pub fn source_with(&self, id: &str, cache: &Path) -> Option<ir::Garment> {
        let dir = self.assets.join(id);
        if !dir.is_dir() {
            eprintln!("note: {} does not exist, so texture, wearer and target files are left out", dir.display());
            return None;
        }
        let workshop = Workshop { cache, tell: &|line| eprintln!("note: {id}: {line}") };
        let garment = kitsuke_pipeline::load_with(&dir, Some(&workshop)).garment;
        if garment.is_none() {
            eprintln!(
                "note: {} has mistakes (cargo xtask check {id}), so texture, wearer and target files are left out",
                dir.display()
            );
        }
        garment
    }
}

/// Ends a verb: 1 with a printed error, else 0.
pub fn ended(done: Result<(), String>) -> ExitCode {
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

/// Ends a verb that has something to say.
pub fn printed(text: Result<String, String>) -> ExitCode {
    // A reader such as `head` may have gone.
    ended(text.map(|text| _ = std::io::stdout().write_all(text.as_bytes())))
}

/// Says a line as soon as it is known.
macro_rules! say {
    // A reader such as `head` may have gone.
    ($($line:tt)*) => {{
        use std::io::Write;
        _ = writeln!(std::io::stdout(), $($line)*);
    }};
}
pub(crate) use say;

/// Writes a file beside its place and renames it, so that nobody sees half of it.
pub fn write_whole(path: &Path, write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>) -> Result<(), String> {
    let beside = path.with_added_extension(format!("{}.part", std::process::id()));
    let written = path.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| {
        let mut out = std::io::BufWriter::new(fs::File::create(&beside)?);
        write(&mut out)?;
        out.into_inner().map_err(std::io::IntoInnerError::into_error)?.sync_all()?;
        fs::rename(&beside, path)
    });
    written.map_err(|error| {
        let _ = fs::remove_file(&beside);
        format!("cannot write {}: {error}", path.display())
    })
}
