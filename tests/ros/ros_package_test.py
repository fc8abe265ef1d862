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
from message_definitions import CONSTANTS_BEFORE, definition_table
from type_hashes import as_ros, hash_table, type_hashes

try:
    import rosidl_adapter.parser as rosidl
    import rosidl_parser.definition as rosidl_definition
    from rosidl_parser.parser import parse_idl_string
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
        header = (SOURCE / "core/traversability/traversability_view.hpp").read_text()
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
        theirs += [self.of_idl(file.read_text()) for file in PACKAGE.glob("msg/*.idl")]
        ours = read_package(PACKAGE)
        self.assert_same(ours, theirs)
        self.assert_same(theirs, ours)

    @staticmethod
    def of_idl(text: str) -> Structure:
        message, = parse_idl_string(text).get_elements_of_type(rosidl_definition.Message)

        def type_of(its) -> str:
            if isinstance(its, rosidl_definition.UnboundedSequence):
                return type_of(its.value_type) + "[]"
            if isinstance(its, rosidl_definition.NamespacedType):
                return f"{its.namespaces[0]}/{its.name}"
            return its.typename
        structure = message.structure
        return Structure(*structure.namespaced_type.namespaces, structure.namespaced_type.name,
                         fields=[Field(type_of(member.type), member.name,
                                       member.has_annotation("key"))
                                 for member in structure.members])

    def test_it_finds_the_keys(self):
        keyed = {made.name: [field.name for field in made.fields if field.is_key]
                 for made in map(self.of_idl, (file.read_text()
                                               for file in PACKAGE.glob("msg/*.idl")))}
        self.assertEqual(keyed, {name: ["tile_x", "tile_y"] for name in ("MapTile", "TileInfo")})


# As ROS 2's own generator wrote them into Jazzy's packages (NAME.json, get_type_hash).
HASHES_OF_ROS = {
    "builtin_interfaces/msg/Time": "b106235e25a4c5ed35098aa0a61a3ee9c9b18d197f398b0e4206cea9acf9c197",
    "geometry_msgs/msg/Point": "6963084842a9b04494d6b2941d11444708d892da2f4b09843b9c43f42a7f6881",
    "geometry_msgs/msg/Pose": "d501954e9476cea2996984e812054b68026ae0bfae789d9a10b23daf35cc90fa",
    "geometry_msgs/msg/PoseStamped": "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
    "geometry_msgs/msg/PoseWithCovariance":
        "9a7c0fd234b7f45c6098745ecccd773ca1085670e64107135397aee31c02e1bb",
    "geometry_msgs/msg/Quaternion": "8a765f66778c8ff7c8ab94afcc590a2ed5325a1d9a076ffff38fbce36f458684",
    "geometry_msgs/msg/Transform": "beb83fbe698636351461f6f35d1abb20010c43d55374d81bd041f1ba2581fddc",
    "geometry_msgs/msg/TransformStamped":
        "0a241f87d04668d94099cbb5ba11691d5ad32c2f29682e4eb5653424bd275206",
    "geometry_msgs/msg/Twist": "9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
    "geometry_msgs/msg/TwistWithCovariance":
        "49f574f033f095d8b6cd1beaca5ca7925e296e84af1716d16c89d38b059c8c18",
    "geometry_msgs/msg/Vector3": "cc12fe83e4c02719f1ce8070bfd14aecd40f75a96696a67a2a1f37f7dbb0765d",
    "nav_msgs/msg/MapMetaData": "2772d4b2000ef2b35dbaeb80fd3946c1369f817fb4f75677d916d27c17d763c8",
    "nav_msgs/msg/OccupancyGrid": "8d348150c12913a31ee0ec170fbf25089e4745d17035792a1ba94d6f0bc0cfc7",
    "nav_msgs/msg/Odometry": "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    "nav_msgs/msg/Path": "1957a5bb3cee5da65c4e52e52b65a93df227efce4c20f8458b36e73066ca334b",
    "nav_msgs/srv/GetMap": "c8ae77c9995b3554b5ba80e4d4d443f970ac65143102a1d893ec24fc07b31147",
    "nav_msgs/srv/GetMap_Event": "a7ccc266ea4796564e253156024ef4e829dd3e3c424fed3b11e3118aab3971d7",
    "nav_msgs/srv/GetMap_Request": "b531e302f1bd6a81f8a5e03453266c378b1f711b4296000c1c0f53a40e00a7c4",
    "nav_msgs/srv/GetMap_Response": "45246f7a2ff0cbfa46e13865d4b95929ebb6d2846d1b85a20ad51030f4690dc2",
    "octomap_msgs/msg/Octomap": "9891a19a05b70ec20aa8f45db3f8300b9ab80afff32c61c549d25087da9625b0",
    "octomap_msgs/srv/GetOctomap": "c43f2ceb835f797f3d2a2c3d9000e4691207d8c7bfb443119b4e90daaabb5d6c",
    "octomap_msgs/srv/GetOctomap_Event":
        "9347720ba6abc64c1a3d6b360084818c9a10793d288770b8f3aadfc0f788c5b4",
    "octomap_msgs/srv/GetOctomap_Request":
        "cd35df88d5efc717a01bcca35289d9bb1ea7099ec081cb9ae6c282c269d7fa59",
    "octomap_msgs/srv/GetOctomap_Response":
        "874a18c1909a064d2dbf207a8e4de6ccc8d7d3d93edce2ac4d4205f9df0495db",
    "rmw_dds_common/msg/ParticipantEntitiesInfo":
        "91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e",
    "sensor_msgs/msg/Imu": "7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b",
    "sensor_msgs/msg/PointCloud2": "9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5",
    "sensor_msgs/msg/PointField": "5c6a4750728c2bcfbbf7037225b20b02d4429634732146b742dee1726637ef01",
    "service_msgs/msg/ServiceEventInfo":
        "41bcbbe07a75c9b52bc96bfd5c24d7f0fc0a08c0cb7921b3373c5732345a6f45",
    "std_msgs/msg/Header": "f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01",
    "tf2_msgs/msg/TFMessage": "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"}


class TypeHashTest(ComparisonTest):
    """The hashes that endpoints announce to ROS 2 from Iron on."""

    @classmethod
    def setUpClass(cls):
        cls.idl = read_idl(sorted((SOURCE / "idl/msg").glob("*.idl")))

    def test_they_are_those_of_ros_own_generator(self):
        ours = type_hashes(as_ros(self.idl))
        for name, theirs in HASHES_OF_ROS.items():
            self.assertEqual(ours[name], f"RIHS01_{theirs}", name)
        standard = {made.full_name for made in as_ros(self.idl)
                    if made.package != PACKAGE.name}
        self.assertEqual(standard - set(HASHES_OF_ROS), {
            "geometry_msgs/msg/PoseWithCovarianceStamped", "rmw_dds_common/msg/Gid",
            "rmw_dds_common/msg/NodeEntitiesInfo", "sensor_msgs/msg/NavSatFix",
            "sensor_msgs/msg/NavSatStatus"})

    def test_strings_and_bounds_count(self):
        def hash_of(text: str) -> str:
            made = read_message("a_msgs", "msg", "Thing", text)
            return type_hashes([made])["a_msgs/msg/Thing"]
        self.assertEqual(
            type_hashes([read_message("std_msgs", "msg", "String", "string data")])
            ["std_msgs/msg/String"],
            "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18")
        texts = ("string a", "string<=4 a", "string<=5 a", "string[] a", "string[3] a",
                 "string[<=3] a", "uint8[] a", "int8[] a", "byte[] a", "string b")
        self.assertEqual(len({hash_of(text) for text in texts}), len(texts))
        self.assertEqual(hash_of("string a"), hash_of("uint8 C=1\nstring a  # why"))

    def test_our_package_has_the_hashes_of_our_idl(self):
        package = type_hashes([*as_ros(self.idl), *read_package(PACKAGE)])
        self.assertEqual(package, type_hashes(as_ros(self.idl)))

    def test_the_table_is_written(self):
        table = (SOURCE / "idl/dds/type_hash_table.inc").read_text()
        self.assertEqual(table, hash_table(self.idl), "run 'make ros-messages'")


class MessageDefinitionTest(ComparisonTest):
    """The definitions that MCAP files and Foxglove carry."""

    def test_the_table_is_written(self):
        idl = read_idl(sorted((SOURCE / "idl/msg").glob("*.idl")))
        table = (SOURCE / "idl/dds/message_definition_table.inc").read_text()
        self.assertEqual(table, definition_table(idl), "run 'make ros-messages'")

    def test_what_viewers_know_is_as_ros_has_it(self):
        table = (SOURCE / "idl/dds/message_definition_table.inc").read_text()
        for text in ("float64 z 0\nfloat64 w 1\n", "int8 STATUS_NO_FIX=-1\n",
                     "float64[9] position_covariance\nuint8 COVARIANCE_TYPE_UNKNOWN=0\n"):
            self.assertEqual(table.count(text), 1, text)

    def test_they_say_what_our_idl_says(self):
        table = (SOURCE / "idl/dds/message_definition_table.inc").read_text()
        found = re.findall(r'\{"(\w+)/(\w+)/(\w+)", R"msg\((.*?)\)msg"\}', table, re.DOTALL)
        theirs = [read_message(package, kind, name, text) for package, kind, name, text in found]
        ours = as_ros(read_idl(sorted((SOURCE / "idl/msg").glob("*.idl"))))
        # A .msg cannot say which fields are keys.
        for made in ours:
            for field in made.fields:
                field.is_key = False
        of_ros = {line for lines in CONSTANTS_BEFORE.values() for line in lines}
        for made in ours + theirs:
            made.constants = [constant for constant in made.constants
                              if f"{constant.type} {constant.name}={constant.value}" not in of_ros]
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
