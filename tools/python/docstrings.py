#!/usr/bin/python3
"""Writes the docstrings of the stub as C++, so that help(stageid) shows the same text.

    docstrings.py STUB OUTPUT.cpp
"""

import ast
import inspect
import pathlib
import sys

SOURCE = """#include <stdexcept>
#include <string>

#include "tools/python/bindings.hpp"

namespace stageid {{

const char* docstring(std::string_view name) {{
  struct Docstring {{
    std::string_view name;
    const char* text;
  }};
  static constexpr Docstring kDocstrings[] = {{
{}
  }};
  for (const Docstring& documented : kDocstrings)
    if (documented.name == name) return documented.text;
  throw std::logic_error("the stub has no docstring of " + std::string(name));
}}

}}  // namespace stageid
"""


def docstrings(body, prefix=""):
    for node, after in zip(body, [*body[1:], None]):
        if isinstance(node, ast.AnnAssign) and isinstance(after, ast.Expr):
            yield prefix + node.target.id, inspect.cleandoc(after.value.value)
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
