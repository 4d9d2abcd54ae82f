//! What people look at and measure with: pictures, contact sheets, exported frames.

use super::blending::KOMON;
use glam::{Vec2, Vec3};
use image::{Rgb, RgbImage};
use kitsuke::arrays::GarmentData;
use kitsuke::pack::write::write;
use kitsuke::skeleton::{Bone, Pose};
use kitsuke::{Frame, Garment, Pack, Rates, Scratch, evaluate, evaluate_with_rates};
use kitsuke_pipeline::look::frames::{
    Blend, Distance, Shot, Stage, in_source_order, npy_frame, npy_header, own_poses, write_obj,
};
use kitsuke_pipeline::look::raster::{Camera, Lens, Paint, Shape, render, smooth_normals};
use kitsuke_pipeline::look::scene::{Colours, Framing, Scene, View};
use kitsuke_pipeline::look::sheet::{Cell, contact_sheet, png_bytes, side_by_side};
use kitsuke_pipeline::look::texture::Texture;
use kitsuke_tests::{random, small_garment, small_garment_data};
use proptest::prelude::*;
use std::path::Path;

const BACKGROUND: [u8; 3] = [10, 20, 30];
const QUAD: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];
const QUAD_UV: [Vec2; 4] = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];

/// Looks along -Z; one metre is one pixel and the picture's lower left corner is the origin.
fn pixel_camera(size: [u32; 2]) -> Camera {
    let target_m = Vec3::new(size[0] as f32 / 2.0, size[1] as f32 / 2.0, 0.0);
    Camera { eye_m: target_m + 10.0 * Vec3::Z, target_m, lens: Lens::Orthographic { height_m: size[1] as f32 } }
}

fn quad([left, bottom]: [f32; 2], [right, top]: [f32; 2], z: f32) -> [Vec3; 4] {
    [[left, bottom], [right, bottom], [right, top], [left, top]].map(|[x, y]| Vec3::new(x, y, z))
}

/// Positions, triangles and their colour.
type Painted<'a> = (&'a [Vec3], &'a [[u32; 3]], Paint<'a>);

fn draw(shapes: &[Painted<'_>], camera: &Camera, size: [u32; 2]) -> RgbImage {
    let normals: Vec<Vec<Vec3>> = shapes.iter().map(|(positions, tris, _)| smooth_normals(positions, tris)).collect();
    let shapes: Vec<Shape<'_>> = shapes
        .iter()
        .zip(&normals)
        .map(|(&(positions_m, triangles, paint), normals)| Shape {
            positions_m,
            normals,
            triangles,
            paint,
            inside: None,
        })
        .collect();
    render(&shapes, camera, size, BACKGROUND)
}

/// Which of red, green and blue is strongest.
fn hue(pixel: &Rgb<u8>) -> usize {
    (0..3).max_by_key(|&i| pixel[i]).expect("three channels")
}

proptest! {
    #[test]
    fn a_quad_covers_exactly_its_pixels(left in 0u32..20, bottom in 0u32..15, width in 1u32..12, height in 1u32..12) {
        let size = [32, 27];
        let (right, top) = (left + width, bottom + height);
        let corners = quad([left as f32, bottom as f32], [right as f32, top as f32], 0.0);
        let picture = draw(&[(&corners, &QUAD, Paint::Plain([200, 200, 200]))], &pixel_camera(size), size);
        let inside = *picture.get_pixel(left, size[1] - 1 - bottom);
        prop_assert_ne!(inside.0, BACKGROUND);
        for (x, row, pixel) in picture.enumerate_pixels() {
            let y = size[1] - 1 - row;
            let covered = (left..right).contains(&x) && (bottom..top).contains(&y);
            prop_assert_eq!(pixel.0, if covered { inside.0 } else { BACKGROUND }, "pixel {} {}", x, y);
        }
    }
}

#[test]
fn the_nearer_surface_hides_the_farther_whatever_the_order() {
    let size = [9, 9];
    let near = quad([0.0, 0.0], [9.0, 9.0], 1.0);
    let far = quad([0.0, 0.0], [9.0, 9.0], -1.0);
    let red = (&near[..], &QUAD[..], Paint::Plain([255, 0, 0]));
    let green = (&far[..], &QUAD[..], Paint::Plain([0, 255, 0]));
    let camera = pixel_camera(size);
    let picture = draw(&[red, green], &camera, size);
    assert!(picture.pixels().all(|p| hue(p) == 0), "red is nearer");
    assert_eq!(picture, draw(&[green, red], &camera, size));
    let eye_m = camera.target_m - 10.0 * Vec3::Z;
    let behind = draw(&[red, green], &Camera { eye_m, ..camera }, size);
    assert!(behind.pixels().all(|p| hue(p) == 1), "from behind green is nearer");
}

#[test]
fn a_perspective_picture_shrinks_with_distance() {
    // 90 degrees high: at distance d the picture spans 2 d metres.
    let camera = Camera {
        eye_m: Vec3::ZERO,
        target_m: -Vec3::Z,
        lens: Lens::Perspective { height_rad: std::f32::consts::FRAC_PI_2 },
    };
    let covered = |distance_m: f32| {
        let corners = quad([-1.0, -1.0], [1.0, 1.0], -distance_m);
        let picture = draw(&[(&corners, &QUAD, Paint::Plain([255; 3]))], &camera, [64, 64]);
        picture.pixels().filter(|p| p.0 != BACKGROUND).count()
    };
    assert_eq!([2.0, 4.0, 8.0].map(covered), [32 * 32, 16 * 16, 8 * 8]);
    assert_eq!(covered(-2.0), 0, "what is behind the eye is not drawn");
}

#[test]
fn the_bottom_row_of_a_texture_is_v_0() {
    let corner_colours = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 255]];
    let image = RgbImage::from_fn(64, 64, |x, y| Rgb(corner_colours[(x / 32 + y / 32 * 2) as usize]));
    let texture = Texture::from_png(&png_bytes(&image).unwrap()).unwrap();
    let corners = quad([0.0, 0.0], [64.0, 64.0], 0.0);
    let picture = draw(&[(&corners, &QUAD, Paint::Textured(&texture, &QUAD_UV))], &pixel_camera([64, 64]), [64, 64]);
    assert_eq!(hue(picture.get_pixel(16, 16)), 0, "upper left");
    assert_eq!(hue(picture.get_pixel(48, 16)), 1, "upper right");
    assert_eq!(hue(picture.get_pixel(16, 48)), 2, "lower left");
    let white = picture.get_pixel(48, 48);
    assert!(white[0] == white[1] && white[1] == white[2], "lower right");
}

#[test]
fn a_fine_pattern_seen_from_far_is_its_mean() {
    let checks = RgbImage::from_fn(512, 512, |x, y| Rgb([if (x + y) % 2 == 0 { 255 } else { 0 }; 3]));
    let texture = Texture::from_png(&png_bytes(&checks).unwrap()).unwrap();
    let corners = quad([0.0, 0.0], [37.0, 37.0], 0.0);
    let camera = pixel_camera([37, 37]);
    let picture = draw(&[(&corners, &QUAD, Paint::Textured(&texture, &QUAD_UV))], &camera, [37, 37]);
    let [least, most] = [picture.pixels().map(|p| p[0]).min(), picture.pixels().map(|p| p[0]).max()];
    assert!(most.unwrap() - least.unwrap() <= 1, "{least:?} to {most:?}");
}

#[test]
fn the_inside_of_cloth_is_darker() {
    let corners = quad([0.0, 0.0], [8.0, 8.0], 0.0);
    let turned = QUAD.map(|[a, b, c]| [a, c, b]);
    let camera = pixel_camera([8, 8]);
    let sides = [QUAD, turned]
        .map(|triangles| draw(&[(&corners, &triangles, Paint::Plain([200; 3]))], &camera, [8, 8]).get_pixel(4, 4)[0]);
    assert!(sides[1] < sides[0] - 20 && sides[1] > 20, "{sides:?}");
}

#[test]
fn a_symmetric_mesh_has_a_symmetric_outline() {
    let size = [61, 41];
    let ball: Vec<Vec3> = (0..36)
        .map(|i| {
            let angle = (i as f32 + 0.5) * std::f32::consts::TAU / 36.0;
            Vec3::new(30.5 + 17.3 * libm::cosf(angle), 20.5 + 17.3 * libm::sinf(angle), 0.0)
        })
        .chain([Vec3::new(30.5, 20.5, 0.0)])
        .collect();
    let fan: Vec<[u32; 3]> = (0..36).map(|i| [36, i, (i + 1) % 36]).collect();
    let picture = draw(&[(&ball, &fan, Paint::Plain([255; 3]))], &pixel_camera(size), size);
    let covered = |x: u32, y: u32| picture.get_pixel(x, y).0 != BACKGROUND;
    assert!((0..size[1]).any(|y| covered(30, y)));
    for (x, y, _) in picture.enumerate_pixels() {
        assert_eq!(covered(x, y), covered(60 - x, y), "pixel {x} {y}");
        assert_eq!(covered(x, y), covered(x, 40 - y), "pixel {x} {y}");
    }
}

#[test]
fn a_picture_is_the_same_on_one_and_two_threads() {
    let size = [80, 90];
    let corners = quad([3.3, 4.7], [70.1, 81.9], 0.0);
    let colours = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [9, 9, 9]];
    let render = || draw(&[(&corners, &QUAD, Paint::PerVertex(&colours))], &pixel_camera(size), size);
    let [one, two] = [1, 2].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap().install(render));
    assert_eq!(one, two);
    assert_eq!(png_bytes(&one).unwrap(), png_bytes(&two).unwrap());
}

#[test]
fn a_contact_sheet_holds_every_picture_and_a_caption() {
    let cells: Vec<Cell> = (0..5u8)
        .map(|i| Cell { caption: format!("{i}"), picture: RgbImage::from_pixel(40, 30, Rgb([i; 3])) })
        .collect();
    let sheet = contact_sheet(&cells, 2);
    for i in 0..5u8 {
        assert_eq!(sheet.pixels().filter(|p| p.0 == [i; 3]).count(), 40 * 30, "picture {i}");
    }
    let blank: Vec<Cell> = cells.iter().cloned().map(|cell| Cell { caption: String::new(), ..cell }).collect();
    assert_ne!(sheet, contact_sheet(&blank, 2), "captions are drawn");
    let long = [Cell { caption: "longer than the picture".to_owned(), ..cells[0].clone() }];
    assert_eq!(
        contact_sheet(&long, 2).dimensions(),
        contact_sheet(&cells[..1], 2).dimensions(),
        "long captions are cut"
    );
    assert_eq!(side_by_side(&[cells[0].picture.clone(), cells[1].picture.clone()]).dimensions(), (80, 30));
}

#[test]
fn a_damaged_texture_is_an_error() {
    let png = png_bytes(&RgbImage::new(4, 4)).unwrap();
    assert!(Texture::from_png(&png[..png.len() / 2]).is_err());
    assert!(Texture::from_png(b"").is_err());
    assert!(Texture::from_png(&png_bytes(&RgbImage::new(8193, 1)).unwrap()).is_err(), "longer than 8192 pixels");
}

/// The small garment with its vertices in another order than its base file's.
fn reordered_garment() -> Garment {
    let mut data: GarmentData = small_garment_data();
    let count = data.mesh.source_vertex.len() as u32;
    // 7 and 60 have no common factor: each number once.
    data.mesh.source_vertex = (0..count).map(|i| i * 7 % count).collect();
    Garment::new(data).unwrap()
}

/// Shape and values of an NPY file (version 1.0, little-endian float32, C order), read as its specification says.
fn parse_npy(bytes: &[u8]) -> (Vec<usize>, Vec<f32>) {
    assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
    let end = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    assert_eq!(end % 64, 0, "the values are aligned");
    let header = std::str::from_utf8(&bytes[10..end]).unwrap();
    assert!(header.ends_with('\n') && header.is_ascii());
    let header = header.trim_end();
    let shape = header.strip_prefix("{'descr': '<f4', 'fortran_order': False, 'shape': (").unwrap();
    let shape =
        shape.strip_suffix("), }").unwrap().trim_end_matches(',').split(", ").map(|n| n.parse().unwrap()).collect();
    let values = bytes[end..].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    (shape, values)
}

#[test]
fn npy_holds_every_frame_in_the_order_of_the_base_file() {
    let garment = reordered_garment();
    let mut stage = Stage::new(&garment);
    let shots = own_poses(&garment);
    let mut bytes = npy_header(&[shots.len(), garment.unique_count(), 3]);
    for shot in &shots {
        bytes.extend(npy_frame(&in_source_order(&garment, stage.show(shot).0)));
    }
    let (shape, values) = parse_npy(&bytes);
    assert_eq!(shape, [4, 60, 3], "twins are left out");
    assert_eq!(values.len(), 4 * 60 * 3);
    let [mut positions_m, mut normals] = [(); 2].map(|()| vec![Vec3::ZERO; garment.vertex_count()]);
    for (frame, shot) in shots.iter().enumerate() {
        let mut rates = Rates::new(garment.data());
        (0..if frame > 0 { 2 } else { 0 }).for_each(|driver| rates.set(driver, frame - 1, 1.0));
        let buffers = Frame { positions_m: &mut positions_m, normals: &mut normals };
        evaluate_with_rates(&garment, &shot.pose, &rates, &mut Scratch::new(&garment), buffers);
        for (v, position_m) in positions_m[..60].iter().enumerate() {
            let at = (frame * 60 + v * 7 % 60) * 3;
            assert_eq!(values[at..at + 3], position_m.to_array(), "frame {frame}, vertex {v}");
        }
    }
}

#[test]
fn headers_of_any_size_are_aligned() {
    for (frames, vertices) in [(0, 0), (1, 1), (19, 13_924), (123_456_789, 4_194_304), (usize::MAX, usize::MAX)] {
        assert_eq!(parse_npy(&npy_header(&[frames, vertices, 3])).0, [frames, vertices, 3]);
        assert_eq!(parse_npy(&npy_header(&[vertices])).0, [vertices]);
    }
}

#[test]
fn own_poses_are_the_table_with_the_base_first() {
    let garment = small_garment();
    let shots = own_poses(&garment);
    let data = garment.data();
    assert_eq!(shots.len(), data.targets.len() + 1);
    assert_eq!((shots[0].name.as_str(), shots[0].blend, &shots[0].pose), ("base", Blend::Alone(None), &Pose::REST));
    for (i, shot) in shots.iter().enumerate().skip(1) {
        assert_eq!((shot.name.as_str(), shot.blend), (data.targets[i - 1].name.as_str(), Blend::Alone(Some(i - 1))));
        for bone in Bone::ALL {
            let column = data.poses.bones.iter().position(|b| *b == bone);
            let expected = column.map_or(glam::Quat::IDENTITY, |column| data.poses.row(i)[column]);
            assert_eq!(shot.pose.rotation(bone), expected, "{} of row {i}", bone.name());
        }
    }
}

#[test]
fn a_stage_blends_like_the_run_time() {
    let garment = small_garment();
    let pose = own_poses(&garment)[1].pose.clone();
    let [mut positions_m, mut normals] = [(); 2].map(|()| vec![Vec3::ZERO; garment.vertex_count()]);
    let frame = Frame { positions_m: &mut positions_m, normals: &mut normals };
    evaluate(&garment, &pose, &mut Scratch::new(&garment), frame);
    let mut stage = Stage::new(&garment);
    let shot = Shot { name: String::new(), pose, blend: Blend::Kernel(garment.kernel()) };
    assert_eq!(stage.show(&shot), (&positions_m[..], &normals[..]));
}

#[test]
fn obj_has_the_vertex_numbers_of_the_base_file() {
    let garment = reordered_garment();
    let mesh = &garment.data().mesh;
    let ordered_m = in_source_order(&garment, &mesh.positions_m);
    let mut text = Vec::new();
    write_obj(&garment, &ordered_m, &mut text).unwrap();
    let read = kitsuke_pipeline::source::obj::read("frame.obj", &text, &mut Vec::new()).unwrap();
    assert_eq!(read.positions.len(), 60);
    for (v, position_m) in mesh.positions_m.iter().enumerate() {
        assert!(read.positions[v * 7 % 60].as_vec3().distance(*position_m) < 2e-6, "vertex {v}");
    }
    assert_eq!(read.uv.len(), mesh.uv.len());
    assert_eq!(read.parts, mesh.parts.iter().map(|part| part.name.clone()).collect::<Vec<_>>());
    assert_eq!(read.faces.len(), mesh.triangles.len());
    for (face, triangle) in read.faces.iter().zip(&mesh.triangles) {
        for (corner, &vertex) in read.corners_of(face).iter().zip(triangle) {
            let unique = if vertex < 60 { vertex } else { mesh.twin_of[vertex as usize - 60] };
            assert_eq!((corner.vertex, corner.uv), (mesh.source_vertex[unique as usize], Some(vertex)));
        }
    }
}

#[test]
fn distances_name_the_worst_vertex() {
    let a = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let b = [Vec3::ZERO, Vec3::X + 0.003 * Vec3::Z, Vec3::Y];
    let Distance { max_m, mean_m, vertex } = Distance::between(&a, &b);
    assert!((max_m - 0.003).abs() < 1e-7 && (mean_m - 0.001).abs() < 1e-7 && vertex == 1);
    assert!(Distance::between(&a, &[Vec3::NAN; 3]).max_m.is_nan(), "what is no number is no small distance");
}

#[test]
fn every_view_and_colour_shows_the_garment() {
    let garment = small_garment();
    let scene = Scene::new(&garment, None);
    let mut stage = Stage::new(&garment);
    let shot = &own_poses(&garment)[1];
    for colours in [Colours::Cloth, Colours::Regions, Colours::Joints, Colours::Error(1e-3)] {
        let figures = [scene.figure(&mut stage, shot, colours)];
        for view in [View::Front, View::Side, View::Back, View::Quarter] {
            let framing = Framing::of(&figures, view);
            let picture = scene.draw(&figures[0], framing, 60);
            let paper = *picture.get_pixel(0, 0);
            let (width, height) = picture.dimensions();
            let shown: Vec<_> = picture.enumerate_pixels().filter(|(.., pixel)| **pixel != paper).collect();
            let border = |x, y| x == 0 || y == 0 || x == width - 1 || y == height - 1;
            assert!(!shown.is_empty() && shown.iter().all(|&(x, y, _)| !border(x, y)), "{view:?} {colours:?}");
            // The tube fills the picture but for the margin.
            let columns = shown.iter().map(|(x, ..)| *x).max().unwrap() - shown.iter().map(|(x, ..)| *x).min().unwrap();
            assert!(columns * 2 > width, "{view:?}: {columns} of {width} columns");
            assert_eq!(picture, scene.draw(&figures[0], framing, 60));
        }
    }
}

/// Positions of an OBJ file, by nothing but its `v` lines.
fn v_lines(path: &Path) -> Vec<Vec3> {
    let text = std::fs::read_to_string(path).unwrap();
    let lines = text.lines().filter_map(|line| line.strip_prefix("v "));
    let numbers = |line: &str| line.split_whitespace().map(|n| n.parse().unwrap()).collect::<Vec<f32>>();
    lines.map(|line| Vec3::from_slice(&numbers(line))).collect()
}

/// Komon as built today, each target alone, against the files by their `v` lines.
#[test]
fn komon_comes_back_in_the_order_of_its_files() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets-src/komon");
    let (source, garment) = &*KOMON;
    let pack = Pack::open(&write(garment)).unwrap();
    let garment = pack.garment();
    let mut stage = Stage::new(garment);
    let shots = own_poses(garment);
    assert_eq!(shots.len(), 55);
    let files = source.targets.iter().map(|target| target.file.as_str());
    for (shot, file) in shots.iter().zip(std::iter::once("base.obj").chain(files)) {
        let (shape, values) = {
            let mut bytes = npy_header(&[1, garment.unique_count(), 3]);
            bytes.extend(npy_frame(&in_source_order(garment, stage.show(shot).0)));
            parse_npy(&bytes)
        };
        assert_eq!(shape, [1, 13_924, 3]);
        let wanted_m = v_lines(&folder.join(file));
        let errors: Vec<f32> = values
            .chunks_exact(3)
            .zip(&wanted_m)
            .map(|(found, wanted)| Vec3::from_slice(found).distance(*wanted))
            .collect();
        assert_eq!(errors.len(), wanted_m.len());
        let max_m = errors.iter().copied().fold(0.0, f32::max);
        let mean_m = errors.iter().sum::<f32>() / errors.len() as f32;
        let limits_m = if file == "base.obj" { (1e-6, 1e-6) } else { (0.077e-3, 0.05e-3) };
        assert!(max_m <= limits_m.0 && mean_m <= limits_m.1, "{file}: max {max_m} m, mean {mean_m} m");
    }
}

/// What is drawn and exported is what an app shows, to the bit, also where a recording's rotations are not quite of length 1.
#[test]
fn frames_are_those_of_the_runtime() {
    let garment = small_garment();
    let mut stage = Stage::new(&garment);
    let mut scratch = Scratch::new(&garment);
    let mut numbers = random::Numbers(3);
    let [mut positions_m, mut normals] = [(); 2].map(|()| vec![Vec3::ZERO; garment.vertex_count()]);
    for _ in 0..50 {
        let mut pose = numbers.pose();
        for rotation in &mut pose.rotations {
            *rotation *= 1.0 + 1e-4 * numbers.signed();
        }
        evaluate(&garment, &pose, &mut scratch, Frame { positions_m: &mut positions_m, normals: &mut normals });
        let shot = Shot { name: String::new(), pose, blend: Blend::Kernel(garment.kernel()) };
        assert_eq!(stage.show(&shot), (&positions_m[..], &normals[..]));
    }
}
