"""A running server, asked from Python."""

import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import stillmap

PATIENCE_S = 120


@pytest.fixture(scope="module")
def client(domain):
    return stillmap.Client(domain=domain, timeout_s=PATIENCE_S)


def test_the_map_comes_by_query_and_by_tiles(client):
    status = client.status()
    assert status["counters"]["scans_mapped"] == 12 and status["health"] in ("good", "degenerate")
    answer = client.query(stillmap.Box())
    assert len(answer) == status["voxel_count"] > 1000
    map = client.map()
    assert len(map) == len(answer)
    voxels = map.voxels()
    order_a = np.lexsort(np.round(answer.position_map, 4).T)
    order_b = np.lexsort(np.round(voxels.position_map, 4).T)
    np.testing.assert_allclose(answer.position_map[order_a], voxels.position_map[order_b], atol=1e-3)
    near = client.query(stillmap.Sphere([0, 0, 0], 8.0), classes=["road", "sidewalk", "terrain"])
    assert 0 < len(near) < len(answer)
    assert np.all(np.linalg.norm(near.position_map, axis=1) <= 8.0)


def test_the_path_is_there(client):
    path = client.trajectory(PATIENCE_S)
    assert len(path) >= 1 and path.T_map_body.shape == (len(path), 4, 4)
    assert np.all(np.diff(path.stamp_ns) > 0)


def test_submaps_come_as_arrays(client):
    submaps = client.submaps(PATIENCE_S)
    assert submaps.map_id == client.status()["map_id"] and submaps.graph_revision == 0
    n = len(submaps.trajectory)
    assert submaps.trajectory.T_map_body.shape == (n, 4, 4) and submaps.way_m.shape == (n,)
    assert submaps.loops.shape == (0, 2) and submaps.jump_m.shape == (0,)


def pose_at(client, stamp_ns):
    """T_map_body when the path has come there: it is published at a period of its own."""
    end = time.monotonic() + PATIENCE_S
    while True:
        path = client.trajectory(PATIENCE_S)
        at = np.flatnonzero(path.stamp_ns == stamp_ns)
        if len(at) == 1:
            return path.T_map_body[at[0]]
        assert time.monotonic() < end, (stamp_ns, path.stamp_ns)
        time.sleep(0.2)


def test_the_robot_is_found_where_it_is(client):
    near = client.trajectory(PATIENCE_S).T_map_body[-1]
    heading = np.arctan2(near[1, 0], near[0, 0])
    found = client.localize(near=(near[0, 3], near[1, 3], heading), radius_m=10.0)
    assert found.outcome == "found" and not found.applied
    here = pose_at(client, found.stamp_ns)
    np.testing.assert_allclose(found.T_map_base[:2, 3], here[:2, 3], atol=0.5)
    with pytest.raises(stillmap.ServiceError, match="radius_m is 20000"):
        client.localize(near=(0.0, 0.0, 0.0), radius_m=20_000.0)
    # 0 would have the whole map searched, and every heading.
    for radius_m in (0.0, -1.0, float("nan")):
        with pytest.raises(ValueError, match="radius_m"):
            client.localize(near=(0.0, 0.0, 0.0), radius_m=radius_m)
    for max_turn_rad in (0.0, -0.1, float("nan")):
        with pytest.raises(ValueError, match="max_turn_rad"):
            client.localize(near=(0.0, 0.0, 0.0), max_turn_rad=max_turn_rad)


def test_traversability_is_that_of_the_servers_map(client):
    here = client.map().traversability("car").grid()
    end = time.monotonic() + PATIENCE_S
    grid = None
    # The server's follows its map.
    while grid is None or not np.array_equal(grid.cost, here.cost):
        assert time.monotonic() < end
        time.sleep(0.2)
        try:
            grid = client.grid(robot="car")
        except LookupError:
            pass
    assert grid.resolution_m == here.resolution_m
    np.testing.assert_array_equal(grid.origin_map, here.origin_map)
    assert np.any(grid.cost == 0)
    free = client.nearest(*client.trajectory(PATIENCE_S).T_map_body[0, :2, 3])
    check = client.check_path([free.position_map[:2]], [0.0])
    assert check.is_free, check.reason
    plan = client.map().traversability("car").plan((*free.position_map[:2], 0.0), (*free.position_map[:2], 0.0))
    assert plan.status == "found"


def test_removed_voxels_and_saving(client, tmp_path):
    removed = client.removed()
    assert removed.position_map.shape == (len(removed.label), 3)
    assert removed.total == len(removed.label) and removed.incomplete == ""
    with pytest.raises(stillmap.ServiceError):
        client.save_map("no/plain/name")


def test_no_server_is_an_exception_that_names_the_domain(free_domain):
    with pytest.raises(stillmap.ServiceTimeout, match=str(free_domain)):
        stillmap.Client(domain=free_domain, timeout_s=0.5)
    with pytest.raises(stillmap.ServiceTimeout, match="within 1200 ms"):
        stillmap.Client(domain=free_domain, timeout_s=1.2)
    with pytest.raises(stillmap.ConfigError, match="pigeon"):
        stillmap.Client(domain=free_domain, profile="pigeon")


def test_without_a_domain_it_is_that_of_ros_domain_id(client, domain, monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    assert stillmap.Client(timeout_s=PATIENCE_S).status()["map_id"] == client.status()["map_id"]
    monkeypatch.setenv("ROS_DOMAIN_ID", "robot")
    with pytest.raises(stillmap.DdsError, match="ROS_DOMAIN_ID"):
        stillmap.Client(timeout_s=0.5)


def test_an_interface_that_the_machine_lacks_is_named_at_once(domain):
    with pytest.raises(stillmap.DdsError, match="203.0.113.9 is no address"):
        stillmap.Client(domain=domain, interfaces=["203.0.113.9"], timeout_s=PATIENCE_S)


def test_a_region_that_cannot_be_used_is_refused_in_words(client):
    with pytest.raises(ValueError, match="radius"):
        client.query(stillmap.Sphere([0, 0, 0], -1.0))


def test_ctrl_c_ends_waiting_for_a_server(free_domain):
    program = (f"import stillmap; print('waits', flush=True); "
               f"stillmap.Client(domain={free_domain}, timeout_s=float('inf'))")
    waiting = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert waiting.stdout.readline() == "waits\n"
    time.sleep(0.5)
    waiting.send_signal(signal.SIGINT)
    assert "KeyboardInterrupt" in waiting.communicate(timeout=PATIENCE_S)[1]
