"""A test of the program and of other processes, which end with it."""
import subprocess
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
