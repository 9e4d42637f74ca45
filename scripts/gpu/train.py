"""Trains networks of `darn` side by side on an NVIDIA GPU, all on the same samples, which `darn samples` makes on the CPU's cores.

Each `--student NAME:FROM:OUT` starts from a weights file: NAME is `standard`, `gravity` (told where up is) or `interpen` (cloth repels cloth).
AdamW, one clip of the whole gradient, averaged weights, warm-up and half a cosine, as src/train does it by the engine: batch norm keeps its
statistics.
"""

import argparse
import json
import math
import queue
import subprocess
import threading
import time

import numpy
import torch

from loss import RECORD, Samples, loss, scores
from network import predict, read, told_up, write

BETA1, BETA2, EPSILON, DECAY, CLIP, AVERAGE = 0.9, 0.99, 1e-8, 1e-2, 1.0, 0.998
WARM_UP, LAST_RATE = 200, 0.01


def arguments():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--darn", default="darn")
    parser.add_argument("--sheets", required=True)
    parser.add_argument("--held-out", required=True)
    parser.add_argument("--student", action="append", required=True, metavar="NAME:FROM:OUT")
    parser.add_argument("--minutes", type=float, required=True)
    parser.add_argument("--every", type=float, default=3, help="minutes between scores and weights files")
    parser.add_argument("--batch", type=int, default=256)
    parser.add_argument("--rate", type=float, default=1e-3)
    parser.add_argument("--workers", type=int, default=14)
    parser.add_argument("--alike", type=int, default=8)
    parser.add_argument("--roughest-of", type=int, default=3)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--beta", type=float, default=300, help="weight of self-penetration, for interpen")
    parser.add_argument("--reach", type=float, default=1.0, help="cells at which cloth repels cloth, for interpen")
    parser.add_argument("--device", default="cuda")
    return parser.parse_args()


class Stream:
    """Batches of records from one `darn samples`."""

    def __init__(self, options, seed):
        command = [options.darn, "samples", "--upright", "--sheets", options.sheets, "--seed", str(seed)]
        command += ["--alike", str(options.alike), "--roughest-of", str(options.roughest_of)]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, bufsize=0)
        pinned = options.device == "cuda"
        self.free, self.full = queue.Queue(), queue.Queue()
        for _ in range(3):
            self.free.put(torch.empty(options.batch, RECORD, dtype=torch.uint8, pin_memory=pinned))
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        while True:
            records = self.free.get()
            view, at = memoryview(records.numpy()).cast("B"), 0
            while at < len(view):
                got = self.process.stdout.readinto(view[at:])
                if not got:
                    return self.full.put(None)
                at += got
            self.full.put(records)


class Student:
    def __init__(self, text, options, records):
        self.name, self.start, self.out = text.split(":")
        self.options, self.records = options, records
        self.card, tensors = read(self.start)
        self.hanging = self.name == "gravity"
        if self.hanging:
            tensors = told_up(tensors)
        self.weights = {"gradient": 2.0, "stretch": 5.0, "self_penetration": 0.0, "reach": options.reach}
        if self.name == "interpen":
            self.weights["self_penetration"] = options.beta
        device = options.device
        trained = {name: x for name, x in tensors.items() if not name.endswith((".mean", ".variance"))}
        flat = lambda of: torch.cat([of(x).flatten() for x in trained.values()]).to(device)
        self.values, self.slopes = flat(lambda x: x), flat(torch.zeros_like)
        self.first, self.second = flat(torch.zeros_like), flat(torch.zeros_like)
        self.averaged, self.kernels = self.values.clone(), flat(lambda x: torch.full_like(x, float(x.dim() > 1)))
        self.fixed = {name: x.to(device) for name, x in tensors.items() if name not in trained}
        self.shapes = {name: x.shape for name, x in trained.items()}
        self.tensors = self.views(self.values)
        for tensor, slope in zip(self.tensors.values(), self.views(self.slopes).values()):
            tensor.requires_grad_()
            tensor.grad = slope
        self.rate, self.time = torch.zeros((), device=device), torch.zeros((), device=device, dtype=torch.float64)
        self.said = torch.zeros(6, device=device)
        self.measured = held_out(options, upright=self.hanging)
        self.graph = None

    def views(self, flat):
        views, at = {}, 0
        for name, shape in self.shapes.items():
            views[name] = flat[at : at + shape.numel()].view(shape)
            at += shape.numel()
        return views

    def answer(self, tensors, samples):
        return predict(tensors, samples.filled, samples.known, samples.up if self.hanging else None)

    def learn(self):
        self.slopes.zero_()
        samples = Samples(self.records)
        total, terms = loss(self.answer(self.tensors | self.fixed, samples), samples, self.weights)
        total.backward()
        with torch.no_grad():
            norm = self.slopes.norm()
            # A step that is not finite is not taken.
            slopes = torch.where(norm.isfinite(), self.slopes * (CLIP / norm).clamp(max=1), 0)
            self.time += 1
            self.first.lerp_(slopes, 1 - BETA1)
            self.second.lerp_(slopes * slopes, 1 - BETA2)
            unbias = [(1 / (1 - beta**self.time)).float() for beta in (BETA1, BETA2)]
            change = self.first * (unbias[0] * self.rate) / (torch.sqrt(self.second * unbias[1]) + EPSILON)
            self.values.mul_(1 - self.rate * DECAY * self.kernels).sub_(change)
            keep = torch.clamp((1 + self.time) / (10 + self.time), max=AVERAGE).float()
            self.averaged.mul_(keep).add_(self.values * (1 - keep))
            self.said.lerp_(torch.cat([terms, norm[None]]), 0.02)

    def capture(self):
        """One step as a CUDA graph: a thousand small kernels for the price of one launch."""
        state = [self.values, self.first, self.second, self.averaged, self.time, self.said]
        kept = [x.clone() for x in state]
        stream = torch.cuda.Stream()
        stream.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(stream):
            for _ in range(3):
                self.learn()
        torch.cuda.current_stream().wait_stream(stream)
        self.graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(self.graph):
            self.learn()
        with torch.no_grad():
            for x, before in zip(state, kept):
                x.copy_(before)

    def step(self, rate):
        self.rate.fill_(rate)
        if self.graph:
            self.graph.replay()
        else:
            self.learn()

    def export(self, minutes):
        """Scores the averaged weights and writes them; returns the scores."""
        tensors = self.views(self.averaged) | self.fixed
        with torch.no_grad():
            found = scores(self.answer(tensors, self.measured), self.measured)
            filled = scores(self.measured.filled, self.measured)
        steps = int(self.time.item())
        words = f"Softened data + 2 gradient + 5 stretch + {self.weights['self_penetration']:g} self-penetration"
        if self.weights["self_penetration"] > 0:
            words += f" within {self.options.reach:g} cells"
        card = self.card | {"name": self.name, "scores": found | {f"fill_{name}": x for name, x in filled.items()}}
        card["architecture"] = self.card["architecture"] | {"frame": "hanging" if self.hanging else "canonical"}
        card["training"] = {
            "steps": steps,
            "batch": self.options.batch,
            "seed": self.options.seed,
            "samples": steps * self.options.batch,
            "minutes": minutes,
            "data_seed": json.load(open(f"{self.options.sheets}/manifest.json"))["seed"],
            "loss": words,
        }
        tensors = {name: x.detach().float().cpu() for name, x in tensors.items()}
        write(f"{self.out}/{self.name}.safetensors", card, tensors)
        return found


def held_out(options, upright):
    """The samples that `darn train` measures such a network on."""
    command = [options.darn, "samples", "--sheets", options.held_out, "--held-out"] + ["--upright"] * upright
    data = numpy.frombuffer(subprocess.run(command, check=True, capture_output=True).stdout, numpy.uint8)
    return Samples(torch.from_numpy(data.copy()).reshape(-1, RECORD).to(options.device))


def main():
    options = arguments()
    torch.backends.cudnn.benchmark = True
    torch.backends.cudnn.allow_tf32 = torch.backends.cuda.matmul.allow_tf32 = True
    streams = [Stream(options, 1000 * options.seed + worker) for worker in range(options.workers)]
    records = torch.empty(options.batch, RECORD, dtype=torch.uint8, device=options.device)
    students = [Student(text, options, records) for text in options.student]
    records.copy_(first := streams[0].full.get())
    streams[0].full.put(first)
    if options.device == "cuda":
        for student in students:
            student.capture()
    told = lambda found: " ".join(f"{name} {value:.4f}" for name, value in found.items())
    for student in students:
        print(f"{student.name} at first: {told(student.export(0))}", flush=True)
    started, step, waited, next_export, next_line = time.monotonic(), 0, 0.0, options.every, 0.0
    while True:
        stream = streams[step % len(streams)]
        before = time.monotonic()
        batch = stream.full.get()
        waited += time.monotonic() - before
        records.copy_(batch, non_blocking=True)
        minutes = (time.monotonic() - started) / 60
        share = min(minutes / options.minutes, 1)
        rise = min((step + 1) / WARM_UP, 1)
        rate = options.rate * rise * (LAST_RATE + (1 - LAST_RATE) * 0.5 * (1 + math.cos(math.pi * share)))
        for student in students:
            student.step(rate)
        if options.device == "cuda":
            torch.cuda.synchronize()
        stream.free.put(batch)
        step += 1
        if minutes >= next_line:
            next_line += options.minutes / 60
            said = "; ".join(f"{s.name} {' '.join(f'{x:.4f}' for x in s.said.tolist())}" for s in students)
            print(f"{minutes:.2f} min, step {step}, waited {waited:.0f} s, rate {rate:.2e}: {said}", flush=True)
        if minutes >= next_export or share >= 1:
            next_export = minutes + options.every
            for student in students:
                print(f"{minutes:.2f} min, step {step}: {student.name}: {told(student.export(minutes))}", flush=True)
        if share >= 1:
            break
    for stream in streams:
        stream.process.kill()


if __name__ == "__main__":
    main()
