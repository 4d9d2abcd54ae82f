//! Cloth under the hands: what is taken, pinned and let go, and that nothing hands do harms the cloth.

use glam::{DVec2, DVec3};
use kitsuke_drape::analytic_form;
use kitsuke_drape::body::Body;
use kitsuke_drape::drape::Settings;
use kitsuke_drape::gestures::{Gestures, Meaning, Seen};
use kitsuke_drape::hands::{Hand, Hands, HandsError, Model};
use kitsuke_drape::intersections::self_intersections;
use kitsuke_drape::parting::PartError;
use kitsuke_drape::scissors::Layers;
use kitsuke_drape::slit::Flat;
use kitsuke_drape::springs;
use kitsuke_drape::woven::Woven;
use proptest::prelude::*;

const SIDE: usize = 12;
const SPACING_M: f64 = 0.04;

fn woven() -> Model {
    Model::Woven(Woven::default(), Settings::default())
}

/// A square of 44 cm that hangs by its upper corners, its lower edge at 0.56 m.
fn hands(model: Model) -> Hands {
    let flat = Flat::rectangle(DVec2::new(-0.22, 0.0), SIDE - 1, SIDE - 1, DVec2::splat(SPACING_M));
    let positions_m: Vec<DVec3> = flat.places_m.iter().map(|at| DVec3::new(at.x, 0.56 + at.y, 0.0)).collect();
    let mut hands = Hands::new(flat, &positions_m, model, 0.08).unwrap();
    hands.upper_corners().into_iter().for_each(|corner| hands.pin_particle(corner));
    hands
}

fn steps(hands: &mut Hands, count: usize) {
    for _ in 0..count {
        hands.step(None);
    }
}

/// Greatest length of an edge by its length in the pattern and a millimetre: cuts leave edges that are shorter than that.
fn stretch(hands: &Hands) -> f64 {
    let at = |v: u32| hands.state.positions_m[v as usize];
    let edges = hands.sheet().edges().iter();
    edges.map(|edge| at(edge.ends[0]).distance(at(edge.ends[1])) / (edge.rest_m + 0.001)).fold(0.0, f64::max)
}

#[test]
fn what_is_pinched_follows_and_what_is_pinned_stays_where_it_was_chosen() {
    let mut hands = hands(woven());
    let lowest = (SIDE / 2) as u32;
    let corner = (SIDE * SIDE - SIDE) as u32;
    let [at_m, corner_m] = [lowest, corner].map(|v| hands.state.positions_m[v as usize]);
    assert_eq!((hands.candidate(Hand::Left), hands.pinch(Hand::Left)), (None, None), "a hand that was never seen");
    hands.see(Hand::Left, Some(at_m + DVec3::new(0.005, -0.01, 0.02)));
    assert_eq!(hands.candidate(Hand::Left), Some(lowest));
    assert_eq!(hands.pinch(Hand::Left), Some(lowest));
    assert_eq!(hands.candidate(Hand::Left), None, "it has one");
    // Drawn to the front and up; the particle keeps its way from the hand.
    let target_m = at_m + DVec3::new(0.05, 0.12, 0.15);
    hands.see(Hand::Left, Some(target_m + DVec3::new(0.005, -0.01, 0.02)));
    steps(&mut hands, 900);
    assert!(hands.state.positions_m[lowest as usize].distance(target_m) < 0.01);
    // The other hand takes a neighbour, not the same.
    hands.see(Hand::Right, Some(target_m));
    assert!(hands.candidate(Hand::Right).is_some_and(|particle| particle != lowest));
    assert_eq!(hands.pin(Hand::Left, None), Some(lowest));
    let pinned_m = hands.state.positions_m[lowest as usize];
    assert_eq!(hands.held(Hand::Left), None);
    // Whatever the hand does now, the pin stays.
    hands.see(Hand::Left, Some(DVec3::splat(3.0)));
    steps(&mut hands, 300);
    assert!(hands.state.positions_m[lowest as usize].distance(pinned_m) < 1e-12);
    // The nearest pinned particle is let go, and falls.
    hands.see(Hand::Right, Some(pinned_m));
    assert_eq!(hands.release(Hand::Right), Some(lowest));
    steps(&mut hands, 300);
    assert!(hands.state.positions_m[lowest as usize].y < pinned_m.y - 0.05);
    // A corner that was released can be taken again.
    hands.see(Hand::Right, Some(corner_m));
    steps(&mut hands, 300);
    assert_eq!(hands.release(Hand::Right), Some(corner));
    steps(&mut hands, 30);
    assert_eq!(hands.pinch(Hand::Right), Some(corner));
    steps(&mut hands, 300);
    assert!(hands.held(Hand::Right).is_some() && hands.state.positions_m[corner as usize].distance(corner_m) < 0.05);
}

#[test]
fn what_is_pinned_near_a_body_lies_on_it_and_who_pulls_too_far_has_nothing_left() {
    let (positions_m, triangles) = analytic_form::sphere(DVec3::new(0.0, 0.6, -0.13), 0.1, 48);
    let body = Body::new(&positions_m, &triangles).unwrap();
    let mut hands = hands(woven());
    let particle = (3 * SIDE + SIDE / 2) as u32;
    hands.see(Hand::Right, Some(hands.state.positions_m[particle as usize]));
    hands.pinch(Hand::Right).unwrap();
    hands.pin(Hand::Right, Some(&body)).unwrap();
    for _ in 0..300 {
        hands.step(Some(&body));
    }
    let near = body.signed_distance(hands.state.positions_m[particle as usize], 0.1).unwrap();
    assert!((near.distance_m - Settings::default().clearance_m).abs() < 1e-4, "{near:?}");

    let corner = hands.upper_corners()[0];
    hands.see(Hand::Left, Some(hands.state.positions_m[corner as usize]));
    assert_eq!(hands.pinch(Hand::Left), Some(corner));
    hands.see(Hand::Left, Some(DVec3::new(-2.0, 3.0, 1.0)));
    for _ in 0..600 {
        hands.step(Some(&body));
    }
    assert_eq!(hands.held(Hand::Left), None, "it slipped out");
    assert!(hands.state.positions_m.iter().all(|p| p.is_finite() && p.length() < 3.0));
}

/// A path that a hand shakes along.
fn shaking(from_m: DVec3, to_m: DVec3) -> impl Iterator<Item = DVec3> {
    (0..=40)
        .map(move |i| from_m.lerp(to_m, f64::from(i) / 40.0) + DVec3::ONE * (0.006 * libm::sin(29.0 * f64::from(i))))
}

#[test]
fn scissors_cut_straight_and_what_is_cut_off_falls() {
    for model in [woven(), Model::Springs(springs::Settings::default())] {
        let mut hands = hands(model);
        assert_eq!(hands.cut(Hand::Right, Layers::Nearest), Err(HandsError::NoPath));
        // One hand holds the lower corner while the other cuts across.
        hands.see(Hand::Left, Some(DVec3::new(-0.22, 0.56, 0.0)));
        assert_eq!(hands.pinch(Hand::Left), Some(0));
        hands.see(Hand::Right, Some(DVec3::new(-0.3, 0.85, 0.05)));
        hands.take_scissors(Hand::Right);
        assert_eq!(hands.candidate(Hand::Right), None, "a hand with scissors takes nothing");
        for place_m in shaking(DVec3::new(-0.3, 0.85, 0.05), DVec3::new(0.3, 0.75, 0.05)) {
            hands.see(Hand::Right, Some(place_m));
            hands.step(None);
        }
        let cut_m = hands.cut(Hand::Right, Layers::Nearest).unwrap();
        assert!((0.44..0.48).contains(&cut_m), "{cut_m}");
        let added = hands.flat().places_m.len() - SIDE * SIDE;
        assert!((12..40).contains(&added), "{added}");
        assert!(self_intersections(&hands.state.positions_m, hands.sheet().triangles()).is_empty());
        assert_eq!(hands.held(Hand::Left).map(|held| held.particle), Some(0), "it holds on");
        assert_eq!(hands.release(Hand::Left), Some(0));
        let seconds = if matches!(model, Model::Springs(_)) { 60 } else { 600 };
        steps(&mut hands, seconds);
        let is_upper = |v: usize| hands.flat().places_m[v].y > 0.3;
        for (v, at_m) in hands.state.positions_m.iter().enumerate() {
            assert!(
                if is_upper(v) { at_m.y > 0.6 } else { at_m.y < 0.2 || hands.flat().places_m[v].y > 0.17 },
                "{v}: {at_m}"
            );
        }
        assert_eq!(hands.cut_along(&[DVec3::splat(5.0); 2], Layers::All), Err(PartError::Misses.into()));
    }
}

#[test]
fn both_corners_move_the_cloth_and_can_be_taken_again() {
    let mut hands = hands(woven());
    assert_eq!(hands.take_corners(), None, "hands that were never seen");
    for (hand, x) in [(Hand::Left, 0.22), (Hand::Right, -0.22)] {
        hands.see(hand, Some(DVec3::new(x, 1.0, 0.03)));
    }
    let [left, right] = hands.take_corners().unwrap();
    assert!(hands.state.positions_m[left as usize].x > 0.0 && hands.state.positions_m[right as usize].x < 0.0);
    assert!(hands.pinned_m().is_empty());
    for i in 0..600 {
        for (hand, x) in [(Hand::Left, 0.22), (Hand::Right, -0.22)] {
            hands.see(hand, Some(DVec3::new(x, 1.0, 0.03 + 0.001 * f64::from(i.min(400)))));
        }
        hands.step(None);
    }
    assert!(hands.state.positions_m[left as usize].distance(DVec3::new(0.22, 1.0, 0.4)) < 0.02);
    // One goes on while the other lets go, pins, and takes the corner again.
    hands.release(Hand::Right).unwrap();
    steps(&mut hands, 100);
    assert_eq!(hands.take_corners(), Some([left, right]));
    hands.pin(Hand::Left, None).unwrap();
    assert_eq!(hands.pinned_m().len(), 1);
    let places_m: Vec<DVec3> = hands.flat().places_m.iter().map(|at| DVec3::new(at.x, 2.0, at.y)).collect();
    hands.lay(&places_m).unwrap();
    assert!(hands.pinned_m().is_empty() && hands.held(Hand::Right).is_none() && hands.state.positions_m == places_m);
    assert!(matches!(hands.lay(&places_m[1..]), Err(HandsError::Places { given: 143, particles: 144 })));
}

#[derive(Clone, Debug)]
enum Act {
    See(Hand, [f64; 3]),
    Lose(Hand),
    NotANumber(Hand),
    Pinch(Hand),
    TakeCorner(Hand, bool),
    Release(Hand),
    Pin(Hand),
    Corners,
    Scissors(Hand),
    Cut(Hand, bool),
    Step(u8),
}

fn acts() -> impl Strategy<Value = Vec<Act>> {
    let hand = || prop_oneof![Just(Hand::Left), Just(Hand::Right)];
    // Mostly near the cloth, sometimes anywhere.
    let place = prop_oneof![
        4 => [-0.3..0.3, 0.5..1.1, -0.15..0.15],
        1 => [-5.0..5.0, -5.0..5.0, -5.0..5.0],
    ];
    let act = prop_oneof![
        6 => (hand(), place).prop_map(|(hand, place)| Act::See(hand, place)),
        1 => hand().prop_map(Act::Lose),
        1 => hand().prop_map(Act::NotANumber),
        3 => hand().prop_map(Act::Pinch),
        1 => (hand(), any::<bool>()).prop_map(|(hand, right)| Act::TakeCorner(hand, right)),
        1 => hand().prop_map(Act::Release),
        2 => hand().prop_map(Act::Pin),
        1 => Just(Act::Corners),
        1 => hand().prop_map(Act::Scissors),
        1 => (hand(), any::<bool>()).prop_map(|(hand, all)| Act::Cut(hand, all)),
        8 => (1..12_u8).prop_map(Act::Step),
    ];
    prop::collection::vec(act, 1..40)
}

fn played(model: Model, acts: &[Act]) -> (Hands, f64) {
    let mut hands = hands(model);
    let mut fastest = 0.0_f64;
    for act in acts {
        match *act {
            Act::See(hand, place) => hands.see(hand, Some(DVec3::from(place))),
            Act::Lose(hand) => hands.see(hand, None),
            Act::NotANumber(hand) => hands.see(hand, Some(DVec3::new(f64::NAN, 1.0, f64::INFINITY))),
            Act::Pinch(hand) => drop(hands.pinch(hand)),
            Act::TakeCorner(hand, right) => drop(hands.take(hand, if right { SIDE as u32 - 1 } else { 0 })),
            Act::Release(hand) => drop(hands.release(hand)),
            Act::Pin(hand) => drop(hands.pin(hand, None)),
            Act::Corners => drop(hands.take_corners()),
            Act::Scissors(hand) => hands.take_scissors(hand),
            Act::Cut(hand, all) => drop(hands.cut(hand, if all { Layers::All } else { Layers::Nearest })),
            Act::Step(count) => {
                for _ in 0..count {
                    fastest = fastest.max(hands.step(None).speed_m_per_s);
                }
            }
        }
    }
    (hands, fastest)
}

/// A thousand take a minute: `PROPTEST_CASES=1000`.
fn cases() -> u32 {
    std::env::var("PROPTEST_CASES").ok().and_then(|text| text.parse().ok()).unwrap_or(64)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(), ..ProptestConfig::default() })]

    #[test]
    fn whatever_hands_do_cloth_is_whole_and_played_again_the_same(acts in acts()) {
        let (hands, fastest) = played(woven(), &acts);
        prop_assert!(hands.state.positions_m.iter().all(|p| p.is_finite()));
        // It falls at most all the time, and hands throw it half as fast again as they go.
        let steps: f64 = acts.iter().map(|act| if let Act::Step(count) = act { f64::from(*count) } else { 0.0 }).sum();
        prop_assert!(fastest < 9.81 * steps / 600.0 + 4.5, "{fastest}");
        prop_assert!(stretch(&hands) < 1.5, "{}", stretch(&hands));
        prop_assert!(self_intersections(&hands.state.positions_m, hands.sheet().triangles()).is_empty());
        prop_assert!(played(woven(), &acts).0.state == hands.state);
    }

    #[test]
    fn springs_do_not_explode_either(acts in acts()) {
        let model = Model::Springs(springs::Settings::default());
        let (hands, fastest) = played(model, &acts);
        prop_assert!(hands.state.positions_m.iter().all(|p| p.is_finite()));
        let steps: f64 = acts.iter().map(|act| if let Act::Step(count) = act { f64::from(*count) } else { 0.0 }).sum();
        prop_assert!(fastest < 9.81 * steps / 60.0 + 4.5, "{fastest}");
        prop_assert!(played(model, &acts).0.state == hands.state);
    }
}

#[test]
fn one_person_takes_pins_cuts_and_lets_go_with_the_hands_alone() {
    let mut hands = hands(woven());
    let mut gestures = Gestures::default();
    let (positions_m, triangles) = analytic_form::sphere(DVec3::new(0.0, 0.58, 0.3), 0.1, 24);
    let wall = Body::new(&positions_m, &triangles).unwrap();
    let up = Seen { place_m: Some(DVec3::new(0.3, 1.9, 0.3)), is_raised: true, is_closed: None };
    let down = Seen { place_m: Some(DVec3::new(0.5, 0.8, 0.4)), ..Seen::default() };
    // The right hand trembles at one place for a second, with the left one somewhere.
    let mut stay = |hands: &mut Hands, at_m: DVec3, left: Seen| {
        let mut meant = Vec::new();
        for i in 0..60 {
            let place_m = at_m + DVec3::splat(0.005 * libm::sin(f64::from(i)));
            hands.see(Hand::Right, Some(place_m));
            let right = Seen { place_m: Some(place_m), ..Seen::default() };
            for (hand, meaning) in gestures.see([left, right], 1.0 / 60.0, hands, Some(&wall)) {
                assert_eq!(hand, Hand::Right);
                match meaning {
                    Meaning::Pinch => drop(hands.pinch(hand)),
                    Meaning::Release => drop(hands.release(hand)),
                    Meaning::Pin => drop(hands.pin(hand, None)),
                    Meaning::Scissors => hands.take_scissors(hand),
                    Meaning::Cut => drop(hands.cut(hand, Layers::Nearest).unwrap()),
                }
                meant.push(meaning);
            }
            steps(hands, 10);
        }
        meant
    };
    let on_m = DVec3::new(0.0, 0.58, 0.01);
    assert_eq!(stay(&mut hands, on_m, down), [Meaning::Pinch]);
    assert_eq!(stay(&mut hands, on_m, down), [], "it has to go away first");
    assert_eq!(stay(&mut hands, on_m + DVec3::new(0.15, 0.0, 0.1), down), [], "no body there");
    assert_eq!(stay(&mut hands, on_m + DVec3::Z * 0.15, down), [Meaning::Pin]);
    assert_eq!((hands.pinned_m().len(), hands.held(Hand::Right)), (3, None));
    assert_eq!(stay(&mut hands, DVec3::new(0.6, 0.9, 0.5), down), [], "nothing to take");
    // Scissors, across, and away.
    assert_eq!(stay(&mut hands, DVec3::new(-0.3, 0.8, 0.04), up), [Meaning::Scissors]);
    for place_m in shaking(DVec3::new(-0.3, 0.8, 0.04), DVec3::new(0.3, 0.8, 0.04)) {
        hands.see(Hand::Right, Some(place_m));
    }
    assert_eq!(stay(&mut hands, DVec3::new(0.3, 0.8, 0.04), down), [Meaning::Cut]);
    assert!(hands.flat().places_m.len() > SIDE * SIDE + 10);
    // Takes a corner and lets it fall.
    assert_eq!(stay(&mut hands, DVec3::new(0.22, 1.0, 0.0), down), [Meaning::Pinch]);
    assert_eq!(stay(&mut hands, DVec3::new(0.1, 1.0, 0.05), up), [Meaning::Release]);
    // Grips and opens.
    let mut seen = Seen { place_m: Some(DVec3::new(-0.22, 1.0, 0.0)), is_closed: Some(false), is_raised: false };
    hands.see(Hand::Left, seen.place_m);
    let mut gestures = Gestures::default();
    assert_eq!(gestures.see([seen, Seen::default()], 0.1, &hands, None), []);
    seen.is_closed = Some(true);
    assert_eq!(gestures.see([seen, Seen::default()], 0.1, &hands, None), [(Hand::Left, Meaning::Pinch)]);
    hands.pinch(Hand::Left).unwrap();
    seen.is_closed = None;
    assert_eq!(gestures.see([Seen { place_m: None, ..seen }, Seen::default()], 0.1, &hands, None), [], "lost");
    seen.is_closed = Some(false);
    assert_eq!(gestures.see([seen, Seen::default()], 0.1, &hands, None), [(Hand::Left, Meaning::Release)]);
}
