#!/usr/bin/env python3
"""Live editing on a running darn over HTTP; Python's standard library only.

usage: edit.py SCAN [--url http://127.0.0.1:8080] [--requests 50] [--abandon 0] [--pid PID]

Opens a session, moves a point of the new cloth once a request, searches once a request, drags points in small steps; prints median and p95. With --abandon opens so many
sessions and leaves them, and prints the service's resident memory on the way (--pid).
"""
import argparse, json, random, statistics, time, urllib.error, urllib.request
from pathlib import Path


def ask(url: str, body: bytes, kind: str, accept: str = "*/*"):
    request = urllib.request.Request(url, body, {"content-type": kind, "accept": accept})
    start = time.perf_counter()
    with urllib.request.urlopen(request, timeout=120) as answer:
        data = answer.read()
    return 1e3 * (time.perf_counter() - start), data


def told(name: str, times: list) -> str:
    times = sorted(times)
    p95 = times[min(len(times) - 1, round(0.95 * len(times)))]
    return f"{name}: requests={len(times)} median={statistics.median(times):.1f} ms p95={p95:.1f} ms"


def resident(pid: int) -> float:
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS")) / 1024


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scan", type=Path)
    parser.add_argument("--url", default="http://127.0.0.1:8080")
    parser.add_argument("--requests", type=int, default=50)
    parser.add_argument("--abandon", type=int, default=0)
    parser.add_argument("--pid", type=int)
    a = parser.parse_args()
    scan, rng = a.scan.read_bytes(), random.Random(1)

    took, data = ask(a.url + "/sessions", scan, "model/gltf-binary")
    session = json.loads(data)
    print(f"open: {took:.1f} ms, the session holds {int(session['bytes']) / 2**20:.1f} MiB")
    here, hole = f"{a.url}/sessions/{session['id']}", session["holes"][0]
    size = max(max(hole["rimPositions"][k::3]) - min(hole["rimPositions"][k::3]) for k in range(3))
    cells = hole["holeCells"]
    grabs, moves, drags, searches = [], [], [], []
    for _ in range(a.requests + 2):
        cell = rng.choice(cells)
        uv = [(cell % 64 + 0.5) / 64, (cell // 64 + 0.5) / 64]
        offset = [rng.uniform(-0.05, 0.05) * size for _ in range(3)]
        edit = {"edits": [{"hole": hole["id"], "grab": {"uv": uv, "offset": offset}}]}
        try:
            grabs.append(ask(here + "/inpaint", json.dumps(edit).encode(), "application/json", "application/octet-stream")[0])
        except urllib.error.HTTPError as error:
            # The centre of a cell at the rim may lie on the rim itself.
            print("refused:", error.read()[:200])
        at = hole["gridPositions"][3 * cell : 3 * cell + 3]
        query = {"hole": hole["id"], "target": [x + d for x, d in zip(at, offset)]}
        searches.append(ask(here + "/optimize-anchor", json.dumps(query).encode(), "application/json")[0])
    print(told("inpaint with one grab", grabs[2:]))
    # As the editor drags: a point of the cloth moves on in small steps, each a draft; beside it each a whole answer.
    for _ in range(max(a.requests // 20, 1)):
        cell = rng.choice(cells)
        uv = [(cell % 64 + 0.5) / 64, (cell // 64 + 0.5) / 64]
        way = [rng.uniform(-0.05, 0.05) * size for _ in range(3)]
        for step in range(1, 21):
            grab = {"uv": uv, "offset": [x * step / 20 for x in way]}
            body = json.dumps({"edits": [{"hole": hole["id"], "grab": grab}]}).encode()
            try:
                drags.append(ask(here + "/inpaint?draft=true", body, "application/json")[0])
                moves.append(ask(here + "/inpaint", body, "application/json", "application/octet-stream")[0])
            except urllib.error.HTTPError as error:
                print("refused:", error.read()[:200])
    print(told("drag, a draft each step", drags[2:]))
    print(told("drag, patches each step", moves[2:]))
    print(told("optimize-anchor", searches[2:]))
    for k in range(a.abandon):
        ask(a.url + "/sessions", scan, "model/gltf-binary")
        if a.pid and (k + 1) % max(a.abandon // 5, 1) == 0:
            print(f"{k + 1} sessions abandoned: resident {resident(a.pid):.0f} MiB")
    if a.abandon:
        took, _ = ask(a.url + "/inpaint", scan, "model/gltf-binary")
        print(f"and then /inpaint answers in {took:.1f} ms")


if __name__ == "__main__":
    main()
