#!/usr/bin/env python3
"""Keeps the arrows of the architecture:

    tools -> estimation -> frf -> record -> excitation -> nothing of ours
             acquisition (the loop) -> record, excitation, hal;  hal -> nothing of ours

Which library a file belongs to is read from the CMakeLists.txt of its folder, so a file that no
library lists is found too. Called with the source tree: prints what is wrong, exit status 1.
With --self-test: plants one violation of every rule in a small tree and expects each to be found.
"""

import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

FOLDERS = ["excitation", "hal", "acquisition", "frf", "estimation", "tools"]

# The libraries that each may include and link. Written out, not derived: this table is the rule.
ARROWS = {
    "excitation": set(),
    "hal": set(),
    "record": {"excitation"},
    "acquisition": {"excitation", "hal", "record"},
    "frf": {"excitation", "record"},
    "estimation": {"excitation", "record", "frf"},
    "tools": {"excitation", "hal", "record", "acquisition", "frf", "estimation"},
}

# Third-party headers that stay behind one door, by the start of their name.
DOORS = {
    "fftw3": {"excitation"},
    "xxhash": {"excitation"},
    "hdf5": {"excitation"},
    "H5": {"excitation"},
    "modbus": {"hal"},
    "matio": {"tools"},
    "zlib": {"tools"},
    "yaml-cpp/": {"tools"},
    "CLI/": {"tools"},
    "httplib": {"tools"},
    "nlohmann/": {"record", "frf", "estimation", "tools"},
}

# What an installed header may ask of its users beside the standard library; HDF5 only behind its door.
INSTALLED_HEADERS_MAY_INCLUDE = ("Eigen/", "hdf5.h")

GRAB_BAGS = {"common", "util", "utils", "helpers", "misc", "base", "core", "shared"}

INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*([<"])([^>"]+)[>"]', re.MULTILINE)
COMMENT = re.compile(r"#[^\n]*")


class Tree:
    """The libraries of a source tree, as its CMake files tell."""

    def __init__(self, root):
        self.root = pathlib.Path(root)
        self.library_of = {}  # "folder/file" -> library
        self.links = {}  # library -> libraries of ours that it links
        self.installed = set()  # "folder/file" in a FILE_SET HEADERS
        for folder in FOLDERS:
            self._read_cmake(folder)

    def _read_cmake(self, folder):
        path = self.root / folder / "CMakeLists.txt"
        if not path.exists():
            return
        text = COMMENT.sub("", path.read_text())
        for call in re.finditer(r"target_sources\(\s*stageid_(\w+)([^)]*)\)", text):
            library, words = call.group(1), call.group(2).split()
            in_file_set = False
            for word in words:
                in_file_set = word == "FILE_SET" or (in_file_set and word not in ("PRIVATE", "PUBLIC"))
                if word.endswith((".cpp", ".hpp")):
                    self.library_of[f"{folder}/{word}"] = library
                    if in_file_set:
                        self.installed.add(f"{folder}/{word}")
        for call in re.finditer(r"target_link_libraries\(\s*stageid_(\w+)([^)]*)\)", text):
            self.links.setdefault(call.group(1), set()).update(
                re.findall(r"stageid::(\w+)", call.group(2)))

    def library(self, name):
        """Library of "folder/file". A private header need not be listed where its folder has one
        library only; everything in tools, the program and its assets, is tools."""
        if name.startswith("tools/"):
            return "tools"
        folder = name.split("/")[0]
        here = {library for file, library in self.library_of.items() if file.split("/")[0] == folder}
        if name.endswith(".hpp") and len(here) == 1:
            return here.pop()
        return self.library_of.get(name)

    def sources(self):
        for folder in FOLDERS:
            for path in sorted((self.root / folder).rglob("*")):
                if path.suffix in (".cpp", ".hpp"):
                    yield path, path.relative_to(self.root).as_posix()


def include_faults(tree, path, name):
    library = tree.library(name)
    if library is None:
        yield f"{name}: not listed in {name.split('/')[0]}/CMakeLists.txt"
        return
    text = path.read_text()
    if path.suffix == ".hpp" and "#pragma once" not in text:
        yield f"{name}: no #pragma once"
    for match in INCLUDE.finditer(text):
        place = f"{name}:{text.count(chr(10), 0, match.start()) + 1}"
        quoted, target = match.group(1) == '"', match.group(2)
        if quoted:
            yield from own_include_faults(tree, place, library, target, name)
            continue
        if target.split("/")[0] in FOLDERS:
            yield f'{place}: our own header is written "{target}"'
        for start, allowed in DOORS.items():
            if target.startswith(start) and library not in allowed:
                yield f"{place}: <{target}> may be included by {', '.join(sorted(allowed))} only"
        asked_of_users = name in tree.installed and not is_standard(target)
        if asked_of_users and not target.startswith(INSTALLED_HEADERS_MAY_INCLUDE):
            yield f"{place}: an installed header may not ask its users for <{target}>"


def own_include_faults(tree, place, library, target, name):
    folder = target.split("/")[0]
    if folder == "tests":
        yield f"{place}: {target}: the product does not include its tests"
    elif folder not in FOLDERS or not (tree.root / target).is_file():
        yield f'{place}: "{target}" is not a header of ours, seen from the root'
    else:
        other = tree.library(target)
        if other is not None and other != library and other not in ARROWS[library]:
            yield f"{place}: {library} may not include {target} of {other}"
        if name in tree.installed and target not in tree.installed:
            yield f"{place}: installed, but {target} is not"


def is_standard(header):
    """C++ headers have neither folder nor ending; those of C and the system are for sources."""
    return "/" not in header and "." not in header


def link_faults(tree):
    for library, links in sorted(tree.links.items()):
        for other in sorted(links - {"warnings"} - ARROWS.get(library, links)):
            if other != library:
                yield f"stageid_{library}: may not link stageid::{other}"
    for library in sorted(set(tree.links) - set(ARROWS) - {"program"}):
        yield f"stageid_{library}: has no place among the arrows (tests/integration/layering_test.py)"


def all_files(root):
    """What git would keep: tracked files and new ones; without git, everything outside build."""
    try:
        listed = subprocess.run(
            ["git", "-C", str(root), "ls-files", "--cached", "--others", "--exclude-standard"],
            check=True, capture_output=True, text=True).stdout.splitlines()
        names = [name for name in listed if (root / name).is_file()]
    except (OSError, subprocess.CalledProcessError):
        names = []
    return names or [
        path.relative_to(root).as_posix() for path in sorted(root.rglob("*"))
        if path.is_file() and path.relative_to(root).parts[0] not in ("build", ".git")]


def shape_faults(root):
    for name in all_files(root):
        path = pathlib.PurePosixPath(name)
        for part in path.parts[:-1]:
            if part in GRAB_BAGS:
                yield f"{name}: no folder '{part}': a folder is named after what it holds"


def faults(root):
    tree = Tree(root)
    found = [fault for path, name in tree.sources() for fault in include_faults(tree, path, name)]
    return found + list(link_faults(tree)) + sorted(set(shape_faults(tree.root)))


class SelfTest(unittest.TestCase):
    """A tree without fault, and that tree with one fault of every kind."""

    FILES = {
        "excitation/CMakeLists.txt":
            "target_sources(stageid_excitation PRIVATE grid.cpp\n"
            "  PUBLIC FILE_SET HEADERS BASE_DIRS x FILES grid.hpp)",
        "excitation/grid.hpp": "#pragma once\n#include <Eigen/Core>\n#include <vector>\n",
        "excitation/grid.cpp": '#include "excitation/grid.hpp"\n#include <fftw3.h>\n',
        "hal/CMakeLists.txt":
            "target_sources(stageid_hal PUBLIC FILE_SET HEADERS BASE_DIRS x FILES stage.hpp)",
        "hal/stage/stage.hpp": "#pragma once\n",
        "acquisition/CMakeLists.txt":
            "target_sources(stageid_record PRIVATE detail.hpp log.cpp\n"
            "  PUBLIC FILE_SET HEADERS BASE_DIRS x FILES log.hpp)\n"
            "target_link_libraries(stageid_record PUBLIC stageid::excitation)\n"
            "target_sources(stageid_acquisition\n"
            "  PUBLIC FILE_SET HEADERS BASE_DIRS x FILES loop.hpp)\n"
            "target_link_libraries(stageid_acquisition PUBLIC stageid::record stageid::hal)\n",
        "acquisition/log.hpp": '#pragma once\n#include "excitation/grid.hpp"\n',
        "acquisition/log.cpp": '#include "acquisition/detail.hpp"\n#include <nlohmann/json.hpp>\n',
        "acquisition/detail.hpp": "#pragma once\n",
        "acquisition/loop.hpp": '#pragma once\n#include "acquisition/log.hpp"\n#include "hal/stage/stage.hpp"\n',
        "tools/CMakeLists.txt": "target_link_libraries(stageid_tools PUBLIC stageid::acquisition)",
        "tools/main.cpp": '#include <CLI/CLI.hpp>\n#include "acquisition/loop.hpp"\n',
    }

    PLANTED = {
        "hal may not include excitation/grid.hpp":
            ("hal/stage/stage.hpp", '#pragma once\n#include "excitation/grid.hpp"\n'),
        "record may not include acquisition/loop.hpp":
            ("acquisition/log.hpp", '#pragma once\n  #  include "acquisition/loop.hpp"\n'),
        "record may not include hal/stage/stage.hpp":
            ("acquisition/log.cpp", '#include "hal/stage/stage.hpp"\n'),
        "excitation may not include acquisition/log.hpp":
            ("excitation/grid.cpp", '#include "acquisition/log.hpp"\n'),
        "<yaml-cpp/yaml.h> may be included by tools only":
            ("hal/stage/stage.hpp", "#pragma once\n#include <yaml-cpp/yaml.h>\n"),
        "<CLI/CLI.hpp> may be included by tools only":
            ("acquisition/log.cpp", "#include <CLI/CLI.hpp>\n"),
        "<fftw3.h> may be included by excitation only": ("tools/main.cpp", "#include <fftw3.h>\n"),
        "<hdf5.h> may be included by excitation only":
            ("acquisition/log.cpp", "#include <hdf5.h>\n"),
        "an installed header may not ask its users for <fmt/format.h>":
            ("excitation/grid.hpp", "#pragma once\n#include <fmt/format.h>\n"),
        "installed, but acquisition/detail.hpp is not":
            ("acquisition/log.hpp", '#pragma once\n#include "acquisition/detail.hpp"\n'),
        "our own header is written": ("tools/main.cpp", "#include <hal/stage/stage.hpp>\n"),
        "is not a header of ours": ("acquisition/loop.hpp", '#pragma once\n#include "log.hpp"\n'),
        "does not include its tests": ("tools/main.cpp", '#include "tests/support/x.hpp"\n'),
        "no #pragma once": ("hal/stage/stage.hpp", "struct Stage {};\n"),
        "orphan.cpp: not listed in hal/CMakeLists.txt": ("hal/orphan.cpp", "int x;\n"),
        "orphan.hpp: not listed in acquisition/CMakeLists.txt":
            ("acquisition/orphan.hpp", "#pragma once\n"),
        "stageid_hal: may not link stageid::record":
            ("hal/CMakeLists.txt", "target_sources(stageid_hal PUBLIC FILE_SET HEADERS BASE_DIRS x "
             "FILES stage.hpp)\ntarget_link_libraries(stageid_hal PRIVATE stageid::record)"),
        "stageid_misfit: has no place":
            ("hal/CMakeLists.txt", "target_sources(stageid_hal PUBLIC FILE_SET HEADERS BASE_DIRS x "
             "FILES stage.hpp)\ntarget_link_libraries(stageid_misfit PRIVATE fmt::fmt)"),
        "no folder 'utils'": ("excitation/utils/notes.txt", ""),
    }

    def faults_of(self, files):
        with tempfile.TemporaryDirectory() as folder:
            for name, text in files.items():
                path = pathlib.Path(folder, name)
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text)
            return faults(pathlib.Path(folder))

    def test_a_clean_tree_passes(self):
        self.assertEqual(self.faults_of(self.FILES), [])

    def test_every_planted_fault_is_found(self):
        for expected, (name, text) in self.PLANTED.items():
            with self.subTest(expected):
                found = self.faults_of({**self.FILES, name: text})
                self.assertTrue(any(expected in fault for fault in found), found)


if __name__ == "__main__":
    if sys.argv[1:] == ["--self-test"]:
        unittest.main(argv=sys.argv[:1])
    found_here = faults(pathlib.Path(sys.argv[1]).resolve())
    print("\n".join(found_here))
    sys.exit(1 if found_here else 0)
