//! Suggested poses: what they are expected to gain, against systems solved from scratch, and which of two is chosen.

use super::blending::KOMON;
use kitsuke::Garment;
use kitsuke::arrays::Group;
use kitsuke::pose_blend::rbf::{embed_poses, embedding_length, rows_of_layer};
use kitsuke::skeleton::{Bone, Pose};
use kitsuke_pipeline::measure::pose_space::poses;
use kitsuke_pipeline::measure::suggest::outlook;

/// Variance of a limb's shape at `pose` when these rows of the table and these poses are its samples.
fn variance(garment: &Garment, layer: usize, group: &Group, added: &[Pose], pose: &Pose) -> f64 {
    let data = garment.data();
    let kernel = &data.rbf.as_ref().unwrap().layers[layer];
    let mut samples: Vec<(Pose, f64)> = Vec::new();
    for row in rows_of_layer(data, layer) {
        let of_row = data.poses.pose(row);
        // The base is its own mirror image.
        if group.mirror.is_some() && row > 0 {
            samples.push((of_row.mirrored(), kernel.mirror_ridge));
        }
        samples.push((of_row, kernel.ridge));
    }
    for pose in added {
        samples.push((pose.clone(), kernel.ridge));
        if group.mirror.is_some() {
            samples.push((pose.mirrored(), kernel.mirror_ridge));
        }
    }
    let near = |a: &Pose, b: &Pose| {
        let places = embed_poses(&group.chain, [a.clone(), b.clone()]);
        let (a, b) = places.split_at(embedding_length(&group.chain));
        1.0 / (1.0 + a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>()).sqrt()
    };
    // (K + ridge) w = k by Gauss's elimination without pivots, for the matrix is positive definite.
    let n = samples.len();
    let ridge = |i: usize, j: usize| if i == j { samples[i].1 } else { 0.0 };
    let mut rows: Vec<Vec<f64>> = (0..n)
        .map(|i| {
            let system = (0..n).map(|j| near(&samples[i].0, &samples[j].0) + ridge(i, j));
            system.chain([near(&samples[i].0, pose)]).collect()
        })
        .collect();
    let wanted: Vec<f64> = rows.iter().map(|row| row[n]).collect();
    for k in 0..n {
        let (above, below) = rows.split_at_mut(k + 1);
        for row in below {
            let factor = row[k] / above[k][k];
            row[k..].iter_mut().zip(&above[k][k..]).for_each(|(a, b)| *a -= factor * b);
        }
    }
    let mut weights = vec![0.0; n];
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| rows[k][j] * weights[j]).sum();
        weights[k] = (rows[k][n] - known) / rows[k][k];
    }
    1.0 - weights.iter().zip(wanted).map(|(a, b)| a * b).sum::<f64>()
}

#[test]
fn expected_gains_are_those_of_systems_with_the_poses_as_samples() {
    let (_, garment) = &*KOMON;
    let (taken, offered) = (poses(garment, 77, 12), poses(garment, 777, 5));
    for layer in 0..2 {
        let found = outlook(garment, layer, &taken, &offered, 2).unwrap();
        let rms = |added: &[Pose]| {
            let groups = &garment.data().rbf.as_ref().unwrap().layers[layer].groups;
            let of_pose = |pose: &Pose| -> f64 {
                let pose = pose.with_arms_untwisted();
                groups.iter().map(|group| variance(garment, layer, group, added, &pose)).sum()
            };
            (taken.iter().map(of_pose).sum::<f64>() / taken.len() as f64).sqrt()
        };
        let mut added = Vec::new();
        let (start, start_mm) = (rms(&added), found.before_mm);
        for suggestion in &found.suggestions {
            added.push(offered[suggestion.candidate].with_arms_untwisted());
            let (wanted, got) = (rms(&added) / start, suggestion.after_mm / start_mm);
            assert!((wanted - got).abs() < 1e-6, "layer {layer}: {got}, not {wanted}");
            assert!(got < 1.0, "a sample more is no loss");
        }
    }
}

#[test]
fn a_pose_that_is_there_already_is_not_suggested_before_one_that_is_not() {
    let (_, garment) = &*KOMON;
    let known = garment.data().poses.pose(1);
    let bent = Pose::REST.with(Bone::LeftLowerArm, glam::Quat::from_rotation_y(-1.9));
    let of_legs = Pose::REST.with(Bone::LeftUpperLeg, glam::Quat::from_rotation_x(-0.4));
    let found = outlook(garment, 0, &poses(garment, 7, 50), &[known, of_legs, bent], 3).unwrap();
    let chosen: Vec<usize> = found.suggestions.iter().map(|suggestion| suggestion.candidate).collect();
    assert_eq!(chosen, [2, 0], "what turns legs alone says nothing about sleeves");
    assert!(found.suggestions[1].error_mm < 0.5 * found.suggestions[0].error_mm);
}
