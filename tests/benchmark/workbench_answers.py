#!/usr/bin/env python3
"""Times the answers of `stageid open` to edits: the first preview, the second one, and the final fit, beside the time of
`stageid fit` with the command line of that fit, without its search.

    workbench_answers.py PROGRAM FRF.h5 MODEL.json FREQUENCY_HZ    frequency of a mode, which is removed and added again
"""

import json
import pathlib
import shlex
import subprocess
import sys
import tempfile
import time
import urllib.request

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "tools/workbench"))
from open_program import OpenProgram  # noqa: E402


def act(bench, action):
    request = urllib.request.Request(f"http://{bench.address.netloc}/act?{bench.address.query}", json.dumps(action).encode(),
                                     {"X-Stageid": "act"}, method="POST")
    urllib.request.urlopen(request, timeout=60).read()


def answers(bench, action):
    """Seconds until the first preview, the second one, and the fit; and the state."""
    begin = time.monotonic()
    act(bench, action)
    times = [time.monotonic() - begin]
    while True:
        state = bench.state()
        stage = state["states"][state["index"]]["stage"]
        if len(times) == 1 and stage in ("improved", "refined"):
            times.append(time.monotonic() - begin)
        if state["state"] == "ready":
            return [*times, time.monotonic() - begin], state
        time.sleep(0.02)


def fit_seconds(program, command):
    with tempfile.TemporaryDirectory() as folder:
        words = shlex.split(command)
        words[0] = program
        words[words.index("-o") + 1] = folder + "/model.json"
        begin = time.monotonic()
        subprocess.run(words, capture_output=True, check=False)
        return time.monotonic() - begin


def main():
    program, frf, model, frequency = sys.argv[1:5]
    mode = {"frequency_hz": float(frequency)}
    bench = OpenProgram(program, frf, model)
    try:
        bench.settled()
        print("action    first   second    fit    ratio of fit to the command")
        for action in ({"kind": "remove", **mode}, {"kind": "add", **mode},
                       {"kind": "band", "low_hz": 0.03 * mode["frequency_hz"], "high_hz": 2 * mode["frequency_hz"]}):
            times, state = answers(bench, action)
            ratio = times[-1] / fit_seconds(program, state["command"])
            print(f"{action['kind']:8s}" + "".join(f"{t:8.3f}" for t in times) + f"{ratio:8.2f}")
        print("undo    %8.3f" % answers(bench, {"kind": "undo"})[0][-1])
    finally:
        bench.close()


if __name__ == "__main__":
    main()
