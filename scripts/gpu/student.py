"""One of the networks that learn side by side: its weights, its optimiser, its step as a CUDA graph, its scores and its file."""

import csv
import os

import torch

from grow import grown
from loss import Samples, loss, scores
from network import predict, read, told_up, write
from optimiser import Optimiser
from symmetry import Turns, mean_answer

KINDS = ("standard", "gravity", "interpen")
DEFAULTS = {"kind": "standard", "optimiser": "adamw", "width": "16", "rate": "", "target": "truth", "teacher": ""}
# Weights files that `darn` ships, and files that a device machine gives back, are no larger.
LARGEST_FILE = 16 * 2**20


def parsed(text):
    """`from=FILE,out=NAME,kind=...,optimiser=...,width=...,rate=...,target=...,teacher=FILE` as a dictionary."""
    given = dict(part.partition("=")[::2] for part in text.split(","))
    unknown = set(given) - set(DEFAULTS) - {"from", "out"}
    missing = {"from", "out"} - set(given)
    if unknown or missing:
        raise SystemExit(f"--student {text}: unknown {sorted(unknown)}, missing {sorted(missing)}")
    chosen = DEFAULTS | given
    if chosen["kind"] not in KINDS or chosen["target"] not in ("truth", "mean"):
        raise SystemExit(f"--student {text}: kind is one of {KINDS}, target is truth or mean")
    return chosen


class Student:
    """`records` and `flags` are the batch that every step learns from, and the symmetries of its samples."""

    def __init__(self, text, options, records, flags):
        chosen = parsed(text)
        self.options, self.records, self.flags = options, records, flags
        self.kind, self.out = chosen["kind"], chosen["out"]
        self.top_rate = float(chosen["rate"] or options.rate)
        self.hanging = self.kind == "gravity"
        self.card, tensors = self.opened(chosen["from"])
        width = int(chosen["width"])
        tensors = grown(tensors, width, seed=options.seed)
        self.card["architecture"] = self.card["architecture"] | {"width": width, "frame": "hanging" if self.hanging else "canonical"}
        size = sum(x.numel() * (2 if x.dim() > 1 else 4) for x in tensors.values())
        if size > LARGEST_FILE - 2**16:
            raise SystemExit(f"{self.out}: a file of width {width} has {size / 2**20:.1f} MiB; at most 16 MiB are allowed")
        self.weights = {"gradient": 2.0, "stretch": 5.0, "self_penetration": 0.0, "reach": options.reach}
        if self.kind == "interpen":
            self.weights["self_penetration"] = options.beta
        trained = {name: x for name, x in tensors.items() if not name.endswith((".mean", ".variance"))}
        self.fixed = {name: x.to(options.device) for name, x in tensors.items() if name not in trained}
        values = torch.cat([x.flatten() for x in trained.values()]).to(options.device)
        self.optimiser = Optimiser(chosen["optimiser"], values, {name: x.shape for name, x in trained.items()})
        self.words = f"{chosen['optimiser']}, rate {self.top_rate:g}"
        self.teacher = None
        if chosen["target"] == "mean":
            _, teacher = self.opened(chosen["teacher"] or chosen["from"])
            self.teacher = {name: x.to(options.device) for name, x in teacher.items()}
            self.words += ", to the mean of a teacher's answers to eight symmetries"
        self.tensors = self.optimiser.views(values)
        for tensor, slope in zip(self.tensors.values(), self.optimiser.views(self.optimiser.slopes).values()):
            tensor.requires_grad_()
            tensor.grad = slope
        self.said = torch.zeros(6, device=options.device)
        self.graph = None

    def opened(self, path):
        card, tensors = read(path)
        return card, told_up(tensors) if self.hanging else tensors

    def answer(self, tensors, samples):
        return predict(tensors, samples.filled, samples.known, samples.up if self.hanging else None)

    def learn(self):
        self.optimiser.slopes.zero_()
        samples = Turns(self.flags).samples(Samples(self.records))
        if self.teacher:
            with torch.no_grad():
                mean = mean_answer(lambda turned: self.answer(self.teacher, turned), samples, 8)
            samples.truth = torch.where(samples.hole > 0, mean, samples.truth)
        total, terms = loss(self.answer(self.tensors | self.fixed, samples), samples, self.weights)
        total.backward()
        norm = self.optimiser.step()
        self.said.lerp_(torch.cat([terms, norm[None]]), 0.02)

    def capture(self):
        """One step as a CUDA graph: a thousand small kernels for the price of one launch."""
        state = self.optimiser.state() + [self.said]
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

    def step(self, share):
        """One step at a share of the highest learning rate."""
        self.optimiser.rate.fill_(self.top_rate * share)
        if self.graph:
            self.graph.replay()
        else:
            self.learn()

    def export(self, minutes, held_out, sheets):
        """Scores the averaged weights on `held_out`, samples by name, and writes them; returns a line of scores."""
        tensors = self.optimiser.views(self.optimiser.averaged) | self.fixed
        answer = lambda samples: self.answer(tensors, samples)
        found, line, row = {}, [], {"student": self.out, "minutes": round(minutes, 3), "steps": self.steps()}
        with torch.no_grad():
            for name, samples in held_out.items():
                once, flips = scores(answer(samples), samples), scores(mean_answer(answer, samples, 4), samples)
                filled = scores(samples.filled, samples)
                # The card has the scores of `darn train`, on the first set.
                found = found or once | {f"fill_{key}": x for key, x in filled.items()}
                row |= {f"{name} once": once["rmse_cells"], f"{name} flips": flips["rmse_cells"], f"{name} normals": once["normal_degrees"]}
                ratio = once["rmse_cells"] / flips["rmse_cells"]
                line.append(f"{name} {once['rmse_cells']:.4f} once, {flips['rmse_cells']:.4f} flips, ratio {ratio:.3f}")
        self.note(row)
        self.write(found, minutes, tensors, sheets)
        return f"{self.out}: {'; '.join(line)}"

    def steps(self):
        return int(self.optimiser.time.item())

    def note(self, row):
        """Appends a line to the table of scores."""
        path = f"{self.options.out}/scores.csv"
        fresh = not os.path.exists(path)
        with open(path, "a", newline="") as file:
            writer = csv.DictWriter(file, row)
            if fresh:
                writer.writeheader()
            writer.writerow(row)

    def write(self, found, minutes, tensors, sheets):
        steps, batch = self.steps(), self.options.batch
        words = f"Softened data + 2 gradient + 5 stretch + {self.weights['self_penetration']:g} self-penetration"
        if self.weights["self_penetration"] > 0:
            words += f" within {self.options.reach:g} cells"
        # The error model belongs to the weights that it was measured on.
        card = {key: value for key, value in self.card.items() if key != "errors"}
        card |= {"name": self.kind, "scores": found}
        card["training"] = {
            "steps": steps,
            "batch": batch,
            "seed": self.options.seed,
            "samples": steps * batch,
            "minutes": minutes,
            "data_seed": None,
            "loss": f"{words}; {self.words}; {sheets}",
        }
        write(f"{self.options.out}/{self.out}.safetensors", card, {name: x.detach().float().cpu() for name, x in tensors.items()})
