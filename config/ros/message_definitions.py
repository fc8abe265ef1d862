"""Message definitions as rosbag2, MCAP and Foxglove carry them ("ros2msg"): the text of a .msg file,
types of other messages with their packages."""

from interfaces import Structure
from type_hashes import as_ros


def numbered(type_name: str, prefix: str, names: list[str], values: list[int]) -> list[str]:
    return [f"{type_name} {prefix}{name}={value}" for name, value in zip(names, values)]


# What ROS 2's own files have beyond the types on the wire: constants before a field, and defaults.
# Viewers that know these messages compare the whole definition with theirs.
CONSTANTS_BEFORE = {
    ("sensor_msgs/msg/NavSatStatus", "status"): numbered(
        "int8", "STATUS_", ["NO_FIX", "FIX", "SBAS_FIX", "GBAS_FIX"], [-1, 0, 1, 2]),
    ("sensor_msgs/msg/NavSatStatus", "service"): numbered(
        "uint16", "SERVICE_", ["GPS", "GLONASS", "COMPASS", "GALILEO"], [1, 2, 4, 8]),
    ("sensor_msgs/msg/NavSatFix", "position_covariance_type"): numbered(
        "uint8", "COVARIANCE_TYPE_", ["UNKNOWN", "APPROXIMATED", "DIAGONAL_KNOWN", "KNOWN"],
        [0, 1, 2, 3]),
}
DEFAULTS = {("geometry_msgs/msg/Quaternion", name): value
            for name, value in {"x": 0, "y": 0, "z": 0, "w": 1}.items()}


def definition_lines(structure: Structure) -> list[str]:
    """Comment, constants and fields, as in a .msg file."""
    lines = [f"# {line}" for line in structure.comment]
    before = {field.name: CONSTANTS_BEFORE.get((structure.full_name, field.name), [])
              for field in structure.fields}
    constants = [f"{constant.type} {constant.name}={constant.value}"
                 for constant in structure.constants]
    lines += [constant for constant in constants if constant not in sum(before.values(), [])]
    for field in structure.fields:
        place = (structure.full_name, field.name)
        lines += before[field.name]
        default = f" {DEFAULTS[place]}" if place in DEFAULTS else ""
        lines.append(f"{field.type} {field.name}{default}")
    return lines


def definition_table(structures: list[Structure]) -> str:
    """Of all messages and both halves of services, by ROS 2's names, as entries of a C++ array."""
    texts = sorted((made.full_name, "\n".join(definition_lines(made))) for made in as_ros(structures))
    return ("// Written by `make ros-messages` from idl/msg.\n" +
            "".join(f'{{"{name}", R"msg({text}\n)msg"}},\n' for name, text in texts))
