#!/usr/bin/python3
"""A fleet whose store is in PostgreSQL, and whose jobs run as tasks of Slurm; both servers are killed.

    fleet_servers_test.py PROGRAM CONFIGS WORK_DIR TOOLS_TESTS [JOBS]

Exit code 77 (skipped) when PostgreSQL or Slurm is not installed.
"""
import json
import os
import pathlib
import random
import re
import signal
import subprocess
import sys
import time
import unittest

import fleet_test
from servers import Postgres, Slurm, wait_for

JOBS = 12


def started(server):
    """A server, or a skipped test: containers may forbid its daemons. What it says then is printed."""
    try:
        return server()
    except (RuntimeError, subprocess.CalledProcessError) as error:
        raise unittest.SkipTest(f"{server} does not start here: {error} {getattr(error, 'stderr', '')}") from error


class PostgresFleetTest(fleet_test.FleetTest):
    """The same tests as with a file."""
    server = tools_tests = None

    @classmethod
    def setUpClass(cls):
        cls.server = started(Postgres)
        cls.addClassCleanup(cls.server.stop)
        cls.store = cls.server.url("fleet")
        cls.fleet = fleet_test.FLEET + f"store: '{cls.store}'\n"
        super().setUpClass()

    def clear_store(self):
        self.server.execute("DROP SCHEMA IF EXISTS fleet CASCADE; CREATE SCHEMA fleet")

    def expect_whole_store(self):
        """The server checks itself."""

    def test_a_full_disk_costs_no_finished_job(self):
        self.skipTest("the disk is that of the server")

    def test_unit_tests_of_the_store(self):
        done = subprocess.run([self.tools_tests, "--gtest_filter=Fleet*:Watched*:Database*"], capture_output=True, text=True,
                              env={**os.environ, "STAGEID_TEST_POSTGRES": self.server.url("public")})
        self.assertEqual(done.returncode, 0, done.stdout)

    def test_completes_the_work_after_the_server_was_killed(self):
        process = subprocess.Popen([self.program, "--verbosity", "quiet", "fleet", "fleet.yaml"], cwd=self.work,
                                   stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        wait_for(lambda: self.done() > 0, 60, "the first job")
        self.server.kill()
        error = process.communicate(timeout=60)[1]
        self.assertEqual(process.returncode, 1, error)
        self.assertIn("no connection to the database", error)
        self.server.restart_after_kill()
        self.call("fleet", "fleet.yaml")
        self.expect_every_job_once()

    def test_without_a_server_the_message_tells_it(self):
        text = self.fleet.replace(str(self.server.folder), str(self.work / "nobody"))
        (self.work / "fleet.yaml").write_text(text.replace("postgresql://", "postgresql://user:secret@").replace("secret@postgres@", "secret@"))
        error = self.call("fleet", "fleet.yaml", wanted=1).stderr
        self.assertRegex(error, r"^stageid: postgresql://user@.*: no connection to the database: .*No such file.*; check the address")
        self.assertNotIn("secret", error)


class SlurmFleetTest(unittest.TestCase):
    jobs = JOBS

    def setUp(self):
        self.base = fleet_test.FleetTest
        self.work = self.base.work.parent / "slurm_work"
        self.server = started(Postgres)
        self.addCleanup(self.server.stop)
        self.server.execute("CREATE SCHEMA fleet")
        self.store = self.server.url("fleet")
        self.slurm = started(lambda: Slurm(self.work.parent / "slurm"))
        self.addCleanup(self.slurm.stop)

    def call(self, *words, wanted=0):
        done = subprocess.run([self.base.program, "--verbosity", "quiet", *words], cwd=self.work, capture_output=True, text=True,
                              env=self.slurm.environment)
        self.assertEqual(done.returncode, wanted, done.stdout + done.stderr)
        return done.stdout

    def make_logs(self):
        (self.work / "logs").mkdir(parents=True, exist_ok=True)
        text = (self.base.configs / "experiment" / "small_stage.yaml").read_text()
        text = text.replace("../stage", str(self.base.configs / "stage"))
        for seed in range(self.jobs):
            if (self.work / "logs" / f"{seed}.slog").exists():
                continue
            (self.work / "experiment.yaml").write_text(re.sub(r"seed: \d+", f"seed: {seed}", text))
            self.call("run", "experiment.yaml", "-o", f"logs/{seed}.slog")
        (self.work / "fleet.yaml").write_text(fleet_test.FLEET + f"store: '{self.store}'\n")

    def count(self, where="verdict <> 'failed'"):
        sql = f"SELECT COUNT(*) AS a, COUNT(DISTINCT job) AS b, COUNT(DISTINCT log) AS c FROM identification WHERE {where}"
        return tuple(json.loads(self.call("fleet", "query", self.store, sql, "--json"))["rows"][0].values())

    def kill_a_job(self):
        """Any process of a job; @returns whether there was one."""
        for status in pathlib.Path("/proc").glob("[0-9]*/cmdline"):
            try:
                words = status.read_bytes().split(b"\0")
            except OSError:
                continue
            if b"job" in words and any(str(self.work).encode() in os.fsencode(os.readlink(link)) for link in [status.parent / "cwd"]):
                os.kill(int(status.parent.name), signal.SIGKILL)
                return True
        return False

    def test_every_job_is_stored_once(self):
        self.make_logs()
        words = self.call("fleet", "fleet.yaml", "--slurm", "4", "--workers", "1", "--json")
        told = json.loads(words)
        self.assertEqual((told["tasks"], told["open_jobs"]), (4, self.jobs))
        chance, killed, restarted = random.Random(1), 0, False
        wanted = max(2, self.jobs // 10)
        end = time.monotonic() + 60 + 5 * self.jobs
        # Slurm waits two minutes before it runs a task again; until then, the others have done its jobs.
        while not restarted or self.count("1 = 1")[0] < self.jobs:
            self.assertLess(time.monotonic(), end, "the tasks do not end")
            if killed < wanted and self.kill_a_job():
                killed += 1
            if restarted:
                self.slurm.resume_node()
            if killed == wanted // 2 and not restarted:
                self.slurm.kill_controller()
                time.sleep(0.5)
                self.slurm.start_controller()
                restarted = True
            time.sleep(chance.uniform(0.1, 0.4))
        self.slurm.call("scancel", told["slurm_job"])
        self.slurm.wait(told["slurm_job"], 60)
        stored = self.count()
        print(f"{killed} jobs killed; {stored[0]} of {self.jobs} stored by the tasks", file=sys.stderr)
        self.assertGreater(stored[0], self.jobs // 2)
        self.call("fleet", "fleet.yaml")
        self.assertEqual(self.count(), (self.jobs,) * 3)
        self.assertEqual(self.count("verdict = 'failed'"), (0, 0, 0))
        self.assertIn(f"{self.jobs} jobs: {self.jobs} done before", self.call("fleet", "fleet.yaml", "--slurm", "4"))

    def test_a_refused_submission_tells_why(self):
        self.make_logs()
        os.environ["SBATCH_PARTITION"] = "missing"
        self.slurm.environment["SBATCH_PARTITION"] = os.environ.pop("SBATCH_PARTITION")
        done = subprocess.run([self.base.program, "fleet", "fleet.yaml", "--slurm", "2"], cwd=self.work, capture_output=True,
                              text=True, env=self.slurm.environment)
        self.assertEqual(done.returncode, 1)
        self.assertRegex(done.stderr, r"fleet\.yaml: not submitted: sbatch: error: .*partition")


if __name__ == "__main__":
    if Postgres.programs() is None or not Slurm.is_installed():
        print("install postgresql and slurm-wlm")
        sys.exit(77)
    fleet_test.prepare(*sys.argv[1:4])
    PostgresFleetTest.tools_tests = sys.argv[4]
    if len(sys.argv) > 5:
        SlurmFleetTest.jobs = int(sys.argv[5])
    unittest.main(argv=sys.argv[:1])
