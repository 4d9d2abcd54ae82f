//! `cargo xtask form BODY`: the dress form of a body, its lines, and how true it is.

use crate::places::{ended, say, write_whole};
use crate::scans::MeshArgs;
use glam::{DVec2, DVec3, Vec3};
use kitsuke_drape::body::Body;
use kitsuke_drape::form::{Cut, Form, Lines};
use kitsuke_pipeline::diagnostic::{self, Format};
use kitsuke_pipeline::look::raster::{Camera, Lens, Paint, Shape, render, smooth_normals};
use kitsuke_pipeline::look::sheet::{Cell, contact_sheet, png_bytes};
use kitsuke_pipeline::source::form_lines::{self, FormLines};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

const PLAIN: [u8; 3] = [206, 188, 170];
const TAPE: [u8; 3] = [30, 60, 150];
const BACKGROUND: [u8; 3] = [244, 243, 240];
/// How wide a line is drawn, metres.
const TAPE_M: f64 = 0.003;
const SIDE_PX: u32 = 720;

/// Make the dress form of a body
///
/// The body is a closed mesh that stands upright in a T- or A-pose. Writes form.png, form.obj and form.toml, the lines found; corrected there, they
/// are given with --lines.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    pub form: FormArgs,
    /// Where the form goes
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Write the figures as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// A body and how its form is made, as options of a verb.
#[derive(clap::Args)]
pub struct FormArgs {
    #[command(flatten)]
    pub body: MeshArgs,
    /// Level sections
    #[arg(long, default_value_t = Cut::default().sections)]
    sections: usize,
    /// Places of each section
    #[arg(long, default_value_t = Cut::default().places)]
    places: usize,
    /// Where the form begins, share of the body's height
    #[arg(long, default_value_t = Cut::default().from)]
    from: f64,
    /// Lines that are known better than the rules find them: a TOML file with waist, hip, bust, centre_x, side_z
    #[arg(long, value_name = "FILE.toml")]
    lines: Option<PathBuf>,
}

/// Makes the form; 1 when something cannot be read or written.
pub fn run(args: Args) -> ExitCode {
    ended(make(&args))
}

impl FormArgs {
    /// A body's form as fine as the paper's, down to below the knee, for skirts.
    pub fn of(body: MeshArgs, lines: Option<PathBuf>) -> FormArgs {
        let Cut { sections, places, .. } = Cut::default();
        FormArgs { body, sections, places, from: 0.15, lines }
    }

    /// The body and its form, with the lines that were given.
    pub fn make(&self) -> Result<(Body, Form), String> {
        let scan = self.body.read()?;
        let named = |error: &dyn std::fmt::Display| format!("{}: {error}", self.body.file.display());
        let body = Body::with_holes_closed(&scan.positions_m, &scan.mesh.triangles).map_err(|error| named(&error))?;
        let cut = Cut { sections: self.sections, places: self.places, from: self.from };
        let form = Form::of(&body, &cut).map_err(|error| named(&error))?;
        let Some(path) = &self.lines else { return Ok((body, form)) };
        let given = read_lines(path)?;
        let found = form.lines;
        let lines = Lines {
            waist_m: given.waist_m.unwrap_or(found.waist_m),
            hip_m: given.hip_m.unwrap_or(found.hip_m),
            bust_m: given.bust_m.unwrap_or(found.bust_m),
            centre_x_m: given.centre_x_m.unwrap_or(found.centre_x_m),
            side_z_m: given.side_z_m.unwrap_or(found.side_z_m),
        };
        let form = form.with_lines(lines).map_err(|error| format!("{}: {error}", path.display()))?;
        Ok((body, form))
    }
}

fn read_lines(path: &Path) -> Result<FormLines, String> {
    let bytes = std::fs::read(path).map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    let mut report = Vec::new();
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let lines = form_lines::read(&name, &bytes, &mut report);
    let folder = path.parent().unwrap_or(Path::new("."));
    eprint!("{}", diagnostic::render(&diagnostic::sorted(report), folder, Format::Human { color: false }));
    lines.ok_or_else(|| format!("{} has mistakes", path.display()))
}

fn make(args: &Args) -> Result<(), String> {
    let started = Instant::now();
    let (body, form) = args.form.make()?;
    let seconds = started.elapsed().as_secs_f64();
    let lines = form.lines;
    for (name, height_m) in [("waist", lines.waist_m), ("hip", lines.hip_m), ("bust", lines.bust_m)] {
        say!("{name}: {:.1} cm high, {:.1} cm around", 1e2 * height_m, 1e2 * form.section(height_m).girth_m());
    }
    let apart = form.apart(&body, form.arms_m);
    let with_shoulders = form.apart(&body, f64::INFINITY);
    say!(
        "below the arms ({:.1} cm), form from its body: {:.2} mm on average, {:.2} at most (at {:.0} mm); body from its form: {:.2} and {:.2} mm ({} vertices); {:.1} % of the form is open; made in {seconds:.2} s",
        1e2 * form.arms_m,
        1e3 * apart.form_mean_m,
        1e3 * apart.form_max_m,
        1e3 * apart.form_worst_m,
        1e3 * apart.body_mean_m,
        1e3 * apart.body_max_m,
        apart.vertices,
        1e2 * apart.open
    );
    say!("with shoulders {:.2} and {:.2} mm at most", 1e3 * with_shoulders.form_max_m, 1e3 * with_shoulders.body_max_m);
    let (positions_m, triangles) = form.mesh(0.0);
    let png = picture(&form, &positions_m, &triangles)?;
    write_whole(&args.out.join("form.png"), |out| out.write_all(&png))?;
    write_whole(&args.out.join("form.obj"), |out| {
        positions_m.iter().try_for_each(|p| writeln!(out, "v {:.6} {:.6} {:.6}", p.x, p.y, p.z))?;
        triangles.iter().try_for_each(|[a, b, c]| writeln!(out, "f {} {} {}", a + 1, b + 1, c + 1))
    })?;
    let toml = format!(
        "# Heights above the ground, and the planes of the centre lines (to the wearer's left) and of the side lines (to the front).\n\
         waist = \"{:.1} mm\"\nhip = \"{:.1} mm\"\nbust = \"{:.1} mm\"\ncentre_x = \"{:.1} mm\"\nside_z = \"{:.1} mm\"\n",
        1e3 * lines.waist_m,
        1e3 * lines.hip_m,
        1e3 * lines.bust_m,
        1e3 * lines.centre_x_m,
        1e3 * lines.side_z_m
    );
    write_whole(&args.out.join("form.toml"), |out| out.write_all(toml.as_bytes()))?;
    if let Some(path) = &args.json {
        let figures = serde_json::json!({
            "form_mean_mm": 1e3 * apart.form_mean_m.max(apart.body_mean_m),
            "form_max_mm": 1e3 * apart.form_max_m.max(apart.body_max_m),
            "form_with_shoulders_max_mm": 1e3 * with_shoulders.form_max_m.max(with_shoulders.body_max_m),
            "form_open": apart.open,
            "form_s": seconds,
            "waist_m": lines.waist_m,
            "hip_m": lines.hip_m,
            "bust_m": lines.bust_m,
            "waist_girth_m": form.section(lines.waist_m).girth_m(),
            "hip_girth_m": form.section(lines.hip_m).girth_m(),
            "bust_girth_m": form.section(lines.bust_m).girth_m(),
        });
        write_whole(path, |out| writeln!(out, "{figures:#}"))?;
    }
    Ok(())
}

/// From the front, the side, behind and askew, with the lines as tape.
fn picture(form: &Form, positions_m: &[DVec3], triangles: &[[u32; 3]]) -> Result<Vec<u8>, String> {
    let Lines { waist_m, hip_m, bust_m, centre_x_m, side_z_m } = form.lines;
    let is_taped = |p: &DVec3| {
        let near = |a: f64, b: f64| (a - b).abs() < 0.5 * TAPE_M;
        near(p.y, waist_m) || near(p.y, hip_m) || near(p.y, bust_m) || near(p.x, centre_x_m) || near(p.z, side_z_m)
    };
    let colours: Vec<[u8; 3]> = positions_m.iter().map(|p| if is_taped(p) { TAPE } else { PLAIN }).collect();
    let single_m: Vec<Vec3> = positions_m.iter().map(|p| p.as_vec3()).collect();
    let normals = smooth_normals(&single_m, triangles);
    let [low_m, high_m] = form.span_m().map(|height_m| height_m as f32);
    let middle_m: DVec2 = form.section(form.lines.waist_m).middle_m;
    let target_m = Vec3::new(middle_m.x as f32, 0.5 * (low_m + high_m), middle_m.y as f32);
    let cells: Vec<Cell> =
        [("front", Vec3::Z), ("left side", Vec3::X), ("behind", Vec3::NEG_Z), ("from above", Vec3::new(0.5, 0.8, 0.8))]
            .into_iter()
            .map(|(name, side)| {
                let camera = Camera {
                    eye_m: target_m + 3.0 * side,
                    target_m,
                    lens: Lens::Orthographic { height_m: 1.15 * (high_m - low_m) },
                };
                let shape = Shape {
                    positions_m: &single_m,
                    normals: &normals,
                    triangles,
                    paint: Paint::PerVertex(&colours),
                    inside: None,
                };
                Cell { caption: name.to_owned(), picture: render(&[shape], &camera, [SIDE_PX; 2], BACKGROUND) }
            })
            .collect();
    png_bytes(&contact_sheet(&cells, 4)).map_err(|error| error.to_string())
}
