"""Trains networks of `darn` side by side on an NVIDIA GPU, all on the same samples, which `darn samples` makes on the CPU's cores.

Each `--student` is a list `from=WEIGHTS,out=NAME` with, where wanted, `kind=standard|gravity|interpen` (gravity is told where up is, interpen's
cloth repels cloth), `optimiser=adamw|muon`, `width=N` (grown from the weights without changing an answer, then disturbed a little), `rate=R`,
`target=truth|mean` (the truth, or the mean of the answers of `teacher=WEIGHTS`, else of `from`, to the eight symmetries of the grid). One clip of
the whole gradient, averaged weights, warm-up and half a cosine over the minutes, as crates/lab/src/train does it by the engine: batch norm keeps
its statistics. Scores and weights are written at intervals and at the end; writing them is part of the minutes.
"""

import argparse
import math
import os
import time

import torch

from loss import RECORD
from pool import Mixture, held_out
from student import Student

WARM_UP, LAST_RATE = 200, 0.01
# The last export starts this much earlier than the slowest step and the slowest export so far would need.
SPARE_SECONDS = 2.0


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", default="darn samples", help="the command that makes samples")
    parser.add_argument("--set", action="append", required=True, metavar="FOLDER:SHARE", help="sheets to learn from, and their share of every batch")
    parser.add_argument("--held-out", action="append", required=True, metavar="NAME:FOLDER", help="sheets to be measured on; the first for the card")
    parser.add_argument("--student", action="append", required=True, metavar="from=WEIGHTS,out=NAME,...")
    parser.add_argument("--out", required=True, help="folder for weights and scores")
    parser.add_argument("--minutes", type=float, required=True)
    parser.add_argument("--every", type=float, default=2, help="minutes between scores and weights files")
    parser.add_argument("--batch", type=int, default=256)
    parser.add_argument("--rate", type=float, default=1e-3, help="of students that name none")
    parser.add_argument("--workers", type=int, default=14)
    parser.add_argument("--pool", type=int, default=32768, help="samples kept on the device and drawn again, 0.1 MB each")
    parser.add_argument("--alike", type=int, default=8)
    parser.add_argument("--roughest-of", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--beta", type=float, default=300, help="weight of self-penetration, for interpen")
    parser.add_argument("--reach", type=float, default=1.0, help="cells at which cloth repels cloth, for interpen")
    parser.add_argument("--device", default="cuda")
    return parser.parse_args()


def rate_share(step, share):
    """Share of the highest learning rate at a step, `share` of the time having passed."""
    rise = min((step + 1) / WARM_UP, 1)
    return rise * (LAST_RATE + (1 - LAST_RATE) * 0.5 * (1 + math.cos(math.pi * min(share, 1))))


def main():
    started = time.monotonic()
    minutes = lambda: (time.monotonic() - started) / 60
    options = arguments()
    os.makedirs(options.out, exist_ok=True)
    torch.backends.cudnn.benchmark = True
    torch.backends.cudnn.allow_tf32 = torch.backends.cuda.matmul.allow_tf32 = True
    records = torch.empty(options.batch, RECORD, dtype=torch.uint8, device=options.device)
    flags = torch.zeros(options.batch, 4, dtype=torch.bool, device=options.device)
    students = [Student(text, options, records, flags) for text in options.student]
    mixture = Mixture(options, options.set)
    try:
        measured = {}
        for text in options.held_out:
            name, _, folder = text.partition(":")
            measured[name] = held_out(options, folder)
        mixture.fill(records, flags)
        if options.device == "cuda":
            for student in students:
                student.capture()
        train(options, students, mixture, measured, minutes)
    finally:
        mixture.stop()


def train(options, students, mixture, measured, minutes):
    """Steps of all students until the minutes are over, exports included."""

    def export():
        before = minutes()
        for student in students:
            print(f"{minutes():.2f} min, step {step}: {student.export(minutes(), measured, mixture.words())}", flush=True)
        return minutes() - before

    step, slowest = 0, 0.0
    longest = export()
    begun = minutes()
    print(f"{begun:.2f} min until the first step", flush=True)
    next_export, next_line = begun + options.every, 0.0
    while True:
        before = minutes()
        last = options.minutes - longest - slowest - SPARE_SECONDS / 60
        share = (before - begun) / max(last - begun, 1e-9)
        if share >= 1:
            break
        mixture.fill(students[0].records, students[0].flags)
        for student in students:
            student.step(rate_share(step, share))
        if options.device == "cuda":
            torch.cuda.synchronize()
        step += 1
        slowest = max(slowest, minutes() - before)
        if minutes() >= next_line:
            next_line = minutes() + options.minutes / 60
            said = "; ".join(f"{s.out} {' '.join(f'{x:.4f}' for x in s.said.tolist())}" for s in students)
            reuse = step * options.batch / mixture.made()
            print(f"{minutes():.2f} min, step {step}, each sample {reuse:.1f} times, rate share {rate_share(step, share):.3f}: {said}", flush=True)
        if minutes() >= next_export:
            longest = max(longest, export())
            next_export = minutes() + options.every
    export()
    print(f"{minutes():.2f} of {options.minutes:g} min used, {step} steps of {options.batch}, {mixture.made()} samples made", flush=True)


if __name__ == "__main__":
    main()
