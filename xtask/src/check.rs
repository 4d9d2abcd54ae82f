//! `cargo xtask check`: reads garment folders and reports every mistake, in seconds and without building.

use crate::places::in_workspace;
use kitsuke_pipeline::Workshop;
use kitsuke_pipeline::catalog;
use kitsuke_pipeline::diagnostic::{self, Format, Severity};
use std::io::IsTerminal;
use std::path::PathBuf;
use std::process::ExitCode;

/// Report every mistake in garment folders, without building
#[derive(clap::Args)]
pub struct Args {
    /// Garments to check; all of the assets folder if none is named.
    ids: Vec<String>,
    /// The folder that holds the garment folders.
    #[arg(long, value_name = "DIR", default_value_os_t = in_workspace("assets-src"))]
    assets: PathBuf,
    /// Where scans are cleaned and kept.
    #[arg(long, value_name = "DIR", default_value_os_t = in_workspace("target/kitsuke-cache"))]
    cache: PathBuf,
    /// How mistakes are written.
    #[arg(long, value_enum, default_value_t)]
    message_format: MessageFormat,
}

/// How mistakes are written.
#[derive(Clone, Copy, Default, clap::ValueEnum)]
pub enum MessageFormat {
    /// With snippets and help, for people.
    #[default]
    Human,
    /// One JSON object per line.
    Json,
    /// Annotations of a GitHub workflow.
    Github,
}

impl MessageFormat {
    /// The renderer's format; colours only on a terminal that wants them.
    pub fn format(self) -> Format {
        match self {
            MessageFormat::Human => {
                Format::Human { color: std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none() }
            }
            MessageFormat::Json => Format::Json,
            MessageFormat::Github => Format::Github,
        }
    }
}

/// Checks the garments one after the other; fails if any has an error.
pub fn run(args: Args) -> ExitCode {
    let ids = match catalog::garment_ids(&args.assets, &args.ids) {
        Ok(ids) => ids,
        Err(error) => {
            eprintln!("error: {error}");
            return ExitCode::FAILURE;
        }
    };
    let mut is_sound = true;
    for id in ids {
        let workshop = Workshop { cache: &args.cache, tell: &|line| eprintln!("note: {id}: {line}") };
        let loaded = kitsuke_pipeline::load_with(&args.assets.join(&id), Some(&workshop));
        print!("{}", diagnostic::render(&loaded.diagnostics, &args.assets, args.message_format.format()));
        let summary = diagnostic::summary(&loaded.diagnostics, &id);
        match args.message_format {
            MessageFormat::Human => println!("{summary}"),
            MessageFormat::Json | MessageFormat::Github => eprintln!("{summary}"),
        }
        is_sound &= loaded.diagnostics.iter().all(|diagnostic| diagnostic.severity != Severity::Error);
    }
    if is_sound { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
