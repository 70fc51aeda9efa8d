#!/usr/bin/env python3
"""Shows that watchers cannot disturb a measurement: many slow ones, some that never read, some that
only connect. In virtual time every sample must be the one of a measurement that nobody watched; against
the wall clock every run must be complete, and no sample missing.

    load_dashboard.py PROGRAM CONFIGS WORK
"""

import hashlib
import pathlib
import shutil
import socket
import struct
import sys
import threading
import time
import urllib.error
import urllib.parse

from running_program import RunningProgram, with_experiment


def connection(url, request):
    place = urllib.parse.urlsplit(url)
    link = socket.socket()
    link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
    link.connect((place.hostname, place.port))
    if request:
        link.sendall(f"GET {request} HTTP/1.1\r\nHost: {place.netloc}\r\n\r\n".encode())
    return link


class Crowd:
    """20 that read a byte now and then, 20 that never read, 20 that say nothing, and some that hammer."""

    def __init__(self, program):
        self.program, self.stop = program, threading.Event()
        self.links = [connection(program.url, "/events" if i < 40 else None) for i in range(60)]
        self.answers = 0
        self.threads = [threading.Thread(target=self.sip, daemon=True)]
        self.threads += [threading.Thread(target=self.hammer, daemon=True) for _ in range(3)]
        for thread in self.threads:
            thread.start()

    def sip(self):
        while not self.stop.wait(0.2):
            for link in self.links[:20]:
                link.settimeout(0.001)
                try:
                    link.recv(1)
                except OSError:
                    pass

    def hammer(self):
        while not self.stop.is_set():
            try:
                self.program.get("response.json")
            except (urllib.error.URLError, OSError):
                time.sleep(0.05)
            self.answers += 1

    def leave(self):
        self.stop.set()
        for thread in self.threads:
            thread.join()
        for link in self.links:
            link.close()


def run(program, config, log, crowd, *flags):
    running = RunningProgram(program, config, "-o", log, *flags, dashboard="0" if crowd else "")
    people = Crowd(running) if crowd else None
    if people:
        running.wait_until_measured()
        people.leave()
    code, out = running.wait()
    if people:
        print(f"{people.answers} requests beside 60 connections: exit code {code}, {out.splitlines()[-1]}")
    return code, out


def samples(log):
    """Hash of all sample blocks (docs/formats.md): what else a log holds tells times."""
    raw, at, found = log.read_bytes(), 0, hashlib.sha256()
    while at < len(raw):
        kind, = struct.unpack_from("<H", raw, at + 8)
        size, = struct.unpack_from("<I", raw, at + 44)
        if kind == 4:
            found.update(raw[at + 64:at + 64 + size])
        at += 64 + -(-size // 64) * 64
    return found.hexdigest()


def main():
    program, configs, work = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    config = with_experiment(configs, work, realizations=100)
    quiet, _ = run(program, config, work / "quiet.slog", False)
    loud, _ = run(program, config, work / "loud.slog", True)
    if (quiet, loud) != (0, 0):
        return f"exit codes {quiet} and {loud}"
    if samples(work / "quiet.slog") != samples(work / "loud.slog"):
        return "in virtual time the samples differ"

    config = with_experiment(configs, work, late=True, realizations=2, realization=2)
    code, out = run(program, config, work / "paced.slog", True, "--pace", "1")
    if code not in (0, 3) or "6 of 6 runs complete" not in out or " 0 missing" not in out:
        return f"against the wall clock: exit code {code}\n{out}"
    return 0


if __name__ == "__main__":
    sys.exit(main())
