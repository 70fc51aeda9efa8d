#!/usr/bin/python3
"""A day of a watched stage on the real clock, eight times as fast: the measurement must keep its pace, tell no change,
lose no sample, and take no more memory, files or threads in its last third than before, while pages of the
dashboard stay open, come and go, and break off.

    soak_test.py PROGRAM CONFIGS WORK_DIR [HOURS]    default: 3 hours, of the day's 24
"""

import contextlib
import json
import pathlib
import random
import re
import shutil
import socket
import subprocess
import sys
import threading
import time
import unittest
import urllib.parse
import urllib.request

from load_dashboard import connection
from running_program import RunningProgram, with_experiment

PROGRAM, CONFIGS, WORK = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
HOURS = float(sys.argv[4]) if len(sys.argv) > 4 else 3
PACE = 8
RUNS = 24
SAMPLE_EVERY_S = 5


class Reader(threading.Thread):
    """A page that stays open: it reads the events to their end."""

    def __init__(self, url):
        super().__init__(daemon=True)
        self.link, self.received = connection(url, "/events"), 0
        self.start()

    def run(self):
        while part := self.link.recv(65536):
            self.received += len(part)

    def close(self):
        self.link.shutdown(socket.SHUT_RDWR)
        self.join()
        self.link.close()


class Visitors(threading.Thread):
    """Pages that come and go, scrapes of the metrics, and connections that break off anywhere."""

    def __init__(self, program, seed):
        super().__init__(daemon=True)
        self.program, self.choose, self.left, self.visits = program, random.Random(seed), threading.Event(), 0
        self.start()

    def run(self):
        while not self.left.wait(self.choose.uniform(0.1, 3)):
            path = self.choose.choice(["", "metrics", "response.json", "events", "no such page"])
            url = urllib.parse.urljoin(self.program.url, urllib.parse.quote(path)) if path else self.program.url
            with contextlib.suppress(OSError), urllib.request.urlopen(url, timeout=10) as answer:
                answer.read(self.choose.choice([0, 1, 1000, 100000]))
            self.visits += 1


def use(process):
    """What the process holds: memory of its own in KiB, open files, threads."""
    status = pathlib.Path(f"/proc/{process}/status").read_text()
    memory, threads = (int(re.search(rf"^{key}:\s+(\d+)", status, re.M).group(1)) for key in ("RssAnon", "Threads"))
    return memory, len(list(pathlib.Path(f"/proc/{process}/fd").iterdir())), threads


class Soak(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        shutil.rmtree(WORK, ignore_errors=True)
        WORK.mkdir(parents=True)
        cls.program("identify", CONFIGS / "experiment/small_stage.yaml", "-o", "model")
        periods = round(HOURS * 3600 * PACE / RUNS) - 2  # measured: two more are transient
        cls.experiment = with_experiment(CONFIGS, WORK, late=True, experiment="small_stage_watch", periods=periods,
                                         realizations=RUNS)

    @staticmethod
    def program(*words):
        return subprocess.run([PROGRAM, *words], cwd=WORK, check=True, capture_output=True, text=True).stdout

    def measure(self):
        """Runs the measurement to its end. @returns what the program held every few seconds, and what it told"""
        running = RunningProgram(PROGRAM, self.experiment, "-o", WORK / "day.slog", "--watch", WORK / "model/model.json",
                                 "--pace", PACE)
        self.addCleanup(running.close)
        page, visitors, held = Reader(running.url), Visitors(running, 1), []
        began = time.monotonic()
        with (WORK / "held.csv").open("w", buffering=1) as table:
            print("time_s,memory_kib,files,threads", file=table)
            while running.process.poll() is None and not any("shows the end" in line for line in running.lines):
                with contextlib.suppress(FileNotFoundError):  # it has just ended
                    held.append((time.monotonic() - began, *use(running.process.pid)))
                    print(*held[-1], sep=",", file=table)
                time.sleep(SAMPLE_EVERY_S)
        visitors.left.set()
        visitors.join()
        page.close()  # the program stays for its watchers
        code, out = running.wait()
        took = held[-1][0]
        print(f"{took:.0f} s for {HOURS * PACE * 3600:.0f} s of the stage, {visitors.visits} visits, "
              f"{page.received} bytes of events, exit code {code}\n{out}", *running.lines[-3:])
        self.assertGreater(page.received, 100 * took)
        return code, out, took, held

    def test_a_day(self):
        code, out, took, held = self.measure()
        self.assertIn(code, (0, 3), out)  # 3: the machine had cycles that were late, and says so
        self.assertIn(f"{RUNS} of {RUNS} runs complete", out)
        self.assertLess(took, HOURS * 3600 * 1.01 + SAMPLE_EVERY_S)

        settled = [row for row in held if took / RUNS < row[0] < 2 * took / 3]
        late = [row for row in held if row[0] >= 2 * took / 3]
        # One visitor at a time, and the one before may not be closed yet.
        for column, name, margin in ((1, "KiB of memory", 2048), (2, "files", 2), (3, "threads", 0)):
            before, after = (max(row[column] for row in rows) for rows in (settled, late))
            print(f"{name}: at most {before}, in the last third {after}")
            self.assertLessEqual(after, before + margin, name)

        self.assertIn(" 0 missing", out)
        self.program("log", "verify", "day.slog")
        events = [json.loads(line) for line in (WORK / "day.events.jsonl").read_text().splitlines()]
        self.assertEqual([event for event in events if event["event"] == "change"], [])


if __name__ == "__main__":
    sys.argv[1:] = []
    unittest.main()
