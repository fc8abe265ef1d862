"""The mapper on arrays, against `stillmap map` of the same scans."""

import threading
import time

import numpy as np
import pytest
import stillmap


def read_poses(file):
    rows = np.loadtxt(file).reshape(-1, 3, 4)
    last = np.broadcast_to([0.0, 0, 0, 1], (len(rows), 1, 4))
    return np.concatenate([rows, last], axis=1)


@pytest.fixture(scope="module")
def run(city):
    dataset = stillmap.open_dataset(city)
    mapper = stillmap.Mapper(dataset.sensor, labels="scan")
    # Arrays of one's own, as another program would have them.
    mapped = [
        mapper.process(stillmap.Scan(scan.points_lidar.copy(), scan.stamp_ns, scan.intensity,
                                     scan.time_offset_s, scan.ring, scan.labels))
        for scan in dataset
    ]
    return mapper, mapped


def test_poses_are_those_of_the_command_line(city, tmp_path):
    from conftest import run as stillmap_program
    bare = tmp_path / "bare"
    bare.mkdir()
    for name in ("velodyne", "labels", "times.txt", "time_offsets", "rings", "calib.txt"):
        if (city / name).exists():
            (bare / name).symlink_to(city / name)
    stillmap_program("map", bare, "--labels", "files", "--loops", "off", "--out", tmp_path / "out", "--json")
    dataset = stillmap.open_dataset(bare)
    mapper = stillmap.Mapper(dataset.sensor, labels="scan")
    for scan in dataset:
        assert mapper.process(scan) is not None
    expected = read_poses(tmp_path / "out" / "poses_lidar.txt")
    np.testing.assert_allclose(mapper.trajectory.T_map_body, expected, atol=1e-6)


def test_every_point_is_told_of(run):
    mapper, mapped = run
    for scan in mapped[1:]:
        assert scan.health in ("good", "degenerate")
        assert len(scan.points_lidar) == len(scan.label) == len(scan.motion) == len(scan)
        assert scan.covariance.shape == (6, 6)
        assert np.all(np.linalg.eigvalsh(scan.covariance) > -1e-12)
    assert len(mapper.trajectory) == len(mapped)
    assert mapper.label_source == "stream"


def test_the_map_is_saved_and_read_again(run, tmp_path):
    mapper, _ = run
    map = mapper.map()
    mapper.save(tmp_path / "made.stillmap")
    again = stillmap.open_map(tmp_path / "made.stillmap")
    assert len(again) == len(map) > 1000
    np.testing.assert_array_equal(again.voxels().position_map, map.voxels().position_map)
    # Rotations are stored as quaternions.
    np.testing.assert_allclose(again.trajectory.T_map_body, mapper.trajectory.T_map_body, atol=1e-12)
    assert len(again.removed().label) == len(map.removed().label)
    with pytest.raises(stillmap.MapFileError, match="already"):
        mapper.save(tmp_path / "made.stillmap")


def test_scans_that_cannot_be_mapped_are_none_with_a_reason(city):
    dataset = stillmap.open_dataset(city)
    mapper = stillmap.Mapper(dataset.sensor)
    assert mapper.process(stillmap.Scan(np.zeros((0, 3)))) is None
    assert mapper.last_rejection
    assert mapper.process(dataset[0]) is not None


def test_wrong_settings_are_refused(city):
    sensor = stillmap.open_dataset(city).sensor
    with pytest.raises(stillmap.Error):
        stillmap.load_sensor("sonar")
    with pytest.raises(stillmap.Error):
        stillmap.Mapper(sensor, labels="/nowhere/model")
    mapper = stillmap.Mapper(sensor)
    with pytest.raises(ValueError, match="rotation"):
        mapper.process(stillmap.Scan(np.zeros((0, 3))), np.diag([2.0, 2, 2, 1]))


def test_a_file_whose_mount_no_mapper_can_know_is_refused(tmp_path):
    sensor = stillmap.load_sensor("vlp_16")
    file = tmp_path / "server.yaml"
    file.write_text("frames: {base: base_link}\nmount: {source: tf_static}\n")
    with pytest.raises(ValueError, match="server.yaml takes .* from /tf_static.*xyz_m"):
        stillmap.Mapper(sensor, config=file, labels="none")
    lidar = "{{name: {0}, topic: {0}/points, sensor: vlp_16, xyz_m: [{1}, 0, 1], rpy_deg: [0, 0, 0]}}"
    both = ", ".join([lidar.format("front", 1), lidar.format("rear", -1)])
    file.write_text(f"frames: {{base: base_link}}\nsensors: [{both}]\n")
    with pytest.raises(ValueError, match="server.yaml lists several lidars"):
        stillmap.Mapper(sensor, config=file, labels="none")


def test_other_threads_run_meanwhile(city):
    dataset = stillmap.open_dataset(city)
    mapper = stillmap.Mapper(dataset.sensor)
    is_processing, end = threading.Event(), threading.Event()
    ticks = 0

    def tick():
        nonlocal ticks
        while not end.is_set():
            time.sleep(0.0002)
            ticks += is_processing.is_set()

    ticking = threading.Thread(target=tick)
    ticking.start()
    for scan in dataset:
        is_processing.set()
        mapper.process(scan)
        is_processing.clear()
    end.set()
    ticking.join()
    # A lock that is held lets this thread in between calls alone.
    assert ticks > 3 * len(dataset)


def test_a_prior_that_jumps_or_stands_still_is_not_followed(city):
    dataset = stillmap.open_dataset(city)
    plain = stillmap.Mapper(dataset.sensor, labels="scan")
    expected = [plain.process(scan).T_map_lidar for scan in dataset]

    def poses(prior_of):
        mapper = stillmap.Mapper(dataset.sensor, labels="scan")
        found = []
        for k, scan in enumerate(dataset):
            prior = prior_of(k, found) if found else None
            mapped = mapper.process(scan, prior)
            assert mapped.health != "lost", k
            found.append(mapped.T_map_lidar)
        return found

    def jumps_once(k, found):
        if k != 6:
            return None
        return found[-1] @ np.block([[np.eye(3), np.array([[30.0], [20.0], [0.0]])],
                                     [np.zeros((1, 3)), np.ones((1, 1))]])

    np.testing.assert_array_equal(poses(jumps_once), expected)
    # A dead encoder: believed at first, and found out.
    np.testing.assert_allclose(poses(lambda k, found: found[-1]), expected, atol=0.05)


def test_a_prior_must_be_finite():
    prior = np.eye(4)
    prior[0, 3] = np.nan
    with pytest.raises(ValueError, match="T_map_lidar_prior is not finite"):
        stillmap.Mapper(stillmap.load_sensor("vlp_16")).process(stillmap.Scan(np.zeros((0, 3))), prior)


def test_labels_that_were_checked_stay_as_they_are():
    scan = stillmap.Scan(np.zeros((2, 3)), labels=np.array([1, 9], np.uint8))
    with pytest.raises(ValueError, match="read-only"):
        scan.labels[:] = 40


def test_threads_share_a_mapper(city):
    dataset = stillmap.open_dataset(city)
    mapper = stillmap.Mapper(dataset.sensor)
    end = threading.Event()

    def look():
        while not end.is_set():
            assert len(mapper.trajectory) <= len(dataset)
            mapper.add_imu(0, [0, 0, 0], [0, 0, 9.8])

    looking = threading.Thread(target=look)
    looking.start()
    for scan in dataset:
        mapper.process(scan)
    end.set()
    looking.join()
    assert len(mapper.trajectory) == len(dataset)


def test_a_reset_begins_a_map_in_which_the_lidar_goes_on(city):
    dataset = stillmap.open_dataset(city)
    mapper = stillmap.Mapper(dataset.sensor)
    before = [mapper.process(scan).T_map_lidar for scan in dataset]
    half = len(dataset) // 2
    mapper = stillmap.Mapper(dataset.sensor)
    for scan in list(dataset)[:half]:
        mapper.process(scan)
    mapper.reset()
    assert len(mapper.map()) == 0
    after = [mapper.process(scan).T_map_lidar for scan in list(dataset)[half:]]
    np.testing.assert_array_equal(after[0], np.eye(4))
    moved = np.linalg.inv(before[half]) @ before[-1]
    np.testing.assert_allclose(after[-1], moved, atol=0.1)
