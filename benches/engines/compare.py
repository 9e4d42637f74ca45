"""Times engines on one network, in turn, and prints their times and ratios."""

import argparse
import json
import shlex
import statistics
import subprocess
import time

import numpy as np
import onnxruntime
import openvino

import pytorch
from export import export


def onnxruntime_engine(model, threads):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
    return lambda x: session.run(None, {"x": x})[0]


def openvino_engine(precision):
    def build(model, threads):
        core = openvino.Core()
        settings = {
            "INFERENCE_NUM_THREADS": threads,
            "NUM_STREAMS": 1,
            "PERFORMANCE_HINT": "LATENCY",
            "INFERENCE_PRECISION_HINT": precision,
        }
        compiled = core.compile_model(core.read_model(model), "CPU", settings)
        request = compiled.create_infer_request()

        def run(x):
            request.infer({0: x}, share_inputs=True)
            return request.get_output_tensor(0).data

        return run

    return build


ENGINES = {
    "onnxruntime f32": onnxruntime_engine,
    "openvino f32": openvino_engine("f32"),
    "openvino bf16": openvino_engine("bf16"),
}


# Made of the weights file, not of the ONNX model.
PYTORCH = {"pytorch f32": pytorch.forward, "pytorch f32 gradient": pytorch.gradient}


def measure(call, seconds):
    """Least and median milliseconds."""
    call()
    call()
    times, start = [], time.perf_counter()
    while len(times) < 5 or time.perf_counter() - start < seconds:
        before = time.perf_counter()
        call()
        times.append(1e3 * (time.perf_counter() - before))
    return min(times), statistics.median(times)


def own(command):
    """Our lines: (name, batch, threads) and times."""
    lines = subprocess.run(shlex.split(command), check=True, capture_output=True, text=True).stdout.splitlines()
    for line in map(json.loads, lines):
        name = f"own {line['isa']} {line['precision']}"
        if line["what"] == "gradient":
            name += " gradient"
        yield (name, line["batch"], line["threads"]), (line["least_ms"], line["median_ms"])


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("weights")
    parser.add_argument("--own", help="a command that prints our JSON lines; run once a round")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=0.5, help="per engine, batch, threads and round")
    arguments = parser.parse_args()

    rng, runs, outputs = np.random.default_rng(0), {}, {}
    for batch in (1, 8):
        model, x = export(arguments.weights, batch), rng.normal(size=(batch, 4, 64, 64)).astype(np.float32)
        for threads in (1, 2):
            for name, build in ENGINES.items():
                run = build(model, threads)
                runs[name, batch, threads] = (lambda run=run, x=x: run(x))
                outputs[name, batch] = np.array(run(x))
            for name, build in PYTORCH.items():
                run = build(pytorch.Network(arguments.weights), threads)
                runs[name, batch, threads] = (lambda run=run, x=x: run(x))
            outputs["pytorch f32", batch] = runs["pytorch f32", batch, threads]()
    for batch in (1, 8):
        truth = outputs["onnxruntime f32", batch]
        for name in [*ENGINES, "pytorch f32"]:
            error = np.abs(outputs[name, batch] - truth).max()
            print(f"# batch {batch}: {name} to onnxruntime {error:.1e}, largest output {np.abs(truth).max():.1e}")

    times = {}
    for _ in range(arguments.rounds):
        for key, call in runs.items():
            times.setdefault(key, []).append(measure(call, arguments.seconds))
        for key, both in own(arguments.own) if arguments.own else ():
            times.setdefault(key, []).append(both)

    print("| batch | threads | engine | least ms | median ms | to onnxruntime (medians) |\n|---|---|---|---|---|---|")
    for name, batch, threads in sorted(times, key=lambda key: key[1:] + key[:1]):
        both = times[name, batch, threads]
        least, median = min(t[0] for t in both), statistics.median(t[1] for t in both)
        base = statistics.median(t[1] for t in times["onnxruntime f32", batch, threads])
        print(f"| {batch} | {threads} | {name} | {least:.2f} | {median:.2f} | {median / base:.2f} |")


if __name__ == "__main__":
    main()
