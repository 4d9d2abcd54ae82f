//! `cargo xtask schema`: writes the JSON Schema of garment.toml, by which editors complete and check it.

use crate::places::in_workspace;
use kitsuke_pipeline::source::manifest;
use std::path::PathBuf;
use std::process::ExitCode;

/// Write the JSON Schema of garment.toml, by which editors complete and check it
#[derive(clap::Args)]
pub struct Args {
    /// The schema file.
    #[arg(long, value_name = "FILE", default_value_os_t = in_workspace("assets-src/garment.schema.json"))]
    out: PathBuf,
}

/// Writes the schema.
pub fn run(args: Args) -> ExitCode {
    match std::fs::write(&args.out, manifest::schema()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{}: {error}", args.out.display());
            ExitCode::FAILURE
        }
    }
}
