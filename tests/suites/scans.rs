//! Sizes that are scans. What needs pymeshlab is tested only where it is installed in the cache.

use glam::DVec3;
use kitsuke_pipeline::catalog::{self, Mode, Options, Outcome, Silent};
use kitsuke_pipeline::meshlab::environment;
use kitsuke_pipeline::source::import;
use kitsuke_pipeline::stages::register::{Rigid, distances_m};
use kitsuke_pipeline::{LaidScan, Workshop, load_with};
use std::fs;
use std::path::{Path, PathBuf};

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

fn options(assets: &Path, folder: &Path, id: &str) -> Options {
    let ids = Some(id.to_owned()).filter(|id| !id.is_empty()).into_iter().collect();
    let (assets, mode) = (assets.to_owned(), Mode::Write);
    Options { assets, catalog: folder.join("catalog"), cache: folder.join("cache"), ids, mode, emit: None }
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        let (from, to) = (entry.path(), to.join(entry.file_name()));
        if from.is_dir() {
            copy(&from, &to);
        } else {
            fs::copy(&from, &to).unwrap();
        }
    }
}

/// Two garments, one with two scans, on a machine without Python: in a process of its own, whose PATH leads nowhere.
#[test]
fn without_python_a_kimono_with_scans_says_once_what_it_needs_and_the_others_are_built() {
    const NAME: &str = "scans::without_python_a_kimono_with_scans_says_once_what_it_needs_and_the_others_are_built";
    const ALONE: &str = "KITSUKE_WITHOUT_PYTHON";
    if std::env::var_os(ALONE).is_none() {
        let mut child = std::process::Command::new(std::env::current_exe().unwrap());
        let output = child.args(["--exact", NAME]).env(ALONE, "1").env("PATH", "/nowhere").output().unwrap();
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success() && said.contains("1 passed"), "{said}");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let assets = folder.path().join("assets");
    let garments = Path::new(env!("CARGO_MANIFEST_DIR")).join("garments");
    copy(&garments, &assets);
    let scanned = assets.join("scanned");
    copy(&garments.join("tube"), &scanned);
    let mut manifest = fs::read_to_string(scanned.join("garment.toml")).unwrap();
    for file in ["sizes/01_small.obj", "sizes/02_tall.obj"] {
        manifest += &format!("\n[[scan]]\nfile = \"{file}\"\nunit = \"m\"\n");
    }
    fs::write(scanned.join("garment.toml"), manifest).unwrap();
    let report = catalog::build(&options(&assets, folder.path(), ""), &Silent).unwrap();
    let [scanned, tube] = &report.garments[..] else { panic!("{:?}", report.garments) };
    assert!(matches!(tube.outcome, Outcome::Built(_)), "{:?}", tube.diagnostics);
    assert!(matches!(scanned.outcome, Outcome::Failed) && !report.is_complete());
    let [said] = &scanned.diagnostics[..] else { panic!("{:?}", scanned.diagnostics) };
    assert_eq!((&*said.code, said.file.as_str()), ("scan", "scanned/garment.toml"));
    assert!(said.problem.contains("there is no python3 in PATH"), "{}", said.problem);
}

/// The sample whose sizes are scans of two of komon's sizes, so that the right shapes are known.
#[cfg(unix)]
#[test]
fn scans_of_the_sample_become_sizes_and_the_report_says_how_well() {
    let cache = repository().join("target/kitsuke-cache");
    if environment::existing(&cache, &environment::PYMESHLAB).is_none() {
        println!("skipped: pymeshlab is not installed (cargo xtask build-catalog komon_scans installs it)");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let own = folder.path().join("cache");
    fs::create_dir_all(&own).unwrap();
    fs::create_dir_all(cache.join("scans")).unwrap();
    for shared in ["meshlab", "scans"] {
        std::os::unix::fs::symlink(cache.canonicalize().unwrap().join(shared), own.join(shared)).unwrap();
    }
    let assets = repository().join("assets-src");
    let report = catalog::build(&options(&assets, folder.path(), "komon_scans"), &Silent).unwrap();
    assert!(report.is_complete(), "{:?}", report.garments);
    let page = fs::read_to_string(folder.path().join("catalog/reports/komon_scans.html")).unwrap();

    let loaded = load_with(&assets.join("komon_scans"), Some(&Workshop { cache: &own, tell: &|_| {} }));
    let garment = loaded.garment.unwrap();
    let base_m: Vec<DVec3> = garment.base.positions_m.iter().map(|p| p.as_dvec3()).collect();
    let shapes = &garment.sizes.as_ref().unwrap().shapes;
    let truths = ["scan_b02.obj", "scan_b08.glb"].into_iter().zip(["03.obj", "07.obj"]);
    assert_eq!((loaded.scans.len(), shapes.len()), (2, 2));
    for ((LaidScan { file, body, triangles, laid, .. }, shape), (name, truth)) in
        loaded.scans.iter().zip(shapes).zip(truths)
    {
        assert_eq!(*file, format!("komon_scans/scans/{name}"));
        // The size is the laid shape, stood on its wearer's shoulders and rounded to what meshes hold.
        let size_m: Vec<DVec3> = shape.positions_m.iter().map(|p| p.as_dvec3()).collect();
        let back = Rigid::between(&size_m, &laid.positions_m, &vec![1.0; size_m.len()]);
        let size_m: Vec<DVec3> = size_m.iter().map(|&p| back.place(p)).collect();
        assert!(size_m.iter().zip(&laid.positions_m).all(|(a, b)| a.distance(*b) < 1e-5), "{file}");
        let scan = (&laid.scan_m[..], &laid.scan_triangles[..]);
        let (_, from_scan_m) = distances_m(&base_m, &size_m, triangles, scan);
        assert!(from_scan_m.iter().zip(&laid.from_scan_m).all(|(a, b)| (a - b).abs() < 2e-5), "{file}");
        // And near what was scanned.
        let path = assets.join("komon/sizes").join(truth);
        let truth = import::read(truth, &path, &mut Vec::new()).unwrap().unwrap().positions;
        let mean_mm = |places_m: &[DVec3]| {
            let motion = Rigid::between(places_m, &truth, &vec![1.0; truth.len()]);
            let away = places_m.iter().zip(&truth).map(|(p, right)| motion.place(*p).distance(*right));
            1e3 * away.sum::<f64>() / truth.len() as f64
        };
        let (laid_mm, base_mm) = (mean_mm(&laid.positions_m), mean_mm(&base_m));
        println!("{file}: {laid_mm:.1} mm from the right shape, the base would be {base_mm:.1} mm from it");
        assert!(laid_mm < base_mm, "{file}: {laid_mm} {base_mm}");

        let section = page.split(&format!("<h3>{file}</h3>")).nth(1).expect("the report names each scan");
        let section = section.split("<h3>").next().unwrap();
        let far_mm = 1e3 * laid.from_scan_m.iter().copied().fold(0.0, f64::max);
        let figures = [
            format!("<td>{far_mm:.2}</tr>"),
            format!("{:.1} % of the {} vertices", 100.0 * laid.seen(), laid.to_scan_m.len()),
            format!("{:.1} mm apart on average", 1e3 * laid.aligned_m),
            format!("of {body}, line"),
        ];
        assert!(figures.iter().all(|figure| section.contains(figure)), "{figures:?} in {}", &section[..1500]);
        assert!(section.contains("src=\"data:image/png;base64,"), "{file} is drawn");
    }
}
