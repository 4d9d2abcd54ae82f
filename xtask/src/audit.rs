//! `cargo xtask audit`: how deep the cloth lies in the wearer's body, over many poses.

use crate::places::{Places, write_whole};
use kitsuke::Garment;
use kitsuke::garment::GarmentData;
use kitsuke::skeleton::Pose;
use kitsuke_pipeline::audit::{Audit, CLASSES_M, Depth, audit, pose_depths};
use kitsuke_pipeline::frames::{Blend, Shot, Stage, own_poses};
use kitsuke_pipeline::ir::Body;
use kitsuke_pipeline::pose_space;
use kitsuke_pipeline::scene::{Colours, Figure, Framing, Scene, View};
use kitsuke_pipeline::sheet::{Cell, contact_sheet, png_bytes};
use std::path::PathBuf;
use std::process::ExitCode;

/// Measure how deep the cloth lies in the wearer, without and with clearance, and draw the worst pose
#[derive(clap::Args)]
pub struct Args {
    /// A kimono's ID
    #[arg(value_name = "ID", default_value = "komon")]
    garment: String,
    /// How many poses, always the same ones
    #[arg(long, default_value_t = 2000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    poses: u32,
    /// Where the picture goes [default: reports/ in --catalog]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    places: Places,
}

/// Deeper than this is marked red, metres.
const MARKED_M: f32 = 0.002;

/// Measures; 1 when something cannot be read or written.
pub fn run(args: Args) -> ExitCode {
    match report(&args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

fn report(args: &Args) -> Result<(), String> {
    let pack = args.places.open(&args.garment)?;
    let garment = pack.garment();
    let id = &garment.data().id;
    let source = args.places.source(id).ok_or("the body is needed to measure against")?;
    let poses = pose_space::poses(&garment.data().poses, args.poses as usize);
    let found = audit(&source.body, garment, &poses);
    print_audit(garment, &source.body, &found);
    print_samples(garment, &source.body);

    let picture = draw(garment, &source, &poses, &found)?;
    let path = args.out.clone().unwrap_or_else(|| args.places.catalog.join("reports")).join(format!("{id}-audit.png"));
    write_whole(&path, |out| out.write_all(&picture))?;
    println!("{}", path.display());
    Ok(())
}

fn print_audit(garment: &Garment, body: &Body, found: &Audit) {
    for (name, side) in [("without clearance", &found.before), ("with clearance", &found.after)] {
        println!("{name}: worst {}", described(garment, body, &side.worst()));
        let (all, beyond) = (side.by_pose.len(), side.poses_beyond(MARKED_M));
        println!("  {beyond} of {all} poses have a vertex deeper than {} mm", MARKED_M * 1e3);
        let ends = CLASSES_M.iter().map(|end_m| format!("up to {} mm", end_m * 1e3));
        for (end, count) in ends.chain(["deeper".to_owned()]).zip(side.classes) {
            println!("  {end:<12} {count:>9} vertices");
        }
    }
}

/// At the samples the cloth is as the artist made it.
fn print_samples(garment: &Garment, body: &Body) {
    println!("at the samples, where the artist's shapes stay as they are:");
    for (number, shot) in own_poses(garment).iter().enumerate() {
        let [_, after] = pose_depths(body, garment, number, &shot.pose);
        let worst = after.iter().copied().max_by(|a, b| a.depth_m.total_cmp(&b.depth_m));
        if let Some(worst) = worst.filter(|worst| worst.depth_m > 1e-3) {
            println!("  {:<26} {}", shot.name, described(garment, body, &worst));
        }
    }
}

fn described(garment: &Garment, body: &Body, depth: &Depth) -> String {
    let bone = body.skeleton.joints()[usize::from(depth.joint)].bone;
    let source_vertex = garment.data().mesh.source_vertex[depth.vertex as usize];
    let mm = depth.depth_m * 1e3;
    format!("{mm:.2} mm in {} at vertex {source_vertex} of the base file, pose {}", bone.name(), depth.pose)
}

/// The pose that was worst without clearance and the one that still is with it, each without and with, penetrating
/// cloth red.
fn draw(
    garment: &Garment,
    source: &kitsuke_pipeline::ir::Garment,
    poses: &[Pose],
    found: &Audit,
) -> Result<Vec<u8>, String> {
    let data = GarmentData { proxies: Vec::new(), ..garment.data().clone() };
    let unclear = Garment::new(data).map_err(|error| error.to_string())?;
    let scenes = [Scene::new(&unclear, Some(source), false), Scene::new(garment, Some(source), false)];
    let mut stages = [Stage::new(&unclear), Stage::new(garment)];
    let mut cells = Vec::new();
    for worst in [found.before.worst(), found.after.worst()] {
        let pose = &poses[worst.pose];
        let depths = pose_depths(&source.body, garment, worst.pose, pose);
        let shot = Shot { name: String::new(), pose: pose.clone(), blend: Blend::Kernel(garment.kernel()) };
        let figures: Vec<Figure> = scenes
            .iter()
            .zip(&mut stages)
            .zip(&depths)
            .map(|((scene, stage), depths)| {
                let mut figure = scene.figure(stage, &shot, Colours::Error(1.0));
                let deep = depths.iter().filter(|depth| depth.depth_m > MARKED_M);
                figure.mark(&deep.map(|depth| depth.vertex).collect::<Vec<_>>());
                figure
            })
            .collect();
        for view in [View::Front, View::Side] {
            let framing = Framing::of(&figures, view);
            for ((scene, figure), state) in scenes.iter().zip(&figures).zip(["without", "with"]) {
                let caption = format!("pose {}: {state} clearance", worst.pose);
                cells.push(Cell { caption, picture: scene.draw(figure, framing, 640) });
            }
        }
    }
    png_bytes(&contact_sheet(&cells, 4)).map_err(|error| error.to_string())
}
