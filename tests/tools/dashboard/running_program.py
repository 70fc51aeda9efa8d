"""A `stageid run --dashboard 0` in a process of its own."""

import re
import subprocess
import threading
import time
import urllib.parse
import urllib.request


class RunningProgram:
    def __init__(self, program, *arguments, dashboard="0"):
        command = [program, "run", *map(str, arguments)]
        command += ["--dashboard", dashboard] if dashboard else []
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.lines = []
        self.url = self._wait_for_url() if dashboard else None
        # Read on, or the program would have to wait for a full pipe.
        self._reader = threading.Thread(target=lambda: self.lines.extend(self.process.stderr), daemon=True)
        self._reader.start()

    def _wait_for_url(self):
        for line in self.process.stderr:
            self.lines.append(line)
            found = re.search(r"dashboard: (http://\S+)", line)
            if found:
                return found.group(1)
        raise RuntimeError("no dashboard: " + "".join(self.lines))

    def get(self, path):
        with urllib.request.urlopen(urllib.parse.urljoin(self.url, path), timeout=10) as answer:
            return answer.read()

    def wait_until_measured(self):
        """The program then stays for its watchers."""
        while self.process.poll() is None and not any("shows the end" in line for line in self.lines):
            time.sleep(0.05)

    def wait(self, timeout=300):
        """The exit code, and what it said on stdout (little: a pipe holds it)."""
        self.process.wait(timeout=timeout)
        self._reader.join()
        return self.process.returncode, self.process.stdout.read()

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()


def with_experiment(configs, work, late=False, experiment="small_stage", **numbers):
    """An experiment of the small stage with other numbers, in `work`; with `late`, the stage may miss any number of cycles."""
    stage = configs / "stage/small_stage.yaml"
    if late:
        patient = work / "stage.yaml"
        patient.write_text(stage.read_text() + "\nrealtime: {policy: try, misses_allowed: 1000000}\n")
        stage = patient
    text = (configs / f"experiment/{experiment}.yaml").read_text().replace("../stage/small_stage.yaml", str(stage))
    for key, value in numbers.items():
        text, found = re.subn(rf"^(  {key}:) \S+", rf"\1 {value}", text, flags=re.M)
        assert found == 1, key
    file = work / "experiment.yaml"
    file.write_text(text)
    return file
