#!/usr/bin/env bash
# rapier-cloth-core 0.3.0 (Linux x86-64): a flat square sheet that hangs by a row, with self-contact as `ClothContactSettings::default()` has it.
#
# A sheet of 96 x 96 particles and one of 100 x 100, edges 15 mm, never near themselves but where their triangles share vertices. Expected: both
# are stepped, or the larger one is refused when the settings are given. Seen: the larger one ends with an error in its very first step, because
# neighbours in the mesh count as candidate pairs, of which the standard limit allows fewer than a sheet of that size has. Whoever simulates
# garments has to raise `limits.candidate_pairs` with the size of the mesh.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
mkdir src
printf '[package]\nname = "sheets"\nversion = "0.1.0"\nedition = "2024"\n[dependencies]\nrapier-cloth-core = "=0.3.0"\n[workspace]\n' > Cargo.toml
cat > src/main.rs <<'RUST'
use rapier_cloth_core::{Cloth, ClothContactSettings, ClothMaterial, ClothMesh, Solver, SolverSettings, Vec3};

fn main() {
    let standard = ClothContactSettings::default();
    println!("FINDING candidate pairs allowed: {}", standard.limits.candidate_pairs);
    for side in [96, 100] {
        let (mut positions, mut triangles) = (Vec::new(), Vec::new());
        for row in 0..side {
            for column in 0..side {
                positions.push(Vec3::new(0.015 * column as f32, 2.0, 0.015 * row as f32));
                if row > 0 && column > 0 {
                    let d: u32 = row * side + column;
                    triangles.extend([[d - side - 1, d - side, d - 1], [d - side, d, d - 1]]);
                }
            }
        }
        let mesh = ClothMesh::new(positions.clone(), triangles).expect("a flat sheet is a mesh");
        let material = ClothMaterial { contact_radius: standard.thickness, ..ClothMaterial::default() };
        let mut cloth = Cloth::new(mesh, material).expect("the material is sound");
        for particle in 0..side {
            cloth.pin(particle, positions[particle as usize]).expect("the particle is there");
        }
        cloth.set_contact_settings(Some(standard.clone())).expect("the standard settings are sound");
        let mut solver = Solver::new();
        let mut ended = "20 steps".to_owned();
        for step in 0..20 {
            let gravity = Vec3::new(0.0, -9.81, 0.0);
            if let Err(error) = solver.step(&mut cloth, 1.0 / 600.0, gravity, &SolverSettings::default()) {
                ended = format!("step {step} fails: {error:?}");
                break;
            }
        }
        println!("FINDING {side} x {side}: {ended}");
    }
}
RUST
cargo run --quiet --release | tee seen
diff <(sed 's/ *{.*//' seen) - <<'SEEN'
FINDING candidate pairs allowed: 2000000
FINDING 96 x 96: 20 steps
FINDING 100 x 100: step 0 fails: CollisionBudgetExceeded
SEEN
