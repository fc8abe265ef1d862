"""The stubs name what the module has, no more and no less."""

import ast
import inspect
from pathlib import Path

import stillmap


def public(names):
    return {name for name in names if not name.startswith("_")}


def stub_nodes():
    text = (Path(stillmap.__file__).parent / "__init__.pyi").read_text()
    return ast.parse(text).body


ALIASES = {"Place", "Path", "Region"}


def test_names_are_those_of_the_module():
    named = set()
    for node in stub_nodes():
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
            named.add(node.name)
        elif isinstance(node, ast.AnnAssign):
            named.add(node.target.id)
    assert public(named) == public(dir(stillmap)) - ALIASES


def test_members_and_parameters_are_those_of_the_classes():
    for node in stub_nodes():
        if not isinstance(node, ast.ClassDef) or not node.body or node.name.endswith("Error"):
            continue
        real = getattr(stillmap, node.name)
        if issubclass(real, Exception):
            continue
        named = {member.name for member in node.body if isinstance(member, ast.FunctionDef)}
        assert public(named) == public(vars(real)), node.name
        for member in node.body:
            function = vars(real).get(getattr(member, "name", ""))
            if function is None or isinstance(function, property) or not function.__doc__:
                continue
            for argument in member.args.args[1:]:
                assert argument.arg in function.__doc__ or member.name == "__getitem__", (
                    node.name, member.name, argument.arg)


def test_everything_public_has_a_docstring():
    for name in public(dir(stillmap)):
        thing = getattr(stillmap, name)
        if inspect.isclass(thing) and not issubclass(thing, Exception):
            assert thing.__doc__, name
