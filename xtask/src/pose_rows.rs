//! `cargo xtask pose-rows`: rows for a pose table from recorded frames, posed bodies or angles.

use crate::new::{BODY, Names, plain_name};
use crate::places::{ended, in_workspace, say, write_whole};
use crate::shots;
use clap::ArgGroup;
use glam::Quat;
use kitsuke::skeleton::{Bone, Pose, Skeleton, angle_between_rad};
use kitsuke_pipeline::catalog;
use kitsuke_pipeline::source::folder::Folder;
use kitsuke_pipeline::source::pose_rows::{Columns, Form, Lost, appended, read_angles};
use kitsuke_pipeline::source::{body, manifest, tables};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// The joints of a table that no garment has yet: those of `_template/recommended_poses.csv`.
const JOINTS: [Bone; 10] = [
    Bone::LeftShoulder,
    Bone::LeftUpperArm,
    Bone::LeftLowerArm,
    Bone::RightShoulder,
    Bone::RightUpperArm,
    Bone::RightLowerArm,
    Bone::LeftUpperLeg,
    Bone::LeftLowerLeg,
    Bone::RightUpperLeg,
    Bone::RightLowerLeg,
];
/// So many joints that a row cannot turn are named.
const SHOWN_JOINTS: usize = 6;

/// Make rows for poses.csv from frames of a recorded motion, from bodies as they were posed, or from angles
#[derive(clap::Args)]
#[command(group = ArgGroup::new("from").required(true).args(["motion", "posed", "angles"]))]
pub struct Args {
    /// A recorded motion (BVH, .vrma, MediaPipe, Kinect, DeepMimic, JSON Lines)
    #[arg(long, value_name = "FILE", requires = "frame")]
    motion: Option<PathBuf>,
    /// Its frames, counted from 0
    #[arg(long, value_name = "N,…", value_delimiter = ',', requires = "motion")]
    frame: Vec<usize>,
    /// Bodies as they were posed: GLB or VRM
    #[arg(long, value_name = "FILE.glb,…", value_delimiter = ',')]
    posed: Vec<PathBuf>,
    /// Angles as in the columns of a pose table: "leftUpperArm_rz_deg=-45 rightUpperArm_rz_deg=45"
    #[arg(long, value_name = "COLUMN=DEG …")]
    angles: Option<String>,
    /// The kimono whose pose table shall take the rows: they get its columns [default: arms and legs]
    #[arg(long = "for", value_name = "ID")]
    garment: Option<String>,
    /// Put the rows at the end of that kimono's pose table
    #[arg(long, requires = "garment", conflicts_with = "out")]
    append: bool,
    /// Write a new table instead of printing it
    #[arg(long, value_name = "FILE.csv")]
    out: Option<PathBuf>,
    /// Name of the pose [default: that of the file, with the frame]
    #[arg(long)]
    name: Option<String>,
    /// Rotations as quaternions instead of angles in degrees
    #[arg(long, conflicts_with = "garment")]
    quaternions: bool,
    #[command(flatten)]
    read_as: shots::ReadAs,
    /// The folder with one folder per kimono
    #[arg(long, value_name = "DIR", default_value_os_t = in_workspace("assets-src"))]
    assets: PathBuf,
}

/// Prints or writes the rows; 1 when something cannot be read or written.
pub fn run(args: Args) -> ExitCode {
    ended(pose_rows(&args))
}

/// A pose and what it may be called.
struct Named {
    name: String,
    pose: Pose,
}

/// What takes the rows.
struct Table {
    path: PathBuf,
    bytes: Vec<u8>,
    columns: Columns,
    /// How many rows it has.
    count: usize,
    names: Names,
}

/// Who is posed.
struct Wearer {
    file: String,
    bytes: Vec<u8>,
    skeleton: Skeleton,
}

fn pose_rows(args: &Args) -> Result<(), String> {
    if let Some(out) = args.out.as_deref().filter(|out| out.exists()) {
        return Err(format!(
            "{} exists already: choose another name, or put the rows at the end of a kimono's own table with --for ID --append",
            out.display()
        ));
    }
    // Angles need no wearer, and their mistakes are said whatever else is missing.
    let typed = args.angles.as_ref().map(|text| {
        let mut report = Vec::new();
        read_angles(text, &mut report).ok_or_else(|| shots::said(&report))
    });
    let typed = typed.transpose()?;
    let (table, body) = match &args.garment {
        Some(id) => garment(&args.assets, id).map(|(table, body)| (Some(table), body))?,
        None => (None, args.assets.join(BODY)),
    };
    let (bones, poses) = match typed {
        Some((bones, pose)) => (bones, vec![Named { name: "pose".to_owned(), pose }]),
        None => {
            let wearer = wearer(&body)?;
            let poses = match &args.motion {
                Some(motion) => frames(motion, &args.frame, &wearer.skeleton, args.read_as),
                None => posed(&args.posed, &wearer),
            };
            (Vec::new(), poses?)
        }
    };
    let own = || {
        let mut joints = JOINTS.to_vec();
        joints.extend(bones.iter().filter(|bone| !JOINTS.contains(bone)));
        Columns::of(&joints, if args.quaternions { Form::Quaternions } else { Form::Degrees })
    };
    let (columns, count, mut names, old) = match table {
        Some(Table { path, bytes, columns, count, names }) => (columns, count, names, Some((path, bytes))),
        None => (own(), 1, Names::default(), None),
    };
    let mut rows = Vec::new();
    let mut files = Vec::new();
    for (Named { name, pose }, number) in poses.iter().zip(count.max(1)..) {
        let wanted = match &args.name {
            Some(wanted) => plain_name(wanted),
            None => name.clone(),
        };
        let name = names.unused(&wanted);
        say_what_is_left_out(&name, &columns, pose, args.garment.is_some());
        let file = format!("poses/{number:02}_{name}.obj");
        rows.push(columns.row(&file, &name, pose));
        files.push(file);
    }
    match old.filter(|_| args.append) {
        Some((path, bytes)) => {
            let text = appended(&bytes, &rows);
            write_whole(&path, |out| out.write_all(&text))?;
            say!("{}: now with rows for {}, whose shapes are to be made", path.display(), files.join(", "));
        }
        None => {
            let text = format!("{}\n{}\n", columns.header(), rows.join("\n"));
            match &args.out {
                Some(out) => {
                    write_whole(out, |out| out.write_all(text.as_bytes()))?;
                    say!("{}: rows for {}", out.display(), files.join(", "));
                }
                None => say!("{}", text.trim_end()),
            }
        }
    }
    Ok(())
}

/// The pose table of a garment, whose shapes need not be there yet, and the path of its body.
fn garment(assets: &Path, id: &str) -> Result<(Table, PathBuf), String> {
    let ids = catalog::garment_ids(assets, &[id.to_owned()]).map_err(|error| error.to_string())?;
    let dir = assets.join(ids.first().map_or(id, String::as_str));
    let path = dir.join(manifest::FILE_NAME);
    let mut report = Vec::new();
    let manifest = manifest::read(&path.to_string_lossy(), &shots::read(&path)?, &mut report);
    let manifest = manifest.ok_or_else(|| shots::said(&report))?;
    let folder = Folder::new(&dir).map_err(|diagnostic| shots::said(&[*diagnostic]))?;
    let named = |key: &str, field: Option<&manifest::Field<String>>| {
        let missing = || format!("{}: `{key}` is missing; name the file there", path.display());
        let name = folder.name_of(field.and_then(manifest::Field::get).ok_or_else(missing)?);
        name.map(|name| assets.join(name)).map_err(|problem| format!("{}: {key}: {problem}", path.display()))
    };
    let (table, body) = (named("poses", manifest.poses.as_ref())?, named("body", manifest.body.as_ref())?);
    let (file, bytes) = (table.to_string_lossy(), shots::read(&table)?);
    report.clear();
    let columns = tables::read_rotations(&file, &bytes, &mut report)
        .and_then(|rows| Some((Columns::of_table(&file, &bytes, &mut report)?, rows.rows)));
    let (columns, rows) = columns.ok_or_else(|| shots::said(&report))?;
    let names = Names::taken(rows.iter().map(|row| row.name.as_str()));
    Ok((Table { path: table, bytes, columns, count: rows.len(), names }, body))
}

fn wearer(path: &Path) -> Result<Wearer, String> {
    let (file, bytes) = (path.to_string_lossy().into_owned(), shots::read(path)?);
    let mut report = Vec::new();
    let body = body::read(&file, &bytes, &mut report).ok_or_else(|| shots::said(&report))?;
    Ok(Wearer { file, bytes, skeleton: body.skeleton })
}

fn frames(path: &Path, frames: &[usize], wearer: &Skeleton, read_as: shots::ReadAs) -> Result<Vec<Named>, String> {
    let recording = shots::recording(path, wearer, read_as)?;
    let count = recording.frames.len();
    let beyond: Vec<String> = frames.iter().filter(|frame| **frame >= count).map(usize::to_string).collect();
    if !beyond.is_empty() {
        let last = count - 1;
        return Err(format!("{} has no frame {}: its frames are 0 to {last}", path.display(), beyond.join(", ")));
    }
    let stem = plain_name(&path.file_stem().unwrap_or_default().to_string_lossy());
    let named = |&frame: &usize| Named { name: format!("{stem}_{frame}"), pose: recording.frames[frame].pose.clone() };
    Ok(frames.iter().map(named).collect())
}

/// The poses of all files, or the mistakes of all.
fn posed(paths: &[PathBuf], wearer: &Wearer) -> Result<Vec<Named>, String> {
    let (mut poses, mut report, mut unreadable) = (Vec::new(), Vec::new(), Vec::new());
    for path in paths {
        let file = path.to_string_lossy();
        let bytes = match shots::read(path) {
            Ok(bytes) => bytes,
            Err(error) => {
                unreadable.push(error);
                continue;
            }
        };
        let Some(posed) = body::read_pose(&file, &bytes, &wearer.skeleton, &wearer.bytes, &mut report) else {
            continue;
        };
        let rest = if posed.is_own_rest {
            "the T-pose in which it was bound"
        } else {
            &format!("{}, whose joints have the same axes", wearer.file)
        };
        eprintln!("note: {file}: turns are against {rest}");
        poses.push(Named {
            name: plain_name(&path.file_stem().unwrap_or_default().to_string_lossy()),
            pose: posed.pose,
        });
    }
    if !report.is_empty() {
        unreadable.push(shots::said(&report));
    }
    if unreadable.is_empty() { Ok(poses) } else { Err(unreadable.join("\n")) }
}

/// What a row does not give: turns without columns, and where the hips went.
fn say_what_is_left_out(name: &str, columns: &Columns, pose: &Pose, is_for_table: bool) {
    let (of_axes, of_joints): (Vec<Lost>, Vec<Lost>) =
        columns.lost(pose).into_iter().partition(|lost| !lost.missing.is_empty());
    for lost in of_axes {
        eprintln!(
            "note: {name}: {} turns about an axis that the table has no column for: the row is off by {:.0} degrees; add {}",
            lost.bone.name(),
            lost.apart_deg,
            lost.missing.join(", ")
        );
    }
    if !of_joints.is_empty() {
        let shown = of_joints.iter().take(SHOWN_JOINTS);
        let shown: Vec<String> = shown.map(|lost| format!("{} {:.0}", lost.bone.name(), lost.apart_deg)).collect();
        let more = match of_joints.len() - shown.len() {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        let which = if is_for_table { "the table has" } else { "there are" };
        eprintln!(
            "note: {name}: joints that turn and for which {which} no columns, degrees: {}{more}; leave them unturned in the shape, or add \
             columns (JOINT_rx_deg, JOINT_ry_deg, JOINT_rz_deg)",
            shown.join(", ")
        );
    }
    let hips_deg = angle_between_rad(pose.rotation(Bone::Hips), Quat::IDENTITY).to_degrees();
    let hips_m = pose.hips_translation_m.length();
    if hips_deg > 1.0 || hips_m > 0.01 {
        eprintln!(
            "note: {name}: the hips turn by {hips_deg:.0} degrees and move by {hips_m:.2} m, which rows leave out: shapes are made with the hips as \
             in the T-pose"
        );
    }
}
