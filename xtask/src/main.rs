//! `cargo xtask <verb>`: one file per verb.

use clap::Parser;
use std::process::ExitCode;

mod ci;
mod evaluate;
mod inspect;
mod places;
mod preview;
mod shots;

/// The project's commands
#[derive(clap::Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", version)]
enum Verb {
    Ci(ci::Args),
    Evaluate(evaluate::Args),
    Inspect(inspect::Args),
    Preview(preview::Args),
}

fn main() -> ExitCode {
    match Verb::parse() {
        Verb::Ci(args) => ci::run(args),
        Verb::Evaluate(args) => evaluate::run(args),
        Verb::Inspect(args) => inspect::run(args),
        Verb::Preview(args) => preview::run(args),
    }
}
