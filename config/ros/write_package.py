#!/usr/bin/env python3
"""Writes stillmap_msgs/msg and stillmap_msgs/srv, which lie beside it, and the tables of type hashes
and of message definitions, from our IDL.

    config/ros/write_package.py idl/msg idl/dds/type_hash_table.inc idl/dds/message_definition_table.inc
"""

import sys
from pathlib import Path

from interfaces import Structure, read_idl
from message_definitions import definition_lines, definition_table
from type_hashes import hash_table

PACKAGE = "stillmap_msgs"


def lines_of(structure: Structure) -> list[str]:
    return [line.removeprefix(f"{PACKAGE}/") for line in definition_lines(structure)]


def rosidl_type(ros_type: str) -> str:
    if ros_type.endswith("[]"):
        return f"sequence<{rosidl_type(ros_type[:-2])}>"
    if "/" in ros_type:
        package, name = ros_type.split("/")
        return f"{package}::msg::{name}"
    return {"float32": "float", "float64": "double", "bool": "boolean"}.get(ros_type, ros_type)


def keyed_message(structure: Structure) -> str:
    """IDL as rosidl reads it: a .msg cannot say which fields are keys."""
    used = sorted({field.type.removesuffix("[]") for field in structure.fields if "/" in field.type})
    includes = [f'#include "{name.replace("/", "/msg/")}.idl"' for name in used]
    comment = [f"    // {line}" for line in structure.comment]
    members = [f"      {'@key ' * field.is_key}{rosidl_type(field.type)} {field.name};"
               for field in structure.fields]
    return "\n".join([*includes, f"module {structure.package} {{", "  module msg {", *comment,
                      f"    struct {structure.name} {{", *members, "    };", "  };", "};"]) + "\n"


def main() -> None:
    folder = Path(__file__).parent / PACKAGE
    structures = read_idl(sorted(Path(sys.argv[1]).glob("*.idl")))
    texts: dict[Path, list[str]] = {}
    for made in structures:
        if made.package != PACKAGE:
            continue
        if any(field.is_key for field in made.fields):
            (folder / "msg" / f"{made.name}.msg").unlink(missing_ok=True)
            texts[folder / "msg" / f"{made.name}.idl"] = keyed_message(made).splitlines()
            continue
        if made.kind == "msg":
            texts[folder / "msg" / f"{made.name}.msg"] = lines_of(made)
            continue
        name, half = made.name.rsplit("_", 1)
        file = folder / "srv" / f"{name}.srv"
        if half == "Request":
            texts[file] = lines_of(made) + ["---"]
        else:
            texts[file] += lines_of(made)
    for file, lines in texts.items():
        file.parent.mkdir(exist_ok=True)
        file.write_text("\n".join(lines) + "\n")
    Path(sys.argv[2]).write_text(hash_table(structures))
    Path(sys.argv[3]).write_text(definition_table(structures))
    print(f"{len(texts)} files in {folder}, {sys.argv[2]} and {sys.argv[3]}")


if __name__ == "__main__":
    main()
