"""Message definitions as rosbag2, MCAP and Foxglove carry them ("ros2msg"): the text of a .msg file,
types of other messages with their packages."""

from interfaces import Structure
from type_hashes import as_ros


def definition_lines(structure: Structure) -> list[str]:
    """Comment, constants and fields, as in a .msg file."""
    lines = [f"# {line}" for line in structure.comment]
    lines += [f"{constant.type} {constant.name}={constant.value}"
              for constant in structure.constants]
    return lines + [f"{field.type} {field.name}" for field in structure.fields]


def definition_table(structures: list[Structure]) -> str:
    """Of all messages and both halves of services, by ROS 2's names, as entries of a C++ array."""
    texts = sorted((made.full_name, "\n".join(definition_lines(made))) for made in as_ros(structures))
    return ("// Written by `make ros-messages` from idl/msg.\n" +
            "".join(f'{{"{name}", R"msg({text}\n)msg"}},\n' for name, text in texts))
