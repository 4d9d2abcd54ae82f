//! What hands do with cloth, and when: a TOML file that a person writes or a recorded session. Written and read here, so that what was recorded is read
//! back with the same bits. Knows no cloth.

use super::manifest::{self, Field, report_wrong};
use super::units::Length;
use crate::diagnostic::{Diagnostic, Place};
use glam::DVec3;
use schemars::JsonSchema;
use serde::Deserialize;
use std::fmt::Write;

/// Most particles along a side of the cloth.
pub const MOST_PARTICLES: u32 = 512;
/// Longest script, seconds.
pub const LONGEST_S: f64 = 3600.0;
/// Hands and cloth are no farther away, metres.
const FARTHEST_M: f64 = 100.0;

/// A hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hand {
    /// The wearer's left one.
    Left,
    /// The right one.
    Right,
}

/// What hands do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Act {
    /// Take the nearest particle.
    Pinch(Hand),
    /// Let go, or unpin the nearest pinned particle.
    Release(Hand),
    /// Pin what is held.
    Pin(Hand),
    /// Take scissors.
    Scissors(Hand),
    /// Cut along the way of the scissors through the nearest layer.
    Cut(Hand),
    /// Or through all.
    CutAll(Hand),
    /// Both take the upper corners.
    Move,
    /// The cloth is laid on the dress form.
    Map,
}

/// Acts by their names.
const ACTS: [(&str, Act); 14] = [
    ("left pinch", Act::Pinch(Hand::Left)),
    ("right pinch", Act::Pinch(Hand::Right)),
    ("left release", Act::Release(Hand::Left)),
    ("right release", Act::Release(Hand::Right)),
    ("left pin", Act::Pin(Hand::Left)),
    ("right pin", Act::Pin(Hand::Right)),
    ("left scissors", Act::Scissors(Hand::Left)),
    ("right scissors", Act::Scissors(Hand::Right)),
    ("left cut", Act::Cut(Hand::Left)),
    ("right cut", Act::Cut(Hand::Right)),
    ("left cut all", Act::CutAll(Hand::Left)),
    ("right cut all", Act::CutAll(Hand::Right)),
    ("move", Act::Move),
    ("map", Act::Map),
];

/// The cloth.
#[derive(Clone, Debug, PartialEq)]
pub struct ClothPlan {
    /// Whether it is woven; else it is masses and springs.
    pub is_woven: bool,
    /// A preset's name.
    pub fabric: String,
    /// Particles along each side, 2 to [`MOST_PARTICLES`].
    pub particles: u32,
    /// Along the weft, and along the warp, metres.
    pub size_m: [f64; 2],
    /// The middle of its upper border, metres. Its face looks along Z.
    pub upper_m: DVec3,
    /// Whether it hangs by its upper corners.
    pub is_pinned: bool,
}

impl Default for ClothPlan {
    fn default() -> ClothPlan {
        ClothPlan {
            is_woven: true,
            fabric: "chirimen".to_owned(),
            particles: 42,
            size_m: [0.9, 0.9],
            upper_m: DVec3::new(0.0, 1.45, 0.3),
            is_pinned: true,
        }
    }
}

/// A time at which something is known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Moment {
    /// Seconds from the begin.
    pub time_s: f64,
    /// Where the left and the right hand are then, metres; between two known places a hand goes straight.
    pub hands_m: [Option<DVec3>; 2],
    /// What they do, in this order.
    pub acts: Vec<Act>,
}

/// What hands do with a cloth.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HandsScript {
    /// The cloth.
    pub cloth: ClothPlan,
    /// Ascending by time.
    pub moments: Vec<Moment>,
    /// Seconds that the cloth goes on after the last moment.
    pub then_s: f64,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[schemars(title = "Hands", deny_unknown_fields)]
struct ScriptFile {
    then_s: Option<Field<f64>>,
    #[serde(default)]
    cloth: ClothTable,
    #[serde(default)]
    moment: Vec<MomentTable>,
}

#[derive(Debug, Default, Deserialize, JsonSchema)]
#[schemars(title = "Cloth", deny_unknown_fields)]
struct ClothTable {
    model: Option<Field<String>>,
    fabric: Option<Field<String>>,
    particles: Option<Field<u32>>,
    width: Option<Field<Length>>,
    length: Option<Field<Length>>,
    upper_m: Option<Field<[f64; 3]>>,
    pinned: Option<Field<bool>>,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[schemars(title = "Moment", deny_unknown_fields)]
struct MomentTable {
    time_s: Field<f64>,
    left_m: Option<Field<[f64; 3]>>,
    right_m: Option<Field<[f64; 3]>>,
    #[serde(default)]
    r#do: Vec<Field<String>>,
}

/// Reads a script for fabrics of these names; what is wrong is reported with its line, and then nothing is returned.
pub fn read(file: &str, bytes: &[u8], fabrics: &[&str], report: &mut Vec<Diagnostic>) -> Option<HandsScript> {
    let before = report.len();
    let table: ScriptFile = manifest::parse(file, super::utf8(file, bytes, report)?, report)?;
    let mut script = HandsScript { then_s: 2.0, ..HandsScript::default() };
    let mut reader = Reader { file, report };
    let seconds = |value: &f64| (0.0..=LONGEST_S).contains(value);
    let seconds_are = format!("0 to {LONGEST_S} seconds");
    if let Some(value) = reader.value(table.then_s.as_ref(), seconds, &seconds_are) {
        script.then_s = *value;
    }
    let cloth = table.cloth;
    let plan = &mut script.cloth;
    if let Some(model) =
        reader.value(cloth.model.as_ref(), |model| matches!(&model[..], "woven" | "springs"), "woven or springs")
    {
        plan.is_woven = model == "woven";
    }
    if let Some(fabric) = reader.value(cloth.fabric.as_ref(), |name| fabrics.contains(&&name[..]), &fabrics.join(", "))
    {
        plan.fabric.clone_from(fabric);
    }
    let range = format!("2 to {MOST_PARTICLES} along each side");
    if let Some(count) = reader.value(cloth.particles.as_ref(), |count| (2..=MOST_PARTICLES).contains(count), &range) {
        plan.particles = *count;
    }
    for (size_m, field) in plan.size_m.iter_mut().zip([&cloth.width, &cloth.length]) {
        let is_cloth = |length: &Length| (0.02..=10.0).contains(&length.metres());
        if let Some(length) = reader.value(field.as_ref(), is_cloth, "2 cm to 10 m") {
            *size_m = length.metres();
        }
    }
    if let Some(place_m) = reader.place(cloth.upper_m.as_ref()) {
        plan.upper_m = place_m;
    }
    if let Some(is_pinned) = reader.value(cloth.pinned.as_ref(), |_| true, "") {
        plan.is_pinned = *is_pinned;
    }
    let mut last_s = 0.0;
    for table in &table.moment {
        let mut moment = Moment::default();
        if let Some(time_s) = reader.value(Some(&table.time_s), seconds, &seconds_are) {
            if *time_s < last_s {
                reader.wrong(
                    &table.time_s.place(),
                    &format!("{time_s} s stands behind {last_s} s"),
                    "moments in the order of their times",
                );
            }
            last_s = last_s.max(*time_s);
            moment.time_s = *time_s;
        }
        moment.hands_m = [reader.place(table.left_m.as_ref()), reader.place(table.right_m.as_ref())];
        for field in &table.r#do {
            let names: Vec<&str> = ACTS.iter().map(|(name, _)| *name).collect();
            if let Some(name) = reader.value(Some(field), |name| names.contains(&&name[..]), &names.join(", ")) {
                moment.acts.extend(ACTS.iter().find(|(of, _)| of == name).map(|(_, act)| *act));
            }
        }
        script.moments.push(moment);
    }
    (report.len() == before).then_some(script)
}

struct Reader<'a> {
    file: &'a str,
    report: &'a mut Vec<Diagnostic>,
}

impl Reader<'_> {
    /// A value that is there and right; others are reported.
    fn value<'f, T>(
        &mut self,
        field: Option<&'f Field<T>>,
        is_right: impl Fn(&T) -> bool,
        right: &str,
    ) -> Option<&'f T> {
        let field = field?;
        report_wrong(self.file, field, self.report);
        let value = field.get()?;
        if !is_right(value) {
            self.wrong(&field.place(), "this is not possible here", right);
            return None;
        }
        Some(value)
    }

    fn place(&mut self, field: Option<&Field<[f64; 3]>>) -> Option<DVec3> {
        let is_near = |place: &[f64; 3]| place.iter().all(|m| m.abs() <= FARTHEST_M);
        self.value(field, is_near, &format!("three numbers, metres, at most {FARTHEST_M} from the ground's middle"))
            .map(|place| DVec3::from(*place))
    }

    fn wrong(&mut self, place: &Place, problem: &str, right: &str) {
        self.report.push(
            Diagnostic::error("wrong-value", self.file, place.clone())
                .problem(problem)
                .help(format!("It must be {right}.")),
        );
    }
}

/// The script as its file, which [`read`] gives back as it was.
#[must_use]
pub fn written(script: &HandsScript) -> String {
    let place = |at: DVec3| format!("[{:?}, {:?}, {:?}]", at.x, at.y, at.z);
    let ClothPlan { is_woven, fabric, particles, size_m: [width_m, length_m], upper_m, is_pinned } = &script.cloth;
    let model = if *is_woven { "woven" } else { "springs" };
    let mut text = format!(
        "then_s = {:?}\n\n[cloth]\nmodel = \"{model}\"\nfabric = \"{fabric}\"\nparticles = {particles}\nwidth = \"{width_m:?} m\"\nlength = \"{length_m:?} m\"\nupper_m = {}\npinned = {is_pinned}\n",
        script.then_s,
        place(*upper_m),
    );
    for Moment { time_s, hands_m, acts } in &script.moments {
        _ = write!(text, "\n[[moment]]\ntime_s = {time_s:?}\n");
        for (name, at) in ["left_m", "right_m"].iter().zip(hands_m) {
            _ = at.map(|at| writeln!(text, "{name} = {}", place(at)));
        }
        let name = |act: &Act| ACTS.iter().find(|(_, of)| of == act).map_or("", |(name, _)| *name);
        if !acts.is_empty() {
            let names: Vec<String> = acts.iter().map(|act| format!("\"{}\"", name(act))).collect();
            _ = writeln!(text, "do = [{}]", names.join(", "));
        }
    }
    text
}

impl HandsScript {
    /// Where a hand is at a time: straight between two known places, exactly there at a moment's time; none before the first.
    #[must_use]
    pub fn place_m(&self, hand: Hand, time_s: f64) -> Option<DVec3> {
        let known = |moment: &Moment| moment.hands_m[hand as usize].map(|at_m| (moment.time_s, at_m));
        let after = self.moments.partition_point(|moment| moment.time_s <= time_s);
        let (from_s, from_m) = self.moments[..after].iter().rev().find_map(known)?;
        let Some((to_s, to_m)) = self.moments[after..].iter().find_map(known) else { return Some(from_m) };
        Some(from_m + (to_m - from_m) * ((time_s - from_s) / (to_s - from_s)))
    }

    /// How long it takes with what comes after the last moment, seconds.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.moments.last().map_or(0.0, |moment| moment.time_s) + self.then_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FABRICS: [&str; 2] = ["chirimen", "yukata"];

    #[test]
    fn a_script_is_read_and_hands_go_straight() {
        let text = b"[cloth]\nfabric = \"yukata\"\nparticles = 22\nwidth = \"60 cm\"\n\n[[moment]]\ntime_s = 1.0\nleft_m = [0.0, 1.0, 0.0]\ndo = [\"left pinch\"]\n\n[[moment]]\ntime_s = 2\ndo = [\"move\"]\n\n[[moment]]\ntime_s = 3.0\nleft_m = [0.2, 1.0, 0.0]\n";
        let script = read("hands.toml", text, &FABRICS, &mut Vec::new()).unwrap();
        assert_eq!((script.cloth.particles, script.cloth.size_m, script.then_s), (22, [0.6, 0.9], 2.0));
        assert_eq!(script.moments[0].acts, [Act::Pinch(Hand::Left)]);
        assert_eq!(script.place_m(Hand::Left, 0.5), None);
        assert_eq!(script.place_m(Hand::Left, 1.0), Some(DVec3::Y));
        assert_eq!(script.place_m(Hand::Left, 2.0), Some(DVec3::new(0.1, 1.0, 0.0)));
        assert_eq!(script.place_m(Hand::Left, 9.0), Some(DVec3::new(0.2, 1.0, 0.0)));
        assert_eq!((script.place_m(Hand::Right, 2.0), script.seconds()), (None, 5.0));
    }

    #[test]
    fn mistakes_are_named_all_together() {
        let text = "[cloth]\nmodel = \"knit\"\nfabric = \"silk\"\nparticles = 1\nwidth = \"90 m\"\n\n[[moment]]\ntime_s = 2\nleft_m = [0.0, 1000.0, 0.0]\ndo = [\"left punch\"]\n\n[[moment]]\ntime_s = 1\nright_m = [0.0]\n";
        let mut report = Vec::new();
        assert_eq!(read("hands.toml", text.as_bytes(), &FABRICS, &mut report), None);
        assert_eq!(report.len(), 8, "{report:?}");
        assert!(
            report
                .iter()
                .all(|diagnostic| diagnostic.code == "wrong-value" && matches!(diagnostic.place, Place::Span(_)))
        );
        report.clear();
        assert_eq!(read("hands.toml", b"[clothes]\n", &FABRICS, &mut report), None);
        assert_eq!(report[0].code, "unknown-key");
    }

    proptest! {
        #[test]
        fn what_was_recorded_is_read_back_with_the_same_bits(
            moments in prop::collection::vec(
                (0.0..100.0, prop::option::of([-9.0..9.0, -9.0..9.0, -9.0..9.0]), prop::option::of([-1e-7..1e-7, 0.0..9.0, 0.0..9.0]), prop::collection::vec(0..14_usize, 0..3)),
                0..20,
            ),
            is_woven in any::<bool>(),
            particles in 2..=MOST_PARTICLES,
            width_m in 0.02..10.0,
        ) {
            let mut moments: Vec<Moment> = moments
                .into_iter()
                .map(|(time_s, left, right, acts)| Moment {
                    time_s,
                    hands_m: [left.map(DVec3::from), right.map(DVec3::from)],
                    acts: acts.into_iter().map(|act| ACTS[act].1).collect(),
                })
                .collect();
            moments.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
            let cloth = ClothPlan { is_woven, particles, size_m: [width_m, 0.9], ..ClothPlan::default() };
            let script = HandsScript { cloth, moments, then_s: 0.5 };
            let again = read("hands.toml", written(&script).as_bytes(), &FABRICS, &mut Vec::new()).unwrap();
            prop_assert_eq!(&again, &script);
            for moment in &script.moments {
                for hand in [Hand::Left, Hand::Right] {
                    let last = script.moments.iter().rev().find(|m| m.time_s <= moment.time_s && m.hands_m[hand as usize].is_some());
                    if let Some(last) = last.filter(|last| last.time_s == moment.time_s) {
                        prop_assert_eq!(script.place_m(hand, moment.time_s), last.hands_m[hand as usize]);
                    }
                }
            }
        }
    }
}
