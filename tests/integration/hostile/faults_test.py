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

from commands import COMMANDS, prepare, words

PROGRAM, CONFIGS, SHIM, WORK = (pathlib.Path(argument).resolve() for argument in sys.argv[1:5])
CALLS = int(sys.argv[5])
ONLY = sys.argv[6] if len(sys.argv) > 6 else ""
FAULTS = {"write": (errno.EIO, errno.ENOSPC), "fsync": (errno.EIO,), "rename": (errno.EIO,), "close": (errno.EIO,),
          "read": (errno.EIO,), "thread": (errno.EAGAIN,)}


def run(name, **environment):
    shutil.rmtree(WORK / "out", ignore_errors=True)
    (WORK / "out").mkdir()
    done = subprocess.run([PROGRAM, *words(name)], capture_output=True, text=True, errors="replace", cwd=WORK, check=False,
                          timeout=120, env=os.environ | environment)
    files = {}  # the bytes of logs contain the time, so they are compared by what `log verify` says
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
    prepare(PROGRAM, CONFIGS, WORK)
    failures, points = [], 0
    for name in COMMANDS:
        plain = run(name)
        if plain[0] not in (0, 3):
            sys.exit(f"{name}: {plain[1]}")
        for function, errors in FAULTS.items() if not ONLY else [(ONLY, (errno.EIO,))]:
            count = WORK / "count"
            run(name, LD_PRELOAD=str(SHIM), STAGEID_FAULT=f"{function}:0:5", STAGEID_FAULT_COUNT=str(count))
            calls = int(count.read_text())
            for call in sorted({1 + k * calls // CALLS for k in range(CALLS) if calls > 0}):
                for error in errors if call < 4 else errors[:1]:
                    points += 1
                    faulty = run(name, LD_PRELOAD=str(SHIM), STAGEID_FAULT=f"{function}:{call}:{error}")
                    if what := problem(name, plain, faulty):
                        failures.append(f"{name}, {function} {call} of {calls}: {what}: {faulty[1][-200:]}")
    print(f"{points} faults in {len(COMMANDS)} commands, {len(failures)} failures")
    print("\n".join(failures))
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
