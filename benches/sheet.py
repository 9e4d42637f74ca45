#!/usr/bin/env python3
"""A large scan: a waved sheet of N x N vertices and side 1, with one round hole of radius 0.02 in its middle; Python's standard library only.

usage: sheet.py N OUT.glb
"""
import json, math, struct, sys
from array import array

RADIUS = 0.02


def main(n: int, out: str) -> None:
    step = 1 / (n - 1)
    # A face is left out if its middle is in the hole; this table is for the columns that come near it.
    near = range(int((0.5 - 2 * RADIUS) / step), int((0.5 + 2 * RADIUS) / step) + 1)
    positions, normals, faces = array("f"), array("f"), array("I")
    for j in range(n):
        w = j * step
        for i in range(n):
            u = i * step
            along, across = 9 * u + 3 * w, 14 * w
            slope_u, slope_w = 0.45 * math.cos(along), 0.15 * math.cos(along) + 0.42 * math.cos(across)
            length = math.sqrt(slope_u * slope_u + 1 + slope_w * slope_w)
            positions.extend((u, 0.05 * math.sin(along) + 0.03 * math.sin(across), w))
            normals.extend((-slope_u / length, 1 / length, -slope_w / length))
    for j in range(n - 1):
        for i in range(n - 1):
            a, b, c, d = j * n + i, (j + 1) * n + i, (j + 1) * n + i + 1, j * n + i + 1
            middles = ((i + 1 / 3, j + 2 / 3), (i + 2 / 3, j + 1 / 3))
            for corners, (x, y) in zip(((a, b, c), (a, c, d)), middles):
                close = i in near and j in near
                if not close or math.hypot(x * step - 0.5, y * step - 0.5) > RADIUS:
                    faces.extend(corners)
    write(out, positions, normals, faces)
    print(f"{out}: {n * n} vertices, {len(faces) // 3} triangles")


def write(out: str, positions: array, normals: array, faces: array) -> None:
    """A GLB of one mesh."""
    views, at = [], 0
    for data, target in ((positions, 34962), (normals, 34962), (faces, 34963)):
        views.append({"buffer": 0, "byteOffset": at, "byteLength": 4 * len(data), "target": target})
        at += 4 * len(data)
    count = len(positions) // 3
    bounds = {key: [pick(positions[k::3]) for k in range(3)] for key, pick in (("min", min), ("max", max))}
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1}, "indices": 2}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": count, **bounds},
            {"bufferView": 1, "componentType": 5126, "type": "VEC3", "count": count},
            {"bufferView": 2, "componentType": 5125, "type": "SCALAR", "count": len(faces)},
        ],
        "bufferViews": views, "buffers": [{"byteLength": at}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    with open(out, "wb") as file:
        file.write(b"glTF" + struct.pack("<II", 2, 28 + len(text) + at))
        file.write(struct.pack("<I", len(text)) + b"JSON" + text)
        file.write(struct.pack("<I", at) + b"BIN\0")
        for data in (positions, normals, faces):
            data.tofile(file)


if len(sys.argv) != 3:
    sys.exit(__doc__)
main(int(sys.argv[1]), sys.argv[2])
