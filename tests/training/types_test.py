"""That signatures of the training say what they take and give."""

import importlib
import inspect
import typing
import unittest
from pathlib import Path

import export

FOLDER = Path(export.__file__).parent


def functions_of(module):
    """Functions and methods that the module itself defines."""
    for thing in vars(module).values():
        if getattr(thing, "__module__", None) != module.__name__:
            continue
        if inspect.isfunction(thing):
            yield thing
        elif inspect.isclass(thing):
            yield from (f for f in vars(thing).values() if inspect.isfunction(f))


class Signatures(unittest.TestCase):
    def test_name_the_type_of_everything(self):
        modules = [importlib.import_module(file.stem) for file in sorted(FOLDER.glob("*.py"))]
        self.assertGreater(len(modules), 10)
        # What validation.py names for readers alone.
        later = {"Run": importlib.import_module("train").Run}
        for module in modules:
            for function in functions_of(module):
                # A dataclass writes some itself.
                if function.__code__.co_filename != module.__file__:
                    continue
                with self.subTest(f"{module.__name__}.{function.__qualname__}"):
                    types = typing.get_type_hints(function, localns=later)
                    names = set(inspect.signature(function).parameters) - {"self"}
                    self.assertEqual(names | {"return"}, set(types))


if __name__ == "__main__":
    unittest.main()
