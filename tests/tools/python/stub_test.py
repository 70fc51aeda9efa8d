#!/usr/bin/python3
"""The stub agrees with the package: names, parameters in order, defaults, docstrings. Arguments: experiment.py."""

import ast
import inspect
import re
import unittest

from experiment import PACKAGES, run_tests

import stageid

SPECIAL = {"__init__", "__len__", "__iter__", "__getitem__"}


def stub_tree():
    return ast.parse((PACKAGES / "stageid" / "__init__.pyi").read_text())


def stub_docstrings(kind):
    """(name, docstring) of the members of a class: attributes have theirs behind them."""
    for member, after in zip(kind.body, [*kind.body[1:], None]):
        if isinstance(member, ast.FunctionDef):
            yield member.name, ast.get_docstring(member)
        if isinstance(member, ast.AnnAssign):
            yield member.target.id, inspect.cleandoc(after.value.value)


def stub_parameters(function):
    """(name, keyword only, default as text or None) of every parameter but self."""
    a = function.args
    defaults = [None] * (len(a.args) - len(a.defaults)) + a.defaults
    listed = [(p.arg, False, d) for p, d in zip(a.args, defaults) if p.arg != "self"]
    listed += [(p.arg, True, d) for p, d in zip(a.kwonlyargs, a.kw_defaults)]
    return [(name, only, None if d is None else ast.unparse(d)) for name, only, d in listed]


def compiled_parameters(function, name):
    """The same of a function: a compiled one has its signature at the beginning of its docstring."""
    if inspect.isfunction(function):
        return [(p.name, p.kind is p.KEYWORD_ONLY, None if p.default is p.empty else repr(p.default))
                for p in list(inspect.signature(function).parameters.values())[1:]]
    signature = re.match(rf"{name}\((.*)\) -> ", function.__doc__).group(1)
    return stub_parameters(ast.parse(f"def function({signature}): pass").body[0])


class Stub(unittest.TestCase):
    def test_names(self):
        nodes = [n for n in stub_tree().body if isinstance(n, (ast.ClassDef, ast.FunctionDef))]
        names = {n.name for n in nodes} | {"__version__"}
        results = set(stageid._results.__all__)
        self.assertIn("from stageid._results import *", map(ast.unparse, stub_tree().body))
        self.assertEqual(names | results, set(stageid.__all__))
        self.assertEqual(names, {n for n in dir(stageid._native) if n == "__version__" or not n.startswith("_")})
        self.assertEqual(results, {n for n, kind in vars(stageid._results).items() if isinstance(kind, type)
                                   and kind.__module__ == "stageid._results"})
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
                said = {member for member, _ in stub_docstrings(node)} - SPECIAL
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

    def test_docstrings_of_the_stub_are_those_of_the_package(self):
        for node in stub_tree().body:
            if isinstance(node, ast.ClassDef):
                kind = getattr(stageid, node.name)
                self.assertEqual(inspect.getdoc(kind), ast.get_docstring(node))
                for member, text in stub_docstrings(node):
                    with self.subTest(f"{node.name}.{member}"):
                        self.assertIn(text, inspect.getdoc(getattr(kind, member)))

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
