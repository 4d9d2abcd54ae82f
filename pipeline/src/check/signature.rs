//! Which program's habits explain that a file is not the base in another pose: each leaves its own trace in how vertices
//! and faces are numbered. Knows no positions.

use crate::source::obj::Mesh;

/// A trace of a program.
pub(super) struct Signature {
    /// What was done to the mesh, as the rest of a sentence.
    pub said: &'static str,
    /// What to do.
    pub help: &'static str,
}

/// The trace that a target bears and the base does not.
pub(super) fn find(base: &Mesh, target: &Mesh) -> Option<Signature> {
    let signature = |said, help| Some(Signature { said, help });
    let largest = |mesh: &Mesh| mesh.faces.iter().map(|face| face.corner_count).max().unwrap_or(0);
    let triangle_count = |mesh: &Mesh| mesh.faces.iter().map(|face| face.corner_count as usize - 2).sum::<usize>();
    if has_vertex_per_corner(target) && !has_vertex_per_corner(base) {
        return signature(
            "every corner of every face has a vertex of its own, as VTK and viewers write it",
            "Export from the program that made the garment, so that faces share their vertices; what VTK or a viewer has saved \
             cannot be put back in order.",
        );
    }
    if largest(base) > 3 && largest(target) == 3 {
        let kept = base.faces.iter().filter(|face| face.corner_count == 3).count();
        if target.faces.len() == kept {
            return signature(
                "only the triangles are left, quads and larger faces are gone, as when open3d has saved it",
                "Export from the program that made the garment, or triangulate base and targets alike before open3d reads them.",
            );
        }
        if target.faces.len() == triangle_count(base) {
            return signature(
                "quads and larger faces are cut into triangles here",
                "Export base and targets with the same choice of quads or triangles.",
            );
        }
    }
    if base.positions.len() == target.positions.len() && has_other_piece_order(base, target) {
        return signature(
            "the same pieces stand in another order, as when Blender has saved several objects",
            "Join the pieces into one object before exporting (Blender: Ctrl+J; import with Split by Object and Split by Group \
             off), so that the order of vertices stays.",
        );
    }
    if is_numbered_by_first_use(target) && !is_numbered_by_first_use(base) {
        return signature(
            "vertices are numbered by their first use in faces, as trimesh and tobj number them",
            "Load with trimesh's process=False and maintain_order=True, or export from the program that made the garment; vertex \
             i must be the same cloth point in every file.",
        );
    }
    None
}

fn has_vertex_per_corner(mesh: &Mesh) -> bool {
    let mut used = vec![false; mesh.positions.len()];
    let is_new = |vertex: u32| !std::mem::replace(&mut used[vertex as usize], true);
    mesh.faces.len() > 1
        && mesh.corners.len() == mesh.positions.len()
        && mesh.corners.iter().map(|corner| corner.vertex).all(is_new)
}

fn is_numbered_by_first_use(mesh: &Mesh) -> bool {
    let mut next = 0;
    let follows = |vertex: u32| {
        next += u32::from(vertex == next);
        vertex < next
    };
    mesh.corners.iter().map(|corner| corner.vertex).all(follows) && next as usize == mesh.positions.len()
}

/// Whether names of parts, or pieces of cloth that hang together, are the same but in another order.
fn has_other_piece_order(base: &Mesh, target: &Mesh) -> bool {
    is_reordered(&base.parts, &target.parts) || is_reordered(&pieces(base), &pieces(target))
}

fn is_reordered<T: Ord + Clone>(a: &[T], b: &[T]) -> bool {
    let sorted = |list: &[T]| {
        let mut list = list.to_vec();
        list.sort_unstable();
        list
    };
    a != b && sorted(a) == sorted(b)
}

/// The pieces that hang together, by their first vertices: the faces of each, their vertices counted within the piece.
fn pieces(mesh: &Mesh) -> Vec<Vec<Vec<u32>>> {
    let piece_of = piece_of_vertices(mesh);
    let mut counts = vec![0; mesh.positions.len()];
    let within = |piece: &u32| {
        counts[*piece as usize] += 1;
        counts[*piece as usize] - 1
    };
    let within: Vec<u32> = piece_of.iter().map(within).collect();
    let mut pieces = vec![Vec::new(); mesh.positions.len()];
    for face in &mesh.faces {
        let mut cycle: Vec<u32> = mesh.corners_of(face).iter().map(|corner| within[corner.vertex as usize]).collect();
        let least = (0..cycle.len()).min_by_key(|&i| cycle[i]).unwrap_or(0);
        cycle.rotate_left(least);
        pieces[piece_of[mesh.corners_of(face)[0].vertex as usize] as usize].push(cycle);
    }
    pieces.retain(|faces| !faces.is_empty());
    pieces.iter_mut().for_each(|faces| faces.sort_unstable());
    pieces
}

/// The least vertex of the piece in which each vertex hangs.
pub(super) fn piece_of_vertices(mesh: &Mesh) -> Vec<u32> {
    // A forest whose roots are the least vertices.
    let mut above: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    let root = |above: &mut Vec<u32>, mut vertex: u32| {
        while above[vertex as usize] != vertex {
            above[vertex as usize] = above[above[vertex as usize] as usize];
            vertex = above[vertex as usize];
        }
        vertex
    };
    for face in &mesh.faces {
        let corners = mesh.corners_of(face);
        for corner in &corners[1..] {
            let (a, b) = (root(&mut above, corners[0].vertex), root(&mut above, corner.vertex));
            above[a.max(b) as usize] = a.min(b);
        }
    }
    (0..above.len() as u32).map(|vertex| root(&mut above, vertex)).collect()
}
