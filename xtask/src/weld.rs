//! `cargo xtask weld ID`: what mixing sizes part by part does to the cloth, and what it costs to pose the result.

use crate::places::{Places, printed};
use kitsuke::fit::{FitData, Transfer};
use kitsuke::garment::Garment;
use kitsuke::pack::layout::{self, Tag};
use kitsuke_pipeline::measure::weld_quality::{Quality, UNEVEN, measure, source_shape};
use std::process::ExitCode;
use std::time::Instant;

/// Mix sizes part by part at random and measure triangles turned over and steps at seams
#[derive(clap::Args)]
pub struct Args {
    /// The kimono, or a pack file
    id: String,
    /// How many mixes
    #[arg(long, default_value_t = 300)]
    mixes: usize,
    #[command(flatten)]
    places: Places,
}

/// Prints the figures; 1 when there is no pack, or one without sizes.
pub fn run(args: Args) -> ExitCode {
    printed(figures(&args))
}

fn figures(args: &Args) -> Result<String, String> {
    let pack = args.places.open(&args.id)?;
    let start = Instant::now();
    let fit = pack.fit_data().map_err(|error| error.to_string())?;
    let decoded_ms = start.elapsed().as_secs_f64() * 1e3;
    let fit =
        fit.ok_or_else(|| format!("{} has no sizes; name them in garment.toml: sizes = \"sizes.csv\"", args.id))?;
    let quality = measure(pack.garment(), &fit, args.mixes);
    let bytes = |tag: Tag| pack.sections().iter().filter(|s| s.tag == tag).map(|s| s.stored_length).sum::<usize>();
    let Quality {
        mixes,
        turned,
        turned_from_agreed,
        agreed,
        across,
        inside,
        ratios: [p50, p99, most],
        uneven,
        least_edge,
    } = quality;
    let triangles = pack.garment().triangle_count();
    let mut text = format!(
        "{} parts x {} sizes, {} bytes of fields, {} of texture coordinates, decoded in {decoded_ms:.0} ms\n\
         {mixes} mixes of {triangles} triangles\n\
         turned from base and every size used: {turned}\n\
         turned from one of them where all sources agree ({agreed} triangles): {turned_from_agreed}\n\
         change of the deformation gradient, 99 %: {across:.3} across seams, {inside:.3} inside parts\n\
         their ratio in single mixes: 50 % {p50:.2}, 99 % {p99:.2}, at most {most:.2}; above {UNEVEN} in {uneven}\n\
         shortest edge: {least_edge:.2} of the shortest in any source\n",
        fit.parts.len(),
        fit.size_count(),
        bytes(layout::SFLD),
        bytes(layout::SZUV),
    );
    text += &posing(pack.garment(), &fit)?;
    Ok(text)
}

/// Times the transfer of all targets to every size.
fn posing(garment: &Garment, fit: &FitData) -> Result<String, String> {
    let start = Instant::now();
    let transfer = Transfer::new(garment).map_err(|error| error.to_string())?;
    let prepared_ms = start.elapsed().as_secs_f64() * 1e3;
    let mut fastest_ms = f64::INFINITY;
    for (size, body) in fit.bodies.iter().enumerate() {
        let shape_m = source_shape(garment, fit, size);
        let start = Instant::now();
        transfer.tailored(garment, &shape_m, &body.joints_m).map_err(|error| format!("{}: {error}", body.name))?;
        fastest_ms = fastest_ms.min(start.elapsed().as_secs_f64() * 1e3);
    }
    Ok(format!("targets transferred to a wearer in {fastest_ms:.0} ms, after {prepared_ms:.0} ms once per garment\n"))
}
