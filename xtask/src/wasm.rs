//! `cargo xtask wasm`: the runtime as WebAssembly, into the package for the web.

use crate::places::{ended, in_workspace};
use std::fs;
use std::path::Path;
use std::process::{Command, ExitCode};

const TARGET: &str = "wasm32-unknown-unknown";
/// What is built: the file, and the features of `kitsuke-wasm`.
const MODULES: [(&str, &[&str]); 2] = [("kitsuke.wasm", &[]), ("kitsuke-core.wasm", &["--no-default-features"])];

/// Build the runtime as WebAssembly into runtime/wasm/package
///
/// The files are committed, so that a viewer needs no compiler for the web; build them anew when the runtime's frames, packs or interface
/// change. Needs the target wasm32-unknown-unknown (`rustup target add wasm32-unknown-unknown`). Where only another compiler knows it,
/// name that compiler in KITSUKE_WASM_RUSTC, 1.91 or later, with the sources of its standard library installed (Debian 14: rustc and rust-src; rustc-web
/// of Debian 12 is too old).
#[derive(clap::Args)]
pub struct Args {}

/// Builds both modules; 1 when that fails.
pub fn run(_: Args) -> ExitCode {
    ended(MODULES.iter().try_for_each(|(file, features)| build(file, features)))
}

fn build(file: &str, features: &[&str]) -> Result<(), String> {
    // Absolute, because cargo runs elsewhere.
    let target_dir = std::path::absolute(in_workspace("target/web")).map_err(|error| error.to_string())?;
    let mut cargo = Command::new(env!("CARGO"));
    cargo.current_dir(in_workspace(".")).args([
        "build",
        "--package",
        "kitsuke-wasm",
        "--profile",
        "wasm",
        "--target",
        TARGET,
    ]);
    cargo.args(features).arg("--target-dir").arg(&target_dir);
    let mut flags = vec!["-Ctarget-feature=+simd128".to_owned()];
    match std::env::var("KITSUKE_WASM_RUSTC") {
        Ok(rustc) => {
            // Its standard library is built along: small, without messages of panics, which nobody could read there.
            cargo.env("RUSTC", rustc).env("RUSTC_BOOTSTRAP", "1");
            cargo.args(["-Zbuild-std=std,panic_abort", "-Zbuild-std-features=optimize_for_size"]);
            cargo.env("CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER", linker()?);
            flags.extend(["-Zunstable-options".to_owned(), "-Cpanic=immediate-abort".to_owned()]);
        }
        Err(_) if has_target() => {}
        Err(_) => {
            return Err(format!(
                "this compiler does not know the web: run `rustup target add {TARGET}`, or name one that does in KITSUKE_WASM_RUSTC"
            ));
        }
    }
    cargo.env("RUSTFLAGS", flags.join(" "));
    let status = cargo.status().map_err(|error| format!("cannot start cargo: {error}"))?;
    if !status.success() {
        return Err(format!("{file} was not built"));
    }
    let built = target_dir.join(TARGET).join("wasm/kitsuke_wasm.wasm");
    let bytes = fs::read(&built).map_err(|error| format!("cannot read {}: {error}", built.display()))?;
    let path = in_workspace("runtime/wasm/package").join(file);
    crate::places::write_whole(&path, |out| std::io::Write::write_all(out, &bytes))?;
    println!("{}: {} bytes", path.display(), bytes.len());
    Ok(())
}

/// What the compiler that builds kitsuke prints.
fn printed_by_rustc(argument: &str) -> String {
    let output = Command::new("rustc").args(["--print", argument]).output();
    output.map(|output| String::from_utf8_lossy(&output.stdout).trim().to_owned()).unwrap_or_default()
}

fn has_target() -> bool {
    Path::new(&printed_by_rustc("sysroot")).join("lib/rustlib").join(TARGET).is_dir()
}

/// The linker for WebAssembly that comes with every toolchain of rustup.
fn linker() -> Result<std::path::PathBuf, String> {
    let rustlib = Path::new(&printed_by_rustc("sysroot")).join("lib/rustlib");
    let hosts = fs::read_dir(&rustlib).map_err(|error| format!("cannot read {}: {error}", rustlib.display()))?;
    let linkers = hosts.flatten().map(|host| host.path().join("bin/rust-lld"));
    linkers.into_iter().find(|linker| linker.is_file()).ok_or_else(|| "the toolchain has no rust-lld".to_owned())
}
