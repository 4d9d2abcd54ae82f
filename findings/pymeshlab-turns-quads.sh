#!/usr/bin/env bash
# pymeshlab 2025.7.post1 (MeshLab), loading an OBJ and saving it, nothing in between.
#
# A quad and a triangle in the group sode_left. Expected: the same faces in the same group.
# Seen: the quad's corners begin one later (1 2 3 4 comes out as 2 3 4 1) while the triangle's stay, and the group's name is gone. Vertices keep
# their order. A comparison of faces corner by corner calls such a file another mesh; how a quad is cut into triangles changes with it, too.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip -q install pymeshlab==2025.7.post1
printf 'g sode_left\nv 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nv 3 2 0\nf 1 2 3 4\nf 4 3 5\n' > in.obj
venv/bin/python - <<'PY'
import pymeshlab
meshes = pymeshlab.MeshSet()
meshes.load_new_mesh("in.obj")
meshes.save_current_mesh("out.obj", save_vertex_normal=False)
PY
grep -E '^(f|g|o) ' out.obj | sed 's/ *$//' | tee seen
diff seen - <<'SEEN'
f 2 3 4 1
f 4 3 5
SEEN
