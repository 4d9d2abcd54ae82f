//! The report of a build as one HTML file that needs nothing else: pictures, certificate, errors, regions, targets, scans, warnings. What a CI
//! job keeps. Knows the garment and what was built of it; the same build gives the same bytes.

use super::index::{Entry, Index, TargetEntry};
use super::scan_report;
use crate::build::Built;
use crate::diagnostic::{self, Diagnostic, Format, Severity};
use crate::ir;
use crate::look::frames::{Stage, own_poses};
use crate::look::scene::{Colours, Figure, Framing, Scene, View};
use crate::look::sheet::{Cell, contact_sheet, png_bytes};
use crate::scans::LaidScan;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use kitsuke::arrays::{Certificate, Compression, Loss};
use std::fmt::Write;
use std::path::Path;

/// Height of a picture, pixels.
const HEIGHT_PX: u32 = 420;
/// How many of the targets are shown: those that the others predict worst.
const SHOWN_TARGETS: usize = 7;

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;max-width:72rem;margin:2rem auto;padding:0 1rem;color:#222}\
                     table{border-collapse:collapse;margin:.5rem 0}td,th{padding:.1rem .8rem .1rem 0;text-align:right;font-variant-numeric:tabular-nums}\
                     td:first-child,th:first-child{text-align:left}th{font-weight:600;border-bottom:1px solid #999}img{max-width:100%}\
                     pre{background:#f4f2ee;padding:.8rem;overflow-x:auto}";

/// The report of one garment. `found` is what the artist was told.
#[must_use]
pub fn html(
    source: &ir::Garment,
    built: &Built,
    entry: &Entry,
    scans: &[LaidScan],
    found: &[Diagnostic],
    assets: &Path,
) -> String {
    let mut body = String::new();
    let accessories = &built.accessories;
    let obi = accessories.obi.as_ref();
    let _ = write!(
        body,
        "<h1>{}</h1><p>{}: {} vertices, {} triangles, {} targets, {} drivers; pack of {:.2} MB, made on {}; {}; {}</p>",
        text(&source.name),
        text(&source.id),
        entry.vertices,
        entry.triangles,
        entry.targets.len(),
        entry.drivers,
        entry.bytes as f64 / 1e6,
        text(&accessories.body),
        obi.map_or("no obi".to_owned(), |obi| format!("obi of {} vertices", obi.positions_m.len())),
        accessories.texture.as_ref().map_or("no texture".to_owned(), |texture| {
            let place = if texture.png.is_empty() { "not in the pack" } else { "in the pack" };
            format!("texture {}, {place}", text(&texture.name))
        }),
    );
    body += &warnings(found, assets);
    body += &pictures(source, built);
    body += &certificate(built, entry);
    body += &targets(&entry.targets);
    body += &scan_report::section(scans);
    body += "<h2>Measured paths</h2><table><tr><th>path<th><th>cm</tr>";
    for path in &accessories.paths {
        let length_cm = path.length_m(&built.garment.data().mesh.positions_m) * 100.0;
        let _ = write!(body, "<tr><td>{}<td>{}<td>{length_cm:.1}</tr>", text(&path.name), text(&path.ja));
    }
    body += "</table>";
    let _ = write!(body, "<p>blake3 of the pack: <code>{}</code></p>", entry.blake3);
    page(&source.name, &body)
}

/// The page that links the reports.
#[must_use]
pub fn index(garments: &Index) -> String {
    let mut body = String::from(
        "<h1>Catalog</h1><table><tr><th>kimono<th>targets<th>MB<th>error, mm<th>deepest in the body, mm</tr>",
    );
    for (id, entry) in garments {
        let _ = write!(
            body,
            "<tr><td><a href=\"{0}.html\">{0}</a><td>{1}<td>{2:.2}<td>{3:.3}<td>{4:.0}</tr>",
            text(id),
            entry.targets.len(),
            entry.bytes as f64 / 1e6,
            entry.max_mm,
            entry.inside_max_mm
        );
    }
    page("Catalog", &(body + "</table>"))
}

fn page(title: &str, body: &str) -> String {
    format!(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>{}</title><style>{STYLE}</style><body>{body}</body></html>\n",
        text(title)
    )
}

fn warnings(found: &[Diagnostic], assets: &Path) -> String {
    if found.is_empty() {
        return "<p>No warnings.</p>".to_owned();
    }
    let errors = found.iter().filter(|diagnostic| diagnostic.severity == Severity::Error).count();
    let said = diagnostic::render(found, assets, Format::Human { color: false });
    format!("<h2>{errors} errors, {} warnings</h2><pre>{}</pre>", found.len() - errors, text(&said))
}

/// The base from three sides, the targets that are predicted worst, regions and joints.
fn pictures(source: &ir::Garment, built: &Built) -> String {
    let garment = &built.garment;
    let scene = Scene::new(garment, Some(source));
    let mut stage = Stage::new(garment);
    let shots = own_poses(garment);
    let base = &shots[0];
    let left_out = garment.data().certificate.as_ref().map_or(&[][..], |certificate| &certificate.left_out);
    let mut worst: Vec<usize> = (0..shots.len() - 1).collect();
    worst.sort_by(|&a, &b| {
        let mean = |target: usize| left_out.get(target).map_or(0.0, |error| error.mean_mm);
        mean(b).total_cmp(&mean(a)).then(a.cmp(&b))
    });
    worst.truncate(SHOWN_TARGETS);
    let mut figure = |shot, colours| scene.figure(&mut stage, shot, colours);
    let cloth = figure(base, Colours::Cloth);
    let mut figures: Vec<(String, Figure, View)> =
        [("base", View::Front), ("from her left", View::Side), ("from behind", View::Back)]
            .into_iter()
            .map(|(name, view)| (name.to_owned(), cloth.clone(), view))
            .collect();
    figures.push(("regions".to_owned(), figure(base, Colours::Regions), View::Front));
    figures.push(("joints".to_owned(), figure(base, Colours::Joints), View::Front));
    let losses = garment.data().compression.as_ref().map_or(&[][..], |compression| &compression.targets);
    let most_lost = (0..losses.len()).max_by(|&a, &b| losses[a].max_m.total_cmp(&losses[b].max_m));
    if let Some(shot) = most_lost.map(|target| &shots[target + 1]) {
        let caption = format!("lost in {}, red is the budget", shot.name);
        figures.push((caption, figure(shot, Colours::Error(source.budget_m)), View::Front));
    }
    figures.extend(worst.into_iter().map(|target| {
        let shot = &shots[target + 1];
        (shot.name.clone(), figure(shot, Colours::Cloth), View::Front)
    }));
    let cells: Vec<Cell> = figures
        .into_iter()
        .map(|(caption, figure, view)| {
            let picture = scene.draw(&figure, Framing::of(std::slice::from_ref(&figure), view), HEIGHT_PX);
            Cell { caption, picture }
        })
        .collect();
    let what = "the base from three sides, its regions and joints, what compression lost, and the targets that the others predict worst";
    format!("<h2>Pictures</h2>{}", picture(&contact_sheet(&cells, 4), what))
}

/// A picture inside the page; nothing where it cannot be written.
pub(super) fn picture(picture: &image::RgbImage, what: &str) -> String {
    let Ok(png) = png_bytes(picture) else { return String::new() };
    format!("<img alt=\"{}\" src=\"data:image/png;base64,{}\">", text(what), BASE64_STANDARD.encode(png))
}

fn certificate(built: &Built, entry: &Entry) -> String {
    let Some(Certificate { speed_mm_per_deg, fastest_joint, step_mm, step_change_mm, .. }) =
        &built.garment.data().certificate
    else {
        return String::new();
    };
    let [_, from, to] = &entry.fastest;
    let [near, by] = &entry.nearest;
    let [poses, above_2mm, above_5mm] = entry.inside_poses;
    let lost = built.garment.data().compression.as_ref().map_or_else(String::new, |compression| {
        let Compression { budget_m, poses, surface: Loss { max_m, p99_m, .. }, .. } = compression;
        let [max_mm, p99_mm, budget_mm] = [max_m, p99_m, budget_m].map(|length_m| 1e3 * length_m);
        format!(
            "at most {max_mm:.3} mm over {poses} poses, 99 % within {p99_mm:.3} mm; the budget is {budget_mm:.3} mm"
        )
    });
    let mixed = built.mixed.as_ref().map_or_else(
        || "no sizes".to_owned(),
        |Loss { max_m, p99_m, .. }| {
            format!("at most {:.3} mm over random mixes, 99 % within {:.3} mm", 1e3 * max_m, 1e3 * p99_m)
        },
    );
    let rows = [
        ("error of the pack", format!("at most {:.3} mm, {:.3} mm on average", entry.max_mm, entry.mean_mm)),
        ("lost between the samples", lost),
        ("lost of mixed sizes", mixed),
        ("fastest", format!("{speed_mm_per_deg:.1} mm per degree of {}, near {from} and {to}", fastest_joint.name())),
        ("steps", format!("{step_mm:.4} mm per 0.01 degrees, changing by {step_change_mm:.4} mm at most")),
        ("hardest to tell apart", format!("{near} and {by}, {:.1} degrees", entry.nearest_deg)),
        (
            "in the body",
            format!(
                "of {poses} poses {above_2mm} have cloth deeper than 2 mm, {above_5mm} deeper than 5 mm; the deepest {:.0} mm",
                entry.inside_max_mm
            ),
        ),
    ];
    let mut table = String::from("<h2>Certificate</h2><table>");
    for (what, figure) in rows {
        let _ = write!(table, "<tr><td>{what}<td style=\"text-align:left\">{}</tr>", text(&figure));
    }
    table + "</table>"
}

fn targets(entries: &[TargetEntry]) -> String {
    let mut table = String::from(
        "<h2>Targets</h2><p>Errors in mm: of the pack against the file, and of the others' prediction when the target is left out.</p>\
         <table><tr><th>target<th>pack, largest<th>mean<th>left out, mean<th>99 %<th>largest</tr>",
    );
    for TargetEntry { name, max_mm, mean_mm, left_out_mm: [mean, p99, max], .. } in entries {
        let name = text(name);
        let _ =
            write!(table, "<tr><td>{name}<td>{max_mm:.3}<td>{mean_mm:.3}<td>{mean:.1}<td>{p99:.1}<td>{max:.0}</tr>");
    }
    table + "</table>"
}

/// Text as HTML has it.
pub(super) fn text(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
