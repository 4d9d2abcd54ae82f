#!/usr/bin/env bash
# trimesh 5.2.0, registration.nricp_amberg with its standard steps, where the scan lacks a piece of the base.
#
# A base of two pieces, a sphere 2 wide and beside it one 0.4 wide, laid onto an ellipsoid alone, as a scanner that saw one piece gives it. Expected: the
# unseen piece stays as it is (nricp_sumner does that), or an exception. Seen: all its 42 vertices in one point inside the other piece, finite, with neither
# an exception nor a warning: nothing holds a piece none of whose vertices has found its place, and the equations have no one answer for it.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip -q install trimesh==5.2.0 scipy==1.17.1 rtree==1.4.1 numpy==2.4.6
venv/bin/python - <<'PY' | tee seen
import warnings
import numpy as np
import trimesh
from trimesh.registration import nricp_amberg, nricp_sumner

large = trimesh.creation.icosphere(3)
small = trimesh.creation.icosphere(1)
small.apply_scale(0.2)
small.apply_translation([3, 0, 0])
for function in (nricp_amberg, nricp_sumner):
    base = trimesh.util.concatenate([large, small])
    scan = trimesh.Trimesh(large.vertices * [1.1, 1, 0.9], large.faces, process=False)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        laid = function(base, scan)
    widths = [f"{np.ptp(laid[piece, 0]):.2f}" for piece in (slice(0, 642), slice(642, None))]
    print(f"{function.__name__}: pieces {' and '.join(widths)} wide, finite {np.isfinite(laid).all()}, {len(caught)} warnings")
PY
diff seen - <<'SEEN'
nricp_amberg: pieces 2.20 and 0.00 wide, finite True, 0 warnings
nricp_sumner: pieces 2.19 and 0.40 wide, finite True, 0 warnings
SEEN
