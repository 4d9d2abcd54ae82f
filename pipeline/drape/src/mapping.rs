//! Flat cloth laid onto a dress form: the warp upright, the weft round the form at its own length, zone by zone where slits let it overlap (Shoda 2018,
//! eqs. 2-1 to 2-10). Lengths along the weft are exact on the section at each height, where the paper takes those of the section below. Knows no forces.

use crate::form::{Form, Section, direction};
use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// Over how much height cloth of an upper layer rises to it, and over how much weft it sinks again, metres.
const RISE_M: f64 = 0.02;
const SINK_M: f64 = 0.03;
/// Cloth of an upper layer is laid on in steps of this, metres.
const STEP_M: f64 = 0.002;

/// Which centre line cloth begins at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Centre {
    /// The front.
    Front,
    /// The back.
    Back,
}

/// What becomes of the cloth that a dart takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DartKind {
    /// It stays: what is beyond the slit lies on it.
    Overlapping,
    /// It is cut away beforehand, as much on either side of the slit, and the edges are sewn.
    Removed,
}

/// A dart of a slit along the warp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dart {
    /// Whether it overlaps.
    pub kind: DartKind,
    /// The slit's place along the weft, metres from the centre line.
    pub weft_m: f64,
    /// Height on the form where it ends below, metres.
    pub tip_m: f64,
    /// What it takes at the waist, metres.
    pub amount_m: f64,
    /// The angles at which what is beyond it begins at its tip and at the waist (eq. 2-10).
    begins_rad: [f64; 2],
}

/// What lies below a zone along a section: the zone before a dart, to where it ends, and how far the cloth beyond has risen onto it, 0 to 1.
struct Below {
    end_rad: f64,
    rise: f64,
}

/// How cloth is laid on.
#[derive(Clone, Debug)]
pub struct Mapping<'a> {
    /// The form.
    pub form: &'a Form,
    /// Cloth lies so far outside, metres.
    pub out_m: f64,
    /// Distance of layers, metres.
    pub layer_m: f64,
    /// Where the weft begins: weft 0 lies on the centre line.
    pub centre: Centre,
    /// Whether it goes round by the wearer's left side.
    pub is_left: bool,
    /// Height on the form of warp 0, metres (H_waist - h_max, eq. 2-1).
    pub from_m: f64,
    /// Along the weft, ascending: the n-th divides zones n and n + 1.
    pub darts: Vec<Dart>,
}

impl Mapping<'_> {
    /// Where cloth of a zone lies.
    #[must_use]
    pub fn place_m(&self, flat_m: DVec2, zone: u32) -> DVec3 {
        let height_m = self.from_m + flat_m.y;
        let section = self.form.section(height_m).grown(self.out_m);
        let (turn, above) = self.turn(&section, height_m, flat_m.x, zone);
        let at = section.middle_m + direction(turn) * (section.radius_m(turn) + above * self.layer_m);
        DVec3::new(at.x, height_m, at.y)
    }

    /// Divides what is beyond the last dart by another one, which takes so much at the waist.
    pub fn add_dart(&mut self, kind: DartKind, weft_m: f64, tip_m: f64, amount_m: f64) {
        let zone = self.darts.len() as u32;
        let turn_at = |height_m: f64, weft_m: f64| {
            self.turn(&self.form.section(height_m).grown(self.out_m), height_m, weft_m, zone).0
        };
        let begins_rad = [turn_at(tip_m, weft_m), turn_at(self.form.lines.waist_m, weft_m - amount_m)];
        self.darts.push(Dart { kind, weft_m, tip_m, amount_m, begins_rad });
    }

    /// What the n-th dart takes at a height, metres along the weft: what its zones would overlap.
    #[must_use]
    pub fn taken_m(&self, dart: usize, height_m: f64) -> f64 {
        let section = self.form.section(height_m).grown(self.out_m);
        let (begin, _, below) = self.begun(&section, height_m, dart as u32 + 1);
        (self.sense() * section.arc_m(begin, below[dart].end_rad)).max(0.0)
    }

    /// Its angle, and how far it has risen onto the layers below it, in layers.
    fn turn(&self, section: &Section, height_m: f64, weft_m: f64, zone: u32) -> (f64, f64) {
        let (begin, begin_m, below) = self.begun(section, height_m, zone);
        let turn = self.walked(section, &below, begin, weft_m - begin_m);
        (turn, self.risen(section, &below, turn))
    }

    /// The angle and the weft at which a zone begins, and what lies below it: it begins where the one before ends, but above the dart's tip earlier by as
    /// much as is taken (eq. 2-10).
    fn begun(&self, section: &Section, height_m: f64, zone: u32) -> (f64, f64, Vec<Below>) {
        let (mut begin, mut begin_m, mut below) = (self.centre_rad(section), 0.0, Vec::new());
        for dart in &self.darts[..zone as usize] {
            let end = self.walked(section, &below, begin, dart.weft_m - begin_m);
            (begin, begin_m) = (end, dart.weft_m);
            if height_m > dart.tip_m {
                let [from, to] = dart.begins_rad;
                let earlier =
                    from + turned(from, to) * (height_m - dart.tip_m) / (self.form.lines.waist_m - dart.tip_m);
                // Over a belly the zone before ends sooner than that: it does not overlap there, but it does not gape, either.
                begin = if self.sense() * turned(earlier, end) < 0.0 { end } else { earlier };
            }
            let rise = match dart.kind {
                DartKind::Overlapping => ((height_m - dart.tip_m) / RISE_M).clamp(0.0, 1.0),
                DartKind::Removed => 0.0,
            };
            below.push(Below { end_rad: end, rise });
        }
        (begin, begin_m, below)
    }

    /// How many layers lie below an angle; beyond where they end cloth sinks again.
    fn risen(&self, section: &Section, below: &[Below], turn: f64) -> f64 {
        let share = |layer: &Below| {
            let beyond_m = self.sense() * section.arc_m(layer.end_rad, turn);
            layer.rise * (1.0 - beyond_m / SINK_M).clamp(0.0, 1.0)
        };
        below.iter().filter(|layer| layer.rise > 0.0).map(share).sum()
    }

    /// The angle after so much weft, metres, on what lies below.
    fn walked(&self, section: &Section, below: &[Below], from_rad: f64, weft_m: f64) -> f64 {
        let place_m =
            |turn: f64| direction(turn) * (section.radius_m(turn) + self.risen(section, below, turn) * self.layer_m);
        // Where cloth rises or sinks it goes inwards or outwards, too: short steps, each as long as it should be.
        let (mut turn, mut left_m) = (from_rad, weft_m);
        while left_m.abs() > 1e-9 {
            if self.risen(section, below, turn) == 0.0 {
                return section.angle_after(turn, self.sense() * left_m);
            }
            let step_m = left_m.clamp(-STEP_M, STEP_M);
            let mut along_m = step_m;
            let mut next = turn;
            for _ in 0..3 {
                next = section.angle_after(turn, self.sense() * along_m);
                along_m *= step_m.abs() / place_m(next).distance(place_m(turn));
            }
            turn = next;
            left_m -= step_m;
        }
        turn
    }

    /// The angle of the centre line.
    #[must_use]
    pub fn centre_rad(&self, section: &Section) -> f64 {
        section.angle_at_x(self.form.lines.centre_x_m, self.centre == Centre::Front)
    }

    /// The angle of the side line.
    #[must_use]
    pub fn side_rad(&self, section: &Section) -> f64 {
        section.angle_at_z(self.form.lines.side_z_m, self.is_left)
    }

    /// Round the form from the centre line to the side line, metres.
    #[must_use]
    pub fn quarter_m(&self, height_m: f64) -> f64 {
        let section = self.form.section(height_m).grown(self.out_m);
        section.arc_m(self.centre_rad(&section), self.side_rad(&section)).abs()
    }

    /// 1 where angles grow along the weft, -1 where they fall.
    #[must_use]
    pub fn sense(&self) -> f64 {
        if self.is_left == (self.centre == Centre::Front) { 1.0 } else { -1.0 }
    }
}

impl Section {
    /// Along the section from one angle to another, the shorter way, metres; below 0 where angles fall.
    #[must_use]
    pub fn arc_m(&self, from_rad: f64, to_rad: f64) -> f64 {
        let girth_m = self.girth_m();
        let way_m = (self.at_along_m(to_rad) - self.at_along_m(from_rad)).rem_euclid(girth_m);
        if way_m > 0.5 * girth_m { way_m - girth_m } else { way_m }
    }

    /// The angle that lies so far along the section, metres; below 0 where angles fall.
    #[must_use]
    pub fn angle_after(&self, from_rad: f64, arc_m: f64) -> f64 {
        let to_m = (self.at_along_m(from_rad) + arc_m).rem_euclid(self.girth_m());
        let along_m = self.along_m();
        let place = along_m.partition_point(|m| *m <= to_m).clamp(1, along_m.len() - 1) - 1;
        let share = (to_m - along_m[place]) / (along_m[place + 1] - along_m[place]);
        crate::form::angle_rad(self.corner_m(place).lerp(self.corner_m(place + 1), share.clamp(0.0, 1.0)))
    }

    /// From angle 0 along the section, metres.
    fn at_along_m(&self, angle_rad: f64) -> f64 {
        let count = self.radii_m().len();
        let place = ((angle_rad.rem_euclid(TAU) / TAU * count as f64) as usize).min(count - 1);
        self.along_m()[place] + self.corner_m(place).distance(direction(angle_rad) * self.radius_m(angle_rad))
    }

    /// The angle of the place with such an X, in front or behind; where there is none, straight ahead.
    #[must_use]
    pub fn angle_at_x(&self, x_m: f64, is_front: bool) -> f64 {
        let sense = if is_front { 1.0 } else { -1.0 };
        self.crossing(|place| place.x - x_m, |place| sense * place.y).unwrap_or(if is_front { 0.0 } else { PI })
    }

    /// The angle of the place with such a Z, on the wearer's left or right; where there is none, straight to the side.
    #[must_use]
    pub fn angle_at_z(&self, z_m: f64, is_left: bool) -> f64 {
        let sense = if is_left { 1.0 } else { -1.0 };
        self.crossing(|place| place.y - z_m, |place| sense * place.x).unwrap_or(sense * 0.5 * PI)
    }

    /// The angle at which a side crosses 0, of several the one that is farthest.
    fn crossing(&self, beyond: impl Fn(DVec2) -> f64, far: impl Fn(DVec2) -> f64) -> Option<f64> {
        let mut best: Option<(f64, f64)> = None;
        for place in 0..self.radii_m().len() {
            let [a, b] = [self.corner_m(place), self.corner_m(place + 1)];
            let [of_a, of_b] = [a, b].map(|corner| beyond(self.middle_m + corner));
            if (of_a <= 0.0) != (of_b <= 0.0) {
                let at = a.lerp(b, of_a / (of_a - of_b));
                if best.is_none_or(|(farthest, _)| far(self.middle_m + at) > farthest) {
                    best = Some((far(self.middle_m + at), crate::form::angle_rad(at)));
                }
            }
        }
        best.map(|(_, angle)| angle)
    }
}

/// From one angle to another the shorter way, -π to π.
#[must_use]
pub fn turned(from_rad: f64, to_rad: f64) -> f64 {
    (to_rad - from_rad + PI).rem_euclid(TAU) - PI
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ways_round_a_section_are_as_long_as_asked() {
        let radii_m = (0..256).map(|i| 0.1 + 0.03 * libm::cos(2.0 * TAU * f64::from(i) / 256.0)).collect();
        let section = Section::new(DVec2::new(0.01, -0.02), radii_m);
        for i in 0..60 {
            let from = 0.3 * f64::from(i);
            for arc_m in [-0.25, -0.01, 0.0, 0.003, 0.1, 0.28] {
                let to = section.angle_after(from, arc_m);
                let along_m = section.arc_m(from, to);
                assert!((along_m - arc_m).abs() < 1e-9, "{from} {arc_m}: {along_m}");
                // Walked in short steps.
                let walked_m: f64 = (0..400)
                    .map(|k| {
                        let at = |k: i32| section.at_m(section.angle_after(from, arc_m * f64::from(k) / 400.0));
                        at(k).distance(at(k + 1))
                    })
                    .sum();
                assert!((walked_m - arc_m.abs()).abs() < 1e-4, "{from} {arc_m}: {walked_m}");
            }
        }
        assert!(section.angle_at_x(0.01, true).abs() < 1e-9 && (section.angle_at_x(0.01, false) - PI).abs() < 1e-9);
        assert!((section.angle_at_z(-0.02, false) - 1.5 * PI).abs() < 1e-9);
    }
}
