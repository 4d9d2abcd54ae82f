//! The tight skirt of the paper (Shoda 2018, 2.3): cloth laid on a form from waist to hem, half front and half back of the wearer's right side, each with
//! slits that become darts; what the form's lines cut out of it when it has come to rest is the pattern. Knows no files.

use crate::body::Body;
use crate::certificate::Certificate;
use crate::drape::{Drape, Settings, State, strain};
use crate::fabric::FabricError;
use crate::form::Form;
use crate::mapping::{Centre, Dart, DartKind, Mapping, turned};
use crate::outline::{OnCloth, in_flat, met};
use crate::pattern::{Pattern, Piece, Run};
use crate::relax::RelaxError;
use crate::rest::{Course, to_rest};
use crate::sew::{SewError, sew};
use crate::sheet::{PatternMesh, Sheet, SheetError};
use crate::slit::{Flat, SlitError};
use crate::woven::Woven;
use glam::{DVec2, DVec3};
use std::collections::BTreeMap;

/// Cloth beyond the centre line and beyond the side line, metres.
const BEYOND_CENTRE_M: f64 = 0.024;
const BEYOND_SIDE_M: f64 = 0.03;
/// And below the hem.
const BELOW_HEM_M: f64 = 0.024;
/// Where a dart's cloth is removed, cells beside it are narrower over so much of the weft, but not beyond the next dart, metres.
const NARROWED_M: f64 = 0.08;
/// Darts are at least so many cells apart.
const APART: f64 = 2.0;

/// A dart as it is planned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DartPlan {
    /// What it takes of what the waist is less than the hip, 0 to 1; the side seam takes what all darts leave.
    pub share: f64,
    /// Where its slit is, share of the waist's quarter from the centre.
    pub at: f64,
    /// Where it ends, share of the way from the hip line up to the waist line.
    pub tip: f64,
    /// Whether it overlaps.
    pub kind: DartKind,
}

/// What is made.
#[derive(Clone, Debug, PartialEq)]
pub struct Design {
    /// From the waist line down to the hem, metres.
    pub length_m: f64,
    /// Cloth above the waist line, metres.
    pub above_m: f64,
    /// Size of the cloth's cells, about, metres.
    pub cell_m: f64,
    /// Of the half front and of the half back, from the centre on.
    pub darts: [Vec<DartPlan>; 2],
}

impl Default for Design {
    fn default() -> Design {
        Design {
            length_m: 0.55,
            above_m: 0.04,
            cell_m: 0.012,
            darts: [
                vec![DartPlan { share: 0.45, at: 0.5, tip: 0.5, kind: DartKind::Overlapping }],
                vec![DartPlan { share: 0.55, at: 0.5, tip: 0.3, kind: DartKind::Overlapping }],
            ],
        }
    }
}

impl Design {
    /// The same with darts of a kind.
    #[must_use]
    pub fn with(mut self, kind: DartKind) -> Design {
        self.darts.iter_mut().flatten().for_each(|dart| dart.kind = kind);
        self
    }

    /// The same with each dart as two of half of what it takes, a sixth of the waist's quarter to both sides.
    #[must_use]
    pub fn with_pairs(mut self) -> Design {
        for darts in &mut self.darts {
            let pair = |dart: &DartPlan| {
                [-1.0, 1.0].map(|side| DartPlan { at: dart.at + side / 6.0, share: 0.5 * dart.share, ..*dart })
            };
            *darts = darts.iter().flat_map(pair).collect();
        }
        self
    }
}

/// On what cloth is draped, and how.
#[derive(Clone, Copy, Debug)]
pub struct Draping<'a> {
    /// The form as a body.
    pub body: &'a Body,
    /// The cloth.
    pub woven: &'a Woven,
    /// How steps are taken.
    pub settings: Settings,
    /// Most seconds that cloth has to come to rest.
    pub most_s: f64,
}

/// Why there is no skirt.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SkirtError {
    /// The form is too short.
    #[error("the skirt goes from {from_m:.3} to {to_m:.3} m, the form from {low_m:.3} to {high_m:.3} m")]
    Form {
        /// Metres.
        from_m: f64,
        /// Metres.
        to_m: f64,
        /// Metres.
        low_m: f64,
        /// Metres.
        high_m: f64,
    },
    /// A dart that does not fit between its neighbours.
    #[error(
        "dart {dart} of the {piece} at {at:.2} of the waist: darts go from centre to side, at least 2 cells of cloth apart and from either"
    )]
    Dart {
        /// The half.
        piece: &'static str,
        /// Which, from 1.
        dart: usize,
        /// Share of the waist's quarter.
        at: f64,
    },
    /// A line of the form meets no cloth.
    #[error("the {piece}'s {line} meets no cloth at {height_m:.3} m")]
    Missed {
        /// The half.
        piece: &'static str,
        /// The line.
        line: &'static str,
        /// Where.
        height_m: f64,
    },
    /// Cloth that is none.
    #[error(transparent)]
    Sheet(#[from] SheetError),
    /// A slit that is none.
    #[error(transparent)]
    Slit(#[from] SlitError),
    /// Constants out of range.
    #[error(transparent)]
    Fabric(#[from] FabricError),
    /// Cloth that P2's model does not relax.
    #[error(transparent)]
    Relax(#[from] RelaxError),
    /// A pattern that cannot be sewn.
    #[error(transparent)]
    Sew(#[from] SewError),
}

/// Half of the front or of the back, laid on.
#[derive(Clone, Debug)]
pub struct Half<'a> {
    /// `right front` or `right back`.
    pub name: &'static str,
    /// The flat cloth with its slit.
    pub flat: Flat,
    /// How it is laid on.
    pub mapping: Mapping<'a>,
    /// Where it is laid on, metres.
    pub laid_m: Vec<DVec3>,
    /// Greatest error of a row's length along the weft, as laid on, of its length.
    pub arc_error_max: f64,
    /// Where it has come to rest, metres; before, where it is laid on.
    pub rests_m: Vec<DVec3>,
    /// Mean strain there.
    pub strain_mean: f64,
    /// Height of the hem, metres.
    pub hem_m: f64,
    /// Of each dart its slit's borders in the zone before and the zone after, from the cloth's upper edge to the dart's tip.
    slits: Vec<[Vec<u32>; 2]>,
}

/// A dart's line at a height: in the zone before and in the zone after.
struct DartAt {
    angles_rad: [f64; 2],
    flat_m: [DVec2; 2],
}

/// The half front and the half back of the wearer's right side on a form that is taut ([`Form::skirt`]).
///
/// # Errors
/// When the form is too short or a slit would lie outside of the cloth.
pub fn laid_on<'a>(form: &'a Form, design: &Design, out_m: f64, layer_m: f64) -> Result<[Half<'a>; 2], SkirtError> {
    let [low_m, high_m] = form.span_m();
    let (from_m, to_m) = (form.lines.waist_m - design.length_m - BELOW_HEM_M, form.lines.waist_m + design.above_m);
    if from_m < low_m || to_m > high_m {
        return Err(SkirtError::Form { from_m, to_m, low_m, high_m });
    }
    Ok([
        half(form, design, "right front", Centre::Front, [out_m, layer_m])?,
        half(form, design, "right back", Centre::Back, [out_m, layer_m])?,
    ])
}

fn half<'a>(
    form: &'a Form,
    design: &Design,
    name: &'static str,
    centre: Centre,
    [out_m, layer_m]: [f64; 2],
) -> Result<Half<'a>, SkirtError> {
    let of = usize::from(centre == Centre::Back);
    let (waist_m, hip_m) = (form.lines.waist_m, form.lines.hip_m);
    let hem_m = waist_m - design.length_m;
    let from_m = hem_m - BELOW_HEM_M;
    let mut mapping = Mapping { form, out_m, layer_m, centre, is_left: false, from_m, darts: Vec::new() };
    let (hip_quarter_m, waist_quarter_m) = (mapping.quarter_m(hip_m), mapping.quarter_m(waist_m));
    // A row lies on the hip line, and a column on the centre line.
    let rows_below = ((hip_m - from_m) / design.cell_m).round().max(1.0);
    let warp_m = (hip_m - from_m) / rows_below;
    let rows = ((waist_m + design.above_m - from_m) / warp_m).round() as usize;
    let columns_before = (BEYOND_CENTRE_M / design.cell_m).round().max(1.0);
    let weft_m = BEYOND_CENTRE_M / columns_before;
    let columns = ((BEYOND_CENTRE_M + hip_quarter_m + BEYOND_SIDE_M) / weft_m).ceil() as usize;
    let mut flat = Flat::rectangle(DVec2::new(-BEYOND_CENTRE_M, 0.0), columns, rows, DVec2::new(weft_m, warp_m));
    let mut slits = Vec::new();
    for (i, plan) in design.darts[of].iter().enumerate() {
        let tip_m = hip_m + plan.tip * (waist_m - hip_m);
        let path = flat.along_warp(plan.at * waist_quarter_m, tip_m - from_m);
        let tip = *path.last().ok_or(SlitError::Short(0))?;
        let at_m = flat.places_m[tip as usize];
        let before_m = mapping.darts.last().map_or(0.0, |dart| dart.weft_m);
        let apart_m = (at_m.x - before_m).min(waist_quarter_m - at_m.x);
        if apart_m < APART * weft_m - 1e-9 {
            return Err(SkirtError::Dart { piece: name, dart: i + 1, at: plan.at });
        }
        // Downwards, cloth towards the centre is to the right.
        let mut other = flat.slit(&path)?;
        other.push(tip);
        flat.divide(at_m.x);
        let amount_m = plan.share * (hip_quarter_m - waist_quarter_m).max(0.0);
        mapping.add_dart(plan.kind, at_m.x, from_m + at_m.y, amount_m);
        slits.push([other, path]);
    }
    remove(&mut flat, &mapping);
    let zones = flat.vertex_zones();
    let laid_m: Vec<DVec3> =
        flat.places_m.iter().zip(&zones).map(|(place_m, zone)| mapping.place_m(*place_m, *zone)).collect();
    let arc_error_max = arc_error_max(&flat, &mapping);
    Ok(Half {
        name,
        flat,
        mapping,
        hem_m,
        slits,
        rests_m: laid_m.clone(),
        laid_m,
        arc_error_max,
        strain_mean: f64::NAN,
    })
}

/// Cuts away what removed darts take: draws the borders of their slits apart to the legs, and cells beside them the less the farther they are.
fn remove(flat: &mut Flat, mapping: &Mapping) {
    let zones = flat.vertex_zones();
    let mut away_m = vec![0.0; flat.places_m.len()];
    for (number, dart) in mapping.darts.iter().enumerate().filter(|(_, dart)| dart.kind == DartKind::Removed) {
        let before_m = number.checked_sub(1).map_or(0.0, |before| mapping.darts[before].weft_m);
        let after_m = mapping.darts.get(number + 1).map_or(f64::INFINITY, |after| after.weft_m);
        let mut halves_m: BTreeMap<u64, f64> = BTreeMap::new();
        for ((place_m, zone), away_m) in flat.places_m.iter().zip(&zones).zip(&mut away_m) {
            let (side, room_m) = match (*zone as usize).checked_sub(number) {
                Some(0) => (-1.0, dart.weft_m - before_m),
                Some(1) => (1.0, after_m - dart.weft_m),
                _ => continue,
            };
            let near = 1.0 - (place_m.x - dart.weft_m).abs() / room_m.min(NARROWED_M);
            let height_m = mapping.from_m + place_m.y;
            if height_m > dart.tip_m && near > 0.0 {
                let half_m = halves_m.entry(place_m.y.to_bits());
                *away_m += side * near * *half_m.or_insert_with(|| 0.5 * mapping.taken_m(number, height_m));
            }
        }
    }
    flat.places_m.iter_mut().zip(away_m).for_each(|(place_m, away_m)| place_m.x += away_m);
}

/// Of each row of each zone: how much longer or shorter it is on the form than in the cloth, along a line of short steps.
fn arc_error_max(flat: &Flat, mapping: &Mapping) -> f64 {
    const STEP_M: f64 = 0.002;
    let mut rows: BTreeMap<(u32, u64), [f64; 2]> = BTreeMap::new();
    for (corners, zone) in flat.triangles.iter().zip(&flat.zones) {
        for place_m in corners.map(|v| flat.places_m[v as usize]) {
            let ends = rows.entry((*zone, place_m.y.max(0.0).to_bits())).or_insert([f64::INFINITY, f64::NEG_INFINITY]);
            *ends = [ends[0].min(place_m.x), ends[1].max(place_m.x)];
        }
    }
    let rows: Vec<((u32, u64), [f64; 2])> = rows.into_iter().filter(|(_, [from_m, to_m])| to_m > from_m).collect();
    let errors = crate::parallel::collect_each(rows.len(), |row, errors: &mut Vec<f64>| {
        let ((zone, warp), [from_m, to_m]) = rows[row];
        let count = ((to_m - from_m) / STEP_M).ceil() as usize;
        let at = |i: usize| DVec2::new(from_m + (to_m - from_m) * i as f64 / count as f64, f64::from_bits(warp));
        let places_m: Vec<DVec3> = (0..=count).map(|i| mapping.place_m(at(i), zone)).collect();
        let length_m: f64 = places_m.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
        errors.push((length_m / (to_m - from_m) - 1.0).abs());
    });
    errors.into_iter().fold(0.0, f64::max)
}

impl Half<'_> {
    /// Comes to rest on the form: hip, centre and side line are held, and darts at their upper end; hands smooth the cloth. Edges of what was cut away
    /// are sewn.
    ///
    /// # Errors
    /// When the cloth's constants are not in their ranges.
    pub fn relax(&mut self, draping: &Draping) -> Result<Certificate, SkirtError> {
        let (sheet, start_m) = self.held()?;
        let mut drape = Drape::new(&sheet, draping.woven, &draping.settings)?;
        let mut state: State = drape.state(&sheet);
        state.positions_m = start_m;
        let course = Course { free_s: 0.3, drag_per_s: [5.0, 15.0, 100.0], ..Course::default() };
        let body = &mut Some(draping.body);
        let certificate = to_rest(&mut drape, body, &course, draping.most_s, &mut state, &mut |_, _| ());
        self.strain_mean = strain(&sheet, &state.positions_m).0;
        self.rests_m = sheet.particle_of_vertex().iter().map(|p| state.positions_m[*p as usize]).collect();
        Ok(certificate)
    }

    /// The cloth with its lines held, and where its particles begin, metres.
    pub(crate) fn held(&self) -> Result<(Sheet, Vec<DVec3>), SkirtError> {
        let corners_uv: Vec<[DVec2; 3]> =
            self.flat.triangles.iter().map(|corners| corners.map(|v| self.flat.places_m[v as usize])).collect();
        let mut welds = Vec::new();
        for ([before, after], dart) in self.slits.iter().zip(&self.mapping.darts) {
            if dart.kind == DartKind::Removed {
                welds.extend(before.iter().zip(after).map(|(a, b)| [*a, *b]).filter(|[a, b]| a != b));
            }
        }
        let spaced_m = self.spaced_m();
        let mut sheet = Sheet::from_pattern(&PatternMesh {
            positions_m: &spaced_m,
            triangles: &self.flat.triangles,
            corners_uv: &corners_uv,
            metres_per_uv: 1.0,
            welds: &welds,
        })?;
        let start_m = sheet.positions_m().to_vec();
        let hip_warp_m = self.mapping.form.lines.hip_m - self.mapping.from_m;
        let mut held: Vec<usize> = self.side_line();
        for (v, place_m) in self.flat.places_m.iter().enumerate() {
            if (place_m.y - hip_warp_m).abs() < 1e-6 || place_m.x.abs() < 1e-6 {
                held.push(v);
            }
        }
        // A dressmaker pins a dart above the waist.
        held.extend(self.slits.iter().flatten().map(|border| border[0] as usize));
        for v in held {
            let particle = sheet.particle_of_vertex()[v];
            sheet.pin(particle, start_m[particle as usize])?;
        }
        Ok((sheet, start_m))
    }

    /// The vertex of each row that is laid on nearest to the side line.
    fn side_line(&self) -> Vec<usize> {
        let (zones, last) = (self.flat.vertex_zones(), self.mapping.darts.len() as u32);
        let mut nearest: BTreeMap<i64, (f64, usize)> = BTreeMap::new();
        for (v, place_m) in self.flat.places_m.iter().enumerate().filter(|(v, _)| zones[*v] == last) {
            let laid_m = self.laid_m[v];
            let section = self.mapping.form.section(laid_m.y).grown(self.mapping.out_m);
            let turn = crate::form::angle_rad(DVec2::new(laid_m.x, laid_m.z) - section.middle_m);
            let away_m = section.arc_m(self.mapping.side_rad(&section), turn).abs();
            let best = nearest.entry((place_m.y * 1e7).round() as i64).or_insert((away_m, v));
            if away_m < best.0 {
                *best = (away_m, v);
            }
        }
        nearest.into_values().map(|(_, v)| v).collect()
    }

    /// As laid on, but above the hip line each warp line as long on the form as in the cloth: level rows stretch it where the form slants.
    fn spaced_m(&self) -> Vec<DVec3> {
        const STEP_M: f64 = 1e-3;
        let hip_warp_m = self.mapping.form.lines.hip_m - self.mapping.from_m;
        let zones = self.flat.vertex_zones();
        let mut warp_lines: BTreeMap<(u32, i64), Vec<usize>> = BTreeMap::new();
        for (v, place_m) in self.flat.places_m.iter().enumerate() {
            if place_m.y > hip_warp_m + 1e-9 {
                warp_lines.entry((zones[v], (place_m.x * 1e7).round() as i64)).or_default().push(v);
            }
        }
        let mut spaced_m = self.laid_m.clone();
        for ((zone, _), mut line) in warp_lines {
            line.sort_by(|a, b| self.flat.places_m[*a].y.total_cmp(&self.flat.places_m[*b].y));
            let weft_m = self.flat.places_m[line[0]].x;
            let at_m = |warp_m: f64| self.mapping.place_m(DVec2::new(weft_m, warp_m), zone);
            let (mut warp_m, mut along_m) = (hip_warp_m, hip_warp_m);
            let mut place_m = at_m(warp_m);
            for v in line {
                let wanted_m = self.flat.places_m[v].y;
                let mut next_m = at_m(warp_m + STEP_M);
                while along_m + next_m.distance(place_m) < wanted_m {
                    along_m += next_m.distance(place_m);
                    warp_m += STEP_M;
                    place_m = next_m;
                    next_m = at_m(warp_m + STEP_M);
                }
                spaced_m[v] = place_m.lerp(next_m, (wanted_m - along_m) / next_m.distance(place_m));
            }
        }
        spaced_m
    }

    /// What the form's lines cut out of the cloth at rest: from the hem up the centre line, along the waist and round each dart, down the side,
    /// and back. Counter-clockwise, as the cloth's inner side is seen.
    ///
    /// # Errors
    /// When a line meets no cloth.
    pub fn piece(&self, places_apart_m: f64) -> Result<Piece, SkirtError> {
        let mapping = &self.mapping;
        let (hem_m, waist_m) = (self.hem_m, mapping.form.lines.waist_m);
        let upright = |line: &'static str, zone: u32, [from_m, to_m]: [f64; 2], turn: &dyn Fn(f64) -> f64| {
            let count = ((to_m - from_m).abs() / places_apart_m).ceil().max(1.0) as usize;
            let heights = (0..=count).map(|i| from_m + (to_m - from_m) * i as f64 / count as f64);
            heights.map(|height_m| self.flat_at(line, zone, height_m, turn(height_m))).collect::<Result<Vec<_>, _>>()
        };
        let section = |height_m: f64| mapping.form.section(height_m).grown(mapping.out_m);
        let centre = |height_m: f64| mapping.centre_rad(&section(height_m));
        let side = |height_m: f64| mapping.side_rad(&section(height_m));
        let level = |line: &'static str, zone: u32, height_m: f64, [from_rad, to_rad]: [f64; 2]| {
            let section = section(height_m);
            let arc_m = section.arc_m(from_rad, to_rad);
            let count = (arc_m.abs() / places_apart_m).ceil().max(1.0) as usize;
            (0..=count)
                .map(|i| section.angle_after(from_rad, arc_m * i as f64 / count as f64))
                .map(|turn| self.flat_at(line, zone, height_m, turn))
                .collect::<Result<Vec<_>, _>>()
        };
        let last = mapping.darts.len() as u32;
        let run = |name: &str, places_m: Vec<DVec2>| Run { name: name.to_owned(), places_m };
        let mut runs = vec![run("centre", upright("centre line", 0, [hem_m, waist_m], &centre)?)];
        // Where the part of the waist line before a dart begins, and where one of the hem ends.
        let (mut from_rad, mut from_flat_m) = (centre(waist_m), None);
        let mut hem_rad = vec![centre(hem_m)];
        for (i, dart) in mapping.darts.iter().enumerate() {
            let number = i + 1;
            let [leg_down, leg_up] = self.legs(i, places_apart_m)?;
            let [to_rad, beyond_rad] = self.dart_at(i, waist_m)?.angles_rad;
            let mut waist = level("waist line", i as u32, waist_m, [from_rad, to_rad])?;
            ends(&mut waist, from_flat_m, Some(leg_down[0]));
            runs.push(run(&format!("waist {number}"), waist));
            (from_rad, from_flat_m) = (beyond_rad, leg_up.last().copied());
            runs.push(run(&format!("dart {number} at the centre"), leg_down));
            runs.push(run(&format!("dart {number} at the side"), leg_up));
            hem_rad.push(section(hem_m).angle_after(centre(hem_m), mapping.sense() * dart.weft_m));
        }
        let mut waist = level("waist line", last, waist_m, [from_rad, side(waist_m)])?;
        ends(&mut waist, from_flat_m, None);
        runs.push(run(&format!("waist {}", last + 1), waist));
        runs.push(run("side", upright("side line", last, [waist_m, hem_m], &side)?));
        // The hem lies below all zones.
        hem_rad.push(side(hem_m));
        let mut hem: Vec<DVec2> = Vec::new();
        for zone in (0..=last).rev() {
            let part = level("hem", zone, hem_m, [hem_rad[zone as usize + 1], hem_rad[zone as usize]])?;
            hem.extend(part.into_iter().skip(usize::from(zone < last)));
        }
        runs.push(run("hem", hem));
        let hip_m = mapping.form.lines.hip_m;
        let piece = Piece {
            name: self.name.to_owned(),
            runs,
            grain_m: [DVec2::new(0.06, 0.1), DVec2::new(0.06, 0.35)],
            notches_m: vec![self.flat_at("side line", last, hip_m, side(hip_m))?],
        };
        // It goes clockwise in the flat cloth, which shows its inner side where the weft goes round to the right of who looks at the wearer's front.
        let over = piece.mirrored(self.name);
        Ok(if mapping.centre == Centre::Front { over.backwards() } else { over.mirrored(self.name).backwards() })
    }

    /// A dart's legs in the flat cloth: from the waist line down to its tip in the zone before, and back up in the zone after.
    fn legs(&self, dart: usize, places_apart_m: f64) -> Result<[Vec<DVec2>; 2], SkirtError> {
        let (Dart { weft_m, tip_m, .. }, waist_m) = (self.mapping.darts[dart], self.mapping.form.lines.waist_m);
        let tip = DVec2::new(weft_m, tip_m - self.mapping.from_m);
        let count = ((waist_m - tip_m) / places_apart_m).ceil().max(2.0) as usize;
        let (mut leg_down, mut leg_up) = (vec![tip], vec![tip]);
        for i in 1..=count {
            let height_m = tip_m + (waist_m - tip_m) * i as f64 / count as f64;
            let [down, up] = self.dart_at(dart, height_m)?.flat_m;
            leg_down.push(down);
            leg_up.push(up);
        }
        leg_down.reverse();
        Ok([leg_down, leg_up])
    }

    /// A dart's line at a height, on the cloth at rest: midway over what overlaps, or along the slit's borders where they gape or are sewn.
    fn dart_at(&self, dart: usize, height_m: f64) -> Result<DartAt, SkirtError> {
        let borders = [0, 1].map(|side| self.border_at(dart, side, height_m));
        let [Some((end, end_m)), Some((begin, begin_m))] = borders else {
            return Err(SkirtError::Missed { piece: self.name, line: "dart", height_m });
        };
        let is_removed = self.mapping.darts[dart].kind == DartKind::Removed;
        if is_removed || self.mapping.sense() * turned(begin, end) <= 0.0 {
            return Ok(DartAt { angles_rad: [end, begin], flat_m: [end_m, begin_m] });
        }
        let middle = begin + 0.5 * turned(begin, end);
        let zone = dart as u32;
        let flat_m = [self.flat_at("dart", zone, height_m, middle)?, self.flat_at("dart", zone + 1, height_m, middle)?];
        Ok(DartAt { angles_rad: [middle; 2], flat_m })
    }

    /// Where a border of a slit has come to a height: its angle and the place in the flat cloth.
    fn border_at(&self, dart: usize, side: usize, height_m: f64) -> Option<(f64, DVec2)> {
        let middle_m = self.mapping.form.section(height_m).middle_m;
        self.slits[dart][side].windows(2).find_map(|pair| {
            let [from_m, to_m] = [pair[0], pair[1]].map(|v| self.rests_m[v as usize]);
            let share = (from_m.y - height_m) / (from_m.y - to_m.y);
            (0.0..=1.0).contains(&share).then(|| {
                let at_m = from_m.lerp(to_m, share);
                let [flat_from_m, flat_to_m] = [pair[0], pair[1]].map(|v| self.flat.places_m[v as usize]);
                let turn = crate::form::angle_rad(DVec2::new(at_m.x, at_m.z) - middle_m);
                (turn, flat_from_m.lerp(flat_to_m, share))
            })
        })
    }

    fn flat_at(&self, line: &'static str, zone: u32, height_m: f64, turn: f64) -> Result<DVec2, SkirtError> {
        let middle = self.mapping.form.section(height_m).middle_m;
        let middle_m = DVec3::new(middle.x, height_m, middle.y);
        let on = |zone: u32| met(&self.flat, &self.rests_m, zone, middle_m, turn);
        // Below a slit the zones' border may have shifted by a hair.
        let beside = |dart: u32| height_m <= self.mapping.darts[dart as usize].tip_m;
        let found: Option<OnCloth> =
            on(zone).or_else(|| zone.checked_sub(1).filter(|before| beside(*before)).and_then(&on)).or_else(|| {
                Some(zone)
                    .filter(|dart| (*dart as usize) < self.mapping.darts.len() && beside(*dart))
                    .and_then(|dart| on(dart + 1))
            });
        found.map(|on| on.flat_m(&self.flat)).ok_or(SkirtError::Missed { piece: self.name, line, height_m })
    }
}

/// How far from each other the same places of two halves' cloth rest that are laid on alike but for their darts' kind, between waist and hem, centre and
/// side line, metres.
#[must_use]
pub fn apart_m(first: &Half, second: &Half) -> Vec<f64> {
    let mapping = &second.mapping;
    let mut apart = Vec::new();
    for ((place_m, zone), (laid_m, rests_m)) in
        second.flat.places_m.iter().zip(second.flat.vertex_zones()).zip(second.laid_m.iter().zip(&second.rests_m))
    {
        let section = mapping.form.section(laid_m.y).grown(mapping.out_m);
        let turn = crate::form::angle_rad(DVec2::new(laid_m.x, laid_m.z) - section.middle_m);
        let beyond_side_m = mapping.sense() * section.arc_m(mapping.side_rad(&section), turn);
        if place_m.x < 0.0 || beyond_side_m > 0.0 || !(second.hem_m..=mapping.form.lines.waist_m).contains(&laid_m.y) {
            continue;
        }
        apart.extend(
            in_flat(&first.flat, zone, *place_m).map(|on| on.place_m(&first.flat, &first.rests_m).distance(*rests_m)),
        );
    }
    apart
}

/// The pattern of both halves and the same turned over for the left side, seams trued: their runs are made equally long, each by as little as the other.
///
/// # Errors
/// When a line of the form meets no cloth.
pub fn pattern(halves: &[Half; 2], places_apart_m: f64) -> Result<Pattern, SkirtError> {
    let mut right = [halves[0].piece(places_apart_m)?, halves[1].piece(places_apart_m)?];
    let at =
        |piece: &Piece, name: &str| piece.runs.iter().position(|run| run.name == name).expect("every run is there");
    let legs = |dart: usize| [format!("dart {} at the centre", dart + 1), format!("dart {} at the side", dart + 1)];
    let darts = [0, 1].map(|half: usize| halves[half].mapping.darts.len());
    // Dart legs keep their tip, sides and centre lines the hem.
    for (piece, darts) in right.iter_mut().zip(darts) {
        for dart in 0..darts {
            let legs = legs(dart).map(|name| at(piece, &name));
            let long_m = 0.5 * legs.iter().map(|leg| piece.runs[*leg].length_m()).sum::<f64>();
            for leg in legs {
                let tip_end = usize::from(piece.runs[leg].places_m[0].y > piece.runs[leg].places_m[1].y);
                lengthen(piece, leg, long_m, tip_end);
            }
        }
    }
    let sides = [at(&right[0], "side"), at(&right[1], "side")];
    let long_m = 0.5 * (right[0].runs[sides[0]].length_m() + right[1].runs[sides[1]].length_m());
    for (piece, side) in right.iter_mut().zip(sides) {
        let hem_end = usize::from(piece.runs[side].places_m[0].y > piece.runs[side].places_m[1].y);
        lengthen(piece, side, long_m, hem_end);
    }
    let [front, back] = right;
    let pieces = vec![front.mirrored("left front"), back.mirrored("left back"), front, back];
    let mut seams = Vec::new();
    let run = |piece: usize, name: &str| [piece, at(&pieces[piece], name)];
    for piece in 0..4 {
        for dart in 0..darts[piece % 2] {
            seams.push(legs(dart).map(|name| run(piece, &name)));
        }
    }
    for (a, b, name) in [(0, 1, "side"), (2, 3, "side"), (0, 2, "centre"), (1, 3, "centre")] {
        seams.push([run(a, name), run(b, name)]);
    }
    Ok(Pattern { pieces, seams })
}

/// Makes the ends of a line those of its neighbours, where they are known.
fn ends(line: &mut [DVec2], first_m: Option<DVec2>, last_m: Option<DVec2>) {
    if let [first, .., last] = line {
        *first = first_m.unwrap_or(*first);
        *last = last_m.unwrap_or(*last);
    }
}

/// Makes a run as long as asked; what begins or ends at its free end goes with it.
fn lengthen(piece: &mut Piece, run: usize, length_m: f64, fixed: usize) {
    piece.runs[run].make_length(length_m, fixed);
    let count = piece.runs.len();
    let places_m = &piece.runs[run].places_m;
    if fixed == 1 {
        let first_m = places_m[0];
        *piece.runs[(run + count - 1) % count].places_m.last_mut().expect("a run has places") = first_m;
    } else {
        let last_m = places_m[places_m.len() - 1];
        piece.runs[(run + 1) % count].places_m[0] = last_m;
    }
}

/// A skirt that was sewn from its pattern and draped again.
#[derive(Clone, Debug)]
pub struct Redraped {
    /// Three particles each.
    pub triangles: Vec<[u32; 3]>,
    /// Where it began and where it has come to rest, metres.
    pub began_m: Vec<DVec3>,
    /// See above.
    pub rests_m: Vec<DVec3>,
    /// Of each particle its distance from the same place of the first drape, metres, ascending.
    pub from_first_m: Vec<f64>,
    /// Mean strain along warp and weft.
    pub strain_mean: f64,
    /// Least angle of a triangle, radians.
    pub least_rad: f64,
    /// Whether it rests.
    pub certificate: Certificate,
}

/// Cuts and sews the pattern of [`pattern`], welds its seams, and drapes it on the same form, held at the waist as by its band. It begins `away_m` farther
/// out than where the first drape was, so that it has to find its own way back.
///
/// # Errors
/// When the pattern cannot be sewn or the cloth's constants are not in their ranges.
pub fn redrape(
    halves: &[Half; 2],
    pattern: &Pattern,
    edge_m: f64,
    away_m: f64,
    draping: &Draping,
) -> Result<Redraped, SkirtError> {
    let sewn = sew(pattern, edge_m, 0.0)?;
    let first_m: Vec<DVec3> =
        (0..sewn.places_m.len()).map(|v| on_first(halves, sewn.pieces[v], sewn.places_m[v])).collect();
    let corners_uv: Vec<[DVec2; 3]> =
        sewn.triangles.iter().map(|corners| corners.map(|v| sewn.places_m[v as usize])).collect();
    let mut sheet = Sheet::from_pattern(&PatternMesh {
        positions_m: &first_m,
        triangles: &sewn.triangles,
        corners_uv: &corners_uv,
        metres_per_uv: 1.0,
        welds: &sewn.welds,
    })?;
    let first_m = sheet.positions_m().to_vec();
    let form = halves[0].mapping.form;
    let mut began_m: Vec<DVec3> = first_m
        .iter()
        .map(|at_m| {
            let out = DVec2::new(at_m.x, at_m.z) - form.section(at_m.y).middle_m;
            let out = out.normalize_or_zero() * away_m;
            *at_m + DVec3::new(out.x, 0.0, out.y)
        })
        .collect();
    for (piece, runs) in pattern.pieces.iter().zip(&sewn.runs) {
        for (run, vertices) in piece.runs.iter().zip(runs) {
            if run.name.starts_with("waist") {
                for &v in vertices {
                    let particle = sheet.particle_of_vertex()[v as usize];
                    began_m[particle as usize] = first_m[particle as usize];
                    sheet.pin(particle, first_m[particle as usize])?;
                }
            }
        }
    }
    let mut drape = Drape::new(&sheet, draping.woven, &draping.settings)?;
    let mut state = drape.state(&sheet);
    state.positions_m.clone_from(&began_m);
    let (body, course) = (&mut Some(draping.body), Course::default());
    let certificate = to_rest(&mut drape, body, &course, draping.most_s, &mut state, &mut |_, _| ());
    let mut from_first_m: Vec<f64> = first_m.iter().zip(&state.positions_m).map(|(a, b)| a.distance(*b)).collect();
    from_first_m.sort_by(f64::total_cmp);
    Ok(Redraped {
        triangles: sheet.triangles().to_vec(),
        began_m,
        strain_mean: strain(&sheet, &state.positions_m).0,
        rests_m: state.positions_m,
        from_first_m,
        least_rad: sewn.least_rad,
        certificate,
    })
}

/// Where a place of a piece of [`pattern`] was in the first drape: left pieces are the right ones turned over.
fn on_first(halves: &[Half; 2], piece: usize, place_m: DVec2) -> DVec3 {
    let [of, is_left] = [piece % 2, usize::from(piece < 2)];
    let half = &halves[of];
    // Right pieces of the front show the cloth's other side.
    let turned_over = (of == 0) != (is_left == 1);
    let flat_m = DVec2::new(if turned_over { -place_m.x } else { place_m.x }, place_m.y);
    let zone = half.mapping.darts.iter().filter(|dart| flat_m.x > dart.weft_m).count() as u32;
    let at_m = in_flat(&half.flat, zone, flat_m).map_or(DVec3::ZERO, |on| on.place_m(&half.flat, &half.rests_m));
    if is_left == 1 { DVec3::new(2.0 * half.mapping.form.lines.centre_x_m - at_m.x, at_m.y, at_m.z) } else { at_m }
}
