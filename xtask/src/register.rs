//! `cargo xtask register ID SCAN`: a scan as a target shape, in the base's own topology, and how near it comes.

use crate::places::{Places, ended, say, write_whole};
use crate::registration_error::{Against, spread};
use crate::scan_texture::TextureArgs;
use crate::scans::{Registration, ScanArgs, registration};
use glam::DVec3;
use kitsuke_pipeline::look::laid_on::{COLUMNS, LaidOn, pictures};
use kitsuke_pipeline::look::sheet::{contact_sheet, png_bytes};
use kitsuke_pipeline::stages::register::{Registered, Scan};
use std::path::PathBuf;
use std::process::ExitCode;

/// Lay a kimono's base onto a scan: the same vertices in the scan's shape, a target
///
/// The scan is cleaned first (see `clean`), then moved rigidly, then the base is deformed onto it. Prints how far both lie apart; with
/// --truth, how far from the right shape. Writes OBJ in metres with the base's vertices in their order.
#[derive(clap::Args)]
pub struct Args {
    /// A kimono's ID
    id: String,
    #[command(flatten)]
    scan: ScanArgs,
    /// The registered shape
    #[arg(long, value_name = "FILE.obj")]
    out: PathBuf,
    /// Pictures of the scan and of the registered shape, coloured by how far it lies from the scan
    #[arg(long, value_name = "FILE.png")]
    picture: Option<PathBuf>,
    /// The right shape, vertex by vertex, in metres: an OBJ to compare with after the best rigid motion
    #[arg(long, value_name = "FILE.obj")]
    truth: Option<PathBuf>,
    #[command(flatten)]
    texture: TextureArgs,
    #[command(flatten)]
    places: Places,
}

/// Registers; 1 when something cannot be read, cleaned or laid on.
pub fn run(args: Args) -> ExitCode {
    ended(registered(&args))
}

fn registered(args: &Args) -> Result<(), String> {
    let Registration { garment, base_m, scan, coloured, laid, truth, seconds } =
        registration(&args.places, &args.id, &args.scan, args.truth.as_deref())?;
    let triangles = &garment.base.triangles;
    say!("{}", table(&laid, triangles.len(), seconds));
    if let Some(truth) = truth {
        say!("{}", Against::truth(&laid.positions_m, &base_m, triangles, &truth).text());
    }
    write_whole(&args.out, |out| {
        laid.positions_m.iter().try_for_each(|p| writeln!(out, "v {:.6} {:.6} {:.6}", p.x, p.y, p.z))?;
        triangles.iter().try_for_each(|[a, b, c]| writeln!(out, "f {} {} {}", a + 1, b + 1, c + 1))
    })?;
    if let Some(path) = &args.picture {
        let png = picture(triangles, &laid, &scan)?;
        write_whole(path, |out| out.write_all(&png))?;
    }
    args.texture.write(&args.scan.mesh.file, &garment, &laid, &coloured)?;
    Ok(())
}

fn table(laid: &Registered, triangles: usize, seconds: f64) -> String {
    let seen = laid.confidence.iter().filter(|c| **c > 0.5).count();
    format!(
        "mm                      mean  median    80 %    95 %     max\nbase to scan        {}\nscan to base        {}\n\
         {} of {} vertices were seen in the scan, {} of {triangles} triangles are turned over; {seconds:.1} s; rigidly {:.1} mm\n",
        spread(&laid.to_scan_m),
        spread(&laid.from_scan_m),
        seen,
        laid.confidence.len(),
        laid.turned_over.len(),
        laid.aligned_m * 1e3
    )
}

/// The scan and the registered shape from the front and behind.
fn picture(triangles: &[[u32; 3]], laid: &Registered, scan: &Scan) -> Result<Vec<u8>, String> {
    let scan_m: Vec<DVec3> = scan.positions_m.iter().map(|&p| laid.base_from_scan.place(p)).collect();
    let laid_on = LaidOn {
        cloth_m: &laid.positions_m,
        triangles,
        confidence: &laid.confidence,
        scan_m: &scan_m,
        scan_triangles: &scan.triangles,
        from_scan_m: &laid.from_scan_m,
    };
    png_bytes(&contact_sheet(&pictures(&laid_on, 640), COLUMNS)).map_err(|error| error.to_string())
}
