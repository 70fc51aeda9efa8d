"""The commands of stageid that write a file, for tests in which the system fails. "OUT.x" is the output."""

import shutil
import subprocess

EXPERIMENT = "configs/experiment/small_stage_pilot.yaml"
COMMANDS = {
    "run": ["run", EXPERIMENT, "-o", "OUT.slog"],
    "recover": ["log", "recover", "run.slog", "-o", "OUT.slog"],
    "to HDF5": ["log", "convert", "run.slog", "-o", "OUT.h5"],
    "to MATLAB": ["log", "convert", "run.slog", "-o", "OUT.mat"],
    "to MATLAB 7.3": ["log", "convert", "run.slog", "-o", "OUT.mat", "--mat-version", "7.3"],
    "to CSV": ["log", "convert", "run.slog", "-o", "OUT.csv"],
    "design": ["design", EXPERIMENT, "-o", "OUT.h5"],
    "frf": ["frf", "run.slog", "-o", "OUT.h5"],
    "modes": ["modes", "frf.h5", "-o", "OUT.json"],
    "fit": ["fit", "frf.h5", "--modes", "4", "-o", "OUT.json"],
    "model to HDF5": ["export", "model.json", "-o", "OUT.h5"],
    "model to .m": ["export", "model.json", "-o", "OUT.m"],
    "FRF to MATLAB": ["export", "frf.h5", "-o", "OUT.mat"],
    "FRF to .npz": ["export", "frf.h5", "-o", "OUT.npz"],
    "FRF to CSV": ["export", "frf.h5", "-o", "OUT.csv"],
    "FRF to UFF": ["export", "frf.h5", "-o", "OUT.uff"],
    "import": ["import", "table.csv", "-o", "OUT.h5"],
    "report": ["report", "model.json", "frf.h5", "-o", "OUT.html"],
}


def prepare(program, configs, work):
    """A new folder with the inputs of all commands, in which they run; outputs go to out/o.x."""
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    shutil.copytree(configs, work / "configs")
    for arguments in (["identify", EXPERIMENT, "-o", "."], ["export", "frf.h5", "-o", "table.csv"]):
        subprocess.run([program, *arguments], cwd=work, check=False, capture_output=True)


def words(name):
    """The arguments of a command."""
    return [word.replace("OUT", "out/o") for word in COMMANDS[name]]
