"""Recordings scan by scan."""

import os

import numpy as np
import pytest
import stillmap


def test_scans_are_the_files(city):
    dataset = stillmap.open_dataset(city)
    files = sorted((city / "velodyne").glob("*.bin"))
    assert len(dataset) == len(files)
    for scan, file in zip(dataset, files):
        values = np.fromfile(file, np.float32).reshape(-1, 4)
        np.testing.assert_array_equal(scan.points_lidar, values[:, :3])
        assert len(scan.intensity) == len(scan) and scan.intensity.max() <= 1.0
        assert scan.labels is not None and scan.raw_labels is not None
    assert dataset.sensor.name == "VLP-16"
    assert len(dataset.truth) == len(dataset)
    assert dataset.faults == []
    assert dataset.remarks == []


def test_what_was_taken_for_granted_is_told(city, tmp_path):
    for i, file in enumerate(sorted((city / "velodyne").glob("*.bin"))):
        (tmp_path / f"{i:06}.bin").symlink_to(file)
    remarks = stillmap.open_dataset(tmp_path).remarks
    assert any("tell no time" in remark for remark in remarks), remarks


def test_what_is_wrong_is_told_whatever_bytes_the_name_has(tmp_path):
    name = os.fsdecode(os.fsencode(tmp_path) + b"/no_utf8_\xff")
    with pytest.raises(stillmap.DatasetError) as error:
        stillmap.open_dataset(name)
    assert name in str(error.value) and "no such file" in str(error.value)


def test_classes_are_not_read_as_ids_without_a_word(city, tmp_path):
    (tmp_path / "labels").mkdir()
    (tmp_path / "velodyne").symlink_to(city / "velodyne")
    for file in (city / "velodyne").glob("*.bin"):
        classes = np.resize(np.array([9, 13, 15, 17, 255], np.uint32), file.stat().st_size // 16)
        classes.tofile(tmp_path / "labels" / (file.stem + ".label"))
    with pytest.raises(stillmap.DatasetError, match="look like classes.*labels_are_classes=True"):
        stillmap.open_dataset(tmp_path)
    told = stillmap.open_dataset(tmp_path, labels_are_classes=True)
    assert list(told[0].labels[:5]) == [9, 13, 15, 17, 0]
    as_ids = stillmap.open_dataset(tmp_path, labels_are_classes=False)
    assert list(as_ids[0].raw_labels[:5]) == [9, 13, 15, 17, 255]


def test_parts_of_a_turn_are_one_scan(tmp_path):
    for part in range(12):
        azimuth = np.radians(180 * part + np.arange(180, dtype=np.float32))
        wall = [
            np.stack([12 * np.cos(azimuth), 12 * np.sin(azimuth), 0 * azimuth + z, 0 * azimuth], 1)
            for z in np.linspace(-2, 2, 8)
        ]
        np.concatenate(wall).astype(np.float32).tofile(tmp_path / f"{part:06}.bin")
    dataset = stillmap.open_dataset(tmp_path)
    assert len(dataset) == 6 and len(dataset[2]) == 8 * 360
    assert any("are joined" in remark for remark in dataset.remarks)
    assert len(stillmap.open_dataset(tmp_path, clouds_per_turn=1)) == 12
    assert len(stillmap.open_dataset(tmp_path, clouds_per_turn=3)) == 4
    with pytest.raises(ValueError, match="clouds_per_turn = 201"):
        stillmap.open_dataset(tmp_path, clouds_per_turn=201)


def test_places_count_as_in_a_list(city):
    dataset = stillmap.open_dataset(city)
    np.testing.assert_array_equal(dataset[-1].points_lidar, dataset[len(dataset) - 1].points_lidar)
    assert dataset.stamps_ns[3] == dataset[3].stamp_ns
    with pytest.raises(IndexError):
        dataset[len(dataset)]
    with pytest.raises(IndexError, match=f"scan {-len(dataset) - 1} of"):
        dataset[-len(dataset) - 1]


def test_the_imu_lies_beside(city):
    stamps_ns, rates, accelerations = stillmap.open_dataset(city).imu
    assert len(stamps_ns) > 50 and rates.shape == accelerations.shape == (len(stamps_ns), 3)
    assert abs(np.median(np.linalg.norm(accelerations, axis=1)) - 9.8) < 0.5


def test_threads_may_read_one_recording(city):
    from concurrent.futures import ThreadPoolExecutor

    dataset = stillmap.open_dataset(city)
    alone = [scan.points_lidar.copy() for scan in dataset]
    with ThreadPoolExecutor(8) as pool:
        for _ in range(5):
            together = list(pool.map(lambda i: dataset[i].points_lidar.copy(), range(len(dataset))))
            for one, other in zip(alone, together):
                np.testing.assert_array_equal(one, other)


def test_points_stay_when_the_scan_is_gone(city):
    points = stillmap.open_dataset(city)[0].points_lidar
    again = stillmap.open_dataset(city)[0].points_lidar
    np.testing.assert_array_equal(points, again)


def test_scans_are_made_of_arrays():
    points = np.arange(30, dtype=float).reshape(10, 3)
    scan = stillmap.Scan(points, stamp_ns=7, ring=np.arange(10), labels=np.full(10, 9))
    np.testing.assert_array_equal(scan.points_lidar, points.astype(np.float32))
    assert scan.stamp_ns == 7 and scan.intensity is None and list(scan.ring) == list(range(10))
    with pytest.raises(ValueError, match=r"points_lidar has the shape \(10, 4\); \(n, 3\)"):
        stillmap.Scan(np.zeros((10, 4)))
    with pytest.raises(ValueError, match="intensity has the shape"):
        stillmap.Scan(points, intensity=np.zeros(9))
    with pytest.raises(ValueError, match="class 20"):
        stillmap.Scan(points, labels=np.full(10, 20))


def test_whole_numbers_are_never_bent_to_fit():
    points = np.zeros((10, 3))
    for wrong in (266, -1, 0x1000A):
        with pytest.raises(ValueError, match=f"labels has the class {wrong};"):
            stillmap.Scan(points, labels=np.full(10, wrong))
    with pytest.raises(ValueError, match="labels has the number 18446744073709551615"):
        stillmap.Scan(points, labels=np.full(10, 2**64 - 1, np.uint64))
    with pytest.raises(ValueError, match="labels has the type float64"):
        stillmap.Scan(points, labels=np.full(10, np.nan))
    for wrong in (70000, -1):
        with pytest.raises(ValueError, match=f"ring has the number {wrong}; .* 0 to 65535"):
            stillmap.Scan(points, ring=np.full(10, wrong))
    with pytest.raises(ValueError, match="ring has the type"):
        stillmap.Scan(points, ring=["a"] * 10)
    with pytest.raises(ValueError, match="stamp_ns has the type float64"):
        stillmap.Trajectory([1.7e18 + 123, np.nan], np.tile(np.eye(4), (2, 1, 1)))
    assert stillmap.Scan(points, ring=[65535] * 10).ring.max() == 65535
    assert len(stillmap.Scan(np.zeros((0, 3)), ring=[], labels=[])) == 0
    assert len(stillmap.Trajectory([2**62, 2**62 + 1], np.tile(np.eye(4), (2, 1, 1)))) == 2


def test_faults_name_the_file(tmp_path):
    with pytest.raises(stillmap.DatasetError, match="missing"):
        stillmap.open_dataset(tmp_path / "missing")
    (tmp_path / "a.mcap").write_bytes(b"this is none")
    with pytest.raises(stillmap.DatasetError, match="no MCAP file"):
        stillmap.open_dataset(tmp_path / "a.mcap")
