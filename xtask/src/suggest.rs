//! `cargo xtask suggest ID`: the next poses that are worth making, as a pose table and as pictures.

use crate::places::{Places, ended, write_whole};
use crate::shots;
use glam::Vec3;
use kitsuke::Garment;
use kitsuke::arrays::GarmentData;
use kitsuke::skeleton::{Bone, Pose};
use kitsuke_pipeline::look::frames::{Blend, Shot, Stage};
use kitsuke_pipeline::look::scene::{Colours, Figure, Framing, Scene, View};
use kitsuke_pipeline::look::sheet::{Cell, contact_sheet, png_bytes, side_by_side};
use kitsuke_pipeline::measure::audit::{deepest, pose_depths};
use kitsuke_pipeline::measure::pose_space;
use kitsuke_pipeline::measure::suggest::{Outlook, Suggestion, outlook};
use std::path::PathBuf;
use std::process::ExitCode;

/// Poses to be good in, and as many others to choose from.
const POSES: usize = 400;
/// Where they begin among those of the pose space: away from those of audit and correctives.
const FIRST: u64 = 1 << 24;
/// Height of a picture, pixels.
const HEIGHT: u32 = 320;

/// Suggest the next poses to make: those that would lower the kimono's errors most
#[derive(clap::Args)]
pub struct Args {
    /// A kimono's ID
    id: String,
    /// How many poses
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u16).range(1..=100))]
    count: u16,
    /// Choose among the rows of this pose table, in the order in which they help most [default: poses of our own]
    #[arg(long, value_name = "FILE.csv")]
    from: Option<PathBuf>,
    /// Be good in the poses of these recorded motions [default: in poses between the targets and in everyday ones]
    #[arg(long, value_name = "FILE,…", value_delimiter = ',')]
    motion: Vec<PathBuf>,
    /// Where the table and the picture go [default: reports/ in --catalog]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    read_as: shots::ReadAs,
    #[command(flatten)]
    places: Places,
}

/// Prints the suggestions and writes table and picture; 1 when something cannot be read or written.
pub fn run(args: Args) -> ExitCode {
    ended(suggest(&args))
}

/// A suggestion with its pose and what it is called.
struct Named {
    name: String,
    shot: Shot,
    suggestion: Suggestion,
    before_mm: f64,
}

fn suggest(args: &Args) -> Result<(), String> {
    let pack = args.places.open(&args.id)?;
    let garment = pack.garment();
    let poses = if args.motion.is_empty() {
        pose_space::poses(garment, FIRST, POSES)
    } else {
        recorded(garment, &args.motion, args.read_as)?
    };
    let rows = args.from.as_ref().map(|path| shots::pose_table(path, garment.kernel())).transpose()?;
    let candidates: Vec<Shot> = match rows {
        Some(rows) => rows.into_iter().map(|row| row.shot).collect(),
        None => pose_space::poses(garment, FIRST + POSES as u64, POSES)
            .into_iter()
            .map(|pose| Shot { name: String::new(), pose, blend: Blend::Kernel(garment.kernel()) })
            .collect(),
    };
    let offered: Vec<Pose> = candidates.iter().map(|shot| shot.pose.clone()).collect();
    let count = usize::from(args.count);
    let outlooks = (0..garment.data().layer_count())
        .map(|layer| outlook(garment, layer, &poses, &offered, count).map_err(|error| error.to_string()))
        .collect::<Result<Vec<Outlook>, String>>()?;
    let chosen = merged(garment.data(), &outlooks, &candidates, count);
    if chosen.is_empty() {
        return Err("none of the poses turns a joint that a driver follows".into());
    }

    let source = args.places.source(&garment.data().id);
    for Named { name, shot, suggestion, before_mm } in &chosen {
        let inside = source.as_ref().map(|source| deepest(&pose_depths(&source.body, garment, 0, &shot.pose)).depth_m);
        let inside =
            inside.map_or(String::new(), |depth_m| format!("; cloth up to {:.0} mm in the body", 1e3 * depth_m));
        println!(
            "{name}: expected to be wrong by {:.1} mm here{inside}; with it {:.2} -> {:.2} mm over all poses of these joints",
            suggestion.error_mm, before_mm, suggestion.after_mm
        );
    }
    let dir = args.out.clone().unwrap_or_else(|| args.places.catalog.join("reports"));
    let path = dir.join(format!("{}-suggested.csv", garment.data().id));
    let table = pose_table(garment.data(), &chosen);
    write_whole(&path, |out| out.write_all(table.as_bytes()))?;
    println!("{}: rows for poses.csv, once their shapes are made", path.display());
    let path = dir.join(format!("{}-suggested.png", garment.data().id));
    let scene = Scene::new(garment, source.as_ref());
    let png = picture(garment, &scene, &chosen)?;
    write_whole(&path, |out| out.write_all(&png))?;
    println!("{}: the shapes that are expected there", path.display());
    Ok(())
}

/// The frames of recordings, as the kimono lets its wearer move, evenly thinned to the usual number.
fn recorded(garment: &Garment, motions: &[PathBuf], read_as: shots::ReadAs) -> Result<Vec<Pose>, String> {
    let mut poses = Vec::new();
    for path in motions {
        let recording = shots::recording(path, &garment.data().skeleton, read_as)?;
        let step = shots::step(recording.frames.len() * motions.len(), POSES);
        poses.extend(recording.frames.iter().step_by(step).map(|frame| garment.limited(&frame.pose).pose));
    }
    Ok(poses)
}

/// The best suggestions of all layers: next the one that lowers a layer's mean square error most.
fn merged(data: &GarmentData, outlooks: &[Outlook], candidates: &[Shot], count: usize) -> Vec<Named> {
    let mut taken = vec![0; outlooks.len()];
    let mut chosen: Vec<Named> = Vec::new();
    for _ in 0..count {
        let before_mm = |layer: usize| match taken[layer] {
            0 => outlooks[layer].before_mm,
            taken => outlooks[layer].suggestions[taken - 1].after_mm,
        };
        let gain = |layer: usize| {
            let next = outlooks[layer].suggestions.get(taken[layer])?;
            Some((layer, *next, before_mm(layer).powi(2) - next.after_mm.powi(2)))
        };
        let best = (0..outlooks.len()).filter_map(gain).max_by(|a, b| a.2.total_cmp(&b.2));
        let Some((layer, suggestion, _)) = best else { break };
        let before_mm = before_mm(layer);
        taken[layer] += 1;
        // Only this layer's joints: turning others as well would tie the layers together.
        let candidate = &candidates[suggestion.candidate];
        let bones = &outlooks[layer].bones;
        let pose = bones.iter().fold(Pose::REST, |pose, &bone| pose.with(bone, candidate.pose.rotation(bone)));
        let described = described(data, &pose, bones);
        let name = if candidate.name.is_empty() { described } else { candidate.name.clone() };
        chosen.push(Named { name, shot: Shot { pose, ..candidate.clone() }, suggestion, before_mm });
    }
    chosen
}

/// What the limbs do, in steps of 5 degrees: `left_down_40_forward_20_elbow_60`.
fn described(data: &GarmentData, pose: &Pose, bones: &[Bone]) -> String {
    const ARMS: [(&str, f32, Bone, Bone, Bone); 2] = [
        ("left", 1.0, Bone::LeftShoulder, Bone::LeftUpperArm, Bone::LeftLowerArm),
        ("right", -1.0, Bone::RightShoulder, Bone::RightUpperArm, Bone::RightLowerArm),
    ];
    const LEGS: [(&str, f32, Bone, Bone); 2] = [
        ("left", 1.0, Bone::LeftUpperLeg, Bone::LeftLowerLeg),
        ("right", -1.0, Bone::RightUpperLeg, Bone::RightLowerLeg),
    ];
    let mut words: Vec<String> = Vec::new();
    let bend = |bone: Bone| 2.0 * libm::acosf(pose.rotation(bone).w.abs().min(1.0));
    for (side, sign, shoulder, upper, lower) in ARMS.into_iter().filter(|arm| bones.contains(&arm.3)) {
        let points = (pose.rotation(shoulder) * pose.rotation(upper)) * Vec3::new(sign, 0.0, 0.0);
        words.push(side.into());
        words.extend(angle(["down", "up"], libm::asinf((-points.y).clamp(-1.0, 1.0))));
        words.extend(angle(["forward", "back"], libm::atan2f(points.z, points.x * sign)));
        words.extend(angle(["elbow", "elbow"], bend(lower)));
    }
    for (side, sign, upper, lower) in LEGS.into_iter().filter(|leg| bones.contains(&leg.2)) {
        let points = pose.rotation(upper) * Vec3::NEG_Y;
        words.push(format!("{side}_leg"));
        words.extend(angle(["forward", "back"], libm::atan2f(points.z, -points.y)));
        words.extend(angle(["out", "in"], libm::asinf((points.x * sign).clamp(-1.0, 1.0))));
        words.extend(angle(["knee", "knee"], bend(lower)));
    }
    if words.is_empty() {
        words.extend(bones.iter().map(|bone| bone.name().to_owned()));
    }
    let name = words.join("_");
    let is_taken = |name: &str| data.targets.iter().any(|target| target.name == name);
    let others = (2..).map(|number| format!("{name}_{number}"));
    std::iter::once(name.clone()).chain(others).find(|name| !is_taken(name)).unwrap_or(name)
}

fn angle([positive, negative]: [&str; 2], angle_rad: f32) -> Option<String> {
    let degrees = (angle_rad.to_degrees() / 5.0).round() * 5.0;
    (degrees != 0.0).then(|| format!("{}_{}", if degrees > 0.0 { positive } else { negative }, degrees.abs()))
}

/// Rows in the columns of the kimono's own table.
fn pose_table(data: &GarmentData, chosen: &[Named]) -> String {
    let columns =
        data.poses.bones.iter().flat_map(|bone| ["qx", "qy", "qz", "qw"].map(|q| format!(",{}_{q}", bone.name())));
    let mut text = format!("file,name{}\n", columns.collect::<String>());
    for (number, Named { name, shot, .. }) in chosen.iter().enumerate() {
        text += &format!("poses/{:02}_{name}.obj,{name}", data.poses.rows() + number);
        for &bone in &data.poses.bones {
            let q = shot.pose.rotation(bone);
            text += &format!(",{:.6},{:.6},{:.6},{:.6}", q.x, q.y, q.z, q.w);
        }
        text.push('\n');
    }
    text
}

fn picture(garment: &Garment, scene: &Scene, chosen: &[Named]) -> Result<Vec<u8>, String> {
    let mut stage = Stage::new(garment);
    let figures: Vec<Figure> =
        chosen.iter().map(|named| scene.figure(&mut stage, &named.shot, Colours::Cloth)).collect();
    let framings = [View::Front, View::Side, View::Back].map(|view| Framing::of(&figures, view));
    let cell = |(figure, named): (&Figure, &Named)| Cell {
        caption: named.name.clone(),
        picture: side_by_side(&framings.map(|framing| scene.draw(figure, framing, HEIGHT))),
    };
    let cells: Vec<Cell> = figures.iter().zip(chosen).map(cell).collect();
    png_bytes(&contact_sheet(&cells, 2)).map_err(|error| error.to_string())
}
