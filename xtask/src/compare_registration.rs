//! `cargo xtask compare-registration ID SCAN --truth FILE.obj`: our registration beside trimesh's, on one cleaned scan, in one table.

use crate::places::{Places, ended, say};
use crate::registration_error::{Against, at_mm, mean_mm};
use crate::scans::{Registration, ScanArgs, registration};
use glam::DVec3;
use kitsuke_pipeline::meshlab::environment::{self, Packages};
use kitsuke_pipeline::meshlab::script;
use kitsuke_pipeline::stages::register::distances_m;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

const SCRIPT: &str = include_str!("../peers/nricp/nricp.py");
const PACKAGES: Packages = Packages {
    requirements: include_str!("../peers/nricp/requirements.txt"),
    folder: "peer-nricp",
    name: "trimesh",
    purpose: "comparing registrations",
    does: "registers scans",
    all: "trimesh, scipy, rtree and numpy (about 60 MB to load, 230 MB on disk, once)",
    load_mb: 60,
    system: "",
};
/// The peer's functions, each with its own standard steps.
const METHODS: [&str; 2] = ["nricp_amberg", "nricp_sumner"];

/// Compare our registration with trimesh's: time and errors, on the same cleaned scan
///
/// The scan is cleaned and registered as by `register`; then trimesh's nricp_amberg and nricp_sumner, each in a process of its own, lay
/// the same base onto the same scan, moved by our rigid motion, with their standard steps. All results are measured by the same code.
/// trimesh is installed into the cache the first time.
#[derive(clap::Args)]
pub struct Args {
    /// A kimono's ID
    id: String,
    #[command(flatten)]
    scan: ScanArgs,
    /// The right shape, vertex by vertex, in metres: an OBJ to compare with after the best rigid motion
    #[arg(long, value_name = "FILE.obj")]
    truth: PathBuf,
    /// How long each of the peer's functions may take, seconds
    #[arg(long, value_name = "S", default_value_t = 600)]
    peer_limit: u64,
    #[command(flatten)]
    places: Places,
}

/// Compares; 1 when something cannot be read, cleaned, installed or laid on. A peer that fails is a row that says so.
pub fn run(args: Args) -> ExitCode {
    ended(compared(&args))
}

fn compared(args: &Args) -> Result<(), String> {
    // Before anything long is computed.
    let python = environment::python(&args.scan.cache, &PACKAGES, &|line| say!("{line}"));
    let python = python.map_err(|error| error.to_string())?;
    let Registration { garment, base_m, scan, laid, truth, seconds, .. } =
        registration(&args.places, &args.id, &args.scan, Some(&args.truth))?;
    let triangles = &garment.base.triangles;
    let truth = truth.expect("it was asked for");

    // The peer has no search for a start: from where our deforming starts, both do the same task.
    let moved_m: Vec<DVec3> = scan.positions_m.iter().map(|&p| laid.base_from_scan.place(p)).collect();
    let facing = |&[a, b, c]: &[u32; 3]| if laid.is_inside_out { [a, c, b] } else { [a, b, c] };
    let faces: Vec<[u32; 3]> = scan.triangles.iter().map(facing).collect();
    let figures = |places_m: &[DVec3], seconds: Option<f64>| {
        let (to_scan_m, from_scan_m) = distances_m(&base_m, places_m, triangles, (&moved_m, &faces));
        let against = Against::truth(places_m, &base_m, triangles, &truth);
        row(&to_scan_m, &from_scan_m, &against, seconds)
    };
    say!(
        "{} vertices and {} triangles are laid onto {} and {}; trimesh is given the scan moved by our rigid motion, so that it starts where we do",
        base_m.len(),
        triangles.len(),
        moved_m.len(),
        faces.len()
    );
    say!("seconds: ours with its rigid motion, on {} threads; trimesh's on one\n", rayon::current_num_threads());
    say!(
        "{:<14}{:^28}    {:^28}    {:^14}\n{:<14}{}    {}       mean    95 %  turned       s",
        "mm",
        "base to scan",
        "scan to base",
        "from the truth",
        "",
        "   mean median   80 %   95 %",
        "   mean median   80 %   95 %"
    );
    say!("{:<14}{}", "rigid motion", figures(&base_m, None));
    say!("{:<14}{}", "kitsuke", figures(&laid.positions_m, Some(seconds)));
    for method in METHODS {
        let limit = Duration::from_secs(args.peer_limit);
        match peer(&python, method, (&base_m, triangles), (&moved_m, &faces), limit) {
            Ok((places_m, seconds)) => say!("{method:<14}{}", figures(&places_m, Some(seconds))),
            Err(problem) => say!("{method:<14}  {problem}"),
        }
    }
    Ok(())
}

fn row(to_scan_m: &[f64], from_scan_m: &[f64], against: &Against, seconds: Option<f64>) -> String {
    let four = |distances_m: &[f64]| {
        let mut text = format!("{:>7.2}", mean_mm(distances_m));
        [0.5, 0.8, 0.95].iter().for_each(|&share| _ = write!(text, "{:>7.2}", at_mm(distances_m, share)));
        text
    };
    let seconds = seconds.map_or("-".to_owned(), |seconds| format!("{seconds:.1}"));
    format!(
        "{}    {}    {:>7.2} {:>7.2} {:>7} {seconds:>7}",
        four(to_scan_m),
        four(from_scan_m),
        mean_mm(&against.laid_m),
        at_mm(&against.laid_m, 0.95),
        against.turned
    )
}

/// Positions and triangles.
type Mesh<'a> = (&'a [DVec3], &'a [[u32; 3]]);

/// One of trimesh's functions in a process of its own: places of the base's vertices and how long it took, or why there are none.
fn peer(
    python: &Path,
    method: &str,
    base: Mesh<'_>,
    scan: Mesh<'_>,
    limit: Duration,
) -> Result<(Vec<DVec3>, f64), String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let folder = folder.path();
    for (name, (positions_m, triangles)) in [("base", base), ("scan", scan)] {
        let folder = folder.join(name);
        std::fs::create_dir(&folder).map_err(|error| error.to_string())?;
        script::write_mesh(&folder, positions_m, triangles).map_err(|error| error.to_string())?;
    }
    let request = serde_json::json!({ "folder": folder.to_string_lossy(), "method": method });
    let ended =
        script::run(python, folder, ("nricp.py", SCRIPT), &request, limit).map_err(|error| error.to_string())?;
    match ended.status {
        None => return Err(format!("took longer than {} s and was ended", limit.as_secs())),
        Some(status) if status.success() => {}
        Some(_) => {
            return Err(format!("ended with {}: {}", ended.how(), ended.tail.lines().last().unwrap_or_default()));
        }
    }
    let answer: serde_json::Value = serde_json::from_slice(&ended.stdout).map_err(|error| error.to_string())?;
    let seconds = answer["seconds"].as_f64().ok_or("did not say how long it took")?;
    let numbers: Vec<f64> = script::array(folder, "laid", "<f8", 3, base.0.len())?;
    let places_m: Vec<DVec3> = numbers.chunks_exact(3).map(DVec3::from_slice).collect();
    if places_m.len() != base.0.len() {
        return Err(format!("gave {} vertices back", places_m.len()));
    }
    match places_m.iter().filter(|place_m| !place_m.is_finite()).count() {
        0 => Ok((places_m, seconds)),
        count => Err(format!("{count} vertices are no numbers, after {seconds:.1} s")),
    }
}
