#!/usr/bin/env python3
"""Runs every command that README.md and docs/ show in blocks of `sh`, as it stands and in its order, each
page in a folder of its own; `# exit code N` behind a command is what it is to end with, else 0. A block of
`yaml` that begins with the first line of a file in configs/import must be that file, and what the prose says
in backticks about a command may only use flags that the command has.

    docs_test.py PROGRAM SOURCE_DIR WORK_DIR
"""

import pathlib
import re
import shlex
import shutil
import subprocess
import sys

# The first takes as long as the main job; the second runs this test.
NOT_HERE = ("tools/quickstart", "tools/test")
EXIT_CODE = re.compile(r"# exit code (\d+)\s*$")
# Required content, so that an emptied page is noticed.
LEAST_COMMANDS = {"README.md": 5, "docs/guide.md": 30, "docs/exchange.md": 5}


def blocks(text, language):
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def commands(text):
    """(words, exit code) of every command of a page."""
    for block in blocks(text, "sh"):
        for line in block.replace("\\\n", " ").splitlines():
            words = shlex.split(line, comments=True)
            if words and words[0] not in NOT_HERE:
                code = EXIT_CODE.search(line)
                yield words, int(code.group(1)) if code else 0


def run_page(name, text, program, work):
    listed = list(commands(text))
    if len(listed) < LEAST_COMMANDS.get(name, 0):
        sys.exit(f"{name} shows {len(listed)} commands; it had {LEAST_COMMANDS[name]} and more")
    for words, wanted in listed:
        shown = shlex.join(words)
        if words[0] != "stageid":
            sys.exit(f"{name}: '{shown}' is not a command of ours")
        done = subprocess.run([program, *words[1:]], cwd=work, capture_output=True, text=True)
        print(f"$ {shown}\n{done.stdout}{done.stderr}", flush=True)
        if done.returncode != wanted:
            sys.exit(f"{name}: '{shown}' ended with status {done.returncode}, not {wanted}")
        output = words[words.index("-o") + 1] if "-o" in words else None
        if output and not (work / output).stat().st_size > 0:
            sys.exit(f"{name}: '{shown}' wrote nothing to {output}")


def check_maps(name, text, source):
    maps = {path: path.read_text() for path in sorted((source / "configs/import").glob("*.yaml"))}
    for block in blocks(text, "yaml"):
        for path, content in maps.items():
            if block.splitlines()[0] == content.splitlines()[0] and block != content:
                sys.exit(f"{name}: the block of yaml differs from {path.relative_to(source)}")


class Flags:
    """The flags of every command, as its --help tells."""

    def __init__(self, program):
        self.program = program
        self.commands = set(re.findall(r"^  ([a-z]+) ", self.help().split("Subcommands:")[1], re.MULTILINE))

    def help(self, *words):
        return subprocess.run([self.program, *words, "--help"], capture_output=True, text=True, check=True).stdout

    def of(self, command):
        text = self.help() + self.help(command)
        nested = text.split("Subcommands:")[-1] if command in ("log", "config") else ""
        for sub in re.findall(r"^  ([a-z]+) ", nested, re.MULTILINE):
            text += self.help(command, sub)
        return set(re.findall(r"--[a-z][a-z-]*", text))


def check_flags(name, text, flags):
    known = {}
    for quoted in re.findall(r"`([^`\n]+)`", text):
        words = quoted.removeprefix("stageid ").split()
        if not words or words[0] not in flags.commands:
            continue
        if words[0] not in known:
            known[words[0]] = flags.of(words[0])
        for flag in re.findall(r"(?<![\w-])--[a-z][a-z-]*", quoted):
            if flag not in known[words[0]]:
                sys.exit(f"{name}: `{quoted}`: {words[0]} has no {flag}")


def main():
    program, source, work = (pathlib.Path(argument).resolve() for argument in sys.argv[1:])
    shutil.rmtree(work, ignore_errors=True)
    flags = Flags(program)
    for path in [source / "README.md", *sorted((source / "docs").rglob("*.md"))]:
        name = str(path.relative_to(source))
        text = path.read_text()
        folder = work / name.removesuffix(".md")
        shutil.copytree(source / "configs", folder / "configs")
        run_page(name, text, program, folder)
        check_maps(name, text, source)
        check_flags(name, text, flags)


if __name__ == "__main__":
    main()
