#!/usr/bin/python3
"""Writes the docstrings of the stub as C++, so that help(stageid) shows the same text.

    docstrings.py STUB OUTPUT.cpp
"""

import ast
import pathlib
import sys

SOURCE = """#include "tools/python/docstring.hpp"

namespace stageid {{

std::span<const Docstring> docstrings() {{
  static constexpr Docstring kDocstrings[] = {{
{}
  }};
  return kDocstrings;
}}

}}  // namespace stageid
"""


def docstrings(body, prefix=""):
    for node in body:
        if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
            if text := ast.get_docstring(node):
                yield prefix + node.name, text
        if isinstance(node, ast.ClassDef):
            yield from docstrings(node.body, f"{node.name}.")


def main():
    stub, output = map(pathlib.Path, sys.argv[1:])
    rows = (f'{{"{name}", R"py({text})py"}},' for name, text in docstrings(ast.parse(stub.read_text()).body))
    output.write_text(SOURCE.format("\n".join(rows)))


if __name__ == "__main__":
    main()
