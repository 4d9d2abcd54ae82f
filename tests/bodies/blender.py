"""Makes blender_drawn.glb and blender_mixamo.glb from tests/garments/bodies/doll.glb with Blender (bpy 5.0.1 from PyPI, Python 3.11).

    python blender.py ../garments/bodies/doll.glb .

blender_drawn: an armature drawn bone by bone, each bone from its joint to the next one, named as Rigify names them; so every joint's axes are
turned along its bone. blender_mixamo: Mixamo's names and structure, an object `Armature` scaled by 0.01 over bones and mesh in centimetres, and
leaf joints that are no bones (`HeadTop_End`).
"""

import json
import struct
import sys

import bpy

source, out = sys.argv[-2], sys.argv[-1]

RIGIFY = {
    "hips": "spine", "spine": "spine.001", "chest": "spine.002", "neck": "spine.004", "head": "spine.006",
    "Shoulder": "shoulder", "UpperArm": "upper_arm", "LowerArm": "forearm", "Hand": "hand",
    "UpperLeg": "thigh", "LowerLeg": "shin", "Foot": "foot",
}
MIXAMO = {
    "hips": "Hips", "spine": "Spine", "chest": "Spine1", "neck": "Neck", "head": "Head",
    "Shoulder": "Shoulder", "UpperArm": "Arm", "LowerArm": "ForeArm", "Hand": "Hand",
    "UpperLeg": "UpLeg", "LowerLeg": "Leg", "Foot": "Foot",
}


def rigify(bone):
    for side, mark in (("left", ".L"), ("right", ".R")):
        if bone.startswith(side):
            return RIGIFY[bone.removeprefix(side)] + mark
    return RIGIFY[bone]


def mixamo(bone):
    for side, mark in (("left", "Left"), ("right", "Right")):
        if bone.startswith(side):
            return "mixamorig:" + mark + MIXAMO[bone.removeprefix(side)]
    return "mixamorig:" + MIXAMO[bone]


def read(path):
    """Joints (name, parent, place), places, triangles and weights of the doll, whose joints are not turned."""
    data = open(path, "rb").read()
    length = struct.unpack_from("<I", data, 12)[0]
    gltf, binary = json.loads(data[20:20 + length]), data[28 + length:]

    def rows(index):
        accessor = gltf["accessors"][index]
        view = gltf["bufferViews"][accessor["bufferView"]]
        kind = {5126: "f", 5125: "I", 5123: "H", 5121: "B"}[accessor["componentType"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[accessor["type"]]
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        flat = struct.unpack_from(f"<{width * accessor['count']}{kind}", binary, start)
        if accessor.get("normalized"):
            flat = [number / 255 for number in flat]
        return [flat[i:i + width] for i in range(0, len(flat), width)]

    nodes, skin = gltf["nodes"], gltf["skins"][0]
    parent = {child: node for node in range(len(nodes)) for child in nodes[node].get("children", [])}

    def place(node):
        above = place(parent[node]) if node in parent else (0, 0, 0)
        return tuple(a + b for a, b in zip(above, nodes[node].get("translation", (0, 0, 0))))

    joints = [(nodes[j]["name"], nodes[parent[j]]["name"] if parent.get(j) in skin["joints"] else None, place(j)) for j in skin["joints"]]
    primitive = gltf["meshes"][0]["primitives"][0]
    attributes = primitive["attributes"]
    indices = [i for i, in rows(primitive["indices"])]
    weights = [
        [(joints[joint][0], weight) for joint, weight in zip(*row) if weight > 0]
        for row in zip(rows(attributes["JOINTS_0"]), rows(attributes["WEIGHTS_0"]))
    ]
    return joints, rows(attributes["POSITION"]), [indices[i:i + 3] for i in range(0, len(indices), 3)], weights


def blender(place, scale):
    """Blender's axes: Z up, front -Y."""
    return (place[0] * scale, -place[2] * scale, place[1] * scale)


def make(path, name_of, scale, leaves):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    joints, places, triangles, weights = read(source)
    children = {}
    for name, parent, place in joints:
        children.setdefault(parent, []).append(place)
    armature = bpy.data.objects.new("Armature", bpy.data.armatures.new("Armature"))
    bpy.context.collection.objects.link(armature)
    bpy.context.view_layer.objects.active = armature
    bpy.ops.object.mode_set(mode="EDIT")
    edit = armature.data.edit_bones
    for name, parent, place in joints:
        bone = edit.new(name_of(name))
        bone.head = blender(place, scale)
        straight = tuple(a + b for a, b in zip(place, (0, 0.1, 0)))
        bone.tail = blender(children.get(name, [straight])[0], scale)
        if parent is not None:
            bone.parent = edit[name_of(parent)]
    for leaf, above in leaves:
        bone = edit.new(leaf)
        bone.head = edit[above].tail
        bone.tail = bone.head + edit[above].tail - edit[above].head
        bone.parent = edit[above]
    bpy.ops.object.mode_set(mode="OBJECT")
    mesh = bpy.data.meshes.new("Body")
    mesh.from_pydata([blender(place, scale) for place in places], [], triangles)
    body = bpy.data.objects.new("Body", mesh)
    bpy.context.collection.objects.link(body)
    for name, _, _ in joints:
        body.vertex_groups.new(name=name_of(name))
    for vertex, row in enumerate(weights):
        for name, weight in row:
            body.vertex_groups[name_of(name)].add([vertex], weight, "REPLACE")
    body.parent = armature
    body.modifiers.new("Armature", "ARMATURE").object = armature
    armature.scale = (1 / scale,) * 3
    bpy.ops.export_scene.gltf(filepath=path, export_format="GLB", export_normals=False, export_texcoords=False, export_materials="NONE")


make(f"{out}/blender_drawn.glb", rigify, 1.0, [])
make(f"{out}/blender_mixamo.glb", mixamo, 100.0, [("mixamorig:HeadTop_End", "mixamorig:Head"), ("mixamorig:LeftToe_End", "mixamorig:LeftFoot")])
