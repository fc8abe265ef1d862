"""A running server, asked from Python."""

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


def test_traversability_is_that_of_the_servers_map(client):
    end = time.monotonic() + PATIENCE_S
    while True:
        try:
            grid = client.grid(robot="car")
            break
        except LookupError:
            assert time.monotonic() < end
            time.sleep(0.2)
    here = client.map().traversability("car").grid()
    assert grid.resolution_m == here.resolution_m
    assert np.mean(grid.cost == 0) > 0 or np.any(grid.cost > 0)
    free = client.nearest(0.0, 0.0)
    check = client.check_path([free.position_map[:2]], [0.0])
    assert check.is_free or check.reason
    plan = client.map().traversability("car").plan((*free.position_map[:2], 0.0), (*free.position_map[:2], 0.0))
    assert plan.status


def test_removed_voxels_and_saving(client, tmp_path):
    removed = client.removed()
    assert removed.position_map.shape == (len(removed.label), 3)
    with pytest.raises(stillmap.ServiceError):
        client.save_map("no/plain/name")


def test_no_server_is_an_exception_that_names_the_domain(free_domain):
    with pytest.raises(stillmap.ServiceTimeout, match=str(free_domain)):
        stillmap.Client(domain=free_domain, timeout_s=0.5)
    with pytest.raises(stillmap.ConfigError, match="pigeon"):
        stillmap.Client(domain=free_domain, profile="pigeon")


def test_a_region_that_cannot_be_used_is_refused_in_words(client):
    with pytest.raises(ValueError, match="radius"):
        client.query(stillmap.Sphere([0, 0, 0], -1.0))
