"""Writes what ROS 2's generators would make of our ROS package and of ROS 2's own messages: one IDL
file with the names that ROS 2 uses on the wire, for another vendor's IDL compiler. Requests and
replies begin with the header that rmw_cyclonedds puts there.

    write_peer_idl.py PACKAGE_FOLDER DEFINITIONS OUT_FILE
"""

import re
import sys
from pathlib import Path

from interfaces import IDL_OF_ROS, Structure, read_definitions, read_package

# What IDL keeps for itself.
KEYWORDS = {"map"}


def base_type(field_type: str) -> str:
    return field_type.split("[")[0]


def idl_type(type_name: str) -> str:
    if type_name.startswith("string<="):
        return f"string<{type_name[8:]}>"
    if type_name in IDL_OF_ROS:
        return IDL_OF_ROS[type_name]
    package, name = type_name.split("/")
    return f"{package}::msg::dds_::{name}_"


def idl_member(field_type: str, name: str) -> str:
    escaped = f"_{name}" if name in KEYWORDS else name
    element = idl_type(base_type(field_type))
    array = re.search(r"\[(.*)\]", field_type)
    if not array:
        return f"{element} {escaped};"
    if array[1]:
        return f"{element} {escaped}[{array[1]}];"
    return f"sequence<{element}> {escaped};"


def idl_structure(made: Structure) -> str:
    members = ["unsigned long long rmw_client;", "long long rmw_sequence;"] * (made.kind == "srv")
    members += ["@key " * field.is_key + idl_member(field.type, field.name)
                for field in made.fields]
    body = "\n".join(f"  {member}" for member in members)
    return (f"module {made.package} {{ module {made.kind} {{ module dds_ {{\n"
            f"@topic struct {made.name}_ {{\n{body}\n}};\n}}; }}; }};\n")


def in_order_of_use(structures: list[Structure]) -> list[Structure]:
    """A type stands before those that have it as a member."""
    known = {f"{made.package}/{made.name}": made for made in structures if made.kind == "msg"}
    ordered: list[Structure] = []

    def add(made: Structure):
        if any(made is other for other in ordered):
            return
        for field in made.fields:
            if member := known.get(base_type(field.type)):
                add(member)
        ordered.append(made)

    for made in structures:
        add(made)
    return ordered


def main():
    package, definitions, out = map(Path, sys.argv[1:])
    structures = read_definitions(definitions.read_text()) + read_package(package)
    out.write_text("\n".join(map(idl_structure, in_order_of_use(structures))))


if __name__ == "__main__":
    main()
