#!/usr/bin/env bash
# Rust crate gltf 1.4.1, Gltf::from_slice.
#
# Two valid files. The first is a triangle with a morph target that moves nothing, written as an accessor without bufferView and sparse, which
# glTF 2.0 says is all zeros (accessor.bufferView: "When undefined, the accessor MUST be initialized with zeros"). The second has a texture
# whose only picture is WebP, by EXT_texture_webp. Expected: both are read, if need be without the texture.
# Seen: both files are refused whole, "Missing data". So a body whose mesh, joints and weights are sound cannot be read for the sake of parts
# that nobody asked for.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
mkdir src
cat > Cargo.toml <<'TOML'
[package]
name = "probe"
version = "0.0.0"
edition = "2021"

[dependencies]
gltf = "=1.4.1"
TOML
cat > src/main.rs <<'RUST'
const ZEROS: &str = r#"{"asset": {"version": "2.0"},
    "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}],
    "accessors": [
        {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
        {"componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [0, 0, 0]}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "targets": [{"POSITION": 1}]}]}]}"#;
const WEBP: &str = r#"{"asset": {"version": "2.0"}, "extensionsUsed": ["EXT_texture_webp"],
    "images": [{"uri": "skin.webp", "mimeType": "image/webp"}],
    "textures": [{"extensions": {"EXT_texture_webp": {"source": 0}}}]}"#;

fn main() {
    for (what, text) in [("zeros", ZEROS), ("webp", WEBP)] {
        match gltf::Gltf::from_slice(text.as_bytes()) {
            Ok(_) => println!("{what}: read"),
            Err(error) => println!("{what}: {error}"),
        }
    }
}
RUST
cargo run -q | tee seen
diff seen - <<'SEEN'
zeros: invalid glTF: accessors[1].bufferView: Missing data;
webp: invalid glTF: textures[0].source: Missing data;
SEEN
