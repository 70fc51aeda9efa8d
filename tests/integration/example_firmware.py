"""The nodes of docs/examples/firmware, built outside the tree, and what is true of their stage."""
import re
import shutil
import subprocess

FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O2"]
MODBUS = ["modbus_tcp_node.c", "stage_node.c", "stage_limits.c"]
CAN = ["can_frame.c", "can_node.c", "can_resident.c", "stage_limits.c"]
LARGEST_ERROR = 1e-4  # of a measured frequency


class ExampleFirmware:
    """A copy of the examples in a folder."""

    def __init__(self, source, folder):
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(source / "docs/examples/firmware", folder)
        self.folder = folder

    def build(self, name, sources, *options, plant="stage_plant.c"):
        files = map(str, (*sources, plant))
        subprocess.run(["cc", *FLAGS, "-I.", "-o", name, *files, *options, "-lm"], cwd=self.folder, check=True)

    def check_modes(self, test, found_hz):
        """`found_hz`: of a fit."""
        text = (self.folder / "stage_plant.c").read_text()
        true_hz = [float(hz) for hz in re.findall(r"\{(\d+\.\d+), 0\.\d+, \{", text)]
        test.assertEqual(len(true_hz), 5)
        test.assertEqual(len(found_hz), 5, found_hz)
        for expected, measured in zip(sorted(true_hz), sorted(found_hz)):
            test.assertLess(abs(measured / expected - 1.0), LARGEST_ERROR)
