//! `cargo xtask drape-scene NAME`: cloth that falls and comes to rest, with figures and pictures.

mod around;
mod curves;
mod darts;
mod energy;
pub mod kimono;
mod laboratory;
mod on_form;
mod picture;
mod plain;
mod sewing;
mod tight_skirt;

use crate::form::FormArgs;
use crate::places::{Places, ended, say, write_whole};
use crate::scans::{MeshArgs, unit};
use around::Around;
use glam::DVec3;
use kitsuke_drape::certificate::Certificate;
use kitsuke_drape::drape::{Drape, Settings, State, Stepped, strain};
use kitsuke_drape::rest::{Course, go_on, is_still, simulated_s, to_rest};
use kitsuke_drape::sheet::Sheet;
use kitsuke_drape::woven::{PRESETS, Woven};
use kitsuke_pipeline::source::units::LengthUnit;
use on_form::OnForm;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Tenths of a second between two pictures.
const FILMED: u64 = 10;
/// What a saved state begins with; a line that says of which scene it is follows.
const STATE_OF: &str = "kitsuke drape-scene ";

/// Let cloth fall and come to certified rest, and show it
///
/// Scenes: kimono (a kimono of the catalog, its base draped anew from a displaced start, held by its obi), hanging, sphere, twist, layers,
/// cantilever and drape-coefficient (of textile laboratories, with what they measure), sewing (a bag cut from outlines, with curved and eased seams), tight-skirt (on the form of --body, with its pattern), darts
/// (the same with darts that overlap and darts whose cloth is cut away, one and two to a quarter), hands-move, hands-cut and hands-combine (cloth under the hands of a script, see `hands`; --body puts a body there).
/// Prints how it goes; ends with the certificate: at rest, outside the body, clear of itself, or what fails and where.
/// Ctrl-C keeps the state; the same command goes on from it with the same bytes.
#[derive(clap::Args)]
pub struct Args {
    /// The scene
    #[arg(value_parser = ["kimono", "hanging", "sphere", "twist", "layers", "cantilever", "drape-coefficient", "sewing", "tight-skirt", "darts", "hands-move", "hands-cut", "hands-combine"])]
    scene: String,
    /// Which kimono [default: komon]
    #[arg(long)]
    id: Option<String>,
    /// Take the wearer from the T-pose to a pose of the kimono's table and say how far the cloth then lies from that target
    #[arg(long, value_name = "NAME")]
    pose: Option<String>,
    /// Which displaced start of the kimono [default: 0]
    #[arg(long)]
    start: Option<u32>,
    /// How far the start is displaced, millimetres [default: 30]
    #[arg(long, value_name = "MM")]
    displaced: Option<f64>,
    /// The cloth [default: chirimen; yukata for what is draped on a form]
    #[arg(long, value_parser = PRESETS.map(|preset| preset.0))]
    cloth: Option<String>,
    /// Most seconds to simulate [default: 10; 6 for each drape on a form]
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// Parts of a step of 1/600 s: more stretch less and take longer [default: what the scene needs]
    #[arg(long)]
    parts: Option<u32>,
    /// Where pictures, the draped shape and a state that was interrupted go
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Write the figures as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// The body on whose form the skirt is draped, a closed mesh that stands upright
    #[arg(long, value_name = "FILE", required_if_eq_any([("scene", "tight-skirt"), ("scene", "darts")]))]
    body: Option<PathBuf>,
    /// The body's unit, where its file does not say it
    #[arg(long, value_parser = unit)]
    unit: Option<LengthUnit>,
    /// Lines of the form that are known better than the rules find them, see `form`
    #[arg(long, value_name = "FILE.toml")]
    lines: Option<PathBuf>,
    /// From the skirt's waist to its hem, millimetres [default: 550]
    #[arg(long, value_name = "MM")]
    length: Option<f64>,
    /// Seam allowance of the skirt's pattern, millimetres [default: 10]
    #[arg(long, value_name = "MM")]
    allowance: Option<f64>,
    #[command(flatten)]
    places: Places,
}

/// What is simulated.
pub struct Scene {
    pub sheet: Sheet,
    pub around: Around,
    /// Where the cloth starts, if not where its sheet is.
    pub start_m: Option<Vec<DVec3>>,
    /// Where others draped the same cloth, metres.
    pub target_m: Option<Vec<DVec3>>,
    /// Parts of a step that it needs: the finer the cloth, the more, or it stretches and hangs lower than it is stiff.
    pub parts: u32,
    /// Drag with which what swings comes to rest, and what trembles, see [`Course`].
    pub drag_per_s: [f64; 2],
    /// What is measured where the cloth lies.
    pub figures: Option<Measure>,
}

/// Measures cloth at these places.
pub type Measure = Box<dyn Fn(&Scene, &Woven, &[DVec3]) -> Figures>;

/// Names with units, as in the JSON, and values.
pub type Figures = Vec<(&'static str, f64)>;

impl Scene {
    /// A sheet, and nothing else.
    pub fn of(sheet: Sheet) -> Scene {
        Scene {
            sheet,
            around: Around::default(),
            start_m: None,
            target_m: None,
            parts: 4,
            drag_per_s: [10.0, 100.0],
            figures: None,
        }
    }

    /// Ready to be simulated, with the cloth where it starts, and how it comes to rest.
    fn begun(&mut self, woven: &Woven, settings: &Settings) -> Result<(Drape, State, Course), String> {
        self.around.step_s = settings.step_s;
        let drape = Drape::new(&self.sheet, woven, settings).map_err(|error| error.to_string())?;
        let mut state = drape.state(&self.sheet);
        if let Some(start_m) = &self.start_m {
            state.positions_m.clone_from(start_m);
        }
        let course = Course {
            moving_s: self.around.moves.as_ref().map_or(0.0, |moves| moves.seconds),
            drag_per_s: [settings.drag_per_s, self.drag_per_s[0], self.drag_per_s[1]],
            ..Course::default()
        };
        Ok((drape, state, course))
    }
}

/// Simulates; 1 when something cannot be read or written, or the cloth does not come to certified rest.
pub fn run(args: Args) -> ExitCode {
    ended(args.check().and_then(|()| match args.scene.as_str() {
        "tight-skirt" => tight_skirt::draped(&args.on_form(), args.allowance.unwrap_or(10.0)),
        "darts" => darts::draped(&args.on_form()),
        "hands-move" => args.under_hands(include_str!("../hands/scenes/move.toml")),
        "hands-cut" => args.under_hands(include_str!("../hands/scenes/cut.toml")),
        "hands-combine" => args.under_hands(include_str!("../hands/scenes/combine.toml")),
        _ => draped(&args),
    }))
}

impl Args {
    /// Whether the scene has a meaning for every option that is given.
    fn check(&self) -> Result<(), String> {
        const KIMONO: &[&str] = &["kimono"];
        const FALLING: &[&str] =
            &["kimono", "hanging", "sphere", "twist", "layers", "cantilever", "drape-coefficient", "sewing"];
        const ON_FORM: &[&str] = &["tight-skirt", "darts"];
        const WITH_BODY: &[&str] = &["tight-skirt", "darts", "hands-move", "hands-cut", "hands-combine"];
        let options = [
            ("--id", self.id.is_some(), KIMONO),
            ("--pose", self.pose.is_some(), KIMONO),
            ("--start", self.start.is_some(), KIMONO),
            ("--displaced", self.displaced.is_some(), KIMONO),
            ("--parts", self.parts.is_some(), FALLING),
            ("--cloth", self.cloth.is_some(), &[FALLING, ON_FORM].concat()),
            ("--seconds", self.seconds.is_some(), &[FALLING, ON_FORM].concat()),
            ("--body", self.body.is_some(), WITH_BODY),
            ("--unit", self.unit.is_some(), WITH_BODY),
            ("--lines", self.lines.is_some(), ON_FORM),
            ("--length", self.length.is_some(), ON_FORM),
            ("--allowance", self.allowance.is_some(), &["tight-skirt"]),
        ];
        for (option, is_given, scenes) in options {
            if is_given && !scenes.contains(&self.scene.as_str()) {
                return Err(format!(
                    "{option} has no meaning for the scene {}, only for {}: leave it out",
                    self.scene,
                    scenes.join(", ")
                ));
            }
        }
        Ok(())
    }

    fn under_hands(&self, script: &str) -> Result<(), String> {
        let form = self.body.as_ref().map(|body| FormArgs::of(MeshArgs::of(body, self.unit), None));
        crate::hands::scene(script, form.as_ref(), &self.out, self.json.as_deref())
    }

    /// Which one, which start of it, and how far that is displaced, millimetres.
    fn kimono(&self) -> (&str, u32, f64) {
        (self.id.as_deref().unwrap_or("komon"), self.start.unwrap_or(0), self.displaced.unwrap_or(30.0))
    }

    fn woven(&self, default: &str) -> Woven {
        Woven::preset(self.cloth.as_deref().unwrap_or(default)).expect("clap allows presets only")
    }

    fn on_form(&self) -> OnForm<'_> {
        let body = self.body.as_ref().expect("clap wants it of scenes on a form");
        OnForm {
            form: FormArgs::of(MeshArgs::of(body, self.unit), self.lines.clone()),
            woven: self.woven("yukata"),
            length_m: 1e-3 * self.length.unwrap_or(550.0),
            most_s: self.seconds.unwrap_or(6.0),
            out: &self.out,
            json: self.json.as_deref(),
        }
    }
}

fn draped(args: &Args) -> Result<(), String> {
    let woven = args.woven("chirimen");
    let most_s = args.seconds.unwrap_or(10.0);
    let mut scene = match args.scene.as_str() {
        "kimono" => {
            let (id, start, displaced_mm) = args.kimono();
            kimono::scene(&args.places, id, start, 1e-3 * displaced_mm, args.pose.as_deref())?
        }
        "sewing" => sewing::scene()?,
        name => plain::scene(name, &woven)?,
    };
    let settings = Settings { parts: args.parts.unwrap_or(scene.parts), ..Settings::default() };
    let (mut drape, mut state, course) = scene.begun(&woven, &settings)?;
    let kept = args.out.join(format!("{}.state", args.scene));
    let of = of_state(args, &settings);
    if let Ok(bytes) = std::fs::read(&kept) {
        state = saved_state(&bytes, &of, state.positions_m.len()).map_err(|problem| {
            format!("{} {problem}; delete it to begin anew, or say another --out", kept.display())
        })?;
        say!("goes on from {} after {:.2} s", kept.display(), simulated_s(&drape, &state));
    }
    let stop = Arc::new(AtomicBool::new(false));
    let stopped = Arc::clone(&stop);
    ctrlc::set_handler(move || stopped.store(true, Ordering::Relaxed)).map_err(|error| error.to_string())?;

    let stores = energy::stores(&scene.sheet, &woven);
    let mut lowest_j = f64::INFINITY;
    let mut film = vec![picture::Frame::of(&scene, &state, &settings)];
    let started = Instant::now();
    let most_steps = (most_s / settings.step_s) as u64;
    let mut certificate = None;
    let mut last = Stepped::default();
    let mut tenths = 0;
    while state.steps < most_steps && certificate.is_none() {
        last = go_on(&mut drape, &mut scene.around, &course, &mut state);
        let (mean, _) = strain(&scene.sheet, &state.positions_m);
        let energy_j = energy::energy(&stores, &state.positions_m).sum_j();
        say!(
            "{:5.2} s of cloth in {:6.1} s: moves at {:8.3} mm/s, at most {:8.2}; strain {:.3} %; {:.5} J; {} near pairs, {} on the body, {} wait, {} looks",
            simulated_s(&drape, &state),
            started.elapsed().as_secs_f64(),
            1e3 * last.speed_m_per_s,
            1e3 * last.fastest_m_per_s,
            1e2 * mean,
            energy_j,
            last.pairs,
            last.on_body,
            last.waiting,
            last.looks
        );
        if stop.load(Ordering::Relaxed) {
            write_whole(&kept, |out| out.write_all(&state_bytes(&of, &state)))?;
            return Err(format!("interrupted; the same command goes on from {}", kept.display()));
        }
        tenths += 1;
        if tenths % FILMED == 0 {
            film.push(picture::Frame::of(&scene, &state, &settings));
        }
        if is_still(&drape, &course, &state, &last) {
            certificate = Some(drape.certify(scene.around.body.as_ref(), course.bounds, &state));
        } else if simulated_s(&drape, &state) > course.moving_s + course.free_s {
            lowest_j = lowest_j.min(energy_j);
        }
    }
    let seconds = started.elapsed().as_secs_f64();
    let (rests, waiting) = (certificate.is_some(), last.waiting);
    let certificate = certificate.unwrap_or_else(|| drape.certify(scene.around.body.as_ref(), course.bounds, &state));
    film.push(picture::Frame::of(&scene, &state, &settings));
    picture::write(&args.out.join(format!("{}.png", args.scene)), &scene, &film, &certificate)?;
    write_obj(&args.out.join(format!("{}.obj", args.scene)), &scene, &state)?;
    if kept.exists() {
        std::fs::remove_file(&kept).map_err(|error| format!("cannot delete {}: {error}", kept.display()))?;
    }
    let (mean, most) = strain(&scene.sheet, &state.positions_m);
    say!(
        "{:.2} s of cloth in {seconds:.1} s on {} threads; strain {:.3} % mean, {:.1} % at most",
        simulated_s(&drape, &state),
        rayon::current_num_threads(),
        1e2 * mean,
        1e2 * most
    );
    let energy = energy::energy(&stores, &state.positions_m);
    let mut measured = vec![
        ("gravity_mj", 1e3 * energy.gravity_j),
        ("stretch_mj", 1e3 * energy.stretch_j),
        ("bending_mj", 1e3 * energy.bending_j),
        ("waiting", waiting as f64),
    ];
    if lowest_j.is_finite() {
        measured.push(("above_lowest_before_mj", 1e3 * (energy.sum_j() - lowest_j)));
    }
    measured.extend(scene.figures.as_ref().map_or(Vec::new(), |figures| figures(&scene, &woven, &state.positions_m)));
    if let Some(target_m) = &scene.target_m {
        let mut away_mm: Vec<f64> =
            target_m.iter().zip(&state.positions_m).map(|(a, b)| 1e3 * a.distance(*b)).collect();
        away_mm.sort_by(f64::total_cmp);
        let mean_mm = away_mm.iter().sum::<f64>() / away_mm.len() as f64;
        measured.push(("target_mean_mm", mean_mm));
        measured.push(("target_p95_mm", away_mm[away_mm.len() * 95 / 100]));
    }
    measured.iter().for_each(|(name, value)| say!("{name}: {value:.3}"));
    if let Some(path) = &args.json {
        let figures = figures(&certificate, seconds, simulated_s(&drape, &state), (mean, most), &measured);
        write_whole(path, |out| out.write_all(figures.as_bytes()))?;
    }
    if rests && certificate.is_certified() {
        say!("{certificate}; {waiting} particles wait at their bounds");
        return Ok(());
    }
    Err(format!("the cloth does not come to certified rest in {most_s} s:\n{certificate}"))
}

/// Lets a scene come to rest without a word, within so many simulated seconds, and says whether it does.
pub fn rested(scene: &mut Scene, woven: &Woven, settings: &Settings, seconds: f64) -> Result<Certificate, String> {
    let (mut drape, mut state, course) = scene.begun(woven, settings)?;
    Ok(to_rest(&mut drape, &mut scene.around, &course, seconds, &mut state, &mut |_, _| ()))
}

/// Of what a saved state is: all that decides how it goes on.
fn of_state(args: &Args, settings: &Settings) -> String {
    let Args { scene, pose, .. } = args;
    let cloth = args.cloth.as_deref().unwrap_or("chirimen");
    let mut of = format!("{scene} --cloth {cloth} --parts {}", settings.parts);
    if scene == "kimono" {
        let (id, start, displaced_mm) = args.kimono();
        of += &format!(" --id {id} --start {start} --displaced {displaced_mm}");
        of += &pose.as_ref().map_or(String::new(), |pose| format!(" --pose {pose}"));
    }
    of
}

/// A line of text, steps, then places and velocities, little endian.
fn state_bytes(of: &str, state: &State) -> Vec<u8> {
    let mut bytes = format!("{STATE_OF}{of}\n").into_bytes();
    bytes.extend(state.steps.to_le_bytes());
    for list in [&state.positions_m, &state.velocities_m_per_s] {
        bytes.extend(list.iter().flat_map(|v| v.to_array()).flat_map(f64::to_le_bytes));
    }
    bytes
}

fn saved_state(bytes: &[u8], of: &str, particles: usize) -> Result<State, String> {
    let line = bytes.split(|byte| *byte == b'\n').next().and_then(|line| std::str::from_utf8(line).ok());
    let Some(was_of) = line.and_then(|line| line.strip_prefix(STATE_OF)) else {
        return Err("is no state of drape-scene".to_owned());
    };
    if was_of != of {
        return Err(format!("is of `{was_of}`, not of `{of}`"));
    }
    let bytes = &bytes[STATE_OF.len() + of.len() + 1..];
    let words: Vec<[u8; 8]> = bytes.chunks_exact(8).map(|word| word.try_into().expect("8 bytes")).collect();
    if bytes.len() != 8 * (1 + 6 * particles) {
        return Err(format!("has {} bytes behind its first line, not {}", bytes.len(), 8 * (1 + 6 * particles)));
    }
    let numbers: Vec<f64> = words[1..].iter().map(|word| f64::from_le_bytes(*word)).collect();
    if numbers.iter().any(|number| !number.is_finite()) {
        return Err("holds a number that is none".to_owned());
    }
    let list = |of: &[f64]| of.chunks_exact(3).map(DVec3::from_slice).collect();
    let (positions, velocities) = numbers.split_at(3 * particles);
    Ok(State {
        positions_m: list(positions),
        velocities_m_per_s: list(velocities),
        went_m_per_s: vec![0.0; particles],
        steps: u64::from_le_bytes(words[0]),
    })
}

fn write_obj(path: &Path, scene: &Scene, state: &State) -> Result<(), String> {
    write_whole(path, |out| {
        state.positions_m.iter().try_for_each(|p| writeln!(out, "v {:.6} {:.6} {:.6}", p.x, p.y, p.z))?;
        scene.sheet.triangles().iter().try_for_each(|[a, b, c]| writeln!(out, "f {} {} {}", a + 1, b + 1, c + 1))
    })
}

fn figures(
    certificate: &Certificate,
    seconds: f64,
    simulated_s: f64,
    (mean, most): (f64, f64),
    measured: &Figures,
) -> String {
    let measured: String = measured.iter().map(|(name, value)| format!(",\n  \"{name}\": {value:.6}")).collect();
    let fastest = certificate.fastest.map_or(0.0, |fastest| fastest.speed_m_per_s);
    format!(
        "{{\n  \"certified\": {},\n  \"drape_to_rest_s\": {seconds:.2},\n  \"simulated_s\": {simulated_s:.3},\n  \"fastest_mm_per_s\": {:.4},\n  \
         \"strain_mean\": {mean:.6},\n  \"strain_max\": {most:.6},\n  \"inside\": {},\n  \"body_crossings\": {},\n  \"self_crossings\": {}{measured}\n}}\n",
        certificate.is_certified(),
        1e3 * fastest,
        certificate.inside.len(),
        certificate.body_crossings.len(),
        certificate.self_crossings.len()
    )
}
