#!/usr/bin/env python3
"""Pictures of holes in garments: the hole, the cloth that was cut out, darn's fill and CGAL's, seen alike.

  garments_pictures.py SET CGAL OURS.json CGAL.json -o docs/garments.jpg [--work FOLDER] [--darn DARN]

SET is a folder of `darn garments`; CGAL, OURS.json and CGAL.json come from the commands that garments_peers.py names.
Shown are twelve holes, evenly spaced in the set's order (every kind of garment and of hole, and every band of flatness of `--seed 1 --each 2`; no
score chooses), then the three with darn's largest chamfer (per cent of the hole's diameter). The camera looks at the middle of the lost cloth, from
that one of nine directions that shows most of it. New cloth is tinted. --work keeps the mended scans, darn's reports on them, and every tile as PNG.

Needs numpy and Pillow (pip install numpy pillow).
"""
import argparse
import contextlib
import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from garments_peers import read_glb, write_glb

SHOWN, WORST = 12, 3
TILE, HEAD, GAP = 224, 22, 4
FILLERS = ["darn", "CGAL"]
COLUMNS = ["hole", "lost cloth", *FILLERS]


def chosen(holes, ours):
    """Names of the holes to show: evenly spaced ones, then the worst of ours."""
    names = [hole["name"] for hole in holes]
    spaced = [names[(2 * k + 1) * len(names) // (2 * SHOWN)] for k in range(SHOWN)]
    measured = [name for name in names if "chamfer" in ours[name]]
    return spaced, sorted(measured, key=lambda name: -ours[name]["chamfer"])[:WORST]


def corners(positions, faces):
    """A key for each triangle: the bits of its corners, in any order."""
    bits = [p.tobytes() for p in positions.astype("<f4")]
    return [tuple(sorted(bits[v] for v in face)) for face in faces]


def mark(kept, filled, out):
    """Writes the filled scan with the triangles that the kept one lacks marked as new cloth."""
    old = set(corners(*kept))
    new = np.array([key not in old for key in corners(*filled)])
    positions, faces = filled
    write_glb(out, positions, faces[~new], faces[new])


def views(lost):
    """Looks at the lost cloth as `darn render` takes them: against its mean normal, then turned from there by 40 degrees to each of eight sides."""
    positions, faces = lost
    a, b, c = (positions[faces[:, k]].astype(float) for k in range(3))
    doubled = np.cross(b - a, c - a)
    areas = np.linalg.norm(doubled, axis=1)
    centre = (a + b + c).T @ areas / areas.sum() / 3
    normal = doubled.sum(0) / np.linalg.norm(doubled.sum(0))
    side = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    side /= np.linalg.norm(side)
    turns = [np.cos(t) * side + np.sin(t) * np.cross(normal, side) for t in np.arange(8) * np.pi / 4]
    focus = ",".join(f"{x:.6f}" for x in [*centre, 1.6 * np.linalg.norm(positions - centre, axis=1).max()])
    for towards in [normal, *(normal * np.cos(np.radians(40)) + turn * np.sin(np.radians(40)) for turn in turns)]:
        azimuth, elevation = np.degrees([np.arctan2(towards[0], towards[2]), np.arcsin(towards[1])])
        yield ["--view", f"{azimuth:.2f},{elevation:.2f}", "--focus", focus]


def on_rim(kept, lost, centroid):
    """The vertex of the rim that is nearest to the hole's centroid; `darn evaluate` names the hole by it."""
    known = {p.tobytes() for p in kept[0]}
    rim = [p for p in lost[0] if p.tobytes() in known]
    return [float(x) for x in min(rim, key=lambda p: np.linalg.norm(p - centroid))]


def drawn(darn, scan, look, side, out):
    """The square picture of a scan."""
    subprocess.run([darn, "render", scan, "-o", out, "--size", f"{side}x{side}", *look], check=True, capture_output=True)
    return Image.open(out).convert("RGB")


def tinted(picture):
    """How many pixels show new cloth: they are redder than blue."""
    pixels = np.asarray(picture).astype(int)
    return int((pixels[..., 0] > pixels[..., 2] + 20).sum())


def mend(darn, scan, rim, out):
    """Has darn fill the hole at a point; its report is written beside the mended scan."""
    wish = out.with_suffix(".constraints.json")
    wish.write_text(json.dumps({"holes": [{"near": rim}]}))
    subprocess.run([darn, "inpaint", scan, "-o", out, "-c", wish, "--report", out.with_suffix(".json")], check=True, stdout=subprocess.DEVNULL)


def tiles(args, hole, garment, filled):
    """The pictures of a hole, in the order of the columns; None for a filler that is not among the `filled`, the names of columns."""
    name, work = hole["name"], args.work
    scan, truth, own, cgal = args.set / hole["file"], work / f"{name}-truth.glb", work / f"{name}.glb", work / f"{name}-cgal.glb"
    kept, lost = read_glb(scan), read_glb(args.set / hole["truth"])
    mark(kept, read_glb(args.set / garment["file"]), truth)
    if "CGAL" in filled:
        mark(kept, read_glb(args.cgal / hole["file"]), cgal)
    if "darn" in filled:
        mend(args.darn, scan, on_rim(kept, lost, hole["centroid"]), own)
    trial = work / "trial.png"
    look = max(views(lost), key=lambda look: tinted(drawn(args.darn, truth, look, TILE // 2, trial)))
    for kind, shown in zip(COLUMNS, [scan, truth, own, cgal]):
        if kind in FILLERS and kind not in filled:
            yield None
            continue
        picture = work / f"{name}-{kind.replace(' ', '-')}.png"
        yield drawn(args.darn, shown, look, args.tile, picture).resize((TILE, TILE), Image.LANCZOS)


def label(name, ours, theirs):
    """The text above a row."""
    figure = lambda row: f"{row['chamfer']:.2f} %" if "chamfer" in row else "none"
    return f"{name} (flat within {ours['band']} %): chamfer {figure(ours)}, CGAL {figure(theirs)}"


def write_rows(rows, out):
    """Writes all rows, each of a text and its tiles, as one JPEG with the columns' names above them."""
    high = HEAD + TILE + GAP
    image = Image.new("RGB", (len(COLUMNS) * (TILE + GAP) - GAP, HEAD + len(rows) * high), "white")
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(14)
    for k, text in enumerate(COLUMNS):
        draw.text((k * (TILE + GAP) + TILE // 2, HEAD // 2), text, "black", font, "mm")
    for row, (text, pictures) in enumerate(rows):
        top = HEAD + row * high
        draw.text((2, top + HEAD // 2), text, "black", font, "lm")
        for k, picture in enumerate(pictures):
            left = k * (TILE + GAP)
            if picture:
                image.paste(picture, (left, top + HEAD))
            else:
                draw.text((left + TILE // 2, top + HEAD + TILE // 2), "no fill", "black", font, "mm")
    image.save(out, "JPEG", quality=80, optimize=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("set", type=Path)
    parser.add_argument("cgal", type=Path)
    parser.add_argument("ours_json", type=Path)
    parser.add_argument("cgal_json", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--work", type=Path)
    parser.add_argument("--darn", default="target/release/darn")
    parser.add_argument("--tile", type=int, default=2 * TILE, help="side of the pictures that are drawn, pixels")
    args = parser.parse_args()
    garments = json.loads((args.set / "manifest.json").read_text())["garments"]
    holes = {hole["name"]: (hole, garment) for garment in garments for hole in garment["holes"]}
    ours, theirs = ({row["name"]: row for row in json.loads(path.read_text())["holes"]} for path in (args.ours_json, args.cgal_json))
    spaced, worst = chosen([hole for hole, _ in holes.values()], ours)
    with contextlib.ExitStack() as stack:
        args.work = args.work or Path(stack.enter_context(tempfile.TemporaryDirectory()))
        args.work.mkdir(parents=True, exist_ok=True)
        rows = []
        for name in spaced + [name for name in worst if name not in spaced]:
            number = f"worst {worst.index(name) + 1}: " if name in worst else ""
            filled = [filler for filler, rows_of in zip(FILLERS, (ours, theirs)) if "chamfer" in rows_of[name]]
            rows.append((number + label(name, ours[name], theirs[name]), list(tiles(args, *holes[name], filled))))
        write_rows(rows, args.output)


if __name__ == "__main__":
    main()
