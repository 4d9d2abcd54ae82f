//! Sizes mixed part by part: what the fields promise, on the sample kimono as it is committed.

use glam::Vec3;
use kitsuke::Accessories;
use kitsuke::Pack;
use kitsuke::arrays::SkinWeights;
use kitsuke::fit::FitData;
use kitsuke::garment::Garment;
use kitsuke::pack::layout::SFLD;
use kitsuke::pack::write::write_with;
use kitsuke_pipeline::measure::weld_quality::{UNEVEN, measure, source_shape};
use kitsuke_pipeline::stages::{compress, fit_data, weld};
use kitsuke_pipeline::{ir, load};
use std::path::Path;
use std::sync::LazyLock;

/// About as fine as the build makes it.
const RADIUS_M: f32 = 0.045e-3;

/// The sample without its poses, which fitting does not need and which take long to build.
pub(super) static SAMPLE: LazyLock<(ir::Garment, Garment, FitData)> = LazyLock::new(|| {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets-src/komon");
    let source = ir::Garment { targets: Vec::new(), ..load(&folder).garment.unwrap() };
    let count = source.base.positions_m.len();
    let skin = vec![SkinWeights { joints: [0; 4], weights: [65535, 0, 0, 0] }; count];
    let masks = vec![0; count * source.drivers.len()];
    let garment = Garment::new(compress::compress(&source, &skin, &masks, &[], source.budget_m).unwrap()).unwrap();
    let sizes = source.sizes.as_ref().unwrap();
    let shoulder_m = source.body.skeleton.joints()[2].rest_m.y;
    let rests: Vec<f64> =
        source.base.positions_m.iter().map(|p| f64::from(u8::from(p.y > shoulder_m && p.x.abs() < 0.2))).collect();
    let fields_m = weld::weld(&source.base, &sizes.shapes, &rests, &weld::Settings::default()).unwrap();
    let fields = fit_data::fields(&source.base, &sizes.shapes, &fields_m, RADIUS_M, &garment).unwrap();
    let fit = fit_data::fit_data(&source, sizes, fields, &garment);
    (source, garment, fit)
});

#[test]
fn equal_weights_give_the_sizes() {
    let (source, garment, fit) = &*SAMPLE;
    fit.check(garment).unwrap();
    for (size, shape) in source.sizes.as_ref().unwrap().shapes.iter().enumerate() {
        let mixed = source_shape(garment, fit, size + 1);
        for (mixed, &v) in mixed.iter().zip(&garment.data().mesh.source_vertex) {
            let distance_m = mixed.distance(shape.positions_m[v as usize]);
            assert!(distance_m <= source.budget_m, "vertex {v} of {} lies {distance_m} m off", shape.file);
        }
    }
}

#[test]
fn mixes_turn_nothing_over_and_seams_bend_no_more_than_cloth() {
    let (_, garment, fit) = &*SAMPLE;
    let quality = measure(garment, fit, 30);
    assert_eq!(quality.turned, 0, "{quality:#?}");
    assert!(quality.turned_from_agreed <= quality.agreed * quality.mixes / 10_000, "{quality:#?}");
    let [p50, p99, most] = quality.ratios;
    assert!(p50 <= p99 && p99 <= UNEVEN && p99 <= most && quality.uneven == 0, "{quality:#?}");
    assert!(quality.agreed > 24_000 && quality.inside > 0.1, "the sources must be looked at: {quality:#?}");
}

#[test]
fn a_part_alone_keeps_to_itself() {
    let (_, garment, fit) = &*SAMPLE;
    let part = fit.parts.iter().position(|name| name == "sode_left").unwrap();
    let field = &fit.fields[part * fit.size_count() + fit.size_count() - 1];
    let moved_m = |v: usize| Vec3::from_array(field.deltas[v].map(f32::from)).length() * field.step_m;
    let at_x = |x: std::ops::Range<f32>| {
        let all = garment.data().mesh.positions_m.iter().enumerate();
        all.filter(move |(_, p)| x.contains(&p.x)).map(|(v, _)| moved_m(v)).fold(0.0, f32::max)
    };
    assert!(at_x(0.5..2.0) > 0.05, "the cuff of the largest size is elsewhere");
    assert!(at_x(-2.0..-0.4) < 0.02, "the other sleeve stays: {} m", at_x(-2.0..-0.4));
}

#[test]
fn the_fields_of_the_sample_take_less_than_two_bits_a_number() {
    let (_, garment, fit) = &*SAMPLE;
    let bytes = write_with(garment, &Accessories::default(), Some(fit)).unwrap();
    let pack = Pack::open(&bytes).unwrap();
    assert!(pack.fit_data().unwrap().as_ref() == Some(fit));
    let stored = pack.sections().iter().find(|section| section.tag == SFLD).unwrap().stored_length;
    let numbers = fit.fields.len() * 3 * garment.unique_count();
    assert!(8 * stored < 2 * numbers, "{stored} bytes for {numbers} numbers");
}
