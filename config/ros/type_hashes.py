"""Type hashes of ROS 2 (REP 2016, "RIHS01_"): SHA-256 of a type's description as canonical JSON,
with all types that it uses; as rosidl_generator_type_description makes them."""

import copy
import hashlib
import json
import re
from dataclasses import replace

from interfaces import Field, Structure

# type_description_interfaces/msg/FieldType.
NESTED, BOUNDED_STRING = 1, 21
TYPE_IDS = {
    "int8": 2, "uint8": 3, "int16": 4, "uint16": 5, "int32": 6, "uint32": 7, "int64": 8, "uint64": 9,
    "float32": 10, "float64": 11, "char": 3, "bool": 15, "byte": 16, "string": 17}
ARRAY, BOUNDED_SEQUENCE, SEQUENCE = 48, 96, 144

# IDL's octets are bytes on the wire; these are called otherwise in ROS 2.
SIGNED_DATA = {"nav_msgs/msg/OccupancyGrid", "octomap_msgs/msg/Octomap"}

TIME = Structure("builtin_interfaces", "msg", "Time",
                 fields=[Field("int32", "sec"), Field("uint32", "nanosec")])
SERVICE_EVENT_INFO = Structure("service_msgs", "msg", "ServiceEventInfo", fields=[
    Field("uint8", "event_type"), Field("builtin_interfaces/Time", "stamp"),
    Field("char[16]", "client_gid"), Field("int64", "sequence_number")])

_FIELD_TYPE = re.compile(r"^(?P<base>[\w/]+)(?:<=(?P<length>\d+))?(?P<array>\[(?P<bound>[<=\d]*)\])?$")


def _field_type(written: str) -> dict:
    found = _FIELD_TYPE.match(written)
    base, length, bound = found["base"], found["length"], found["bound"] or ""
    nested = ""
    if "/" in base:
        package, *kind, name = base.split("/")
        nested = "/".join([package, *(kind or ["msg"]), name])
    type_id = NESTED if nested else BOUNDED_STRING if length else TYPE_IDS[base]
    if found["array"]:
        type_id += SEQUENCE if not bound else BOUNDED_SEQUENCE if "<=" in bound else ARRAY
    return {"type_id": type_id, "capacity": int(bound.removeprefix("<=") or 0),
            "string_capacity": int(length or 0), "nested_type_name": nested}


def _description(structure: Structure) -> dict:
    return {"type_name": structure.full_name,
            "fields": [{"name": field.name, "type": _field_type(field.type)}
                       for field in structure.fields]}


def _hash(name: str, descriptions: dict[str, dict]) -> str:
    used: set[str] = set()
    waiting = [name]
    while waiting:
        for field in descriptions[waiting.pop()]["fields"]:
            nested = field["type"]["nested_type_name"]
            if nested and nested not in used:
                used.add(nested)
                waiting.append(nested)
    whole = {"type_description": descriptions[name],
             "referenced_type_descriptions": [descriptions[other] for other in sorted(used)]}
    return "RIHS01_" + hashlib.sha256(json.dumps(whole).encode()).hexdigest()


def _services(structures: list[Structure]) -> list[Structure]:
    """Each service itself, and its event, as rosidl adds them to the two halves."""
    made = []
    for request in structures:
        if request.kind != "srv" or not request.name.endswith("_Request"):
            continue
        name = request.name.removesuffix("_Request")
        half = f"{request.package}/srv/{name}_"
        made += [
            Structure(request.package, "srv", name, fields=[
                Field(f"{half}Request", "request_message"),
                Field(f"{half}Response", "response_message"), Field(f"{half}Event", "event_message")]),
            Structure(request.package, "srv", f"{name}_Event", fields=[
                Field("service_msgs/ServiceEventInfo", "info"),
                Field(f"{half}Request[<=1]", "request"), Field(f"{half}Response[<=1]", "response")])]
    return made


def as_ros(structures: list[Structure]) -> list[Structure]:
    """What our IDL mirrors, under ROS 2's own names of types and packages, from Iron on."""
    made = []
    for structure in structures:
        if structure.package == "rmw_dds_common":
            continue
        fields = copy.deepcopy(structure.fields)
        for field in fields:
            field.type = field.type.replace("rmw_dds_common_iron/", "rmw_dds_common/")
            if structure.full_name in SIGNED_DATA and field.name == "data":
                field.type = "int8[]"
            if structure.full_name == "sensor_msgs/msg/NavSatStatus" and field.name == "status":
                field.type = "int8"
        package = structure.package.removesuffix("_iron")
        made.append(replace(structure, package=package, fields=fields))
    return made


def type_hashes(structures: list[Structure]) -> dict[str, str]:
    """By full name: of all messages, of both halves of services, their events and themselves."""
    every = [*structures, *_services(structures), SERVICE_EVENT_INFO, TIME]
    descriptions = {structure.full_name: _description(structure) for structure in every}
    return {name: _hash(name, descriptions) for name in descriptions}


def hash_table(structures: list[Structure]) -> str:
    """Of what endpoints carry, by its name on the wire, as entries of a C++ array."""
    known = as_ros(structures)
    hashes = type_hashes(known)
    entries = sorted((made.dds_name, hashes[made.full_name]) for made in known)
    return ("// Written by `make ros-messages` from idl/msg.\n" +
            "".join(f'{{"{name}",\n "{value}"}},\n' for name, value in entries))
