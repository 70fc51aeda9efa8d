"""What the tests of the Python package share: their arguments, and one experiment by the program.

    SCRIPT PROGRAM PACKAGE_DIR CONFIG WORK_DIR
"""

import pathlib
import shutil
import subprocess
import sys
import unittest

PROGRAM, PACKAGES, CONFIG, WORK = (pathlib.Path(argument).resolve() for argument in sys.argv[1:5])
sys.path.insert(0, str(PACKAGES))


def program(*words):
    """Runs a command of the program in WORK; its exit code."""
    done = subprocess.run([PROGRAM, *map(str, words)], cwd=WORK, capture_output=True, text=True)
    assert done.returncode in (0, 3), done.stderr
    return done.returncode


def setUpModule():
    """run.slog, run.h5, frf.h5 and model.json as the program makes them."""
    shutil.rmtree(WORK, ignore_errors=True)
    WORK.mkdir(parents=True)
    program("run", CONFIG, "-o", "run.slog")
    program("log", "convert", "run.slog", "-o", "run.h5")
    program("frf", "run.slog", "-o", "frf.h5")
    program("fit", "frf.h5", "-o", "model.json", "--band", "120", "800")


class Case(unittest.TestCase):
    """A test of the package with the log, the response and the model of the program, each read again."""

    def setUp(self):
        import stageid
        self.log = stageid.read_log(WORK / "run.slog")
        self.frf = stageid.read_frf(WORK / "frf.h5")
        self.model = stageid.read_model(WORK / "model.json")


def file_bytes(result):
    """The content of the file that a response or a model is written as."""
    import stageid
    file = WORK / ("written.h5" if isinstance(result, stageid.Frf) else "written.json")
    if file.suffix == ".h5":
        stageid.write_frf(file, result)
    else:
        result.save(file)
    return file.read_bytes()


def run_tests():
    sys.argv = sys.argv[:1] + sys.argv[5:]
    unittest.main()
