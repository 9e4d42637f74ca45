"""Samples for training: `darn`'s records from its processes on the CPU's cores, kept on the device and drawn again under other symmetries, so
that training never waits for them."""

import queue
import shlex
import subprocess
import threading

import numpy
import torch

from loss import RECORD, Samples

# Records that a process hands over at once.
CHUNK = 64


class Stream:
    """Chunks of records from one process that makes them without end."""

    def __init__(self, command, pinned):
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, bufsize=0)
        self.free, self.full = queue.Queue(), queue.Queue()
        for _ in range(3):
            self.free.put(torch.empty(CHUNK, RECORD, dtype=torch.uint8, pin_memory=pinned))
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


class Pool:
    """The newest `capacity` records of one folder of sheets, from `workers` processes."""

    def __init__(self, options, folder, workers, seed, capacity):
        command = shlex.split(options.samples) + ["--upright", "--sheets", folder, "--alike", str(options.alike), "--roughest-of", str(options.roughest_of)]
        pinned = options.device == "cuda"
        self.streams = [Stream(command + ["--seed", str(seed + worker)], pinned) for worker in range(workers)]
        self.records = torch.empty(max(capacity, CHUNK), RECORD, dtype=torch.uint8, device=options.device)
        self.made = self.at = 0

    def take(self, block):
        """Copies finished chunks into the pool; with `block` waits for one."""
        for stream in self.streams:
            while block or not stream.full.empty():
                chunk = stream.full.get()
                if chunk is None:
                    raise SystemExit("a process that makes samples has ended")
                if self.at + CHUNK > len(self.records):
                    self.at = 0
                self.records[self.at : self.at + CHUNK] = chunk.to(self.records.device)
                self.at += CHUNK
                self.made += CHUNK
                stream.free.put(chunk)
                block = False

    def draw(self, count, random):
        """Random records of the pool, `[count, RECORD]`."""
        filled = min(self.made, len(self.records) // CHUNK * CHUNK)
        at = torch.randint(filled, [count], generator=random)
        return self.records[at.to(self.records.device)]

    def stop(self):
        for stream in self.streams:
            stream.process.kill()


class Mixture:
    """Pools with shares of every batch: `sets` are texts `FOLDER:SHARE`."""

    def __init__(self, options, sets):
        pairs = [text.rpartition(":")[::2] for text in sets]
        total = sum(float(share) for _, share in pairs)
        self.shares = {folder: float(share) / total for folder, share in pairs}
        self.options, self.pools, self.random = options, [], torch.Generator().manual_seed(options.seed)
        counts = [round(share * options.batch) for share in self.shares.values()]
        counts[0] += options.batch - sum(counts)
        self.counts = counts
        for number, (folder, share) in enumerate(self.shares.items()):
            workers = max(1, round(share * options.workers))
            seed = 1000 * options.seed + 100 * number
            self.pools.append(Pool(options, folder, workers, seed, int(share * options.pool)))
        for pool in self.pools:
            pool.take(block=True)

    def fill(self, records, flags):
        """Draws a batch into `records`, and symmetries of its samples into `flags`."""
        for pool in self.pools:
            pool.take(block=False)
        drawn = [pool.draw(count, self.random) for pool, count in zip(self.pools, self.counts)]
        records.copy_(torch.cat(drawn))
        flags.copy_(torch.randint(2, flags.shape, generator=self.random).bool())

    def made(self):
        return sum(pool.made for pool in self.pools)

    def words(self):
        parts = [f"{100 * share:.0f} % {folder.rstrip('/').rpartition('/')[2]}" for folder, share in self.shares.items()]
        return "sheets: " + ", ".join(parts)

    def stop(self):
        for pool in self.pools:
            pool.stop()


def held_out(options, folder):
    """The samples that `darn train` measures networks on."""
    command = shlex.split(options.samples) + ["--sheets", folder, "--held-out"]
    data = numpy.frombuffer(subprocess.run(command, check=True, capture_output=True).stdout, numpy.uint8)
    return Samples(torch.from_numpy(data.copy()).reshape(-1, RECORD).to(options.device))
