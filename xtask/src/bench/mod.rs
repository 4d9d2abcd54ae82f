//! `cargo xtask bench`: how fast frames, opening and building are on this machine, as one flat JSON object.

mod cloth;
mod cloth_peer;
mod doors;
mod hands;

use crate::compare_packs;
use crate::places::{Places, ended, in_workspace, write_whole};
use glam::Vec3;
use kitsuke::evaluate::{blend, bytes_touched, normals, skin, twins};
use kitsuke::fit::texture::{TextureScratch, Texturer};
use kitsuke::fit::{self, FitData, Fitter, Transfer};
use kitsuke::measurement::{Measurement, Measurements};
use kitsuke::skeleton::{Pose, bvh};
use kitsuke::{Frame, Garment, Pack, Rates, Scratch, evaluate};
use kitsuke_pipeline::build_garment;
use kitsuke_pipeline::catalog::{self, Mode, Options};
use kitsuke_pipeline::measure::weld_quality::mixed;
use kitsuke_pipeline::memo::Memo;
use kitsuke_pipeline::source::obj;
use serde_json::{Map, Value, json};
use std::fmt::Write as _;
use std::fs;
use std::hint::black_box;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

/// Measure frames, opening and building on this machine
#[derive(clap::Args)]
pub struct Args {
    /// A kimono's ID
    #[arg(value_name = "ID", default_value = "komon")]
    garment: String,
    /// Also write the figures as one flat JSON object
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// The recorded motion whose frames are measured
    #[arg(long, value_name = "FILE.bvh", default_value_os_t = in_workspace("assets-src/motions/walk_climb_sit.bvh"))]
    motion: PathBuf,
    /// Also measure cloth (about 2 minutes)
    #[arg(long)]
    cloth: bool,
    /// Also measure cloth under hands, on one core (about a minute)
    #[arg(long)]
    hands: bool,
    /// Also measure a cloth solver by others (about 3 minutes; built the first time, which needs the network)
    #[arg(long)]
    cloth_peer: bool,
    #[command(flatten)]
    places: Places,
}

/// How often the motion is played; a frame's time is the median of its times.
const PASSES: usize = 9;
/// How often the pack is opened, and the dense loop run.
const REPEATS: usize = 51;
/// What is copied to measure memory: far more than any cache holds.
const COPIED_BYTES: usize = 256 << 20;

/// Measures; 1 when something cannot be read or written.
pub fn run(args: Args) -> ExitCode {
    ended(bench(&args))
}

fn bench(args: &Args) -> Result<(), String> {
    let pack = args.places.open(&args.garment)?;
    let garment = pack.garment();
    let motion = fs::read(&args.motion).map_err(|error| format!("cannot read {}: {error}", args.motion.display()))?;
    let motion =
        bvh::read(&motion, &garment.data().skeleton).map_err(|error| format!("{}: {error}", args.motion.display()))?;

    let mut figures = Map::new();
    let mut note = |key: &str, value: Value| drop(figures.insert(key.to_owned(), value));
    // First, because it may fail for want of a network.
    if args.cloth_peer {
        for (scene, key) in [("hanging", ""), ("folding", "_contact")] {
            let figures = cloth_peer::peer(scene)?;
            note(&format!("peer_step{key}_ms"), json!(rounded(figures.ms_per_step)));
            // Of strain, a thousandth is not fine.
            note(&format!("peer_strain{key}_mean"), json!((figures.strain_mean * 1e6).round() / 1e6));
        }
    }
    if args.cloth {
        for (key, value) in cloth::measure(&args.places, &args.garment)? {
            note(key, json!((value * 1e5).round() / 1e5));
        }
    }
    if args.hands {
        for (key, value) in hands::measure()? {
            note(key, json!(rounded(value)));
        }
    }
    let frames = measure_frames(garment, &motion.poses);
    note("frame_us_median", json!(rounded(frames.median(|frame| frame.whole_us))));
    note("frame_us_p99", json!(rounded(quantile(frames.all(|frame| frame.whole_us), 0.99))));
    note("frame_rates_us", json!(rounded(frames.median(|frame| frame.rates_us))));
    note("frame_blend_us", json!(rounded(frames.median(|frame| frame.blend_us))));
    note("frame_skin_us", json!(rounded(frames.median(|frame| frame.skin_us))));
    note("frame_normals_us", json!(rounded(frames.median(|frame| frame.normals_us))));
    note("dense_f32_blend_us", json!(rounded(dense_f32_blend_us(garment))));
    note("frame_active_targets_median", json!(frames.median(|frame| frame.active_targets) as u64));
    let (bytes_touched, memory_gbps) = (frames.median(|frame| frame.bytes_touched), memory_gbps());
    // No frame can be faster than memory delivers what it touches, unless a cache holds it.
    let bound_us = bytes_touched / (memory_gbps * 1e3);
    note("frame_bytes_touched", json!(bytes_touched as u64));
    note("memory_gbps", json!(rounded(memory_gbps)));
    note("frame_bound_us", json!(rounded(bound_us)));
    note("frame_bound_ratio", json!(rounded(frames.median(|frame| frame.whole_us) / bound_us)));
    note("frames_per_s_two_threads", json!(frames_per_s_two_threads(garment, &motion.poses).round()));
    note("vertices", json!(garment.unique_count()));
    note("triangles", json!(garment.triangle_count()));
    note("targets", json!(garment.data().targets.len()));
    if let Ok(fitter) = args.places.fitter(&pack) {
        let (fit_us, shape_us) = fit_us(&fitter);
        note("fit_us_median", json!(rounded(fit_us)));
        note("fit_shape_us_median", json!(rounded(shape_us)));
    }
    let (_, bytes) = args.places.read_pack(&args.garment)?;
    note("open_ms_median", json!(rounded(open_ms(&bytes))));
    note("pack_bytes", json!(bytes.len()));
    // The same few frames through all doors, Rust's first.
    let few: Vec<Pose> = motion.poses.iter().step_by(8).cloned().collect();
    let rust_us = measure_frames(garment, &few).median(|frame| frame.whole_us);
    note("doors_rust_frame_us_median", json!(rounded(rust_us)));
    for (key, value) in doors::measure(&bytes, &few)? {
        if key.ends_with("frame_us_median") {
            note(&key.replace("us_median", "ratio"), json!(rounded(value / rust_us)));
        }
        note(&key, json!(rounded(value)));
    }
    note("pack_target_bytes", json!(compare_packs::pose_target_bytes(garment)?));
    note("open_fit_ms_median", json!(rounded(open_fit_ms(&pack))));
    if let Some(fit) = pack.fit_data().map_err(|error| error.to_string())? {
        note("uv_ms_median", json!(rounded(uv_ms(garment, &fit)?)));
        note("tailor_ms_median", json!(rounded(tailor_ms(garment, &fit)?)));
    }
    if let Some(source) = args.places.source(&args.garment) {
        let memo = Memo::new(&in_workspace("target/kitsuke-cache/stages"));
        let built = build_garment(&source, &memo, &|_| ()).map_err(|error| error.to_string())?;
        let wanted_m = compare_packs::masked_deltas(&source, &built);
        note("pack_target_max_mm", json!(compare_packs::target_max_mm(&built, &wanted_m)));
    }
    let (obj_ms, tobj_ms) = obj_read_ms()?;
    note("obj_read_ms_median", json!(rounded(obj_ms)));
    note("obj_read_ratio_tobj", json!(rounded(obj_ms / tobj_ms)));
    let (clean_s, noop_s) = build_s(&args.places.assets)?;
    note("build_clean_s", json!(rounded(clean_s)));
    note("build_noop_ms", json!(rounded(noop_s * 1e3)));

    for (key, value) in &figures {
        println!("{key:<28} {value:>12}");
    }
    if let Some(path) = &args.json {
        write_whole(path, |out| writeln!(out, "{:#}", Value::Object(figures)))?;
    }
    Ok(())
}

/// One frame's times, each the median over the passes, microseconds.
struct FrameFigures {
    whole_us: f64,
    rates_us: f64,
    blend_us: f64,
    skin_us: f64,
    normals_us: f64,
    active_targets: f64,
    bytes_touched: f64,
}

struct Frames(Vec<FrameFigures>);

impl Frames {
    fn all(&self, figure: impl Fn(&FrameFigures) -> f64) -> Vec<f64> {
        self.0.iter().map(figure).collect()
    }

    fn median(&self, figure: impl Fn(&FrameFigures) -> f64) -> f64 {
        median(self.all(figure))
    }
}

/// Plays the motion several times: whole frames first, then step by step.
fn measure_frames(garment: &Garment, poses: &[Pose]) -> Frames {
    let mut scratch = Scratch::new(garment);
    let mut rates = Rates::new(garment.data());
    let mut positions_m = vec![Vec3::ZERO; garment.vertex_count()];
    let mut unit_normals = positions_m.clone();
    let mut times_us = vec![[const { Vec::new() }; 5]; poses.len()];
    for _ in 0..PASSES {
        for (pose, times_us) in poses.iter().zip(&mut times_us) {
            let frame = Frame { positions_m: &mut positions_m, normals: &mut unit_normals };
            times_us[0].push(microseconds(|| evaluate(garment, black_box(pose), &mut scratch, frame)));
        }
        for (pose, times_us) in poses.iter().zip(&mut times_us) {
            times_us[1].push(microseconds(|| garment.blend_rates(garment.kernel(), black_box(pose), &mut rates)));
            times_us[2].push(microseconds(|| blend(garment, &rates, &mut scratch)));
            times_us[3].push(microseconds(|| skin(garment, pose, &mut scratch, &mut positions_m)));
            times_us[4].push(microseconds(|| normals(garment, &positions_m, &mut scratch, &mut unit_normals)));
            twins(garment, Frame { positions_m: &mut positions_m, normals: &mut unit_normals });
        }
        black_box((&positions_m, &unit_normals));
    }
    let figures = poses.iter().zip(times_us).map(|(pose, times_us)| {
        let [whole_us, rates_us, blend_us, skin_us, normals_us] = times_us.map(median);
        garment.blend_rates(garment.kernel(), pose, &mut rates);
        let active_targets = (0..garment.data().targets.len()).filter(|&target| rates.is_active(target)).count() as f64;
        let bytes_touched = bytes_touched(garment, &rates) as f64;
        FrameFigures { whole_us, rates_us, blend_us, skin_us, normals_us, active_targets, bytes_touched }
    });
    Frames(figures.collect())
}

/// Frames per second of two threads that play the motion each for a wearer of its own.
fn frames_per_s_two_threads(garment: &Garment, poses: &[Pose]) -> f64 {
    let play = || {
        let mut scratch = Scratch::new(garment);
        let mut positions_m = vec![Vec3::ZERO; garment.vertex_count()];
        let mut normals = positions_m.clone();
        for pose in poses {
            evaluate(garment, pose, &mut scratch, Frame { positions_m: &mut positions_m, normals: &mut normals });
        }
        black_box((&positions_m, &normals));
    };
    let both_play = || {
        std::thread::scope(|threads| {
            threads.spawn(play);
            threads.spawn(play);
        });
    };
    let times_us = (0..PASSES).map(|_| microseconds(both_play));
    2.0 * poses.len() as f64 / (median(times_us.collect()) / 1e6)
}

/// The plainest way to blend, for comparison: every target dense in single precision, one rate each, no regions.
fn dense_f32_blend_us(garment: &Garment) -> f64 {
    let data = garment.data();
    let base: Vec<f32> = data.mesh.positions_m.iter().flat_map(|position_m| position_m.to_array()).collect();
    let firsts: Vec<usize> = data
        .segments
        .iter()
        .scan(0, |end, segment| {
            let first = *end;
            *end += segment.vertex_count as usize;
            Some(first)
        })
        .collect();
    let dense = |target: &kitsuke::arrays::Target| {
        let mut dense = vec![0.0; base.len()];
        let mut deltas = target.deltas.as_flattened().iter();
        for &segment in &target.segments {
            let first = 3 * firsts[usize::from(segment)];
            let count = 3 * data.segments[usize::from(segment)].vertex_count as usize;
            for (value, &delta) in dense[first..first + count].iter_mut().zip(&mut deltas) {
                *value = f32::from(delta) * target.step_m;
            }
        }
        dense
    };
    let targets: Vec<Vec<f32>> = data.targets.iter().map(dense).collect();
    let mut blended = base.clone();
    let times_us = (0..REPEATS).map(|_| {
        microseconds(|| {
            blended.copy_from_slice(&base);
            for target in &targets {
                let rate = black_box(0.05_f32);
                for (sum, delta) in blended.iter_mut().zip(target) {
                    *sum += rate * delta;
                }
            }
            black_box(&mut blended);
        })
    });
    median(times_us.collect())
}

/// Bytes read and written per second by one core's copy, in 10⁹.
fn memory_gbps() -> f64 {
    let from = vec![1_u8; COPIED_BYTES];
    let mut to = vec![2_u8; COPIED_BYTES];
    let times_us = (0..5).map(|_| {
        microseconds(|| {
            to.copy_from_slice(black_box(&from));
            black_box(&mut to);
        })
    });
    2.0 * COPIED_BYTES as f64 / (median(times_us.collect()) * 1e3)
}

fn open_ms(pack: &[u8]) -> f64 {
    let times_us = (0..REPEATS).map(|_| microseconds(|| black_box(Pack::open(black_box(pack)).is_ok())));
    median(times_us.collect()) / 1e3
}

/// Decoding and checking what a fit needs, which an app does when it makes a fitter.
fn open_fit_ms(pack: &Pack) -> f64 {
    let times_us = (0..REPEATS).map(|_| microseconds(|| black_box(black_box(pack).fit_data().is_ok())));
    median(times_us.collect()) / 1e3
}

/// Correcting the texture of a kimono between all its sizes.
fn uv_ms(garment: &Garment, fit: &FitData) -> Result<f64, String> {
    let texturer = Texturer::new(&garment.data().mesh, fit).map_err(|error| error.to_string())?;
    let weights = vec![1.0 / (fit.size_count() + 1) as f32; fit.fields.len()];
    let positions_m = mixed(garment, fit, &weights);
    let mut scratch = TextureScratch::new(&texturer);
    let mut uv = garment.data().mesh.uv.clone();
    let times_us = (0..REPEATS).map(|_| {
        microseconds(|| {
            texturer.correct(black_box(&positions_m), &weights, &mut scratch, &mut uv);
            black_box(&mut uv);
        })
    });
    Ok(median(times_us.collect()) / 1e3)
}

/// Transferring all pose targets to a kimono between all its sizes.
fn tailor_ms(garment: &Garment, fit: &FitData) -> Result<f64, String> {
    let transfer = Transfer::new(garment).map_err(|error| error.to_string())?;
    let share = 1.0 / fit.bodies.len() as f32;
    let positions_m = mixed(garment, fit, &vec![share; fit.fields.len()]);
    let joints_m = fit.joints_m(&vec![share; fit.bodies.len()]);
    let times_us = (0..REPEATS)
        .map(|_| microseconds(|| black_box(transfer.tailored(garment, black_box(&positions_m), &joints_m).is_ok())));
    Ok(median(times_us.collect()) / 1e3)
}

/// Loading a file of cloth, 27 MB, by our reader and by tobj.
fn obj_read_ms() -> Result<(f64, f64), String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let file = folder.path().join("cloth.obj");
    fs::write(&file, cloth_text()).map_err(|error| error.to_string())?;
    let (mut ours_us, mut tobj_us) = (Vec::new(), Vec::new());
    for _ in 0..PASSES {
        ours_us.push(microseconds(|| {
            let mesh = fs::File::open(&file).and_then(|source| obj::read_from("cloth.obj", source, &mut Vec::new()));
            black_box(mesh.is_ok_and(|mesh| mesh.is_some()));
        }));
        tobj_us.push(microseconds(|| black_box(tobj::load_obj(&file, &tobj::LoadOptions::default()).is_ok())));
    }
    Ok((median(ours_us) / 1e3, median(tobj_us) / 1e3))
}

/// A square of cloth as OBJ text: 200,704 vertices and as many texture coordinates, 399,618 triangles.
fn cloth_text() -> String {
    const SIDE: usize = 448;
    let places = || (0..SIDE * SIDE).map(|i| (i / SIDE, i % SIDE));
    let mut text = String::from("g cloth\n");
    for (i, j) in places() {
        let z = 0.001 * ((i * 37 + j * 11) % 101) as f64;
        _ = writeln!(text, "v {:.6} {:.6} {z:.6}", i as f64 * 0.0017, 1.5 - j as f64 * 0.0013);
    }
    for (i, j) in places() {
        _ = writeln!(text, "vt {:.6} {:.6}", i as f64 / SIDE as f64, j as f64 / SIDE as f64);
    }
    for (i, j) in places().filter(|&(i, j)| i + 1 < SIDE && j + 1 < SIDE) {
        let a = i * SIDE + j + 1;
        let (b, c, d) = (a + SIDE, a + SIDE + 1, a + 1);
        _ = writeln!(text, "f {a}/{a} {b}/{b} {c}/{c}\nf {a}/{a} {c}/{c} {d}/{d}");
    }
    text
}

/// Builds the whole catalog twice into an empty folder: everything, then nothing.
fn build_s(assets: &Path) -> Result<(f64, f64), String> {
    let folder = std::env::temp_dir().join(format!("kitsuke-bench-{}", std::process::id()));
    let options = Options {
        assets: assets.to_owned(),
        catalog: folder.join("catalog"),
        cache: folder.join("cache"),
        ids: Vec::new(),
        mode: Mode::Write,
        emit: None,
    };
    let build = || -> Result<f64, String> {
        let begin = Instant::now();
        let report = catalog::build(&options, &catalog::Silent).map_err(|error| error.to_string())?;
        let elapsed_s = begin.elapsed().as_secs_f64();
        if report.is_complete() {
            Ok(elapsed_s)
        } else {
            Err("the catalog cannot be built: run cargo xtask build-catalog".to_owned())
        }
    };
    let times = build().and_then(|clean_s| Ok((clean_s, build()?)));
    // Nothing was built where the folder is missing.
    let _ = fs::remove_dir_all(&folder);
    times
}

/// Medians of a fit and of making its shape, over wearers between and beyond the bodies for which the kimono exists.
fn fit_us(fitter: &Fitter) -> (f64, f64) {
    let bodies = &fitter.data().bodies;
    let mut wearers = Vec::new();
    for (i, a) in bodies.iter().enumerate() {
        for b in &bodies[..i] {
            wearers.extend([-0.25, 0.3, 0.5, 0.8].map(|share| between(&a.measurements, &b.measurements, share)));
        }
    }
    let mut scratch = fit::Scratch::default();
    let mut positions_m = Vec::new();
    let (mut fit_us, mut shape_us) = (Vec::new(), Vec::new());
    for wearer in &wearers {
        let mut fit = None;
        fit_us.push(microseconds(|| fit = fitter.fit(black_box(wearer), 0, &mut scratch).ok()));
        let Some(fit) = fit else { continue };
        positions_m.resize(fitter.data().fields[0].deltas.len(), Vec3::ZERO);
        shape_us.push(microseconds(|| fitter.shape(&fit, &mut positions_m)));
        black_box(&positions_m);
    }
    (median(fit_us), median(shape_us))
}

/// A body between two, or beyond the first where `share` is negative.
fn between(a: &Measurements, b: &Measurements, share: f32) -> Measurements {
    let known = |m| Some((m, a.get(m)? + share * (b.get(m)? - a.get(m)?)));
    let known = Measurement::ALL.into_iter().filter_map(known);
    known.fold(Measurements::default(), |body, (measurement, value_m)| body.with(measurement, value_m))
}

fn microseconds<T>(run: impl FnOnce() -> T) -> f64 {
    let begin = Instant::now();
    run();
    begin.elapsed().as_secs_f64() * 1e6
}

fn median(values: Vec<f64>) -> f64 {
    quantile(values, 0.5)
}

/// The value below which this share of the values lies; 0 of none.
fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let place = (values.len().saturating_sub(1) as f64 * share).round() as usize;
    values.get(place).copied().unwrap_or(0.0)
}

/// To a thousandth: finer is noise.
fn rounded(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_values_of_the_sorted_list() {
        let values = || vec![3.0, 1.0, 2.0, 5.0, 4.0];
        assert_eq!([0.0, 0.5, 0.99].map(|share| quantile(values(), share)), [1.0, 3.0, 5.0]);
        assert_eq!(quantile(Vec::new(), 0.5), 0.0);
    }
}
