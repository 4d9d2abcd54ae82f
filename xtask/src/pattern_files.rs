//! A paper pattern as files: SVG at full size to print, DXF for cutters' programs, on the layers of ASTM D6673 (1 cut line, 4 notches, 7 grain, 14 sewing
//! line). Millimetres. Knows nothing of how a pattern came to be.

use dxf::Drawing;
use dxf::entities::{Entity, EntityType, Line, ModelPoint, Polyline, Text, Vertex};
use dxf::enums::{AcadVersion, Units};
use glam::DVec2;
use i_overlay::mesh::float::outline::offset::OutlineOffset;
use i_overlay::mesh::float::style::{LineJoin, OutlineStyle};
use kitsuke_drape::pattern::{Pattern, Piece};
use std::fmt::Write;

/// Between pieces, and about all, millimetres.
const GAP_MM: f64 = 40.0;
/// A line of this length shows whether a print has its size.
const SCALE_MM: f64 = 100.0;
/// Corners of cut lines that are sharper are cut off, radians.
const SHARPEST_RAD: f64 = 0.5;

/// A piece where it lies on the sheet, millimetres, Y up.
struct Placed<'a> {
    piece: &'a Piece,
    by_mm: DVec2,
    cut_mm: Vec<DVec2>,
}

impl Placed<'_> {
    fn at_mm(&self, place_m: DVec2) -> DVec2 {
        1e3 * place_m + self.by_mm
    }
}

/// All pieces side by side, their cut lines outside of the sewing lines by the allowance; darts, which are folded and not cut, are open in them.
fn placed(pattern: &Pattern, allowance_mm: f64) -> (Vec<Placed<'_>>, DVec2) {
    let (mut all, mut x_mm, mut high_mm) = (Vec::new(), GAP_MM, 0.0_f64);
    for piece in &pattern.pieces {
        let cut_mm = cut_line_mm(piece, allowance_mm);
        let low = cut_mm.iter().copied().reduce(DVec2::min).unwrap_or_default();
        let high = cut_mm.iter().copied().reduce(DVec2::max).unwrap_or_default();
        let by_mm = DVec2::new(x_mm, GAP_MM) - low;
        all.push(Placed { piece, by_mm, cut_mm: cut_mm.into_iter().map(|p| p + by_mm).collect() });
        x_mm += high.x - low.x + GAP_MM;
        high_mm = high_mm.max(high.y - low.y);
    }
    (all, DVec2::new(x_mm.max(SCALE_MM + 2.0 * GAP_MM), high_mm + 2.0 * GAP_MM))
}

fn cut_line_mm(piece: &Piece, allowance_mm: f64) -> Vec<DVec2> {
    let is_dart = |name: &str| name.starts_with("dart");
    let sewn: Vec<[f64; 2]> = piece
        .runs
        .iter()
        .filter(|run| !is_dart(&run.name))
        .flat_map(|run| run.places_m.iter().map(|p| [1e3 * p.x, 1e3 * p.y]))
        .collect();
    if allowance_mm <= 0.0 {
        return sewn.into_iter().map(DVec2::from).collect();
    }
    let style = OutlineStyle::new(allowance_mm).line_join(LineJoin::Miter(SHARPEST_RAD));
    let grown = vec![sewn].outline(&style);
    grown.into_iter().flatten().next().unwrap_or_default().into_iter().map(DVec2::from).collect()
}

/// The pattern as SVG, a unit of the drawing a millimetre.
pub fn svg(pattern: &Pattern, allowance_mm: f64) -> String {
    let (pieces, size) = placed(pattern, allowance_mm);
    let at = |p: DVec2| format!("{:.3} {:.3}", p.x, size.y - p.y);
    let path = |places: &[DVec2]| places.iter().map(|p| at(*p)).collect::<Vec<_>>().join(" L ");
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.3}mm\" height=\"{1:.3}mm\" viewBox=\"0 0 {0:.3} {1:.3}\" fill=\"none\" stroke=\"black\" stroke-width=\"0.3\" font-family=\"sans-serif\" font-size=\"6\">\n",
        size.x, size.y
    );
    let ends = [DVec2::new(GAP_MM, 0.4 * GAP_MM), DVec2::new(GAP_MM + SCALE_MM, 0.4 * GAP_MM)];
    let _ = writeln!(svg, "<path id=\"scale\" d=\"M {}\"/>", path(&ends));
    let label = |svg: &mut String, p: DVec2, text: &str| {
        let _ = writeln!(
            svg,
            "<text x=\"{:.3}\" y=\"{:.3}\" fill=\"black\" stroke=\"none\">{text}</text>",
            p.x,
            size.y - p.y
        );
    };
    label(&mut svg, ends[0] - DVec2::Y * 8.0, "this line is 100 mm long; dashed: sewing lines, whole: cut lines");
    for placed in &pieces {
        let piece = placed.piece;
        let id = piece.name.replace(' ', "-");
        let _ = writeln!(svg, "<g id=\"{id}\">\n<path class=\"cut\" d=\"M {} Z\"/>", path(&placed.cut_mm));
        for run in &piece.runs {
            let places: Vec<DVec2> = run.places_m.iter().map(|p| placed.at_mm(*p)).collect();
            let _ = writeln!(
                svg,
                "<path class=\"sew\" id=\"{id}.{}\" stroke-dasharray=\"3 2\" d=\"M {}\"/>",
                run.name.replace(' ', "-"),
                path(&places)
            );
        }
        let grain = piece.grain_m.map(|p| placed.at_mm(p));
        let _ = writeln!(svg, "<path class=\"grain\" d=\"M {}\"/>", path(&grain));
        for notch in &piece.notches_m {
            let at_mm = placed.at_mm(*notch);
            let _ =
                writeln!(svg, "<circle class=\"notch\" cx=\"{:.3}\" cy=\"{:.3}\" r=\"2\"/>", at_mm.x, size.y - at_mm.y);
        }
        label(&mut svg, grain[1] + DVec2::Y * 4.0, &piece.name);
        svg.push_str("</g>\n");
    }
    svg.push_str("</svg>\n");
    svg
}

/// The pattern as DXF of release 12, which all read.
///
/// # Errors
/// When the crate cannot write it.
pub fn dxf(pattern: &Pattern, allowance_mm: f64) -> Result<Vec<u8>, String> {
    let (pieces, _) = placed(pattern, allowance_mm);
    let mut drawing = Drawing::new();
    drawing.header.version = AcadVersion::R12;
    drawing.header.default_drawing_units = Units::Millimeters;
    // Same input, same bytes: not when it was written.
    let then = chrono::DateTime::UNIX_EPOCH;
    (drawing.header.creation_date, drawing.header.update_date) = (then.into(), then.into());
    (drawing.header.creation_date_universal, drawing.header.update_date_universal) = (then, then);
    for placed in &pieces {
        add_line(&mut drawing, "1", &placed.cut_mm, true);
        for run in &placed.piece.runs {
            let places: Vec<DVec2> = run.places_m.iter().map(|p| placed.at_mm(*p)).collect();
            add_line(&mut drawing, "14", &places, false);
        }
        let [from, to] = placed.piece.grain_m.map(|p| point(placed.at_mm(p)));
        add(&mut drawing, "7", EntityType::Line(Line::new(from, to)));
        for notch in &placed.piece.notches_m {
            add(&mut drawing, "4", EntityType::ModelPoint(ModelPoint::new(point(placed.at_mm(*notch)))));
        }
        let text = Text {
            location: point(placed.at_mm(placed.piece.grain_m[1])),
            text_height: 6.0,
            value: placed.piece.name.clone(),
            ..Text::default()
        };
        add(&mut drawing, "1", EntityType::Text(text));
    }
    let mut bytes = Vec::new();
    drawing.save(&mut bytes).map_err(|error| format!("the pattern cannot be written as DXF: {error}"))?;
    Ok(bytes)
}

fn point(p: DVec2) -> dxf::Point {
    dxf::Point::new(p.x, p.y, 0.0)
}

fn add(drawing: &mut Drawing, layer: &str, specific: EntityType) {
    let mut entity = Entity::new(specific);
    entity.common.layer = layer.to_owned();
    drawing.add_entity(entity);
}

fn add_line(drawing: &mut Drawing, layer: &str, places_mm: &[DVec2], is_closed: bool) {
    let mut line = Polyline::default();
    line.set_is_closed(is_closed);
    for place in places_mm {
        line.add_vertex(drawing, Vertex::new(point(*place)));
    }
    add(drawing, layer, EntityType::Polyline(line));
}

#[cfg(test)]
mod tests {
    use super::*;
    use kitsuke_drape::pattern::Run;

    /// A piece of 30 by 60 cm with a dart and a bent side.
    fn pattern() -> Pattern {
        let run = |name: &str, places: &[(f64, f64)]| Run {
            name: name.to_owned(),
            places_m: places.iter().map(|p| DVec2::from(*p)).collect(),
        };
        let piece = Piece {
            name: "right front".to_owned(),
            runs: vec![
                run("hem", &[(0.0, 0.0), (0.3, 0.0)]),
                run("side", &[(0.3, 0.0), (0.31, 0.3), (0.28, 0.6)]),
                run("waist to the side", &[(0.28, 0.6), (0.17, 0.6)]),
                run("dart leg at the side", &[(0.17, 0.6), (0.15, 0.45)]),
                run("dart leg at the centre", &[(0.15, 0.45), (0.13, 0.6)]),
                run("waist to the centre", &[(0.13, 0.6), (0.0, 0.6)]),
                run("centre", &[(0.0, 0.6), (0.0, 0.0)]),
            ],
            grain_m: [DVec2::new(0.05, 0.1), DVec2::new(0.05, 0.4)],
            notches_m: vec![DVec2::new(0.31, 0.3)],
        };
        piece.check().unwrap();
        Pattern { pieces: vec![piece.mirrored("left front"), piece], seams: Vec::new() }
    }

    fn length(places: &[DVec2]) -> f64 {
        places.windows(2).map(|pair| pair[0].distance(pair[1])).sum()
    }

    #[test]
    fn what_is_written_as_svg_is_read_back_as_long_at_full_size() {
        let pattern = pattern();
        let text = svg(&pattern, 10.0);
        let document = roxmltree::Document::parse(&text).unwrap();
        let root = document.root_element();
        let size = |key: &str| root.attribute(key).unwrap().trim_end_matches("mm").parse::<f64>().unwrap();
        assert_eq!(root.attribute("viewBox").unwrap(), format!("0 0 {:.3} {:.3}", size("width"), size("height")));
        let places = |id: &str| -> Vec<DVec2> {
            let node = document.descendants().find(|node| node.attribute("id") == Some(id)).unwrap();
            let numbers: Vec<f64> =
                node.attribute("d").unwrap().split([' ', 'M', 'L', 'Z']).filter_map(|n| n.parse().ok()).collect();
            numbers.chunks(2).map(|p| DVec2::new(p[0], p[1])).collect()
        };
        assert_eq!(length(&places("scale")), 100.0);
        for piece in &pattern.pieces {
            for run in &piece.runs {
                let id = format!("{}.{}", piece.name, run.name).replace(' ', "-");
                assert!((length(&places(&id)) - 1e3 * run.length_m()).abs() < 0.01, "{id}");
            }
        }
        assert_eq!(text.matches("class=\"cut\"").count(), 2);
    }

    #[test]
    fn what_is_written_as_dxf_is_read_back_as_long() {
        let pattern = pattern();
        let bytes = dxf(&pattern, 10.0).unwrap();
        assert_eq!(bytes, dxf(&pattern, 10.0).unwrap(), "the same bytes");
        let drawing = Drawing::load(&mut std::io::Cursor::new(bytes)).unwrap();
        let lines = |layer: &str| -> Vec<Vec<DVec2>> {
            let of_layer = drawing.entities().filter(|entity| entity.common.layer == layer);
            let places = of_layer.filter_map(|entity| match &entity.specific {
                EntityType::Polyline(line) => {
                    Some(line.vertices().map(|v| DVec2::new(v.location.x, v.location.y)).collect())
                }
                _ => None,
            });
            places.collect()
        };
        let runs = pattern.pieces.iter().flat_map(|piece| &piece.runs);
        let sewn = lines("14");
        assert_eq!(sewn.len(), 14);
        for (line, run) in sewn.iter().zip(runs) {
            assert!((length(line) - 1e3 * run.length_m()).abs() < 1e-6, "{}", run.name);
        }
        // Cut 10 mm outside, with its corners; over the dart straight on.
        for cut in lines("1") {
            let (low, high) = cut.iter().fold((cut[0], cut[0]), |(low, high), p| (low.min(*p), high.max(*p)));
            assert!((high.y - low.y - 620.0).abs() < 0.01 && (high.x - low.x - 330.0).abs() < 0.2, "{low} {high}");
            assert!(cut.len() < 12, "{cut:?}");
        }
    }
}
