"""Packs what training needs on a machine without a network into one folder, and unpacks it there.

    python3 pack.py FOLDER --program SAMPLES --set NAME=SOURCE[FIRST:LAST] ... [--limit MIB]
    python3 pack.py --unpack FOLDER TO

A set's source is a folder of sheets (`darn scarffolds`) or an int16 array of the paper's sheets (`.npy`, y up, 24000 to the side); `[FIRST:LAST]`
takes a part of it, as in Python. Positions are rounded to 1/24000 of a sheet's side (0.002 cells; the paper's sheets are exactly so), predicted
from their neighbours and compressed by LZMA. Unpacked, each set is a folder that `darn samples` reads, and the program lies beside them.
"""

import argparse
import glob
import json
import lzma
import os
import re
import struct

import numpy

STEPS = 24000
SIDE = 51
MIB = 2**20


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", help="where the packed files go")
    parser.add_argument("to", nargs="?", help="with --unpack: where the sets and the program go")
    parser.add_argument("--unpack", action="store_true")
    parser.add_argument("--program", help="the program that makes samples there")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=SOURCE[FIRST:LAST]")
    parser.add_argument("--limit", type=float, default=40, help="MiB that all packed files together may take")
    options = parser.parse_args()
    if options.unpack:
        unpack(options.folder, options.to)
    else:
        pack(options)


def pack(options):
    os.makedirs(options.folder, exist_ok=True)
    taken, packed = {}, {}
    for text in options.set:
        name, sheets, rows = chosen(text)
        source = os.path.realpath(rows.pop("source"))
        shared = set(rows["rows"]) & taken.get(source, set())
        if shared:
            raise SystemExit(f"--set {text}: {len(shared)} of its sheets are in another set of {source}")
        taken[source] = taken.get(source, set()) | set(rows["rows"])
        packed[f"{name}.sheets"] = compressed(sheets)
        print(f"{name}: {len(sheets)} sheets, {len(packed[f'{name}.sheets']) / MIB:.2f} MiB")
    if options.program:
        packed["program.xz"] = lzma.compress(open(options.program, "rb").read(), preset=9)
        print(f"program: {len(packed['program.xz']) / MIB:.2f} MiB")
    size = sum(map(len, packed.values()))
    if size > options.limit * MIB:
        raise SystemExit(f"{size / MIB:.2f} MiB packed; the limit is {options.limit:g}. Take parts of the sets")
    for name in os.listdir(options.folder):
        if name.endswith((".sheets", ".xz")):
            os.remove(os.path.join(options.folder, name))
    for name, data in packed.items():
        with open(os.path.join(options.folder, name), "wb") as file:
            file.write(data)
    print(f"{size / MIB:.2f} MiB in {options.folder}, of {options.limit:g}")


def chosen(text):
    """The name of a set, its sheets as int32 `[n, 51, 51, 3]` (z up), and where they come from."""
    match = re.fullmatch(r"(\w+)=(.+?)(?:\[(-?\d*):(-?\d*)\])?", text)
    if not match:
        raise SystemExit(f"--set {text}: NAME=SOURCE[FIRST:LAST]")
    name, source, first, last = match.groups()
    number = lambda text: int(text) if text else None
    if source.endswith(".npy"):
        paper = numpy.load(source).astype(numpy.int32)
        sheets = numpy.stack([paper[..., 0], -paper[..., 2], paper[..., 1]], -1)
    else:
        sheets = numpy.rint(read_sheets(source) * STEPS).astype(numpy.int32)
    rows = range(len(sheets))[number(first) : number(last)]
    if not rows:
        raise SystemExit(f"--set {text}: it has no sheets")
    return name, sheets[rows.start : rows.stop], {"source": source, "rows": rows}


def read_sheets(folder):
    """Positions of all sheets of a folder, `[n, 51, 51, 3]`, finished or in parts."""
    whole = os.path.join(folder, "sheets.safetensors")
    paths = [whole] if os.path.exists(whole) else sorted(glob.glob(os.path.join(folder, "part-*.safetensors")))
    if not paths:
        raise SystemExit(f"{folder} holds no sheets")
    parts = []
    for path in paths:
        data = open(path, "rb").read()
        (size,) = struct.unpack("<Q", data[:8])
        entry = json.loads(data[8 : 8 + size])["positions"]
        start, end = (8 + size + at for at in entry["data_offsets"])
        kind = {"F32": "<f4", "F16": "<f2"}[entry["dtype"]]
        parts.append(numpy.frombuffer(data[start:end], kind).reshape(entry["shape"]).astype(numpy.float64))
    return numpy.concatenate(parts)


def write_sheets(folder, positions):
    os.makedirs(folder, exist_ok=True)
    data = numpy.ascontiguousarray(positions, "<f4").tobytes()
    header = json.dumps({"positions": {"dtype": "F32", "shape": list(positions.shape), "data_offsets": [0, len(data)]}}).encode()
    header += b" " * (-len(header) % 8)
    with open(os.path.join(folder, "sheets.safetensors"), "wb") as file:
        file.write(struct.pack("<Q", len(header)) + header + data)


def differences(sheets):
    """What rows and columns say not of the next value: second differences along both, by which smooth cloth is nearly predicted."""
    for axis in (1, 2, 1, 2):
        sheets = numpy.diff(sheets, axis=axis, prepend=0)
    return sheets


def sums(values):
    """The inverse of `differences`."""
    for axis in (1, 2, 1, 2):
        values = numpy.cumsum(values, axis=axis)
    return values


def compressed(sheets):
    """Bytes of int32 sheets: the count, then the low, middle and high bytes of the zigzag differences, each compressed."""
    signed = differences(sheets.astype(numpy.int64))
    if numpy.abs(signed).max() >= 2**23:
        raise SystemExit("a sheet is hundreds of times as large as a sheet should be")
    folded = numpy.moveaxis((signed << 1) ^ (signed >> 63), 3, 0)
    planes = [lzma.compress((folded >> 8 * byte & 255).astype(numpy.uint8).tobytes(), preset=9) for byte in range(3)]
    return struct.pack("<4Q", len(sheets), *map(len, planes)) + b"".join(planes)


def decompressed(data):
    """The sheets, int64 `[n, 51, 51, 3]`."""
    count, *sizes = struct.unpack("<4Q", data[:32])
    at, folded = 32, 0
    for byte, size in enumerate(sizes):
        plane = numpy.frombuffer(lzma.decompress(data[at : at + size]), numpy.uint8).astype(numpy.int64)
        folded = folded + (plane << 8 * byte)
        at += size
    folded = numpy.moveaxis(folded.reshape(3, count, SIDE, SIDE), 0, 3)
    return sums((folded >> 1) ^ -(folded & 1))


def unpack(folder, to):
    for name in sorted(os.listdir(folder)):
        stem, kind = os.path.splitext(name)
        data = open(os.path.join(folder, name), "rb").read()
        if kind == ".sheets":
            write_sheets(os.path.join(to, stem), decompressed(data) / STEPS)
        elif name == "program.xz":
            path = os.path.join(to, "samples")
            os.makedirs(to, exist_ok=True)
            with open(path, "wb") as file:
                file.write(lzma.decompress(data))
            os.chmod(path, 0o755)


if __name__ == "__main__":
    main()
