//! The dress form of a body: level sections, each a radius for every one of equally many angles about the section's middle, with the lines that a
//! dressmaker tapes onto it (Shoda, A study of virtual draping method, 2018, chapter 2: 633 sections of 256 places). Knows no cloth.
//!
//! Angles are counted from the front (+Z) towards the wearer's left (+X). Along each angle a section reaches as far as the body does the last time:
//! hollows that cannot be seen from the middle are filled. Where two legs are cut, the section is their convex hull, as a form has no legs. Arms are
//! cut off by the planes that touch the trunk just below them, the head at the neck, where the body is thinnest.

use crate::body::Body;
use crate::slices::{Loop, area_m2, girth_m, hull, last_met_m, middle_m, slices};
use crate::triangle_tree::TriangleTree;
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// Fewest and most sections and places of a section.
const FEWEST: usize = 8;
const MOST: usize = 1 << 14;
/// A section that is wider than the one below by this on one side has an arm there, metres.
const ARM_M: f64 = 0.02;
/// Over how much of the height middles are smoothed, share of the body's height.
const SMOOTHED: f64 = 0.03;
/// What a hull bridges by more than this is open, metres.
const BRIDGED_M: f64 = 0.002;

/// What is cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut {
    /// Sections, the lowest first.
    pub sections: usize,
    /// Places of each.
    pub places: usize,
    /// Height of the lowest section above the lowest place of the body, share of the body's height; 0 to 0.5.
    pub from: f64,
}

impl Default for Cut {
    /// The paper's, from the knee on.
    fn default() -> Cut {
        Cut { sections: 633, places: 256, from: 0.27 }
    }
}

/// Lines on a form. They are found, and may be corrected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lines {
    /// Height of the waist, metres: the least girth between hip and bust.
    pub waist_m: f64,
    /// Of the hip: the greatest girth of the taut section from the crotch up to the waist.
    pub hip_m: f64,
    /// Of the bust: the farthest to the front below the arms.
    pub bust_m: f64,
    /// X of the plane through both centre lines, metres.
    pub centre_x_m: f64,
    /// Z of the plane through both side lines.
    pub side_z_m: f64,
}

/// A dress form.
#[derive(Clone, Debug, PartialEq)]
pub struct Form {
    /// Heights of the sections, ascending.
    heights_m: Vec<f64>,
    /// Their middles, X and Z.
    middles_m: Vec<DVec2>,
    /// Section by section.
    radii_m: Vec<f64>,
    /// Whether the body ends there: cut arms, and what is between legs.
    is_open: Vec<bool>,
    places: usize,
    /// Height at which arms begin, metres; of a body without arms, the highest section's.
    pub arms_m: f64,
    /// Its lines.
    pub lines: Lines,
}

/// A level section of a form.
#[derive(Clone, Debug, PartialEq)]
pub struct Section {
    /// X and Z, metres.
    pub middle_m: DVec2,
    radii_m: Vec<f64>,
    /// From angle 0 to each place along the section, and all around, metres.
    along_m: Vec<f64>,
}

/// How far a form and its body are from each other, both ways, metres; where the form is open, not counted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Apart {
    /// Of the form's places and the middles between them from the body's surface.
    pub form_mean_m: f64,
    /// See above.
    pub form_max_m: f64,
    /// Where.
    pub form_worst_m: DVec3,
    /// Of the body's vertices that are seen from outside from the form's surface.
    pub body_mean_m: f64,
    /// See above.
    pub body_max_m: f64,
    /// Share of the form that is open.
    pub open: f64,
    /// Body's vertices that were counted.
    pub vertices: usize,
}

/// Why there is no form.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FormError {
    /// A number of the cut.
    #[error("{what} is {value}, must be {range}")]
    Cut {
        /// Which.
        what: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        range: &'static str,
    },
    /// Nothing is met.
    #[error("the body has no section {height_m:.3} m above the ground: it must stand upright along Y, in metres")]
    Empty {
        /// Where.
        height_m: f64,
    },
    /// A line is none.
    #[error("the {line} line at {height_m:.3} m is not on the form, which goes from {low_m:.3} to {high_m:.3} m")]
    Line {
        /// Which.
        line: &'static str,
        /// Where.
        height_m: f64,
        /// Where the form begins.
        low_m: f64,
        /// Where it ends.
        high_m: f64,
    },
    /// Lines in the wrong order.
    #[error("the lines must lie above one another: hip {hip_m:.3} m, waist {waist_m:.3} m, bust {bust_m:.3} m")]
    Order {
        /// Metres.
        hip_m: f64,
        /// Metres.
        waist_m: f64,
        /// Metres.
        bust_m: f64,
    },
}

impl Form {
    /// Of a body that stands upright, its front towards +Z, in a T- or A-pose.
    ///
    /// # Errors
    /// When a number of the cut is out of its range or the body has nothing where it is cut.
    pub fn of(body: &Body, cut: &Cut) -> Result<Form, FormError> {
        for (what, value) in [("sections", cut.sections), ("places", cut.places)] {
            if !(FEWEST..=MOST).contains(&value) {
                return Err(FormError::Cut { what, value: value as f64, range: "8 to 16384" });
            }
        }
        if !(0.0..=0.5).contains(&cut.from) {
            return Err(FormError::Cut { what: "from", value: cut.from, range: "0 to 0.5 of the body's height" });
        }
        let extent = body.surface().tree().extent();
        let tall_m = extent.high_m.y - extent.low_m.y;
        let height_m = |share: f64| extent.low_m.y + share * tall_m;
        // First all the way up, to find the neck; then as many sections as are asked for.
        let rough = cut_up(body, &level(height_m(cut.from), height_m(0.93), 256), height_m(0.6))?;
        let shoulder = rough.trunks.iter().position(|trunk| trunk.height_m > height_m(0.78)).unwrap_or(0);
        let girth = |trunk: &Trunk| girth_m(&hull(&trunk.places_m()));
        let neck = rough.trunks[shoulder..].iter().min_by(|a, b| girth(a).total_cmp(&girth(b)));
        let top_m = neck.map_or(height_m(0.85), |trunk| trunk.height_m);
        let cut_up = cut_up(body, &level(height_m(cut.from), top_m, cut.sections), height_m(0.6))?;
        let mut middles_m: Vec<DVec2> = cut_up.trunks.iter().map(|trunk| middle_m(&hull(&trunk.places_m()))).collect();
        smooth(&mut middles_m, (SMOOTHED * tall_m / (top_m - height_m(cut.from)) * cut.sections as f64) as usize);
        let (mut radii_m, mut is_open) = (Vec::new(), Vec::new());
        for (trunk, middle_m) in cut_up.trunks.iter().zip(&middles_m) {
            let outline = trunk.outline_m();
            for place in 0..cut.places {
                let direction = direction(TAU * place as f64 / cut.places as f64);
                let to_body = trunk.loops.iter().filter_map(|line| last_met_m(line, *middle_m, direction));
                let to_body_m = to_body.fold(0.0, f64::max);
                let to_arm_m = trunk.to_arm_m(*middle_m, direction);
                let radius_m = last_met_m(&outline, *middle_m, direction).unwrap_or(to_body_m).min(to_arm_m);
                radii_m.push(radius_m);
                is_open.push((radius_m - to_body_m).abs() > BRIDGED_M);
            }
        }
        let heights_m: Vec<f64> = cut_up.trunks.iter().map(|trunk| trunk.height_m).collect();
        let lines = found_lines(&cut_up, &middles_m, tall_m);
        let arms_m = heights_m[cut_up.armpit];
        Ok(Form { heights_m, middles_m, radii_m, is_open, places: cut.places, arms_m, lines })
    }

    /// With other lines.
    ///
    /// # Errors
    /// When one is not on the form or they are not in their order.
    pub fn with_lines(self, lines: Lines) -> Result<Form, FormError> {
        let [low_m, high_m] = self.span_m();
        for (line, height_m) in [("hip", lines.hip_m), ("waist", lines.waist_m), ("bust", lines.bust_m)] {
            if !(low_m..=high_m).contains(&height_m) {
                return Err(FormError::Line { line, height_m, low_m, high_m });
            }
        }
        if !(lines.hip_m < lines.waist_m && lines.waist_m < lines.bust_m) {
            return Err(FormError::Order { hip_m: lines.hip_m, waist_m: lines.waist_m, bust_m: lines.bust_m });
        }
        Ok(Form { lines, ..self })
    }

    /// What a tight skirt touches: all sections convex, below the hip line one section as wide as any there, and upright, between waist and hip line,
    /// only what stands out. The paper takes the hip's section below the hip; thighs that stand out farther are in ours.
    #[must_use]
    pub fn skirt(&self) -> Form {
        let section_at =
            |height_m: f64| self.heights_m.partition_point(|height| *height < height_m).min(self.heights_m.len() - 1);
        let [hip, waist] = [section_at(self.lines.hip_m), section_at(self.lines.waist_m)];
        let outline = |section: usize| (0..self.places).map(move |place| self.place_m(section, place));
        let below = hull(&(0..=hip).flat_map(outline).collect::<Vec<_>>());
        let middle_m = middle_m(&below);
        let mut form = self.clone();
        form.middles_m.fill(middle_m);
        for section in 0..self.heights_m.len() {
            let taut = if section <= hip { below.clone() } else { hull(&outline(section).collect::<Vec<_>>()) };
            for place in 0..self.places {
                let way = direction(self.angle_rad(place));
                form.radii_m[section * self.places + place] = last_met_m(&taut, middle_m, way).unwrap_or(0.0);
            }
        }
        for place in 0..self.places {
            // As a thread that is drawn from the waist to the hip along this angle.
            let profile: Vec<DVec2> = (hip..=waist)
                .map(|section| DVec2::new(self.heights_m[section], form.radii_m[section * self.places + place]))
                .collect();
            let chain = upper_chain(&profile);
            let mut along = 0;
            for section in hip..=waist {
                while along + 2 < chain.len() && chain[along + 1].x < self.heights_m[section] {
                    along += 1;
                }
                let [a, b] = [chain[along], chain[(along + 1).min(chain.len() - 1)]];
                let share = if b.x > a.x { (self.heights_m[section] - a.x) / (b.x - a.x) } else { 0.0 };
                form.radii_m[section * self.places + place] = a.y + (b.y - a.y) * share;
            }
        }
        for at in 0..form.radii_m.len() {
            let [section, place] = [at / self.places, at % self.places];
            form.is_open[at] |= form.place_m(section, place).distance(self.place_m(section, place)) > BRIDGED_M;
        }
        form
    }

    /// Heights of the lowest and the highest section, metres.
    #[must_use]
    pub fn span_m(&self) -> [f64; 2] {
        [self.heights_m[0], self.heights_m[self.heights_m.len() - 1]]
    }

    /// Sections and places of each.
    #[must_use]
    pub fn size(&self) -> [usize; 2] {
        [self.heights_m.len(), self.places]
    }

    fn angle_rad(&self, place: usize) -> f64 {
        TAU * place as f64 / self.places as f64
    }

    /// X and Z of a place, metres.
    fn place_m(&self, section: usize, place: usize) -> DVec2 {
        let radius_m = self.radii_m[section * self.places + place % self.places];
        self.middles_m[section] + direction(self.angle_rad(place)) * radius_m
    }

    /// The section at any height (eqs. 2-2, 2-7); beyond the form, its first or last one.
    #[must_use]
    pub fn section(&self, height_m: f64) -> Section {
        let last = self.heights_m.len() - 1;
        let above = self.heights_m.partition_point(|height| *height < height_m).clamp(1, last);
        let [low_m, high_m] = [self.heights_m[above - 1], self.heights_m[above]];
        let share = ((height_m - low_m) / (high_m - low_m)).clamp(0.0, 1.0);
        let [low, high] = [above - 1, above].map(|section| &self.radii_m[section * self.places..][..self.places]);
        let radii_m = low.iter().zip(high).map(|(low, high)| low + (high - low) * share).collect();
        Section::new(self.middles_m[above - 1].lerp(self.middles_m[above], share), radii_m)
    }

    /// As a closed mesh, farther out by a distance (metres): places section by section, then the middles below and above; triangles face out.
    #[must_use]
    pub fn mesh(&self, out_m: f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let [sections, places] = self.size();
        let mut positions_m = Vec::new();
        for section in 0..sections {
            let middle_m = self.middles_m[section];
            for place in 0..places {
                let radius_m = self.radii_m[section * places + place] + out_m;
                let at_m = middle_m + direction(self.angle_rad(place)) * radius_m;
                positions_m.push(DVec3::new(at_m.x, self.heights_m[section], at_m.y));
            }
        }
        let [low, high] = [0, sections - 1].map(|section| {
            let at_m = self.middles_m[section];
            DVec3::new(at_m.x, self.heights_m[section], at_m.y)
        });
        let (below, above) = (positions_m.len() as u32, positions_m.len() as u32 + 1);
        positions_m.extend([low, high]);
        let at = |section: usize, place: usize| (section * places + place % places) as u32;
        let mut triangles = Vec::new();
        for place in 0..places {
            triangles.push([below, at(0, place + 1), at(0, place)]);
            triangles.push([above, at(sections - 1, place), at(sections - 1, place + 1)]);
            for section in 1..sections {
                let [a, b] = [at(section - 1, place), at(section - 1, place + 1)];
                let [c, d] = [at(section, place), at(section, place + 1)];
                triangles.extend([[a, b, d], [a, d, c]]);
            }
        }
        (positions_m, triangles)
    }

    /// How far it and the body it was cut from are apart, up to a height (metres): shoulders are level, and level cuts miss most of what is so.
    #[must_use]
    pub fn apart(&self, body: &Body, up_to_m: f64) -> Apart {
        let places = self.places;
        let sections = self.heights_m.partition_point(|height| *height <= up_to_m);
        let (positions_m, triangles) = self.mesh(0.0);
        let mut apart = Apart::default();
        let is_open = |section: usize, place: usize| self.is_open[section * places + place % places];
        let mut asked = Vec::new();
        for section in 1..sections.max(1) {
            for place in 0..places {
                let corners = [(section - 1, place), (section - 1, place + 1), (section, place), (section, place + 1)];
                if corners.iter().any(|(section, place)| is_open(*section, *place)) {
                    apart.open += 1.0 / (places * (sections - 1)) as f64;
                    continue;
                }
                let at_m = corners.map(|(section, place)| positions_m[section * places + place % places]);
                asked.extend([at_m[0], at_m.iter().sum::<DVec3>() / 4.0]);
            }
        }
        // Mean, most and where.
        let distances_m = |asked: &[DVec3], tree: &TriangleTree, of_m: &[DVec3]| {
            let found = crate::parallel::collect(asked.len(), |i, found: &mut Vec<(f64, DVec3)>| {
                let near = tree.nearest(of_m, asked[i], f64::INFINITY);
                found.extend(near.map(|near| (near.squared_m2.sqrt(), asked[i])));
            });
            let most = found.iter().max_by(|a, b| a.0.total_cmp(&b.0)).copied().unwrap_or_default();
            (found.iter().map(|found| found.0).sum::<f64>() / found.len().max(1) as f64, most)
        };
        let surface = body.surface();
        (apart.form_mean_m, (apart.form_max_m, apart.form_worst_m)) =
            distances_m(&asked, surface.tree(), surface.positions_m());
        let tree = TriangleTree::new(&positions_m, &triangles);
        let [low_m, high_m] = [self.heights_m[0], self.span_m()[1].min(up_to_m)];
        let seen: Vec<DVec3> = (surface.positions_m().iter().copied())
            .filter(|at_m| at_m.y > low_m && at_m.y < high_m)
            .filter(|at_m| {
                let section = self.section(at_m.y);
                let way_m = DVec2::new(at_m.x, at_m.z) - section.middle_m;
                let above = self.heights_m.partition_point(|height| *height < at_m.y);
                let place = (angle_rad(way_m) / TAU * places as f64) as usize;
                // What lies deeper has other parts of the body before it.
                let is_seen = (way_m.length() - section.radius_m(angle_rad(way_m))).abs() < 0.01;
                let is_closed = (0..2).all(|i| !is_open(above - 1, place + i) && !is_open(above, place + i));
                is_seen && is_closed && !hidden(body, *at_m, way_m)
            })
            .collect();
        apart.vertices = seen.len();
        (apart.body_mean_m, (apart.body_max_m, _)) = distances_m(&seen, &tree, &positions_m);
        apart
    }
}

impl Section {
    /// Of radii at equal angles from the front on, metres, at least three.
    #[must_use]
    pub fn new(middle_m: DVec2, radii_m: Vec<f64>) -> Section {
        let mut section = Section { middle_m, radii_m, along_m: vec![0.0] };
        for place in 0..section.radii_m.len() {
            let side_m = section.corner_m(place).distance(section.corner_m(place + 1));
            section.along_m.push(section.along_m[place] + side_m);
        }
        section
    }

    /// Radius at an angle, on the straight line between two places.
    #[must_use]
    pub fn radius_m(&self, angle_rad: f64) -> f64 {
        let count = self.radii_m.len();
        let at = angle_rad.rem_euclid(TAU) / TAU * count as f64;
        let place = (at as usize).min(count - 1);
        let step = TAU / count as f64;
        let [a, b] = [place, place + 1].map(|i| direction(step * i as f64) * self.radii_m[i % count]);
        let ray = direction(angle_rad);
        // a + s (b - a) lies on the ray.
        let share = ray.perp_dot(a) / (ray.perp_dot(a) - ray.perp_dot(b));
        a.lerp(b, if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 }).dot(ray)
    }

    /// The place at an angle, X and Z, metres.
    #[must_use]
    pub fn at_m(&self, angle_rad: f64) -> DVec2 {
        self.middle_m + direction(angle_rad) * self.radius_m(angle_rad)
    }

    /// The angle of a place seen from the middle.
    #[must_use]
    pub fn angle_rad(&self, place_m: DVec2) -> f64 {
        angle_rad(place_m - self.middle_m)
    }

    /// All around, metres.
    #[must_use]
    pub fn girth_m(&self) -> f64 {
        self.along_m[self.radii_m.len()]
    }

    /// Farther out along each angle, metres.
    #[must_use]
    pub fn grown(mut self, out_m: f64) -> Section {
        self.radii_m.iter_mut().for_each(|radius_m| *radius_m += out_m);
        Section::new(self.middle_m, self.radii_m)
    }

    /// Radii at equal angles, metres.
    #[must_use]
    pub fn radii_m(&self) -> &[f64] {
        &self.radii_m
    }

    /// The way from the middle to a place, counted on beyond the last one.
    #[must_use]
    pub fn corner_m(&self, place: usize) -> DVec2 {
        let count = self.radii_m.len();
        direction(TAU * place as f64 / count as f64) * self.radii_m[place % count]
    }

    /// From angle 0 to a place along the section, metres; of all places, the girth.
    #[must_use]
    pub fn along_m(&self) -> &[f64] {
        &self.along_m
    }
}

/// The unit vector (X, Z) of an angle from the front towards the wearer's left.
#[must_use]
pub fn direction(angle_rad: f64) -> DVec2 {
    DVec2::new(libm::sin(angle_rad), libm::cos(angle_rad))
}

/// The angle of a way (X, Z), 0 to a whole turn.
#[must_use]
pub fn angle_rad(way_m: DVec2) -> f64 {
    libm::atan2(way_m.x, way_m.y).rem_euclid(TAU)
}

/// What of a level cut is trunk or leg.
struct Trunk {
    height_m: f64,
    loops: Vec<Loop>,
    /// Arms are cut off here, X, metres.
    arms_m: [f64; 2],
    is_legs: bool,
}

struct CutUp {
    trunks: Vec<Trunk>,
    /// The highest section of two legs, and the lowest with arms.
    crotch: usize,
    armpit: usize,
}

impl Trunk {
    fn places_m(&self) -> Vec<DVec2> {
        let [right_m, left_m] = self.arms_m;
        self.loops.iter().flatten().map(|p| DVec2::new(p.x.clamp(right_m, left_m), p.y)).collect()
    }

    fn outline_m(&self) -> Loop {
        if self.is_legs || self.loops.len() != 1 { hull(&self.places_m()) } else { self.loops[0].clone() }
    }

    /// How far it is along a ray to where arms are cut off, metres.
    fn to_arm_m(&self, from_m: DVec2, direction: DVec2) -> f64 {
        let wall_m = if direction.x > 0.0 { self.arms_m[1] } else { self.arms_m[0] };
        if direction.x.abs() < 1e-12 { f64::INFINITY } else { ((wall_m - from_m.x) / direction.x).max(0.0) }
    }
}

/// Of places that go to greater X, those that a thread above them touches.
fn upper_chain(places: &[DVec2]) -> Vec<DVec2> {
    let mut chain: Vec<DVec2> = Vec::new();
    for &place in places {
        while chain.len() >= 2
            && (chain[chain.len() - 1] - chain[chain.len() - 2]).perp_dot(place - chain[chain.len() - 2]) >= 0.0
        {
            chain.pop();
        }
        chain.push(place);
    }
    chain
}

fn level(low_m: f64, high_m: f64, count: usize) -> Vec<f64> {
    (0..count).map(|i| low_m + (high_m - low_m) * i as f64 / (count - 1) as f64).collect()
}

/// From the largest loop about the waist down and up, each time what lies over or under the last section.
fn cut_up(body: &Body, heights_m: &[f64], start_m: f64) -> Result<CutUp, FormError> {
    let cuts = slices(body.surface().positions_m(), body.surface().triangles(), heights_m);
    let start = heights_m.partition_point(|height| *height < start_m).min(heights_m.len() - 1);
    let largest = cuts[start].iter().max_by(|a, b| area_m2(a).abs().total_cmp(&area_m2(b).abs()));
    let first = largest.ok_or(FormError::Empty { height_m: heights_m[start] })?.clone();
    let free = [f64::NEG_INFINITY, f64::INFINITY];
    let mut trunks: Vec<Option<Trunk>> = heights_m.iter().map(|_| None).collect();
    trunks[start] = Some(Trunk { height_m: heights_m[start], loops: vec![first], arms_m: free, is_legs: false });
    let (mut crotch, mut armpit) = (0, heights_m.len() - 1);
    let (down, up): (Vec<usize>, Vec<usize>) = ((0..start).rev().collect(), (start + 1..heights_m.len()).collect());
    for (way, goes_up) in [(down, false), (up, true)] {
        let mut before = start;
        for section in way {
            let last = trunks[before].as_ref().expect("the section before is cut");
            let last_hull = hull(&last.places_m());
            let loops: Vec<Loop> = cuts[section].iter().filter(|line| overlaps(line, &last_hull)).cloned().collect();
            let height_m = heights_m[section];
            if loops.is_empty() {
                return Err(FormError::Empty { height_m });
            }
            let mut arms_m = last.arms_m;
            if goes_up {
                let span = |places: &mut dyn Iterator<Item = f64>| {
                    places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
                };
                let [right_m, left_m] = span(&mut loops.iter().flatten().map(|p| p.x));
                let [last_right_m, last_left_m] = span(&mut last_hull.iter().map(|p| p.x));
                if arms_m == free && (right_m < last_right_m - ARM_M || left_m > last_left_m + ARM_M) {
                    arms_m = [last_right_m, last_left_m];
                    armpit = section;
                }
            }
            let is_legs = !goes_up && (last.is_legs || loops.len() > 1);
            if is_legs && !last.is_legs {
                crotch = section;
            }
            trunks[section] = Some(Trunk { height_m, loops, arms_m, is_legs });
            before = section;
        }
    }
    Ok(CutUp { trunks: trunks.into_iter().flatten().collect(), crotch, armpit })
}

/// Whether a closed line and a convex one have places in common, about: one has a corner in the other.
fn overlaps(line: &[DVec2], convex: &[DVec2]) -> bool {
    let is_in =
        |p: DVec2| convex.iter().zip(convex.iter().cycle().skip(1)).all(|(a, b)| (*b - *a).perp_dot(p - *a) >= 0.0);
    line.iter().any(|p| is_in(*p)) || {
        let around = hull(line);
        convex
            .iter()
            .any(|p| around.iter().zip(around.iter().cycle().skip(1)).all(|(a, b)| (*b - *a).perp_dot(*p - *a) >= 0.0))
    }
}

/// A running mean over so many sections to either side, fewer at the ends.
fn smooth(middles_m: &mut [DVec2], reach: usize) {
    let were_m = middles_m.to_vec();
    for (i, middle_m) in middles_m.iter_mut().enumerate() {
        let reach = reach.min(i).min(were_m.len() - 1 - i);
        let around = &were_m[i - reach..=i + reach];
        *middle_m = around.iter().sum::<DVec2>() / around.len() as f64;
    }
}

fn found_lines(cut_up: &CutUp, middles_m: &[DVec2], tall_m: f64) -> Lines {
    let CutUp { trunks, crotch, armpit } = cut_up;
    let girths_m: Vec<f64> = trunks.iter().map(|trunk| girth_m(&hull(&trunk.places_m()))).collect();
    let at = |height_m: f64| trunks.partition_point(|trunk| trunk.height_m < height_m).min(trunks.len() - 1);
    let crotch_m = trunks[*crotch].height_m;
    let range = |low_m: f64, high_m: f64| at(low_m)..at(high_m).max(at(low_m) + 1);
    let hip = range(crotch_m - 0.01 * tall_m, crotch_m + 0.12 * tall_m)
        .max_by(|a, b| girths_m[*a].total_cmp(&girths_m[*b]))
        .unwrap_or(*crotch);
    let hip_m = trunks[hip].height_m;
    let waist = range(hip_m + 0.05 * tall_m, hip_m + 0.2 * tall_m)
        .min_by(|a, b| girths_m[*a].total_cmp(&girths_m[*b]))
        .unwrap_or(hip);
    let waist_m = trunks[waist].height_m;
    let front_m = |section: &usize| trunks[*section].places_m().iter().map(|p| p.y).fold(f64::NEG_INFINITY, f64::max);
    let highest_m = trunks[*armpit].height_m.min(waist_m + 0.2 * tall_m);
    let bust =
        range(waist_m + 0.03 * tall_m, highest_m).max_by(|a, b| front_m(a).total_cmp(&front_m(b))).unwrap_or(waist);
    // Where the hip is widest.
    let places_m = trunks[hip].places_m();
    let widest = |sign: f64| places_m.iter().max_by(|a, b| (sign * a.x).total_cmp(&(sign * b.x))).map_or(0.0, |p| p.y);
    Lines {
        waist_m,
        hip_m,
        bust_m: trunks[bust].height_m,
        centre_x_m: middles_m.iter().map(|m| m.x).sum::<f64>() / middles_m.len() as f64,
        side_z_m: 0.5 * (widest(1.0) + widest(-1.0)),
    }
}

/// Whether more of the body lies outwards of a place of it.
fn hidden(body: &Body, at_m: DVec3, way_m: DVec2) -> bool {
    let out = way_m.normalize_or_zero();
    [0.004, 0.008, 0.02].iter().any(|m| body.contains(at_m + DVec3::new(out.x, 0.0, out.y) * *m))
}
