//! A cloth solver by others, rapier-cloth-core, on the scenes that our own is timed on: `cloth-peer SCENE [ITERATIONS [STEPS_PER_S]]`
//! prints one JSON line. Must not know our solver: it shares the scene's numbers, no code.
//!
//! # The scenes
//!
//! The sheet of both: 118 x 118 particles, 0.015 m apart, so 1.755 m square; particle `118 row + column`; Y is up, rows lie along X
//! (the weft), and the row number grows along Z (the warp). It is at rest when flat. The cell between rows r-1, r and columns c-1, c
//! has the diagonal from (r-1, c-1) to (r, c) where r + c is even, else the one from (r-1, c) to (r, c-1). It starts flat, horizontal
//! and without velocity; gravity is 9.81 m/s² down.
//!
//! * `hanging`: particle 0 at (-0.8775, 2, -0.8775) m. Row 0 is pinned where it starts, nothing else is. No contact of any kind.
//!   1.0 s is simulated; the last 0.5 s are timed.
//! * `folding`: particle 0 at (-0.8775, 1.55, -0.8775) m, nothing is pinned. A fixed sphere of radius 0.25 m, its centre at (0, 1, 0),
//!   has its top 0.3 m below the middle of the sheet; there is no floor. Cloth keeps 0.003 m away from the sphere (its particles) and
//!   from itself (everywhere), self-contact is on from the start. 0.6 s are simulated; the last 0.1 s are timed, when folds close.
//! * `folding_continuous`: the same, with the peer's continuous self-contact. Version 0.3.0 ends it at step 336 (0.56 s) with an error.
//!
//! The cloth: 0.15 kg/m², spread over the particles by the area of their triangles; friction of cloth on cloth and on the sphere 0.3;
//! velocities fade by 0.1 per second; a crease's torque at 90° is 0.004 N·m per metre of its length. The peer's edges do not stretch
//! (its standard, and what it advises); what they stretch nevertheless is what its iterations leave over.
//!
//! Steps are 1/600 s of 8 iterations (the peer's standard). What is timed is timed in 5 blocks of equally many steps.
//!
//! # The figures
//!
//! * `ms_per_step`: milliseconds of wall time per 1/600 s of simulated time, whatever the step: the median over the blocks.
//! * `strain_mean`, `strain_max`: of |length / 0.015 m - 1| over all 27,612 edges along warp and weft, diagonals left out, where each
//!   block ends: the mean of the 5 means, the greatest of all. Not of one moment: while a sheet swings, that is a matter of luck.
//! * `contacts`: what the peer holds as contacts at the end, cloth on cloth and cloth on sphere.

use rapier_cloth_core::{
    Cloth, ClothContactSettings, ClothError, ClothMaterial, ClothMesh, CollisionLimits, Contact, ContactKey,
    ContactSource, ContactStage, Solver, SolverSettings, Vec3,
};
use std::ops::Range;
use std::process::ExitCode;
use std::time::Instant;

/// Particles along warp and weft.
const SIDE: usize = 118;
const SPACING_M: f32 = 0.015;
const MASS_KG_PER_M2: f32 = 0.15;
const GRAVITY_M_PER_S2: f32 = 9.81;
const THICKNESS_M: f32 = 0.003;
const FRICTION: f32 = 0.3;
/// Torque of a crease at 90° per metre of its length, N·m/m.
const BENDING_N: f32 = 0.004;
const SPHERE_CENTRE_M: Vec3 = Vec3::new(0.0, 1.0, 0.0);
const SPHERE_RADIUS_M: f32 = 0.25;
const BLOCKS: usize = 5;

struct Scene {
    /// Where the sheet starts, metres.
    height_m: f32,
    is_pinned: bool,
    /// Whether there are a sphere and self-contact.
    has_contact: bool,
    is_continuous: bool,
    simulated_s: f64,
    /// How much of the end is timed, seconds.
    timed_s: f64,
}

fn scene(name: &str) -> Option<Scene> {
    let hanging = Scene {
        height_m: 2.0,
        is_pinned: true,
        has_contact: false,
        is_continuous: false,
        simulated_s: 1.0,
        timed_s: 0.5,
    };
    let folding = Scene {
        height_m: 1.55,
        is_pinned: false,
        has_contact: true,
        is_continuous: false,
        simulated_s: 0.6,
        timed_s: 0.1,
    };
    match name {
        "hanging" => Some(hanging),
        "folding" => Some(folding),
        "folding_continuous" => Some(Scene { is_continuous: true, ..folding }),
        _ => None,
    }
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match played(&arguments) {
        Ok(line) => {
            println!("{line}");
            ExitCode::SUCCESS
        }
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

fn played(arguments: &[String]) -> Result<String, String> {
    let usage = "usage: cloth-peer hanging|folding|folding_continuous [ITERATIONS [STEPS_PER_S]]";
    let name = arguments.first().ok_or(usage)?;
    let scene = scene(name).ok_or(usage)?;
    let mut settings = SolverSettings::default();
    if let Some(iterations) = arguments.get(1) {
        settings.iterations = iterations.parse().map_err(|_| usage)?;
    }
    let steps_per_s: f64 = arguments.get(2).map_or(Ok(600.0), |text| text.parse().map_err(|_| usage))?;

    let mut cloth = cloth(&scene).map_err(|error| format!("the cloth is refused: {error}"))?;
    let mut solver = Solver::new();
    let mut contacts = 0;
    let mut play = |cloth: &mut Cloth, steps: Range<usize>| {
        let (step_s, gravity) = ((1.0 / steps_per_s) as f32, Vec3::new(0.0, -GRAVITY_M_PER_S2, 0.0));
        for step in steps {
            let report = match scene.has_contact {
                true => solver.step_with_contacts(cloth, step_s, gravity, &settings, &[], &mut Sphere),
                false => solver.step(cloth, step_s, gravity, &settings),
            };
            contacts = report.map_err(|error| format!("step {step} fails: {error}"))?.contacts;
        }
        Ok::<_, String>(())
    };
    let steps = |seconds: f64| (seconds * steps_per_s).round() as usize;
    let block = steps(scene.timed_s) / BLOCKS;
    let timed_from = steps(scene.simulated_s) - BLOCKS * block;
    play(&mut cloth, 0..timed_from)?;
    let mut blocks_ms = Vec::new();
    let (mut strain_mean, mut strain_max) = (0.0, 0.0_f64);
    for number in 0..BLOCKS {
        let first = timed_from + number * block;
        let begin = Instant::now();
        play(&mut cloth, first..first + block)?;
        blocks_ms.push(begin.elapsed().as_secs_f64() * 1e3 / block as f64 * steps_per_s / 600.0);
        let (mean, max) = strains(cloth.positions());
        strain_mean += mean / BLOCKS as f64;
        strain_max = strain_max.max(max);
    }
    blocks_ms.sort_by(f64::total_cmp);
    let (vertices, step_s, iterations) = (cloth.positions().len(), 1.0 / steps_per_s, settings.iterations);
    let (ms_per_step, simulated_s) = (blocks_ms[BLOCKS / 2], scene.simulated_s);
    Ok(format!(
        r#"{{"scene":"{name}","vertices":{vertices},"step_s":{step_s},"iterations":{iterations},"ms_per_step":{ms_per_step},"strain_mean":{strain_mean},"strain_max":{strain_max},"contacts":{contacts},"simulated_s":{simulated_s}}}"#
    ))
}

fn cloth(scene: &Scene) -> Result<Cloth, ClothError> {
    let corner_m = Vec3::new(-0.8775, scene.height_m, -0.8775);
    let mut positions_m = Vec::new();
    let mut triangles = Vec::new();
    for row in 0..SIDE {
        for column in 0..SIDE {
            positions_m.push(corner_m + SPACING_M * Vec3::new(column as f32, 0.0, row as f32));
            if row == 0 || column == 0 {
                continue;
            }
            let d = (row * SIDE + column) as u32;
            let [a, b, c] = [d - SIDE as u32 - 1, d - SIDE as u32, d - 1];
            triangles.extend(if (row + column) % 2 == 0 { [[a, b, d], [a, d, c]] } else { [[a, b, c], [b, d, c]] });
        }
    }
    let mut mesh = ClothMesh::new(positions_m.clone(), triangles)?;
    // Without this, a crease would be as stiff as any other, however long it is.
    mesh.scale_hinge_stiffness(|hinge| {
        let [a, b, ..] = hinge.vertices.map(|vertex| positions_m[vertex as usize]);
        a.distance(b)
    })?;
    let material = ClothMaterial {
        surface_density: MASS_KG_PER_M2,
        stretch_compliance: 0.0,
        // Radians per N·m, of a crease of 1 m: its torque grows with the angle.
        bend_compliance: std::f32::consts::FRAC_PI_2 / BENDING_N,
        damping: 0.1,
        friction: FRICTION,
        contact_radius: THICKNESS_M,
        stitch_compliance: 0.0,
    };
    let mut cloth = Cloth::new(mesh, material)?;
    if scene.is_pinned {
        for particle in 0..SIDE as u32 {
            cloth.pin(particle, cloth.positions()[particle as usize])?;
        }
    }
    if scene.has_contact {
        cloth.set_contact_settings(Some(ClothContactSettings {
            thickness: THICKNESS_M,
            continuous_self_collision: scene.is_continuous,
            static_friction: FRICTION,
            kinetic_friction: FRICTION,
            // As soon as a sheet of this size does more than fall, neighbours in its mesh alone are more pairs than the
            // standard 2,000,000 per step, and the step ends with an error.
            limits: CollisionLimits {
                candidate_pairs: 200_000_000,
                ccd_checks: 200_000_000,
                ..CollisionLimits::default()
            },
            ..ClothContactSettings::default()
        }))?;
    }
    Ok(cloth)
}

/// The sphere of `folding`, as the peer asks for obstacles: a tangent plane for every particle near it.
struct Sphere;

impl ContactSource for Sphere {
    fn contacts(
        &mut self,
        _previous_m: &[Vec3],
        positions_m: &[Vec3],
        radius_m: f32,
        _stage: ContactStage,
        out: &mut Vec<Contact>,
    ) -> Result<(), ClothError> {
        for (particle, &position_m) in positions_m.iter().enumerate() {
            let outward_m = position_m - SPHERE_CENTRE_M;
            // A little more than the radius, so that what the next iteration pushes in is known to this one.
            if outward_m.length_squared() < (SPHERE_RADIUS_M + 2.0 * radius_m).powi(2) {
                let normal = outward_m.normalize();
                out.push(Contact {
                    key: ContactKey { particle: particle as u32, external: 0, feature: 0 },
                    normal,
                    point: SPHERE_CENTRE_M + SPHERE_RADIUS_M * normal,
                    surface_velocity: Vec3::ZERO,
                    friction: FRICTION,
                });
            }
        }
        Ok(())
    }
}

/// Mean and greatest strain of the edges along warp and weft.
fn strains(positions_m: &[Vec3]) -> (f64, f64) {
    let (mut sum, mut max, mut count) = (0.0, 0.0_f64, 0);
    let mut add = |a: usize, b: usize| {
        let strain = (f64::from(positions_m[a].distance(positions_m[b])) / f64::from(SPACING_M) - 1.0).abs();
        sum += strain;
        max = max.max(strain);
        count += 1;
    };
    for particle in 0..positions_m.len() {
        if particle % SIDE + 1 < SIDE {
            add(particle, particle + 1);
        }
        if particle + SIDE < positions_m.len() {
            add(particle, particle + SIDE);
        }
    }
    (sum / f64::from(count), max)
}
