//! Cloth under the hands: what is taken, pinned and let go, and that nothing hands do harms the cloth.

use glam::DVec3;
use kitsuke_drape::analytic_form;
use kitsuke_drape::body::Body;
use kitsuke_drape::drape::Settings;
use kitsuke_drape::hands::{Hand, Hands};
use kitsuke_drape::intersections::self_intersections;
use kitsuke_drape::sheet::{Grid, Sheet};
use kitsuke_drape::woven::Woven;
use proptest::prelude::*;

const SIDE: usize = 12;
const SPACING_M: f64 = 0.04;

/// A square of 44 cm that hangs by its upper corners, its lower edge at 0.56 m.
fn sheet() -> Sheet {
    let grid = Grid {
        rows: SIDE,
        columns: SIDE,
        spacing_m: SPACING_M,
        corner_m: DVec3::new(-0.22, 1.0, 0.0),
        weft: DVec3::X,
        warp: DVec3::NEG_Y,
    };
    let mut sheet = Sheet::from_grid(&grid).unwrap();
    for corner in [0, SIDE - 1] {
        let at_m = sheet.positions_m()[corner];
        sheet.pin(corner as u32, at_m).unwrap();
    }
    sheet
}

fn hands(sheet: &Sheet) -> Hands {
    Hands::new(sheet, &Woven::default(), &Settings::default(), 0.08).unwrap()
}

fn steps(hands: &mut Hands, count: usize) {
    for _ in 0..count {
        hands.step(None);
    }
}

/// Greatest length of an edge by its length in the pattern.
fn stretch(sheet: &Sheet, hands: &Hands) -> f64 {
    let at = |v: u32| hands.state.positions_m[v as usize];
    sheet.edges().iter().map(|edge| at(edge.ends[0]).distance(at(edge.ends[1])) / edge.rest_m).fold(0.0, f64::max)
}

#[test]
fn what_is_pinched_follows_and_what_is_pinned_stays_where_it_was_chosen() {
    let sheet = sheet();
    let mut hands = hands(&sheet);
    let lowest = (SIDE * SIDE - SIDE / 2) as u32;
    let at_m = sheet.positions_m()[lowest as usize];
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
    hands.see(Hand::Right, Some(sheet.positions_m()[0]));
    steps(&mut hands, 300);
    assert_eq!(hands.release(Hand::Right), Some(0));
    steps(&mut hands, 30);
    assert_eq!(hands.pinch(Hand::Right), Some(0));
    steps(&mut hands, 300);
    assert!(hands.held(Hand::Right).is_some() && hands.state.positions_m[0].distance(sheet.positions_m()[0]) < 0.05);
}

#[test]
fn what_is_pinned_near_a_body_lies_on_it_and_who_pulls_too_far_has_nothing_left() {
    let sheet = sheet();
    let (positions_m, triangles) = analytic_form::sphere(DVec3::new(0.0, 0.6, -0.13), 0.1, 48);
    let body = Body::new(&positions_m, &triangles).unwrap();
    let mut hands = hands(&sheet);
    let particle = (8 * SIDE + SIDE / 2) as u32;
    hands.see(Hand::Right, Some(sheet.positions_m()[particle as usize]));
    hands.pinch(Hand::Right).unwrap();
    hands.pin(Hand::Right, Some(&body)).unwrap();
    for _ in 0..300 {
        hands.step(Some(&body));
    }
    let near = body.signed_distance(hands.state.positions_m[particle as usize], 0.1).unwrap();
    assert!((near.distance_m - Settings::default().clearance_m).abs() < 1e-4, "{near:?}");

    hands.see(Hand::Left, Some(hands.state.positions_m[0]));
    assert_eq!(hands.pinch(Hand::Left), Some(0));
    hands.see(Hand::Left, Some(DVec3::new(-2.0, 3.0, 1.0)));
    for _ in 0..600 {
        hands.step(Some(&body));
    }
    assert_eq!(hands.held(Hand::Left), None, "it slipped out");
    assert!(hands.state.positions_m.iter().all(|p| p.is_finite() && p.length() < 3.0));
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
        8 => (1..12_u8).prop_map(Act::Step),
    ];
    prop::collection::vec(act, 1..40)
}

fn played(sheet: &Sheet, acts: &[Act]) -> (Hands, f64) {
    let mut hands = hands(sheet);
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
        let sheet = sheet();
        let (hands, fastest) = played(&sheet, &acts);
        prop_assert!(hands.state.positions_m.iter().all(|p| p.is_finite()));
        // It falls at most all the time, and no hand throws it.
        let steps: f64 = acts.iter().map(|act| if let Act::Step(count) = act { f64::from(*count) } else { 0.0 }).sum();
        prop_assert!(fastest < 9.81 * steps / 600.0 + 3.0, "{fastest}");
        prop_assert!(stretch(&sheet, &hands) < 1.5, "{}", stretch(&sheet, &hands));
        prop_assert!(self_intersections(&hands.state.positions_m, sheet.triangles()).is_empty());
        prop_assert!(played(&sheet, &acts).0.state == hands.state);
    }
}
