//! A session of hands with cloth, frame by frame: it is filmed, measured and recorded. Knows neither where hands come from nor pictures.

use super::hand_of;
use crate::form::FormArgs;
use crate::places::say;
use glam::{DVec2, DVec3};
use kitsuke_drape::body::Body;
use kitsuke_drape::drape::{self, Stepped, strain};
use kitsuke_drape::form::Form;
use kitsuke_drape::hands::{Hand, Hands, Model};
use kitsuke_drape::intersections::self_intersections;
use kitsuke_drape::mapping::{Centre, Mapping};
use kitsuke_drape::scissors::Layers;
use kitsuke_drape::slit::Flat;
use kitsuke_drape::springs;
use kitsuke_drape::woven::Woven;
use kitsuke_pipeline::source::hands_script::{Act, ClothPlan, HandsScript, LONGEST_S, Moment};
use std::collections::{BTreeMap, BTreeSet};
use std::time::Instant;

/// Frames of a second, in each of which the cloth takes a step.
pub const FRAMES_PER_S: f64 = 60.0;
/// How near a hand must be to take a particle or to cut, metres.
const REACH_M: f64 = 0.1;
/// Frames between two pictures at first; when there are too many, every second one goes.
const FILMED: u64 = 15;
const MOST_PICTURES: usize = 16;
/// The ground goes so far from the middle, metres.
const FLOOR_M: f64 = 4.0;
/// Distance of pins along its waist, metres.
const PINNED_M: f64 = 0.05;
/// Cloth that is laid on a form lies so far outside, metres.
const LAID_OUT_M: f64 = 0.006;

/// What a picture shows.
#[derive(Clone)]
pub struct Shown {
    pub time_s: f64,
    pub positions_m: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
    pub hands_m: [Option<DVec3>; 2],
    /// What each would take or has.
    pub candidates: [Option<u32>; 2],
    pub held: [Option<u32>; 2],
    pub pinned_m: Vec<DVec3>,
    /// What was done since the last picture.
    pub acts: Vec<String>,
}

/// Cloth, hands, and what was seen of them.
pub struct Session {
    hands: Hands,
    /// The ground, and who stands on it.
    body: Body,
    form: Option<Form>,
    recorded: HandsScript,
    frame: u64,
    last_m: [Option<DVec3>; 2],
    filmed: u64,
    film: Vec<Shown>,
    acts: Vec<String>,
    frame_ms: Vec<f64>,
    last: Stepped,
    fastest_m_per_s: f64,
    cut_m: f64,
    in_vain: usize,
}

impl Session {
    /// Cloth that hangs as planned, before the form of a body if one is given.
    pub fn new(cloth: &ClothPlan, form: Option<&FormArgs>) -> Result<Session, String> {
        let form = form.map(FormArgs::make).transpose()?;
        let (mut body_m, mut body_triangles) = floor();
        if let Some((body, _)) = &form {
            let before = body_m.len() as u32;
            body_m.extend(body.surface().positions_m());
            body_triangles.extend(body.surface().triangles().iter().map(|corners| corners.map(|v| v + before)));
        }
        let body = Body::new(&body_m, &body_triangles).map_err(|error| error.to_string())?;
        let cells = cloth.particles as usize - 1;
        let [width_m, length_m] = cloth.size_m;
        let spacing_m = DVec2::new(width_m, length_m) / cells as f64;
        let flat = Flat::rectangle(DVec2::new(-0.5 * width_m, 0.0), cells, cells, spacing_m);
        let hung = |at: &DVec2| cloth.upper_m + DVec3::new(at.x, at.y - length_m, 0.0);
        let positions_m: Vec<DVec3> = flat.places_m.iter().map(hung).collect();
        let model = if cloth.is_woven {
            let woven = Woven::preset(&cloth.fabric).ok_or_else(|| format!("there is no fabric {}", cloth.fabric))?;
            let parts = drape::parts_of_frame(spacing_m.min_element());
            Model::Woven(woven, drape::Settings { step_s: 1.0 / FRAMES_PER_S, parts, ..drape::Settings::default() })
        } else {
            Model::Springs(springs::Settings { step_s: 1.0 / FRAMES_PER_S, ..springs::Settings::default() })
        };
        let mut hands = Hands::new(flat, &positions_m, model, REACH_M).map_err(|error| error.to_string())?;
        if cloth.is_pinned {
            hands.upper_corners().into_iter().for_each(|corner| hands.pin_particle(corner));
        }
        Ok(Session {
            hands,
            body,
            form: form.map(|(_, form)| form),
            recorded: HandsScript { cloth: cloth.clone(), moments: Vec::new(), then_s: 0.0 },
            frame: 0,
            last_m: [None; 2],
            filmed: FILMED,
            film: Vec::new(),
            acts: Vec::new(),
            frame_ms: Vec::new(),
            last: Stepped::default(),
            fastest_m_per_s: 0.0,
            cut_m: 0.0,
            in_vain: 0,
        })
    }

    /// When the next frame is, seconds.
    pub fn time_s(&self) -> f64 {
        self.frame as f64 / FRAMES_PER_S
    }

    /// Whether it is as long as a script may be: what is longer could not be played again.
    pub fn is_full(&self) -> bool {
        self.time_s() >= LONGEST_S
    }

    pub fn hands(&self) -> &Hands {
        &self.hands
    }

    pub fn film(&self) -> &[Shown] {
        &self.film
    }

    pub fn body(&self) -> &Body {
        &self.body
    }

    /// As a script that does the same again.
    pub fn recorded(&self) -> &HandsScript {
        &self.recorded
    }

    /// A frame with the hands there, none where they are not seen, and what they do.
    pub fn frame(&mut self, hands_m: [Option<DVec3>; 2], acts: &[Act]) -> Result<(), String> {
        let time_s = self.time_s();
        for hand in [Hand::Left, Hand::Right] {
            let last_m = &mut self.last_m[hand as usize];
            *last_m = hands_m[hand as usize].filter(|at_m| at_m.is_finite()).or(*last_m);
            self.hands.see(hand, *last_m);
        }
        self.recorded.moments.push(Moment { time_s, hands_m: self.last_m, acts: acts.to_vec() });
        for act in acts {
            match self.act(*act) {
                Ok(done) => {
                    say!("{time_s:6.2} s: {done}");
                    self.acts.push(done);
                }
                Err(problem) => {
                    self.in_vain += 1;
                    say!("{time_s:6.2} s: {act:?} in vain: {problem}");
                }
            }
        }
        if self.frame.is_multiple_of(self.filmed) {
            self.shoot();
        }
        let started = Instant::now();
        self.last = self.hands.step(Some(&self.body));
        self.frame_ms.push(started.elapsed().as_secs_f64() * 1e3);
        self.fastest_m_per_s = self.fastest_m_per_s.max(self.last.speed_m_per_s);
        self.frame += 1;
        Ok(())
    }

    fn act(&mut self, act: Act) -> Result<String, String> {
        let name = |hand| if hand == Hand::Left { "left" } else { "right" };
        let done = match act {
            Act::Pinch(hand) => {
                let hand = hand_of(hand);
                let particle = self.hands.pinch(hand).ok_or("nothing within reach, or the hand is not free")?;
                format!("{} takes {particle}", name(hand))
            }
            Act::Release(hand) => {
                let hand = hand_of(hand);
                let particle =
                    self.hands.release(hand).ok_or("it holds nothing, and nothing is pinned within reach")?;
                format!("{} lets go of {particle}", name(hand))
            }
            Act::Pin(hand) => {
                let hand = hand_of(hand);
                let particle = self.hands.pin(hand, Some(&self.body)).ok_or("it holds nothing")?;
                format!("{} pins {particle}", name(hand))
            }
            Act::Scissors(hand) => {
                self.hands.take_scissors(hand_of(hand));
                format!("{} takes scissors", name(hand_of(hand)))
            }
            Act::Cut(hand) => self.cut(hand_of(hand), Layers::Nearest)?,
            Act::CutAll(hand) => self.cut(hand_of(hand), Layers::All)?,
            Act::Move => {
                let corners = self.hands.take_corners().ok_or("both hands must be seen and have no scissors")?;
                format!("both move {} and {}", corners[0], corners[1])
            }
            Act::Map => {
                let form = self.form.as_ref().ok_or("there is no form to lay it on: give --body")?.skirt();
                self.hands.lay(&mapped(&form, self.hands.flat())).map_err(|error| error.to_string())?;
                let pins = waist_pins(self.hands.flat());
                pins.iter().for_each(|particle| self.hands.pin_particle(*particle));
                format!("laid on the form with {} pins along its waist", pins.len())
            }
        };
        Ok(done)
    }

    fn cut(&mut self, hand: Hand, layers: Layers) -> Result<String, String> {
        let cut_m = self.hands.cut(hand, layers).map_err(|error| error.to_string())?;
        self.cut_m += cut_m;
        Ok(format!("cut {:.0} mm", 1e3 * cut_m))
    }

    fn shoot(&mut self) {
        if self.film.len() == MOST_PICTURES {
            let mut kept = false;
            self.film.retain(|_| {
                kept = !kept;
                kept
            });
            self.filmed *= 2;
            if !self.frame.is_multiple_of(self.filmed) {
                return;
            }
        }
        let shown = self.shown();
        self.film.push(shown);
        self.acts.clear();
    }

    /// What is to be seen now.
    pub fn shown(&self) -> Shown {
        let both = [Hand::Left, Hand::Right];
        Shown {
            time_s: self.time_s(),
            positions_m: self.hands.state.positions_m.clone(),
            triangles: self.hands.flat().triangles.clone(),
            hands_m: both.map(|hand| self.hands.place_m(hand)),
            candidates: both.map(|hand| self.hands.candidate(hand)),
            held: both.map(|hand| self.hands.held(hand).map(|held| held.particle)),
            pinned_m: self.hands.pinned_m().values().copied().collect(),
            acts: self.acts.clone(),
        }
    }

    /// A line of live figures.
    pub fn told(&self) -> String {
        let recent = &self.frame_ms[self.frame_ms.len().saturating_sub(FRAMES_PER_S as usize)..];
        let mean_ms = recent.iter().sum::<f64>() / recent.len().max(1) as f64;
        let what = |hand: Hand| match (self.hands.held(hand), self.hands.candidate(hand), self.hands.has_scissors(hand))
        {
            (Some(held), ..) => format!("holds {}", held.particle),
            (.., true) => "has scissors".to_owned(),
            (_, Some(candidate), _) => format!("would take {candidate}"),
            _ => "is free".to_owned(),
        };
        format!(
            "{:6.2} s: {mean_ms:.1} ms a frame ({:.0} possible in a second); strain {:.2} %; left {}, right {}; {} pinned",
            self.time_s(),
            1e3 / mean_ms.max(1e-3),
            1e2 * strain(self.hands.sheet(), &self.hands.state.positions_m).0,
            what(Hand::Left),
            what(Hand::Right),
            self.hands.pinned_m().len()
        )
    }

    /// Figures of the whole session.
    pub fn figures(&self) -> Vec<(&'static str, f64)> {
        let mut frame_ms = self.frame_ms.clone();
        frame_ms.sort_by(f64::total_cmp);
        let at = |share: f64| frame_ms.get((share * frame_ms.len() as f64) as usize).copied().unwrap_or(f64::NAN);
        let places_m = &self.hands.state.positions_m;
        let (mean, most) = strain(self.hands.sheet(), places_m);
        let triangles = &self.hands.flat().triangles;
        let inside = places_m.iter().filter(|at_m| self.body.contains(**at_m)).count();
        vec![
            ("frames", self.frame as f64),
            ("frame_ms_median", at(0.5)),
            ("frame_ms_p95", at(0.95)),
            ("fps", 1e3 / (frame_ms.iter().sum::<f64>() / frame_ms.len().max(1) as f64)),
            ("particles", places_m.len() as f64),
            ("pieces", pieces(triangles) as f64),
            ("cut_mm", 1e3 * self.cut_m),
            ("in_vain", self.in_vain as f64),
            ("strain_mean", mean),
            ("strain_max", most),
            ("speed_max_m_per_s", self.fastest_m_per_s),
            ("inside", inside as f64),
            ("self_pairs", self_intersections(places_m, triangles).len() as f64),
        ]
    }
}

/// A slab whose upper side is the ground.
fn floor() -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let corner = |i: u32| {
        let far = |bit: u32| if i & bit == 0 { -FLOOR_M } else { FLOOR_M };
        DVec3::new(far(1), if i & 2 == 0 { -0.3 } else { 0.0 }, far(4))
    };
    // Counter-clockwise as seen from outside; corners count X, Y and Z as bits.
    let sides: [[u32; 4]; 6] = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles = sides.iter().flat_map(|[a, b, c, d]| [[*a, *b, *c], [*a, *c, *d]]);
    ((0..8).map(corner).collect(), triangles.collect())
}

/// Where flat cloth lies on a form whose warp is upright and whose upper border lies on the waist line: its middle in front, the weft round it.
fn mapped(form: &Form, flat: &Flat) -> Vec<DVec3> {
    let highest_m = flat.places_m.iter().map(|at| at.y).fold(f64::NEG_INFINITY, f64::max);
    let [low_m, _] = form.span_m();
    let from_m = (form.lines.waist_m - highest_m).max(low_m);
    let mapping = Mapping {
        form,
        out_m: LAID_OUT_M,
        layer_m: LAID_OUT_M,
        centre: Centre::Front,
        is_left: true,
        from_m,
        darts: Vec::new(),
    };
    flat.places_m.iter().map(|at| mapping.place_m(*at, 0)).collect()
}

/// Particles of the upper border that a dressmaker pins, about [`PINNED_M`] apart.
fn waist_pins(flat: &Flat) -> Vec<u32> {
    let highest_m = flat.places_m.iter().map(|at| at.y).fold(f64::NEG_INFINITY, f64::max);
    let weft_m = |v: &u32| flat.places_m[*v as usize].x;
    let mut upper: Vec<u32> =
        (0..flat.places_m.len() as u32).filter(|v| flat.places_m[*v as usize].y > highest_m - 1e-6).collect();
    upper.sort_by(|a, b| weft_m(a).total_cmp(&weft_m(b)));
    let mut pins: Vec<u32> = Vec::new();
    for (i, v) in upper.iter().enumerate() {
        if i + 1 == upper.len() || pins.last().is_none_or(|last| weft_m(v) - weft_m(last) >= PINNED_M) {
            pins.push(*v);
        }
    }
    pins
}

/// Pieces of cloth that hang together.
fn pieces(triangles: &[[u32; 3]]) -> usize {
    let mut near: BTreeMap<u32, BTreeSet<u32>> = BTreeMap::new();
    for corners in triangles {
        corners.iter().for_each(|v| near.entry(*v).or_default().extend(corners));
    }
    let mut count = 0;
    while let Some((first, _)) = near.first_key_value() {
        count += 1;
        let mut waiting = vec![*first];
        while let Some(vertex) = waiting.pop() {
            waiting.extend(near.remove(&vertex).into_iter().flatten());
        }
    }
    count
}
