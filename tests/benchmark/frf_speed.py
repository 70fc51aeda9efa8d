#!/usr/bin/python3
"""How fast and in how much memory `stageid frf` goes through a log, beside plain reading of the same file.

    frf_speed.py PROGRAM CONFIG [REALIZATIONS PERIODS [REPEATS]]

Simulates the experiment of CONFIG with so many realizations and periods (default 3 and 3) and estimates its
response, alternately with reading the file in pieces of 1 MiB, from the page cache and, the cache told to forget
the file, from the disk. Prints the least of REPEATS
times (default 5) by the wall's clock and by the processors': the latter tells more on a machine that others
use as well. Rates are of the file as it stands, which `frf` reads but for the transient periods. The folder of
temporary files (TMPDIR) must hold the log. The result must be the same for any number of threads.
"""

import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

PROGRAM, CONFIG = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
REALIZATIONS, PERIODS, REPEATS = [int(argument) for argument in sys.argv[3:]] + [3, 3, 5][len(sys.argv) - 3:]


def shortened(config):
    """The text of the experiment with other numbers and nothing held back."""
    text = config.read_text()
    stage = re.search(r"^stage: (\S+)", text, re.M)[1]
    text = text.replace(f"stage: {stage}", f"stage: {(config.parent / stage).resolve()}")
    text = re.sub(r"^validation:\n( .*\n?)*", "", text, flags=re.M)
    for key, value in (("realizations", REALIZATIONS), ("periods", PERIODS)):
        text, found = re.subn(rf"^  {key}: \d+", f"  {key}: {value}", text, flags=re.M)
        assert found == 1, f"{config}: {key} of the experiment is not there"
    return text


def child(*words):
    """Runs the program: seconds by the wall's clock, of the processors, peak memory in MB."""
    begin = time.perf_counter()
    process = subprocess.Popen([PROGRAM, "--verbosity", "quiet", *words], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - begin
    if os.waitstatus_to_exitcode(status) not in (0, 3):  # 3: the data are not healthy
        sys.exit(f"stageid {' '.join(map(str, words))}: failed")
    return seconds, usage.ru_utime + usage.ru_stime, usage.ru_maxrss * 1024 / 1e6


def read_plainly(log):
    begin, used = time.perf_counter(), sum(os.times()[:2])
    piece = bytearray(1 << 20)
    with open(log, "rb", buffering=0) as file:
        while file.readinto(piece):
            pass
    return time.perf_counter() - begin, sum(os.times()[:2]) - used, 1.0


def from_disk(log, run):
    """After every page of the file has left the page cache."""
    file = os.open(log, os.O_RDONLY)
    os.fsync(file)
    os.posix_fadvise(file, 0, 0, os.POSIX_FADV_DONTNEED)
    os.close(file)
    return run()


def main():
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        log = folder / "run.slog"
        (folder / "config.yaml").write_text(shortened(CONFIG))
        child("run", folder / "config.yaml", "-o", log, "--backend", "sim", "--pace", "0")
        size = log.stat().st_size / 1e9
        ways = {
            "read plainly": lambda: read_plainly(log),
            "frf": lambda: child("frf", log, "-o", folder / "all.h5"),
            "frf --no-health": lambda: child("frf", log, "-o", folder / "fast.h5", "--no-health"),
            "frf --threads 1": lambda: child("frf", log, "-o", folder / "one.h5", "--threads", "1"),
            "disk, read plainly": lambda: from_disk(log, lambda: read_plainly(log)),
            "disk, frf": lambda: from_disk(log, lambda: child("frf", log, "-o", folder / "disk.h5")),
        }
        times = {way: [] for way in ways}
        for _ in range(REPEATS):  # alternating, so that all have the same conditions
            for way, run in ways.items():
                times[way].append(run())
        assert (folder / "all.h5").read_bytes() == (folder / "one.h5").read_bytes()
        print(f"{size:.2f} GB: {REALIZATIONS} realizations, {PERIODS} periods, load {os.getloadavg()[0]:.1f}")
        print(f"{'':20}{'wall, s':>10}{'GB/s':>8}{'processors, s':>15}{'GB a processor second':>24}{'peak, MB':>10}")
        for way, seconds in times.items():
            wall, used, _ = (min(column) for column in zip(*seconds))
            memory = max(peak for _, _, peak in seconds)
            print(f"{way:20}{wall:10.2f}{size / wall:8.2f}{used:15.2f}{size / used:24.2f}{memory:10.0f}", flush=True)


if __name__ == "__main__":
    main()
