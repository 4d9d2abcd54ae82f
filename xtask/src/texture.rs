//! `cargo xtask texture`: how a pattern lies on fitted kimono, with the texture kept, blended and corrected.

use crate::places::{Places, ended, write_whole};
use crate::wearers;
use glam::{Vec2, Vec3};
use kitsuke::Garment;
use kitsuke::fit::texture::{Energies, TextureScratch, Texturer};
use kitsuke::fit::{FitData, Fitter, Scratch};
use kitsuke_pipeline::look::scene::{Figure, Framing, Scene, View};
use kitsuke_pipeline::look::sheet::{Cell, contact_sheet, png_bytes, side_by_side};
use kitsuke_pipeline::look::texture::Texture;
use kitsuke_pipeline::measure::distortion::{Distortion, Worn, distortion, m_per_uv};
use kitsuke_pipeline::measure::weld_quality::{mixed, random_weights};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Print how a pattern is stretched and turned on fitted kimono: with the base's texture coordinates, with the sizes' flat pieces
/// blended, and corrected
#[derive(clap::Args)]
pub struct Args {
    /// A kimono's ID, or the path of a pack
    #[arg(value_name = "ID")]
    garment: String,
    /// The kimono in each of its sizes [default where nothing else is asked for]
    #[arg(long)]
    sizes: bool,
    /// So many kimono whose parts have sizes at random
    #[arg(long, value_name = "N", default_value_t = 0)]
    mixes: u64,
    /// The kimono of the bodies in a table, or of its Nth row, from 1
    #[arg(long, value_name = "FILE[#N]")]
    bodies: Option<String>,
    /// Use the paper's weights of the three energies
    #[arg(long)]
    paper: bool,
    /// Also draw each of them with a checker of 5 cm and with its own pattern, as one PNG per kimono
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Height of a picture, pixels
    #[arg(long, value_name = "PX", default_value_t = 640, value_parser = clap::value_parser!(u32).range(16..=2048))]
    height: u32,
    #[command(flatten)]
    places: Places,
}

/// Prints; 1 when something cannot be read, fitted or written.
pub fn run(args: Args) -> ExitCode {
    ended(texture(&args))
}

/// A kimono by its weights: a row per part with one for every size.
struct Mix {
    name: String,
    weights: Vec<f32>,
}

fn texture(args: &Args) -> Result<(), String> {
    let pack = args.places.open(&args.garment)?;
    let garment = pack.garment();
    let fit = pack.fit_data().map_err(|error| error.to_string())?;
    let fit = fit.ok_or_else(|| format!("{} exists in one size only", garment.data().id))?;
    let energies = if args.paper { Energies::PAPER } else { Energies::default() };
    let mesh = &garment.data().mesh;
    let texturer = Texturer::with_energies(mesh, &fit, energies).map_err(|error| error.to_string())?;
    let mut scratch = TextureScratch::new(&texturer);
    let m_per_uv = m_per_uv(mesh);
    println!(
        "{:16}{:^30}{:^47}{:>10}{:>7}",
        "", "RMS of (sigma - 1), %", "worst motif of 5 cm, %", "drawn out,", "grain,"
    );
    let heads = ["kept", "blended", "corrected"].map(|head| format!("{head:>10}")).concat();
    println!("{:16}{heads}{heads}  {:15}{:>10}{:>7}", "", "on", "%", "deg");
    let mut ratios = Vec::new();
    let mut worst_motif = (0.0f64, String::new());
    let mixes = mixes(args, garment, &fit)?;
    for mix in &mixes {
        let positions_m = mixed(garment, &fit, &mix.weights);
        let mut blended = vec![Vec2::ZERO; garment.vertex_count()];
        let mut corrected = blended.clone();
        texturer.blend(&mix.weights, &mut blended);
        texturer.correct(&positions_m, &mix.weights, &mut scratch, &mut corrected);
        let ways = [&mesh.uv, &blended, &corrected];
        let rows =
            ways.map(|uv| distortion(&Worn { mesh, positions_m: &positions_m, uv, straight_uv: &blended, m_per_uv }));
        let whole = |rows: &Vec<Distortion>| rows[rows.len() - 1].clone();
        let wholes = [0, 1, 2].map(|way| whole(&rows[way]));
        let part = rows[2].iter().position(|row| row.motif == wholes[2].motif).unwrap_or(0);
        let on = mesh.parts.get(part).map_or("", |part| part.name.as_str());
        let rms = wholes.each_ref().map(|row| format!("{:10.2}", 100.0 * row.rms)).concat();
        let motif = wholes.each_ref().map(|row| format!("{:+10.2}", 100.0 * row.motif)).concat();
        let corrected = &wholes[2];
        let drawn_out = 100.0 * corrected.drawn_out;
        println!("{:16}{rms}{motif}  {on:15}{drawn_out:10.2}{:7.2}", mix.name, corrected.turned_deg);
        ratios.push(wholes[2].rms / wholes[0].rms);
        if wholes[2].motif.abs() > worst_motif.0.abs() {
            worst_motif = (wholes[2].motif, format!("on {on} of {}", mix.name));
        }
        if let Some(dir) = &args.out {
            draw(args, garment, &mix.name, &positions_m, ways, m_per_uv, dir)?;
        }
    }
    let mean = ratios.iter().sum::<f64>() / ratios.len().max(1) as f64;
    let most = ratios.iter().copied().fold(0.0, f64::max);
    println!(
        "corrected / kept: mean {mean:.3}, at most {most:.3}; worst motif {:+.2} % {}",
        100.0 * worst_motif.0,
        worst_motif.1
    );
    Ok(())
}

/// The kimono that were asked for.
fn mixes(args: &Args, garment: &Garment, fit: &FitData) -> Result<Vec<Mix>, String> {
    let (parts, sizes) = (fit.parts.len(), fit.size_count());
    let mut mixes = Vec::new();
    if args.sizes || (args.mixes == 0 && args.bodies.is_none()) {
        mixes.extend(fit.bodies[1..].iter().enumerate().map(|(size, body)| Mix {
            name: body.name.clone(),
            weights: (0..parts * sizes).map(|i| if i % sizes == size { 1.0 } else { 0.0 }).collect(),
        }));
    }
    mixes.extend(
        (0..args.mixes).map(|mix| Mix { name: format!("mix {mix}"), weights: random_weights(mix, parts, sizes) }),
    );
    let Some(bodies) = &args.bodies else { return Ok(mixes) };
    let fitter = Fitter::new(garment, fit.clone()).map_err(|error| error.to_string())?;
    let mut scratch = Scratch::default();
    for wearer in wearers::load(bodies)? {
        let fitted =
            fitter.fit(&wearer.measurements, 0, &mut scratch).map_err(|error| format!("{}: {error}", wearer.name))?;
        mixes.push(Mix { name: wearer.name.clone(), weights: fitted.weights });
    }
    Ok(mixes)
}

/// One picture: kept, blended and corrected side by side, with a checker above and the garment's own pattern below.
fn draw(
    args: &Args,
    garment: &Garment,
    name: &str,
    positions_m: &[Vec3],
    ways: [&Vec<Vec2>; 3],
    m_per_uv: f64,
    dir: &Path,
) -> Result<(), String> {
    const SQUARE_M: f64 = 0.05;
    let source = args.places.source(&garment.data().id);
    let own = Scene::new(garment, source.as_ref());
    let checker = Texture::checker((m_per_uv / SQUARE_M).round() as u32, [[36, 60, 110], [236, 232, 222]]);
    let figures: Vec<Figure> = ways.iter().map(|uv| own.alone(positions_m, uv)).collect();
    let framings = [View::Front, View::Back].map(|view| Framing::of(&figures, view));
    let mut cells = Vec::new();
    for (scene, pattern) in [(&own.with_texture(checker), "checker"), (&own, "pattern")] {
        for (figure, way) in figures.iter().zip(["kept", "blended", "corrected"]) {
            let views = framings.map(|framing| scene.draw(figure, framing, args.height));
            cells.push(Cell { caption: format!("{name}: {pattern}, {way}"), picture: side_by_side(&views) });
        }
    }
    let png = png_bytes(&contact_sheet(&cells, 3)).map_err(|error| error.to_string())?;
    let stem: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    let path = dir.join(format!("{}_texture_{stem}.png", garment.data().id));
    write_whole(&path, |out| out.write_all(&png))?;
    println!("{}", path.display());
    Ok(())
}
