//! How long it takes to look for crossings of a sheet that is folded over and for the distance to bodies, from formulas and from
//! an OBJ file: `cargo run --release -p kitsuke-drape --example certify_speed -- body.obj`. Writes nothing but its lines.
#![allow(clippy::print_stdout)]

use glam::DVec3;
use kitsuke_drape::analytic_form;
use kitsuke_drape::body::Body;
use kitsuke_drape::intersections::Surface;
use kitsuke_drape::sheet::{Grid, Sheet};
use std::hint::black_box;
use std::time::Instant;

/// Particles along a side.
const SIDE: usize = 118;
const SPACING_M: f64 = 0.008;
const TIMED_S: f64 = 0.5;

type Fault = Box<dyn std::error::Error + Send + Sync>;
type Mesh = (Vec<DVec3>, Vec<[u32; 3]>);

fn main() -> Result<(), Fault> {
    for threads in [1, 2] {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build()?.install(|| measure(threads))?;
    }
    Ok(())
}

fn measure(threads: usize) -> Result<(), Fault> {
    let grid = Grid {
        rows: SIDE,
        columns: SIDE,
        spacing_m: SPACING_M,
        corner_m: DVec3::ZERO,
        weft: DVec3::X,
        warp: DVec3::NEG_Z,
    };
    let sheet = Sheet::from_grid(&grid)?;
    let positions_m: Vec<DVec3> = sheet.positions_m().iter().map(|&place| folded(place)).collect();
    let mut surface = Surface::new(&positions_m, sheet.triangles());
    println!("{threads} threads, {} particles, {} triangles", positions_m.len(), sheet.triangles().len());
    println!("  build            {:>8.3} ms", milliseconds(|| Surface::new(&positions_m, sheet.triangles())));
    println!("  refit            {:>8.3} ms", milliseconds(|| surface.refit(&positions_m)));
    let flat = Surface::new(sheet.positions_m(), sheet.triangles());
    println!(
        "  flat             {:>8.3} ms, {}",
        milliseconds(|| flat.self_intersections()),
        flat.self_intersections().len()
    );
    let tree = surface.tree();
    let (touching, near) = (tree.self_pairs(0.0).len(), tree.self_pairs(0.002).len());
    println!("  self pairs       {:>8.3} ms, {touching}", milliseconds(|| tree.self_pairs(0.0)));
    println!("  within 2 mm      {:>8.3} ms, {near}", milliseconds(|| tree.self_pairs(0.002)));
    let crossings = surface.self_intersections().len();
    println!("  intersections    {:>8.3} ms, {crossings}", milliseconds(|| surface.self_intersections()));

    let mut bodies = vec![
        ("sphere".to_owned(), analytic_form::sphere(DVec3::Y, 0.25, 164)),
        ("dress form".to_owned(), analytic_form::dress_form(400)),
    ];
    for path in std::env::args().skip(1) {
        let mesh = mesh(&std::fs::read_to_string(&path)?)?;
        bodies.push((path, mesh));
    }
    for (name, (body_m, triangles)) in bodies {
        let mut body = Body::new(&body_m, &triangles)?;
        // Up to 5 mm before and behind the middles of triangles.
        let mut places_m = Vec::new();
        for (number, corners) in triangles.iter().enumerate() {
            let [a, b, c] = corners.map(|corner| body_m[corner as usize]);
            let height_m = 0.005 * libm::sin(number as f64);
            places_m.push((a + b + c) / 3.0 + height_m * (b - a).cross(c - a).normalize_or_zero());
        }
        println!("  {name} of {} triangles", triangles.len());
        println!("    moved          {:>8.3} ms", milliseconds(|| body.moved(&body_m)));
        let meets_itself = body.self_intersections().len();
        println!("    intersections  {:>8.3} ms, {meets_itself}", milliseconds(|| body.self_intersections()));
        for within_m in [0.005, 0.02, f64::INFINITY] {
            let one_pass = milliseconds(|| {
                let mut found = 0;
                for &place in &places_m {
                    found += usize::from(body.signed_distance(black_box(place), within_m).is_some());
                }
                found
            });
            let per_second = 1e3 * places_m.len() as f64 / one_pass;
            println!("    distances within {within_m:>5} m: {per_second:>9.0} per second and thread");
        }
        let one_pass = milliseconds(|| places_m.iter().filter(|&&place| body.contains(black_box(place))).count());
        println!(
            "    contains:                  {:>9.0} per second and thread",
            1e3 * places_m.len() as f64 / one_pass
        );
    }
    Ok(())
}

/// Rolled over its middle, with ripples, so that the halves pass through each other here and there.
fn folded(place_m: DVec3) -> DVec3 {
    let half_m = 0.5 * SPACING_M * (SIDE - 1) as f64;
    let (radius_m, along_m) = (0.002, place_m.x - half_m);
    let angle_rad = (along_m / radius_m).clamp(-0.5, 0.5) * std::f64::consts::PI;
    let ripple_m = 0.003 * libm::sin(60.0 * along_m.abs() + 20.0 * along_m) * libm::sin(50.0 * place_m.z);
    DVec3::new(
        -(along_m.abs() - 0.5 * radius_m).max(0.0) + radius_m * libm::cos(angle_rad),
        radius_m * libm::sin(angle_rad) + ripple_m,
        place_m.z,
    )
}

/// Positions and triangles of an OBJ file.
fn mesh(text: &str) -> Result<Mesh, Fault> {
    let (mut positions_m, mut triangles) = (Vec::new(), Vec::new());
    for line in text.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            ["v", x, y, z, ..] => positions_m.push(DVec3::new(x.parse()?, y.parse()?, z.parse()?)),
            ["f", ref corners @ ..] => {
                let index = |word: &&str| word.split('/').next().unwrap_or("").parse::<u32>().map(|index| index - 1);
                let corners: Vec<u32> = corners.iter().map(index).collect::<Result<_, _>>()?;
                triangles.extend((2..corners.len()).map(|i| [corners[0], corners[i - 1], corners[i]]));
            }
            _ => {}
        }
    }
    Ok((positions_m, triangles))
}

/// The mean time of a call.
fn milliseconds<T>(mut call: impl FnMut() -> T) -> f64 {
    let (start, mut calls) = (Instant::now(), 0);
    while start.elapsed().as_secs_f64() < TIMED_S {
        black_box(call());
        calls += 1;
    }
    1e3 * start.elapsed().as_secs_f64() / f64::from(calls)
}
