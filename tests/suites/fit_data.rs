//! What a fit needs, in packs: exact round trips, hostile bytes, and the rules that it keeps.

use glam::Vec2;
use kitsuke::Accessories;
use kitsuke::fit::{Dimension, Field, FitData, SizeBody};
use kitsuke::garment::Garment;
use kitsuke::measurement::{Measurement, Measurements};
use kitsuke::pack::write::{write, write_with};
use kitsuke::{OpenError, Pack};
use kitsuke_tests::container::{Container, for_each_damage};
use kitsuke_tests::random::{self, Numbers};
use kitsuke_tests::{small_fit, small_garment};
use proptest::prelude::*;

#[test]
fn the_small_fit_comes_back_exactly() {
    let (garment, fit) = (small_garment(), small_fit());
    let pack = write_with(&garment, &Accessories::default(), Some(&fit)).unwrap();
    let opened = Pack::open(&pack).unwrap();
    assert_eq!(opened.fit_data().unwrap().as_ref(), Some(&fit));
    assert_eq!(opened.garment().data(), garment.data());
    assert_eq!(
        write_with(&garment, &Accessories::default(), Some(&fit)).unwrap(),
        pack,
        "the same fit gives the same bytes"
    );
    assert_eq!(Pack::open(&write(&garment)).unwrap().fit_data(), Ok(None));
}

/// Any numbers within the rules, for a garment whose parts bear them.
fn random_fit(garment: &Garment, n: &mut Numbers) -> FitData {
    let (sizes, unique, data) = (1 + n.below(3), garment.unique_count(), garment.data());
    let bodies = (0..=sizes).map(|i| SizeBody {
        name: format!("b{i}"),
        measurements: Measurements::default().with(Measurement::ALL[n.below(Measurement::COUNT)], 1.1 + n.signed()),
        joints_m: data.skeleton.joints().iter().map(|_| n.vector()).collect(),
    });
    let bodies = bodies.collect();
    let spread = 1 << n.below(16);
    let mut delta = || [0; 3].map(|_: i32| (n.below(2 * spread) as i32 - spread as i32).clamp(-32768, 32767) as i16);
    let fields = (0..data.mesh.parts.len() * sizes)
        .map(|i| Field { step_m: 1e-5 * (i + 1) as f32, deltas: (0..unique).map(|_| delta()).collect() })
        .collect();
    let uv = if n.below(3) == 0 { 0 } else { sizes };
    let is_decimal = n.below(2) == 0;
    let mut coordinate =
        || if is_decimal { (1e4 * f64::from(n.signed())).round() / 1e4 } else { f64::from(n.signed()) } as f32;
    let uv =
        (0..uv).map(|_| (0..garment.vertex_count()).map(|_| Vec2::new(coordinate(), coordinate())).collect()).collect();
    FitData {
        bodies,
        dimensions: vec![Dimension {
            name: "d".to_owned(),
            rule: "yuki".to_owned(),
            vertices: vec![0, unique as u32 - 1],
            load: 1.0,
            ..Dimension::default()
        }],
        parts: data.mesh.parts.iter().map(|part| part.name.clone()).collect(),
        fields,
        uv,
        rules: Vec::new(),
    }
}

proptest! {
    #[test]
    fn fits_come_back_exactly(seed in any::<u64>()) {
        let garment = random::garment(seed);
        if garment.unique_count() > 1 {
            let fit = random_fit(&garment, &mut Numbers(seed));
            let opened = Pack::open(&write_with(&garment, &Accessories::default(), Some(&fit)).unwrap()).unwrap();
            // Not with `prop_assert_eq!`, which would print both fits.
            prop_assert!(opened.fit_data().unwrap().as_ref() == Some(&fit));
        }
    }
}

/// Damages the pack in every way; how many of the results still give a fit. A fit that comes is a checked one.
fn damages_that_fit(pack: &[u8]) -> usize {
    let mut fitted = 0;
    for_each_damage(pack, |_, damaged| {
        if let Ok(pack) = Pack::open(damaged)
            && let Ok(Some(fit)) = pack.fit_data()
        {
            fit.check(pack.garment()).unwrap();
            fitted += 1;
        }
    });
    fitted
}

#[test]
fn damage_gives_an_error_or_a_checked_fit() {
    let pack = write_with(&small_garment(), &Accessories::default(), Some(&small_fit())).unwrap();
    assert!(damages_that_fit(&pack) > 500, "damage must reach the fit, too");
    let uncompressed = Container::of(&pack).uncompressed().to_pack();
    assert!(damages_that_fit(&uncompressed) > 500, "damage must reach the fit, too");
}

#[test]
fn a_fit_that_lacks_a_section_is_refused() {
    let pack = write_with(&small_garment(), &Accessories::default(), Some(&small_fit())).unwrap();
    let without = |tag: &[u8; 4]| {
        let mut container = Container::of(&pack);
        container.sections.retain(|section| section.tag != *tag);
        Pack::open(&container.to_pack()).unwrap().fit_data()
    };
    assert!(matches!(without(b"FITS"), Err(OpenError::Missing(_))));
    assert!(matches!(without(b"SFLD"), Err(OpenError::Missing(_))));
    assert_eq!(without(b"SZUV"), Ok(Some(FitData { uv: Vec::new(), ..small_fit() })));
}

#[test]
fn what_breaks_a_rule_is_named() {
    let refusal = |change: fn(&mut FitData)| {
        let mut fit = small_fit();
        change(&mut fit);
        write_with(&small_garment(), &Accessories::default(), Some(&fit)).unwrap_err().to_string()
    };
    let refusals = [
        refusal(|fit| fit.bodies.truncate(1)),
        refusal(|fit| fit.bodies[1].measurements = Measurements::default().with(Measurement::HipGirth, -1.0)),
        refusal(|fit| fit.bodies[2].joints_m[1].y = f32::NAN),
        refusal(|fit| fit.bodies[2].joints_m.truncate(3)),
        refusal(|fit| fit.bodies[2].name = "b0".to_owned()),
        refusal(|fit| fit.dimensions.clear()),
        refusal(|fit| fit.dimensions[0].vertices[2] = 60),
        refusal(|fit| fit.dimensions[0].load = 0.0),
        refusal(|fit| fit.dimensions[0].rule.clear()),
        refusal(|fit| fit.parts.swap(0, 1)),
        refusal(|fit| fit.fields.truncate(3)),
        refusal(|fit| fit.fields[3].step_m = f32::INFINITY),
        refusal(|fit| fit.fields[1].deltas.truncate(59)),
        refusal(|fit| fit.uv[1][7].x = 1e9),
        refusal(|fit| fit.uv.truncate(1)),
        refusal(|fit| fit.rules[0].dimensions[0].program.clear()),
    ];
    insta::assert_snapshot!(refusals.join("\n"));
}
