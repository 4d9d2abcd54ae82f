//! A wearer's skeleton as two hands before the cloth, and what they mean as acts. Knows no cloth.

use glam::{Affine3A, DVec3, Vec3};
use kitsuke::skeleton::{Bone, Skeleton, Tracked};
use kitsuke_drape::gestures::{Meaning, Seen};
use kitsuke_drape::hands::Hand;
use kitsuke_pipeline::source::hands_script::{self, Act};

/// How far the wearer stands before the origin, where a body would stand, and looks at it, metres.
const STANDS_M: f64 = 0.75;
/// From the wrist to the palm, metres.
const PALM_M: f32 = 0.08;
/// Bones that are seen worse are not seen.
const LEAST_CONFIDENCE: f32 = 0.3;
/// Fingers that bend farther make a closed hand, radians.
const CLOSED_RAD: f32 = 0.7;

/// What is seen of the left and the right hand.
pub fn seen(wearer: &Skeleton, tracked: &Tracked) -> [Seen; 2] {
    let mut posed_from_rest = vec![Affine3A::IDENTITY; wearer.frame_count()];
    wearer.posed_from_rest(&tracked.pose, &mut posed_from_rest);
    let place_m =
        |bone: Bone, rest_m: Vec3| wearer.index_of(bone).map(|index| posed_from_rest[index].transform_point3(rest_m));
    let head_m = wearer.rest_m(Bone::Head).and_then(|rest_m| place_m(Bone::Head, rest_m));
    [
        (Bone::LeftLowerArm, Bone::LeftHand, Bone::LeftMiddleProximal),
        (Bone::RightLowerArm, Bone::RightHand, Bone::RightMiddleProximal),
    ]
    .map(|(arm, hand, finger)| {
        let confidence = |bone: Bone| tracked.confidence[bone as usize];
        // A hand that does not turn by itself is seen by its arm.
        if confidence(arm).max(confidence(hand)) < LEAST_CONFIDENCE {
            return Seen::default();
        }
        let palm_m = wearer.rest_m(hand).zip(wearer.rest_m(arm)).and_then(|(hand_m, arm_m)| {
            let palm_m = hand_m + (hand_m - arm_m).normalize_or_zero() * PALM_M;
            place_m(hand, palm_m).or_else(|| place_m(arm, palm_m))
        });
        let bend_rad = tracked.pose.rotation(finger).to_axis_angle().1.abs();
        Seen {
            place_m: palm_m.map(|at_m| faced(at_m.as_dvec3())),
            is_closed: (confidence(finger) >= LEAST_CONFIDENCE).then_some(bend_rad > CLOSED_RAD),
            is_raised: palm_m.zip(head_m).is_some_and(|(palm_m, head_m)| palm_m.y > head_m.y + 0.1),
        }
    })
}

/// From the wearer's place, who looks along Z, to before the origin, looking at it.
fn faced(wearer_m: DVec3) -> DVec3 {
    DVec3::new(-wearer_m.x, wearer_m.y, STANDS_M - wearer_m.z)
}

/// The act of a meaning.
pub fn act(hand: Hand, meaning: Meaning) -> Act {
    let hand = match hand {
        Hand::Left => hands_script::Hand::Left,
        Hand::Right => hands_script::Hand::Right,
    };
    match meaning {
        Meaning::Pinch => Act::Pinch(hand),
        Meaning::Release => Act::Release(hand),
        Meaning::Pin => Act::Pin(hand),
        Meaning::Scissors => Act::Scissors(hand),
        Meaning::Cut => Act::Cut(hand),
    }
}
