//! `cargo xtask masks PAINTED.png --colour "#ff0000=NAME" … --out DIR`: regions painted on one picture, as the masks that a garment reads.

use crate::places::{ended, say, write_whole};
use kitsuke_pipeline::source::picture;
use kitsuke_pipeline::stages::painted::{Painted, Region, regions};
use std::fmt::Write;
use std::io::Cursor;
use std::path::PathBuf;
use std::process::ExitCode;

/// Make region masks of a picture on which each region is painted in a colour of its own
///
/// The picture lies in the kimono's texture space, as its texture does; one painted on a scan gets there by `register --texture`. What is
/// transparent or of the background's colour belongs to no region; soft edges stay soft. Writes NAME.png per region, 8 bits, grey.
#[derive(clap::Args)]
pub struct Args {
    /// The painted picture (PNG or JPEG)
    picture: PathBuf,
    /// A colour and its region's name, such as "#ff0000=rightShoulder"; once per region
    #[arg(long = "colour", value_name = "#RRGGBB=NAME", required = true, value_parser = region)]
    colours: Vec<Region>,
    /// The colour that belongs to no region
    #[arg(long, value_name = "#RRGGBB", default_value = "#000000", value_parser = colour)]
    background: [u8; 3],
    /// The folder of the masks
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Writes masks; 1 when the picture cannot be read or lacks a colour.
pub fn run(args: Args) -> ExitCode {
    ended(masks(&args))
}

fn masks(args: &Args) -> Result<(), String> {
    let all: Vec<[u8; 3]> = std::iter::once(args.background).chain(args.colours.iter().map(|c| c.colour)).collect();
    if let Some((i, _)) = all.iter().enumerate().find(|(i, colour)| all[..*i].contains(colour)) {
        return Err(format!(
            "{} is given twice: each region needs a colour of its own, other than the background's",
            hex(all[i])
        ));
    }
    if let Some((i, _)) = args
        .colours
        .iter()
        .enumerate()
        .find(|(i, r)| args.colours[..*i].iter().any(|o| o.name.eq_ignore_ascii_case(&r.name)))
    {
        return Err(format!("the region {} is given twice", args.colours[i].name));
    }
    let file = args.picture.display();
    let bytes = std::fs::read(&args.picture).map_err(|error| format!("cannot read {file}: {error}"))?;
    let picture = picture::decode(&bytes).map_err(|problem| format!("{file}: {problem}"))?.into_rgba8();
    let painted = regions(&picture, &args.colours, args.background);
    missing(args, &painted)?;
    for (region, mask) in args.colours.iter().zip(&painted.masks) {
        let mut png = Cursor::new(Vec::new());
        mask.write_to(&mut png, image::ImageFormat::Png).map_err(|error| error.to_string())?;
        let path = args.out.join(format!("{}.png", region.name));
        write_whole(&path, |out| out.write_all(png.get_ref()))?;
    }
    let total = picture.width() as usize * picture.height() as usize;
    for (region, &pixels) in args.colours.iter().zip(&painted.pixels) {
        say!(
            "{} {:<24}{pixels:>10} pixels, {:.1} %",
            hex(region.colour),
            region.name,
            100.0 * pixels as f64 / total as f64
        );
    }
    if let Some(([x, y], colour)) = painted.first_stray {
        eprintln!(
            "warning: {} pixels ({:.2} %) are neither of a named colour nor a mix of two, the first at column {x}, row {y} ({}): they go to the \
             nearest. Name their colour too, or paint without shading and save as PNG",
            painted.strays,
            100.0 * painted.strays as f64 / total as f64,
            hex(colour)
        );
    }
    Ok(())
}

/// Says which colours occur nowhere.
fn missing(args: &Args, painted: &Painted) -> Result<(), String> {
    let mut text = String::new();
    for ((region, &pixels), nearest) in args.colours.iter().zip(&painted.pixels).zip(&painted.nearest) {
        if pixels == 0 {
            let nearest = nearest.map_or(String::new(), |colour| format!("; the nearest colour is {}", hex(colour)));
            _ = write!(text, "\n  {} ({}){nearest}", hex(region.colour), region.name);
        }
    }
    match text.is_empty() {
        true => Ok(()),
        false => Err(format!("{} has no pixel of these colours, so nothing is written:{text}", args.picture.display())),
    }
}

fn hex([r, g, b]: [u8; 3]) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn colour(text: &str) -> Result<[u8; 3], String> {
    let digits = text.strip_prefix('#').unwrap_or(text);
    let number = u32::from_str_radix(digits, 16).ok().filter(|_| digits.len() == 6 && digits.is_ascii());
    let number = number.ok_or("a colour is written #rrggbb, such as #ff0000")?;
    Ok([(number >> 16) as u8, (number >> 8) as u8, number as u8])
}

fn region(text: &str) -> Result<Region, String> {
    let (of, name) = text.split_once('=').ok_or("a region is written COLOUR=NAME, such as #ff0000=rightShoulder")?;
    let is_file_name = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if name.is_empty() || !name.chars().all(is_file_name) {
        return Err("a region's name is of letters, digits, _ and -, because its file is called so".to_owned());
    }
    Ok(Region { name: name.to_owned(), colour: colour(of)? })
}
