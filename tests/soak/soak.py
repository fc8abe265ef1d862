#!/usr/bin/env python3
"""A server under a long run, with clients that come and go, hang and die.

A sensor drives round in one hall at 10 Hz, so that the map stops growing after the first round;
whatever grows from then on is looked at. Fails when the server's memory grows beyond what poses, new
voxels and submaps explain, when file descriptors, threads or shared memory pile up, when a scan is lost, or
when poses stop.
"""
import argparse
import json
import math
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import threading
import time

SAMPLE_S = 5.0
STATUS_EVERY = 3  # samples
CLIENT_PAUSE_S = (0.5, 3.0)
MAX_CLIENTS = 3
WARM_UP = 1 / 6  # of the run
# Beyond these the server leaks. A pose is kept in the trajectory, in its published path and their
# copies; a voxel in the map, its views and the octree; and the allocator needs some play.
PLAY_MIB = 24.0
BYTES_A_POSE = 1500
BYTES_A_VOXEL = 600
# Of the way driven, for the submaps among which loops are closed (server/README.md), up to 1 GiB.
BYTES_A_METRE = 20_000
METRES_A_SCAN = 2 * math.pi * 5.0 / 200  # soak_sensor's circle
MORE_FDS = 12
MORE_THREADS = 8
MORE_SEGMENTS = 6
# A client's two ports in shared memory stay open in the server, and a later client takes others as
# long as there are any (idl/dds/discovery.cpp).
MORE_PORTS = 200
MAX_GAP_S = 20.0
# After this long, DDS has forgotten a client that was killed.
LEASE_S = 30.0


def kib_of(pid, field):
    for line in pathlib.Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith(field + ":"):
            return int(line.split()[1])
    return 0


def shared_memory_of(pid):
    """What the process has mapped: clients' segments of samples, and their small ports."""
    maps = pathlib.Path(f"/proc/{pid}/maps").read_text().splitlines()
    names = {line.split()[5] for line in maps if "/dev/shm/" in line}
    ports = {name for name in names if "_port" in name}
    return {"segments": len(names - ports), "ports": len(ports)}


def use_of(pid):
    folder = pathlib.Path(f"/proc/{pid}")
    return {
        "rss_mib": kib_of(pid, "VmRSS") / 1024,
        "own_mib": kib_of(pid, "RssAnon") / 1024,
        "shared_mib": kib_of(pid, "RssShmem") / 1024,
        "fds": len(list((folder / "fd").iterdir())),
        "threads": len(list((folder / "task").iterdir())),
        **shared_memory_of(pid),
    }


class Poses(threading.Thread):
    """A client that stays: when poses arrive."""

    def __init__(self, command):
        super().__init__(daemon=True)
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                                        text=True)
        self.count = 0
        self.last = None
        self.max_gap_s = 0.0

    def run(self):
        for line in self.process.stdout:
            if '"type":"pose"' not in line:
                continue
            now = time.monotonic()
            if self.last is not None:
                self.max_gap_s = max(self.max_gap_s, now - self.last)
            self.last = now
            self.count += 1


class Clients(threading.Thread):
    """Clients that come, and end by themselves, by SIGKILL, or after being stopped."""

    def __init__(self, stillmap, domain, seed):
        super().__init__(daemon=True)
        self.stillmap, self.domain = stillmap, domain
        self.random = random.Random(seed)
        self.ends = {"by itself": 0, "killed": 0, "stopped, then killed": 0, "stopped for a while": 0}
        self.failed = 0
        self.running = []
        self.stop = threading.Event()

    def command(self):
        far = f"{self.random.uniform(-4, 4):.1f},{self.random.uniform(-4, 4):.1f}"
        words = self.random.choice([
            ["watch", "--duration", "8"],
            ["watch-tiles", "--around-robot", "20", "--duration", "8"],
            ["query"],
            ["query", "--around-robot", "15", "--repeat", "5"],
            ["query", "--sphere", "0", "0", "0", "8", "--resolution", "0.5"],
            ["plan", "--to", far, "--profile", "delivery_robot"],
            ["plan", "--to", far, "--profile", "delivery_robot", "--follow", "--duration", "10"],
            ["nearest", "--to", "0", "0", "--profile", "delivery_robot"],
            ["traversable", "--around-robot", "20", "--profile", "delivery_robot"],
            ["octomap", "--point", "1,1,0", "--ray", "0,0,0,1,0,0"],
            ["status"],
        ])
        return [self.stillmap, *words, "--domain", str(self.domain), "--interface", "127.0.0.1"]

    def live(self, process):
        fate = self.random.choices(list(self.ends), weights=[5, 3, 1, 1])[0]
        if fate == "by itself":
            self.failed += process.wait() not in (0, 4)
        else:
            time.sleep(self.random.uniform(0.3, 6.0))
            if fate.startswith("stopped"):
                process.send_signal(signal.SIGSTOP)
                time.sleep(self.random.uniform(5.0, 15.0))
            if fate == "stopped for a while":
                process.send_signal(signal.SIGCONT)
                process.wait()
            else:
                process.kill()
                process.wait()
        self.ends[fate] += 1

    def run(self):
        while not self.stop.is_set():
            self.running = [t for t in self.running if t.is_alive()]
            if len(self.running) < MAX_CLIENTS:
                process = subprocess.Popen(self.command(), stdout=subprocess.DEVNULL,
                                           stderr=subprocess.DEVNULL)
                life = threading.Thread(target=self.live, args=(process,), daemon=True)
                life.start()
                self.running.append(life)
            self.stop.wait(self.random.uniform(*CLIENT_PAUSE_S))

    def finish(self):
        self.stop.set()
        self.join()
        for life in self.running:
            life.join()


class Soak:
    def __init__(self, options):
        self.options = options
        self.out = pathlib.Path(options.out)
        shutil.rmtree(self.out, ignore_errors=True)
        self.out.mkdir(parents=True)
        self.stillmap = f"{options.bin}/stillmap"
        self.samples = []
        self.processes = []
        self.sent = 0

    def start(self, command, log):
        process = subprocess.Popen(command, stdout=open(self.out / log, "w"),
                                   stderr=subprocess.STDOUT)
        self.processes.append(process)
        return process

    def here(self):
        return ["--domain", str(self.options.domain), "--interface", "127.0.0.1"]

    def status(self):
        answer = subprocess.run([self.stillmap, "status", *self.here(), "--json", "--timeout", "30"],
                                capture_output=True, text=True)
        try:
            return json.loads(answer.stdout)
        except json.JSONDecodeError:
            print(f"soak: no status: exit code {answer.returncode}, {len(answer.stdout)} characters; "
                  f"{answer.stderr.strip()}", flush=True)
            return None

    def start_server(self):
        config = self.out / "server.yaml"
        config.write_text(
            "sensor: vlp_16\n"
            f"dds: {{domain_id: {self.options.domain}, interfaces: [127.0.0.1]}}\n"
            "labels: {source: stream}\n"
            "input: {delivery: every}\n"
            "map: {file: map.stillmap}\n"
            "traversability: {profiles: [delivery_robot], grid_profile: delivery_robot}\n")
        self.server = self.start([f"{self.options.bin}/stillmap-server", "--config", str(config)],
                                 "server.log")
        if self.status() is None:
            raise SystemExit(f"soak: the server does not answer; see {self.out}/server.log")

    def sample(self, begin):
        use = use_of(self.server.pid)
        use["minutes"] = (time.monotonic() - begin) / 60
        if len(self.samples) % STATUS_EVERY == 0:
            status = self.status()
            if status:
                use["mapped"] = status["counters"]["scans_mapped"]
                use["voxels"] = status["voxels"]
                use["dropped"] = dropped_of(status)
        self.samples.append(use)

    def run(self):
        seconds = int(self.options.minutes * 60)
        self.start_server()
        poses = Poses([self.stillmap, "watch", "--json", *self.here()])
        poses.start()
        sensor = self.start([self.options.sensor, str(self.options.domain), str(seconds)], "sensor.log")
        time.sleep(min(10, seconds / 6))
        self.quiet_before = use_of(self.server.pid)
        clients = Clients(self.stillmap, self.options.domain, self.options.seed)
        clients.start()
        begin = time.monotonic()
        while sensor.poll() is None:
            if self.server.poll() is not None:
                raise SystemExit(f"soak: FAILED: the server ended with {self.server.returncode}")
            self.sample(begin)
            time.sleep(SAMPLE_S)
        clients.finish()
        time.sleep(LEASE_S)
        self.quiet_after = use_of(self.server.pid)
        self.last_status = self.status()
        poses.process.send_signal(signal.SIGINT)
        poses.process.wait()
        self.poses, self.clients = poses, clients
        sent = [line.split()[1] for line in (self.out / "sensor.log").read_text().splitlines()
                if line.startswith("sent")]
        self.sent = int(sent[-1]) if sent else 0
        self.sensor_exit = sensor.returncode
        self.server.send_signal(signal.SIGTERM)
        self.server_exit = self.server.wait(timeout=60)

    def stop_all(self):
        for process in self.processes:
            if process.poll() is None:
                process.kill()
                process.wait()

    def faults(self):
        found = []

        def demand(holds, text):
            if not holds:
                found.append(text)

        status = self.last_status
        demand(status is not None, "the server did not answer at the end")
        mapped = status["counters"]["scans_mapped"] if status else 0
        demand(mapped == self.sent, f"{self.sent} scans were sent, {mapped} were mapped")
        demand(status is not None and dropped_of(status) == 0, "scans were dropped")
        demand(self.sensor_exit == 0, "the server stopped taking scans")
        demand(self.poses.max_gap_s <= MAX_GAP_S,
               f"no pose came for {self.poses.max_gap_s:.1f} s")
        demand(self.grown_mib() <= self.allowed_mib(),
               f"memory grew by {self.grown_mib():.1f} MiB, {self.allowed_mib():.1f} are explained")
        for name, slack in (("fds", MORE_FDS), ("threads", MORE_THREADS),
                            ("segments", MORE_SEGMENTS), ("ports", MORE_PORTS)):
            before, after = self.quiet_before[name], self.quiet_after[name]
            demand(after <= before + slack, f"{name} grew from {before} to {after}")
        demand(self.server_exit == 0, f"the server ended with exit code {self.server_exit}")
        return found

    def settled(self):
        return [s for s in self.samples if s["minutes"] > WARM_UP * self.options.minutes]

    def grown_mib(self):
        """From the mean of the first tenth after the warm-up to that of the last."""
        settled = self.settled()
        few = max(1, len(settled) // 10)

        def mean(samples):
            return sum(s["own_mib"] for s in samples) / len(samples)

        return mean(settled[-few:]) - mean(settled[:few])

    def allowed_mib(self):
        known = [s for s in self.settled() if "mapped" in s]
        if len(known) < 2:
            return PLAY_MIB
        poses = known[-1]["mapped"] - known[0]["mapped"]
        voxels = max(0, known[-1]["voxels"] - known[0]["voxels"])
        way_m = poses * METRES_A_SCAN
        return PLAY_MIB + (poses * BYTES_A_POSE + voxels * BYTES_A_VOXEL + way_m * BYTES_A_METRE) / 2**20

    def report(self):
        first, last = self.settled()[0], self.samples[-1]
        known = [s for s in self.samples if "mapped" in s]
        print(f"soak of {self.options.minutes:g} minutes, seed {self.options.seed}")
        rate = self.sent / (self.options.minutes * 60)
        print(f"  scans     {self.sent} sent ({rate:.2f}/s), {known[-1]['mapped']} mapped at the last "
              f"sample, {dropped_of(self.last_status)} dropped")
        print(f"  poses     {self.poses.count} at the client that stayed; longest gap "
              f"{self.poses.max_gap_s:.1f} s")
        print("  clients   " + ", ".join(f"{n} ended {how}" for how, n in self.clients.ends.items()) +
              f"; {self.clients.failed} had no answer")
        print(f"  memory    own {first['own_mib']:.1f} -> {last['own_mib']:.1f} MiB after the warm-up, "
              f"grown {self.grown_mib():.1f} of {self.allowed_mib():.1f} explained; shared "
              f"{first['shared_mib']:.1f} -> {last['shared_mib']:.1f} MiB")
        print(f"  voxels    {known[0]['voxels']} -> {known[-1]['voxels']}")
        for name in ("fds", "threads", "segments", "ports"):
            values = [s[name] for s in self.samples]
            print(f"  {name:9} {self.quiet_before[name]} before the clients, {max(values)} at most, "
                  f"{self.quiet_after[name]} after them")
        print(curve(self.samples))


def dropped_of(status):
    return sum(status["counters"].get("scans_dropped", {}).values())


def curve(samples, columns=64, rows=8):
    """The memory over time, as text."""
    values = [samples[int(i * len(samples) / columns)]["own_mib"] for i in range(columns)]
    top = max(values)
    lines = []
    for row in range(rows, 0, -1):
        marks = "".join("#" if v >= top * (row - 0.5) / rows else " " for v in values)
        lines.append(f"  {top * row / rows:7.1f} |{marks}")
    lines.append("  own MiB +" + "-" * columns + f" {samples[-1]['minutes']:.0f} min")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bin", default="build/release/bin")
    parser.add_argument("--sensor", default="build/release/tests/soak/soak_sensor")
    parser.add_argument("--minutes", type=float, default=30)
    parser.add_argument("--domain", type=int, default=57)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", default="build/soak")
    soak = Soak(parser.parse_args())
    try:
        soak.run()
    finally:
        soak.stop_all()
    (soak.out / "samples.json").write_text(json.dumps(soak.samples))
    soak.report()
    faults = soak.faults()
    for fault in faults:
        print(f"soak: FAILED: {fault}", file=sys.stderr)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
