#!/usr/bin/python3
"""stageid-mpi with any number of processes: the files, output and exit codes of stageid; errors told once.

    mpi_test.py PROGRAM MPI_PROGRAM CONFIGS WORK_DIR

Exit code 77 (skipped) when MPI is not installed, or mpirun cannot start processes.
"""

import concurrent.futures
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import time
import unittest

import numpy as np

sys.path.append(str(pathlib.Path(__file__).resolve().parents[1] / "support"))
from frf_file import write_frf  # noqa: E402

PROGRAM, MPI_PROGRAM, CONFIGS, WORK = (argument and pathlib.Path(argument).resolve() for argument in sys.argv[1:5])
# Processes that wait let others run, even where Open MPI does not know that all cores are busy.
MPIRUN = ["mpirun", "--quiet", "--allow-run-as-root", "--oversubscribe", "--mca", "mpi_yield_when_idle", "1"]
TEAMS = (8, 4, 3, 2, 1)  # the slowest first
# In order: each uses the output of the previous ones.
COMMANDS = {
    "frf.h5": ["frf", "../run.slog", "--realizations", "1,2"],
    "held.h5": ["frf", "../run.slog", "--realizations", "3"],
    "lpm.h5": ["frf", "../run.slog", "--method", "lpm"],
    "modes.json": ["modes", "frf.h5"],
    "model.json": ["fit", "frf.h5", "--direct-term", "full"],
    "rank.json": ["fit", "frf.h5", "--residue-rank", "1", "--band", "120", "800"],
    "wide.json": ["fit", "../wide.h5"],
    "wide_general.json": ["fit", "../wide.h5", "--modes", "3", "--damping", "general"],
    "wide_exact.json": ["fit", "../exact.h5", "--modes", "3"],
    "wide_given.json": ["fit", "../wide.h5", "--modes", "20,41,73", "--band", "10", "90"],
    "wide_realizations.json": ["fit", "../realizations.h5", "--modes", "20,41,73"],
    "narrow.json": ["fit", "../narrow.h5", "--modes", "20,41,73"],
}
# One tile; several, with realizations; without variances; a model of some channels, and of another stage.
VALIDATIONS = (("model.json", "held.h5"), ("wide.json", "../realizations.h5"), ("wide_given.json", "../exact.h5"),
               ("narrow.json", "../wide.h5"))


def write_wide_frf(path, noise, outputs=390, lines=80, realizations=0):
    """By default more channels than three tiles of 256, of two inputs."""
    random = np.random.default_rng(1)
    frequency_hz = np.linspace(5.0, 100.0, lines)
    s = 2j * np.pi * frequency_hz
    response = np.zeros((lines, outputs, 2), complex)
    for f, zeta in ((20.0, 0.02), (41.0, 0.01), (73.0, 0.015)):
        w = 2 * np.pi * f
        residue = np.outer(random.standard_normal(outputs), random.standard_normal(2))
        response += residue / (w**2 + 2 * zeta * w * s + s**2)[:, None, None]
    scale = noise * np.sqrt(np.mean(np.abs(response) ** 2))
    response += scale * (random.standard_normal(response.shape) + 1j * random.standard_normal(response.shape)) / np.sqrt(2)
    variance = np.full(response.shape, scale**2) if noise > 0 else None
    several = {"datasets": {"total_variance": 1.5 * variance}, "realizations": realizations, "noise_dof": 8.0,
               "total_dof": realizations - 1.0} if realizations > 0 else {}
    write_frf(path, frequency_hz, response, variance, **several)


# Of the largest process that a command has started.
PEAK = "import resource, subprocess, sys\n" \
    "subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)\n" \
    "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024)"


def call(words, folder, processes=0):
    start = [*MPIRUN, "-n", str(processes), MPI_PROGRAM] if processes else [PROGRAM]
    return subprocess.run([*start, *map(str, words)], cwd=folder, capture_output=True, text=True, timeout=600)


def without_times(output):
    return re.sub(r"[\d.]+ MB of samples in [^\n]*|[\d.]+ s\b", "", output)


def errors(done):
    return re.findall(r"^stageid: .*$", done.stderr, re.MULTILINE)


def setUpModule():
    shutil.rmtree(WORK, ignore_errors=True)
    WORK.mkdir(parents=True)
    if not MPI_PROGRAM or shutil.which("mpirun") is None:
        print("skipped: MPI is not installed; apt-get install libopenmpi-dev openmpi-bin")
        sys.exit(77)
    probe = subprocess.run([*MPIRUN, "-n", "2", "true"], capture_output=True, text=True)
    if probe.returncode != 0:
        print(f"skipped: mpirun does not start here: {probe.stderr}")
        sys.exit(77)
    subprocess.run([PROGRAM, "run", CONFIGS / "experiment/small_stage.yaml", "-o", "run.slog"], cwd=WORK, check=True,
                   capture_output=True)
    write_wide_frf(WORK / "wide.h5", 1e-3)
    write_wide_frf(WORK / "exact.h5", 0.0)
    write_wide_frf(WORK / "realizations.h5", 1e-3, realizations=4)
    write_wide_frf(WORK / "narrow.h5", 1e-3, outputs=3)


class SameResults(unittest.TestCase):
    def run_all(self, processes):
        folder = WORK / f"of_{processes}"
        folder.mkdir()
        said = {}
        for output, words in COMMANDS.items():
            done = call([*words, "-o", output], folder, processes)
            self.assertIn(done.returncode, (0, 3), f"{words}: {done.stderr}")
            said[output] = done.returncode, without_times(done.stdout)
        for model, data in VALIDATIONS:
            done = call(["--json", "validate", model, data], folder, processes)
            said[model, data] = done.returncode, json.loads(done.stdout)
        return folder, said

    def test_any_number_of_processes_gives_the_files_and_the_output_of_one(self):
        folder, said = self.run_all(0)
        with concurrent.futures.ThreadPoolExecutor(3) as pool:  # processes wait for messages most of the time
            teams = list(pool.map(self.run_all, TEAMS))
        for processes, (of_team, said_by_team) in zip(TEAMS, teams):
            for output in COMMANDS:
                with self.subTest(processes=processes, output=output):
                    self.assertEqual((of_team / output).read_bytes(), (folder / output).read_bytes())
            self.assertEqual(said_by_team, said)


class Memory(unittest.TestCase):
    def test_a_process_of_many_has_only_its_part_of_the_data(self):
        lines, outputs = 1200, 8 * 256
        write_wide_frf(WORK / "large.h5", 1e-3, outputs, lines)
        fit = [MPI_PROGRAM, "fit", "large.h5", "--modes", "20,41,73", "--threads", "1", "-o", "large.json"]
        peak = {}
        models = {}
        for processes in (1, 4):
            command = [sys.executable, "-c", PEAK, *MPIRUN, "-n", str(processes), *fit]
            done = subprocess.run(list(map(str, command)), cwd=WORK, check=True, capture_output=True, text=True)
            peak[processes] = int(done.stdout)
            models[processes] = (WORK / "large.json").read_bytes()
        self.assertEqual(models[4], models[1])
        # Response, variance and weights.
        self.assertLess(peak[4], peak[1] - 0.5 * 32 * lines * 2 * outputs)


class Failures(unittest.TestCase):
    def test_an_error_of_all_is_told_once_with_its_exit_code(self):
        for words in (["fit", "none.h5", "-o", "x.json"], ["fit", "wide.h5"], ["frobnicate"]):
            alone = call(words, WORK)
            done = call(words, WORK, 3)
            self.assertEqual((done.returncode, errors(done)), (alone.returncode, errors(alone)), words)

    def test_other_commands_are_refused(self):
        done = call(["run", CONFIGS / "experiment/small_stage.yaml", "-o", "y.slog"], WORK, 2)
        self.assertEqual(done.returncode, 2)
        self.assertIn("cannot be divided", done.stderr)
        self.assertFalse((WORK / "y.slog").exists())

    def test_an_error_of_one_process_ends_all(self):
        fit = [MPI_PROGRAM, "fit", "wide.h5", "-o", "z.json"]
        broken = [MPI_PROGRAM, "fit", "none.h5", "-o", "z.json"]
        for words in (["-n", "2", *fit, ":", "-n", "1", *broken], ["-n", "1", *broken, ":", "-n", "2", *fit]):
            done = subprocess.run([*MPIRUN, *words], cwd=WORK, capture_output=True, text=True, timeout=60)
            self.assertEqual(done.returncode, 1, done.stderr)
            self.assertEqual(len(errors(done)), 1, done.stderr)
            self.assertIn("none.h5", errors(done)[0])
            self.assertFalse((WORK / "z.json").exists())

    def test_a_killed_process_ends_all_and_leaves_no_file(self):
        process = subprocess.Popen([*MPIRUN, "-n", "3", MPI_PROGRAM, "fit", "wide.h5", "-o", "killed.json"], cwd=WORK,
                                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        ranks = []
        while len(ranks) < 3 and process.poll() is None:
            time.sleep(0.01)
            listed = subprocess.run(["pgrep", "-P", str(process.pid)], capture_output=True, text=True)
            ranks = [int(pid) for pid in listed.stdout.split()]
        os.kill(ranks[-1], signal.SIGKILL)
        self.assertNotEqual(process.wait(60), 0)
        self.assertFalse((WORK / "killed.json").exists())


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
