"""Holds config/ros/stillmap_msgs, our IDL and ROS 2's own definitions against each other.

STILLMAP_SOURCE: the repository. STILLMAP_GENERATED: what fastddsgen made of idl/msg.
"""

import os
import re
import unittest
import xml.etree.ElementTree as xml
from pathlib import Path

from interfaces import (Constant, Field, Structure, read_definitions, read_idl, read_message, read_package,
                        read_service)

try:
    import rosidl_adapter.parser as rosidl
except ImportError:
    rosidl = None

SOURCE = Path(os.environ["STILLMAP_SOURCE"])
PACKAGE = SOURCE / "config/ros/stillmap_msgs"

# rosidl's rules.
FIELD_NAME = re.compile(r"^(?!.*__)(?!.*_$)[a-z][a-z0-9_]*$")
MESSAGE_NAME = re.compile(r"^[A-Z][A-Za-z0-9]*$")

# One octet on the wire, whatever ROS 2 makes of it in memory.
OCTETS = {"int8", "byte", "char"}


def wire_type(field_type: str) -> str:
    base, bracket, rest = field_type.partition("[")
    return ("uint8" if base in OCTETS else base) + bracket + rest


def differences(ours: list[Structure], theirs: list[Structure]) -> list[str]:
    """What of `ours` is another thing in `theirs`, and what is missing there, field by field."""
    found = {made.full_name: made for made in theirs}
    faults = []
    for made in ours:
        if other := found.get(made.full_name):
            faults += field_differences(made, other)
        else:
            faults.append(f"{made.full_name} is missing")
    return faults


def field_differences(made: Structure, other: Structure) -> list[str]:
    faults = []
    if made.constants != other.constants:
        faults.append(f"{made.full_name}: {other.constants} instead of {made.constants}")
    for at in range(max(len(made.fields), len(other.fields))):
        place = f"{made.full_name}, field {at + 1}"
        if at >= len(made.fields):
            faults.append(f"{place}: {other.fields[at].name} is too much")
        elif at >= len(other.fields):
            faults.append(f"{place}: {made.fields[at].name} is missing")
        else:
            mine, its = ((wire_type(f.type), f.name, f.is_key)
                         for f in (made.fields[at], other.fields[at]))
            if mine != its:
                faults.append(f"{place}: {its} instead of {mine}")
    return faults


class ComparisonTest(unittest.TestCase):

    def assert_same(self, ours: list[Structure], theirs: list[Structure]):
        faults = differences(ours, theirs)
        if faults:
            self.fail("\n" + "\n".join(faults))


class RosPackageTest(ComparisonTest):

    @classmethod
    def setUpClass(cls):
        cls.idl = read_idl(sorted((SOURCE / "idl/msg").glob("*.idl")))
        cls.own_idl = [made for made in cls.idl if made.package == "stillmap_msgs"]
        cls.package = read_package(PACKAGE)

    def test_package_has_every_type_of_our_idl_field_by_field(self):
        self.assertGreater(len(self.own_idl), 30)
        self.assert_same(self.own_idl, self.package)

    def test_package_has_nothing_that_our_idl_has_not(self):
        self.assert_same(self.package, self.own_idl)

    def test_standard_messages_of_our_idl_are_those_of_ros(self):
        ros = read_definitions((SOURCE / "tests/ros/ros2_definitions.txt").read_text())
        mirrored = [made for made in self.idl
                    if made.package not in ("stillmap_msgs", "rmw_dds_common_iron")]
        self.assert_same(mirrored, ros)
        self.assert_same(ros, mirrored)

    def test_longer_gids_are_the_only_difference_before_iron(self):
        humble = [made for made in self.idl if made.package == "rmw_dds_common"]
        iron = [Structure("rmw_dds_common", made.kind, made.name, [], made.fields)
                for made in self.idl if made.package == "rmw_dds_common_iron"]
        for made in iron:
            for field in made.fields:
                field.type = field.type.replace("rmw_dds_common_iron/", "rmw_dds_common/")
        self.assertEqual(differences(humble, iron), [
            "rmw_dds_common/msg/Gid, field 1: ('uint8[16]', 'data', False) instead of "
            "('uint8[24]', 'data', False)"])

    def test_names_on_the_wire_are_those_that_ros_makes(self):
        generated = Path(os.environ["STILLMAP_GENERATED"])
        names = {name for file in generated.glob("*PubSubTypes.cxx")
                 for name in re.findall(r'setName\("([^"]+)"\)', file.read_text())}
        self.assertEqual([made.dds_name for made in self.package if made.dds_name not in names], [])

    def test_names_are_allowed_in_ros(self):
        for made in self.package:
            self.assertRegex(made.name.removesuffix("_Request").removesuffix("_Response"),
                             MESSAGE_NAME)
            for field in made.fields:
                self.assertRegex(field.name, FIELD_NAME, made.full_name)

    def test_reasons_are_called_as_the_core_and_the_tools_call_them(self):
        header = (SOURCE / "core/traversability/traversability_tile.hpp").read_text()
        reasons = re.search(r"enum class BlockReason[^{]*{(.*?)}", header, re.DOTALL)[1]
        names = [name.upper() for name in re.findall(r"^\s*(\w+),$", reasons, re.MULTILINE)]
        grid = next(made for made in self.package if made.name == "TraversabilityGrid")
        self.assertEqual([constant.name for constant in grid.constants
                          if constant.name.startswith("REASON_")],
                         [f"REASON_{name}" for name in names])

    def test_package_names_every_package_that_it_uses(self):
        used = {field.type.split("/")[0] for made in self.package for field in made.fields
                if "/" in field.type} - {"stillmap_msgs"}
        manifest = xml.parse(PACKAGE / "package.xml").getroot()
        self.assertEqual(manifest.findtext("name"), PACKAGE.name)
        self.assertLessEqual(used, {entry.text for entry in manifest.findall("depend")})
        build = (PACKAGE / "CMakeLists.txt").read_text()
        for package in used:
            self.assertIn(f"find_package({package} REQUIRED)", build)

    def test_versions_agree(self):
        project = (SOURCE / "CMakeLists.txt").read_text()
        version = re.search(r"project\(stillmap VERSION (\S+)", project)[1]
        self.assertEqual(xml.parse(PACKAGE / "package.xml").getroot().findtext("version"), version)


@unittest.skipUnless(rosidl, "python3-rosidl is not installed")
class RosidlTest(ComparisonTest):
    """ROS 2's own reader of .msg and .srv takes the package, and reads what we read."""

    @staticmethod
    def structure(kind: str, name: str, specification) -> Structure:
        return Structure(
            PACKAGE.name, kind, name,
            fields=[Field(str(field.type), field.name) for field in specification.fields],
            constants=[Constant(constant.type, constant.name, constant.value)
                       for constant in specification.constants])

    def test_it_reads_the_same_fields(self):
        theirs = [self.structure("msg", file.stem, rosidl.parse_message_string(
            PACKAGE.name, file.stem, file.read_text())) for file in PACKAGE.glob("msg/*.msg")]
        for file in PACKAGE.glob("srv/*.srv"):
            service = rosidl.parse_service_string(PACKAGE.name, file.stem, file.read_text())
            theirs += [self.structure("srv", f"{file.stem}_Request", service.request),
                       self.structure("srv", f"{file.stem}_Response", service.response)]
        ours = read_package(PACKAGE)
        for made in ours:
            for field in made.fields:
                field.is_key = False
        self.assert_same(ours, theirs)
        self.assert_same(theirs, ours)


class DifferencesTest(unittest.TestCase):
    """The comparison itself: each kind of difference is told with the field's name."""

    @staticmethod
    def message(text: str) -> list[Structure]:
        return [read_message("a_msgs", "msg", "Thing", text)]

    def difference(self, text: str) -> str:
        faults = differences(self.message("uint8 first\nfloat64[] second  # key"),
                             self.message(text))
        self.assertEqual(len(faults), 1, faults)
        return faults[0]

    def test_a_name_a_type_an_order_a_key(self):
        self.assertIn("'secnd'", self.difference("uint8 first\nfloat64[] secnd # key"))
        self.assertIn("'uint16'", self.difference("uint16 first\nfloat64[] second # key"))
        self.assertIn("'second'", self.difference("uint8 first\nfloat64[] second"))
        self.assertIn("second is missing", self.difference("uint8 first"))
        self.assertIn("third is too much",
                      self.difference("uint8 first\nfloat64[] second # key\nbool third"))
        self.assertEqual(len(differences(self.message("uint8 a\nuint16 b"),
                                         self.message("uint16 b\nuint8 a"))), 2)

    def test_a_missing_message(self):
        self.assertEqual(differences(self.message("bool a"), []), ["a_msgs/msg/Thing is missing"])

    def test_constants_and_comments_are_no_fields(self):
        self.assertEqual(differences(self.message("uint8 C=1\nbool a"),
                                     self.message("# b\nuint8 C = 1\nbool a # is true")), [])

    def test_another_constant(self):
        for text in ("uint8 C=2\nbool a", "uint8 D=1\nbool a", "bool a"):
            faults = differences(self.message("uint8 C=1\nbool a"), self.message(text))
            self.assertEqual(len(faults), 1, text)

    def test_an_empty_half_of_a_service_has_one_byte(self):
        request, reply = read_service("a_msgs", "Do", "---\nbool done")
        self.assertEqual([f.name for f in request.fields], ["structure_needs_at_least_one_member"])
        self.assertEqual([f.name for f in reply.fields], ["done"])


if __name__ == "__main__":
    unittest.main()
