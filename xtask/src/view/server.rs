//! The server: the page and what it asks for. Answers only requests that name this machine, serves nothing but what is listed here.

use super::state::State;
use super::wearer;
use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::{Path, Query, Request, State as Shared};
use axum::http::{HeaderValue, StatusCode, Uri, header};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use glam::{Quat, Vec3};
use kitsuke::arrays::Certificate;
use kitsuke::fit::FitData;
use kitsuke::measurement::Measurement;
use kitsuke::skeleton::{Bone, Pose};
use kitsuke_pipeline::look::scene::{joint_colours, region_colours};
use kitsuke_pipeline::measure;
use serde_json::json;
use std::collections::BTreeMap;
use std::net::SocketAddr;
use std::sync::Arc;

/// The page's files: path, type, content.
const PAGE: [(&str, &str, &[u8]); 12] = [
    ("/", "text/html; charset=utf-8", include_bytes!("../../viewer/index.html")),
    ("/style.css", "text/css; charset=utf-8", include_bytes!("../../viewer/style.css")),
    ("/main.js", JS, include_bytes!("../../viewer/main.js")),
    ("/stage.js", JS, include_bytes!("../../viewer/stage.js")),
    ("/colours.js", JS, include_bytes!("../../viewer/colours.js")),
    ("/controls.js", JS, include_bytes!("../../viewer/controls.js")),
    ("/kitsuke.js", JS, include_bytes!("../../../runtime/wasm/package/kitsuke.js")),
    ("/kitsuke.wasm", "application/wasm", include_bytes!("../../../runtime/wasm/package/kitsuke.wasm")),
    ("/vendor/three.module.js", JS, include_bytes!("../../viewer/vendor/three.module.js")),
    ("/vendor/three.core.js", JS, include_bytes!("../../viewer/vendor/three.core.js")),
    ("/vendor/OrbitControls.js", JS, include_bytes!("../../viewer/vendor/OrbitControls.js")),
    ("/favicon.ico", "image/x-icon", &[]),
];
const JS: &str = "text/javascript; charset=utf-8";

/// What pages may do: nothing that does not come from here. It has the hash of the import map in `index.html`, which must stand in the
/// page.
const POLICY: &str = include_str!("../../viewer/policy.txt");

/// Serves until the program is interrupted.
///
/// # Errors
/// When the address cannot be used.
pub async fn serve(state: Arc<State>, address: SocketAddr) -> Result<(), String> {
    let listener = tokio::net::TcpListener::bind(address).await;
    let listener = listener.map_err(|error| format!("cannot serve at {address}: {error}"))?;
    let address = listener.local_addr().map_err(|error| error.to_string())?;
    crate::places::say!("http://{address}/ (Ctrl-C ends it)");
    let guarded = middleware::from_fn(move |request, next| guard(address, request, next));
    let router = Router::new()
        .route("/state", get(changes))
        .route("/garments/{id}/pack", get(pack))
        .route("/garments/{id}/wearer", get(body))
        .route("/garments/{id}/covered", get(covered))
        .route("/garments/{id}/depths", post(depths))
        .route("/garments/{id}/facts", get(facts))
        .route("/garments/{id}/colours/{kind}", get(colours))
        .route("/motions", get(motions))
        .route("/motions/{name}", get(motion))
        .fallback(get(page))
        .with_state(state)
        .layer(guarded);
    axum::serve(listener, router).await.map_err(|error| error.to_string())
}

/// Refuses requests that name another host, as those of foreign pages do whose name was made to point here.
async fn guard(address: SocketAddr, request: Request, next: Next) -> Response {
    let host = request.headers().get(header::HOST).and_then(|host| host.to_str().ok()).unwrap_or_default();
    let names = [address.to_string(), format!("localhost:{}", address.port())];
    if !names.iter().any(|name| name == host) {
        return (StatusCode::FORBIDDEN, "this page is for its own machine").into_response();
    }
    let mut response = next.run(request).await;
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_SECURITY_POLICY, HeaderValue::from_static(POLICY.trim_ascii_end()));
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    response
}

async fn page(uri: Uri) -> Response {
    match PAGE.iter().find(|(path, ..)| *path == uri.path()) {
        Some((_, kind, content)) => ([(header::CONTENT_TYPE, *kind)], *content).into_response(),
        None => missing(),
    }
}

fn missing() -> Response {
    (StatusCode::NOT_FOUND, "there is nothing here").into_response()
}

fn binary(bytes: Vec<u8>) -> Response {
    ([(header::CONTENT_TYPE, "application/octet-stream")], Body::from(bytes)).into_response()
}

async fn changes(Shared(state): Shared<Arc<State>>, Query(query): Query<BTreeMap<String, u64>>) -> Response {
    let found = state.after(query.get("after").copied().unwrap_or(0)).await;
    ([(header::CONTENT_TYPE, "application/json")], found.to_string()).into_response()
}

async fn pack(Shared(state): Shared<Arc<State>>, Path(id): Path<String>) -> Response {
    state.pack_bytes(&id).map_or_else(missing, binary)
}

async fn body(Shared(state): Shared<Arc<State>>, Path(id): Path<String>) -> Response {
    state.source(&id).map_or_else(missing, |source| binary(wearer::bytes(&source.body)))
}

/// Per vertex of the wearer 1 where the cloth always covers her, else 0. Takes seconds, in a thread of its own.
async fn covered(Shared(state): Shared<Arc<State>>, Path(id): Path<String>) -> Response {
    let found = tokio::task::spawn_blocking(move || {
        let (pack, source) = (state.pack(&id)?, state.source(&id)?);
        Some(measure::covered::covered(pack.garment(), &source.body))
    });
    let flags = found.await.ok().flatten();
    flags.map_or_else(missing, |flags| binary(flags.into_iter().map(u8::from).collect()))
}

/// Per vertex of the kimono how deep it lies in the wearer in this pose, metres as 32-bit floats. The request is the pose: 223 such floats,
/// rotations by bone and the hips.
async fn depths(Shared(state): Shared<Arc<State>>, Path(id): Path<String>, pose: Bytes) -> Response {
    let (floats, rest) = pose.as_chunks::<4>();
    if !rest.is_empty() || floats.len() != 4 * Bone::COUNT + 3 {
        return (StatusCode::BAD_REQUEST, "a pose is 223 floats").into_response();
    }
    let floats: Vec<f32> = floats.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect();
    let mut pose = Pose { hips_translation_m: Vec3::from_slice(&floats[4 * Bone::COUNT..]), ..Pose::REST };
    for (rotation, floats) in pose.rotations.iter_mut().zip(floats.as_chunks::<4>().0) {
        *rotation = Quat::from_array(*floats);
    }
    let found = tokio::task::spawn_blocking(move || {
        let (pack, source) = (state.pack(&id)?, state.source(&id)?);
        let garment = pack.garment();
        let mut depths_m = vec![0.0; garment.unique_count()];
        for depth in measure::audit::pose_depths(&source.body, garment, 0, &pose) {
            depths_m[depth.vertex as usize] = depth.depth_m;
        }
        let mesh = &garment.data().mesh;
        Some((0..garment.vertex_count() as u32).flat_map(|v| depths_m[mesh.unique(v) as usize].to_le_bytes()).collect())
    });
    found.await.ok().flatten().map_or_else(missing, binary)
}

/// Three bytes per vertex.
async fn colours(Shared(state): Shared<Arc<State>>, Path((id, kind)): Path<(String, String)>) -> Response {
    let Some(pack) = state.pack(&id) else { return missing() };
    let found = match kind.as_str() {
        "regions" => region_colours(pack.garment()),
        "joints" => joint_colours(pack.garment()),
        _ => return missing(),
    };
    let mesh = &pack.garment().data().mesh;
    let all = (0..pack.garment().vertex_count() as u32).flat_map(|v| found[mesh.unique(v) as usize]);
    binary(all.collect())
}

/// What is known of a pack beside its shapes.
async fn facts(Shared(state): Shared<Arc<State>>, Path(id): Path<String>) -> Response {
    let Some(pack) = state.pack(&id) else { return missing() };
    let data = pack.garment().data();
    let row = |row: u16| match usize::from(row).checked_sub(1) {
        Some(target) => data.targets[target].name.as_str(),
        None => "base",
    };
    let certificate = data.certificate.as_ref().map(|certificate| {
        let Certificate { speed_mm_per_deg, fastest_joint, fastest_rows, step_mm, step_change_mm, left_out, nearest } =
            certificate;
        let left_out: Vec<_> = data
            .targets
            .iter()
            .zip(left_out)
            .map(|(target, e)| json!({ "target": target.name, "mean_mm": e.mean_mm, "p99_mm": e.p99_mm, "max_mm": e.max_mm }))
            .collect();
        json!({
            "speed_mm_per_deg": speed_mm_per_deg, "fastest_joint": fastest_joint.name(), "fastest_rows": fastest_rows.map(row),
            "step_mm": step_mm, "step_change_mm": step_change_mm,
            "nearest": { "rows": nearest.rows.map(row), "apart_deg": nearest.apart_deg }, "left_out": left_out,
        })
    });
    let wearer = pack.fit_data().ok().flatten().as_ref().map(|fit: &FitData| {
        let bodies = fit.bodies.iter().map(|body| {
            let known = Measurement::ALL.into_iter().filter_map(|m| Some((m.name(), body.measurements.get(m)?)));
            json!({ "name": body.name, "measurements": known.collect::<BTreeMap<_, _>>() })
        });
        let ranges = Measurement::ALL.into_iter().map(|m| (m.name(), m.plausible_m()));
        json!({ "bodies": bodies.collect::<Vec<_>>(), "plausible": ranges.collect::<BTreeMap<_, _>>() })
    });
    let found = json!({
        "bones": data.poses.bones.iter().map(|bone| bone.name()).collect::<Vec<_>>(),
        "limited": data.pose_limits.iter().flat_map(|limit| &limit.bones).map(|bone| bone.name()).collect::<Vec<_>>(),
        "bytes": pack.sections().iter().map(|section| section.stored_length).sum::<usize>(),
        "certificate": certificate,
        "wearer": wearer,
    });
    ([(header::CONTENT_TYPE, "application/json")], found.to_string()).into_response()
}

/// The recordings in the assets' folder `motions`.
fn motion_files(state: &State) -> Vec<String> {
    let files = std::fs::read_dir(state.places.assets.join("motions")).into_iter().flatten().flatten();
    let mut names: Vec<String> = files
        .filter(|file| file.file_type().is_ok_and(|kind| kind.is_file()))
        .filter_map(|file| file.file_name().into_string().ok())
        .collect();
    names.sort();
    names
}

async fn motions(Shared(state): Shared<Arc<State>>) -> Response {
    ([(header::CONTENT_TYPE, "application/json")], json!(motion_files(&state)).to_string()).into_response()
}

async fn motion(Shared(state): Shared<Arc<State>>, Path(name): Path<String>) -> Response {
    // Only names that the list has: no path leads out of the folder.
    let known = motion_files(&state).into_iter().find(|file| *file == name);
    let bytes = known.and_then(|name| std::fs::read(state.places.assets.join("motions").join(name)).ok());
    bytes.map_or_else(missing, binary)
}
