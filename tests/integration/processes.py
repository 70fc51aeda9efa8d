"""A test of the program and of other processes, which end with it."""
import concurrent.futures
import shutil
import subprocess
import time
import unittest


class ProcessTest(unittest.TestCase):
    program = folder = None  # the tested program, and where it runs

    @classmethod
    def call(cls, *words):
        return subprocess.run([cls.program, *map(str, words)], cwd=cls.folder, capture_output=True, text=True, timeout=300)

    def succeed(self, *words):
        done = self.call(*words)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done

    def spawn(self, *command, **options):
        process = subprocess.Popen([*map(str, command)], cwd=self.folder, stdout=subprocess.PIPE, text=True, **options)
        self.addCleanup(self.end, process)
        return process

    def spawn_run(self, *words):
        return self.spawn(self.program, "run", *words, stderr=subprocess.PIPE)

    @staticmethod
    def end(process):
        process.kill()
        process.wait()
        process.stdout.close()


def run_side_by_side(case, at_once, alone):
    """Runs the tests of a class that mostly wait, some at a time, each in a folder of its own; then those of `alone`, which
    take all cores. @returns how many failed"""
    def run(name):
        result, began = unittest.TestResult(), time.monotonic()
        own = type(case.__name__, (case,), {"folder": case.folder / name})
        shutil.rmtree(own.folder, ignore_errors=True)
        own.folder.mkdir(parents=True)
        own(name).run(result)
        wrong = [text for _, text in result.failures + result.errors]
        print(f"{'FAIL' if wrong else 'ok  '} {name} ({time.monotonic() - began:.1f} s)", *wrong, sep="\n", flush=True)
        return bool(wrong)

    case.setUpClass()
    names = [name for name in unittest.defaultTestLoader.getTestCaseNames(case) if name not in alone]
    with concurrent.futures.ThreadPoolExecutor(at_once) as pool:
        return sum(pool.map(run, names)) + sum(map(run, alone))
