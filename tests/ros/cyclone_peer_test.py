"""The server and a Cyclone DDS program, as processes: topics, services and the ROS 2 graph.

STILLMAP, STILLMAP_SERVER, CYCLONE_PEER: the programs. Without CYCLONE_PEER all is skipped.
STILLMAP_SLOWDOWN: how many times as long the time limits are, as in tests/slowdown.hpp.
"""

import fcntl
import math
import os
import random
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

SCANS = int(os.environ.get("STILLMAP_SCANS", "40"))
SLOWDOWN = int(os.environ.get("STILLMAP_SLOWDOWN", "1"))
NODE = "stillmap_server"
WORDS_WITH_SPACES = re.compile(r"  (\w+)=")


LEASES = []


def free_domain() -> int:
    """A DDS domain that no other test takes while this runs (as tests/domain_lease.hpp), and whose first port nobody uses."""
    while True:
        domain = random.randint(100, 200)
        lease = open(Path(tempfile.gettempdir()) / f"stillmap-test-domain-{domain}-of-{os.getuid()}", "a")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                fcntl.flock(lease, fcntl.LOCK_EX | fcntl.LOCK_NB)
                probe.bind(("", 7400 + 250 * domain + 10))
                LEASES.append(lease)
                return domain
            except OSError:
                lease.close()


def facts_of(line: str) -> dict[str, str]:
    """Of a line of the peer's report: 'subject  name=value  name=value'."""
    words = WORDS_WITH_SPACES.split(line)
    return {"subject": words[0]} | dict(zip(words[1::2], words[2::2]))


class Report:
    """What the peer printed."""

    def __init__(self, text: str):
        self.facts = [facts_of(line) for line in text.splitlines()]

    def all(self, subject: str) -> list[dict[str, str]]:
        return [facts for facts in self.facts if facts["subject"] == subject]

    def one(self, subject: str) -> dict[str, str]:
        found = self.all(subject)
        if len(found) != 1:
            raise AssertionError(f"{len(found)} lines on {subject}")
        return found[0]


class Peer:
    """A running command of the peer's."""

    def __init__(self, domain: int, command: str, argument: str = "", may_fail: bool = False):
        self._may_fail = may_fail
        self._process = subprocess.Popen(
            [os.environ["CYCLONE_PEER"], command, str(domain)] + ([argument] if argument else []),
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    def report(self) -> Report:
        text, _ = self._process.communicate(timeout=300 * SLOWDOWN)
        print(text, flush=True)
        if self._process.returncode != 0 and not self._may_fail:
            raise AssertionError(f"the peer failed:\n{text}")
        return Report(text)

    def end(self):
        self._process.kill()
        self._process.communicate()


def true_length_m(recording: Path) -> float:
    """Of the driven path: poses.txt has a 3x4 matrix a line."""
    rows = [[float(word) for word in line.split()]
            for line in (recording / "poses.txt").read_text().splitlines()]
    places = [(row[3], row[7], row[11]) for row in rows]
    return sum(math.dist(a, b) for a, b in zip(places, places[1:]))


CONFIG = """\
sensor: vlp_16
dds: {{domain_id: {domain}, interfaces: [127.0.0.1]}}
labels: {{source: stream}}
frames: {{lidar: ""}}
input: {{delivery: every, queue_length: 3}}
publish: {{path_period_s: 0.1, cloud_period_s: 0.1, tiles_period_s: 0.1, status_period_s: 0.2}}
occupancy: {{publish_period_s: 0.5}}
map: {{file: map.stillmap, save_period_s: 3600}}
"""


class CyclonePeerTest(unittest.TestCase):
    """One drive, after which the server is asked and looked at from all sides."""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        folder = Path(cls.folder.name)
        cls.recording = folder / "city"
        subprocess.run([os.environ["STILLMAP"], "simulate", str(cls.recording),
                        "--sensor", "vlp_16", "--scans", str(SCANS)],
                       check=True, stdout=subprocess.DEVNULL)
        cls.domain = free_domain()
        (folder / "server.yaml").write_text(CONFIG.format(domain=cls.domain))
        cls.watch = Peer(cls.domain, "graph", NODE)
        cls.log = open(folder / "server.log", "w")
        cls.server = subprocess.Popen(
            [os.environ["STILLMAP_SERVER"], "--config", str(folder / "server.yaml")],
            stdout=cls.log, stderr=subprocess.STDOUT)
        try:
            cls.drive = Peer(cls.domain, "drive", str(cls.recording)).report()
        except AssertionError:
            cls.tearDownClass()
            raise

    @classmethod
    def tearDownClass(cls):
        cls.server.kill()
        cls.server.wait()
        cls.log.close()
        cls.watch.end()
        cls.folder.cleanup()

    def test_1_every_scan_comes_back_as_a_pose(self):
        self.assertEqual(self.drive.one("rt/points")["published"], str(SCANS))
        odometry = self.drive.one("rt/stillmap/odometry")
        self.assertEqual(odometry["samples"], str(SCANS))
        self.assertEqual((odometry["frame_id"], odometry["child_frame_id"]), ("map", "velodyne"))
        self.assertAlmostEqual(float(odometry["driven_m"]), true_length_m(self.recording),
                               delta=1.0)

    def test_1_tf_says_the_same_as_odometry(self):
        self.assertEqual(self.drive.one("rt/tf")["samples"], str(SCANS))
        self.assertEqual(self.drive.one("tf")["is_odometry"], "true")

    def test_1_scans_have_colours_for_rviz_and_reach_a_reliable_reader(self):
        scan = self.drive.one("rt/stillmap/scan")
        # Only the newest is kept: a busy machine leaves some out.
        self.assertGreater(int(scan["samples"]), SCANS // 4)
        self.assertEqual(scan["fields"], "x,y,z,intensity,rgb,confidence,label,motion")
        self.assertGreater(int(scan["colours"]), 3)

    def test_2_a_late_joiner_gets_the_map(self):
        late = Peer(self.domain, "late").report()
        self.assertEqual(late.one("rt/stillmap/path")["poses"], str(SCANS))
        cloud = late.one("rt/stillmap/static_cloud")
        self.assertEqual(cloud["fields"], "x,y,z,rgb,confidence,label")
        self.assertEqual((cloud["point_step"], cloud["is_dense"]), ("24", "true"))
        self.assertGreater(int(cloud["points"]), 1000)
        grid = late.one("rt/stillmap/traversability")
        self.assertGreater(int(grid["free"]), 100)
        self.assertEqual(grid["wrong"], "0")
        octomap = late.one("rt/stillmap/octomap")
        self.assertEqual((octomap["id"], octomap["binary"]), ("OcTree", "true"))
        index, tiles = late.one("rt/stillmap/tile_index"), late.one("rt/stillmap/tiles")
        self.assertGreater(int(tiles["keys"]), 4)
        self.assertEqual((index["keys"], index["voxels"]), (tiles["keys"], tiles["voxels"]))
        self.assertEqual(late.one("tiles")["are_those_of_index"], "true")
        self.assertEqual(late.one("rt/stillmap/status")["tiles"], tiles["keys"])

    def check_answers(self, report: Report):
        good, refused = report.all("get_status")
        self.assertEqual(good["code"], "0")
        self.assertEqual(refused["code"], "1")
        self.assertIn("format_version", refused["refused"])
        whole, buildings, reversed_box = report.all("get_static_map")
        self.assertEqual((whole["code"], buildings["code"], reversed_box["code"]), ("0", "0", "1"))
        self.assertEqual((whole["voxels"], whole["continues"]), (good["voxels"], "false"))
        self.assertGreater(int(whole["voxels"]), int(buildings["voxels"]))
        self.assertGreater(int(buildings["voxels"]), 0)
        self.assertEqual(buildings["other_classes"], "0")
        self.assertIn("box x is from", reversed_box["refused"])
        self.assertEqual(report.one("get_tile_versions")["tiles"], good["tiles"])
        tiles = report.one("get_tiles")
        self.assertEqual(int(tiles["tiles"]) + int(tiles["remaining"]), int(good["tiles"]))
        for service in ("get_traversable_area", "nearest_traversable", "check_path",
                        "query_occupancy", "get_removed", "save_map"):
            self.assertEqual(report.one(service)["code"], "0", service)
        self.assertGreater(int(report.one("get_map")["cells"]), 100)
        for service in ("octomap_binary", "octomap_full"):
            self.assertGreater(int(report.one(service)["bytes"]), 100)

    def test_2_every_service_answers_a_cyclone_client(self):
        self.check_answers(Peer(self.domain, "services").report())

    def test_2_clients_of_both_vendors_are_answered_at_once(self):
        cyclone = [Peer(self.domain, "services") for _ in range(3)]
        fast = [subprocess.Popen([os.environ["STILLMAP"], "query", "--domain", str(self.domain),
                                  "--interface", "127.0.0.1", "--json"], stdout=subprocess.PIPE)
                for _ in range(3)]
        for peer in cyclone:
            self.check_answers(peer.report())
        for process in fast:
            process.communicate(timeout=120 * SLOWDOWN)
            self.assertEqual(process.returncode, 0)

    def test_2_the_first_request_of_a_new_client_is_answered(self):
        clients = 30
        report = Peer(self.domain, "clients", str(clients)).report()
        self.assertEqual(report.one("new clients, one request each")["answered"], str(clients))

    def test_2_large_replies_reach_new_processes_of_an_idle_server(self):
        processes = int(os.environ.get("STILLMAP_IDLE_PROCESSES", "10"))
        answered = 0
        for _ in range(processes):
            time.sleep(float(os.environ.get("STILLMAP_IDLE_S", "0")))
            # What the server says to a new reader when it finds it, the peer has often missed.
            report = Peer(self.domain, "large", "1", may_fail=True).report()
            facts = report.one("new clients, one request each")
            answered += int(facts["answered"])
            if facts["answered"] == "1":
                self.assertGreater(int(facts["largest_bytes"]), 100_000)
        self.assertEqual(answered, processes)

    def test_3_the_graph_is_what_discovery_shows(self):
        self.server.send_signal(signal.SIGTERM)
        self.assertEqual(self.server.wait(timeout=60 * SLOWDOWN), 0)
        graph = self.watch.report()
        node, gone = graph.all("node")
        self.assertEqual((node["name"], node["user_data"]), (f"/{NODE}", "enclave=/;"))
        self.assertEqual(gone["has_left"], "true")
        for kind in ("writers", "readers"):
            self.assertEqual(graph.one(kind)["same_gids"], "true", graph.one(kind))
            self.assertGreater(int(graph.one(kind)["announced"]), 15)
        self.assertEqual(graph.one("gids")["rest_is_zero"], "true")
        writers = {facts["topic"]: facts for facts in graph.all("writer")}
        for facts in writers.values():
            self.assertEqual(facts["reliability"], "RELIABLE", facts)
        latched = {topic for topic, facts in writers.items()
                   if facts["durability"] == "TRANSIENT_LOCAL"}
        self.assertEqual(latched, {f"rt/stillmap/{name}" for name in (
            "path", "static_cloud", "tile_index", "tiles", "traversability", "octomap", "status",
            "submaps")})
        for facts in graph.all("writer") + graph.all("reader"):
            self.assertRegex(facts["topic"], r"^(rt|rq|rr)/")
            self.assertRegex(facts["type"], r"^\w+::(msg|srv)::dds_::\w+_$")
            self.assertRegex(facts["user_data"], r"^typehash=RIHS01_[0-9a-f]{64};$", facts)


if __name__ == "__main__":
    if "CYCLONE_PEER" not in os.environ:
        print("skipped: Cyclone DDS (cyclonedds-dev, cyclonedds-tools) was not there at the build")
        sys.exit(77)
    unittest.main()
