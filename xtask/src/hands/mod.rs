//! `cargo xtask hands`: cloth under the hands of a script, of a recorded motion or of somebody who stands before a sensor now.

mod operator;
mod picture;
mod session;

use crate::form::FormArgs;
use crate::places::{Places, ended, say, write_whole};
use crate::scans::{MeshArgs, unit};
use crate::shots::{self, FilterName, ReadAs};
use kitsuke::skeleton::filter::FilterState;
use kitsuke::skeleton::{Skeleton, Tracked};
use kitsuke_drape::gestures::Gestures;
use kitsuke_drape::hands::Hand;
use kitsuke_drape::woven::PRESETS;
use kitsuke_live::{Listener, Settings};
use kitsuke_pipeline::diagnostic::{self, Format};
use kitsuke_pipeline::source::hands_script::{self, Act, ClothPlan, HandsScript};
use kitsuke_pipeline::source::units::LengthUnit;
use session::{FRAMES_PER_S, Session};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Who has not been seen for so long is lost, seconds.
const STALE_S: f64 = 0.5;
/// A solver that falls behind by more frames than this lets them go.
const BEHIND: u64 = 3;

/// Move, take, pin, cut and lay cloth with two hands
///
/// The hands are those of a script (TOML with times), of a recorded motion, or of somebody who sends a live skeleton. Without a script, hands speak for themselves: one that closes takes, one
/// that opens lets go, one that stays for a second takes, pins on the body or cuts, whichever comes next there, and with the other hand raised takes scissors or lets go. The wearer stands 75 cm before the cloth and
/// looks at it. Writes hands.png (how it went), cloth.obj and session.toml, a script that does the same again, bit for bit.
#[derive(clap::Args)]
#[command(group = clap::ArgGroup::new("whose").required(true).args(["script", "motion", "vmc"]))]
pub struct Args {
    /// What the hands do, and the cloth
    #[arg(long, value_name = "FILE.toml")]
    script: Option<PathBuf>,
    /// BVH, .vrma, MediaPipe or DeepMimic JSON, Kinect CSV, or JSON Lines
    #[arg(long, value_name = "FILE")]
    motion: Option<PathBuf>,
    /// Address and port to listen at in the VMC protocol; whoever reaches it can move the hands
    #[arg(long, value_name = "ADDRESS:PORT", value_parser = kitsuke_live::address)]
    vmc: Option<SocketAddr>,
    /// Where pictures, the cloth and the recorded session go
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Write the figures as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// A body that the cloth meets and on whose form it can be laid, a closed mesh that stands upright at the origin
    #[arg(long, value_name = "FILE")]
    body: Option<PathBuf>,
    /// The body's unit, where its file does not say it
    #[arg(long, value_parser = unit, requires = "body")]
    unit: Option<LengthUnit>,
    /// End after so many seconds, an hour at most [default: with the script or motion; live, on Ctrl-C]
    #[arg(long, value_name = "S", value_parser = seconds)]
    seconds: Option<f64>,
    /// Smooth the skeleton
    #[arg(long, conflicts_with = "script")]
    filter: Option<FilterName>,
    /// Both hands hold the upper corners from the first frame on
    #[arg(long, conflicts_with = "script")]
    r#move: bool,
    /// Particles along each side of the cloth [default: 42]
    #[arg(long, value_name = "N", conflicts_with = "script", value_parser = clap::value_parser!(u32).range(2..=i64::from(hands_script::MOST_PARTICLES)))]
    particles: Option<u32>,
    /// The cloth [default: chirimen]
    #[arg(long, conflicts_with = "script", value_parser = PRESETS.map(|preset| preset.0))]
    cloth: Option<String>,
    /// Masses and springs instead of woven cloth
    #[arg(long, conflicts_with = "script")]
    springs: bool,
    /// The kimono whose wearer moves: an ID, or the path of a pack
    #[arg(long, value_name = "ID", default_value = "komon", conflicts_with = "script")]
    garment: String,
    #[command(flatten)]
    read_as: ReadAs,
    #[command(flatten)]
    places: Places,
}

fn seconds(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|&seconds: &f64| seconds > 0.0 && seconds <= hands_script::LONGEST_S);
    number.ok_or_else(|| format!("seconds are a number above 0, at most {}", hands_script::LONGEST_S))
}

/// Plays; 1 when something cannot be read, written or listened to.
pub fn run(args: Args) -> ExitCode {
    ended(play(&args))
}

/// What a scene's script does, on a body if one is given.
pub fn scene(script: &str, form: Option<&FormArgs>, out: &Path, json: Option<&Path>) -> Result<(), String> {
    let script = read_script("scene.toml", script.as_bytes(), Path::new("."))?;
    let mut session = Session::new(&script.cloth, form)?;
    scripted(&mut session, &script, script.seconds())?;
    finished(session, out, json)
}

fn play(args: &Args) -> Result<(), String> {
    let form = args.body.as_ref().map(|body| FormArgs::of(MeshArgs::of(body, args.unit), None));
    if let Some(path) = &args.script {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let script = read_script(&name, &shots::read(path)?, path.parent().unwrap_or(Path::new(".")))?;
        let mut session = Session::new(&script.cloth, form.as_ref())?;
        scripted(&mut session, &script, args.seconds.unwrap_or(script.seconds()))?;
        return finished(session, &args.out, args.json.as_deref());
    }
    let cloth = ClothPlan {
        is_woven: !args.springs,
        fabric: args.cloth.clone().unwrap_or(ClothPlan::default().fabric),
        particles: args.particles.unwrap_or(ClothPlan::default().particles),
        is_pinned: !args.r#move,
        ..ClothPlan::default()
    };
    let pack = args.places.open(&args.garment)?;
    let wearer = &pack.garment().data().skeleton;
    let mut session = Session::new(&cloth, form.as_ref())?;
    match (&args.motion, args.vmc) {
        (Some(path), _) => recorded(args, path, wearer, &mut session)?,
        (None, Some(address)) => live(args, address, wearer, &mut session)?,
        (None, None) => unreachable!("clap wants one of the three"),
    }
    finished(session, &args.out, args.json.as_deref())
}

fn read_script(name: &str, bytes: &[u8], folder: &Path) -> Result<HandsScript, String> {
    let mut report = Vec::new();
    let script = hands_script::read(name, bytes, &PRESETS.map(|preset| preset.0), &mut report);
    eprint!("{}", diagnostic::render(&diagnostic::sorted(report), folder, Format::Human { color: false }));
    script.ok_or_else(|| format!("{name} has mistakes"))
}

/// Plays a script frame by frame.
fn scripted(session: &mut Session, script: &HandsScript, seconds: f64) -> Result<(), String> {
    let mut next = 0;
    while session.time_s() <= seconds {
        let time_s = session.time_s();
        let hands_m = [hands_script::Hand::Left, hands_script::Hand::Right].map(|hand| script.place_m(hand, time_s));
        let mut acts = Vec::new();
        while let Some(moment) = script.moments.get(next).filter(|moment| moment.time_s <= time_s) {
            acts.extend(&moment.acts);
            next += 1;
        }
        session.frame(hands_m, &acts)?;
    }
    Ok(())
}

/// What is seen of a wearer, as hands and what they mean.
struct Watcher<'a> {
    wearer: &'a Skeleton,
    gestures: Gestures,
    begins_with_move: bool,
}

impl Watcher<'_> {
    fn frame(&mut self, session: &mut Session, tracked: &Tracked) -> Result<(), String> {
        let seen = operator::seen(self.wearer, tracked);
        let meanings = self.gestures.see(seen, 1.0 / FRAMES_PER_S, session.hands(), Some(session.body()));
        let mut acts: Vec<Act> = meanings.into_iter().map(|(hand, meaning)| operator::act(hand, meaning)).collect();
        if self.begins_with_move && seen.iter().all(|seen| seen.place_m.is_some()) {
            self.begins_with_move = false;
            acts.push(Act::Move);
        }
        session.frame(seen.map(|seen| seen.place_m), &acts)
    }
}

fn recorded(args: &Args, path: &Path, wearer: &Skeleton, session: &mut Session) -> Result<(), String> {
    let mut recording = shots::recording(path, wearer, args.read_as)?;
    if let Some(filter) = args.filter {
        recording = recording.filtered(&filter.filter());
    }
    let last_s = recording.times_s.last().copied().unwrap_or(0.0);
    let mut watcher = Watcher { wearer, gestures: Gestures::default(), begins_with_move: args.r#move };
    let end_s = args.seconds.unwrap_or(last_s);
    while session.time_s() <= end_s && !session.is_full() {
        let time_s = session.time_s();
        let after = recording.times_s.partition_point(|known_s| *known_s <= time_s).max(1);
        let Some(frame) = recording.frames.get(after - 1) else { break };
        let tracked = Tracked { pose: recording.pose_at(time_s), confidence: frame.confidence };
        watcher.frame(session, &tracked)?;
    }
    Ok(())
}

fn live(args: &Args, address: SocketAddr, wearer: &Skeleton, session: &mut Session) -> Result<(), String> {
    let settings = Settings { address, ..Settings::default() };
    let mut listener = Listener::new(&settings, wearer).map_err(|error| error.to_string())?;
    say!("listens at {}", listener.address().map_err(|error| error.to_string())?);
    let is_stopped = Arc::new(AtomicBool::new(false));
    let stop = Arc::clone(&is_stopped);
    ctrlc::set_handler(move || stop.store(true, Ordering::Relaxed))
        .map_err(|error| format!("cannot wait for Ctrl-C: {error}"))?;
    let mut watcher = Watcher { wearer, gestures: Gestures::default(), begins_with_move: args.r#move };
    let mut filter = args.filter.map(|name| (name.filter(), FilterState::default()));
    let began = Instant::now();
    let frame_s = 1.0 / FRAMES_PER_S;
    let (mut frames, mut let_go, mut reported) = (0_u64, 0_u64, 0_u64);
    while !is_stopped.load(Ordering::Relaxed)
        && !session.is_full()
        && args.seconds.is_none_or(|seconds| began.elapsed().as_secs_f64() < seconds)
    {
        let due = began + Duration::from_secs_f64((frames + let_go) as f64 * frame_s);
        loop {
            let left = due.saturating_duration_since(Instant::now());
            listener.wait(left, |_, _| ());
            if left.is_zero() {
                break;
            }
        }
        let now_s = listener.now_s();
        let pose = listener.receiver().pose(now_s, STALE_S);
        let pose = filter.as_mut().map_or_else(|| pose.clone(), |(filter, state)| filter.apply(state, &pose, frame_s));
        watcher.frame(session, &pose)?;
        frames += 1;
        let behind = ((began.elapsed().as_secs_f64() / frame_s) as u64).saturating_sub(frames + let_go);
        if behind > BEHIND {
            let_go += behind;
        }
        if frames >= reported + FRAMES_PER_S as u64 {
            reported = frames;
            say!("{}; {let_go} frames let go", session.told());
        }
    }
    Ok(())
}

fn finished(session: Session, out: &Path, json: Option<&Path>) -> Result<(), String> {
    say!("{}", session.told());
    if session.is_full() {
        say!("ended after {} seconds, the longest session", hands_script::LONGEST_S);
    }
    picture::write(&out.join("hands.png"), &session)?;
    let hands = session.hands();
    write_whole(&out.join("cloth.obj"), |file| {
        hands.state.positions_m.iter().try_for_each(|p| writeln!(file, "v {:?} {:?} {:?}", p.x, p.y, p.z))?;
        hands.flat().triangles.iter().try_for_each(|[a, b, c]| writeln!(file, "f {} {} {}", a + 1, b + 1, c + 1))
    })?;
    let recorded = hands_script::written(session.recorded());
    write_whole(&out.join("session.toml"), |file| file.write_all(recorded.as_bytes()))?;
    let figures = session.figures();
    for (name, value) in &figures {
        say!("{name}: {value:.3}");
    }
    if let Some(path) = json {
        let lines: Vec<String> = figures.iter().map(|(name, value)| format!("  \"{name}\": {value:.6}")).collect();
        write_whole(path, |file| write!(file, "{{\n{}\n}}\n", lines.join(",\n")))?;
    }
    Ok(())
}

/// The cloth's hand of a script's.
fn hand_of(hand: hands_script::Hand) -> Hand {
    match hand {
        hands_script::Hand::Left => Hand::Left,
        hands_script::Hand::Right => Hand::Right,
    }
}
