#!/usr/bin/env bash
# trimesh 5.2.0, registration.nricp_amberg and nricp_sumner, where they raise.
#
# A sphere 2 wide with one vertex that no triangle uses, laid onto an ellipsoid 2.2 x 2 x 1.8. Expected: an answer, or an exception and the caller's two
# meshes as they were. Seen: an exception of the solver, and both meshes 0.29 times as large: they are scaled in place to the source's size before the
# equations and scaled back only behind them. Who catches the exception and goes on (the other function, the next scan) measures and saves in another unit.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip -q install trimesh==5.2.0 scipy==1.17.1 rtree==1.4.1 numpy==2.4.6
venv/bin/python - <<'PY' | tee seen
import numpy as np
import trimesh
from trimesh.registration import nricp_amberg, nricp_sumner

sphere = trimesh.creation.icosphere(3)
for function in (nricp_amberg, nricp_sumner):
    base = trimesh.Trimesh(np.vstack([[[0, 0, 0]], sphere.vertices]), sphere.faces + 1, process=False)
    scan = trimesh.Trimesh(sphere.vertices * [1.1, 1, 0.9], sphere.faces, process=False)
    try:
        function(base, scan)
        said = "an answer"
    except RuntimeError as error:
        said = error
    width = lambda mesh: f"{np.ptp(mesh.vertices[:, 0]):.3f}"
    print(f"{function.__name__}: {said}; base 2.000 -> {width(base)} wide, scan 2.200 -> {width(scan)}")
PY
diff seen - <<'SEEN'
nricp_amberg: Factor is exactly singular; base 2.000 -> 0.577 wide, scan 2.200 -> 0.635
nricp_sumner: Factor is exactly singular; base 2.000 -> 0.577 wide, scan 2.200 -> 0.635
SEEN
