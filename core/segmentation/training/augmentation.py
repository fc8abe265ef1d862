"""What is done to a training scan so that a network does not learn one sensor or one city."""

import numpy as np


def _move(points, settings, random):
    """Turns about the vertical, mirrors, tilts, stretches and lifts the scan."""
    if settings["rotate"]:
        angle = random.uniform(-np.pi, np.pi)
        c, s = np.cos(angle), np.sin(angle)
        points = points @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]], np.float32)
    if settings["flip"] and random.random() < 0.5:
        points = points * np.array([1, -1, 1], np.float32)
    if settings["tilt_deg"]:
        roll, pitch = np.radians(random.normal(0, settings["tilt_deg"], 2))
        points = points @ np.array([[1, 0, -pitch], [0, 1, -roll], [pitch, roll, 1]], np.float32)
    points = points * np.float32(random.uniform(1 - settings["scale"], 1 + settings["scale"]))
    return points + np.array([0, 0, random.normal(0, settings["lift_m"])], np.float32)


def _change_remission(remission, settings, random):
    """Another gain, offset and contrast, noise; or no remission at all."""
    if random.random() < settings["remission_dropout"]:
        return None
    jitter = settings["remission_jitter"]
    gain, power = np.exp(random.normal(0, jitter, 2))
    noise = random.normal(0, 0.1 * jitter, remission.size).astype(np.float32)
    changed = gain * np.clip(remission, 0, 1) ** power + random.normal(0, 0.1 * jitter) + noise
    return np.clip(changed, 0, 1).astype(np.float32)


def augment_points(points, remission, classes, settings, random):
    """A scan as another sensor might have seen it. Remission becomes None when it is left out."""
    keep = random.random(len(points)) >= random.uniform(0, settings["drop_points"])
    far = random.uniform(settings["max_range_m"], 120)
    keep &= (points**2).sum(axis=1) < far**2
    points, remission, classes = points[keep], remission[keep], classes[keep]
    points = _move(points, settings, random)
    noise = random.normal(0, random.uniform(0, settings["range_noise_m"]), len(points))
    depth = np.sqrt((points**2).sum(axis=1))
    points = points * (1 + noise / depth).astype(np.float32)[:, None]
    return points, _change_remission(remission, settings, random), classes


def drop_beams(image, settings, random):
    """Rows of the image whose beams are lost: single ones, or every other one."""
    lost = random.random(len(image.point)) < random.uniform(0, settings["drop_beams"])
    if random.random() < settings["halve_beams"]:
        lost[random.integers(2) :: 2] = True
    image.point[lost] = -1
    image.channels[:, lost] = 0


def crop(channels, target, columns, random):
    """A part of the image, `columns` wide, that may run over its seam."""
    start = random.integers(channels.shape[2])
    chosen = np.arange(start, start + columns) % channels.shape[2]
    return channels[:, :, chosen], target[:, chosen]
