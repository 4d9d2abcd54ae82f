//! `cargo xtask new`: a kimono folder from `assets-src/_template` and the given shapes.

use crate::places::in_workspace;
use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::{fs, io};

/// The files of a new folder; `{name}` stands for the kimono's name.
const MANIFEST: &str = include_str!("../../assets-src/_template/garment.toml");
/// The pose table with its first row, the base.
const POSES: &str = include_str!("../../assets-src/_template/poses.csv");

/// The body that the template names, and where it lies.
pub const BODY: &str = "bodies/b04.glb";
const ASSETS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../assets-src");

/// Longest name, bytes: some systems take no longer file names than 255, and the names of poses get a number and an ending.
const NAME_BYTES: usize = 200;

/// Make a kimono folder from the template, from given OBJ files
#[derive(clap::Args)]
pub struct Args {
    /// The kimono's ID, which becomes the folder's name: a-z, 0-9, _ and -.
    id: String,
    /// The base in the T-pose, then the targets, in the order of the pose table.
    #[arg(long, num_args = 1.., value_names = ["BASE.obj", "TARGET.obj"])]
    from: Vec<PathBuf>,
    /// The folder that gets the new one.
    #[arg(long, value_name = "DIR", default_value_os_t = in_workspace("assets-src"))]
    into: PathBuf,
}

/// Makes the folder, or says why not; never touches one that exists.
pub fn run(args: Args) -> ExitCode {
    match make(&args) {
        Ok(folder) => {
            println!("{} is ready.", folder.display());
            match args.from.len() {
                0 => println!("1. Put base.obj and the targets into it, a row for each into poses.csv."),
                1 => println!(
                    "1. Put the targets into poses/, and a row for each into poses.csv: file, name, joint rotations."
                ),
                _ => println!(
                    "1. Write each target's joint rotations into poses.csv; they are those of the T-pose still."
                ),
            }
            println!(
                "   cargo xtask pose-rows makes rows from recordings, posed bodies and angles; {} has rows to copy.",
                in_workspace("assets-src/_template/recommended_poses.csv").display()
            );
            println!("2. Look over unit, up and body in garment.toml.");
            println!("3. cargo xtask check {} --assets {}", args.id, args.into.display());
            ExitCode::SUCCESS
        }
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

fn make(args: &Args) -> Result<PathBuf, String> {
    let is_allowed = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_' || c == '-';
    if !args.id.starts_with(|c: char| c.is_ascii_alphanumeric()) || !args.id.chars().all(is_allowed) {
        return Err(format!("`{}` is no ID: use a-z, 0-9, _ and -, beginning with a letter or digit", args.id));
    }
    // Before anything is written, so that a wrong path leaves nothing behind.
    for shape in &args.from {
        let is_obj = shape.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("obj"));
        if !is_obj || !shape.is_file() {
            return Err(format!("{}: there is no such OBJ file", shape.display()));
        }
    }
    let folder = args.into.join(&args.id);
    let failed = |error: io::Error| format!("{}: {error}", folder.display());
    fs::create_dir_all(&args.into).map_err(failed)?;
    fs::create_dir(&folder).map_err(|error| match error.kind() {
        io::ErrorKind::AlreadyExists => format!("{} exists already; choose another ID", folder.display()),
        _ => failed(error),
    })?;
    fill(&folder, args).map_err(failed)?;
    Ok(folder)
}

fn fill(folder: &Path, args: &Args) -> io::Result<()> {
    // The template names this body; a parent elsewhere gets a copy, since nothing outside it is read.
    let body = args.into.join(BODY);
    if !body.exists() {
        fs::create_dir_all(body.parent().unwrap_or(&args.into))?;
        fs::copy(Path::new(ASSETS).join(BODY), body)?;
    }
    fs::write(folder.join("garment.toml"), MANIFEST.replace("{name}", &args.id))?;
    let mut poses = POSES.to_owned();
    let mut names = Names::taken(POSES.lines().skip(1).filter_map(|row| row.split(',').nth(1)));
    let rest = poses.lines().nth(1).and_then(|row| row.splitn(3, ',').nth(2)).unwrap_or_default().to_owned();
    fs::create_dir(folder.join("poses"))?;
    if let Some((base, targets)) = args.from.split_first() {
        fs::copy(base, folder.join("base.obj"))?;
        for (i, target) in targets.iter().enumerate() {
            let name = names.unused(&pose_name(target));
            let file = format!("poses/{:02}_{name}.obj", i + 1);
            fs::copy(target, folder.join(&file))?;
            poses += &format!("{file},{name},{rest}\n");
        }
    }
    fs::File::create_new(folder.join("poses.csv"))?.write_all(poses.as_bytes())
}

/// Names of poses that a table has, as `check` compares them: upper and lower case count as the same.
#[derive(Default)]
pub struct Names(BTreeSet<String>);

impl Names {
    /// Those of a table.
    pub fn taken<'a>(names: impl IntoIterator<Item = &'a str>) -> Names {
        Names(names.into_iter().map(str::to_lowercase).collect())
    }

    /// The name, or the name with the first number that makes it a new one; it is taken then.
    pub fn unused(&mut self, name: &str) -> String {
        let numbered = (2..).map(|number| format!("{name}_{number}"));
        let is_new = |name: &String| self.0.insert(name.to_lowercase());
        std::iter::once(name.to_owned()).chain(numbered).find(is_new).expect("there are more numbers than names")
    }
}

/// A target's name from its file: `03 Both down.obj` gives `both_down`.
fn pose_name(file: &Path) -> String {
    plain_name(&file.file_stem().unwrap_or_default().to_string_lossy())
}

/// A name for tables and files: letters and digits, no number before them, no longer than `check` allows.
pub fn plain_name(text: &str) -> String {
    let plain: String = text.to_lowercase().chars().map(|c| if c.is_alphanumeric() { c } else { '_' }).collect();
    let unnumbered = plain.trim_start_matches(|c: char| c.is_ascii_digit() || c == '_').trim_end_matches('_');
    let name = if unnumbered.is_empty() { &plain } else { unnumbered };
    name[..name.floor_char_boundary(NAME_BYTES)].to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_poses() {
        let check = |file: &str, expected: &str| assert_eq!(pose_name(Path::new(file)), expected);
        check("shapes/03_both_down.obj", "both_down");
        check("03 Both down.OBJ", "both_down");
        check("komon_pose_01_a_pose_45.obj", "komon_pose_01_a_pose_45");
        check("17.obj", "17");
        check("腕.obj", "腕");
        check(&format!("{}.obj", "腕".repeat(100)), &"腕".repeat(66));
    }

    /// `check` finds nothing wrong with what `new` wrote but that all rows are still the T-pose's and all shapes the same.
    #[test]
    fn names_are_those_that_check_takes() {
        let dir = tempfile::tempdir().unwrap();
        let base = Path::new(ASSETS).join("komon/base.obj");
        let names =
            ["base", "03 Both down", "both_down", "4_BOTH-DOWN", "t_pose", "T pose", "both_down_2", "17", "18", "腕"];
        let mut from = Vec::new();
        for (i, name) in names.iter().enumerate() {
            // Two folders, for systems whose files differ by more than case.
            let file = dir.path().join(format!("{i}/{name}.obj"));
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::copy(&base, &file).unwrap();
            from.push(file);
        }
        let args = Args { id: "mine".to_owned(), from, into: dir.path().join("assets") };
        let folder = make(&args).unwrap();
        let poses = fs::read_to_string(folder.join("poses.csv")).unwrap();
        let written: Vec<&str> = poses.lines().skip(1).filter_map(|row| row.split(',').nth(1)).collect();
        let expected = [
            "t_pose",
            "both_down",
            "both_down_2",
            "both_down_3",
            "t_pose_2",
            "t_pose_3",
            "both_down_2_2",
            "17",
            "18",
            "腕",
        ];
        assert_eq!(written, expected);
        let codes: BTreeSet<String> =
            kitsuke_pipeline::load(&folder).diagnostics.into_iter().map(|said| said.code.into_owned()).collect();
        assert_eq!(codes.into_iter().collect::<Vec<_>>(), ["equal-poses", "same-shape"]);
    }
}
