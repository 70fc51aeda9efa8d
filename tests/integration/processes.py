"""A test of the program and of other processes, which end with it."""
import concurrent.futures
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


def run_side_by_side(case, at_once):
    """Runs the tests of a class that mostly wait, some at a time, each in a folder of its own. @returns how many failed"""
    def run(name):
        result, began = unittest.TestResult(), time.monotonic()
        case(name).run(result)
        return result, time.monotonic() - began

    names, failed = unittest.defaultTestLoader.getTestCaseNames(case), 0
    with concurrent.futures.ThreadPoolExecutor(at_once) as pool:
        for name, (result, took_s) in zip(names, pool.map(run, names)):
            wrong = [text for _, text in result.failures + result.errors]
            failed += bool(wrong)
            print(f"{'FAIL' if wrong else 'ok  '} {name} ({took_s:.1f} s)", *wrong, sep="\n", flush=True)
    return failed
