//! Cleaning of scans. What the process answers is held against what went in, by programs that stand in for Python; what pymeshlab makes of
//! a mesh is tested only where it is installed in the cache or KITSUKE_MESHLAB=1 allows that.

use glam::{DVec3, Vec2};
use kitsuke_pipeline::meshlab::{self, Cleaned, MeshlabError, Settings, environment};
use kitsuke_pipeline::source::import::{ImportedMesh, Part};
use std::path::{Path, PathBuf};

/// The Python that has pymeshlab; `None`, said aloud, where it is not installed and may not be.
fn python() -> Option<PathBuf> {
    let cache = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().join("target/kitsuke-cache");
    if std::env::var_os("KITSUKE_MESHLAB").is_some_and(|value| value == "1") {
        return Some(
            environment::python(&cache, &environment::PYMESHLAB, &|line| println!("{line}"))
                .expect("pymeshlab can be installed"),
        );
    }
    let python = environment::existing(&cache, &environment::PYMESHLAB);
    if python.is_none() {
        println!("skipped: pymeshlab is not installed (KITSUKE_MESHLAB=1 lets the tests install it)");
    }
    python
}

/// A sheet of 11 x 11 squares of 10 cm with every fault that a scan has, and how many of each.
fn faulty() -> ImportedMesh {
    const N: u32 = 12;
    let at = |x: u32, y: u32| y * N + x;
    let point = |i: u32| DVec3::new(f64::from(i % N), f64::from(i / N), 0.0) * 0.1;
    let mut positions: Vec<DVec3> = (0..N * N).map(point).collect();
    let mut triangles = Vec::new();
    for (x, y) in (0..N - 1).flat_map(|y| (0..N - 1).map(move |x| (x, y))) {
        // Two holes that meet in one vertex.
        if (x, y) != (5, 5) && (x, y) != (6, 6) {
            triangles.push([at(x, y), at(x + 1, y), at(x, y + 1)]);
            triangles.push([at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]);
        }
    }
    let mut add = |position: DVec3| {
        positions.push(position);
        positions.len() as u32 - 1
    };
    // Facing the other way.
    triangles[0].swap(1, 2);
    // A vertex twice, exactly and nearly.
    triangles[40][0] = add(point(triangles[40][0]));
    triangles[80][1] = add(point(triangles[80][1]) + DVec3::X * 5e-6);
    // A fin at an edge of two triangles.
    let apex = add(point(at(2, 8)) + DVec3::new(0.05, 0.0, 0.01));
    triangles.push([at(2, 8), at(3, 8), apex]);
    // A floating tetrahedron.
    let [a, b, c, d] = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|p| add(p * 0.02 + DVec3::splat(3.0)));
    triangles.extend([[a, c, b], [a, b, d], [b, c, d], [c, a, d]]);
    // A triangle without area, one that is there twice, a vertex that belongs to none.
    triangles.extend([[0, 0, 1], triangles[10]]);
    add(DVec3::splat(9.0));
    let uv = triangles.iter().map(|t| t.map(|i| positions[i as usize].truncate().as_vec2())).collect();
    ImportedMesh {
        colours: (0..positions.len()).map(|i| [i as u8, (i >> 8) as u8, 7]).collect(),
        parts: ["low", "high"].map(|name| Part { name: name.to_owned(), material: String::new() }).into(),
        part_of_triangle: (0..triangles.len() as u32).map(|i| i / 120 % 2).collect(),
        positions,
        triangles,
        uv,
        ..ImportedMesh::default()
    }
}

#[test]
fn every_fault_is_found_and_what_is_left_knows_where_it_came_from() {
    let Some(python) = python() else { return };
    let mesh = faulty();
    let settings = Settings { hole_m: 1.0, ..Settings::default() };
    let cleaned = meshlab::clean(&python, &mesh.positions, &mesh.triangles, &settings).unwrap();
    let Cleaned { positions_m, triangles, source_vertex, source_triangle, is_turned, report, .. } = &cleaned;

    assert_eq!(report.before.vertices as usize, mesh.positions.len());
    assert_eq!(report.before.triangles as usize, mesh.triangles.len());
    assert_eq!(report.before.components, 2);
    assert_eq!(report.before.non_manifold_edges, 2 + 1, "the fin's, and two of the triangle that is there twice");
    let steps = report.steps;
    assert_eq!((steps.unused_vertices, steps.exact_duplicates, steps.near_duplicates), (1, 1, 1));
    assert_eq!((steps.degenerate_triangles, steps.duplicate_triangles, steps.non_manifold_triangles), (1, 1, 1));
    assert_eq!((steps.split_vertices, report.turned_triangles), (1, 1));
    assert_eq!(report.removed.len(), 1);
    assert_eq!(report.removed[0].triangles, 4);
    assert!((DVec3::from(report.removed[0].place_m) - DVec3::splat(3.005)).length() < 1e-9, "{:?}", report.removed);
    let after = report.after;
    assert_eq!((after.vertices, after.triangles, after.components), (145, 2 * 119, 1));
    assert_eq!((after.non_manifold_edges, after.non_manifold_vertices, after.borders), (0, 0, 2));
    assert_eq!(report.borders.iter().map(|b| (b.vertices, b.is_hole)).collect::<Vec<_>>(), [(44, false), (8, true)]);
    assert!((report.borders[0].length_m - 4.4).abs() < 1e-4 && (report.borders[1].length_m - 0.8).abs() < 1e-4);
    assert_eq!(report.warnings, [""; 0]);
    let count_on = |border| cleaned.border_of_vertex.iter().filter(|&&on| on == border).count();
    assert_eq!([Some(0), Some(1), None].map(count_on), [44, 8, 145 - 52]);

    for (position, &source) in positions_m.iter().zip(source_vertex) {
        assert!((*position - mesh.positions[source as usize]).length() <= 1e-5);
    }
    for ((triangle, &source), &turned) in triangles.iter().zip(source_triangle).zip(is_turned) {
        let [a, b, c] = mesh.triangles[source as usize].map(|i| mesh.positions[i as usize]);
        let source_corners = if turned { [a, c, b] } else { [a, b, c] };
        for (corner, source) in triangle.iter().zip(source_corners) {
            assert!((positions_m[*corner as usize] - source).length() <= 1e-5);
        }
    }
    let carried = cleaned.carried(&mesh);
    for (i, triangle) in triangles.iter().enumerate() {
        for (&corner, uv) in triangle.iter().zip(carried.uv[i]) {
            let place: Vec2 = positions_m[corner as usize].truncate().as_vec2();
            assert!((place - uv).length() <= 2e-5, "triangle {i}");
        }
        assert_eq!(carried.part_of_triangle[i], mesh.part_of_triangle[source_triangle[i] as usize]);
    }
    assert!(carried.colours.iter().zip(source_vertex).all(|(colour, &source)| colour[0] == source as u8));
    let again = meshlab::clean(&python, &mesh.positions, &mesh.triangles, &settings).unwrap();
    assert!(cleaned == again, "the same mesh gives the same bytes");
}

#[test]
fn a_surface_with_one_side_is_said_to_be_one() {
    let Some(python) = python() else { return };
    let n = 20;
    let along = |i: u32| f64::from(i) * std::f64::consts::TAU / f64::from(n);
    let point = |i: u32, side: f64| {
        let r = 1.0 + side * libm::cos(along(i) / 2.0);
        DVec3::new(r * libm::cos(along(i)), r * libm::sin(along(i)), side * libm::sin(along(i) / 2.0))
    };
    let positions: Vec<DVec3> = (0..n).flat_map(|i| [point(i, -0.3), point(i, 0.3)]).collect();
    let quad = |i: u32| if i + 1 < n { [2 * i, 2 * i + 1, 2 * i + 2, 2 * i + 3] } else { [2 * i, 2 * i + 1, 1, 0] };
    let triangles: Vec<[u32; 3]> = (0..n).map(quad).flat_map(|[a, b, c, d]| [[a, c, b], [c, d, b]]).collect();
    let cleaned = meshlab::clean(&python, &positions, &triangles, &Settings::default()).unwrap();
    assert_eq!(cleaned.triangles.len(), 40);
    assert!(cleaned.report.warnings[0].contains("no two sides"), "{:?}", cleaned.report.warnings);
}

#[test]
fn what_cannot_be_cleaned_is_said_before_anything_starts() {
    let nowhere = Path::new("no/such/python");
    let clean = |positions: &[DVec3], triangles: &[[u32; 3]], settings: &Settings| match meshlab::clean(
        nowhere, positions, triangles, settings,
    ) {
        Err(MeshlabError::Unfit(problem)) => problem,
        other => panic!("{other:?}"),
    };
    let (positions, settings) = ([DVec3::ZERO, DVec3::X, DVec3::Y], Settings::default());
    assert_eq!(clean(&[], &[], &settings), "it has no triangles");
    assert_eq!(clean(&positions, &[[0, 1, 3]], &settings), "triangle 0 names a vertex that does not exist");
    assert!(
        clean(&[DVec3::ZERO, DVec3::X, DVec3::new(0.0, f64::NAN, 1.0)], &[[0, 1, 2]], &settings)
            .starts_with("vertex 2 lies at")
    );
    let wrong = Settings { merge_m: f64::NAN, ..settings };
    assert!(clean(&positions, &[[0, 1, 2]], &wrong).contains("merge distance"));
}

/// Programs in the place of Python, as a shell script each.
#[cfg(unix)]
mod stand_ins {
    use super::*;
    use kitsuke_pipeline::look::frames::npy_header_of;
    use std::fs;
    use std::time::{Duration, Instant};

    /// A square of two triangles, cleaned by this script.
    fn cleaned_by(script: &str, limit: Duration) -> Result<Cleaned, MeshlabError> {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let python = folder.path().join("python");
        fs::write(&python, format!("#!/bin/sh\n{script}\n")).unwrap();
        fs::set_permissions(&python, fs::Permissions::from_mode(0o755)).unwrap();
        let positions = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(1.0, 1.0, 0.0)];
        let settings = Settings { limit, ..Settings::default() };
        loop {
            match meshlab::clean(&python, &positions, &[[0, 1, 2], [1, 3, 2]], &settings) {
                // Another test's process was started while the script was written, and still holds it open.
                Err(MeshlabError::Io { problem, .. }) if problem.contains("Text file busy") => {}
                done => return done,
            }
        }
    }

    const AMPLE: Duration = Duration::from_secs(60);

    #[test]
    fn a_process_that_dies_says_how_and_its_last_words() {
        let error = cleaned_by("/bin/cat >/dev/null; echo one >&2; echo 'no memory' >&2; exit 3", AMPLE).unwrap_err();
        let said = "the process that cleans with pymeshlab ended with exit code 3\nIt said:\n  one\n  no memory";
        assert_eq!(error.to_string(), said);
        let error = cleaned_by("kill -9 $$", AMPLE).unwrap_err();
        assert!(error.to_string().contains("signal 9, perhaps because memory ran out"), "{error}");
        let error = cleaned_by("i=0; while [ $i -lt 500 ]; do echo line $i >&2; i=$((i+1)); done; exit 1", AMPLE);
        let text = error.unwrap_err().to_string();
        assert!(text.contains("line 488\n") && text.ends_with("line 499") && !text.contains("line 487"), "{text}");
        let missing = "echo 'ImportError: libGL.so.1: cannot open shared object file' >&2; exit 1";
        let text = cleaned_by(missing, AMPLE).unwrap_err().to_string();
        assert!(text.contains("apt install libgl1") && text.contains("libGL.so.1"), "{text}");
    }

    #[test]
    fn a_process_that_runs_too_long_is_ended() {
        let start = Instant::now();
        let error = cleaned_by("exec /bin/sleep 60", Duration::from_millis(200)).unwrap_err();
        assert!(matches!(error, MeshlabError::TimedOut { .. }), "{error}");
        // One that leaves another behind, which holds its pipes open.
        let error = cleaned_by("/bin/sleep 20 & /bin/sleep 20", Duration::from_millis(200)).unwrap_err();
        assert!(error.to_string().contains("longer than 0.2 s"), "{error}");
        assert!(start.elapsed() < Duration::from_secs(15));
    }

    #[test]
    fn the_users_variables_do_not_reach_it() {
        let error = cleaned_by("echo \"[$CARGO_MANIFEST_DIR$USER$PYTHONPATH] $OMP_NUM_THREADS\" >&2; exit 1", AMPLE);
        assert!(error.unwrap_err().to_string().contains("[] 1"));
    }

    /// What a sound process gives back for the square: arrays by name, and the answer.
    struct Given {
        arrays: Vec<(&'static str, Vec<u8>)>,
        answer: serde_json::Value,
    }

    fn npy(descr: &str, shape: &[usize], bytes: &[u8]) -> Vec<u8> {
        [&npy_header_of(descr, shape), bytes].concat()
    }

    fn f64s(shape: &[usize], numbers: &[f64]) -> Vec<u8> {
        npy("<f8", shape, &numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>())
    }

    fn i32s(shape: &[usize], numbers: &[i32]) -> Vec<u8> {
        npy("<i4", shape, &numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>())
    }

    const PLACES: [f64; 12] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0];

    fn sound() -> Given {
        let figures = serde_json::json!({
            "vertices": 4, "triangles": 2, "components": 1, "non_manifold_edges": 0, "non_manifold_vertices": 0, "borders": 1,
            "border_m": 4.0, "area_m2": 1.0,
        });
        Given {
            arrays: vec![
                ("cleaned_positions", f64s(&[4, 3], &PLACES)),
                ("cleaned_triangles", i32s(&[2, 3], &[0, 1, 2, 1, 3, 2])),
                ("source_vertex", i32s(&[4], &[0, 1, 2, 3])),
                ("source_triangle", i32s(&[2], &[0, 1])),
                ("turned", npy("|u1", &[2], &[0, 0])),
                ("border", i32s(&[4], &[0, 0, 0, 0])),
            ],
            answer: serde_json::json!({
                "before": figures, "after": figures,
                "steps": {
                    "unused_vertices": 0, "exact_duplicates": 0, "near_duplicates": 0, "degenerate_triangles": 0,
                    "duplicate_triangles": 0, "non_manifold_triangles": 0, "split_vertices": 0,
                },
                "turned_triangles": 0, "removed": [], "warnings": [],
                "borders": [{ "length_m": 4.0, "vertices": 4, "place_m": [0.5, 0.5, 0.0], "is_hole": false }],
            }),
        }
    }

    fn given_back(given: &Given) -> Result<Cleaned, MeshlabError> {
        let folder = tempfile::tempdir().unwrap();
        for (name, bytes) in &given.arrays {
            fs::write(folder.path().join(format!("{name}.npy")), bytes).unwrap();
        }
        fs::write(folder.path().join("answer"), given.answer.to_string()).unwrap();
        let at = folder.path().display();
        cleaned_by(&format!("/bin/cp '{at}'/*.npy . && /bin/cat '{at}/answer'"), AMPLE)
    }

    #[test]
    fn a_sound_answer_is_taken() {
        let cleaned = given_back(&sound()).unwrap();
        assert_eq!(cleaned.triangles, [[0, 1, 2], [1, 3, 2]]);
        assert!((0..4).all(|vertex| cleaned.is_border(vertex)));
    }

    #[test]
    fn every_wrong_answer_is_refused() {
        let mut no_number = PLACES;
        no_number[4] = f64::NAN;
        let wrong: [(&str, Vec<u8>, &str); 13] = [
            ("cleaned_positions", f64s(&[12], &PLACES), "has the shape (12,)"),
            ("cleaned_positions", f64s(&[5, 3], &PLACES), "holds 96 bytes"),
            ("cleaned_positions", f64s(&[3, 3], &PLACES[..9]), "disagree on the number of vertices"),
            ("cleaned_positions", f64s(&[4, 3], &no_number), "a position is no place"),
            ("cleaned_positions", f64s(&[40_000, 3], &[0.0; 120_000]), "larger than the mesh that went in"),
            ("cleaned_positions", b"no array".to_vec(), "is no NPY file"),
            ("cleaned_triangles", i32s(&[2, 3], &[0, 1, 2, 1, 4, 2]), "a corner does not exist"),
            ("cleaned_triangles", i32s(&[2, 3], &[0, 1, 2, 1, -1, 2]), "a corner does not exist"),
            ("cleaned_triangles", i32s(&[2, 3], &[0, 1, 2, 1, 1, 2]), "one vertex twice"),
            ("source_vertex", i32s(&[4], &[0, 1, 2, 4]), "the source of a vertex does not exist"),
            ("source_triangle", i32s(&[2], &[1, 1]), "do not ascend"),
            ("turned", npy("|u1", &[2], &[0, 2]), "neither turned nor not"),
            ("border", i32s(&[4], &[0, 0, 0, 1]), "border that does not exist"),
        ];
        for (name, bytes, problem) in wrong {
            let mut given = sound();
            given.arrays.iter_mut().find(|(array, _)| *array == name).unwrap().1 = bytes;
            match given_back(&given) {
                Err(MeshlabError::Answer { problem: found, .. }) => assert!(found.contains(problem), "{name}: {found}"),
                other => panic!("{name}, {problem}: {other:?}"),
            }
        }
        for missing in 0..6 {
            let mut given = sound();
            given.arrays.remove(missing);
            assert!(matches!(given_back(&given), Err(MeshlabError::Answer { .. })));
        }
        for answer in [serde_json::json!(null), serde_json::json!({}), serde_json::json!("rubbish")] {
            assert!(matches!(given_back(&Given { answer, ..sound() }), Err(MeshlabError::Answer { .. })));
        }
        let mut given = sound();
        given.answer["after"]["border_m"] = serde_json::json!(-1.0);
        assert!(matches!(given_back(&given), Err(MeshlabError::Answer { .. })));
        let half = cleaned_by("echo '{\"before\": {'", AMPLE);
        assert!(matches!(half, Err(MeshlabError::Answer { .. })), "{half:?}");
    }
}
