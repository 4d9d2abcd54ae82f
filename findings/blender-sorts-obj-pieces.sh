#!/usr/bin/env bash
# Blender 5.0.1 (bpy from PyPI), OBJ import and export with their own settings but for normals, texture coordinates and materials.
#
# Three quads as objects piece_9, piece_10, piece_2, in this order. Expected of a file that is only read and written: the same order.
# Seen: the objects come out sorted by their names as text (piece_10, piece_2, piece_9), so each vertex has another number, while counts of
# vertices and faces are as before. A garment whose targets are keyed by vertex number is scrambled with no sign of it; as one object
# (`g` instead of `o`) the order stays.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
python3 -m venv venv
venv/bin/pip -q install bpy==5.0.1
cat > run.py <<'PY'
import bpy

def quads(keyword):
    lines = []
    for number, name in enumerate(["piece_9", "piece_10", "piece_2"]):
        lines.append(f"{keyword} {name}")
        lines += [f"v {number + dx} {dy} 0" for dx, dy in [(0, 0), (1, 0), (1, 1), (0, 1)]]
        lines.append("f " + " ".join(str(4 * number + corner) for corner in (1, 2, 3, 4)))
    return "\n".join(lines) + "\n"

def through_blender(text):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    open("in.obj", "w").write(text)
    bpy.ops.wm.obj_import(filepath="in.obj")
    bpy.ops.wm.obj_export(filepath="out.obj", export_materials=False, export_normals=False, export_uv=False)
    return open("out.obj").read().splitlines()

def places(lines):
    return [tuple(float(number) + 0.0 for number in line.split()[1:4]) for line in lines if line.startswith("v ")]

out = through_blender(quads("o"))
names = [line[2:] for line in out if line.startswith("o ")]
print("FINDING version", bpy.app.version_string)
print("FINDING objects", " ".join(names))
print("FINDING same vertex order", places(out) == places(quads("o").splitlines()))
print("FINDING same vertex order as groups", places(through_blender(quads("g"))) == places(quads("g").splitlines()))
PY
venv/bin/python run.py 2>/dev/null | grep '^FINDING' | tee seen
diff seen - <<'SEEN'
FINDING version 5.0.1
FINDING objects piece_10 piece_2 piece_9
FINDING same vertex order False
FINDING same vertex order as groups True
SEEN
