#!/usr/bin/env python3
"""Runs every `stageid` command that README.md shows, as it stands and in its order, in a folder of
its own. Usage: readme_test.py PROGRAM SOURCE_DIR WORK_DIR
"""

import pathlib
import re
import shlex
import shutil
import subprocess
import sys

# One takes the main job's time, the other is what runs this test.
NOT_HERE = ("tools/quickstart", "tools/test")


def commands(text):
    for block in re.findall(r"```sh\n(.*?)```", text, re.DOTALL):
        for line in block.replace("\\\n", " ").splitlines():
            words = shlex.split(line, comments=True)
            if words and words[0] not in NOT_HERE:
                yield words


def main():
    program, source, work = (pathlib.Path(argument).resolve() for argument in sys.argv[1:])
    shutil.rmtree(work, ignore_errors=True)
    shutil.copytree(source / "configs", work / "configs")
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
