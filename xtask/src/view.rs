//! `cargo xtask view`: a page in which an artist sees the kimono while she works: what she saves is checked, built and shown.

mod server;
mod state;
mod watch;
mod wearer;

use crate::places::{ended, in_workspace};
use kitsuke_pipeline::catalog;
use state::{Places, State};
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

/// Show kimonos in the browser, and again after every change
///
/// Prints an address to be opened in a browser on this machine. What is saved in a garment's folder is checked and built; mistakes
/// appear in the page in the words of `check`, and packs are shown as soon as they are built. The index of the catalog follows, as with
/// `build-catalog`.
#[derive(clap::Args)]
pub struct Args {
    /// Garments to show; all of the assets folder if none is named
    ids: Vec<String>,
    /// Where to serve; only this machine unless another address of its own is named
    #[arg(long, value_name = "ADDRESS", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    address: IpAddr,
    /// The port; any that is free unless given
    #[arg(long, default_value_t = 0)]
    port: u16,
    /// The folder with one folder per kimono
    #[arg(long, value_name = "DIR", default_value_os_t = in_workspace("assets-src"))]
    assets: PathBuf,
    /// The folder of index and packs
    #[arg(long, value_name = "DIR", default_value_os_t = in_workspace("catalog"))]
    catalog: PathBuf,
    /// The folder of earlier results; may be deleted at any time
    #[arg(long, value_name = "DIR", default_value_os_t = in_workspace("target/kitsuke-cache"))]
    cache: PathBuf,
}

/// Serves until it is interrupted; 1 when it cannot begin.
pub fn run(args: Args) -> ExitCode {
    ended(view(args))
}

fn view(args: Args) -> Result<(), String> {
    let Args { ids, address, port, assets, catalog, cache } = args;
    let ids = catalog::garment_ids(&assets, &ids).map_err(|error| error.to_string())?;
    let state = Arc::new(State::new(Places { assets, catalog, cache }, &ids));
    let changes = watch::changes(&state.places.assets)?;
    let builder = Arc::clone(&state);
    std::thread::spawn(move || builder.keep_built(&changes));
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let runtime = runtime.map_err(|error| format!("cannot start the server: {error}"))?;
    runtime.block_on(server::serve(state, SocketAddr::new(address, port)))
}
