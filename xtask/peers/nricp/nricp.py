"""trimesh's non-rigid registration (MIT), in a process of its own: `cargo xtask compare-registration` starts this file and reads what it writes.

stdin: one JSON object: folder, method (nricp_amberg or nricp_sumner).
folder: base/ and scan/, each with positions.npy (float64, N x 3, metres) and triangles.npy (int32, M x 3); written beside them:
  laid.npy  float64, N x 3: the base's vertices as the method lays them onto the scan
stdout: one JSON object: seconds, of the method alone. What the library prints goes to stderr.
"""

import json
import os
import sys
import time


def main():
    answer_file = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    import numpy as np
    import trimesh

    request = json.load(sys.stdin)
    at = lambda *names: os.path.join(request["folder"], *names)

    def mesh(name):
        positions = np.load(at(name, "positions.npy"), allow_pickle=False)
        triangles = np.load(at(name, "triangles.npy"), allow_pickle=False)
        # Processing would merge vertices, and the base's numbers would be lost.
        return trimesh.Trimesh(positions, triangles, process=False)

    methods = {"nricp_amberg": trimesh.registration.nricp_amberg, "nricp_sumner": trimesh.registration.nricp_sumner}
    base, scan = mesh("base"), mesh("scan")
    begin = time.perf_counter()
    laid = methods[request["method"]](base, scan)
    seconds = time.perf_counter() - begin
    np.save(at("laid.npy"), np.ascontiguousarray(laid, dtype="<f8"))
    json.dump({"seconds": seconds}, answer_file, allow_nan=False)
    answer_file.write("\n")
    answer_file.flush()


main()
