"""The figures, against NumPy."""

import numpy as np
import pytest
import stillmap


def walk(seed, poses=200):
    noise = np.random.default_rng(seed)
    T = np.broadcast_to(np.eye(4), (poses, 4, 4)).copy()
    heading = np.cumsum(noise.normal(0, 0.05, poses))
    T[:, 0, 0] = T[:, 1, 1] = np.cos(heading)
    T[:, 1, 0], T[:, 0, 1] = np.sin(heading), -np.sin(heading)
    T[1:, 0, 3] = np.cumsum(np.cos(heading[1:]))
    T[1:, 1, 3] = np.cumsum(np.sin(heading[1:]))
    return T


def test_absolute_error_is_that_of_numpy():
    truth, estimate = walk(1), walk(1)
    estimate[:, :3, 3] += np.random.default_rng(2).normal(0, 0.1, (200, 3))
    error = stillmap.absolute_trajectory_error(truth, estimate, alignment="none")
    distance = np.linalg.norm(truth[:, :3, 3] - estimate[:, :3, 3], axis=1)
    np.testing.assert_allclose(error["per_pose_m"], distance)
    assert error["rmse_m"] == pytest.approx(np.sqrt(np.mean(distance**2)))
    moved = np.linalg.inv(walk(7)[50]) @ truth
    rigid = stillmap.absolute_trajectory_error(truth, moved)
    assert rigid["rmse_m"] < 1e-9
    np.testing.assert_allclose(rigid["T_truth_estimate"], walk(7)[50], atol=1e-9)


def test_kitti_error_of_a_longer_path_is_its_share():
    truth, estimate = walk(1), walk(1)
    estimate[:, :3, 3] *= 1.01
    error = stillmap.kitti_odometry_error(truth, estimate)
    assert error["translation_percent"] == pytest.approx(1.0, abs=0.05)
    assert stillmap.kitti_odometry_error(truth[:50], estimate[:50]) is None
    assert stillmap.relative_pose_error(truth, truth)["max_translation_m"] < 1e-9


def test_confusion_is_counted_as_by_numpy():
    noise = np.random.default_rng(3)
    truth, predicted = noise.integers(0, 20, 5000), noise.integers(0, 20, 5000)
    matrix = stillmap.ConfusionMatrix()
    matrix.add(truth, predicted)
    counted = truth > 0
    expected = np.zeros((20, 20))
    np.add.at(expected, (truth[counted], predicted[counted]), 1)
    np.testing.assert_array_equal(matrix.counts, expected)
    hits = expected[9, 9]
    assert matrix.iou("road") == pytest.approx(
        hits / (expected[9].sum() + expected[:, 9].sum() - hits))
    assert matrix.accuracy == pytest.approx(np.mean((truth == predicted)[counted]))


def test_a_map_of_the_fixed_points_is_perfectly_clean():
    noise = np.random.default_rng(5)
    points = noise.uniform(-20, 20, (3000, 3)).astype(np.float32)
    ids = np.where(points[:, 0] > 10, 252, 50).astype(np.uint16)
    # Only moving points far from fixed ones can be told apart.
    points[ids == 252, 0] += 30
    score = stillmap.map_cleaning_score(points, ids, points[ids == 50])
    assert score["preservation_rate"] == 1.0 and score["rejection_rate"] == 1.0
    with_instances = ids.astype(np.uint32) | np.uint32(40000 << 16)
    assert stillmap.map_cleaning_score(points, with_instances, points[ids == 50]) == score
    worst = stillmap.map_cleaning_score(points, ids, points)
    assert worst["rejection_rate"] == 0.0 and worst["f1"] == 0.0


def test_wrong_shapes_are_refused():
    with pytest.raises(ValueError, match="alignment 'best'"):
        stillmap.absolute_trajectory_error(walk(1), walk(1), alignment="best")
    with pytest.raises(ValueError):
        stillmap.absolute_trajectory_error(walk(1), walk(1)[:-1])
    with pytest.raises(ValueError, match=r"\(n, 4, 4\)"):
        stillmap.absolute_trajectory_error(np.zeros((5, 3)), np.zeros((5, 3)))
    with pytest.raises(ValueError, match="class 20"):
        stillmap.ConfusionMatrix().add([20], [1])
    with pytest.raises(ValueError, match="truth has the class 257"):
        stillmap.ConfusionMatrix().add([257], [1])
    with pytest.raises(ValueError, match="predicted has the type float64"):
        stillmap.ConfusionMatrix().add([1], [1.5])
    with pytest.raises(ValueError, match="truth_ids has the number -1"):
        stillmap.map_cleaning_score(np.zeros((1, 3)), [-1], np.zeros((1, 3)))
