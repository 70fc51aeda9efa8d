#!/usr/bin/python3
"""A fleet of short logs: a corrupt one, kill -9, two processes at once, a full disk.

    fleet_test.py PROGRAM CONFIGS WORK_DIR [KILLS]

After every fault, the same command completes the work: each job is in the store exactly once.
"""
import json
import os
import pathlib
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
import unittest

FLEET = """format: stageid-fleet
logs: ["logs/*.slog"]
tags: {site: north}
identification:
  fit: {rigid_body: suspension, suspension_hz: [0.4, 0.5], direct_term: full}
  validation_realization: 3
"""
LOGS = 5


class FleetTest(unittest.TestCase):
    program = configs = work = None
    kills = 3
    store = "fleet.db"
    fleet = FLEET

    @classmethod
    def setUpClass(cls):
        shutil.rmtree(cls.work, ignore_errors=True)
        (cls.work / "logs").mkdir(parents=True)
        experiment = (cls.configs / "experiment" / "small_stage.yaml").read_text()
        experiment = experiment.replace("../stage", str(cls.configs / "stage"))
        for seed in range(LOGS):
            (cls.work / "experiment.yaml").write_text(re.sub(r"seed: \d+", f"seed: {seed}", experiment))
            cls.call("run", "experiment.yaml", "-o", f"logs/{seed}.slog")

    def setUp(self):
        for path in self.work.glob("fleet*"):
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        self.clear_store()
        (self.work / "fleet.yaml").write_text(self.fleet)
        (self.work / "logs" / "corrupt.slog").unlink(missing_ok=True)

    @classmethod
    def call(cls, *words, wanted=0, **options):
        done = subprocess.run([cls.program, "--verbosity", "quiet", *map(str, words)], cwd=cls.work, capture_output=True, text=True,
                              timeout=300, **options)
        if done.returncode != wanted:
            raise AssertionError(f"{words}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
        return done

    def clear_store(self):
        """A file is removed with the others."""

    def rows(self, sql):
        return [tuple(row.values()) for row in json.loads(self.call("fleet", "query", self.store, sql, "--json").stdout)["rows"]]

    def expect_whole_store(self):
        self.assertEqual(self.rows("PRAGMA integrity_check"), [("ok",)])

    def expect_every_job_once(self, jobs=LOGS):
        self.assertEqual(self.rows("SELECT COUNT(*) AS a, COUNT(DISTINCT job) AS b, COUNT(DISTINCT log) AS c FROM identification "
                                   "WHERE verdict = 'trustworthy'"), [(jobs, jobs, jobs)])
        self.assertEqual(self.rows("SELECT COUNT(*) FROM mode GROUP BY identification_id HAVING COUNT(*) <> 4"), [])
        self.expect_whole_store()
        for job, results in self.rows("SELECT job, results FROM identification WHERE verdict <> 'failed'"):
            folder = self.work / results / job[:2] / job[:12]
            self.assertEqual(sorted(path.name for path in folder.iterdir()),
                             ["frf.h5", "frf_validation.h5", "model.json", "report.html"])

    def test_a_corrupt_log_costs_one_job(self):
        whole = (self.work / "logs" / "0.slog").read_bytes()
        (self.work / "logs" / "corrupt.slog").write_bytes(whole[:len(whole) // 3])
        for repetition in range(2):
            error = self.call("fleet", "fleet.yaml", wanted=1).stderr.splitlines()
            self.assertIn("stageid: logs/corrupt.slog: damaged at byte", error[0])
            self.assertEqual(error[1:], [f"stageid: {self.store}: 1 job failed; remove the cause and run the command again"])
            self.expect_every_job_once()
            self.assertEqual(self.rows("SELECT COUNT(*) FROM identification WHERE verdict = 'failed'"), [(1,)])
        # Repaired: a copy of another log is the same job.
        (self.work / "logs" / "corrupt.slog").write_bytes(whole)
        self.assertIn("5 jobs: 5 done before, 0 done now", self.call("fleet", "fleet.yaml").stdout)

    def test_runs_again_after_a_change_of_options_only(self):
        self.call("fleet", "fleet.yaml")
        (self.work / "fleet.yaml").write_text(self.fleet + "# a comment\nstage_name: folder\n")
        self.assertIn("5 done before, 0 done now", self.call("fleet", "fleet.yaml").stdout)
        (self.work / "fleet.yaml").write_text(self.fleet.replace("direct_term: full", "direct_term: full, max_iterations: 90"))
        self.assertIn("0 done before, 5 done now", self.call("fleet", "fleet.yaml").stdout)
        current = ("SELECT COUNT(*) AS a, COUNT(CASE WHEN c.text LIKE '%max_iterations%' THEN 1 END) AS b FROM identification i "
                   "JOIN configuration c ON c.id = i.configuration_id WHERE i.is_current = 1")
        self.assertEqual(self.rows(current), [(5, 5)])
        (self.work / "fleet.yaml").write_text(self.fleet)
        self.assertIn("5 done before, 0 done now", self.call("fleet", "fleet.yaml").stdout)
        self.assertEqual(self.rows(current), [(5, 0)])

    def test_completes_the_work_after_kill(self):
        start = time.monotonic()
        self.call("fleet", "fleet.yaml")
        duration = time.monotonic() - start
        chance = random.Random(1)
        done = []
        for kill in range(self.kills):
            self.setUp()
            process = subprocess.Popen([self.program, "fleet", "fleet.yaml"], cwd=self.work,
                                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            time.sleep(chance.uniform(0.05, 0.95) * duration)
            process.send_signal(signal.SIGKILL)
            process.wait()
            done.append(int(self.call("fleet", "fleet.yaml", "--json").stdout.split('"done_before": ')[1].split(",")[0]))
            self.expect_every_job_once()
        print("jobs done before each kill:", done, file=sys.stderr)
        self.assertLess(min(done), LOGS, "every kill came too late")

    def test_two_processes_share_the_work(self):
        both = [subprocess.Popen([self.program, "--verbosity", "quiet", "fleet", "fleet.yaml", "--json"], cwd=self.work,
                                 stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) for _ in range(2)]
        outputs = [process.communicate() for process in both]
        self.assertEqual([(process.returncode, errors) for process, (_, errors) in zip(both, outputs)], [(0, "")] * 2)
        self.assertEqual(sum(json.loads(text)["done"] for text, _ in outputs), LOGS)
        self.expect_every_job_once()

    def test_a_process_takes_over_the_jobs_of_a_killed_one(self):
        command = [self.program, "--verbosity", "quiet", "fleet", "fleet.yaml", "--workers", "1"]
        killed = subprocess.Popen(command, cwd=self.work, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        children = pathlib.Path(f"/proc/{killed.pid}/task/{killed.pid}/children")
        self.addCleanup(killed.kill)
        while not children.read_text():  # stopped first: else the job could be done before the signal arrives
            killed.send_signal(signal.SIGCONT)
            time.sleep(0.001)
            killed.send_signal(signal.SIGSTOP)
        other = subprocess.Popen(command, cwd=self.work, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        while self.done() < LOGS - 1:
            time.sleep(0.01)
        time.sleep(0.5)
        self.assertIsNone(other.poll(), "it does not wait for the job of the other process")
        killed.kill()
        killed.wait()
        self.assertEqual(other.communicate()[1], "")
        self.assertEqual(other.returncode, 0)
        self.expect_every_job_once()

    def done(self):
        try:
            return self.rows("SELECT COUNT(*) FROM identification")[0][0]
        except AssertionError:  # no tables yet
            return 0

    def call_limited(self, most_bytes):
        """Files end there, as with a quota."""
        return self.call("fleet", "fleet.yaml", wanted=1,
                         preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, most_bytes))).stderr

    def test_a_full_disk_costs_no_finished_job(self):
        self.assertEqual(self.call_limited(60000), "stageid: fleet.db: cannot be read or written; check permissions and "
                                                   "free space of its disk\n")
        error = self.call_limited(300000).splitlines()
        self.assertRegex(error[0], r"^stageid: logs/\d.slog: fleet_results/.*: File too large; ")
        self.assertEqual(len(error), LOGS + 1, error)
        self.call("fleet", "fleet.yaml")
        self.expect_every_job_once()

    def test_a_crash_costs_one_job(self):
        process = subprocess.Popen([self.program, "--verbosity", "quiet", "fleet", "fleet.yaml", "--workers", "1"], cwd=self.work,
                                   stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        children = pathlib.Path(f"/proc/{process.pid}/task/{process.pid}/children")
        while not children.read_text():
            time.sleep(0.001)
        os.kill(int(children.read_text().split()[0]), signal.SIGSEGV)
        error = process.communicate()[1]
        self.assertEqual(process.returncode, 1, error)
        self.assertIn("logs/0.slog: the process of this job was ended by signal 11 (Segmentation fault)", error)
        self.assertEqual(len(error.splitlines()), 2, error)
        self.assertEqual(self.rows("SELECT COUNT(*) FROM identification WHERE verdict = 'failed'"), [(1,)])
        self.call("fleet", "fleet.yaml")
        self.expect_every_job_once()

    def test_ends_if_the_signal_of_an_ended_child_is_ignored(self):
        self.call("fleet", "fleet.yaml", preexec_fn=lambda: signal.signal(signal.SIGCHLD, signal.SIG_IGN))
        self.expect_every_job_once()

    def test_completes_the_work_after_the_program_was_removed(self):
        copy = self.work / "fleet_program"
        shutil.copy(self.program, copy)
        process = subprocess.Popen([copy, "--verbosity", "quiet", "fleet", "fleet.yaml", "--workers", "1"], cwd=self.work,
                                   stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        children = pathlib.Path(f"/proc/{process.pid}/task/{process.pid}/children")
        while not children.read_text():
            time.sleep(0.001)
        copy.unlink()
        self.assertEqual((process.communicate()[1], process.returncode), ("", 0))
        self.expect_every_job_once()

    def test_a_scheduler_runs_single_jobs(self):
        job = ("fleet", "job", "fleet.yaml", "logs/0.slog", "--stage", "x", "--time", "2026-01-01", "--tag", "bench=3")
        self.assertRegex(self.call(*job).stdout, r"^fleet_results/../.{12}: done\n$")
        self.assertRegex(self.call(*job).stdout, r": was done before\n$")
        self.assertEqual(self.rows("SELECT s.name, i.time_utc, t.name AS tag, t.number FROM identification i JOIN stage s ON "
                                   "s.id = i.stage_id JOIN tag t ON t.identification_id = i.id ORDER BY t.name"),
                         [("x", "2026-01-01", "bench", 3.0), ("x", "2026-01-01", "site", None)])
        self.call("fleet", "report", self.store, "-o", "fleet.html")  # pairs the modes first
        self.assertEqual(self.rows("SELECT COUNT(*) FROM modes WHERE mode IS NULL"), [(0,)])
        self.assertIn("5 jobs: 1 done before, 4 done now", self.call("fleet", "fleet.yaml").stdout)

    def test_a_table_names_stages_times_and_tags(self):
        (self.work / "fleet.csv").write_text("log,stage,time_utc,temperature\n" + "".join(
            f"logs/{i}.slog,stage {i % 2},2026-01-0{i + 1},{20 + i}\n" for i in range(LOGS)) + "logs/missing.slog,x,,\n")
        (self.work / "fleet.yaml").write_text(self.fleet.replace('logs: ["logs/*.slog"]', "table: fleet.csv"))
        error = self.call("fleet", "fleet.yaml", wanted=1).stderr
        self.assertIn("stageid: logs/missing.slog: cannot be read: No such file", error)
        self.expect_every_job_once()
        self.assertEqual(self.rows("SELECT s.name, i.time_utc, t.number FROM identification i JOIN stage s ON "
                                   "s.id = i.stage_id JOIN tag t ON t.identification_id = i.id WHERE t.name = "
                                   "'temperature' ORDER BY 2")[1], ("stage 1", "2026-01-02", 21.0))
        table = self.call("fleet", "query", self.store, "SELECT stage, COUNT(*) AS n FROM modes WHERE "
                          "frequency_hz > 400 GROUP BY stage ORDER BY stage", "--csv", "fleet_modes.csv")
        self.assertEqual(table.stdout, "wrote fleet_modes.csv: 2 rows\n")
        self.assertEqual((self.work / "fleet_modes.csv").read_text(), "stage,n\nstage 0,9\nstage 1,6\n")


def prepare(program, configs, work):
    FleetTest.program, FleetTest.configs, FleetTest.work = program, pathlib.Path(configs).resolve(), pathlib.Path(work).resolve()


if __name__ == "__main__":
    prepare(*sys.argv[1:4])
    if len(sys.argv) > 4:
        FleetTest.kills = int(sys.argv[4])
    unittest.main(argv=sys.argv[:1])
