"""`stageid open` in a process of its own, and the results that it opens."""

import json
import re
import signal
import subprocess
import time
import urllib.parse
import urllib.request


def identify(program, configs, folder, seed):
    """The results of the small experiment with another seed."""
    text = (configs / "experiment/small_stage.yaml").read_text().replace("../stage", str(configs / "stage"))
    text, found = re.subn(r"seed: \d+", f"seed: {seed}", text)
    assert found == 1
    file = folder.with_suffix(".yaml")
    file.write_text(text)
    subprocess.run([program, "identify", file, "-o", folder], capture_output=True, check=True)


class OpenProgram:
    def __init__(self, program, *arguments):
        self.process = subprocess.Popen([program, "open", *map(str, arguments)], stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE, text=True)
        found = re.match(r"workbench: (http://\S+)", self.process.stdout.readline())
        if not found:
            raise RuntimeError("no workbench: " + self.process.stderr.read())
        self.url = found.group(1)
        self.address = urllib.parse.urlparse(self.url)

    def state(self):
        """The newest of the stream."""
        with urllib.request.urlopen(f"http://{self.address.netloc}/events?{self.address.query}", timeout=20) as stream:
            for line in stream:
                if line.startswith(b"data: "):
                    return json.loads(line[6:])
        raise RuntimeError("the stream has no state")

    def settled(self, seconds=120):
        end = time.monotonic() + seconds
        while (state := self.state())["state"] != "ready":
            assert time.monotonic() < end, "the fit does not end"
            time.sleep(0.05)
        return state

    def interrupt(self):
        """Ends it as Ctrl-C does; returns the exit code."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(timeout=30)

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
