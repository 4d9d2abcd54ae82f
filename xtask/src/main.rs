//! `cargo xtask <verb>`: one file per verb.

mod bench;
mod build_catalog;
mod check;
mod ci;
mod evaluate;
mod inspect;
mod leave_one_out;
mod new;
mod places;
mod preview;
mod schema;
mod shots;
mod skinning;

use clap::Parser;
use std::process::ExitCode;

/// Kimono packs: check, build, look, measure
#[derive(clap::Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask", version)]
enum Verb {
    Bench(bench::Args),
    BuildCatalog(build_catalog::Args),
    Check(check::Args),
    Ci(ci::Args),
    Evaluate(evaluate::Args),
    Inspect(inspect::Args),
    LeaveOneOut(leave_one_out::Args),
    New(new::Args),
    Preview(preview::Args),
    Schema(schema::Args),
    Skinning(skinning::Args),
}

fn main() -> ExitCode {
    match Verb::parse() {
        Verb::Bench(args) => bench::run(args),
        Verb::BuildCatalog(args) => build_catalog::run(args),
        Verb::Check(args) => check::run(args),
        Verb::Ci(args) => ci::run(args),
        Verb::Evaluate(args) => evaluate::run(args),
        Verb::Inspect(args) => inspect::run(args),
        Verb::LeaveOneOut(args) => leave_one_out::run(args),
        Verb::New(args) => new::run(args),
        Verb::Preview(args) => preview::run(args),
        Verb::Schema(args) => schema::run(args),
        Verb::Skinning(args) => skinning::run(args),
    }
}
