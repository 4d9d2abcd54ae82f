"""Texture coordinates for a mesh that has none, by xatlas (MIT), in a process of its own: kitsuke starts this file and reads what it writes.

stdin: one JSON object: folder, padding_px, size_px.
folder: positions.npy (float64, N x 3, metres) and triangles.npy (int32, M x 3); what is made is written beside them:
  source_vertex.npy  int32, U: the vertex that each texture coordinate belongs to (xatlas splits vertices along its cuts)
  uv_triangles.npy   int32, M x 3: the texture coordinate of each corner, triangles and corners in the order of the source
  uv.npy             float64, U x 2: in pixels of the atlas, u and v alike
  chart.npy          int32, U: the chart that each texture coordinate lies in
stdout: one JSON object: width_px, height_px. What the library prints goes to stderr.
"""

import json
import os
import sys


def main():
    answer_file = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    # One thread, where the system lets a process choose: xatlas takes as many as it may have.
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    import numpy as np
    import xatlas

    request = json.load(sys.stdin)
    at = lambda name: os.path.join(request["folder"], name + ".npy")
    positions = np.load(at("positions"), allow_pickle=False)
    triangles = np.load(at("triangles"), allow_pickle=False)
    atlas = xatlas.Atlas()
    atlas.add_mesh(np.ascontiguousarray(positions, dtype="f4"), np.ascontiguousarray(triangles, dtype="u4"))
    charts, packing = xatlas.ChartOptions(), xatlas.PackOptions()
    # Without it charts come out mirrored; and rotating charts exchanges u and v, which mirrors them again.
    charts.fix_winding = True
    packing.rotate_charts = False
    packing.rotate_charts_to_axis = True
    packing.bilinear = True
    packing.padding = request["padding_px"]
    packing.resolution = request["size_px"]
    atlas.generate(charts, packing)
    if atlas.atlas_count != 1:
        sys.exit(f"xatlas made {atlas.atlas_count} atlases of the mesh instead of one")
    source_vertex, uv_triangles, uv = atlas[0]
    _, chart = atlas.get_mesh_vertex_assignment(0)
    # What comes out is divided by width and by height, which are not the same: one scale for both is what it was made with.
    size = np.array([atlas.width, atlas.height], dtype="f8")
    np.save(at("source_vertex"), source_vertex.astype("<i4"))
    np.save(at("uv_triangles"), np.ascontiguousarray(uv_triangles, dtype="<i4"))
    np.save(at("uv"), np.ascontiguousarray(uv.astype("f8") * size, dtype="<f8"))
    np.save(at("chart"), chart.astype("i8").astype("<i4"))
    json.dump({"width_px": int(atlas.width), "height_px": int(atlas.height)}, answer_file, allow_nan=False)
    answer_file.write("\n")
    answer_file.flush()


main()
