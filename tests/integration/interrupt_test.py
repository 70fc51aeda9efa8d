#!/usr/bin/python3
"""Ctrl-C at any moment, a closed terminal: every command ends by itself or with 130 and one line, an output is there whole or not
at all, nothing else is left behind, and an interrupted run goes on to the same log.

    interrupt_test.py PROGRAM CONFIGS WORK_DIR
"""

import json
import os
import pathlib
import pty
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
from processes import ProcessTest  # noqa: E402

PROGRAM, CONFIGS, WORK = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
SMALL = "configs/experiment/small_stage.yaml"
# In order: each uses the output of the previous ones. All outputs are identical byte for byte in every run.
COMMANDS = {
    "excitation.h5": ["design", SMALL],
    "frf.h5": ["frf", "run.slog", "--realizations", "1,2"],
    "modes.json": ["modes", "frf.h5"],
    "model.json": ["fit", "frf.h5", "--band", "120", "800", "--direct-term", "full"],
    "model.mat": ["export", "model.json"],
    "page.html": ["report", "model.json", "frf.h5"],
    "table.csv": ["log", "convert", "run.slog"],
    "back.h5": ["import", "table.csv", "--map", "configs/import/bench_csv.yaml"],
}
# From before main() to after the end of most commands, in steps that cover everything in between.
DELAYS_S = [0.0, 0.003, 0.006, 0.012, 0.02, 0.035, 0.05, 0.08, 0.12]

# Writes lines into a pipe until nobody reads them.
ENDLESS = """
import sys, time
with open(sys.argv[1], "w") as pipe:
    while True:
        pipe.write("- 1.0,2.0,3.0\\n" * 200)
        time.sleep(0.005)
"""


def run(*words, interrupt_after_s, by=signal.SIGINT, start=None):
    """(exit code, stderr); the signal once after so long. `start` is called in the process before the program."""
    process = subprocess.Popen([PROGRAM, *words], cwd=WORK, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                               preexec_fn=start)
    try:
        process.wait(interrupt_after_s)
    except subprocess.TimeoutExpired:
        process.send_signal(by)
    _, error = process.communicate(timeout=120)
    return process.returncode, error


def files():
    return {path.relative_to(WORK) for path in WORK.rglob("*") if path.is_file()}


class InterruptTest(ProcessTest):
    program, folder = PROGRAM, WORK

    @classmethod
    def setUpClass(cls):
        shutil.rmtree(WORK, ignore_errors=True)
        shutil.copytree(CONFIGS, WORK / "configs")
        # Late cycles of a busy machine are only marked, because this test is about Ctrl-C.
        stage = WORK / "configs/stage/small_stage.yaml"
        stage.write_text(stage.read_text() + "\nrealtime: {misses_allowed: 1000000}\n")
        for words in (["run", SMALL, "-o", "run.slog"],
                      *([*words, "-o", output] for output, words in COMMANDS.items())):
            done = cls.call(*words)
            assert done.returncode == 0, (words, done.stderr)

    def check_end(self, code, error):
        # Before main() there is no signal handler yet.
        self.assertIn(code, (0, 130, -signal.SIGINT), error)
        if code == 130:
            last = error.strip().splitlines()[-1]
            self.assertRegex(last, "^stageid: ")

    def check_best_model(self, file):
        model = json.loads(file.read_text())
        self.assertEqual(model["fit"]["status"], "interrupted")
        self.assertTrue(model["submodels"])
        self.assertTrue(model["provenance"]["decisions"])

    def test_an_output_is_whole_or_not_there(self):
        ends = set()
        for output, words in COMMANDS.items():
            whole = (WORK / output).read_bytes()
            before = files()
            for delay_s in (*DELAYS_S, 60.0):  # the last one is too late for any build
                with self.subTest(words[0], delay_s=delay_s):
                    new = pathlib.Path(f"new{pathlib.Path(output).suffix}")
                    code, error = run(*words, "-o", str(new), interrupt_after_s=delay_s)
                    self.check_end(code, error)
                    ends.add(code)
                    left = files() - before
                    self.assertLessEqual(left, {new})
                    if code == 0:
                        self.assertEqual(left, {new})
                    if not left:
                        continue
                    same = (WORK / new).read_bytes() == whole
                    if code == 130 and words[0] == "fit" and not same:  # the best model so far
                        self.check_best_model(WORK / new)
                    else:
                        self.assertTrue(same, "another file than without Ctrl-C")
                    (WORK / new).unlink()
        self.assertIn(0, ends)

    def test_what_writes_no_file_ends_and_leaves_none(self):
        before = files()
        for delay_s in DELAYS_S:
            for words in (["validate", "model.json", "run.slog"], ["log", "info", "run.slog"]):
                with self.subTest(words[0], delay_s=delay_s):
                    self.check_end(*run(*words, interrupt_after_s=delay_s))
                    self.assertEqual(files(), before)

    def test_every_command_that_reads_ends_at_the_first_signal(self):
        """A file that never comes to its end. Logs are not among them: they must be regular files."""
        for ending, words in {".yaml": ["config", "check"], ".csv": ["import"], ".json": ["report", "-o", "x.html"]}.items():
            for by in (signal.SIGINT, signal.SIGTERM):
                with self.subTest(words, by=by):
                    pipe = WORK / f"endless{ending}"
                    os.mkfifo(pipe)
                    before = files()
                    writer = subprocess.Popen([sys.executable, "-c", ENDLESS, pipe], stderr=subprocess.DEVNULL)
                    try:
                        begun = time.monotonic()
                        code, error = run(*words, str(pipe), interrupt_after_s=1.5, by=by)
                        self.assertLess(time.monotonic() - begun, 30.0)
                        self.assertEqual(code, 130, error)
                        self.assertRegex(error.strip().splitlines()[-1], "^stageid: interrupted; ")
                        self.assertEqual(files(), before)
                    finally:
                        writer.kill()
                        writer.wait()
                        pipe.unlink()

    def test_a_long_design_ends_at_the_first_signal(self):
        slow = WORK / "configs/experiment/slow.yaml"
        slow.write_text((WORK / SMALL).read_text().replace("seed: 7", "seed: 7\n  crest_iterations: 100000"))
        for by in (signal.SIGINT, signal.SIGTERM):
            for words, output in ((["design", str(slow)], "slow.h5"), (["identify", str(slow)], "slow")):
                with self.subTest(words[0], by=by):
                    code, error = run(*words, "-o", output, interrupt_after_s=1.5, by=by)
                    self.assertEqual(code, 130, error)
                    self.assertIn("stageid: interrupted; ", error)
                    self.assertFalse((WORK / "slow.h5").exists())
                    shutil.rmtree(WORK / "slow", ignore_errors=True)

    def test_a_long_search_writes_its_best_model_at_the_first_signal(self):
        """Sixty modes of four sensors and four actuators, closer than their widths: the search takes minutes."""
        random = np.random.default_rng(3)
        f = np.linspace(20.0, 900.0, 1500)
        G = np.zeros((len(f), 4, 4), complex)
        for hz in np.sort(random.uniform(30.0, 890.0, 60)):
            shape = random.standard_normal((4, 4)) + 1j * random.standard_normal((4, 4))
            G += shape / (hz**2 - f**2 + 0.06j * hz * f)[:, None, None]
        G += 1e-4 * np.abs(G).mean() * (random.standard_normal(G.shape) + 1j * random.standard_normal(G.shape))
        write_frf(WORK / "dense.h5", f, G, 2e-8 * np.abs(G).mean() ** 2)
        for by in (signal.SIGINT, signal.SIGTERM):
            with self.subTest(by=by):
                code, error = run("fit", "dense.h5", "-o", "best.json", "--search-seconds", "0", interrupt_after_s=4.0,
                                  by=by)
                self.assertEqual(code, 130, error)
                self.check_best_model(WORK / "best.json")
                (WORK / "best.json").unlink()

    def cut_and_resume(self, delay_s):
        for path in WORK.glob("cut.*"):
            path.unlink()
        code, error = run("run", SMALL, "-o", "cut.slog", "--pace", "0.1", interrupt_after_s=delay_s)
        self.check_end(code, error)
        if (WORK / "cut.slog").exists():
            self.succeed("log", "verify", "cut.slog")
            self.succeed("run", SMALL, "-o", "cut.slog", "--resume", "--pace", 0)
            self.succeed("frf", "cut.slog", "--realizations", "1,2", "-o", "cut.h5")
        return code

    def test_an_interrupted_run_goes_on(self):
        codes = []
        delays_s = list(DELAYS_S)
        for delay_s in delays_s:
            with self.subTest(delay_s=delay_s):
                codes.append(self.cut_and_resume(delay_s))
            # On a busy machine main() begins later than the last of them.
            if delay_s == delays_s[-1] < 60.0 and set(codes) == {-signal.SIGINT}:
                delays_s.append(2.0 * delay_s)
        self.assertIn(130, codes)

    def test_two_signals_in_a_row_are_one_controlled_stop(self):
        log = WORK / "twice.slog"
        process = self.spawn_run(SMALL, "-o", log.name, "--pace", 0.1)
        self.wait_for_samples(log)
        process.send_signal(signal.SIGINT)
        time.sleep(0.03)
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=120)
        self.assertEqual(process.returncode, 130, error)
        self.assertIn("the measured data are kept", error)  # the loop's own message: it ended normally
        # The ramp is in the log: 0.1 s of stage time, marked.
        self.succeed("log", "verify", log.name)
        marked = self.succeed("log", "info", log.name, "--json").stdout
        self.assertGreaterEqual(sum(r["health"]["marked"] for r in json.loads(marked)["runs"]), 200, marked)

    def test_a_closed_terminal_ends_a_run_as_ctrl_c_does(self):
        code = None
        for delay_s in (0.3, 0.6, 1.2, 2.4, 4.8):  # on a busy machine main() begins late
            for path in WORK.glob("hung.*"):
                path.unlink()
            code, error = run("run", SMALL, "-o", "hung.slog", "--pace", "1", interrupt_after_s=delay_s,
                              by=signal.SIGHUP)
            if code != -signal.SIGHUP and (WORK / "hung.slog").exists():
                break
        self.assertEqual(code, 130, error)
        self.succeed("log", "verify", "hung.slog")
        self.succeed("run", SMALL, "-o", "hung.slog", "--resume", "--pace", 0)

    def test_a_run_ends_so_when_nobody_takes_its_messages_any_more(self):
        process, terminal = pty.fork()
        if process == 0:
            os.chdir(WORK)
            os.execv(PROGRAM, [str(PROGRAM), "run", SMALL, "-o", "alone.slog", "--pace", "0.1"])
        self.wait_for_samples(WORK / "alone.slog")
        os.close(terminal)
        self.assertEqual(os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]), 130)
        self.succeed("log", "verify", "alone.slog")

    def wait_for_samples(self, log):
        for _ in range(600):
            if log.exists() and log.stat().st_size > 10000:
                return
            time.sleep(0.1)
        self.fail(f"{log}: no samples came")

    def test_a_log_that_is_removed_ends_a_slow_run_within_a_second(self):
        """At 50 Hz, a thousand samples would be twenty seconds."""
        stage = (WORK / "configs/stage/small_stage_modbus.yaml").read_text()
        stage = re.sub(r"supervisor:\n(  .*\n|    .*\n)+", "", stage).replace("backend: modbus", "backend: sim")
        (WORK / "slow_stage.yaml").write_text(stage + "\nrealtime: {misses_allowed: 1000000}\n")
        experiment = (WORK / "configs/experiment/small_stage_modbus.yaml").read_text()
        (WORK / "slow.yaml").write_text(experiment.replace("../stage/small_stage_modbus.yaml", "slow_stage.yaml"))
        folder = WORK / "removed"
        folder.mkdir()
        process = self.spawn_run("slow.yaml", "-o", "removed/slow.slog", "--pace", 1)
        time.sleep(2.0)
        shutil.rmtree(folder)
        removed = time.monotonic()
        _, error = process.communicate(timeout=60)
        self.assertLess(time.monotonic() - removed, 5.0)  # 1 s, on a busy machine
        self.assertEqual(process.returncode, 1, error)
        self.assertIn("its directory was removed", error)

    def test_a_run_of_nohup_goes_on(self):
        code, error = run("run", SMALL, "-o", "nohup.slog", "--pace", "4", interrupt_after_s=1.0, by=signal.SIGHUP,
                          start=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
        self.assertIn(code, (0, 3), error)  # 3: late cycles of a busy machine
        self.assertNotIn("interrupted", error)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
