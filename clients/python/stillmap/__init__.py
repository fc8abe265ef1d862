"""Stillmap from Python: map files and recordings as NumPy arrays, the mapper scan by scan, a running
server over DDS, and the figures by which trajectories and maps are judged.

Names say frames and units: position_map is in the map frame, points_lidar in the lidar's, both in metres;
T_a_b takes points of b to a; stamps are nanoseconds. Labels are indexes of CLASS_NAMES.

    import stillmap
    map = stillmap.open_map("city.stillmap")
    voxels = map.voxels()
    voxels.position_map[voxels.label == stillmap.CLASS_NAMES.index("road")]
"""

from ._stillmap import *  # noqa: F401,F403
