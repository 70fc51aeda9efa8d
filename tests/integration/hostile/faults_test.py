#!/usr/bin/python3
"""One call of the operating system fails in each run of a command: it ends with exit code 1 and one line, or as without
the fault and with the same bytes. Nothing half-written is left.

    faults_test.py PROGRAM CONFIGS SHIM WORK_DIR CALLS [FUNCTION]
CALLS: how many calls of a function fail per command, spread over all of them
FUNCTION: only this one; also malloc and mmap, which the test leaves out because libraries end the program
"""

import errno
import os
import pathlib
import re
import shutil
import subprocess
import sys

PROGRAM, CONFIGS, SHIM, WORK = (pathlib.Path(argument).resolve() for argument in sys.argv[1:5])
CALLS = int(sys.argv[5])
ONLY = sys.argv[6] if len(sys.argv) > 6 else ""
EXPERIMENT = "configs/experiment/small_stage_pilot.yaml"

# "OUT.x" is the output. The bytes of logs contain the time, so they are compared by what `log verify` says.
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
FAULTS = {"write": (errno.EIO, errno.ENOSPC), "fsync": (errno.EIO,), "rename": (errno.EIO,), "close": (errno.EIO,),
          "read": (errno.EIO,), "thread": (errno.EAGAIN,)}


def run(arguments, **environment):
    shutil.rmtree(WORK / "out", ignore_errors=True)
    (WORK / "out").mkdir()
    words = [PROGRAM, *(word.replace("OUT", "out/o") for word in arguments)]
    done = subprocess.run(words, capture_output=True, text=True, errors="replace", cwd=WORK, check=False, timeout=120,
                          env=os.environ | environment)
    files = {}
    for file in (WORK / "out").iterdir():
        if file.suffix == ".slog":
            content = subprocess.run([PROGRAM, "log", "verify", file], capture_output=True, check=False)
            files[file.name] = content.returncode
        elif not file.name.endswith(".jsonl"):
            files[file.name] = file.read_bytes()
    return done.returncode, done.stderr.strip(), files


def problem(name, plain, faulty):
    (code, _, files), (new_code, said, new_files) = plain, faulty
    if new_code == code:
        return "" if new_files == files else "same exit code, other files"
    if new_code not in (1, 2):
        return f"exit code {new_code}"
    if not re.match("stageid: .*: ", said.splitlines()[-1] if said else ""):
        return "no message"
    if re.search(r"a bug in stageid|basic_|json\.exception|terminate", said):
        return "not told in plain words"
    left = {file: content for file, content in new_files.items() if content != files.get(file)}
    return "" if not left or name == "run" else "half-written: " + ", ".join(left)


def main():
    shutil.rmtree(WORK, ignore_errors=True)
    WORK.mkdir(parents=True)
    shutil.copytree(CONFIGS, WORK / "configs")
    for arguments in (["identify", EXPERIMENT, "-o", "."], ["export", "frf.h5", "-o", "table.csv"]):
        subprocess.run([PROGRAM, *arguments], cwd=WORK, check=False, capture_output=True)
    failures, points = [], 0
    for name, arguments in COMMANDS.items():
        plain = run(arguments)
        if plain[0] not in (0, 3):
            sys.exit(f"{name}: {plain[1]}")
        for function, errors in FAULTS.items() if not ONLY else [(ONLY, (errno.EIO,))]:
            count = WORK / "count"
            run(arguments, LD_PRELOAD=str(SHIM), STAGEID_FAULT=f"{function}:0:5", STAGEID_FAULT_COUNT=str(count))
            calls = int(count.read_text())
            for call in sorted({1 + k * calls // CALLS for k in range(CALLS) if calls > 0}):
                for error in errors if call < 4 else errors[:1]:
                    points += 1
                    faulty = run(arguments, LD_PRELOAD=str(SHIM), STAGEID_FAULT=f"{function}:{call}:{error}")
                    if what := problem(name, plain, faulty):
                        failures.append(f"{name}, {function} {call} of {calls}: {what}: {faulty[1][-200:]}")
    print(f"{points} faults in {len(COMMANDS)} commands, {len(failures)} failures")
    print("\n".join(failures))
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
