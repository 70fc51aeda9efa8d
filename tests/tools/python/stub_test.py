#!/usr/bin/python3
"""The type stub says what the compiled package has: names, parameters in their order, defaults; every
public thing has a docstring that tells units or shapes. Arguments: experiment.py."""

import ast
import re
import unittest

from experiment import PACKAGES, run_tests

import stageid

# Kinds of results and of arguments: in the stub only.
TYPES_ONLY = {"File", "Reals", "Complexes", "Run", "CandidateMode", "StabilizationPole", "Mode", "Submodel",
              "ModePair", "Covariance", "Finding"}
SPECIAL = {"__init__", "__len__", "__iter__", "__getitem__"}


def stub_tree():
    return ast.parse((PACKAGES / "stageid" / "__init__.pyi").read_text())


def stub_parameters(function):
    """(name, keyword only, default as text or None) of every parameter but self."""
    a = function.args
    defaults = [None] * (len(a.args) - len(a.defaults)) + a.defaults
    listed = [(p.arg, False, d) for p, d in zip(a.args, defaults) if p.arg != "self"]
    listed += [(p.arg, True, d) for p, d in zip(a.kwonlyargs, a.kw_defaults)]
    return [(name, only, None if d is None else ast.unparse(d)) for name, only, d in listed]


def compiled_parameters(function, name):
    """The same from the signature that begins the docstring of a compiled function."""
    signature = re.match(rf"{name}\((.*)\) -> ", function.__doc__).group(1)
    listed, only, depth, word = [], False, 0, ""
    for character in signature + ",":
        depth += character in "[({"
        depth -= character in "])}"
        if character != "," or depth > 0:
            word += character
            continue
        word, part = "", word.strip()
        if part == "*":
            only = True
        elif part and part.split(":")[0] != "self":
            default = part.split(" = ")[1] if " = " in part else None
            listed.append((part.split(":")[0], only, default))
    return listed


class Stub(unittest.TestCase):
    def test_names(self):
        nodes = [n for n in stub_tree().body if isinstance(n, (ast.ClassDef, ast.FunctionDef))]
        names = {n.name for n in nodes} - TYPES_ONLY
        self.assertEqual(names, set(stageid.__all__) - {"__version__"})
        self.assertEqual(set(stageid.__all__), {n for n in dir(stageid._native) if n == "__version__" or
                                                not n.startswith("_")})
        self.assertTrue((PACKAGES / "stageid" / "py.typed").exists())

    def test_parameters(self):
        for node in stub_tree().body:
            if isinstance(node, ast.FunctionDef) and node.name != "call":
                self.compare(node, getattr(stageid, node.name))
            if isinstance(node, ast.ClassDef) and node.name in stageid.__all__:
                for member in node.body:
                    if isinstance(member, ast.FunctionDef) and not member.decorator_list:
                        self.compare(member, getattr(getattr(stageid, node.name), member.name))

    def compare(self, node, function):
        if node.name in ("__len__", "__iter__"):
            return
        with self.subTest(node.name):
            stub = stub_parameters(node)
            compiled = compiled_parameters(function, node.name)
            self.assertEqual([p[:2] for p in stub], [p[:2] for p in compiled])
            for (name, _, said), (_, _, true) in zip(stub, compiled):
                self.assertEqual(said is None, true is None, name)
                if said not in (None, "..."):
                    self.assertEqual(ast.literal_eval(said), ast.literal_eval(true), name)

    def test_members(self):
        for node in stub_tree().body:
            if isinstance(node, ast.ClassDef) and node.name in ("Log", "Frf", "Model", "Fit"):
                kind = getattr(stageid, node.name)
                said = {m.name for m in node.body if isinstance(m, ast.FunctionDef)} - SPECIAL
                self.assertEqual(said, {name for name in vars(kind) if not name.startswith("_")})

    def test_docstrings(self):
        for name in stageid.__all__:
            thing = getattr(stageid, name)
            if name == "__version__":
                continue
            with self.subTest(name):
                self.assertTrue(thing.__doc__ and thing.__doc__.strip())
            if not isinstance(thing, type):
                self.check_function(name, thing)
            elif not issubclass(thing, Exception):
                for member, value in vars(thing).items():
                    if not member.startswith("_"):
                        with self.subTest(f"{name}.{member}"):
                            self.assertTrue(value.__doc__ and len(value.__doc__.strip()) > 3)

    def check_function(self, name, function):
        """Behind the signature stands a text; it tells of every parameter, and says what is raised."""
        signature, text = function.__doc__.split("\n", 1)
        with self.subTest(name):
            self.assertIn("Raises", text)
            for parameter, _, _ in compiled_parameters(function, name) if name != "call" else []:
                if parameter not in ("file", "frf", "model", "first", "second", "config"):
                    self.assertRegex(text, rf"\b{parameter}\b")


if __name__ == "__main__":
    run_tests()
