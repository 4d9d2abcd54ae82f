//! Colours from scans, regions from paint, texture coordinates for meshes without: against scans and pictures made here, whose right
//! answers are known. xatlas itself is asked only where the suite `clean` asks pymeshlab.

use glam::{DVec3, Vec2};
use image::{Rgb, RgbImage, Rgba, RgbaImage};
use kitsuke_pipeline::meshlab::{self, AtlasSettings, MeshlabError, environment};
use kitsuke_pipeline::source::{masks, picture};
use kitsuke_pipeline::stages::bake::{Baked, Base, Colours, Scan, Settings, bake};
use kitsuke_pipeline::stages::pack_islands::{self, pack};
use kitsuke_pipeline::stages::painted::{Region, regions};
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// A mesh with texture coordinates per vertex.
#[derive(Clone)]
struct Sheet {
    positions_m: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    uv: Vec<Vec2>,
}

impl Sheet {
    /// `n` x `n` squares over u and v, at places of them.
    fn new(n: u32, place_m: impl Fn(Vec2) -> DVec3) -> Sheet {
        let uv: Vec<Vec2> =
            (0..=n).flat_map(|y| (0..=n).map(move |x| Vec2::new(x as f32, y as f32) / n as f32)).collect();
        let at = |x: u32, y: u32| y * (n + 1) + x;
        let square = |x, y| [[at(x, y), at(x + 1, y), at(x + 1, y + 1)], [at(x, y), at(x + 1, y + 1), at(x, y + 1)]];
        Sheet {
            positions_m: uv.iter().map(|&uv| place_m(uv)).collect(),
            triangles: (0..n).flat_map(|y| (0..n).flat_map(move |x| square(x, y))).collect(),
            uv,
        }
    }

    fn flat(n: u32, z_m: f64) -> Sheet {
        Sheet::new(n, |uv| DVec3::new(f64::from(uv.x), f64::from(uv.y), z_m))
    }

    fn per_corner(&self) -> Vec<[Vec2; 3]> {
        self.triangles.iter().map(|t| t.map(|v| self.uv[v as usize])).collect()
    }

    fn baked(&self, scan: &Sheet, picture: &RgbImage, settings: &Settings) -> Baked {
        let (uv, confidence) = (scan.per_corner(), vec![1.0; self.positions_m.len()]);
        let colours = Colours::Picture(picture, &uv);
        bake(
            &self.base(&confidence),
            &Scan { positions_m: &scan.positions_m, triangles: &scan.triangles, colours },
            settings,
        )
        .unwrap()
    }

    fn base<'a>(&'a self, confidence: &'a [f64]) -> Base<'a> {
        let (positions_m, triangles, uv) = (&self.positions_m, &self.triangles, &self.uv);
        Base { positions_m, triangles, confidence, uv, uv_triangles: triangles }
    }
}

const SIZE: Settings = Settings { size_px: 64, within_m: 0.01, least_facing: 0.5, gutter_px: 4 };

fn speckled(size: u32) -> RgbImage {
    RgbImage::from_fn(size, size, |x, y| Rgb([(x * 37 + y * 11) as u8, (x * y * 5) as u8, (255 - 3 * y) as u8]))
}

#[test]
fn a_flat_scan_gives_its_own_picture_back() {
    let picture = speckled(64);
    // Another topology, and a triangle's width beside it nothing is different.
    let baked = Sheet::flat(3, 0.0).baked(&Sheet::flat(7, 0.0), &picture, &SIZE);
    assert_eq!((baked.covered, baked.seen), (64 * 64, 64 * 64));
    for (x, y, Rgb(colour)) in baked.colour.enumerate_pixels() {
        let Rgb(wanted) = picture.get_pixel(x, y);
        assert!(colour.iter().zip(wanted).all(|(a, b)| a.abs_diff(*b) <= 1), "({x}, {y}): {colour:?} for {wanted:?}");
    }
    assert!(baked.confidence.as_raw().iter().all(|&c| c == 255));
}

#[test]
fn a_scan_that_faces_inwards_or_lies_a_little_off_is_used_all_the_same() {
    let picture = speckled(64);
    let mut scan = Sheet::flat(7, 0.005);
    scan.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    let baked = Sheet::flat(3, 0.0).baked(&scan, &picture, &SIZE);
    assert_eq!(baked.seen, 64 * 64);
    assert_eq!(baked.confidence.get_pixel(30, 30).0, [191], "half way to where nothing is trusted");
    let far = Scan {
        positions_m: &Sheet::flat(7, 0.05).positions_m,
        triangles: &scan.triangles,
        colours: Colours::PerVertex(&[[1, 2, 3]; 64]),
    };
    let base = Sheet::flat(3, 0.0);
    let error = bake(&base.base(&[1.0; 16]), &far, &SIZE).unwrap_err();
    assert!(error.to_string().contains("nothing of the scan lies near"), "{error}");
}

#[test]
fn a_tube_has_its_colours_on_the_side_that_they_are_on() {
    let round = |radius: f64| {
        move |uv: Vec2| {
            let along = f64::from(uv.x) * std::f64::consts::TAU;
            DVec3::new(radius * libm::sin(along), f64::from(uv.y), radius * libm::cos(along))
        }
    };
    // Red left of the middle, green right of it; inside another tube of blue that faces inwards, 4 mm off.
    let halves = RgbImage::from_fn(64, 64, |x, _| Rgb(if x < 32 { [255, 0, 0] } else { [0, 255, 0] }));
    let mut scan = Sheet::new(48, round(0.2));
    let lining = Sheet::new(48, round(0.196));
    let colours: Vec<[u8; 3]> = scan.uv.iter().map(|uv| if uv.x < 0.5 { [255, 0, 0] } else { [0, 255, 0] }).collect();
    let colours = [colours, vec![[0, 0, 255]; lining.uv.len()]].concat();
    let baked = Sheet::new(48, round(0.2)).baked(&scan, &halves, &SIZE);
    assert_eq!(baked.colour.get_pixel(10, 10).0, [255, 0, 0]);
    assert_eq!(baked.colour.get_pixel(50, 10).0, [0, 255, 0]);
    let count = scan.positions_m.len() as u32;
    scan.positions_m.extend(&lining.positions_m);
    scan.triangles.extend(lining.triangles.iter().map(|[a, b, c]| [a + count, c + count, b + count]));
    let base = Sheet::new(48, round(0.196));
    let confidence = vec![1.0; base.positions_m.len()];
    let scan =
        Scan { positions_m: &scan.positions_m, triangles: &scan.triangles, colours: Colours::PerVertex(&colours) };
    let baked = bake(&base.base(&confidence), &scan, &SIZE).unwrap();
    assert_eq!(baked.colour.get_pixel(10, 10).0, [255, 0, 0], "the lining is nearer, but faces the other way");
}

#[test]
fn a_hole_is_filled_from_around_and_trusted_nowhere() {
    let halves = RgbImage::from_fn(64, 64, |x, _| Rgb(if x < 32 { [200, 0, 0] } else { [0, 0, 200] }));
    let mut scan = Sheet::flat(16, 0.0);
    let centre = |t: &[u32; 3]| t.iter().map(|&v| scan.uv[v as usize]).sum::<Vec2>() / 3.0;
    // Wholly in the left half.
    let is_hole = |c: Vec2| c.x > 0.1 && c.x < 0.3 && c.y > 0.4 && c.y < 0.8;
    let kept: Vec<[u32; 3]> = scan.triangles.iter().copied().filter(|t| !is_hole(centre(t))).collect();
    scan.triangles = kept;
    let baked = Sheet::flat(3, 0.0).baked(&scan, &halves, &SIZE);
    let middle = (13, 64 - 38);
    assert_eq!(baked.confidence.get_pixel(middle.0, middle.1).0, [0]);
    let Rgb([r, _, b]) = *baked.colour.get_pixel(middle.0, middle.1);
    assert!(r > 190 && b < 40, "{r} {b}");
    assert!(baked.seen < baked.covered);
    // A vertex that registration did not see is not asked for its colour.
    let base = Sheet::flat(16, 0.0);
    let unseen: Vec<f64> = base.uv.iter().map(|uv| f64::from(u8::from(uv.x > 0.5))).collect();
    let uv = scan.per_corner();
    let scan =
        Scan { positions_m: &scan.positions_m, triangles: &scan.triangles, colours: Colours::Picture(&halves, &uv) };
    let baked = bake(&base.base(&unseen), &scan, &SIZE).unwrap();
    assert_eq!(baked.confidence.get_pixel(20, 20).0, [0]);
    assert_eq!(baked.confidence.get_pixel(50, 20).0, [255]);
}

#[test]
fn where_one_layer_has_a_hole_the_other_layers_colour_is_not_taken() {
    // Two layers of the base, 6 mm apart, beside each other in the picture; the scan has the lower one alone on the left.
    let at = |uv: Vec2| match uv.x {
        x if x < 0.5 => DVec3::new(f64::from(x), f64::from(uv.y), 0.0),
        x => DVec3::new(f64::from(x) - 0.55, f64::from(uv.y), 0.006),
    };
    let mut base = Sheet::new(20, at);
    let across = |t: &[u32; 3]| {
        let x = t.map(|v| base.uv[v as usize].x);
        x.iter().any(|x| *x < 0.5) && x.iter().any(|x| *x >= 0.5)
    };
    let kept: Vec<[u32; 3]> = base.triangles.iter().copied().filter(|t| !across(t)).collect();
    base.triangles = kept;
    let mut scan = base.clone();
    scan.triangles.retain(|t| base.uv[t[0] as usize].x < 0.5);
    let baked = base.baked(&scan, &RgbImage::from_pixel(4, 4, Rgb([9, 90, 200])), &SIZE);
    assert_eq!(baked.confidence.get_pixel(14, 30).0, [255]);
    assert_eq!(baked.confidence.get_pixel(48, 30).0, [0], "it is the lower layer's");
    // Between islands: the gutter has the island's colour, nothing is trusted.
    assert_eq!(baked.colour.get_pixel(30, 30).0, [9, 90, 200]);
    assert_eq!(baked.confidence.get_pixel(30, 30).0, [0]);
}

#[test]
fn threads_change_nothing() {
    let picture = speckled(32);
    let bake = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Sheet::flat(5, 0.002).baked(&Sheet::flat(9, 0.0), &picture, &SIZE))
    };
    assert!(bake(1) == bake(3));
}

#[test]
fn pictures_are_read_by_what_they_hold_and_refused_in_words() {
    let written = |format| {
        let mut bytes = Cursor::new(Vec::new());
        RgbImage::from_pixel(16, 16, Rgb([200, 30, 60])).write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    };
    for format in [image::ImageFormat::Png, image::ImageFormat::Jpeg] {
        let Rgb(colour) = *picture::decode(&written(format)).unwrap().into_rgb8().get_pixel(8, 8);
        assert!(colour.iter().zip([200, 30, 60]).all(|(a, b)| a.abs_diff(b) < 4), "{colour:?}");
        let half = &written(format)[..40];
        assert!(picture::decode(half).unwrap_err().contains("damaged"));
    }
    // The header of a PNG of 60000 x 4 pixels.
    let mut large = written(image::ImageFormat::Png);
    large[16..20].copy_from_slice(&60_000_u32.to_be_bytes());
    let crc = large[12..29].iter().fold(!0_u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 })
    });
    large[29..33].copy_from_slice(&(!crc).to_be_bytes());
    for (bytes, problem) in [
        (b"GIF89a......".to_vec(), "it is Gif; pictures are read as PNG or JPEG"),
        (b"no picture".to_vec(), "neither as a PNG nor as a JPEG"),
        (large, "60000 x 16 pixels; at most 16384"),
    ] {
        let found = picture::decode(&bytes).unwrap_err();
        assert!(found.contains(problem), "{found}");
    }
}

fn region(name: &str, colour: [u8; 3]) -> Region {
    Region { name: name.to_owned(), colour }
}

#[test]
fn painted_regions_are_read_back_as_masks_that_sum_to_at_most_one() {
    let named = [region("a", [255, 0, 0]), region("b", [0, 255, 0])];
    let half = kitsuke_pipeline::light::srgb(glam::Vec3::splat(0.5))[0];
    // Colour, and the shares of a and b.
    let cases: [([u8; 4], [u8; 2]); 9] = [
        ([255, 0, 0, 255], [255, 0]),
        ([0, 255, 0, 255], [0, 255]),
        ([0, 0, 0, 255], [0, 0]),
        ([9, 200, 77, 0], [0, 0]),
        ([half, 0, 0, 255], [128, 0]),
        ([half, half, 0, 255], [127, 128]),
        ([128, 127, 0, 255], [128, 127]),
        ([255, 0, 0, 100], [100, 0]),
        ([250, 4, 3, 255], [244, 0]),
    ];
    let picture = RgbaImage::from_fn(9, 1, |x, _| Rgba(cases[x as usize].0));
    let painted = regions(&picture, &named, [0; 3]);
    let read: Vec<masks::Mask> = painted
        .masks
        .iter()
        .map(|mask| {
            let mut png = Cursor::new(Vec::new());
            mask.write_to(&mut png, image::ImageFormat::Png).unwrap();
            masks::read("mask.png", png.get_ref(), &mut Vec::new()).unwrap()
        })
        .collect();
    for (x, (colour, wanted)) in cases.into_iter().enumerate() {
        let found = [0, 1].map(|i| read[i].values[x] / 257);
        assert!(found.iter().zip(wanted).all(|(f, w)| f.abs_diff(u16::from(w)) <= 6), "{colour:?}: {found:?}");
        assert!(read.iter().map(|mask| u32::from(mask.values[x])).sum::<u32>() <= 65535);
    }
    assert_eq!((painted.strays, painted.first_stray), (0, None));
    assert!(painted.nearest.iter().all(Option::is_none));
}

#[test]
fn colours_that_are_nowhere_and_pixels_of_no_colour_are_found() {
    let mut picture = RgbaImage::from_pixel(8, 4, Rgba([255, 0, 0, 255]));
    picture.put_pixel(5, 2, Rgba([40, 90, 250, 255]));
    picture.put_pixel(6, 3, Rgba([40, 90, 250, 255]));
    let painted = regions(&picture, &[region("a", [255, 0, 0]), region("b", [0, 255, 0])], [0; 3]);
    assert_eq!(painted.pixels, [30, 0]);
    assert_eq!(painted.nearest, [None, Some([40, 90, 250])]);
    assert_eq!((painted.strays, painted.first_stray), (2, Some(([5, 2], [40, 90, 250]))));
}

#[test]
fn islands_are_packed_without_overlap_scale_or_mirror() {
    // Three strips of their own and one of them twice as a mirrored piece.
    let mut triangles = Vec::new();
    let mut uv = Vec::new();
    let sizes = [(0.2, 0.9), (0.9, 0.1), (0.3, 0.3), (-0.3, 0.4), (0.05, 0.05)];
    for (i, (width, height)) in sizes.into_iter().enumerate() {
        let corner = Vec2::new(i as f32 * 3.0 - 4.0, 0.5);
        let at = |x: f32, y: f32| corner + Vec2::new(x * width, y * height);
        let v = 4 * i as u32;
        triangles.extend([[v, v + 1, v + 2], [v, v + 2, v + 3]]);
        uv.extend([[at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0)], [at(0.0, 0.0), at(1.0, 1.0), at(0.0, 1.0)]]);
    }
    for may_turn in [false, true] {
        let settings = pack_islands::Settings { margin: 0.01, may_turn };
        let packed = pack(&triangles, &uv, &settings).unwrap();
        assert_eq!((packed.islands, &packed.mirrored[..]), (5, &[3][..]));
        let mut boxes = Vec::new();
        for i in 0..5 {
            let (before, after) = (&uv[2 * i..2 * i + 2], &packed.uv[2 * i..2 * i + 2]);
            for (before, after) in before.iter().zip(after) {
                for (a, b) in [(0, 1), (1, 2)] {
                    let (from, to) = (before[b] - before[a], after[b] - after[a]);
                    let is_turned = may_turn && sizes[i].0.abs() > sizes[i].1;
                    let wanted = if is_turned { from.perp() } else { from } * packed.scale as f32;
                    assert!(to.distance(wanted) < 1e-5, "{to} for {wanted}");
                }
            }
            let all = || after.iter().flatten();
            let low = all().copied().reduce(Vec2::min).unwrap();
            let high = all().copied().reduce(Vec2::max).unwrap();
            assert!(low.min_element() >= 0.0099 && high.max_element() <= 0.9901, "{low} {high}");
            boxes.push((low, high));
        }
        for (i, a) in boxes.iter().enumerate() {
            let apart = |b: &(Vec2, Vec2)| {
                let gap = (b.0 - a.1).max(a.0 - b.1);
                gap.max_element() >= 0.0099
            };
            assert!(boxes[..i].iter().all(apart));
        }
    }
    let error = pack(&triangles, &vec![[Vec2::ONE; 3]; triangles.len()], &Default::default()).unwrap_err();
    assert!(error.to_string().contains("all lie at one place"), "{error}");
    let error = pack(&triangles, &vec![[Vec2::NAN; 3]; triangles.len()], &Default::default()).unwrap_err();
    assert!(error.to_string().contains("triangle 0"), "{error}");
}

/// The Python that has xatlas, where it is installed.
fn python() -> Option<PathBuf> {
    let cache = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().join("target/kitsuke-cache");
    let python = environment::existing(&cache, &environment::PYMESHLAB);
    if python.is_none() {
        println!("skipped: xatlas is not installed (KITSUKE_MESHLAB=1 lets the suite clean install it)");
    }
    python
}

#[test]
fn xatlas_unwraps_to_one_scale_with_every_vertex_where_it_was() {
    let Some(python) = python() else { return };
    // A strip of 1 : 5, rolled up.
    let tube = Sheet::new(24, |uv| {
        let along = f64::from(uv.x) * std::f64::consts::TAU;
        DVec3::new(0.1 * libm::sin(along), f64::from(uv.y) * 3.1, 0.1 * libm::cos(along))
    });
    let settings = AtlasSettings { size_px: 512, padding_px: 4, ..AtlasSettings::default() };
    let atlas = match meshlab::atlas(&python, &tube.positions_m, &tube.triangles, &settings) {
        Err(MeshlabError::NoXatlas) => return println!("skipped: xatlas has no wheel here"),
        atlas => atlas.unwrap(),
    };
    assert_eq!(atlas.mirrored, 0);
    let per_metre = 1.0 / atlas.side_m;
    let (mut all, mut all_m) = (0.0, 0.0);
    for (vertices, uv) in tube.triangles.iter().zip(&atlas.uv_triangles) {
        assert_eq!(uv.map(|i| atlas.vertex_of_uv[i as usize]), *vertices);
        for (a, b) in [(0, 1), (1, 2), (2, 0)] {
            let length_m = tube.positions_m[vertices[a] as usize].distance(tube.positions_m[vertices[b] as usize]);
            let length = f64::from(atlas.uv[uv[a] as usize].distance(atlas.uv[uv[b] as usize]));
            // A chart of half the tube is no flat strip: some edges grow, others shrink.
            assert!((length / (length_m * per_metre) - 1.0).abs() < 0.3, "{length} for {length_m} m");
            (all, all_m) = (all + length, all_m + length_m);
        }
    }
    assert!((all / (all_m * per_metre) - 1.0).abs() < 0.05, "{all} for {all_m} m");
    let again = meshlab::atlas(&python, &tube.positions_m, &tube.triangles, &settings).unwrap();
    assert!(atlas == again, "the same mesh gives the same bytes");
}

/// Programs in the place of Python, as a shell script each.
#[cfg(unix)]
mod stand_ins {
    use super::*;
    use kitsuke_pipeline::look::frames::npy_header_of;
    use std::fs;

    fn atlas_by(script: &str, settings: &AtlasSettings) -> Result<meshlab::Atlas, MeshlabError> {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let python = folder.path().join("python");
        fs::write(&python, format!("#!/bin/sh\n{script}\n")).unwrap();
        fs::set_permissions(&python, fs::Permissions::from_mode(0o755)).unwrap();
        let positions = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(1.0, 1.0, 0.0)];
        loop {
            match meshlab::atlas(&python, &positions, &[[0, 1, 2], [1, 3, 2]], settings) {
                // Another test's process was started while the script was written, and still holds it open.
                Err(MeshlabError::Io { problem, .. }) if problem.contains("Text file busy") => {}
                done => return done,
            }
        }
    }

    #[test]
    fn what_fails_says_so() {
        let ample = AtlasSettings::default();
        let said = |script: &str, settings: &AtlasSettings| atlas_by(script, settings).unwrap_err().to_string();
        let text = said("echo \"ModuleNotFoundError: No module named 'xatlas'\" >&2; exit 1", &ample);
        assert!(text.contains("no wheel for this system"), "{text}");
        let text = said("echo 'out of room' >&2; exit 3", &ample);
        assert!(text.contains("xatlas ended with exit code 3") && text.ends_with("out of room"), "{text}");
        let short = AtlasSettings { limit: std::time::Duration::from_millis(200), ..ample };
        assert!(said("exec /bin/sleep 60", &short).contains("took longer than 0.2 s and was ended"));
        assert!(said("echo rubbish", &ample).contains("gave a wrong answer"));
        let wide = AtlasSettings { padding_px: 1000, ..ample };
        assert!(matches!(atlas_by("exit 0", &wide), Err(MeshlabError::Unfit(_))));
    }

    #[test]
    fn sound_answers_are_taken_and_wrong_ones_refused() {
        fn npy<const N: usize>(descr: &str, shape: &[usize], bytes: Vec<[u8; N]>) -> Vec<u8> {
            [npy_header_of(descr, shape), bytes.concat()].concat()
        }
        let i32s = |shape: &[usize], n: &[i32]| npy("<i4", shape, n.iter().map(|n| n.to_le_bytes()).collect());
        let f64s = |shape: &[usize], n: &[f64]| npy("<f8", shape, n.iter().map(|n| n.to_le_bytes()).collect());
        let uv = [0.0, 0.0, 50.0, 0.0, 0.0, 50.0, 50.0, 50.0];
        let sound = || {
            vec![
                ("source_vertex", i32s(&[4], &[0, 1, 2, 3])),
                ("uv_triangles", i32s(&[2, 3], &[0, 1, 2, 1, 3, 2])),
                ("uv", f64s(&[4, 2], &uv)),
                ("chart", i32s(&[4], &[0, 0, 0, 0])),
            ]
        };
        let given = |arrays: &[(&str, Vec<u8>)]| {
            let folder = tempfile::tempdir().unwrap();
            arrays
                .iter()
                .for_each(|(name, bytes)| fs::write(folder.path().join(format!("{name}.npy")), bytes).unwrap());
            let at = folder.path().display();
            let answer = "echo '{\"width_px\": 100, \"height_px\": 50}'";
            atlas_by(&format!("/bin/cp '{at}'/*.npy . && {answer}"), &AtlasSettings::default())
        };
        let atlas = given(&sound()).unwrap();
        assert_eq!((atlas.charts, atlas.mirrored), (1, 0));
        assert_eq!(atlas.uv[3], Vec2::splat(0.5), "one scale for both, though the atlas is wider than high");
        assert!((atlas.side_m - 2.0).abs() < 1e-9 && (atlas.covered - 0.25).abs() < 1e-9);
        let mut nan = uv;
        nan[3] = f64::NAN;
        let wrong = [
            (0, i32s(&[4], &[0, 1, 2, 4]), "the vertex of a coordinate does not exist"),
            (0, i32s(&[3], &[0, 1, 2]), "a corner does not exist"),
            (1, i32s(&[2, 3], &[0, 1, 2, 1, 2, 3]), "not those of the mesh"),
            (1, i32s(&[1, 3], &[0, 1, 2]), "not those of the mesh"),
            (2, f64s(&[4, 2], &nan), "outside the atlas"),
            (2, f64s(&[4, 2], &[7.0; 8]), "have no area"),
            (2, f64s(&[3, 2], &uv[..6]), "disagree"),
            (3, i32s(&[4], &[0, 0, 0, 9]), "more charts than triangles"),
        ];
        for (array, bytes, problem) in wrong {
            let mut arrays = sound();
            arrays[array].1 = bytes;
            let text = given(&arrays).unwrap_err().to_string();
            assert!(text.contains(problem), "{text}");
        }
    }
}
