#!/usr/bin/env python3
"""Latency and memory of a running darn over HTTP; Python's standard library only.

usage: load.py SCAN [--url http://127.0.0.1:8080] [--requests 50] [--clients 1 8] [--soak 500] [--pid PID]

Prints median and p95 of the requests for each number of clients, the report's stage timings (medians), and with --pid the service's
resident memory after 50 and after --soak requests.
"""
import argparse, concurrent.futures, email, json, statistics, time, urllib.request
from pathlib import Path


def post(url: str, body: bytes, accept: str = "model/gltf-binary"):
    request = urllib.request.Request(url + "/inpaint", body, {"content-type": "model/gltf-binary", "accept": accept})
    start = time.perf_counter()
    with urllib.request.urlopen(request, timeout=120) as answer:
        data, kind = answer.read(), answer.headers["content-type"]
    return 1e3 * (time.perf_counter() - start), data, kind


def report(url: str, body: bytes) -> dict:
    _, data, kind = post(url, body, "multipart/mixed")
    parts = email.message_from_bytes(b"content-type: " + kind.encode() + b"\r\n\r\n" + data).get_payload()
    return json.loads(next(p.get_payload(decode=True) for p in parts if p.get_content_type() == "application/json"))


def measure(url: str, body: bytes, requests: int, clients: int) -> str:
    start = time.perf_counter()
    with concurrent.futures.ThreadPoolExecutor(clients) as pool:
        times = sorted(t for t, _, _ in pool.map(lambda _: post(url, body), range(requests)))
    seconds = time.perf_counter() - start
    p95 = times[min(len(times) - 1, round(0.95 * len(times)))]
    return f"clients={clients} requests={requests} median={statistics.median(times):.1f} ms p95={p95:.1f} ms throughput={requests / seconds:.1f}/s"


def resident(pid: int) -> float:
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS")) / 1024


def main():
    a = argparse.ArgumentParser(); a.add_argument("scan"); a.add_argument("--url", default="http://127.0.0.1:8080")
    a.add_argument("--requests", type=int, default=50); a.add_argument("--clients", type=int, nargs="+", default=[1, 8])
    a.add_argument("--soak", type=int, default=0); a.add_argument("--pid", type=int); a = a.parse_args()
    body = Path(a.scan).read_bytes()
    for _ in range(5):
        post(a.url, body)
    for clients in a.clients:
        print(measure(a.url, body, a.requests, clients))
    reports = [report(a.url, body) for _ in range(15)]
    for name, pick in [("scan", lambda r: r["timings"]), ("hole", lambda r: r["holes"][0]["timings"])]:
        stages = {k: statistics.median(pick(r).get(k, 0) for r in reports) for k in pick(reports[0])}
        print(f"{name}, ms:", " ".join(f"{k}={v:.1f}" for k, v in stages.items()))
    if a.pid and a.soak:
        first = resident(a.pid)
        for _ in range(a.soak):
            post(a.url, body)
        print(f"resident: {first:.1f} MiB, after {a.soak} more requests {resident(a.pid):.1f} MiB")


if __name__ == "__main__":
    main()
