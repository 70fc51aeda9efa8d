#!/usr/bin/env python3
"""Runs every `stageid` command that README.md shows, in its order, in a folder of its own.

Only the measurement is shortened (see SHORTER), so that the test takes seconds: flags, files and
channels are those that the reader types. Usage: readme_test.py PROGRAM SOURCE_DIR WORK_DIR
"""

import pathlib
import re
import shlex
import shutil
import subprocess
import sys

# What is replaced in the main job's configuration: (pattern, replacement), each must occur.
SHORTER = [
    (r"(?m)^  axes: \[.*\]", "  axes: [z1, z4, z7, z13]"),
    (r"(?m)^  period_s: \d+", "  period_s: 1"),
    (r"(?m)^  band_hz: \[0.25, 2000\]", "  band_hz: [1, 2000]"),
]
# The script itself runs the job in full length; the tests run this one.
NOT_HERE = ("tools/quickstart", "tools/test")


def commands(text):
    for block in re.findall(r"```sh\n(.*?)```", text, re.DOTALL):
        for line in block.replace("\\\n", " ").splitlines():
            words = shlex.split(line, comments=True)
            if words and words[0] not in NOT_HERE:
                yield words


def prepare(source, work):
    """A copy of the configurations, the experiment's shortened, at the path the README names."""
    shutil.rmtree(work, ignore_errors=True)
    for folder in ("experiment", "stage"):
        shutil.copytree(source / "configs" / folder, work / "configs" / folder)
    path = work / "configs" / "experiment" / "wafer_stage_quick.yaml"
    text = path.read_text()
    for pattern, replacement in SHORTER:
        text, count = re.subn(pattern, replacement, text)
        if count != 1:
            sys.exit(f"{path.name}: '{pattern}' occurs {count} times, expected once")
    path.write_text(text)


def main():
    program, source, work = (pathlib.Path(argument).resolve() for argument in sys.argv[1:])
    prepare(source, work)
    listed = list(commands((source / "README.md").read_text()))
    if len(listed) < 5:
        sys.exit(f"README.md shows {len(listed)} commands; its pipeline has more")
    for words in listed:
        if words[0] != "stageid":
            sys.exit(f"README.md: '{shlex.join(words)}' is not a command of ours")
        done = subprocess.run([program, *words[1:]], cwd=work, capture_output=True, text=True)
        print(f"$ {shlex.join(words)}\n{done.stdout}{done.stderr}", flush=True)
        if done.returncode != 0:
            sys.exit(f"'{shlex.join(words)}' ended with status {done.returncode}")
        output = words[words.index("-o") + 1] if "-o" in words else None
        if output and not (work / output).stat().st_size > 0:
            sys.exit(f"'{shlex.join(words)}' wrote nothing to {output}")


if __name__ == "__main__":
    main()
