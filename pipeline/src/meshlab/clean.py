"""Cleans a mesh with pymeshlab (GPL-3), in a process of its own: kitsuke starts this file and reads what it writes.

stdin: one JSON object: folder, merge_m, least_share, least_triangles, hole_m.
folder: positions.npy (float64, N x 3, metres) and triangles.npy (int32, M x 3); what is cleaned is written beside them:
  cleaned_positions.npy  float64, V x 3
  cleaned_triangles.npy  int32, F x 3; corners in the order of the source triangle's, the last two exchanged where turned
  source_triangle.npy    int32, F, ascending
  source_vertex.npy      int32, V, ascending
  turned.npy             uint8, F: 1 where the triangle faces the other way than its source
  border.npy             int32, V: the border on which the vertex lies, or -1
stdout: one JSON object, see `main`. What the libraries print goes to stderr.
"""

import json
import os
import sys


def components(vertex_count, triangles):
    """The smallest vertex of each vertex's component: what corners of triangles join."""
    import numpy as np

    label = np.arange(vertex_count)
    while len(triangles):
        corners = label[triangles]
        joined = label.copy()
        np.minimum.at(joined, corners.ravel(), corners.min(axis=1).repeat(3))
        while True:
            jumped = joined[joined]
            if np.array_equal(jumped, joined):
                break
            joined = jumped
        if np.array_equal(joined, label):
            break
        label = joined
    return label


def areas(positions, triangles):
    import numpy as np

    a, b, c = (positions[triangles[:, i]] for i in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def edges_of(triangles):
    """Undirected edges, each once, and how many triangles have each. Triangles with a corner twice do not count."""
    import numpy as np

    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    directed = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    if not len(directed):
        return directed, np.zeros(0, int)
    return np.unique(np.sort(directed, axis=1), axis=0, return_counts=True)


def count_non_manifold_vertices(vertex_count, triangles, edges, counts):
    """Vertices without non-manifold edges whose triangles do not hang together by edges at the vertex: there are more ends of border
    edges than a single fan has, or a closed fan besides."""
    import numpy as np

    if not len(triangles):
        return 0
    # Nodes are corners; two corners of one vertex are joined where their triangles share an edge at it.
    corner = np.arange(3 * len(triangles)).reshape(-1, 3)
    sides, at, first = [], [], []
    for i in range(3):
        j = (i + 1) % 3
        low = np.minimum(triangles[:, i], triangles[:, j])
        high = np.maximum(triangles[:, i], triangles[:, j])
        key = low.astype(np.int64) * vertex_count + high
        for k in (i, j):
            sides.append(key)
            at.append(triangles[:, k])
            first.append(corner[:, k])
    sides, at, first = (np.concatenate(x) for x in (sides, at, first))
    order = np.lexsort((first, at, sides))
    sides, at, first = sides[order], at[order], first[order]
    same = (sides[1:] == sides[:-1]) & (at[1:] == at[:-1])
    joined = np.stack([first[:-1][same], first[1:][same], first[1:][same]], axis=1)
    label = components(3 * len(triangles), joined)
    fans = np.unique(np.stack([triangles.ravel(), label], axis=1), axis=0)
    fan_count = np.bincount(fans[:, 0], minlength=vertex_count)
    at_edge = np.zeros(vertex_count, bool)
    at_edge[edges[counts > 2].ravel()] = True
    return int(((fan_count > 1) & ~at_edge).sum())


def measured(positions, triangles):
    """What a mesh is, in figures."""
    import numpy as np

    used = np.unique(triangles)
    edges, counts = edges_of(triangles)
    border = edges[counts == 1]
    length = np.linalg.norm(positions[border[:, 0]] - positions[border[:, 1]], axis=1).sum()
    as_pairs = np.concatenate([border, border[:, 1:]], axis=1)
    loops = np.unique(components(len(positions), as_pairs)[border[:, 0]]) if len(border) else border
    return {
        "vertices": len(positions),
        "triangles": len(triangles),
        "components": len(np.unique(components(len(positions), triangles)[used])),
        "non_manifold_edges": int((counts > 2).sum()),
        "non_manifold_vertices": count_non_manifold_vertices(len(positions), triangles, edges, counts),
        "borders": len(loops),
        "border_m": float(length),
        "area_m2": float(areas(positions, triangles).sum()),
    }


def repaired(positions, triangles, merge_m, warnings):
    """What pymeshlab does: positions, triangles, their sources, and counts of each step."""
    import numpy as np
    import pymeshlab

    mesh = pymeshlab.Mesh(positions, triangles)
    # Only triangles carry their source: splitting vertices gives the new ones other vertices' attributes (pymeshlab 2025.7.post1).
    mesh.add_face_custom_scalar_attribute(np.arange(len(triangles), dtype=float), "source")
    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(mesh)

    def step(filter, **options):
        """How many vertices and triangles the filter took away."""
        current = meshes.current_mesh()
        before = (current.vertex_number(), current.face_number())
        # Filters refuse a mesh without faces, where nothing is left to do.
        if before[1] == 0:
            return 0, 0
        meshes.apply_filter(filter, **options)
        current = meshes.current_mesh()
        return before[0] - current.vertex_number(), before[1] - current.face_number()

    unused = step("meshing_remove_unreferenced_vertices")[0]
    exact, collapsed_exact = step("meshing_remove_duplicate_vertices")
    near, collapsed_near = step("meshing_merge_close_vertices", threshold=pymeshlab.PureValue(merge_m))
    degenerate = step("meshing_remove_null_faces")[1]
    duplicate = step("meshing_remove_duplicate_faces")[1]
    non_manifold = step("meshing_repair_non_manifold_edges", method="Remove Faces")[1]
    step("meshing_remove_unreferenced_vertices")
    split = -step("meshing_repair_non_manifold_vertices", vertdispratio=0.0)[0]
    try:
        step("meshing_re_orient_faces_coherently")
    except pymeshlab.PyMeshLabException as error:
        warnings.append(f"faces were not oriented: {error}")
    steps = {
        "unused_vertices": unused,
        "exact_duplicates": exact,
        "near_duplicates": near,
        "degenerate_triangles": collapsed_exact + collapsed_near + degenerate,
        "duplicate_triangles": duplicate,
        "non_manifold_triangles": non_manifold,
        "split_vertices": split,
    }
    mesh = meshes.current_mesh()
    source_triangle = mesh.face_custom_scalar_attribute_array("source").astype(np.int64)
    return mesh.vertex_matrix(), mesh.face_matrix().astype(np.int64), source_triangle, steps


def main():
    # pymeshlab's C++ prints to stdout; the answer must stand there alone.
    answer_file = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    import numpy as np

    request = json.load(sys.stdin)
    at = lambda name: os.path.join(request["folder"], name + ".npy")
    positions = np.load(at("positions"), allow_pickle=False)
    triangles = np.load(at("triangles"), allow_pickle=False).astype(np.int64)
    warnings = []
    before = measured(positions, triangles)
    v, t, source_triangle, steps = repaired(positions, triangles, request["merge_m"], warnings)

    # In the order of the source, whatever order the filters left.
    order = np.argsort(source_triangle, kind="stable")
    t, source_triangle = t[order], source_triangle[order]
    # Corners as in the source: the rotation or mirror image whose corners lie nearest to those of the source.
    orders = np.array([[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]])
    wanted = positions[triangles[source_triangle]]
    far = np.stack([((v[t[:, o]] - wanted) ** 2).sum(axis=(1, 2)) for o in orders], axis=1)
    best = far.argmin(axis=1) if len(t) else np.zeros(0, int)
    turned = best >= 3
    t = np.take_along_axis(t, orders[best], axis=1)
    # `t` has the source's corners in the source's order; those turned get their last two exchanged at the end.
    # Of the source vertices that became one, the nearest, then the first.
    corners, sources = t.ravel(), triangles[source_triangle].ravel()
    distance = ((v[corners] - positions[sources]) ** 2).sum(axis=1)
    by_vertex = np.lexsort((sources, distance, corners))
    known, first = np.unique(corners[by_vertex], return_index=True)
    source_vertex = np.zeros(len(v), np.int64)
    source_vertex[known] = sources[by_vertex][first]
    label = components(len(v), t)
    area = areas(v, t)
    total = area.sum()
    of_triangle = label[t[:, 0]] if len(t) else np.zeros(0, int)
    names, of_triangle = np.unique(of_triangle, return_inverse=True)
    of_triangle = of_triangle.ravel()
    area_of = np.bincount(of_triangle, weights=area, minlength=len(names))
    count_of = np.bincount(of_triangle, minlength=len(names))
    # Most of a component says which way is out: filters start from any triangle.
    turned_area = np.bincount(of_triangle, weights=area * turned, minlength=len(names))
    turned ^= (turned_area > area_of / 2)[of_triangle]

    keep = (area_of >= request["least_share"] * total) & (count_of >= request["least_triangles"])
    if len(names) and not keep.any():
        keep[area_of.argmax()] = True
    removed = []
    for i in np.flatnonzero(~keep):
        mine = t[of_triangle == i]
        middle = v[np.unique(mine)].mean(axis=0)
        removed.append({"triangles": int(count_of[i]), "area_m2": float(area_of[i]), "place_m": middle.tolist()})
    removed.sort(key=lambda bit: -bit["area_m2"])
    kept = keep[of_triangle] if len(t) else np.zeros(0, bool)
    t, turned, source_triangle = t[kept], turned[kept], source_triangle[kept]
    used = np.unique(t)
    used = used[np.lexsort((used, source_vertex[used]))]
    new = np.full(len(v), -1)
    new[used] = np.arange(len(used))
    v, source_vertex, t = v[used], source_vertex[used], new[t]
    t[turned] = t[turned][:, [0, 2, 1]]

    edges, counts = edges_of(t)
    open_edges = edges[counts == 1]
    on = np.full(len(v), -1)
    borders = []
    if len(open_edges):
        label = components(len(v), np.concatenate([open_edges, open_edges[:, 1:]], axis=1))[open_edges[:, 0]]
        names, of_edge = np.unique(label, return_inverse=True)
        of_edge = of_edge.ravel()
        lengths = np.linalg.norm(v[open_edges[:, 0]] - v[open_edges[:, 1]], axis=1)
        length_of = np.bincount(of_edge, weights=lengths)
        # The longest first, ties by the first vertex.
        rank = np.empty(len(names), int)
        by_length = np.lexsort((names, -length_of))
        rank[by_length] = np.arange(len(names))
        on[open_edges.ravel()] = rank[of_edge].repeat(2)
        for i in by_length:
            mine = np.unique(open_edges[of_edge == i])
            borders.append({
                "length_m": float(length_of[i]),
                "vertices": len(mine),
                "place_m": v[mine].mean(axis=0).tolist(),
                "is_hole": bool(length_of[i] <= request["hole_m"]),
            })
    # Where two triangles run along their edge the same way, they face differently.
    directed = np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])
    same_way = len(directed) - len(np.unique(directed, axis=0)) if len(directed) else 0
    if same_way:
        warnings.append(f"{same_way} edges join triangles that face differently: this surface has no two sides")

    np.save(at("cleaned_positions"), np.ascontiguousarray(v, dtype="<f8"))
    np.save(at("cleaned_triangles"), np.ascontiguousarray(t, dtype="<i4"))
    np.save(at("source_triangle"), source_triangle.astype("<i4"))
    np.save(at("source_vertex"), source_vertex.astype("<i4"))
    np.save(at("turned"), turned.astype("|u1"))
    np.save(at("border"), on.astype("<i4"))
    answer = {
        "before": before,
        "after": measured(v, t),
        "steps": steps,
        "turned_triangles": int(turned.sum()),
        "removed": removed,
        "borders": borders,
        "warnings": warnings,
    }
    json.dump(answer, answer_file, allow_nan=False)
    answer_file.write("\n")
    answer_file.flush()


main()
