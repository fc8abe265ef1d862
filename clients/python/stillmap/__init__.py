"""Stillmap from Python: map files and recordings as NumPy arrays, the mapper scan by scan, a running
server over DDS, and the figures by which trajectories and maps are judged.

Names say frames and units: position_map is in the map frame, points_lidar in the lidar's, both in metres;
T_a_b takes points of b to a; stamps are nanoseconds. Labels are indexes of CLASS_NAMES.

    import stillmap
    map = stillmap.open_map("city.stillmap")
    voxels = map.voxels()
    voxels.position_map[voxels.label == stillmap.CLASS_NAMES.index("road")]
"""

try:
    import numpy as _numpy  # noqa: F401
except ImportError as error:
    raise ImportError(f"stillmap needs numpy (Debian's python3-numpy): {error}") from None

from ._stillmap import *  # noqa: F401,F403
from ._stillmap import __version__  # noqa: F401


def _describe_by(type_name, describe):
    """What the interpreter shows of an object: its type, and what tells it from others."""
    globals()[type_name].__repr__ = lambda thing: f"<stillmap.{type_name}: {describe(thing)}>"


_describe_by("Map", lambda map: f"{len(map)} voxels of {map.voxel_size_m:g} m in {len(map.tiles)} tiles, "
                                f"version {map.version}")
_describe_by("Voxels", lambda voxels: f"{len(voxels)} voxels")
_describe_by("QueryAnswer", lambda answer: f"{len(answer)} voxels, map version {answer.map_version}")
_describe_by("Tile", lambda tile: f"{tile.id}, {len(tile)} voxels, revision {tile.revision}")
_describe_by("Trajectory", lambda trajectory: f"{len(trajectory)} poses")
_describe_by("Dataset", lambda dataset: f"{len(dataset)} scans of {dataset.sensor.name}")
_describe_by("Sensor", lambda sensor: f"{sensor.name}, {sensor.rings} rings, {sensor.period_s:g} s a turn")
_describe_by("Scan", lambda scan: f"{len(scan)} points, stamp_ns={scan.stamp_ns}")
_describe_by("MappedScan", lambda scan: f"{len(scan)} points, odometry {scan.health}, stamp_ns={scan.stamp_ns}")
_describe_by("Mapper", lambda mapper: f"{len(mapper.trajectory)} poses, labels: {mapper.label_source}")
