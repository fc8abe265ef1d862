"""A small simulated drive, its map by the command line, and a server that has mapped it."""

import fcntl
import json
import os
import random
import subprocess
import tempfile
from pathlib import Path

import pytest

PROGRAM = os.environ["STILLMAP"]
SERVER = os.environ["STILLMAP_SERVER"]
SCANS = 12
PATIENCE_S = 60


def run(*arguments: object) -> str:
    words = [PROGRAM, *map(str, arguments)]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, f"{words}: {done.stderr}"
    return done.stdout


@pytest.fixture(scope="session")
def city(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("drive") / "city"
    run("simulate", folder, "--preset", "yard", "--sensor", "vlp_16", "--scans", SCANS, "--imu")
    return folder


@pytest.fixture(scope="session")
def mapped(city) -> Path:
    """The folder that `stillmap map` wrote."""
    out = city.parent / "mapped"
    run("map", city, "--labels", "files", "--out", out, "--json")
    return out


@pytest.fixture(scope="session")
def map_file(mapped) -> Path:
    return mapped / "map.stillmap"


def take_domain():
    """A DDS domain that no other test takes, and the file that says so while it is open."""
    while True:
        domain = random.randint(20, 219)
        lease = open(Path(tempfile.gettempdir()) / f"stillmap-test-domain-{domain}-of-{os.getuid()}", "a")
        try:
            fcntl.flock(lease, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return domain, lease
        except OSError:
            lease.close()


@pytest.fixture(scope="session")
def free_domain():
    domain, lease = take_domain()
    yield domain
    lease.close()


@pytest.fixture(scope="session")
def domain(city):
    """Of a server that has mapped the drive."""
    number, lease = take_domain()
    config = city.parent / "server.yaml"
    config.write_text("sensor: vlp_16\ninput: {delivery: every}\ntraversability: {update_period_s: 0.1}\n")
    with open(city.parent / "server.log", "w") as log:
        server = subprocess.Popen([SERVER, "--config", config, "--domain", str(number)], stderr=log)
        try:
            run("status", "--domain", number, "--timeout", PATIENCE_S)
            replayed = json.loads(run("replay", city, "--lossless", "--json", "--domain", number,
                                      "--timeout", PATIENCE_S))
            assert replayed["mapped"] == SCANS, replayed
            yield number
        finally:
            server.terminate()
            server.wait(PATIENCE_S)
            lease.close()
