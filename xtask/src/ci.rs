//! `cargo xtask ci`: exactly what CI runs after the catalog is built, each step named before it starts.

use std::process::{Command, ExitCode};

/// One step: its name, the arguments of cargo, and what is added to the environment.
type Step = (&'static str, &'static [&'static str], &'static [(&'static str, &'static str)]);

/// Formatting, lints, every test and documentation. In the profile `bench`, so that what `cargo xtask` itself was compiled from serves again.
const STEPS: &[Step] = &[
    ("format", &["fmt", "--all", "--check"], &[]),
    (
        "lints",
        &["clippy", "--workspace", "--all-targets", "--profile", "bench", "--quiet", "--", "-D", "warnings"],
        &[],
    ),
    ("tests", &["test", "--workspace", "--profile", "bench"], &[("INSTA_UPDATE", "no")]),
    (
        "runtime without features",
        &["check", "--package", "kitsuke", "--no-default-features", "--profile", "bench"],
        &[],
    ),
    (
        "documentation",
        &["doc", "--workspace", "--no-deps", "--profile", "bench", "--quiet"],
        &[("RUSTDOCFLAGS", "-D warnings")],
    ),
];

/// Run exactly what CI runs after the catalog is built
#[derive(clap::Args)]
pub struct Args {}

/// Runs the steps in order and stops at the first that fails.
pub fn run(_: Args) -> ExitCode {
    for (name, arguments, environment) in STEPS {
        println!("ci: {name}: cargo {}", arguments.join(" "));
        let status = Command::new(env!("CARGO")).args(*arguments).envs(environment.iter().copied()).status();
        match status {
            Ok(status) if status.success() => {}
            Ok(status) => {
                eprintln!("ci: {name} failed ({status})");
                return ExitCode::FAILURE;
            }
            Err(error) => {
                eprintln!("ci: cannot start cargo for {name}: {error}");
                return ExitCode::FAILURE;
            }
        }
    }
    println!("ci: all steps passed");
    ExitCode::SUCCESS
}
