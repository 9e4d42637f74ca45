#!/usr/bin/env python3
"""Another filler on a garment set, and its figures beside darn's.

  garments_peers.py fill SET OUT            CGAL triangulates, refines and fairs every hole of SET; one GLB each goes to OUT
  garments_peers.py table OURS.json THEIRS.json

SET is a folder of `darn garments`. Measure both fillers by the same code:

  darn evaluate --garments SET --json ours.json
  darn evaluate --garments SET --mended OUT --json cgal.json

Needs numpy and, for `fill`, CGAL's Python bindings (pip install cgal numpy).
"""
import argparse
import json
import struct
import sys
import tempfile
from pathlib import Path

import numpy as np

BANDS = ["0-2", "2-5", "5-10", ">10"]


def read_glb(path):
    """Positions (f32) and triangles of a GLB that darn wrote: one mesh, one primitive."""
    data = path.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    document = json.loads(data[20 : 20 + length])
    binary = data[20 + length + 8 :]
    primitive = document["meshes"][0]["primitives"][0]

    def accessor(index):
        found = document["accessors"][index]
        view = document["bufferViews"][found["bufferView"]]
        kind = {5121: "<u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}[found["componentType"]]
        width = {"SCALAR": 1, "VEC3": 3}[found["type"]]
        start = view.get("byteOffset", 0) + found.get("byteOffset", 0)
        return np.frombuffer(binary, kind, found["count"] * width, start).reshape(-1, width)

    positions = accessor(primitive["attributes"]["POSITION"])
    faces = accessor(primitive["indices"]).reshape(-1, 3).astype(np.int64)
    return positions, faces


def write_glb(path, positions, *parts):
    """One mesh as GLB: a primitive of the triangles of each part. Those after the first are marked as new cloth, which `darn render` tints."""
    positions, parts = positions.astype("<f4"), [faces.astype("<u4") for faces in parts]
    binary = positions.tobytes() + b"".join(faces.tobytes() for faces in parts)
    low, high = positions.min(0).tolist(), positions.max(0).tolist()
    accessors = [{"bufferView": 0, "componentType": 5126, "count": len(positions), "type": "VEC3", "min": low, "max": high}]
    views = [{"buffer": 0, "byteOffset": 0, "byteLength": positions.nbytes}]
    primitives = []
    for number, faces in enumerate(parts, 1):
        accessors.append({"bufferView": number, "componentType": 5125, "count": faces.size, "type": "SCALAR"})
        views.append({"buffer": 0, "byteOffset": views[-1]["byteOffset"] + views[-1]["byteLength"], "byteLength": faces.nbytes})
        mark = {"extras": {"darn": {"reconstructed": True}}} if number > 1 else {}
        primitives.append({"attributes": {"POSITION": 0}, "indices": number, **mark})
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": primitives}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(binary)}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    head = struct.pack("<III", 0x46546C67, 2, 28 + len(text) + len(binary))
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    path.write_bytes(head + chunks)


def fair(positions, faces, centroid):
    """The mesh with the hole nearest to a point filled by CGAL: triangulated, refined and faired (C1)."""
    from CGAL import CGAL_Polygon_mesh_processing as processing
    from CGAL.CGAL_Polyhedron_3 import Polyhedron_3

    with tempfile.NamedTemporaryFile("w", suffix=".off") as off:
        off.write(f"OFF\n{len(positions)} {len(faces)} 0\n")
        off.writelines("%.9g %.9g %.9g\n" % tuple(p) for p in positions)
        off.writelines("3 %d %d %d\n" % tuple(f) for f in faces)
        off.flush()
        mesh = Polyhedron_3(off.name)

    def place(vertex):
        point = vertex.point()
        return (point.x(), point.y(), point.z())

    seen, rims = set(), []
    for start in mesh.halfedges():
        if not start.is_border():
            continue
        key = (place(start.opposite().vertex()), place(start.vertex()))
        if key in seen:
            continue
        ring, edge = [], start
        while key not in seen:
            seen.add(key)
            ring.append(key[1])
            edge = edge.next()
            key = (place(edge.opposite().vertex()), place(edge.vertex()))
        rims.append((np.linalg.norm(np.mean(ring, axis=0) - centroid), start))
    rim = min(rims, key=lambda found: found[0])[1]
    processing.triangulate_refine_and_fair_hole(mesh, rim, [], [])
    number, points, triangles = {}, [], []
    for vertex in mesh.vertices():
        number[place(vertex)] = len(points)
        points.append(place(vertex))
    for facet in mesh.facets():
        edge, corners = facet.halfedge(), []
        for _ in range(3):
            corners.append(number[place(edge.vertex())])
            edge = edge.next()
        triangles.append(corners)
    return np.array(points), np.array(triangles)


def fill(garments, out):
    out.mkdir(parents=True, exist_ok=True)
    manifest = json.loads((garments / "manifest.json").read_text())
    for hole in (hole for garment in manifest["garments"] for hole in garment["holes"]):
        try:
            filled = fair(*read_glb(garments / hole["file"]), np.array(hole["centroid"]))
        except Exception as error:  # CGAL's bindings raise bare exceptions
            print(f"{hole['name']}: {error!r}", file=sys.stderr)
            continue
        write_glb(out / hole["file"], *filled)


def table(ours, theirs):
    """Means over the holes that both filled, moth holes apart."""
    rows = [{row["name"]: row for row in json.loads(path.read_text())["holes"]} for path in (ours, theirs)]
    both = [name for name, row in rows[0].items() if "chamfer" in row and "chamfer" in rows[1].get(name, {})]
    print("| holes | n | chamfer | CGAL | ratio | to the surface | CGAL | ratio | h95 | CGAL | normals | CGAL | area | CGAL | too curved | CGAL |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|")
    groups = [(band, lambda row, band=band: row["share"] and row["band"] == band) for band in BANDS]
    groups += [("moth holes", lambda row: not row["share"]), ("all but moth holes", lambda row: row["share"])]
    for name, among in groups:
        own = [key for key in both if among(rows[0][key])]
        if not own:
            continue
        columns = {k: [[side[key][k] for key in own] for side in rows] for k in ("chamfer", "surface", "h95", "normal", "area", "mean_curvature")}
        mean = {k: [np.mean(side) for side in sides] for k, sides in columns.items()}
        curved = [sum(x > 1.5 for x in side) for side in columns["mean_curvature"]]
        ratio, surface = (mean[key][0] / mean[key][1] for key in ("chamfer", "surface"))
        pair = lambda k, form: " | ".join(form % x for x in mean[k])
        print(f"| {name} | {len(own)} | {pair('chamfer', '%.2f')} | {ratio:.2f} | {pair('surface', '%.2f')} | {surface:.2f} | {pair('h95', '%.2f')} | "
              f"{pair('normal', '%.1f')} | {pair('area', '%.3f')} | {curved[0]} | {curved[1]} |")
    worst = sorted(both, key=lambda key: -rows[0][key]["chamfer"])[:8]
    print("\nworst of ours:")
    for key in worst:
        a, b = rows[0][key], rows[1][key]
        print(f"{key} ({a['band']}): chamfer {a['chamfer']:.2f}, CGAL {b['chamfer']:.2f}; normals {a['normal']:.1f}, CGAL {b['normal']:.1f}; "
              f"area {a['area']:.3f}, {b['area']:.3f}; curvature ÷ truth's {a['mean_curvature']:.2f}, {b['mean_curvature']:.2f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("do", choices=["fill", "table"])
    parser.add_argument("first", type=Path)
    parser.add_argument("second", type=Path)
    args = parser.parse_args()
    {"fill": fill, "table": table}[args.do](args.first, args.second)


if __name__ == "__main__":
    main()
