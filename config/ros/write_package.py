#!/usr/bin/env python3
"""Writes stillmap_msgs/msg and stillmap_msgs/srv, which lie beside it, from our IDL.

    config/ros/write_package.py idl/msg
"""

import sys
from pathlib import Path

from interfaces import Structure, read_idl

PACKAGE = "stillmap_msgs"


def lines_of(structure: Structure) -> list[str]:
    lines = [f"# {line}" for line in structure.comment]
    lines += [f"{constant.type} {constant.name}={constant.value}"
              for constant in structure.constants]
    for field in structure.fields:
        type_name = field.type.removeprefix(f"{PACKAGE}/")
        lines.append(f"{type_name} {field.name}" + ("  # key" if field.is_key else ""))
    return lines


def main():
    folder = Path(__file__).parent / PACKAGE
    structures = read_idl(sorted(Path(sys.argv[1]).glob("*.idl")))
    texts: dict[Path, list[str]] = {}
    for made in structures:
        if made.package != PACKAGE:
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
    print(f"{len(texts)} files in {folder}")


if __name__ == "__main__":
    main()
