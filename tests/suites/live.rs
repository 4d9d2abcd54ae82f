//! Live poses: the VMC protocol, packets of every kind, the socket, and what comes from one end to the other.

use glam::{DQuat, Quat};
use kitsuke::skeleton::osc::{self, Argument};
use kitsuke::skeleton::vmc::{self, Receiver};
use kitsuke::skeleton::{Bone, Pose, RestPose, Tracked, vrma};
use kitsuke_live::{Listener, Settings};
use kitsuke_tests::motions::{self, DANCE_FRAME_S, apart_deg, dance, wearer};
use proptest::prelude::*;
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

const LOOPBACK: SocketAddr = SocketAddr::new(IpAddr::V4(std::net::Ipv4Addr::LOCALHOST), 0);

/// Every pose that a receiver makes of datagrams that come 60 times a second.
fn received(receiver: &mut Receiver, frames: impl Iterator<Item = Vec<Vec<u8>>>) -> Vec<Tracked> {
    let mut poses = Vec::new();
    for (i, datagrams) in frames.enumerate() {
        for datagram in datagrams {
            receiver.datagram(&datagram, i as f64 * DANCE_FRAME_S, |pose| poses.push(pose.clone()));
        }
    }
    poses
}

fn farthest_deg(found: &[Tracked], expected: &[Pose]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let apart = |(found, expected): (&Tracked, &Pose)| {
        let joints = wearer();
        let bones = joints.joints().iter().map(|joint| joint.bone);
        bones.map(|bone| apart_deg(found.pose.rotation(bone), expected.rotation(bone))).fold(0.0, f64::max)
    };
    found.iter().zip(expected).map(apart).fold(0.0, f64::max)
}

#[test]
fn a_motion_sent_is_the_motion_received() {
    let (wearer, poses) = (wearer(), dance());
    let frames = poses.iter().zip(0..).map(|(pose, i)| vmc::datagrams(pose, &wearer, i as f32 / 60.0));
    let mut receiver = Receiver::new(&wearer);
    let found = received(&mut receiver, frames);
    let apart_deg = farthest_deg(&found, &poses);
    println!("VMC: {apart_deg:.6}°");
    assert!(apart_deg < 0.01, "{apart_deg}° apart");
    for (found, expected) in found.iter().zip(&poses) {
        let moved_m = expected.hips_translation_m - poses[0].hips_translation_m;
        assert!(found.pose.hips_translation_m.distance(moved_m) < 1e-5);
        assert!(wearer.joints().iter().all(|joint| found.confidence[joint.bone as usize] == 1.0));
    }
    let counters = receiver.counters();
    assert_eq!((counters.poses, counters.missing_poses, counters.lost_bones, counters.malformed), (240, 0, 0, 0));
}

/// The bundle of a frame as a sender writes it whose bones have these local rotations, in Unity's axes.
fn raw_frame(bones: &[(String, DQuat)], time: Option<f32>, time_comes_first: bool) -> Vec<u8> {
    let mut out = Vec::new();
    osc::write_bundle_head(&mut out);
    let write_time = |out: &mut Vec<u8>| {
        if let Some(time_s) = time {
            osc::write_element(out, "/VMC/Ext/T", &[Argument::Float(time_s)]);
        }
    };
    if time_comes_first {
        write_time(&mut out);
    }
    for (name, q) in bones {
        let numbers = [0.0, 0.8, 0.0, q.x as f32, -q.y as f32, -q.z as f32, q.w as f32].map(Argument::Float);
        let arguments: Vec<Argument<'_>> = std::iter::once(Argument::Text(name)).chain(numbers).collect();
        osc::write_element(&mut out, "/VMC/Ext/Bone/Pos", &arguments);
    }
    if !time_comes_first {
        write_time(&mut out);
    }
    out
}

fn raw_bones(rest: &[DQuat], pose: &Pose) -> Vec<(String, DQuat)> {
    let wearer = wearer();
    let name = |bone: Bone| bone.name()[..1].to_uppercase() + &bone.name()[1..];
    let raw = motions::raw_rotations(&wearer, rest, pose);
    wearer.joints().iter().zip(raw).map(|(joint, raw)| (name(joint.bone), raw)).collect()
}

#[test]
fn raw_rotations_are_normalised_by_the_model_or_by_a_t_pose() {
    let (wearer, poses) = (wearer(), dance());
    let odd = motions::odd_rest(&wearer);
    let frame = |pose: &Pose, i: usize| vec![raw_frame(&raw_bones(&odd, pose), Some(i as f32 / 60.0), false)];
    let frames = || poses.iter().zip(1..).map(|(pose, i)| frame(pose, i));
    let rest = vrma::read_rest(&motions::vrma(&wearer, &poses[..2], &odd)).unwrap();
    let mut by_model = Receiver::new(&wearer);
    by_model.set_rest(rest);
    assert!(farthest_deg(&received(&mut by_model, frames()), &poses) < 0.01);

    let mut by_t_pose = Receiver::new(&wearer);
    assert!(!by_t_pose.calibrate(), "nothing has come yet");
    received(&mut by_t_pose, std::iter::once(frame(&Pose::REST, 0)));
    assert!(by_t_pose.calibrate());
    assert!(farthest_deg(&received(&mut by_t_pose, frames()), &poses) < 0.01);

    let mut as_it_comes = Receiver::new(&wearer);
    assert!(farthest_deg(&received(&mut as_it_comes, frames()), &poses) > 90.0);
}

#[test]
fn poses_are_whole_whatever_the_order() {
    let (wearer, poses) = (wearer(), dance());
    let identity = vec![DQuat::IDENTITY; wearer.joints().len()];
    for (name, has_time, first, delay) in
        [("time last", true, false, 0), ("time first", true, true, 1), ("no time", false, false, 1)]
    {
        let time = |i: usize| has_time.then_some(i as f32 / 60.0);
        // One bone per datagram: the sender does not bundle.
        let frames = poses.iter().enumerate().map(|(i, pose)| {
            let bones = raw_bones(&identity, pose);
            let mut one_by_one: Vec<Vec<u8>> = bones.chunks(1).map(|bone| raw_frame(bone, None, false)).collect();
            let at = if first { 0 } else { one_by_one.len() };
            one_by_one.insert(at, raw_frame(&[], time(i), false));
            one_by_one
        });
        let mut receiver = Receiver::new(&wearer);
        let found = received(&mut receiver, frames);
        assert!(farthest_deg(&found, &poses[..poses.len() - delay]) < 0.01, "{name}");
        assert_eq!(receiver.counters().lost_bones, 0, "{name}");
    }
}

#[test]
fn what_is_lost_is_counted_and_held() {
    let (wearer, poses) = (wearer(), dance());
    let mut receiver = Receiver::new(&wearer);
    let sent = poses.iter().zip(0_usize..).filter(|(_, i)| i % 50 != 20);
    received(&mut receiver, sent.map(|(pose, i)| vmc::datagrams(pose, &wearer, i as f32 / 60.0)));
    assert_eq!(receiver.counters().missing_poses, 5, "frames 20, 70, 120, 170 and 220");
    let bones = raw_bones(&vec![DQuat::IDENTITY; 20], &poses[0]);
    let without_head: Vec<_> = bones.iter().filter(|(name, _)| name != "Head").cloned().collect();
    let before = receiver.pose(4.0, 0.5);
    receiver.datagram(&raw_frame(&without_head, Some(4.0), false), 4.0, |_| ());
    let after = receiver.pose(4.0, 0.5);
    assert_eq!(receiver.counters().lost_bones, 1);
    assert_eq!((before.confidence[Bone::Head as usize], after.confidence[Bone::Head as usize]), (1.0, 0.5));
    assert!(apart_deg(after.pose.rotation(Bone::Head), before.pose.rotation(Bone::Head)) < 0.01);
    // Too long without a pose: it is held, but nobody is there.
    let stale = receiver.pose(5.0, 0.5);
    assert_eq!((stale.pose == after.pose, stale.confidence), (true, [0.0; Bone::COUNT]));
    assert!((receiver.age_s(5.0) - 1.0).abs() < 1e-9);
}

/// Times of a sender, all of whose poses arrive, and how many it seems to have left out.
#[test]
fn a_sender_without_a_steady_pace_loses_nothing() {
    let (wearer, poses) = (wearer(), dance());
    let missing = |intervals_s: &mut dyn FnMut(usize) -> f64| {
        let mut receiver = Receiver::new(&wearer);
        let mut time_s = 1000.0;
        let frames = poses.iter().enumerate().map(|(i, pose)| {
            time_s += intervals_s(i);
            vmc::datagrams(pose, &wearer, time_s as f32)
        });
        assert_eq!(received(&mut receiver, frames).len(), poses.len());
        receiver.counters().missing_poses
    };
    let mut random = Hostile::new(3);
    assert_eq!(missing(&mut |_| 0.02 + 0.04 * random.below(1000) as f64 / 1000.0), 0, "20 to 60 ms");
    assert_eq!(missing(&mut |i| if i % 3 == 2 { 0.067 } else { 0.033 }), 0, "a camera that often needs twice as long");
    let slower = missing(&mut |i| if i < 100 { 1.0 / 60.0 } else { 1.0 / 30.0 });
    assert!(slower <= 4, "half the rate from now on, not {slower} poses lost");
    assert_eq!(
        missing(&mut |i| if i % 60 == 59 { 3.0 / 60.0 } else { 1.0 / 60.0 }),
        8,
        "two of 60 left out, four times"
    );
}

#[test]
fn thumbs_move_one_bone_up_and_names_are_exact() {
    let mut receiver = Receiver::new(&wearer());
    let turn = DQuat::from_rotation_y(0.5);
    let names = ["Hips", "LeftThumbProximal", "leftHand", "LastBone", "Left", ""];
    receiver.datagram(&raw_frame(&names.map(|name| (name.to_owned(), turn)), Some(0.0), false), 0.0, |_| ());
    let pose = receiver.pose(0.0, 1.0);
    let seen: Vec<Bone> = Bone::ALL.into_iter().filter(|&bone| pose.confidence[bone as usize] > 0.0).collect();
    assert_eq!(seen, [Bone::Hips, Bone::LeftThumbMetacarpal]);
    assert_eq!((receiver.counters().messages, receiver.counters().ignored), (3, 4));
}

#[test]
fn numbers_that_cannot_be_are_ignored() {
    let good = [0.0, 0.8, 0.0, 0.0, 0.0, 0.0, 1.0_f32];
    for (at, bad) in
        [(0, f32::NAN), (1, 101.0), (2, f32::INFINITY), (3, f32::NAN), (6, 0.0), (5, f32::MAX), (4, -f32::INFINITY)]
    {
        let mut numbers = good;
        numbers[at] = bad;
        let mut out = Vec::new();
        let mut arguments = vec![Argument::Text("Hips")];
        arguments.extend(numbers.map(Argument::Float));
        osc::write_message(&mut out, "/VMC/Ext/Bone/Pos", &arguments);
        let mut receiver = Receiver::new(&wearer());
        receiver.datagram(&out, 0.0, |_| panic!("no pose"));
        assert_eq!((receiver.counters().malformed, receiver.counters().messages), (1, 0), "{at}: {bad}");
    }
    for arguments in [&[][..], &[Argument::Text("Hips")], &[Argument::Int(1); 8], &[Argument::Float(1.0); 9]] {
        let mut out = Vec::new();
        osc::write_message(&mut out, "/VMC/Ext/Bone/Pos", arguments);
        let mut receiver = Receiver::new(&wearer());
        receiver.datagram(&out, 0.0, |_| panic!("no pose"));
        assert_eq!(receiver.counters().malformed, 1, "{arguments:?}");
    }
}

/// A small generator of bad packets: the same for the same seed.
struct Hostile {
    state: u64,
    valid: Vec<Vec<u8>>,
}

impl Hostile {
    fn new(seed: u64) -> Hostile {
        let wearer = wearer();
        let valid =
            dance().iter().step_by(24).zip(0..).flat_map(|(p, i)| vmc::datagrams(p, &wearer, i as f32)).collect();
        Hostile { state: seed, valid }
    }

    fn next(&mut self) -> u64 {
        // splitmix64
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.state ^ (self.state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }

    fn bytes(&mut self, length: usize) -> Vec<u8> {
        (0..length).map(|_| self.next() as u8).collect()
    }

    fn datagram(&mut self) -> Vec<u8> {
        let pick = self.below(self.valid.len());
        let mut datagram = self.valid[pick].clone();
        match self.below(8) {
            0 => {
                let length = self.below(600);
                self.bytes(length)
            }
            // A valid packet with some bytes changed.
            1 | 2 => {
                for _ in 0..=self.below(8) {
                    let at = self.below(datagram.len());
                    datagram[at] = self.next() as u8;
                }
                datagram
            }
            3 => {
                datagram.truncate(self.below(datagram.len()));
                datagram
            }
            // Bundles in bundles.
            4 => {
                let mut inner = datagram;
                for _ in 0..self.below(60) {
                    let mut outer = Vec::new();
                    osc::write_bundle_head(&mut outer);
                    outer.extend((inner.len() as u32).to_be_bytes());
                    outer.extend(inner);
                    inner = outer;
                }
                inner
            }
            // Numbers that are none.
            5 => {
                let kinds = [f32::NAN, f32::INFINITY, -0.0, f32::MAX, f32::MIN_POSITIVE, 1e-30];
                let numbers = [0; 7].map(|_| Argument::Float(kinds[self.below(kinds.len())]));
                let arguments: Vec<_> = std::iter::once(Argument::Text("Hips")).chain(numbers).collect();
                let mut out = Vec::new();
                osc::write_message(&mut out, ["/VMC/Ext/Bone/Pos", "/VMC/Ext/Root/Pos"][self.below(2)], &arguments);
                out
            }
            // Huge counts: an element or a blob that claims to be enormous, thousands of type tags.
            6 => {
                let at = 16 + self.below(4);
                let end = (at + 4).min(datagram.len());
                datagram[at..end].fill(0xff);
                datagram
            }
            _ => {
                let tags: String =
                    std::iter::once(',').chain((0..self.below(4000)).map(|i| ['[', 'b', 'f', 's'][i % 4])).collect();
                let mut out = b"/VMC/Ext/T\0\0".to_vec();
                out.extend(tags.as_bytes());
                let padding = self.below(9);
                out.extend(vec![0; padding]);
                out
            }
        }
    }
}

/// Hostile datagrams, every hundredth followed by a whole valid pose that must arrive as it was sent.
fn soak(count: usize) {
    let (wearer, poses) = (wearer(), dance());
    let mut hostile = Hostile::new(7);
    let mut receiver = Receiver::new(&wearer);
    let (mut now_s, mut arrived, mut sent) = (0.0, 0, 0);
    for i in 0..count {
        now_s += 1e-4;
        let datagram = hostile.datagram();
        receiver.datagram(&datagram, now_s, |tracked| assert!(tracked.pose.is_valid()));
        if i % 100 == 99 {
            let pose = &poses[i / 100 % poses.len()];
            let mut last = None;
            for datagram in vmc::datagrams(pose, &wearer, i as f32 * 1e-3) {
                receiver.datagram(&datagram, now_s, |tracked| last = Some(tracked.clone()));
            }
            sent += 1;
            arrived += usize::from(last.is_some_and(|last| farthest_deg(&[last], std::slice::from_ref(pose)) < 0.01));
        }
    }
    let counters = receiver.counters();
    println!("{count} hostile datagrams: {counters:?}; {arrived} of {sent} valid poses arrived");
    assert_eq!(arrived, sent);
    assert!(counters.malformed > count as u64 / 4);
}

#[test]
fn hostile_datagrams_do_no_harm() {
    soak(20_000);
}

/// The same for longer, in a process of its own, whose memory no other test uses.
#[test]
fn a_million_hostile_datagrams_do_no_harm() {
    const NAME: &str = "live::a_million_hostile_datagrams_do_no_harm";
    const ALONE: &str = "KITSUKE_SOAK_ALONE";
    if std::env::var_os(ALONE).is_none() {
        let mut child = std::process::Command::new(std::env::current_exe().unwrap());
        let output = child.args(["--exact", NAME, "--nocapture"]).env(ALONE, "1").output().unwrap();
        let (said, failed) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        println!("{said}");
        assert!(output.status.success() && said.contains("1 passed"), "{failed}");
        return;
    }
    let resident_kb = || {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"));
        line.and_then(|line| line.split_whitespace().next()?.parse::<i64>().ok()).unwrap_or(0)
    };
    soak(20_000);
    let before_kb = resident_kb();
    let start = Instant::now();
    soak(1_000_000);
    let grown_kb = resident_kb() - before_kb;
    println!("{:.1} s, resident memory grew by {grown_kb} kB", start.elapsed().as_secs_f64());
    assert!(grown_kb < 1024, "memory grew by {grown_kb} kB");
}

proptest! {
    #[test]
    fn any_bytes_are_read_to_their_end(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let parts = osc::parts(&bytes).take(1000).count();
        prop_assert!(parts <= osc::MOST_MESSAGES + 1);
    }
}

/// Receives until so many poses have come, or half a second has passed without one.
fn listen(listener: &mut Listener, count: usize) -> Vec<Tracked> {
    let (mut poses, mut last) = (Vec::new(), Instant::now());
    while poses.len() < count && last.elapsed() < Duration::from_millis(500) {
        listener.wait(Duration::from_millis(50), |pose, _| {
            poses.push(pose.clone());
            last = Instant::now();
        });
    }
    poses
}

#[test]
fn a_wait_may_end_between_the_datagrams_of_a_pose() {
    let (wearer, poses) = (wearer(), dance());
    let settings = Settings { address: LOOPBACK, ..Settings::default() };
    let mut listener = Listener::new(&settings, &wearer).unwrap();
    let (sender, address) = (UdpSocket::bind(LOOPBACK).unwrap(), listener.address().unwrap());
    let datagrams = vmc::datagrams(&poses[7], &wearer, 1.0);
    assert_eq!(datagrams.len(), 2);
    let mut came = Vec::new();
    for datagram in &datagrams {
        sender.send_to(datagram, address).unwrap();
        let before = came.len();
        listener.wait(Duration::from_secs(1), |pose, _| came.push(pose.clone()));
        assert!(came.len() == before || datagram == &datagrams[1]);
    }
    assert!(farthest_deg(&came, &poses[7..8]) < 0.01);
}

#[test]
fn the_socket_hands_on_what_comes_and_only_from_its_source() {
    let (wearer, poses) = (wearer(), dance());
    let settings = |source: Option<IpAddr>| Settings { address: LOOPBACK, source, ..Settings::default() };
    let sender = UdpSocket::bind(LOOPBACK).unwrap();
    let send = |listener: &Listener| {
        let address = listener.address().unwrap();
        sender.send_to(&[0xff; 60_000], address).unwrap();
        sender.send_to(&[], address).unwrap();
        for datagram in vmc::datagrams(&poses[7], &wearer, 1.0) {
            sender.send_to(&datagram, address).unwrap();
        }
    };
    let mut open = Listener::new(&settings(None), &wearer).unwrap();
    send(&open);
    assert!(farthest_deg(&listen(&mut open, 1), &poses[7..8]) < 0.01);
    assert_eq!((open.receiver().counters().malformed, open.foreign_datagrams()), (2, 0));

    let mut pinned = Listener::new(&settings(Some("127.0.0.9".parse().unwrap())), &wearer).unwrap();
    send(&pinned);
    assert_eq!(listen(&mut pinned, 1), []);
    let sent = 2 + vmc::datagrams(&poses[7], &wearer, 1.0).len() as u64;
    assert_eq!((pinned.receiver().counters().datagrams, pinned.foreign_datagrams()), (0, sent));

    let taken = Settings { address: open.address().unwrap(), ..Settings::default() };
    let error = Listener::new(&taken, &wearer).unwrap_err().to_string();
    assert!(error.contains("cannot listen at 127.0.0.1:") && error.contains("another program"), "{error}");
    // An address that is set aside for documentation, so that no machine has it.
    let elsewhere = Settings { address: "192.0.2.1:39540".parse().unwrap(), ..Settings::default() };
    let error = Listener::new(&elsewhere, &wearer).unwrap_err().to_string();
    assert!(error.contains("no such address") && !error.contains("another program"), "{error}");
}

#[test]
fn addresses_are_read_as_people_write_them() {
    for text in ["127.0.0.1:39540", "localhost:39540", "39540", " 39540 "] {
        assert_eq!(kitsuke_live::address(text), Ok("127.0.0.1:39540".parse().unwrap()), "{text}");
    }
    assert_eq!(kitsuke_live::address("[::1]:39540"), Ok("[::1]:39540".parse().unwrap()));
    for text in ["", "localhost", "127.0.0.1", ":39540", "127.0.0.1:70000", "70000"] {
        let error = kitsuke_live::address(text).unwrap_err();
        assert!(error.contains("for example 127.0.0.1:39540"), "{text}: {error}");
    }
}

/// A sender at 120 Hz on a thread of its own, the kimono evaluated for every pose; the time from before a pose is sent until its
/// cloth is there. The sample's pack where it is built, else the small garment.
#[test]
#[ignore = "timed, and takes ten seconds"]
fn poses_at_120_hz_are_cloth_within_a_frame() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../catalog/packs/komon.kitsuke");
    let pack = std::fs::read(&path).ok().and_then(|bytes| kitsuke::Pack::open(&bytes).ok());
    let small = kitsuke_tests::small_garment();
    let garment = pack.as_ref().map_or(&small, kitsuke::Pack::garment);
    let skeleton = garment.data().skeleton.clone();
    let settings = Settings { address: LOOPBACK, ..Settings::default() };
    let mut listener = Listener::new(&settings, &skeleton).unwrap();
    let address = listener.address().unwrap();
    let frame = Duration::from_secs_f64(1.0 / 120.0);
    let sender = std::thread::spawn(move || {
        let socket = UdpSocket::bind(LOOPBACK).unwrap();
        let (poses, start) = (dance(), Instant::now());
        let send = |i: u32| {
            std::thread::sleep((frame * i).saturating_sub(start.elapsed()));
            let sent = Instant::now();
            for datagram in vmc::datagrams(&poses[i as usize % poses.len()], &skeleton, i as f32 / 120.0) {
                socket.send_to(&datagram, address).unwrap();
            }
            sent
        };
        (0..1200).map(send).collect::<Vec<Instant>>()
    });
    let mut scratch = kitsuke::Scratch::new(garment);
    let mut positions_m = vec![glam::Vec3::ZERO; garment.vertex_count()];
    let mut normals = positions_m.clone();
    let mut done = Vec::new();
    let mut last = Instant::now();
    while done.len() < 1200 {
        // A wait may end between the two datagrams of a pose.
        listener.wait(Duration::from_secs(1), |tracked, _| {
            let frame = kitsuke::Frame { positions_m: &mut positions_m, normals: &mut normals };
            kitsuke::evaluate(garment, &tracked.pose, &mut scratch, frame);
            last = Instant::now();
            done.push(last);
        });
        assert!(last.elapsed() < Duration::from_secs(2), "{} of 1200 poses came", done.len());
    }
    let sent = sender.join().unwrap();
    let mut latencies: Vec<Duration> = done.iter().zip(&sent).map(|(done, sent)| *done - *sent).collect();
    let within = latencies.iter().filter(|&&latency| latency <= frame).count();
    latencies.sort();
    println!(
        "{} vertices: {within} of 1200 poses within a frame; latency median {:?}, 99 % {:?}, longest {:?}",
        garment.vertex_count(),
        latencies[600],
        latencies[1188],
        latencies[1199]
    );
    assert!(within * 1000 >= 1200 * 999);
}

#[test]
fn rest_poses_that_are_no_rotation_change_nothing() {
    let (wearer, poses) = (wearer(), dance());
    let frames = || poses[..9].iter().zip(0..).map(|(pose, i)| vmc::datagrams(pose, &wearer, i as f32 / 60.0));
    let mut plain = Receiver::new(&wearer);
    let mut set = Receiver::new(&wearer);
    set.set_rest(RestPose::NORMALISED);
    assert_eq!(received(&mut plain, frames()), received(&mut set, frames()));
    assert_eq!(plain.pose(1.0, 9.0).pose.rotation(Bone::Jaw), Quat::IDENTITY);
}
