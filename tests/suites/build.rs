//! The catalog: what is built, what is left alone, what is written. Runs on the sample kimono as it is committed, where its numbers
//! matter, and on the tube, which takes no time, where they do not.

use glam::{Affine3A, DVec3, Mat3, Vec3};
use kitsuke::skeleton::{Bone, Pose};
use kitsuke::{Frame, Rates, Scratch, evaluate};
use kitsuke_pipeline::catalog::index::{self, Entry};
use kitsuke_pipeline::catalog::{self, GarmentReport, Mode, Options, Outcome, Progress, Report, Silent};
use kitsuke_pipeline::measure::pose_space;
use kitsuke_pipeline::memo::{Memo, Origin};
use kitsuke_pipeline::{Built, build_garment, ir};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex};
use std::time::SystemTime;
use tempfile::TempDir;

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// A folder with assets, catalog and cache of its own.
struct Place {
    folder: TempDir,
}

impl Place {
    /// With the whole sample kimono.
    fn whole() -> Place {
        let place = Place { folder: tempfile::tempdir().unwrap() };
        copy(&repository().join("assets-src/komon"), &place.assets().join("komon"));
        copy(&repository().join("assets-src/bodies"), &place.assets().join("bodies"));
        copy(&repository().join("assets-src/rules"), &place.assets().join("rules"));
        place
    }

    /// With the small tube instead, once for each ID.
    fn tubes(ids: &[&str]) -> Place {
        let place = Place { folder: tempfile::tempdir().unwrap() };
        let garments = Path::new(env!("CARGO_MANIFEST_DIR")).join("garments");
        copy(&garments.join("bodies"), &place.assets().join("bodies"));
        copy(&garments.join("rules"), &place.assets().join("rules"));
        for id in ids {
            copy(&garments.join("tube"), &place.assets().join(id));
        }
        place
    }

    /// With the sample kimono and three of its targets: as true as the whole, and built in a fraction of the time.
    fn small() -> Place {
        let place = Place::whole();
        place.edit("komon/poses.csv", |table| {
            let kept = ["base.obj", "poses/03", "poses/13", "poses/14", "file,"];
            let rows = table.lines().filter(|row| kept.iter().any(|start| row.starts_with(start)));
            rows.map(|row| format!("{row}\n")).collect()
        });
        place
    }

    /// [`Place::small`] after its first build, which is made once and copied, and what that build said had changed.
    fn small_and_built() -> (Place, &'static [String]) {
        type Written = BTreeMap<PathBuf, Vec<u8>>;
        static FIRST: LazyLock<(Vec<String>, Written)> = LazyLock::new(|| {
            let place = Place::small();
            let report = place.build(Mode::Write);
            let written = [place.catalog(), place.cache()].iter().flat_map(|folder| files(folder)).collect::<Vec<_>>();
            let named = |path: PathBuf| path.strip_prefix(place.folder.path()).unwrap().to_owned();
            (report.changes, written.into_iter().map(|(path, (bytes, _))| (named(path), bytes)).collect())
        });
        let place = Place::small();
        let (changes, written) = &*FIRST;
        for (path, bytes) in written {
            let path = place.folder.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, bytes).unwrap();
        }
        (place, changes)
    }

    fn assets(&self) -> PathBuf {
        self.folder.path().join("assets")
    }

    fn catalog(&self) -> PathBuf {
        self.folder.path().join("catalog")
    }

    fn cache(&self) -> PathBuf {
        self.folder.path().join("cache")
    }

    fn options(&self, mode: Mode) -> Options {
        let (assets, catalog, cache) = (self.assets(), self.catalog(), self.cache());
        Options { assets, catalog, cache, ids: Vec::new(), mode, emit: None }
    }

    fn build(&self, mode: Mode) -> Report {
        catalog::build(&self.options(mode), &Silent).unwrap()
    }

    fn edit(&self, file: &str, change: impl FnOnce(String) -> String) {
        let path = self.assets().join(file);
        fs::write(&path, change(fs::read_to_string(&path).unwrap())).unwrap();
    }

    /// Moves the first vertex of a target by a millimetre.
    fn nudge(&self, target: &str) {
        self.edit(target, |text| {
            let line = text.lines().find(|line| line.starts_with("v ")).unwrap().to_owned();
            let mut numbers = line.split(' ').skip(1).map(|number| number.parse::<f64>().unwrap());
            let [x, y, z] = [0; 3].map(|_| numbers.next().unwrap());
            text.replacen(&line, &format!("v {:.6} {y} {z}", x + 0.001), 1)
        });
    }

    /// The catalog's files with their bytes and when they were written.
    fn written(&self) -> BTreeMap<PathBuf, (Vec<u8>, SystemTime)> {
        files(&self.catalog())
    }
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

fn files(folder: &Path) -> BTreeMap<PathBuf, (Vec<u8>, SystemTime)> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).into_iter().flatten().map(Result::unwrap) {
        let path = entry.path();
        if path.is_dir() {
            found.extend(files(&path));
        } else {
            found.insert(path.clone(), (fs::read(&path).unwrap(), entry.metadata().unwrap().modified().unwrap()));
        }
    }
    found
}

fn entry(garment: &GarmentReport) -> &Entry {
    match &garment.outcome {
        Outcome::Built(entry) => entry,
        outcome => panic!("{} should be built but is {outcome:?}: {:?}", garment.id, garment.diagnostics),
    }
}

/// Stage and target of all stages that ended so.
fn runs(garment: &GarmentReport, origin: Origin) -> Vec<String> {
    let runs = garment.runs.iter().filter(|run| run.origin == origin);
    runs.map(|run| [run.stage, run.target.as_deref().unwrap_or_default()].join(" ").trim().to_owned()).collect()
}

/// What a build of the whole sample wrote into the catalog, and said.
pub(super) struct Whole {
    pub files: BTreeMap<&'static str, Vec<u8>>,
    index: index::Index,
    report: Report,
}

/// Built once for all suites, as it lies in the work tree, on several threads.
pub(super) static WHOLE: LazyLock<Whole> =
    LazyLock::new(|| whole(&repository().join("assets-src"), rayon::current_num_threads().max(2)));

fn whole(assets: &Path, threads: usize) -> Whole {
    let place = tempfile::tempdir().unwrap();
    let [catalog, cache] = ["catalog", "cache"].map(|name| place.path().join(name));
    let ids = vec!["komon".to_owned()];
    let options = Options { assets: assets.to_owned(), catalog, cache, ids, mode: Mode::Write, emit: None };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    let report = pool.install(|| catalog::build(&options, &Silent)).unwrap();
    let names = ["index.toml", "packs/komon.kitsuke", "reports/komon.html", "reports/index.html"];
    let files = names.map(|name| (name, fs::read(options.catalog.join(name)).unwrap())).into();
    Whole { files, index: index::read(&options.catalog.join("index.toml")).unwrap().0, report }
}

#[test]
fn the_sample_is_exact_and_the_same_on_any_threads_in_any_folder() {
    let (one, many) = (whole(&Place::whole().assets(), 1), &*WHOLE);
    let komon = entry(&one.report.garments[0]);
    assert_eq!(komon.targets.len(), 54);
    for target in &komon.targets {
        assert!(target.max_mm <= 0.25, "{}: {} mm", target.name, target.max_mm);
        assert!(target.mean_mm <= 0.05, "{}: {} mm on average", target.name, target.mean_mm);
    }
    for file in ["index.toml", "packs/komon.kitsuke", "reports/komon.html"] {
        assert!(one.files[file] == many.files[file], "{file} differs between one thread and several");
    }
    // The report needs nothing else, and the page beside it links it.
    let text = |file: &str| str::from_utf8(&one.files[file]).unwrap();
    let report = text("reports/komon.html");
    let asked: Vec<&str> = report.match_indices("src=\"").map(|(at, _)| &report[at + 5..at + 27]).collect();
    assert_eq!(asked, ["data:image/png;base64,"]);
    assert!(!report.contains("href") && report.contains("No warnings.") && report.contains("<td>袖丈<td>"));
    assert!(komon.targets.iter().all(|target| report.contains(&format!("<td>{}<td>", target.name))));
    assert!(text("reports/index.html").contains("href=\"komon.html\""));
    // Other garments of the catalog are compared by `build-catalog --locked`.
    let mut committed = index::read(&repository().join("catalog/index.toml")).unwrap().0;
    committed.retain(|id, _| id == "komon");
    assert_eq!(
        index::differences(&committed, &one.index),
        [""; 0],
        "catalog/index.toml is stale: run cargo xtask build-catalog and commit it"
    );
}

#[test]
fn a_second_build_changes_nothing() {
    let (place, first_changes) = Place::small_and_built();
    assert_eq!(first_changes, ["komon: is not in the index"]);
    let written = place.written();
    let second = place.build(Mode::Write);
    assert!(matches!(second.garments[0].outcome, Outcome::UpToDate), "{:?}", second.garments[0]);
    assert_eq!(second.changes, [""; 0]);
    assert!(place.written() == written, "a file was written again");
}

#[test]
fn an_edited_target_rebuilds_only_what_depends_on_it() {
    let (place, _) = Place::small_and_built();
    place.nudge("komon/poses/13_right_elbow_90.obj");
    let report = place.build(Mode::Write);
    let komon = &report.garments[0];
    assert_eq!(komon.reasons, ["komon/poses/13_right_elbow_90.obj changed"]);
    // Skin weights follow all samples, so that one edited sample changes every delta a little.
    assert_eq!(runs(komon, Origin::Remembered), ["reach", "skin", "weld"]);
    assert_eq!(
        runs(komon, Origin::Computed),
        [
            "audit",
            "certificate",
            "compress",
            "correctives",
            "deltas both_down",
            "deltas left_elbow_90",
            "deltas right_elbow_90",
            "regions",
            "skin fit",
            "verify",
            "write"
        ]
    );
}

#[test]
fn an_entry_that_lacks_a_figure_counts_as_not_built() {
    struct Notes(Mutex<Vec<String>>);
    impl Progress for Notes {
        fn note(&self, text: &str) {
            self.0.lock().unwrap().push(text.to_owned());
        }
    }
    let place = Place::tubes(&["komon"]);
    place.build(Mode::Write);
    let index = place.catalog().join("index.toml");
    let whole = fs::read_to_string(&index).unwrap();
    let (before, _) = whole.split_once("inside_max_mm").unwrap();
    let (_, after) = whole.split_once("targets = [").unwrap();
    let older = format!("{before}targets = [{after}\n[gone]\nbytes = 1\n");
    fs::write(&index, &older).unwrap();
    for mode in [Mode::Locked, Mode::Check] {
        let wanted = ["komon: is not in the index", "gone: is in the index, but its garment is gone"];
        assert_eq!(place.build(mode).changes, wanted, "{mode:?}");
        assert_eq!(fs::read_to_string(&index).unwrap(), older, "{mode:?} wrote the index");
    }
    let notes = Notes(Mutex::default());
    let report = catalog::build(&place.options(Mode::Write), &notes).unwrap();
    assert!(matches!(report.garments[0].outcome, Outcome::Built(_)), "{:?}", report.garments[0]);
    assert_eq!(fs::read_to_string(&index).unwrap(), whole);
    let notes = notes.0.into_inner().unwrap();
    let told =
        |id: &str| notes.iter().any(|note| note.contains(&format!("index.toml: the entry of {id} lacks figures")));
    assert!(notes.len() == 2 && told("komon") && told("gone"), "{notes:?}");
}

#[test]
fn locked_refuses_a_change_of_the_index_and_check_writes_nothing() {
    let place = Place::tubes(&["komon"]);
    place.build(Mode::Write);
    place.nudge("komon/poses/02_left_down.obj");
    let written = place.written();
    for mode in [Mode::Locked, Mode::Check] {
        let report = place.build(mode);
        assert!(report.changes[0].starts_with("komon: `mean_mm = "), "{mode:?}: {:?}", report.changes);
        assert!(place.written() == written, "{mode:?} wrote into the catalog");
    }
    place.build(Mode::Write);
    assert!(place.written() != written);

    // A fresh checkout has the index and no packs: locked makes them, check says that they are missing.
    fs::remove_file(place.catalog().join("packs/komon.kitsuke")).unwrap();
    assert_eq!(place.build(Mode::Check).changes, ["komon: its pack is not in the catalog"]);
    assert_eq!(place.build(Mode::Locked).changes, [""; 0]);
    assert!(place.catalog().join("packs/komon.kitsuke").exists());
    assert_eq!(place.build(Mode::Check).changes, [""; 0]);
}

#[test]
fn leftovers_of_a_killed_build_and_a_damaged_cache_do_no_harm() {
    let place = Place::tubes(&["komon"]);
    place.build(Mode::Write);
    let written = place.written();
    let half = &b"half a file"[..];
    for leftover in ["catalog/.tmp-a", "catalog/packs/.tmp-b", "cache/stages/.tmp-c", "cache/builds/.tmp-d"] {
        fs::write(place.folder.path().join(leftover), half).unwrap();
    }
    assert!(matches!(place.build(Mode::Write).garments[0].outcome, Outcome::UpToDate));

    for (path, (bytes, _)) in files(&place.cache().join("stages")) {
        fs::write(path, &bytes[..bytes.len() / 2]).unwrap();
    }
    fs::write(place.catalog().join("packs/komon.kitsuke"), half).unwrap();
    let report = place.build(Mode::Write);
    assert_eq!(report.garments[0].reasons, ["the pack in the catalog is missing or another"]);
    assert_eq!(runs(&report.garments[0], Origin::Remembered), [""; 0]);
    for (path, (bytes, _)) in written {
        assert!(fs::read(&path).unwrap() == bytes, "{} differs after the rebuild", path.display());
    }

    fs::remove_dir_all(place.cache()).unwrap();
    assert_eq!(place.build(Mode::Check).changes, [""; 0], "without any cache the same comes out");
}

#[test]
fn garments_come_and_go_and_fail_one_by_one() {
    let place = Place::tubes(&["komon", "tsumugi", "yukata"]);
    let outcomes = |report: &Report| -> Vec<(String, bool)> {
        let built = |outcome: &Outcome| matches!(outcome, Outcome::Built(_));
        report.garments.iter().map(|garment| (garment.id.clone(), built(&garment.outcome))).collect()
    };
    let ids = || index::read(&place.catalog().join("index.toml")).unwrap().0.into_keys().collect::<Vec<_>>();
    place.build(Mode::Write);
    assert_eq!(ids(), ["komon", "tsumugi", "yukata"]);

    // Two faults in one run: both are told, the good one is built, and nobody loses an entry.
    place.edit("tsumugi/garment.toml", |text| text.replace("base.obj", "missing.obj"));
    place.edit("yukata/poses/02_left_down.obj", |text| text.replacen("v ", "v NaN ", 1));
    place.nudge("komon/poses/02_left_down.obj");
    let report = place.build(Mode::Write);
    assert_eq!(outcomes(&report), [("komon".into(), true), ("tsumugi".into(), false), ("yukata".into(), false)]);
    assert!(report.garments[1..].iter().all(|garment| !garment.diagnostics.is_empty()));
    assert_eq!(ids(), ["komon", "tsumugi", "yukata"]);

    // One named garment leaves the others alone, even those that are gone; building all drops them.
    fs::remove_dir_all(place.assets().join("tsumugi")).unwrap();
    fs::remove_dir_all(place.assets().join("yukata")).unwrap();
    let options = Options { ids: vec!["komon".to_owned()], ..place.options(Mode::Write) };
    catalog::build(&options, &Silent).unwrap();
    assert_eq!(ids(), ["komon", "tsumugi", "yukata"]);
    let report = place.build(Mode::Write);
    assert_eq!(report.changes[0], "tsumugi: is in the index, but its garment is gone");
    assert_eq!(ids(), ["komon"]);
    let packs: Vec<PathBuf> = files(&place.catalog().join("packs")).into_keys().collect();
    assert_eq!(packs, [place.catalog().join("packs/komon.kitsuke")]);

    let options = Options { ids: vec!["komom".to_owned()], ..place.options(Mode::Write) };
    let error = catalog::build(&options, &Silent).unwrap_err().to_string();
    assert!(error.contains("no garment komom") && error.ends_with("did you mean komon?"), "{error}");
}

/// With what its build remembers, so that this one takes little.
fn built_sample(place: &Place) -> (ir::Garment, Built) {
    let loaded = kitsuke_pipeline::load(&place.assets().join("komon"));
    let garment = loaded.garment.unwrap_or_else(|| panic!("{:?}", loaded.diagnostics));
    let built = build_garment(&garment, &Memo::new(&place.cache().join("stages")), &|_| {}).unwrap();
    (garment, built)
}

#[test]
fn the_skirt_follows_both_thighs_alike_and_sleeves_follow_the_arms() {
    let (garment, built) = built_sample(&Place::small_and_built().0);
    let skeleton = &built.garment.data().skeleton;
    let weight = |vertex: usize, bones: &[Bone]| -> f64 {
        let skin = built.skin[vertex];
        let counted = |joint: u8| bones.contains(&skeleton.bone(joint));
        let weights = skin.joints.into_iter().zip(skin.weights).filter(|&(joint, _)| counted(joint));
        weights.map(|(_, weight)| f64::from(weight) / 65535.0).sum()
    };
    let (left, right) = ([Bone::LeftUpperLeg], [Bone::RightUpperLeg]);
    let left_arm = [Bone::LeftShoulder, Bone::LeftUpperArm, Bone::LeftLowerArm];
    let right_arm = [Bone::RightShoulder, Bone::RightUpperArm, Bone::RightLowerArm];
    let shins = [[Bone::LeftLowerLeg], [Bone::RightLowerLeg]];
    let never = [Bone::LeftFoot, Bone::LeftHand, Bone::RightHand, Bone::Head];
    let obi_bottom_m = garment.obi.as_ref().unwrap().positions_m.iter().map(|p| p.y).fold(f32::MAX, f32::min);
    let mut sleeves = Vec::new();
    for (v, p) in garment.base.positions_m.iter().enumerate() {
        let uneven = (weight(v, &left) - weight(v, &right)).abs() + (weight(v, &shins[0]) - weight(v, &shins[1])).abs();
        // The odd unit of a weight does not halve.
        assert!(uneven < 4e-5, "vertex {v}: one leg pulls more than the other, by {uneven}");
        assert_eq!(weight(v, &never), 0.0, "vertex {v} follows a bone that moves no cloth");
        let legs: f64 = [left, right, shins[0], shins[1]].iter().map(|bones| weight(v, bones)).sum();
        if p.y >= obi_bottom_m {
            assert_eq!(legs, 0.0, "vertex {v} above the obi's edge follows the legs");
        }
        if p.y < 0.3 {
            assert!(legs > 0.9, "vertex {v} near the hem follows the legs by {legs} only");
        }
        if p.x.abs() > 0.45 {
            let (own, other) = if p.x > 0.0 { (left_arm, right_arm) } else { (right_arm, left_arm) };
            // As the samples ask: the bag of a lowered sleeve hangs, whatever its arm does.
            sleeves.push(weight(v, &own));
            assert!(weight(v, &own) > 0.4, "vertex {v} of a sleeve follows its arm by {} only", weight(v, &own));
            assert_eq!(weight(v, &other), 0.0, "vertex {v} of a sleeve follows the other arm");
        }
    }
    let mean = sleeves.iter().sum::<f64>() / sleeves.len() as f64;
    assert!(mean > 0.65, "sleeves follow their arm by {mean} only");
}

/// People type what their shell completes.
#[test]
fn a_garment_is_named_by_its_id_or_its_folder() {
    let assets = repository().join("assets-src");
    for named in ["komon".to_owned(), "komon/".to_owned(), format!("{}/", assets.join("komon").display())] {
        assert_eq!(catalog::garment_ids(&assets, &[named]).unwrap(), ["komon"]);
    }
    let other = catalog::garment_ids(&assets, &["elsewhere/komon".to_owned()]).unwrap_err().to_string();
    assert!(other.contains("no garment elsewhere/komon"), "{other}");
}

#[test]
fn a_build_ends_with_a_cache_of_no_more_than_its_limit() {
    let place = Place::tubes(&["tube"]);
    let forgotten = ["stages", "scans"].map(|folder| place.cache().join(folder).join("old.memo"));
    for file in &forgotten {
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        // Sparse: it takes no room.
        fs::File::create(file).unwrap().set_len((1 << 30) + 1).unwrap();
    }
    place.build(Mode::Write);
    for file in &forgotten {
        assert!(!file.exists(), "{} is still there", file.display());
    }
}

/// Each build reads the index, adds its garment and writes it: at the same time they would lose each other's.
#[test]
fn builds_at_the_same_time_keep_each_other_s_entries() {
    let ids = ["a", "b", "c", "d"];
    let place = Place::tubes(&ids);
    std::thread::scope(|scope| {
        for id in ids {
            let options = Options { ids: vec![id.to_owned()], ..place.options(Mode::Write) };
            scope.spawn(move || catalog::build(&options, &Silent).unwrap());
        }
    });
    let index = index::read(&place.catalog().join("index.toml")).unwrap().0;
    assert_eq!(index.keys().collect::<Vec<_>>(), ids);
}

#[test]
fn painted_masks_are_kept_and_what_they_cut_off_is_told() {
    let (place, _) = Place::small_and_built();
    place.edit("komon/garment.toml", |text| {
        // Nobody painted the legs.
        let (arms, _) = text.split_once("[[driver]]\nname = \"leftUpperLeg\"").unwrap();
        // Correctives have no masks, and take long.
        arms.replace("regions = \"auto\"", "regions = \"painted\"").replace("correctives = 8", "correctives = 0")
    });
    let report = place.build(Mode::Write);
    entry(&report.garments[0]);
    let told: Vec<&str> = report.garments[0]
        .diagnostics
        .iter()
        .filter(|diagnostic| diagnostic.code == "mask-remainder")
        .map(|diagnostic| diagnostic.problem.as_str())
        .collect();
    assert_eq!(told.len(), 4, "one warning per driver: {told:#?}");
    assert!(told.iter().all(|problem| problem.contains(" mm where ") && problem.contains("vertex ")), "{told:#?}");
    // A build that has nothing to do says so still.
    let again = place.build(Mode::Write);
    assert!(matches!(again.garments[0].outcome, Outcome::UpToDate));
    assert_eq!(again.garments[0].diagnostics, report.garments[0].diagnostics);
}

/// The surface from the deltas as they were, by the formulas alone: base and masked, rated deltas, then linear blend skinning.
fn uncompressed_m(built: &Built, pose: &Pose) -> Vec<DVec3> {
    let garment = &built.garment;
    let data = garment.data();
    let mut rates = Rates::new(data);
    garment.blend_rates(garment.kernel(), pose, &mut rates);
    let mut posed_from_rest = vec![Affine3A::IDENTITY; data.skeleton.frame_count()];
    data.skeleton.posed_from_rest(&pose.with_arms_untwisted(), &mut posed_from_rest);
    let vertex = |(v, &source): (usize, &u32)| {
        let mut place_m = data.mesh.positions_m[v].as_dvec3();
        for driver in 0..data.drivers.len() {
            let mask = f64::from(built.masks[source as usize * data.drivers.len() + driver]) / 65535.0;
            for (deltas, &rate) in built.deltas.iter().zip(rates.driver(driver)) {
                place_m += mask * f64::from(rate) * deltas[source as usize].as_dvec3();
            }
        }
        let skin = data.skin[v];
        let parts = skin.joints.iter().zip(skin.weights).map(|(&joint, weight)| {
            let matrix = posed_from_rest[usize::from(joint)];
            let turned = Mat3::from(matrix.matrix3).as_dmat3() * place_m + matrix.translation.as_dvec3();
            turned * (f64::from(weight) / 65535.0)
        });
        parts.sum::<DVec3>()
    };
    data.mesh.source_vertex.iter().enumerate().map(vertex).collect()
}

#[test]
fn the_posed_surface_keeps_the_budget_at_samples_and_between() {
    let tube = Path::new(env!("CARGO_MANIFEST_DIR")).join("garments/tube");
    let source = kitsuke_pipeline::load(&tube).garment.unwrap();
    let cache = tempfile::tempdir().unwrap();
    let built = build_garment(&source, &Memo::new(cache.path()), &|_| ()).unwrap();
    let garment = &built.garment;
    let said = garment.data().compression.as_ref().unwrap();
    assert_eq!((said.budget_m, said.poses, said.targets.len()), (source.budget_m, 500, source.targets.len()));
    let mut poses = pose_space::poses(garment, 1 << 21, 500);
    poses.extend((0..garment.data().poses.rows()).map(|row| garment.data().poses.pose(row)));
    let mut scratch = Scratch::new(garment);
    let mut positions_m = vec![Vec3::ZERO; garment.vertex_count()];
    let mut farthest_m = 0.0f64;
    for pose in &poses {
        evaluate(garment, pose, &mut scratch, Frame { positions_m: &mut positions_m, normals: &mut [] });
        let wanted_m = uncompressed_m(&built, pose);
        let apart = positions_m.iter().zip(&wanted_m).map(|(found, wanted)| found.as_dvec3().distance(*wanted));
        farthest_m = farthest_m.max(apart.fold(0.0, f64::max));
    }
    assert!(farthest_m <= f64::from(source.budget_m) + 1e-6, "{farthest_m} m");
    assert!((farthest_m - f64::from(said.surface.max_m)).abs() < 2e-6, "{farthest_m} m, {} m said", said.surface.max_m);
    assert!(said.surface.p99_m <= said.surface.max_m && said.surface.above_half > 0.0);
}
