//! `cargo xtask register ID SCAN`: a scan as a target shape, in the base's own topology, and how near it comes.

use crate::places::{Places, ended, say, write_whole};
use crate::registration_error::{Against, read_truth, spread};
use crate::scan_texture::TextureArgs;
use crate::scans::ScanArgs;
use glam::{DVec3, Vec3};
use kitsuke_pipeline::ir;
use kitsuke_pipeline::look::raster::{Camera, Lens, Paint, Shape, render, smooth_normals};
use kitsuke_pipeline::look::sheet::{Cell, contact_sheet, png_bytes};
use kitsuke_pipeline::stages::register::{Registered, Scan, Settings, register};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

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
    let garment =
        args.places.source(&args.id).ok_or_else(|| format!("{} has mistakes: cargo xtask check {0}", args.id))?;
    let base_m: Vec<DVec3> = garment.base.positions_m.iter().map(|p| p.as_dvec3()).collect();
    let triangles = &garment.base.triangles;
    let scan = args.scan.read()?;
    let cleaned = args.scan.clean(&scan)?;
    let coloured = cleaned.carried(&scan.mesh);
    let scan = Scan {
        positions_m: cleaned.positions_m.clone(),
        triangles: cleaned.triangles.clone(),
        knows_front: scan.knows_front,
        landmarks: Vec::new(),
    };
    let started = Instant::now();
    let laid = register(&base_m, triangles, &scan, &Settings::default()).map_err(|error| error.to_string())?;
    say!("{}", table(&laid, triangles.len(), started.elapsed().as_secs_f64()));
    if let Some(truth) = &args.truth {
        let truth = read_truth(truth, base_m.len())?;
        say!("{}", Against::truth(&laid.positions_m, &base_m, triangles, &truth).text());
    }
    write_whole(&args.out, |out| {
        laid.positions_m.iter().try_for_each(|p| writeln!(out, "v {:.6} {:.6} {:.6}", p.x, p.y, p.z))?;
        triangles.iter().try_for_each(|[a, b, c]| writeln!(out, "f {} {} {}", a + 1, b + 1, c + 1))
    })?;
    if let Some(path) = &args.picture {
        let png = picture(&garment, &laid, &scan)?;
        write_whole(path, |out| out.write_all(&png))?;
    }
    args.texture.write(&args.scan.file, &garment, &laid, &coloured)?;
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
fn picture(garment: &ir::Garment, laid: &Registered, scan: &Scan) -> Result<Vec<u8>, String> {
    const FULL_M: f32 = 0.01;
    let scan_m: Vec<Vec3> = scan.positions_m.iter().map(|&p| laid.base_from_scan.place(p).as_vec3()).collect();
    let laid_m: Vec<Vec3> = laid.positions_m.iter().map(|p| p.as_vec3()).collect();
    let heat = |distance_m: f64| {
        let t = (distance_m as f32 / FULL_M).min(1.0);
        [(70.0 + 170.0 * t) as u8, (130.0 - 70.0 * t) as u8, (200.0 - 160.0 * t) as u8]
    };
    let from_scan: Vec<[u8; 3]> = laid.from_scan_m.iter().map(|&d| heat(d)).collect();
    let confidence: Vec<[u8; 3]> = laid.confidence.iter().map(|&c| heat(f64::from(FULL_M) * (1.0 - c))).collect();
    let mut cells = Vec::new();
    for (name, side) in [("front", 1.0), ("behind", -1.0)] {
        let camera = Camera {
            eye_m: Vec3::new(0.0, 0.85, 4.0 * side),
            target_m: Vec3::new(0.0, 0.85, 0.0),
            lens: Lens::Orthographic { height_m: 1.7 },
        };
        let mut draw = |caption: &str, positions_m: &[Vec3], triangles: &[[u32; 3]], paint: Paint<'_>| {
            let normals = smooth_normals(positions_m, triangles);
            let shape = Shape { positions_m, normals: &normals, triangles, paint, inside: Some([120, 110, 100]) };
            let picture = render(&[shape], &camera, [640, 640], [244, 243, 240]);
            cells.push(Cell { caption: format!("{caption}, {name}"), picture });
        };
        draw("scan, red 10 mm from the base", &scan_m, &scan.triangles, Paint::PerVertex(&from_scan));
        draw("registered, red not seen", &laid_m, &garment.base.triangles, Paint::PerVertex(&confidence));
        draw("registered", &laid_m, &garment.base.triangles, Paint::Plain([96, 110, 150]));
    }
    png_bytes(&contact_sheet(&cells, 3)).map_err(|error| error.to_string())
}
