#!/usr/bin/env python3
"""Man pages and completion hold every command and flag that `--help` shows, and no word that the program
refuses. Usage: manual_test.py PROGRAM WORK_DIR
"""

import pathlib
import re
import shutil
import subprocess
import sys
import unittest

PROGRAM, WORK = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
# Calls the bash script like its completion: the last word is completed.
COMPLETE = 'source "$1"; shift; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _stageid; printf "%s\\n" "${COMPREPLY[@]}"'
# The same for zsh; the functions of its completion system are replaced and print their arguments.
COMPLETE_ZSH = """_describe() { [[ $1 == -o ]] && shift; print -rl -- ${${(P)2}//(#b)([^\\\\]):*/$match[1]}; }
compadd() { print -rl -- ${(P)2}; }
_files() { print -r FILES; }
setopt extended_glob; script=$1; shift; words=("$@"); CURRENT=$#; source $script"""


def help_of(*words):
    return subprocess.run([PROGRAM, *words, "--help"], capture_output=True, text=True, check=True).stdout


def commands_of(text):
    """Names below Subcommands: in a help text."""
    _, found, below = text.partition("Subcommands:\n")
    return re.findall(r"^  ([a-z]+) ", below, re.MULTILINE) if found else []


def every_command(*path):
    yield path
    for name in commands_of(help_of(*path)):
        yield from every_command(*path, name)


def flags_in(text):
    """Flags at the head of their line; the prose behind names others."""
    heads = re.findall(r"^  (-[^ ]*)", text, re.MULTILINE)
    return {flag for head in heads for flag in head.split(",")}


class ManualTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        shutil.rmtree(WORK / "share", ignore_errors=True)
        WORK.mkdir(parents=True, exist_ok=True)
        subprocess.run([PROGRAM, "manual", "-o", WORK / "share"], check=True, capture_output=True)

    def completed(self, *words):
        script = WORK / "share/bash-completion/completions/stageid"
        done = subprocess.run(["bash", "-c", COMPLETE, "bash", script, "stageid", *words],
                              cwd=WORK, capture_output=True, text=True, check=True)
        self.assertEqual(done.stderr, "")
        return done.stdout.split()

    def completed_by_zsh(self, *words):
        script = WORK / "share/zsh/vendor-completions/_stageid"
        done = subprocess.run(["zsh", "-fc", COMPLETE_ZSH, "zsh", script, "stageid", *words], cwd=WORK,
                              capture_output=True, text=True, check=True)
        self.assertEqual(done.stderr, "")
        return done.stdout.split("\n")[:-1]

    @unittest.skipUnless(shutil.which("zsh"), "no zsh here")
    def test_zsh_offers_what_bash_offers(self):
        for path in every_command():
            with self.subTest(path):
                self.assertEqual(self.completed_by_zsh(*path, "-"), self.completed(*path, "-"))
                self.assertEqual([word for word in self.completed_by_zsh(*path, "") if word != "FILES"],
                                 self.completed(*path, ""))
        self.assertEqual(self.completed_by_zsh("frf", "run.slog", "--method", ""), ["periodic", "lpm"])
        self.assertEqual(self.completed_by_zsh("--verbosity", "debug", "log", ""), self.completed("log", ""))
        self.assertEqual(self.completed_by_zsh("frf", "run.sl"), ["FILES"])

    @unittest.skipUnless(shutil.which("zsh"), "no zsh here")
    def test_zsh_finds_its_completion(self):
        load = "fpath=($1 $fpath); autoload -Uz compinit; compinit -u -d $2; print ${_comps[stageid]}"
        done = subprocess.run(["zsh", "-fc", load, "zsh", WORK / "share/zsh/vendor-completions", WORK / "dump"],
                              capture_output=True, text=True)
        self.assertEqual((done.stdout, done.stderr), ("_stageid\n", ""))

    def test_completion_offers_every_command_and_flag(self):
        paths = list(every_command())
        self.assertGreater(len(paths), 18)
        for path in paths:
            with self.subTest(path):
                text = help_of(*path)
                own = flags_in(text)
                self.assertIn("--help", own)
                self.assertEqual(own - set(self.completed(*path, "-")), set())
                self.assertEqual(set(commands_of(text)) - set(self.completed(*path, "")), set())
                self.assertIn("--json", self.completed(*path, "--js"))

    def test_completion_narrows_what_was_begun(self):
        self.assertEqual(self.completed("va"), ["validate"])
        self.assertEqual(self.completed("--verbosity", "de"), ["debug"])
        self.assertEqual(self.completed("--verbosity", "debug", "log", "inf"), ["info"])
        self.assertEqual(self.completed("frf", "run.slog", "--method", ""), ["periodic", "lpm"])
        self.assertEqual(self.completed("frf", "run.sl"), [])  # bash completes files then

    def test_what_completion_offers_is_accepted(self):
        """A word that a flag does not take ends with 2; a good one gets as far as the missing file, 1."""
        needed = {"frf": ["none.h5", "-o", "x.h5"], "fit": ["none.h5", "-o", "x.json"],
                  "modes": ["none.h5"], "run": ["none.yaml", "-o", "x.slog"],
                  "export": ["none.json", "-o", "x.mat"]}
        tried = 0
        for command, arguments in needed.items():
            for flag in flags_in(help_of(command)) - {"-h", "--help", "-o", "--output"}:
                for word in self.completed(command, flag, ""):
                    with self.subTest(command=command, flag=flag, word=word):
                        done = subprocess.run([PROGRAM, command, *arguments, flag, word], cwd=WORK,
                                              capture_output=True, text=True)
                        self.assertEqual(done.returncode, 1, done.stderr)
                        tried += 1
        self.assertGreater(tried, 25)

    def test_man_pages_hold_every_flag(self):
        for path in every_command():
            with self.subTest(path):
                page = WORK / "share/man/man1" / f"{'-'.join(('stageid', *path[:1]))}.1"
                text = page.read_text().replace("\\-", "-")
                for flag in flags_in(help_of(*path)):
                    self.assertIn(f"\\fB{flag}\\fR", text)

    @unittest.skipUnless(shutil.which("groff"), "no groff here")
    def test_man_pages_are_without_warnings(self):
        for page in sorted((WORK / "share/man/man1").iterdir()):
            with self.subTest(page.name):
                done = subprocess.run(["groff", "-man", "-ww", "-b", "-Tutf8", "-P-cbou", page], capture_output=True, text=True)
                self.assertEqual(done.stderr, "")
                self.assertIn("NAME", done.stdout)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
