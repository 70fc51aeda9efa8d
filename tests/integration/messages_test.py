#!/usr/bin/python3
"""Every command of messages_cases.py goes wrong, or ends with doubts, with exactly the exit code and the messages
that messages.txt contains. That file is also for reading: is each message clear to someone who sees only it?

    messages_test.py PROGRAM SOURCE_DIR [--update]

--update writes messages.txt anew; review its changes with git diff.
"""

import concurrent.futures
import difflib
import os
import pathlib
import re
import resource
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile

import messages_cases
import messages_files

GOLDEN = "tests/integration/messages.txt"
HEADER = """\
# Messages

What stageid prints on stderr when a command goes wrong. messages_test.py runs the commands and compares;
`messages_test.py PROGRAM SOURCE_DIR --update` writes this file. FOLDER is the folder in which a command runs.
Where a result depends on rounding, its numbers are shown as ~.
"""
UNPRIVILEGED = 65534  # nobody: the permissions of a file do not bind root
WORDS = re.compile(r"[\w./-]+")


def become_nobody():
    os.setgroups([])
    os.setgid(UNPRIVILEGED)
    os.setuid(UNPRIVILEGED)


def limiter(case):
    """What the process does before it becomes the program, or None."""
    if case.read_only and os.getuid() == 0:
        return become_nobody
    if case.file_bytes is None:
        return None

    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (case.file_bytes, case.file_bytes))

    return limit


def nobody_can_run(program):
    """Where it cannot, root cannot test permissions."""
    try:
        done = subprocess.run([program, "--version"], capture_output=True, preexec_fn=become_nobody)
    except OSError:
        return False
    return done.returncode == 0


def one_line(text):
    return text.strip("\n").replace("\n", "; ")


class Runner:
    def __init__(self, program, source, work):
        self.program, self.source, self.work = program, source, work
        (work / "files").mkdir()
        self.files = messages_files.Files(program, source, work / "files")
        for case in messages_cases.CASES:  # one after the other: they build on each other
            for name in self.needed(case):
                self.files.path(name)

    @staticmethod
    def needed(case):
        return sorted(set(WORDS.findall(" ".join((case.command, *case.needs)))) & messages_files.names())

    def prepare(self, case, folder):
        shutil.copytree(self.source / "configs", folder / "configs")
        for name in self.needed(case):
            messages_files.copy(self.files, name, folder)
        for name, (old, new) in case.edits:
            original = folder / messages_cases.ORIGINALS[name]
            text = original.read_text()
            if old not in text:
                raise SystemExit(f"{case.name}: {original.name} does not contain '{old}'")
            original.write_text(text.replace(old, new, 1))
        if case.read_only:
            folder.chmod(0o555)

    def run(self, case):
        """The paragraph of messages.txt."""
        folder = self.work / re.sub(r"\W+", "_", case.name)
        folder.mkdir()
        self.prepare(case, folder)
        before = set(folder.rglob("*"))
        command = f"{shlex.quote(str(self.program))} {case.command}"
        environment = {**os.environ, "LC_ALL": "C.UTF-8", "TMPDIR": str(folder), **case.environment}
        done = subprocess.run(["/bin/sh", "-c", command], cwd=folder, capture_output=True, text=True, errors="replace",
                              stdin=subprocess.DEVNULL, env=environment, timeout=120,
                              preexec_fn=limiter(case))  # fmt: skip
        text = done.stderr.replace(str(folder), "FOLDER").replace(str(self.program), "stageid")
        if case.rounded:
            text = re.sub(r"(?<![\w.])-?\d+(\.\d+)?(e[+-]?\d+)?", "~", text)
        left = sorted(str(path.relative_to(folder)) for path in set(folder.rglob("*")) - before)
        if done.returncode in (1, 2) and left and not case.keeps:
            text += f"(leaves {', '.join(left)})\n"
        folder.chmod(0o755)
        shutil.rmtree(folder)
        edits = [f"({name}: `{one_line(old)}` is replaced by `{one_line(new)}`)\n" for name, (old, new) in case.edits]
        return f"\n### {case.name}\n{''.join(edits)}$ stageid {case.command}\nexit code {done.returncode}\n{text}"


def paragraph_in(text, case):
    found = re.search(rf"\n### {re.escape(case.name)}\n.*?(?=\n##|\Z)", text, re.DOTALL)
    return found.group() if found else ""


def document(runner, golden):
    """What messages.txt is to contain; cases that cannot be tested here stay as they are."""
    permissions = os.getuid() != 0 or nobody_can_run(runner.program)

    def paragraph(case):
        return runner.run(case) if permissions or not case.read_only else paragraph_in(golden, case)

    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        paragraphs = list(pool.map(paragraph, messages_cases.CASES))
    text, chapter = HEADER, None
    for case, paragraph in zip(messages_cases.CASES, paragraphs):
        if case.chapter != chapter:
            chapter = case.chapter
            text += f"\n## {chapter}\n"
        text += paragraph
    return text


def main():
    update = "--update" in sys.argv
    program, source = (pathlib.Path(word).resolve() for word in sys.argv[1:3])
    golden = source / GOLDEN
    before = golden.read_text() if golden.exists() else ""
    with tempfile.TemporaryDirectory() as work:
        pathlib.Path(work).chmod(0o755)
        text = document(Runner(program, source, pathlib.Path(work).resolve()), before)
    if update:
        golden.write_text(text)
        return
    difference = list(difflib.unified_diff(before.splitlines(True), text.splitlines(True), GOLDEN, "this program"))
    sys.stdout.writelines(difference)
    sys.exit(1 if difference else 0)


if __name__ == "__main__":
    main()
