#!/usr/bin/python3
"""The packages hold what they should, and it works from where they put it.

    package_test.py BUILD_DIR SOURCE_DIR VERSION WORK_DIR
"""

import base64
import csv
import hashlib
import json
import pathlib
import re
import shutil
import subprocess
import sys
import unittest
import zipfile

BUILD, SOURCE, WORK = (pathlib.Path(sys.argv[i]).resolve() for i in (1, 2, 4))
VERSION = sys.argv[3]
CONFIG = SOURCE / "configs/experiment/small_stage.yaml"

USE = f"import stageid; print(stageid.__file__, stageid.__version__, len(stageid.simulate({str(CONFIG)!r})))"


def output(*words, **options):
    """What a command prints; the test fails if the command does."""
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, **options)
    if done.returncode != 0:
        raise AssertionError(f"{words}: {done.stdout}{done.stderr}")
    return done.stdout


def setUpModule():
    shutil.rmtree(WORK, ignore_errors=True)
    WORK.mkdir(parents=True)


class BillOfMaterials(unittest.TestCase):
    def test_it_lists_what_the_program_is_made_of(self):
        program, file = BUILD / "tools/stageid", WORK / "stageid.spdx.json"
        output("/usr/bin/python3", SOURCE / "tools/package/sbom.py", program, BUILD, VERSION, file)
        document = json.loads(file.read_text())
        packages = {package["name"]: package for package in document["packages"]}
        kinds = {packages[name]["SPDXID"]: name for name in packages}
        relations = {kinds.get(r["relatedSpdxElement"]): r["relationshipType"] for r in document["relationships"]}
        self.assertEqual(relations["libfftw3-double3"], "DYNAMIC_LINK")
        self.assertIn("GPL-2+", packages["libfftw3-double3"]["licenseComments"])
        for header_only in ("libeigen3-dev", "nlohmann-json3-dev", "libcli11-dev", "libutfcpp-dev"):
            self.assertEqual(relations[header_only], "CONTAINS")
            self.assertEqual(packages[header_only]["versionInfo"], output("dpkg-query", "-W", "-f", "${Version}", header_only))
        self.assertNotIn("libgtest-dev", packages)
        digest = hashlib.sha256(program.read_bytes()).hexdigest()
        self.assertEqual(packages["stageid"]["checksums"], [{"algorithm": "SHA256", "checksumValue": digest}])
        identifiers = [package["SPDXID"] for package in document["packages"]]
        self.assertEqual(len(identifiers), len(set(identifiers)))

    def test_the_program_does_not_contain_its_folder(self):
        self.assertNotIn(str(SOURCE).encode(), (BUILD / "tools/stageid").read_bytes())


class Wheel(unittest.TestCase):
    def pack(self, folder):
        folder.mkdir()
        package = SOURCE / "tools/package"
        return pathlib.Path(output(package / "wheel.py", BUILD / "tools/python/stageid", VERSION, folder, "--licence",
                                   package / "copyright", "--readme", SOURCE / "docs/python.md",
                                   "--strip", "strip").strip())

    def test_it_installs_into_an_empty_environment(self):
        wheel = self.pack(WORK / "wheel")
        self.assertEqual(wheel.read_bytes(), self.pack(WORK / "again").read_bytes())
        # Debian's numpy only.
        output("/usr/bin/python3", "-m", "venv", "--system-site-packages", WORK / "venv")
        python = WORK / "venv/bin/python"
        output(python, "-m", "pip", "install", "--no-deps", "--no-index", wheel)
        place, version, runs = output(python, "-I", "-c", USE).split()
        self.assertTrue(place.startswith(str(WORK / "venv")), place)
        self.assertEqual((version, runs), (VERSION, "9"))
        self.assertIn("stageid", output(python, "-m", "pip", "show", "stageid"))
        output(python, "-m", "pip", "uninstall", "-y", "stageid")
        self.assertFalse(pathlib.Path(place).exists())

    def test_its_record(self):
        """Every file with its size and hash, as an installer may check them."""
        with zipfile.ZipFile(self.pack(WORK / "record")) as archive:
            self.assertIsNone(archive.testzip())
            info = f"stageid-{VERSION}.dist-info"
            rows = list(csv.reader(archive.read(f"{info}/RECORD").decode().splitlines()))
            self.assertEqual([row[0] for row in rows], archive.namelist())
            self.assertEqual(rows.pop(), [f"{info}/RECORD", "", ""])
            for name, digest, size in rows:
                content = archive.read(name)
                value = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).decode().rstrip("=")
                self.assertEqual((digest, int(size)), (f"sha256={value}", len(content)))

    def test_it_is_typed(self):
        with zipfile.ZipFile(self.pack(WORK / "typed")) as archive:
            self.assertIn("stageid/py.typed", archive.namelist())
            self.assertIn("stageid/__init__.pyi", archive.namelist())
            self.assertIn("stageid/_results.py", archive.namelist())

    def test_without_the_compiled_part(self):
        (WORK / "empty").mkdir()
        done = subprocess.run([SOURCE / "tools/package/wheel.py", WORK / "empty", VERSION, WORK, "--licence",
                               CONFIG, "--readme", CONFIG], capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn("build the target stageid_python first", done.stderr)


class Debian(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        output("cpack", "--config", BUILD / "CPackConfig.cmake", "-B", WORK / "deb")
        cls.packages = {file.name.split("_")[0]: file for file in (WORK / "deb").glob("*.deb")}
        cls.root = WORK / "root"
        for file in cls.packages.values():
            output("dpkg-deb", "-x", file, cls.root)

    def field(self, package, name):
        return output("dpkg-deb", "-f", self.packages[package], name).strip()

    def test_there_are_three(self):
        mpi = {"stageid-mpi"} if (BUILD / "tools/stageid-mpi").exists() else set()
        self.assertEqual(set(self.packages), {"stageid", "python3-stageid", "libstageid-dev"} | mpi)
        for package in self.packages:
            self.assertEqual(self.field(package, "Version"), f"{VERSION}-1")
            self.assertTrue((self.root / "usr/share/doc" / package / "copyright").is_file())

    def test_dependencies_are_those_of_the_libraries(self):
        for package in ("stageid", "python3-stageid"):
            depends = self.field(package, "Depends")
            for library in ("libc6", "libfftw3", "libhdf5", "libmodbus", "libzmq5", "libyaml-cpp", "libmatio"):
                self.assertRegex(depends, rf"\b{re.escape(library)}")
        self.assertIn("python3-numpy", self.field("python3-stageid", "Depends"))
        self.assertIn("libeigen3-dev", self.field("libstageid-dev", "Depends"))

    @unittest.skipUnless(shutil.which("lintian"), "no lintian here")
    def test_lintian_has_nothing_to_say(self):
        # The suppressed warning concerns uploads to Debian's own archive.
        said = output("lintian", "--allow-root", "--suppress-tags", "initial-upload-closes-no-bugs", *self.packages.values())
        self.assertEqual(said, "")

    def test_completions_are_where_the_shells_look(self):
        for place in ("bash-completion/completions/stageid", "zsh/vendor-completions/_stageid"):
            self.assertTrue((self.root / "usr/share" / place).is_file(), place)

    def test_the_program_works(self):
        program = self.root / "usr/bin/stageid"
        self.assertIn(VERSION, output(program, "--version"))
        self.assertTrue((self.root / "usr/share/man/man1/stageid.1.gz").is_file())
        config = self.root / "usr/share/stageid/configs/experiment/small_stage.yaml"
        output(program, "design", config, "-o", WORK / "excitation.h5")

    def test_the_python_package_works(self):
        packages = self.root / "usr/lib/python3/dist-packages"
        place, version, runs = output("/usr/bin/python3", "-c", USE, env={"PYTHONPATH": str(packages)}).split()
        self.assertTrue(place.startswith(str(packages)), place)
        self.assertEqual((version, runs), (VERSION, "9"))

    def test_the_program_and_the_module_are_hardened(self):
        program = self.root / "usr/bin/stageid"
        self.assertIn("Position-Independent Executable", output("readelf", "-h", program))
        for file in (program, *self.root.rglob("_native*.so")):
            segments = output("readelf", "-dlW", file)
            self.assertIn("GNU_RELRO", segments)
            self.assertIn("BIND_NOW", segments)
            self.assertRegex(segments, r"GNU_STACK .* RW  ")  # not executable
            symbols = output("readelf", "--dyn-syms", "-W", file)
            self.assertIn("__stack_chk_fail", symbols)
            self.assertRegex(symbols, r"__(memcpy|memmove|read|snprintf|vsnprintf|fprintf|printf)_chk")

    def test_no_place_of_this_machine_is_in_it(self):
        for file in self.root.rglob("*"):
            if file.is_file() and not file.is_symlink() and file.suffix != ".a":
                self.assertNotIn(str(BUILD).encode(), file.read_bytes(), file)


if __name__ == "__main__":
    sys.argv = sys.argv[:1] + sys.argv[5:]
    unittest.main()
