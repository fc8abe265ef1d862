"""Map files as arrays, against what the command line says of them and against NumPy."""

import json
import subprocess
import sys

import numpy as np
import pytest
import stillmap
from conftest import run


@pytest.fixture(scope="module")
def map(map_file):
    return stillmap.open_map(map_file)


def test_it_holds_what_map_info_counts(map, map_file):
    info = json.loads(run("map-info", map_file, "--json"))
    voxels = map.voxels()
    assert len(map) == len(voxels) == info["voxels"]
    assert len(map.tiles) == info["tiles"]
    assert len(map.trajectory) == info["poses"]
    counts = np.bincount(voxels.label, minlength=len(stillmap.CLASS_NAMES))
    for name, count in zip(stillmap.CLASS_NAMES, counts):
        assert info["classes"].get(name, 0) == count, name


def test_what_the_interpreter_shows_tells_things_apart(map, city):
    assert repr(map) == f"<stillmap.Map: {len(map)} voxels of 0.2 m in {len(map.tiles)} tiles, version {map.version}>"
    assert repr(map.voxels()) == f"<stillmap.Voxels: {len(map)} voxels>"
    assert repr(map.trajectory) == f"<stillmap.Trajectory: {len(map.trajectory)} poses>"
    dataset = stillmap.open_dataset(city)
    assert repr(dataset) == f"<stillmap.Dataset: {len(dataset)} scans of {dataset.sensor.name}>"
    assert repr(dataset[0]).startswith(f"<stillmap.Scan: {len(dataset[0])} points")
    assert "16 rings" in repr(dataset.sensor)
    mapper = stillmap.Mapper(dataset.sensor)
    assert repr(mapper.process(dataset[0])).startswith("<stillmap.MappedScan: ")
    assert repr(mapper) == "<stillmap.Mapper: 1 poses, labels: none>"


def test_it_has_the_version_of_the_programs():
    assert run("--version").split()[-1] == stillmap.__version__


def test_without_numpy_it_names_what_is_missing():
    program = "import sys; sys.modules['numpy'] = None; import stillmap"
    failed = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert failed.stderr.splitlines()[-1].startswith("ImportError: stillmap needs numpy (Debian's python3-numpy)")


def test_packed_voxels_are_what_numpy_makes_of_their_bytes(map):
    """The format's own formula, in NumPy: 8 + 8 + 16 bits of index, sums of offsets."""
    columns = round(map.tile_size_m / map.voxel_size_m)
    voxels = map.voxels()
    begin = 0
    for tile in map.tiles:
        packed = tile.packed
        key = packed["key"].astype(np.int64)
        index = np.stack([key >> 24, key >> 16 & 0xFF, (key & 0xFFFF) - 0x8000], axis=1)
        corner = index + np.array([*tile.id, 0]) * columns * np.array([1, 1, 0])
        points = np.minimum(packed["point_count"], 255).astype(float)[:, None]
        mean = (corner + packed["offset_sum"] / (256 * points) + 0.5 / 256) * map.voxel_size_m
        of_tile = slice(begin, begin + len(tile))
        np.testing.assert_allclose(voxels.position_map[of_tile], mean, atol=1e-5)
        np.testing.assert_array_equal(voxels.point_count[of_tile], packed["point_count"])
        np.testing.assert_array_equal(tile.voxels().position_map, voxels.position_map[of_tile])
        assert not packed.flags.writeable and not packed.flags.owndata
        begin += len(tile)
    assert begin == len(voxels)


def test_arrays_outlive_what_they_come_from(map_file):
    packed = stillmap.open_map(map_file).tiles[0].packed
    positions = stillmap.open_map(map_file).query(stillmap.Box()).position_map
    again = stillmap.open_map(map_file)
    assert np.array_equal(packed, again.tiles[0].packed)
    assert np.array_equal(positions, again.query(stillmap.Box()).position_map)


def test_evidence_has_the_label_first_in_weight(map):
    labels, weights = map.evidence()
    voxels = map.voxels()
    best = weights.max(axis=1)
    winner_has_it = np.any((labels == voxels.label[:, None]) & (weights == best[:, None]), axis=1)
    assert np.all(winner_has_it | (best == 0))
    np.testing.assert_allclose(best / np.maximum(weights.sum(axis=1), 1e-9), voxels.confidence,
                               atol=1e-5)


def test_regions_are_what_numpy_selects(map):
    p = map.voxels().position_map
    inside = np.all((p >= [-15, -15, -3]) & (p <= [18, 19, 6]), axis=1)
    assert len(map.query(stillmap.Box([-15, -15, -3], [18, 19, 6]))) == inside.sum() > 100
    near = np.linalg.norm(p - [1, 2, 0], axis=1) <= 16
    answer = map.query(stillmap.Sphere([1, 2, 0], 16))
    assert len(answer) == near.sum() > 100
    assert set(np.unique(answer.label)) <= set(range(20))
    roads = map.query(stillmap.Box(), classes=["road"])
    assert len(roads) == np.sum(map.voxels().label == stillmap.CLASS_NAMES.index("road"))
    corners = np.array([[-14.0, -14], [14, -14], [14, 14], [-14, 14]])
    square = np.all(np.abs(p[:, :2]) <= 14, axis=1)
    assert len(map.query(stillmap.Polygon(corners))) == square.sum() > 100


def test_removed_voxels_have_reasons(map, map_file):
    removed = map.removed()
    assert removed.position_map.shape == (len(removed.label), 3)
    assert len(removed.reason) == len(removed.label)
    listed = json.loads(run("removed", map_file, "--json"))
    assert listed["total"] == len(removed.label)


def test_traversability_and_plans(map):
    car = map.traversability("delivery_robot")
    grid = car.grid()
    assert grid.cost.shape == grid.state.shape == grid.ground_z_m.shape
    free = np.argwhere(grid.state == stillmap.CELL_STATES.index("free"))
    assert len(free) > 50
    start = car.nearest(0.0, 0.0)
    row = int((start.position_map[1] - grid.origin_map[1]) / grid.resolution_m)
    column = int((start.position_map[0] - grid.origin_map[0]) / grid.resolution_m)
    assert grid.state[row, column] == stillmap.CELL_STATES.index("free")
    plan = car.plan(start.position_map[:2], start.position_map[:2])
    assert plan.status == "found"
    with pytest.raises(LookupError):
        car.grid(stillmap.Box([9000, 9000, -1], [9001, 9001, 1]))


def test_faults_are_exceptions_with_the_command_lines_text(map, map_file, tmp_path):
    with pytest.raises(stillmap.MapFileError, match="nothing.stillmap: is not there"):
        stillmap.open_map("nothing.stillmap")
    other = tmp_path / "a.stillmap"
    other.write_bytes(b"no map" * 1000)
    with pytest.raises(stillmap.MapFileError, match="a.stillmap"):
        stillmap.open_map(other)
    with pytest.raises(stillmap.Error):
        map.traversability("balloon")
    with pytest.raises(ValueError, match="radius"):
        map.query(stillmap.Sphere([0, 0, 0], -1.0))
    with pytest.raises(ValueError, match="no class 'sea'"):
        map.query(stillmap.Box(), classes=["sea"])
    with pytest.raises(ValueError, match=r"\(n, 2\)"):
        stillmap.Polygon(np.zeros((4, 3)))


def test_a_damaged_file_never_ends_in_anything_but_an_error(map_file, tmp_path):
    sound = map_file.read_bytes()
    noise = np.random.default_rng(4)
    for _ in range(30):
        damaged = bytearray(sound)
        for place in noise.integers(0, len(sound), 200):
            damaged[place] = noise.integers(256)
        file = tmp_path / "damaged.stillmap"
        file.write_bytes(damaged)
        try:
            stillmap.open_map(file).voxels()
        except stillmap.Error:
            pass
