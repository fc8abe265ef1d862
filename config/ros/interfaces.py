"""Message and service types as ROS 2 sees them, read from IDL or from .msg text."""

import re
from dataclasses import dataclass, field
from pathlib import Path

# IDL's names of ROS 2's basic types. An octet is a uint8 in .msg: rosidl makes it an octet again.
ROS_OF_IDL = {
    "boolean": "bool", "octet": "uint8", "short": "int16", "unsigned short": "uint16",
    "long": "int32", "unsigned long": "uint32", "long long": "int64",
    "unsigned long long": "uint64", "float": "float32", "double": "float64", "string": "string"}
# As rosidl writes IDL.
ROS_OF_ROSIDL = {"uint8": "uint8", "int16": "int16", "uint16": "uint16", "int32": "int32",
                 "uint32": "uint32", "int64": "int64", "uint64": "uint64"}
IDL_OF_ROS = {ros: idl for idl, ros in ROS_OF_IDL.items()} | {
    "byte": "octet", "char": "octet", "int8": "octet"}


@dataclass
class Field:
    """`type` is written as in .msg, another message's with its package: uint8[], a_msgs/Header."""
    type: str
    name: str
    is_key: bool = False


@dataclass
class Constant:
    """As in .msg: uint8 BOX=0."""
    type: str
    name: str
    value: int


@dataclass
class Structure:
    """A message, or one half of a service: Reset_Request."""
    package: str
    kind: str  # msg or srv
    name: str
    comment: list[str] = field(default_factory=list)
    fields: list[Field] = field(default_factory=list)
    constants: list[Constant] = field(default_factory=list)

    @property
    def full_name(self) -> str:
        return f"{self.package}/{self.kind}/{self.name}"

    @property
    def dds_name(self) -> str:
        return f"{self.package}::{self.kind}::dds_::{self.name}_"


# What follows a structure's name in the name of the module that has its constants.
CONSTANTS = "_Constants"

# Brackets and semicolons are words of their own; a comment is one word.
_IDL_WORD = re.compile(r"//[^\n]*|#include[^\n]*|@?\w+(?:::\w+)*|[{};<>\[\],=]")


class IdlReader:
    """Reads the part of IDL that idl/msg uses. Throws ValueError naming what it does not know."""

    def __init__(self, text: str) -> None:
        self._words = _IDL_WORD.findall(text)
        self._at = 0
        self._modules: list[str] = []
        self._comment: list[str] = []
        self._constants: dict[str, list[Constant]] = {}
        self.structures: list[Structure] = []

    def read(self) -> list[Structure]:
        while self._at < len(self._words):
            self._declaration(self._next())
        if self._constants:
            raise ValueError(f"constants without a structure: {', '.join(self._constants)}")
        return self.structures

    def _next(self) -> str:
        word = self._words[self._at]
        self._at += 1
        return word

    def _expect(self, wanted: str) -> None:
        word = self._next()
        if word != wanted:
            raise ValueError(f"'{word}' stands where '{wanted}' is expected")

    def _declaration(self, word: str) -> None:
        if word.startswith("//"):
            self._comment.append(word[2:].strip())
            return
        if word == "struct":
            self.structures.append(self._structure())
        elif word == "module":
            self._modules.append(self._next())
            self._expect("{")
            # The comment above a structure's constants is the structure's own.
            if self._modules[-1].endswith(CONSTANTS):
                constants = self._read_constants()
                self._constants[self._modules.pop()] = constants
                return
        elif word == "}":
            self._modules.pop()
        elif word != ";" and not word.startswith("#include"):
            raise ValueError(f"'{word}' is not known")
        self._comment = []

    def _read_constants(self) -> list[Constant]:
        """As rosidl writes them: module Region_Constants { const octet BOX = 0; };"""
        constants = []
        while (word := self._next()) != "}":
            if word != "const":
                raise ValueError(f"'{word}' stands where 'const' is expected")
            idl_type, name = self._next(), self._next()
            self._expect("=")
            constants.append(Constant(ROS_OF_IDL[idl_type], name, int(self._next())))
            self._expect(";")
        self._expect(";")
        return constants

    def _structure(self) -> Structure:
        package, kind = self._modules
        name = self._next()
        made = Structure(package, kind, name, self._comment,
                         constants=self._constants.pop(name + CONSTANTS, []))
        self._expect("{")
        while (word := self._next()) != "}":
            made.fields.append(self._field(word))
        return made

    def _field(self, word: str) -> Field:
        is_key = word == "@key"
        words = [] if is_key else [word]
        while (word := self._next()) != ";":
            words.append(word)
        bound = ""
        if words[-1] == "]":
            bound = f"[{words[-2]}]"
            words = words[:-3]
        # An underscore before a name only keeps it from being a keyword of IDL.
        name = words.pop().removeprefix("_")
        return Field(_ros_type(words) + bound, name, is_key)


def _ros_type(words: list[str]) -> str:
    if words[0] == "sequence":
        return _ros_type(words[2:-1]) + "[]"
    if words[0] == "string" and len(words) > 1:
        return f"string<={words[2]}"
    name = " ".join(words)
    if "::" in name:
        package, _, message = name.split("::")
        return f"{package}/{message}"
    known = ROS_OF_IDL | ROS_OF_ROSIDL
    if name not in known:
        raise ValueError(f"type '{name}' has no counterpart in .msg")
    return known[name]


# A type, how many of it, a name, a default.
_ROS_FIELD = re.compile(
    r"^(?P<type>[\w/]+(?:<=\d+)?)(?P<array>\[[^\]]*\])?\s+(?P<name>\w+)(?:\s+\S+)?$")


_ROS_CONSTANT = re.compile(r"^(?P<type>\w+)\s+(?P<name>[A-Z][A-Z0-9_]*)\s*=\s*(?P<value>-?\d+)$")


def _is_basic(type_name: str) -> bool:
    return type_name.split("<=")[0] in IDL_OF_ROS


def _ros_field(package: str, line: str) -> Field | None:
    declaration, _, comment = line.partition("#")
    declaration = declaration.strip()
    if not declaration or "=" in declaration.replace("<=", ""):
        return None
    found = _ROS_FIELD.match(declaration)
    if not found:
        raise ValueError(f"'{declaration}' is no field")
    type_name = found["type"]
    if not _is_basic(type_name) and "/" not in type_name:
        type_name = f"{package}/{type_name}"
    return Field(type_name + (found["array"] or ""), found["name"], comment.strip() == "key")


def _ros_constant(line: str) -> Constant | None:
    found = _ROS_CONSTANT.match(line.partition("#")[0].strip())
    return Constant(found["type"], found["name"], int(found["value"])) if found else None


def read_message(package: str, kind: str, name: str, text: str) -> Structure:
    """Of the text of a .msg file, or of half of a .srv file."""
    fields = [_ros_field(package, line) for line in text.splitlines()]
    constants = [_ros_constant(line) for line in text.splitlines()]
    made = Structure(package, kind, name, fields=[f for f in fields if f],
                     constants=[c for c in constants if c])
    if not made.fields:
        made.fields = [Field("uint8", "structure_needs_at_least_one_member")]
    return made


def read_service(package: str, name: str, text: str) -> list[Structure]:
    request, reply = re.split(r"^---$", text, flags=re.MULTILINE)
    return [read_message(package, "srv", f"{name}_Request", request),
            read_message(package, "srv", f"{name}_Response", reply)]


def read_package(folder: Path) -> list[Structure]:
    """All messages and services of a ROS 2 package."""
    messages = [read_message(folder.name, "msg", file.stem, file.read_text())
                for file in sorted(folder.glob("msg/*.msg"))]
    services = [read_service(folder.name, file.stem, file.read_text())
                for file in sorted(folder.glob("srv/*.srv"))]
    keyed = read_idl(sorted(folder.glob("msg/*.idl")))
    return messages + keyed + [half for service in services for half in service]


def read_definitions(text: str) -> list[Structure]:
    """Of many definitions in one text, each under a line as 'MSG: std_msgs/Header' or SRV."""
    made: list[Structure] = []
    for block in re.split(r"^=+\n", text, flags=re.MULTILINE):
        found = re.match(r"(MSG|SRV): (\w+)/(\w+)\n", block)
        if not found:
            continue
        kind, package, name = found.groups()
        body = block[found.end():]
        made += ([read_message(package, "msg", name, body)] if kind == "MSG"
                 else read_service(package, name, body))
    return made


def read_idl(files: list[Path]) -> list[Structure]:
    return [made for file in files for made in IdlReader(file.read_text()).read()]
