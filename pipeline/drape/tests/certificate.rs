//! Crossings, distances and certificates against what can be worked out by hand, against comparing all with all, and on the
//! shared data where it is there.
#![allow(clippy::print_stderr)]

use glam::{DMat3, DVec3};
use kitsuke_drape::analytic_form;
use kitsuke_drape::body::{Body, BodyError};
use kitsuke_drape::certificate::{Bounds, certify};
use kitsuke_drape::intersections::{Crossing, Of, crossings, meeting, self_intersections};
use std::path::Path;

type Mesh = (Vec<DVec3>, Vec<[u32; 3]>);

/// Numbers in -1..1, the same every time.
fn numbers(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// A square of two triangles, 2 wide, around the origin, normal to Z.
fn square() -> Mesh {
    let corners_m = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    (corners_m.map(|[x, y]| DVec3::new(x, y, 0.0)).to_vec(), vec![[0, 1, 2], [0, 2, 3]])
}

fn cube() -> Mesh {
    let positions_m = (0..8).map(|i| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2))).collect();
    let triangles = [
        [0, 2, 3],
        [0, 3, 1],
        [4, 5, 7],
        [4, 7, 6],
        [0, 1, 5],
        [0, 5, 4],
        [2, 6, 7],
        [2, 7, 3],
        [0, 4, 6],
        [0, 6, 2],
        [1, 3, 7],
        [1, 7, 5],
    ];
    (positions_m, triangles.to_vec())
}

fn moved((positions_m, triangles): &Mesh, by: impl Fn(DVec3) -> DVec3) -> Mesh {
    (positions_m.iter().map(|&place| by(place)).collect(), triangles.clone())
}

fn together((first_m, first): &Mesh, (second_m, second): &Mesh) -> Mesh {
    let start = first_m.len() as u32;
    let behind = second.iter().map(|corners| corners.map(|corner| corner + start));
    ([&first_m[..], &second_m[..]].concat(), first.iter().copied().chain(behind).collect())
}

fn edges_and_triangles(found: &[Crossing]) -> Vec<([u32; 2], u32)> {
    found.iter().map(|crossing| (crossing.edge, crossing.triangle)).collect()
}

#[test]
fn two_squares_that_cross_are_found_and_apart_they_are_not() {
    let upright = moved(&square(), |place| DVec3::new(0.5 * place.x, 0.0, place.y + 0.25));
    let (positions_m, triangles) = together(&square(), &upright);
    let found = self_intersections(&positions_m, &triangles);
    // The upright one is on the plane's diagonal 0-2 in the middle: its edges meet both of the lower triangles where they touch.
    assert!(!found.is_empty());
    for crossing in &found {
        assert!(crossing.place_m.y.abs() < 1e-15 && crossing.place_m.z.abs() < 1e-15, "{crossing:?}");
        assert!(crossing.place_m.x.abs() <= 0.5, "{crossing:?}");
    }
    // Apart by the least that there is.
    let above = moved(&square(), |place| DVec3::new(0.5 * place.x, 0.0, place.y + 1.0));
    let (mut positions_m, triangles) = together(&square(), &above);
    assert!(!self_intersections(&positions_m, &triangles).is_empty(), "they touch");
    for place in &mut positions_m[4..] {
        place.z = place.z.max(f64::MIN_POSITIVE * 1e200);
    }
    assert_eq!(self_intersections(&positions_m, &triangles), []);
}

#[test]
fn of_two_surfaces_is_said_whose_edge_it_is() {
    let triangle = vec![[0, 1, 2]];
    let flat_m = [DVec3::ZERO, DVec3::X * 4.0, DVec3::Y * 4.0];
    // Its edges 0-1 and 0-2 pass through the flat one; no edge of the flat one meets it.
    let upright_m = [DVec3::new(1.0, 1.0, -1.0), DVec3::new(0.5, 1.0, 1.0), DVec3::new(1.5, 1.0, 1.0)];
    let found = crossings(&flat_m, &triangle, &upright_m, &triangle);
    assert_eq!(edges_and_triangles(&found), [([0, 1], 0), ([0, 2], 0)]);
    assert!(found.iter().all(|crossing| crossing.edge_of == Of::Second));
    assert_eq!(found[0].place_m, DVec3::new(0.75, 1.0, 0.0));
    let turned = crossings(&upright_m, &triangle, &flat_m, &triangle);
    assert!(turned.len() == 2 && turned.iter().all(|crossing| crossing.edge_of == Of::First));
}

#[test]
fn triangles_that_touch_meet() {
    let triangle_m = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let meets = |from: [f64; 3], to: [f64; 3]| meeting([from, to].map(DVec3::from), triangle_m);
    // An end in the middle, on a side, on a corner; a side in its middle; then past each of them.
    assert_eq!(meets([0.25, 0.25, 0.0], [0.0, 0.0, 1.0]), Some(DVec3::new(0.25, 0.25, 0.0)));
    assert_eq!(meets([0.5, 0.5, 1.0], [0.5, 0.5, 0.0]), Some(DVec3::new(0.5, 0.5, 0.0)));
    assert_eq!(meets([1.0, 0.0, -1.0], [1.0, 0.0, 1.0]), Some(DVec3::X));
    assert_eq!(meets([0.0, 1.0, 0.0], [0.0, 2.0, 1.0]), Some(DVec3::Y));
    assert!(meets([0.5, -1.0, -1.0], [0.5, 1.0, 1.0]).is_some());
    let past = 0.5 + f64::EPSILON;
    assert_eq!(meets([0.5, past, 1.0], [0.5, past, 0.0]), None);
    assert_eq!(meets([0.25, 0.25, 1e-300], [0.0, 0.0, 1.0]), None);
    assert_eq!(meets([1.0 + f64::EPSILON, 0.0, -1.0], [1.0 + f64::EPSILON, 0.0, 1.0]), None);
    // Without area nothing is met, and a point meets what it lies in.
    assert_eq!(meeting([DVec3::NEG_Z, DVec3::Z], [DVec3::NEG_X, DVec3::ZERO, DVec3::X]), None);
    assert!(meets([0.25, 0.25, 0.0], [0.25, 0.25, 0.0]).is_some() && meets([0.5, 0.6, 0.0], [0.5, 0.6, 0.0]).is_none());
}

#[test]
fn in_one_plane_what_overlaps_meets() {
    for axis in 0..3 {
        let turn = |[x, y]: [f64; 2]| {
            let mut place_m = DVec3::splat(0.1);
            (place_m[(axis + 1) % 3], place_m[(axis + 2) % 3]) = (x, y);
            place_m
        };
        let triangle_m = [[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]].map(turn);
        let meets = |from: [f64; 2], to: [f64; 2]| meeting([from, to].map(turn), triangle_m);
        for [from, to] in [
            [[0.5, 0.5], [5.0, 5.0]],
            [[-1.0, 0.5], [5.0, 0.5]],
            [[-1.0, 0.0], [5.0, 0.0]],
            [[-1.0, -1.0], [0.0, 0.0]],
            [[0.5, 0.0], [1.5, 0.0]],
            [[-1.0, 1.0], [1.0, -1.0]],
            [[3.0, -1.0], [1.0, 1.0]],
            [[2.0, 0.0], [3.0, 0.0]],
        ] {
            assert!(meets(from, to).is_some() && meets(to, from).is_some(), "{from:?} {to:?}");
        }
        for [from, to] in [
            [[-1.0, 0.9], [0.9, -1.0]],
            [[2.1, 0.0], [3.0, 0.0]],
            [[-1.0, -1.0], [-0.1, -0.1]],
            [[2.1, 0.0], [0.0, 2.1]],
            [[0.0, 2.5], [0.0, 2.1]],
        ] {
            assert!(meets(from, to).is_none() && meets(to, from).is_none(), "{from:?} {to:?}");
        }
    }
    // Two squares on each other.
    let (positions_m, triangles) = together(&square(), &moved(&square(), |place| 0.5 * place + DVec3::X * 0.1));
    let found = self_intersections(&positions_m, &triangles);
    let inner = found.iter().filter(|crossing| crossing.edge[0] >= 4).count();
    assert!(inner >= 5 && found.iter().all(|crossing| crossing.place_m.z == 0.0), "{inner}");
}

/// Around one vertex, a second triangle reaches through the first one.
#[test]
fn triangles_that_share_a_vertex_are_found_by_the_opposite_edge() {
    let through = |x: f64| {
        let positions_m = [
            DVec3::ZERO,
            DVec3::new(2.0, -1.0, 0.0),
            DVec3::new(2.0, 1.0, 0.0),
            DVec3::new(1.0, 0.0, -1.0),
            DVec3::new(x, 0.0, 1.0),
        ];
        edges_and_triangles(&self_intersections(&positions_m, &[[0, 1, 2], [0, 3, 4]]))
    };
    assert_eq!(through(1.0), [([3, 4], 0)]);
    assert_eq!(through(6.0), [([1, 2], 1)]);
    assert_eq!(through(-3.0), []);
}

#[test]
fn triangles_that_share_an_edge_meet_when_they_are_folded_flat() {
    let folded = |x: f64, z: f64| {
        let positions_m = [DVec3::ZERO, DVec3::Y, DVec3::X, DVec3::new(x, 0.7, z)];
        edges_and_triangles(&self_intersections(&positions_m, &[[0, 1, 2], [1, 0, 3]]))
    };
    assert_eq!(folded(0.3, 0.0), [([0, 1], 1)]);
    assert_eq!(folded(0.3, 1e-300), []);
    assert_eq!(folded(-0.3, 0.0), []);
    // The same triangle twice.
    assert_eq!(self_intersections(&square().0, &[[0, 1, 2], [2, 0, 1]]).len(), 1);
}

/// On a coarse grid of places, so that many touch and lie in one plane.
#[test]
fn random_triangles_meet_as_comparing_all_says() {
    let mut kinds = [0; 3];
    for seed in 0..60 {
        let mut number = numbers(seed);
        let steps = if seed % 2 == 0 { 3.0 } else { 1e4 };
        let vertices = 40u32;
        let positions_m: Vec<DVec3> =
            (0..vertices).map(|_| (DVec3::new(number(), number(), number()) * steps).round() / steps).collect();
        let mut triangles: Vec<[u32; 3]> = Vec::new();
        while triangles.len() < 30 {
            let corners = [(); 3].map(|()| ((number() * 0.5 + 0.5) * f64::from(vertices)) as u32);
            if corners[0] != corners[1] && corners[1] != corners[2] && corners[2] != corners[0] {
                triangles.push(corners);
            }
        }
        let mut wanted = Vec::new();
        for (number, &triangle) in triangles.iter().enumerate() {
            for &other in &triangles {
                for i in 0..3 {
                    let ends = [other[i], other[(i + 1) % 3]];
                    let at = |corner: u32| positions_m[corner as usize];
                    if ends.iter().any(|end| triangle.contains(end)) {
                        continue;
                    }
                    if meeting(ends.map(at), triangle.map(at)).is_some() {
                        wanted.push(([ends[0].min(ends[1]), ends[0].max(ends[1])], number as u32));
                    }
                }
            }
        }
        wanted.sort_unstable();
        wanted.dedup();
        let found = self_intersections(&positions_m, &triangles);
        let is_flat =
            |crossing: &Crossing| crossing.edge.iter().all(|end| triangles[crossing.triangle as usize].contains(end));
        let (flat, found): (Vec<Crossing>, Vec<Crossing>) = found.into_iter().partition(is_flat);
        assert_eq!(edges_and_triangles(&found), wanted, "{seed}");
        kinds[seed as usize % 2] += found.len();
        kinds[2] += flat.len();
        // The place lies in the triangle.
        for crossing in &found {
            let [a, b, c] = triangles[crossing.triangle as usize].map(|corner| positions_m[corner as usize]);
            let normal = (b - a).cross(c - a).normalize();
            assert!((crossing.place_m - a).dot(normal).abs() < 1e-9, "{crossing:?}");
        }
    }
    assert!(kinds[0] > 1000 && kinds[1] > 1000, "{kinds:?}");
}

/// Exactness itself: `meeting` against whole numbers, where nothing is rounded.
#[test]
fn meeting_is_exact_against_whole_numbers() {
    let volume = |[a, b, c, d]: [[i64; 3]; 4]| {
        let [u, v, w] = [a, b, c].map(|place| [0, 1, 2].map(|axis| place[axis] - d[axis]));
        u[0] * (v[1] * w[2] - v[2] * w[1]) - u[1] * (v[0] * w[2] - v[2] * w[0]) + u[2] * (v[0] * w[1] - v[1] * w[0])
    };
    let (mut met, mut passed, mut number) = (0, 0, numbers(9));
    for _ in 0..200_000 {
        let [p, q, a, b, c] = [(); 5].map(|()| [(); 3].map(|()| (number() * 3.5).round() as i64));
        let (p_below, q_below) = (volume([a, b, c, p]), volume([a, b, c, q]));
        if p_below == 0 && q_below == 0 {
            continue;
        }
        let hands = [volume([p, q, a, b]), volume([p, q, b, c]), volume([p, q, c, a])];
        let is_through = hands.iter().all(|&hand| hand >= 0) || hands.iter().all(|&hand| hand <= 0);
        let wanted = p_below.signum() * q_below.signum() <= 0 && is_through;
        // Far from the origin by a sum that is not rounded, so that products are.
        let at = |place: [i64; 3]| DVec3::from(place.map(|part| 1.0 + part as f64 * 2f64.powi(-40)));
        assert_eq!(meeting([p, q].map(at), [a, b, c].map(at)).is_some(), wanted, "{p:?} {q:?} {a:?} {b:?} {c:?}");
        met += usize::from(wanted);
        passed += usize::from(!wanted);
    }
    assert!(met > 10_000 && passed > 10_000, "{met} {passed}");
}

/// In a plane: what the three half planes of the triangle leave of the edge, in fractions.
#[test]
fn meeting_in_a_plane_is_exact_against_fractions() {
    let area = |[a, b, c]: [[i64; 2]; 3]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let (mut met, mut passed, mut number) = (0, 0, numbers(10));
    for i in 0..100_000 {
        let [p, q, a, mut b, mut c] = [(); 5].map(|()| [(); 2].map(|()| (number() * 4.5).round() as i64));
        if area([a, b, c]) < 0 {
            std::mem::swap(&mut b, &mut c);
        }
        if area([a, b, c]) == 0 {
            continue;
        }
        // From `from` to `to` of the way from p to q, numerator and denominator.
        let (mut from, mut to, mut is_left) = ([0, 1], [1, 1], true);
        for [low, high] in [[a, b], [b, c], [c, a]] {
            let (at_p, at_q) = (area([low, high, p]), area([low, high, q]));
            let cut = [at_p.abs(), (at_p - at_q).abs()];
            if at_p < 0 && at_q < 0 {
                is_left = false;
            } else if at_p < 0 && cut[0] * from[1] > from[0] * cut[1] {
                from = cut;
            } else if at_q < 0 && cut[0] * to[1] < to[0] * cut[1] {
                to = cut;
            }
        }
        let wanted = is_left && from[0] * to[1] <= to[0] * from[1];
        let at = |[x, y]: [i64; 2]| {
            let [x, y] = [x, y].map(|part| 1.0 + part as f64 * 2f64.powi(-40));
            DVec3::from([[x, y, 0.7], [y, 0.7, x], [0.7, x, y]][i % 3])
        };
        let found = meeting([p, q].map(at), [a, b, c].map(at));
        assert_eq!(found.is_some(), wanted, "{p:?} {q:?} {a:?} {b:?} {c:?}");
        met += usize::from(wanted);
        passed += usize::from(!wanted);
    }
    assert!(met > 10_000 && passed > 10_000, "{met} {passed}");
}

/// Of the formula's sphere, the mesh cuts off 0.4 mm at most.
#[test]
fn distances_to_a_sphere_are_those_of_its_formula() {
    let (centre_m, radius_m) = (DVec3::new(0.3, 1.0, -0.2), 0.2);
    let (positions_m, triangles) = analytic_form::sphere(centre_m, radius_m, 96);
    let body = Body::new(&positions_m, &triangles).unwrap();
    let (mut number, mut inside) = (numbers(1), 0);
    for _ in 0..5000 {
        let place_m = centre_m + 0.35 * DVec3::new(number(), number(), number());
        let wanted_m = (place_m - centre_m).length() - radius_m;
        let near = body.signed_distance(place_m, f64::INFINITY).unwrap();
        assert!((-1e-12..4e-4).contains(&(near.distance_m - wanted_m)), "{near:?} {wanted_m}");
        if (place_m - centre_m).length() > 0.02 && wanted_m.abs() > 0.01 {
            assert!(near.normal.dot((place_m - centre_m).normalize()) > 0.95, "{near:?}");
        }
        assert!((near.normal.length() - 1.0).abs() < 1e-12);
        assert!((near.place_m + near.normal * near.distance_m - place_m).length() < 1e-12);
        assert_eq!(body.contains(place_m), near.distance_m < 0.0);
        inside += usize::from(near.distance_m < 0.0);
        // What is asked for within a distance is the same or nothing.
        let within = body.signed_distance(place_m, 0.05);
        assert_eq!(within, (near.distance_m.abs() <= 0.05).then_some(near));
    }
    assert!((300..2000).contains(&inside), "{inside}");
    // Vertices are on the surface.
    for &place_m in &positions_m {
        let near = body.signed_distance(place_m, 0.0).unwrap();
        assert!(near.distance_m == 0.0 && near.normal.dot((place_m - centre_m).normalize()) > 0.95, "{near:?}");
    }
}

#[test]
fn a_body_follows_its_vertices() {
    let (positions_m, triangles) = analytic_form::dress_form(32);
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 2.0) / 3.0, 0.8);
    let turned_m: Vec<DVec3> = positions_m.iter().map(|&place| turn * place).collect();
    let mut body = Body::new(&positions_m, &triangles).unwrap();
    body.moved(&turned_m).unwrap();
    let anew = Body::new(&turned_m, &triangles).unwrap();
    let mut number = numbers(2);
    for _ in 0..500 {
        let place_m = turn * DVec3::new(0.3 * number(), 1.1 + 0.5 * number(), 0.3 * number());
        let [one, other] = [&body, &anew].map(|body| body.signed_distance(place_m, 1.0).unwrap().distance_m);
        assert_eq!(one, other);
    }
    let count = positions_m.len();
    assert_eq!(body.moved(&turned_m[1..]), Err(BodyError::Moved { moved: count - 1, vertices: count }));
    let mut broken_m = turned_m.clone();
    broken_m[7].y = f64::NAN;
    assert_eq!(body.moved(&broken_m), Err(BodyError::NotFinite(7)));
    assert_eq!(body.surface().positions_m(), turned_m);
}

/// Rays along the faces, the edges and the diagonals of a cube, and a second cube half in the first.
#[test]
fn winding_numbers_are_right_where_rays_meet_edges() {
    let second = moved(&cube(), |place| place * 0.5 + DVec3::new(0.75, 0.25, 0.25));
    let (positions_m, triangles) = together(&cube(), &second);
    let body = Body::new(&positions_m, &triangles).unwrap();
    assert!(!body.self_intersections().is_empty());
    for i in 0..21 * 21 * 21 {
        let place_m = DVec3::new(f64::from(i % 21), f64::from(i / 21 % 21), f64::from(i / 441)) / 8.0 - 0.5;
        let side = |low_m: DVec3, size_m: f64| {
            let from_middle_m = (place_m - low_m - 0.5 * size_m).abs().max_element();
            0.5 * size_m - from_middle_m
        };
        let depths_m = [side(DVec3::ZERO, 1.0), side(DVec3::new(0.75, 0.25, 0.25), 0.5)];
        if depths_m.contains(&0.0) {
            continue;
        }
        let wanted = depths_m.iter().filter(|&&depth_m| depth_m > 0.0).count() as i32;
        assert_eq!(body.winding_number(place_m), wanted, "{place_m}");
    }
}

/// A needle along an edge, one across a face, an edge and a point.
#[test]
fn triangles_without_area_change_no_distance() {
    let (mut positions_m, mut triangles) = cube();
    let plain = Body::new(&positions_m, &triangles).unwrap();
    positions_m.extend([DVec3::X / 3.0, DVec3::new(0.7, 0.7, 0.0)]);
    triangles.extend([[0, 8, 1], [0, 1, 8], [0, 9, 3], [0, 3, 9], [5, 6, 6], [7, 7, 7]]);
    let body = Body::new(&positions_m, &triangles).unwrap();
    let mut number = numbers(8);
    for i in 0..2000 {
        let mut place_m = 0.5 + 0.8 * DVec3::new(number(), number(), number());
        if i % 3 == 0 {
            place_m.z = -0.01;
        }
        // The inner edge 5-6 lies in the body, and is near to what is deep in it.
        let [one, other] = [&plain, &body].map(|body| body.signed_distance(place_m, f64::INFINITY).unwrap().distance_m);
        let [from_m, to_m] = [5, 6].map(|corner: usize| positions_m[corner]);
        let share = ((place_m - from_m).dot(to_m - from_m) / 2.0).clamp(0.0, 1.0);
        let from_edge_m = (from_m.lerp(to_m, share) - place_m).length();
        assert!((one.signum() * one.abs().min(from_edge_m) - other).abs() < 1e-12, "{place_m} {one} {other}");
    }
}

#[test]
fn bodies_that_are_none_say_why() {
    let (positions_m, triangles) = cube();
    let error = |positions_m: &[DVec3], triangles: &[[u32; 3]]| Body::new(positions_m, triangles).unwrap_err();
    assert_eq!(error(&positions_m, &[]), BodyError::Count(0));
    let open = error(&positions_m, &triangles[1..]);
    assert_eq!(open, BodyError::Open { count: 3, edges: vec![[0, 2], [0, 3], [2, 3]] });
    assert_eq!(
        open.to_string(),
        "3 edges of the body are open, with a triangle on one side only or two that face opposite ways: of positions 0-2, \
         0-3, 2-3"
    );
    let mut turned = triangles.clone();
    turned[0].swap(0, 1);
    assert!(matches!(error(&positions_m, &turned), BodyError::Open { count: 3, .. }));
    let inward: Vec<[u32; 3]> = triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
    assert!(matches!(error(&positions_m, &inward), BodyError::Volume { volume_m3 } if (volume_m3 + 1.0).abs() < 1e-12));
    let mut broken_m = positions_m.clone();
    broken_m[3].x = f64::INFINITY;
    assert_eq!(error(&broken_m, &triangles), BodyError::NotFinite(3));
    let index = BodyError::Index { triangle: 0, position: 9, positions: 8 };
    assert_eq!(error(&positions_m, &[[0, 1, 9]]), index);
}

/// A sphere without its cap, and without single triangles.
#[test]
fn holes_are_closed_by_fans() {
    let (positions_m, triangles) = analytic_form::sphere(DVec3::ZERO, 0.2, 32);
    let at = |corner: u32| positions_m[corner as usize];
    let is_kept = |(number, corners): (usize, &[u32; 3])| {
        let high_m = corners.map(at).map(|place| place.y).into_iter().fold(f64::NEG_INFINITY, f64::max);
        (high_m < 0.16 && (high_m > 0.0 || number % 97 != 0)).then_some(*corners)
    };
    let open: Vec<[u32; 3]> = triangles.iter().enumerate().filter_map(is_kept).collect();
    assert!(matches!(Body::new(&positions_m, &open), Err(BodyError::Open { .. })));
    let mut body = Body::with_holes_closed(&positions_m, &open).unwrap();
    let rim_m = open.iter().flatten().map(|&corner| at(corner).y).fold(0.0, f64::max);
    let mut number = numbers(4);
    for _ in 0..2000 {
        let place_m = 0.25 * DVec3::new(number(), number(), number());
        let depth_m = (0.2 - place_m.length()).min(rim_m - place_m.y);
        if depth_m.abs() > 0.003 {
            assert_eq!(body.contains(place_m), depth_m > 0.0, "{place_m}");
        }
    }
    let on_lid = body.signed_distance(DVec3::Y * (rim_m + 0.001), 0.01).unwrap();
    assert!((on_lid.distance_m - 0.001).abs() < 1e-12 && on_lid.triangle as usize >= open.len());
    // The lid goes with its rim.
    let away_m: Vec<DVec3> = positions_m.iter().map(|&place| place + DVec3::X).collect();
    body.moved(&away_m).unwrap();
    assert!(body.contains(DVec3::X) && !body.contains(DVec3::ZERO));
}

#[test]
fn a_certificate_says_what_fails_and_where() {
    let (body_m, body_triangles) = cube();
    let body = Body::new(&body_m, &body_triangles).unwrap();
    let above = moved(&square(), |place| DVec3::new(0.5, 1.25, 0.5) + DVec3::new(place.x, 0.0, -place.y));
    let still = [0.0; 4];
    let good = certify(&above.0, &still, &above.1, Some(&body), Bounds::default());
    assert!(good.is_certified(), "{good}");
    assert_eq!(
        good.to_string(),
        "at rest, outside the body and clear of itself; the fastest particle moves at 0.000 mm/s"
    );
    // One corner drawn into the cube, and moving.
    let (mut positions_m, mut speeds) = (above.0.clone(), still);
    positions_m[2] = DVec3::new(0.5, 0.875, 0.5);
    speeds[1] = 0.25;
    let bad = certify(&positions_m, &speeds, &above.1, Some(&body), Bounds::default());
    assert!(!bad.is_certified());
    assert!((bad.inside.len(), bad.inside[0].particle, bad.inside[0].depth_m) == (1, 2, 0.125), "{:?}", bad.inside);
    let text = bad.to_string();
    for line in [
        "particle 1 at (1500.0, 1250.0, 1500.0) mm moves at 250.000 mm/s, at most 1.000 is rest\n",
        "1 particle inside the body: particle 2 at (500.0, 875.0, 500.0) mm, 125.000 mm deep\n",
        " of an edge of the cloth: 0-2 through the body's triangle ",
    ] {
        assert!(text.contains(line), "{text}");
    }
    assert!(certify(&positions_m, &still, &above.1, None, Bounds::default()).is_certified());
    // Each fault alone.
    let faults =
        |positions_m: &[DVec3], speeds: &[f64]| certify(positions_m, speeds, &above.1, Some(&body), Bounds::default());
    assert!(!faults(&above.0, &speeds).is_certified());
    let small_m: Vec<DVec3> =
        above.0.iter().map(|&place| DVec3::splat(0.5) + 0.1 * (place - DVec3::splat(0.5))).collect();
    let deep = faults(&small_m, &still);
    assert!(deep.body_crossings.is_empty() && deep.inside.len() == 4 && !deep.is_certified(), "{deep}");
    let large_m = moved(&square(), |place| DVec3::new(9.0 * place.x, 0.5, -9.0 * place.y)).0;
    let pierced = faults(&large_m, &still);
    assert!(pierced.inside.is_empty() && !pierced.is_certified(), "{pierced}");
    assert!(pierced.to_string().contains(" crossings of an edge of the body: "), "{pierced}");
    let mut lost_m = above.0.clone();
    (lost_m[1].x, lost_m[3].y) = (f64::NAN, 1e300);
    let lost = faults(&lost_m, &still);
    assert!(!lost.is_certified() && lost.lost == [1, 3]);
    assert_eq!(lost.to_string(), "2 particles are lost, their place or speed is no number or beyond 1000 km: 1, 3");
}

#[test]
fn the_same_bytes_on_one_thread_and_on_two() {
    let (body_m, body_triangles) = analytic_form::sphere(DVec3::ZERO, 0.3, 64);
    let body = Body::new(&body_m, &body_triangles).unwrap();
    let (mut positions_m, mut triangles) = (Vec::new(), Vec::new());
    let side = 80;
    for i in 0..side * side {
        let (x, y) = (f64::from(i % side) / 40.0 - 1.0, f64::from(i / side) / 40.0 - 1.0);
        positions_m.push(0.4 * DVec3::new(x + 0.5 * libm::sin(9.0 * y), libm::sin(7.0 * x * y), y * x));
        if i % side > 0 && i / side > 0 {
            let [a, b, c, d] = [i - side - 1, i - side, i - 1, i].map(|corner| corner as u32);
            triangles.extend([[a, b, d], [a, d, c]]);
        }
    }
    let speeds: Vec<f64> = positions_m.iter().map(|place| place.length()).collect();
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| certify(&positions_m, &speeds, &triangles, Some(&body), Bounds::default()))
    };
    let (one, two) = (on(1), on(2));
    assert_eq!(one, two);
    assert!(one.inside.len() > 50 && one.body_crossings.len() > 100 && one.self_crossings.len() > 100);
}

/// A mesh of the shared data; none where it is absent.
fn shared(file: &str) -> Option<Mesh> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(file);
    let Ok(text) = std::fs::read_to_string(&path) else {
        eprintln!("skipped: {} is not there", path.display());
        return None;
    };
    let (mut positions_m, mut triangles) = (Vec::new(), Vec::new());
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let parts: Vec<f64> = words.map(|word| word.parse().unwrap()).collect();
                positions_m.push(DVec3::from_slice(&parts));
            }
            Some("f") => {
                let index = |word: &str| word.split('/').next().unwrap().parse::<u32>().unwrap() - 1;
                let corners: Vec<u32> = words.map(index).collect();
                for i in 2..corners.len() {
                    triangles.push([corners[0], corners[i - 1], corners[i]]);
                }
            }
            _ => {}
        }
    }
    Some((positions_m, triangles))
}

/// By solid angles (van Oosterom and Strackee, 1983).
fn winding_by_angles(mesh: &Mesh, place_m: DVec3) -> f64 {
    let mut angle_rad = 0.0;
    for corners in &mesh.1 {
        let [a, b, c] = corners.map(|corner| mesh.0[corner as usize] - place_m);
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        angle_rad += 2.0 * libm::atan2(a.dot(b.cross(c)), below);
    }
    angle_rad / (4.0 * std::f64::consts::PI)
}

#[test]
fn real_bodies_wind_around_places_as_their_solid_angles_say() {
    for file in ["bodies/b04_rest_uv.obj", "bodies/b04_pose_T.obj", "body/b04.obj"] {
        let Some(mesh) = shared(file) else { continue };
        let body = Body::new(&mesh.0, &mesh.1).unwrap();
        let mut number = numbers(6);
        let mut found = [0; 3];
        for i in 0..600 {
            // Within some millimetres of the skin, where it matters.
            let on_skin_m = mesh.0[(i * 7919) % mesh.0.len()];
            let place_m = on_skin_m + 0.01 * DVec3::new(number(), number(), number());
            let (winding, by_angles) = (body.winding_number(place_m), winding_by_angles(&mesh, place_m));
            assert!((f64::from(winding) - by_angles).abs() < 1e-6, "{file} {place_m}: {winding}, {by_angles}");
            found[winding.clamp(0, 2) as usize] += 1;
        }
        let crossings = body.self_intersections().len();
        eprintln!("{file}: places outside, inside, in two parts {found:?}; meets itself {crossings} times");
        assert!(found[0] > 100 && found[1] > 100);
    }
}

#[test]
fn the_reference_drape_is_looked_at() {
    let Some((positions_m, triangles)) = shared("komon/base.obj") else { return };
    let own = self_intersections(&positions_m, &triangles);
    eprintln!("the reference drape meets itself {} times", own.len());
    let Some(body) = shared("body/b04.obj") else { return };
    let body = Body::new(&body.0, &body.1).unwrap();
    let still = vec![0.0; positions_m.len()];
    let certificate = certify(&positions_m, &still, &triangles, Some(&body), Bounds::default());
    eprintln!("{certificate}");
    assert!(certificate.inside.is_empty() && certificate.body_crossings.is_empty());
    assert_eq!(certificate.self_crossings, own);
}
