#!/usr/bin/env bash
# Cargo and rustc 1.95.0 (Linux x86-64): a profile with opt-level "s" in which one package has opt-level 3, as small WebAssembly modules with one
# fast crate want it.
#
# A package whose loop adds scaled 16-bit deltas to floats. Expected: the package's opt-level holds for its loop, whatever the profile's `lto`
# is. Seen: with `lto = "off"` the loop multiplies four floats at a time; with `lto = "fat"` one, because whole programs are optimised at the
# profile's level, which vectorises nothing, and packages leave that to them. Nothing warns; the loop takes more than twice as long.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
mkdir -p blend/src app/src
cat > Cargo.toml <<'TOML'
[workspace]
resolver = "3"
members = ["blend", "app"]
[profile.small]
inherits = "release"
opt-level = "s"
codegen-units = 1
[profile.small.package.blend]
opt-level = 3
TOML
printf '[package]\nname = "blend"\nversion = "0.1.0"\nedition = "2024"\n' > blend/Cargo.toml
printf '[package]\nname = "app"\nversion = "0.1.0"\nedition = "2024"\n[dependencies]\nblend = { path = "../blend" }\n' > app/Cargo.toml
cat > blend/src/lib.rs <<'RUST'
#[unsafe(no_mangle)]
#[inline(never)]
pub fn add_deltas(sums: &mut [f32], deltas: &[i16], rate: f32) {
    for (sum, &delta) in sums.iter_mut().zip(deltas) {
        *sum += rate * f32::from(delta);
    }
}
RUST
cat > app/src/main.rs <<'RUST'
use std::hint::black_box;
use std::time::Instant;

fn main() {
    let (mut sums, deltas) = (vec![0.0; 16_384], vec![3; 16_384]);
    let mut times: Vec<f64> = (0..2_001)
        .map(|_| {
            let begin = Instant::now();
            blend::add_deltas(black_box(&mut sums), black_box(&deltas), black_box(0.5));
            begin.elapsed().as_secs_f64() * 1e6
        })
        .collect();
    times.sort_by(f64::total_cmp);
    println!("{:.1} us", times[1_000]);
}
RUST
rustc --version | sed 's/ (.*//; s/^/FINDING version /' | tee seen
for lto in off fat; do
    CARGO_PROFILE_SMALL_LTO=$lto cargo build --quiet --profile small --target-dir "$lto"
    echo "lto $lto: $("$lto/small/app")"
    of_loop=$(objdump -d --no-show-raw-insn "$lto/small/app" | awk '/<add_deltas>:/ { on = 1 } /^$/ { on = 0 } on')
    vectors=no
    grep -q mulps <<< "$of_loop" && vectors=yes
    echo "FINDING lto $lto: four at a time: $vectors" | tee -a seen
done
diff seen - <<'SEEN'
FINDING version rustc 1.95.0
FINDING lto off: four at a time: yes
FINDING lto fat: four at a time: no
SEEN
