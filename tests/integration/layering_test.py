#!/usr/bin/env python3
"""Keeps the arrows of the architecture, between floors and between their rooms.

A floor is a top-level folder, a room a folder with sources; a room's CMakeLists.txt says what is in it and names what
it may include:

    # Submodels and the mode indicator.
    stageid_room(estimation USES estimation/model frf/response INSTALLED cmif.hpp)

Checked: each include is of the room itself or of a room in USES, no entry of USES is unused, the rooms have no
circle, libraries follow ARROWS, third-party headers stay behind their DOORS, installed headers include installed ones.

    layering_test.py SOURCE_DIR           prints what is wrong, exit status 1
    layering_test.py SOURCE_DIR --draw    prints the rooms and their arrows as a page (docs/rooms.md)
    layering_test.py --self-test          plants one violation of every rule and expects each to be found
"""

import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

FLOORS = ["excitation", "hal", "acquisition", "frf", "estimation", "tools"]

# The libraries that each may use. Not derived from the sources: this table is the rule.
ARROWS = {
    "words": set(),
    "decompositions": set(),
    "files": set(),
    "excitation": {"words", "decompositions"},
    "hal": {"words", "decompositions"},
    "record": {"words", "files", "excitation"},
    "acquisition": {"words", "decompositions", "files", "excitation", "hal", "record"},
    "frf": {"words", "decompositions", "files", "excitation", "record"},
    "estimation": {"words", "decompositions", "files", "excitation", "record", "frf"},
    "tools": {"words", "decompositions", "files", "excitation", "hal", "record", "acquisition", "frf", "estimation"},
}

# Third-party headers that only one library may include, by the start of their name.
DOORS = {
    "fftw3": {"excitation"},
    "boost/": {"frf", "estimation"},
    "xxhash": {"files"},
    "hdf5": {"files"},
    "H5": {"files"},
    "modbus": {"hal"},
    "zmq.h": {"hal"},
    "matio": {"tools"},
    "mpi.h": {"tools"},
    "zlib": {"tools"},
    "zip.h": {"tools"},
    "sqlite3.h": {"tools"},
    "utf8.h": {"tools"},
    "yaml-cpp/": {"tools"},
    "CLI/": {"tools"},
    "httplib": {"tools"},
    "nlohmann/": {"record", "frf", "estimation", "tools"},
}

# Headers that an installed header may include besides the standard library; HDF5 only where permitted.
INSTALLED_HEADERS_MAY_INCLUDE = ("Eigen/", "hdf5.h")

GRAB_BAGS = {"common", "util", "utils", "helpers", "misc", "base", "core", "shared"}
# The bindings and both main(): above every room.
NO_ROOM = ("tools/python", "tools/main.cpp", "tools/mpi_main.cpp", "tools/program_main")

INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*([<"])([^>"]+)[>"]', re.MULTILINE)
COMMENT = re.compile(r"#[^\n]*")
WORDS = ("USES", "GENERATED", "INSTALLED", "LIBRARIES")


class Room:
    def __init__(self, library, words, about):
        self.library = library
        self.about = about  # one line for people
        self.parts = {word: [] for word in WORDS}
        part = None
        for word in words:
            if word in WORDS:
                part = self.parts[word]
            elif part is not None:
                part.append(word)
        self.uses = self.parts["USES"]


class Tree:
    """The rooms and libraries of a source tree, from its CMake files."""

    def __init__(self, root):
        self.root = pathlib.Path(root)
        self.rooms = {}  # "floor/room" -> Room
        self.links = {}  # library -> libraries of this project that it links
        for floor in FLOORS:
            for path in sorted((self.root / floor).rglob("CMakeLists.txt")):
                self._read_cmake(path)
        self.installed = {f"{name}/{header}" for name, room in self.rooms.items() for header in room.parts["INSTALLED"]}
        self.installed |= {f"{floor}/{floor}.hpp" for floor in FLOORS}

    def _read_cmake(self, path):
        about = re.match(r"# (.+)\.\n", path.read_text())
        text = COMMENT.sub("", path.read_text())
        name = path.parent.relative_to(self.root).as_posix()
        for call in re.finditer(r"stageid_room\(\s*(\w+)([^)]*)\)", text):
            self.rooms[name] = Room(call.group(1), call.group(2).split(), about.group(1) if about else "")
        for call in re.finditer(r"target_link_libraries\(\s*stageid_(\w+)([^)]*)\)", text):
            self.links.setdefault(call.group(1), set()).update(re.findall(r"stageid::(\w+)", call.group(2)))

    def sources(self):
        for floor in FLOORS:
            for path in sorted((self.root / floor).rglob("*")):
                if path.suffix in (".cpp", ".hpp"):
                    yield path, path.relative_to(self.root).as_posix()


def folder_of(name):
    return name.rpartition("/")[0]


def include_faults(tree, path, name, used):
    text = path.read_text()
    room = tree.rooms.get(folder_of(name))
    face = name in {f"{floor}/{floor}.hpp" for floor in FLOORS}  # included by a floor's users: above its rooms
    above = face or name.startswith(NO_ROOM)
    if room is None and not above:
        yield f"{name}: its folder is not a room (stageid_room() in its CMakeLists.txt)"
        return
    if path.suffix == ".hpp" and "#pragma once" not in text:
        yield f"{name}: no #pragma once"
    library = name.split("/")[0] if face else "tools" if above else room.library
    for match in INCLUDE.finditer(text):
        place = f"{name}:{text.count(chr(10), 0, match.start()) + 1}"
        quoted, target = match.group(1) == '"', match.group(2)
        if quoted:
            yield from own_include_faults(tree, place, target, name, None if above else room, used)
            continue
        if target.split("/")[0] in FLOORS:
            yield f'{place}: our own header is written "{target}"'
        for start, allowed in DOORS.items():
            if target.startswith(start) and library not in allowed:
                yield f"{place}: <{target}> may be included by {', '.join(sorted(allowed))} only"
        asked_of_users = name in tree.installed and not is_standard(target)
        if asked_of_users and not target.startswith(INSTALLED_HEADERS_MAY_INCLUDE):
            yield f"{place}: an installed header may not ask its users for <{target}>"


def own_include_faults(tree, place, target, name, room, used):
    floor = target.split("/")[0]
    if floor == "tests":
        yield f"{place}: {target}: the product does not include its tests"
    elif floor not in FLOORS or not (tree.root / target).is_file():
        yield f'{place}: "{target}" is not a header of ours, seen from the root'
    else:
        other, here = folder_of(target), folder_of(name)
        if room is not None and other != here:
            used.add((here, other))
            if other not in room.uses:
                yield f"{place}: {here} may not include {target}: {other} is not in its USES"
        if name in tree.installed and target not in tree.installed:
            yield f"{place}: installed, but {target} is not"


def is_standard(header):
    """C++ headers have neither folder nor ending; those of C and the system are for sources."""
    return "/" not in header and "." not in header


def room_faults(tree, used):
    for name, room in tree.rooms.items():
        if not room.about:
            yield f"{name}: its CMakeLists.txt does not begin with a line '# What is in this room.'"
        for other in room.uses:
            if other not in tree.rooms:
                yield f"{name}: USES {other}, which is not a room"
                continue
            library = tree.rooms[other].library
            if library != room.library and library not in ARROWS.get(room.library, set()):
                yield f"{name}: {room.library} may not use {other} of {library}"
            if (name, other) not in used:
                yield f"{name}: USES {other}, but includes nothing of it"
    yield from circles(tree)


def circles(tree):
    """Rooms that cannot be put in an order."""
    left = {name: {other for other in room.uses if other in tree.rooms} for name, room in tree.rooms.items()}
    while True:
        free = [name for name, uses in left.items() if not uses & left.keys()]
        if not free:
            break
        for name in free:
            del left[name]
    if left:
        yield f"rooms use each other in a circle: {', '.join(sorted(left))}"


def link_faults(tree):
    for library, links in sorted(tree.links.items()):
        for other in sorted(links - {"warnings"} - ARROWS.get(library, links)):
            if other != library:
                yield f"stageid_{library}: may not link stageid::{other}"
    for library in sorted(set(tree.links) - set(ARROWS) - {"program", "mpi", "python"}):
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
    names = all_files(root)
    sources = {name for name in names if name.split("/")[0] in FLOORS}
    floor_of = {pathlib.PurePosixPath(name).stem: folder_of(name) for name in sources if name.endswith((".cpp", ".hpp"))}
    for name in names:
        path = pathlib.PurePosixPath(name)
        for part in path.parts[:-1]:
            if part in GRAB_BAGS:
                yield f"{name}: no folder '{part}': a folder is named after what it holds"
        if path.parts[0] == "tests" and path.name.endswith("_test.cpp"):
            home = floor_of.get(path.name[:-len("_test.cpp")])
            if home is not None and folder_of(name) != f"tests/{home}":
                yield f"{name}: the test of a source in {home} belongs in tests/{home}"


def drawing_faults(root):
    page = root / "docs/rooms.md"
    if page.exists() and page.read_text() != drawing(root) + "\n":
        yield "docs/rooms.md: out of date; tests/integration/layering_test.py . --draw > docs/rooms.md"


def faults(root):
    tree = Tree(root)
    used = set()
    found = [fault for path, name in tree.sources() for fault in include_faults(tree, path, name, used)]
    return found + list(room_faults(tree, used)) + list(link_faults(tree)) + sorted(set(shape_faults(tree.root))) + \
        list(drawing_faults(tree.root))


def reachable(tree, name):
    found, open_rooms = set(), [name]
    while open_rooms:
        for other in tree.rooms[open_rooms.pop()].uses:
            if other not in found:
                found.add(other)
                open_rooms.append(other)
    return found


def direct_uses(tree, name):
    """Without those that another room in USES implies."""
    uses = tree.rooms[name].uses
    return [other for other in uses if not any(other in reachable(tree, via) for via in uses if via != other)]


def drawing(root):
    """The page: per floor a Mermaid graph of its rooms, and a table of what each contains and uses of other floors."""
    tree = Tree(root)
    lines = ["# Rooms", "",
             "Made by `tests/integration/layering_test.py . --draw`, from the CMakeLists.txt of each room; `integration.layering`",
             "holds the sources to them. An arrow points to what a room uses; arrows that others imply are left out.",
             "The bindings for Python are in tools/python, above all rooms.", ""]
    for floor in FLOORS:
        rooms = {name: room for name, room in tree.rooms.items() if name.split("/")[0] == floor}
        lines += [f"## {floor}", "", "```mermaid", "graph BT"]
        short = {name: name[len(floor) + 1:].replace("/", "_") or floor for name in rooms}
        for name in rooms:
            lines.append(f"  {short[name]}[{name[len(floor) + 1:]}]")
        for name in rooms:
            lines += [f"  {short[name]} --> {short[other]}" for other in direct_uses(tree, name) if other in rooms]
        lines += ["```", "", "| room | contents | of other floors |", "| --- | --- | --- |"]
        for name, room in rooms.items():
            others = " ".join(other for other in room.uses if other not in rooms)
            lines.append(f"| {name} | {room.about} | {others} |")
        lines.append("")
    return "\n".join(lines)


class SelfTest(unittest.TestCase):
    """A tree without fault, and that tree with one fault of every kind."""

    FILES = {
        "excitation/CMakeLists.txt": "",
        "excitation/multisine/CMakeLists.txt":
            "# Room.\nstageid_room(excitation INSTALLED grid.hpp)",
        "excitation/multisine/grid.hpp": "#pragma once\n#include <Eigen/Core>\n#include <vector>\n",
        "excitation/multisine/grid.cpp": '#include "excitation/multisine/grid.hpp"\n#include <fftw3.h>\n',
        "hal/stage/CMakeLists.txt": "# Room.\nstageid_room(hal INSTALLED stage.hpp)",
        "hal/stage/stage.hpp": "#pragma once\n",
        "acquisition/CMakeLists.txt":
            "target_link_libraries(stageid_record PUBLIC stageid::excitation)\n"
            "target_link_libraries(stageid_acquisition PUBLIC stageid::record stageid::hal)\n",
        "acquisition/record/CMakeLists.txt":
            "# Room.\nstageid_room(record USES excitation/multisine INSTALLED log.hpp)\n",
        "acquisition/loop/CMakeLists.txt":
            "# Room.\nstageid_room(acquisition USES acquisition/record hal/stage INSTALLED loop.hpp)\n",
        "acquisition/record/log.hpp": '#pragma once\n#include "excitation/multisine/grid.hpp"\n',
        "acquisition/record/log.cpp": '#include "acquisition/record/detail.hpp"\n#include <nlohmann/json.hpp>\n',
        "acquisition/record/detail.hpp": "#pragma once\n",
        "acquisition/loop/loop.hpp":
            '#pragma once\n#include "acquisition/record/log.hpp"\n#include "hal/stage/stage.hpp"\n',
        "tests/acquisition/record/log_test.cpp": "",
        "tools/CMakeLists.txt": "target_link_libraries(stageid_tools PUBLIC stageid::acquisition)",
        "tools/main.cpp": '#include <CLI/CLI.hpp>\n#include "acquisition/loop/loop.hpp"\n',
    }

    PLANTED = {
        "hal/stage may not include excitation/multisine/grid.hpp":
            ("hal/stage/stage.hpp", '#pragma once\n#include "excitation/multisine/grid.hpp"\n'),
        "acquisition/record may not include acquisition/loop/loop.hpp":
            ("acquisition/record/log.hpp", '#pragma once\n  #  include "acquisition/loop/loop.hpp"\n'),
        "hal/stage: hal may not use acquisition/loop of acquisition":
            ("hal/stage/CMakeLists.txt", "# Room.\nstageid_room(hal USES acquisition/loop INSTALLED stage.hpp)"),
        "acquisition/record: USES excitation/multisine, but includes nothing of it":
            ("acquisition/record/log.hpp", "#pragma once\n"),
        "hal/stage: its CMakeLists.txt does not begin with a line":
            ("hal/stage/CMakeLists.txt", "stageid_room(hal INSTALLED stage.hpp)"),
        "which is not a room": ("hal/stage/CMakeLists.txt", "# Room.\nstageid_room(hal USES hal/attic INSTALLED stage.hpp)"),
        "in a circle: acquisition/loop, acquisition/record":
            ("acquisition/record/CMakeLists.txt",
             "# Room.\nstageid_room(record USES excitation/multisine acquisition/loop INSTALLED log.hpp)\n"),
        "<yaml-cpp/yaml.h> may be included by tools only":
            ("hal/stage/stage.hpp", "#pragma once\n#include <yaml-cpp/yaml.h>\n"),
        "<CLI/CLI.hpp> may be included by tools only":
            ("acquisition/record/log.cpp", "#include <CLI/CLI.hpp>\n"),
        "<fftw3.h> may be included by excitation only": ("tools/main.cpp", "#include <fftw3.h>\n"),
        "<hdf5.h> may be included by files only":
            ("acquisition/record/log.cpp", "#include <hdf5.h>\n"),
        "an installed header may not ask its users for <fmt/format.h>":
            ("excitation/multisine/grid.hpp", "#pragma once\n#include <fmt/format.h>\n"),
        "installed, but acquisition/record/detail.hpp is not":
            ("acquisition/record/log.hpp", '#pragma once\n#include "acquisition/record/detail.hpp"\n'),
        "our own header is written": ("tools/main.cpp", "#include <hal/stage/stage.hpp>\n"),
        "is not a header of ours": ("acquisition/loop/loop.hpp", '#pragma once\n#include "log.hpp"\n'),
        "does not include its tests": ("tools/main.cpp", '#include "tests/support/x.hpp"\n'),
        "no #pragma once": ("hal/stage/stage.hpp", "struct Stage {};\n"),
        "its folder is not a room": ("hal/attic/orphan.hpp", "#pragma once\n"),
        "belongs in tests/acquisition/record": ("tests/acquisition/log_test.cpp", ""),
        "stageid_hal: may not link stageid::record":
            ("hal/CMakeLists.txt", "target_link_libraries(stageid_hal PRIVATE stageid::record)"),
        "stageid_misfit: has no place":
            ("hal/CMakeLists.txt", "target_link_libraries(stageid_misfit PRIVATE fmt::fmt)"),
        "no folder 'utils'": ("hal/utils/notes.txt", ""),
        "docs/rooms.md: out of date": ("docs/rooms.md", "# Rooms\n"),
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
    tree_root = pathlib.Path(sys.argv[1]).resolve()
    if sys.argv[2:] == ["--draw"]:
        print(drawing(tree_root))
        sys.exit(0)
    found_here = faults(tree_root)
    print("\n".join(found_here))
    sys.exit(1 if found_here else 0)
