#!/usr/bin/env python3
"""Measures how much of a patch shows the fabric that was there, on scans of one textured mesh whose fabric is known.

    scripts/fabric_share.py SCAN MENDED [MENDED...] [--period X,Y]

The texture coordinates of the scan, taken over the borders of islands and unfolded where they are mirrored, say where every vertex lies on the flat
fabric. The first mended scan must have a texture of its own: its coordinates go affinely with the place on the fabric, which is fitted at the rim and
holds for the same patch in the others. The fabric in the hole is what the scan's image has there, if the coordinates are mirrored, or else, with
--period (in texture coordinates), what the cloth shows a whole number of periods away.

Prints for each mended scan the share of the patch's faces that show the fabric at their middle within a Delta E (CIEDE2000) of 10, and the mean of the
differences. Exit status 1 where the truth does not agree with the cloth that is there. Needs Python alone.
"""

import argparse
import json
import math
import struct
import sys
import zlib

WITHIN = 10.0
# Least share of the cloth's own faces that must show what the truth says.
SURE = 0.97


class Glb:
    """A GLB with one mesh, whose images are PNGs in it."""

    def __init__(self, path):
        data = open(path, "rb").read()
        length = struct.unpack_from("<I", data, 12)[0]
        self.json = json.loads(data[20 : 20 + length])
        self.bin = data[28 + length :]
        self.pictures = {}

    def rows(self, index):
        accessor = self.json["accessors"][index]
        view = self.json["bufferViews"][accessor["bufferView"]]
        at = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        letter = {5126: "f", 5125: "I", 5123: "H", 5121: "B"}[accessor["componentType"]]
        numbers = struct.unpack_from(f"<{accessor['count'] * width}{letter}", self.bin, at)
        if width == 1:
            return list(numbers)
        return [numbers[k : k + width] for k in range(0, len(numbers), width)]

    def primitives(self):
        return self.json["meshes"][0]["primitives"]

    def picture(self, material):
        """The base colour's image: width, height, bytes a texel, bytes."""
        info = self.json["materials"][material]["pbrMetallicRoughness"]["baseColorTexture"]
        source = self.json["textures"][info["index"]]["source"]
        if source not in self.pictures:
            view = self.json["bufferViews"][self.json["images"][source]["bufferView"]]
            at = view.get("byteOffset", 0)
            self.pictures[source] = png(self.bin[at : at + view["byteLength"]])
        return self.pictures[source]


def png(data):
    """A PNG of eight bits a channel, not interlaced: width, height, channels, texels."""
    width, height, depth, kind, _, _, interlaced = struct.unpack_from(">IIBBBBB", data, 16)
    channels = {2: 3, 6: 4}.get(kind)
    if depth != 8 or channels is None or interlaced:
        sys.exit("only PNGs of eight bits in RGB or RGBA are read")
    at, packed = 8, b""
    while at < len(data):
        length = struct.unpack_from(">I", data, at)[0]
        if data[at + 4 : at + 8] == b"IDAT":
            packed += data[at + 8 : at + 8 + length]
        at += length + 12
    raw = zlib.decompress(packed)
    stride = width * channels
    out, above = bytearray(), bytearray(stride)
    for y in range(height):
        start = y * (stride + 1)
        way, row = raw[start], bytearray(raw[start + 1 : start + 1 + stride])
        for x in range(stride) if way else ():
            left = row[x - channels] if x >= channels else 0
            up, corner = above[x], above[x - channels] if x >= channels else 0
            if way == 1:
                add = left
            elif way == 2:
                add = up
            elif way == 3:
                add = (left + up) // 2
            else:
                guess = left + up - corner
                near = [abs(guess - left), abs(guess - up), abs(guess - corner)]
                add = (left, up, corner)[near.index(min(near))]
            row[x] = (row[x] + add) & 255
        out += row
        above = row
    return width, height, channels, bytes(out)


def texel(picture, place):
    """The colour at a place, between texels as viewers filter: sRGB, not rounded."""
    width, height, channels, data = picture
    x, y = (place[0] % 1.0) * width - 0.5, (place[1] % 1.0) * height - 0.5
    left, top = math.floor(x), math.floor(y)
    s, t = x - left, y - top
    sum_of = [0.0, 0.0, 0.0]
    for row, down in ((top, 1 - t), (top + 1, t)):
        for column, along in ((left, 1 - s), (left + 1, s)):
            at = ((row % height) * width + column % width) * channels
            for k in range(3):
                sum_of[k] += down * along * data[at + k]
    return tuple(round(x, 3) for x in sum_of)


def lab(colour, known={}):
    if colour not in known:
        r, g, b = (c / 3294.6 if c <= 10 else ((c / 255 + 0.055) / 1.055) ** 2.4 for c in colour)
        x = (0.4124 * r + 0.3576 * g + 0.1805 * b) / 0.95047
        y = 0.2126 * r + 0.7152 * g + 0.0722 * b
        z = (0.0193 * r + 0.1192 * g + 0.9505 * b) / 1.08883
        fx, fy, fz = (t ** (1 / 3) if t > 0.008856 else 7.787 * t + 16 / 116 for t in (x, y, z))
        known[colour] = (116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz))
    return known[colour]


def ciede2000(one, two):
    """The colour difference of Sharma, Wu and Dalal 2005."""
    (l1, a1, b1), (l2, a2, b2) = one, two
    chroma = (math.hypot(a1, b1) + math.hypot(a2, b2)) / 2
    g = 0.5 * (1 - math.sqrt(chroma**7 / (chroma**7 + 25**7)))
    a1, a2 = a1 * (1 + g), a2 * (1 + g)
    c1, c2 = math.hypot(a1, b1), math.hypot(a2, b2)
    h1, h2 = math.degrees(math.atan2(b1, a1)) % 360, math.degrees(math.atan2(b2, a2)) % 360
    turn = 0.0 if c1 * c2 == 0 else (h2 - h1 + 180) % 360 - 180
    dh = 2 * math.sqrt(c1 * c2) * math.sin(math.radians(turn / 2))
    l, c = (l1 + l2) / 2, (c1 + c2) / 2
    h = h1 + h2 if c1 * c2 == 0 else (h1 + turn / 2) % 360
    t = 1 - 0.17 * cos(h - 30) + 0.24 * cos(2 * h) + 0.32 * cos(3 * h + 6) - 0.2 * cos(4 * h - 63)
    sl = 1 + 0.015 * (l - 50) ** 2 / math.sqrt(20 + (l - 50) ** 2)
    sc, sh = 1 + 0.045 * c, 1 + 0.015 * c * t
    rc = 2 * math.sqrt(c**7 / (c**7 + 25**7))
    rt = -rc * math.sin(math.radians(60 * math.exp(-(((h - 275) / 25) ** 2))))
    dc = c2 - c1
    return math.sqrt(((l2 - l1) / sl) ** 2 + (dc / sc) ** 2 + (dh / sh) ** 2 + rt * dc / sc * dh / sh)


def cos(degrees):
    return math.cos(math.radians(degrees))


class Part:
    """A primitive: its faces, positions, and places in its base colour."""

    def __init__(self, glb, primitive):
        attributes = primitive["attributes"]
        indices = glb.rows(primitive["indices"])
        self.faces = [tuple(indices[k : k + 3]) for k in range(0, len(indices), 3)]
        self.positions = glb.rows(attributes["POSITION"])
        self.places = glb.rows(attributes["TEXCOORD_0"])
        self.picture = glb.picture(primitive["material"])

    def shown(self, face):
        """The colour in the middle of a face."""
        return texel(self.picture, middle(self.places, face))


def middle(rows, face):
    return tuple(sum(rows[v][k] for v in face) / 3 for k in range(2))


def unfolded(part):
    """The place on the flat fabric of every position, and whether coordinates are mirrored somewhere."""
    steps, mirrored = {}, False
    signs = []
    for face in part.faces:
        (ax, ay), (bx, by), (cx, cy) = (part.places[v] for v in face)
        signs.append(math.copysign(1, (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)))
    most = math.copysign(1, sum(signs))
    for face, sign in zip(part.faces, signs):
        mirrored |= sign != most
        for k in range(3):
            v, w = face[k], face[(k + 1) % 3]
            du = (part.places[w][0] - part.places[v][0]) * sign * most
            dv = part.places[w][1] - part.places[v][1]
            p, q = part.positions[v], part.positions[w]
            steps.setdefault(p, []).append((q, du, dv))
            steps.setdefault(q, []).append((p, -du, -dv))
    # A corner of a face that is not mirrored keeps its coordinates.
    first = next(face for face, sign in zip(part.faces, signs) if sign == most)
    places = {part.positions[first[0]]: part.places[first[0]]}
    waiting = [part.positions[first[0]]]
    off = 0.0
    for p in waiting:
        x, y = places[p]
        for q, du, dv in steps[p]:
            if q not in places:
                places[q] = (x + du, y + dv)
                waiting.append(q)
            else:
                off = max(off, abs(places[q][0] - x - du), abs(places[q][1] - y - dv))
    return places, mirrored, off


def affine(rows):
    """The affine map of the plane that fits pairs of places best, and its largest residual."""
    n = len(rows)
    mean = [[sum(row[side][k] for row in rows) / n for k in range(2)] for side in range(2)]
    apart = [[[row[side][k] - mean[side][k] for k in range(2)] for side in range(2)] for row in rows]
    xx, xy, yy = (sum(a[0][i] * a[0][k] for a in apart) for i, k in ((0, 0), (0, 1), (1, 1)))
    det = xx * yy - xy * xy
    matrix = []
    for k in range(2):
        x, y = (sum(a[0][i] * a[1][k] for a in apart) for i in range(2))
        matrix.append(((x * yy - y * xy) / det, (y * xx - x * xy) / det))

    def of(place):
        d = [place[k] - mean[0][k] for k in range(2)]
        return tuple(mean[1][k] + matrix[k][0] * d[0] + matrix[k][1] * d[1] for k in range(2))

    return of, max(math.dist(of(a), b) for a, b in rows)


class Cloth:
    """Finds the colour of the cloth at a place on the flat fabric."""

    def __init__(self, part, places):
        self.part = part
        self.corners = [tuple(places[part.positions[v]] for v in face) for face in part.faces]
        spread = max(abs(c[0][k] - c[1][k]) for c in self.corners for k in range(2))
        self.cell = 2 * spread
        self.cells = {}
        for index, corners in enumerate(self.corners):
            xs, ys = ([self.index(c[k]) for c in corners] for k in range(2))
            for x in range(min(xs), max(xs) + 1):
                for y in range(min(ys), max(ys) + 1):
                    self.cells.setdefault((x, y), []).append(index)

    def index(self, x):
        return math.floor(x / self.cell)

    def colour(self, place):
        for index in self.cells.get((self.index(place[0]), self.index(place[1])), ()):
            (ax, ay), (bx, by), (cx, cy) = self.corners[index]
            det = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
            if det == 0:
                continue
            s = ((place[0] - ax) * (cy - ay) - (place[1] - ay) * (cx - ax)) / det
            t = ((bx - ax) * (place[1] - ay) - (by - ay) * (place[0] - ax)) / det
            if min(s, t, 1 - s - t) >= 0:
                a, b, c = (self.part.places[v] for v in self.part.faces[index])
                at = tuple(a[k] + s * (b[k] - a[k]) + t * (c[k] - a[k]) for k in range(2))
                return texel(self.part.picture, at)
        return None


def snapped(part, places):
    """The line at which coordinates are mirrored, and the places with what the coordinates themselves say, without the errors of their sums."""
    sums = [places[p][0] + place[0] for p, place in zip(part.positions, part.places) if abs(places[p][0] - place[0]) > 0.05]
    # A vertex of the mirrored side lies as far beyond the line as its coordinate lies before it. The line is where the coordinates end.
    guess = sorted(sums)[len(sums) // 2] / 2
    ends = [pick(place[0] for place in part.places) for pick in (min, max)]
    line = min(ends, key=lambda end: abs(end - guess))
    exact = {}
    for p, (u, v) in zip(part.positions, part.places):
        exact[p] = (min((u, 2 * line - u), key=lambda x: abs(x - places[p][0])), v)
    return line, exact


def mirrored_truth(part, line):
    """What the image has at a place, the coordinates folded at a line."""
    side = math.copysign(1, sum(place[0] - line for place in part.places))

    def truth(place):
        return texel(part.picture, (line + side * abs(place[0] - line), place[1]))

    return truth


def periodic_truth(cloth, period):
    """What the cloth shows a whole number of periods away: of all such colours the one that is nearest to the others."""
    away = [(i, k) for i in range(-3, 4) for k in range(-3, 4) if (i, k) != (0, 0)]

    def truth(place):
        found = (cloth.colour((place[0] + i * period[0], place[1] + k * period[1])) for i, k in away)
        found = [colour for colour in found if colour is not None]
        far = [sum(math.dist(a, b) for b in found) for a in found]
        return found[far.index(min(far))] if found else None

    return truth


def differences(shown_and_true):
    return [ciede2000(lab(a), lab(b)) for a, b in shown_and_true if b is not None]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scan")
    parser.add_argument("mended", nargs="+")
    parser.add_argument("--period")
    args = parser.parse_args()
    glb = Glb(args.scan)
    part = Part(glb, glb.primitives()[0])
    places, mirrored, off = unfolded(part)
    print(f"{args.scan}: {len(part.faces)} faces; places on the fabric agree within {off:.1e}")
    if mirrored:
        line, places = snapped(part, places)
        truth = mirrored_truth(part, line)
    elif args.period:
        truth = periodic_truth(Cloth(part, places), [float(x) for x in args.period.split(",")])
    else:
        sys.exit("the coordinates are not mirrored; say the fabric's --period")
    sample = part.faces[:: max(1, len(part.faces) // 2000)]
    by_vertex = [places[p] for p in part.positions]
    on_cloth = differences((part.shown(face), truth(middle(by_vertex, face))) for face in sample)
    sure = sum(d <= WITHIN for d in on_cloth) / len(on_cloth)
    print(f"the truth agrees with {100 * sure:.1f} % of the cloth's own faces")
    place_of = None
    for path in args.mended:
        mended = Glb(path)
        new = [it for it in mended.primitives() if it.get("extras", {}).get("darn", {}).get("reconstructed")]
        patch = Part(mended, new[0])
        if place_of is None:
            rim = [(patch.places[k], places[p]) for k, p in enumerate(patch.positions) if p in places]
            to_fabric, residual = affine(rim)
            place_of = {p: to_fabric(uv) for p, uv in zip(patch.positions, patch.places)}
            print(f"the patch lies flat on the fabric within {residual:.1e} at {len(rim)} vertices of the rim")
        by_vertex = [place_of[p] for p in patch.positions]
        found = differences((patch.shown(face), truth(middle(by_vertex, face))) for face in patch.faces)
        right = sum(d <= WITHIN for d in found) / len(found)
        print(f"{path}: {100 * right:.1f} % of {len(found)} faces within ΔE {WITHIN:.0f}, mean ΔE {sum(found) / len(found):.2f}")
    return 0 if sure >= SURE else 1


if __name__ == "__main__":
    sys.exit(main())
