#!/usr/bin/python3
"""Power fails while a command writes. Of what was not synchronized, any names and any sectors of the disk survive, in any
order. Then an output is as before or complete, a log has every row that was synchronized and no wrong one, and an
experiment can be resumed.

    power_cut_test.py PROGRAM CONFIGS RECORDER WORK_DIR ORDERS [SEED]
RECORDER: the library made of sync_recorder.c
ORDERS: how many states of the disk for identify; ten times as many for the log, at least 100 for each command
"""

import json
import os
import pathlib
import random
import shutil
import subprocess
import sys

import h5py
import numpy as np

from commands import COMMANDS, EXPERIMENT, prepare, words

PROGRAM, CONFIGS, RECORDER, WORK = (pathlib.Path(argument).resolve() for argument in sys.argv[1:5])
ORDERS = int(sys.argv[5])
OUTPUT_ORDERS = max(ORDERS, 100)  # in fewer, one of the two possible contents may not occur
DICE = random.Random(int(sys.argv[6]) if len(sys.argv) > 6 else 1)
OUT = WORK / "out"
SECTOR = 512
MARKED = 1 << 8

BLOCK = np.dtype([("magic", "S8"), ("type", "<u2"), ("version", "<u2"), ("log_id", "<u4"), ("sequence", "<u8"),
                  ("run", "<u4"), ("cols", "<u4"), ("first_row", "<u8"), ("rows", "<u4"), ("bytes", "<u4"),
                  ("time_ns", "<i8"), ("payload_crc", "<u4"), ("header_crc", "<u4")])


def stageid(*arguments, **environment):
    return subprocess.run([PROGRAM, *arguments], cwd=WORK, capture_output=True, text=True, errors="replace", check=False,
                          env=os.environ | environment, timeout=300)


class Trace:
    """What a command did to the files in OUT: the durable names and bytes after each event, and those to come."""

    def __init__(self, arguments):
        to = WORK / "trace"
        shutil.rmtree(to, ignore_errors=True)
        to.mkdir()
        visible = [self.listing()]  # the durable names, and those since
        data = {inode: (OUT / name).read_bytes() for name, inode in visible[0].items()}
        done = stageid(*arguments, LD_PRELOAD=str(RECORDER), STAGEID_SYNC_OF=str(OUT), STAGEID_SYNC_TO=str(to))
        self.returncode = done.returncode
        if done.returncode not in (0, 3):
            sys.exit(f"{' '.join(arguments)}: {done.stderr}")
        self.final = {name: (OUT / name).read_bytes() for name in self.listing()}
        events = [line.split("\t") for line in (to / "trace").read_text().splitlines()]
        self.states = [(visible, dict(data))]
        for kind, *words in events:
            if kind == "data":
                inode, copy, *words = words
                data[int(inode)] = (to / copy).read_bytes()
            seen = {name: int(inode) for name, inode in (word.rsplit("=", 1) for word in words)}
            visible = [seen] if kind == "names" else [*visible, seen]
            self.states.append((visible, dict(data)))

    @staticmethod
    def listing():
        return {file.name: file.stat().st_ino for file in OUT.iterdir()}

    def cut(self):
        """Power fails after a random event. Returns the files, and the bytes of each that were durable."""
        at = DICE.randrange(len(self.states))
        visible, data = self.states[at]
        coming, _ = self.states[min(at + 1, len(self.states) - 1)]
        names = DICE.choice([*visible, coming[-1]])
        files = {name: torn(data.get(inode, b""), self.coming(at, inode)) for name, inode in names.items()}
        durable = {name: data.get(inode, b"") for name, inode in visible[0].items()}
        return files, durable

    def coming(self, at, inode):
        """The bytes of a file at its next synchronization."""
        now = self.states[at][1].get(inode)
        return next((data[inode] for _, data in self.states[at:] if data.get(inode) != now), now or b"")


def torn(old, new):
    """Any sectors of what is to come have reached the disk, and any size has."""
    size = DICE.choice([len(old), len(new), DICE.randint(*sorted((len(old), len(new))))])
    likely = DICE.choice([0.02, 0.5, 0.98])
    out = bytearray(old[:size].ljust(size, b"\0"))
    for at in range(0, size, SECTOR):
        if DICE.random() < likely:
            part = new[at:min(at + SECTOR, size)]
            out[at:at + len(part)] = part
    return bytes(out)


def blocks(content):
    at = 0
    while at + BLOCK.itemsize <= len(content):
        head = np.frombuffer(content, BLOCK, 1, at)[0]
        if head["magic"] != b"\x89SLOG\r\n\x1a":
            return
        size = int(head["bytes"])
        if at + BLOCK.itemsize + size > len(content):
            return
        yield head, content[at + BLOCK.itemsize:at + BLOCK.itemsize + size]
        at += BLOCK.itemsize + -(-size // 64) * 64


def rows_of(content):
    """Unmarked rows of an undamaged log by realization, experiment and number, of complete runs and of all."""
    everything, complete, run = {}, {}, {}
    for head, payload in blocks(content):
        if head["type"] == 2:
            begin = json.loads(payload)
            key, run = (begin["realization"], begin["experiment"]), {}
        elif head["type"] == 4:
            rows = np.frombuffer(payload, "<u8").reshape(head["rows"], head["cols"])
            for n, row in enumerate(rows):
                if not int(row[-1]) & MARKED:
                    run[(*key, int(head["first_row"]) + n)] = row.tobytes()
            everything |= run
        elif head["type"] == 5 and json.loads(payload)["complete"]:
            complete |= run
    return everything, complete


def resume(file):
    return stageid("run", EXPERIMENT, "-o", file, "--resume")


class LogCheck:
    def __init__(self, truth):
        self.truth = rows_of(truth)[0]
        self.refused = 0

    def problem(self, content, durable, also_resume):
        cut, recovered = WORK / "cut.slog", WORK / "recovered.slog"
        for file in WORK.glob("cut.slog*"):
            file.unlink()
        cut.write_bytes(content)
        recovered.unlink(missing_ok=True)
        acknowledged, _ = rows_of(durable)
        done = stageid("log", "recover", cut, "-o", recovered)
        if done.returncode == 0:
            rows, _ = rows_of(recovered.read_bytes())
            if wrong := [key for key, row in rows.items() if key[0] >= 0 and self.truth[key] != row]:
                return f"{len(wrong)} wrong rows, e.g. {wrong[0]}"
            if missing := acknowledged.keys() - rows.keys():
                return f"{len(missing)} synchronized rows are lost, e.g. {min(missing)}"
        elif acknowledged or done.returncode != 2:
            return f"recover: exit code {done.returncode}: {done.stderr}"
        else:
            self.refused += 1
        if not also_resume:
            return ""
        done = resume(cut)
        if done.returncode == 2 and "log recover" in done.stderr and recovered.exists():
            cut = recovered
            done = resume(cut)
        if done.returncode != 0:
            return f"resume: exit code {done.returncode}: {done.stderr}"
        _, complete = rows_of(cut.read_bytes())
        return "" if complete == self.truth else "the resumed log differs from the one without a cut"


def check_log(name, trace, truth, orders, failures):
    check = LogCheck(truth)
    for order in range(orders):
        files, durable = trace.cut()
        if name not in files:
            if durable.get(name):
                failures.append(f"{name}: order {order}: the synchronized log has no name")
            continue
        if what := check.problem(files[name], durable.get(name, b""), order % 20 == 0):
            failures.append(f"{name}: order {order}: {what}")
            (WORK / f"failed_{len(failures)}.slog").write_bytes(files[name])
    print(f"{name}: {orders} orders, of {check.refused} nothing to recover")


def numbers(folder):
    with h5py.File(folder / "frf.h5") as frf:
        return frf["response"][:], json.loads((folder / "model.json").read_text())["submodels"]


def check_identify(orders, failures):
    """The whole of identify is continued after a cut, and ends as without one."""
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir()
    command = ["identify", EXPERIMENT, "-o"]
    trace = Trace([*command, "out"])
    response, submodels = numbers(OUT)
    cut = WORK / "cut"
    for order in range(orders):
        shutil.rmtree(cut, ignore_errors=True)
        cut.mkdir()
        for name, content in trace.cut()[0].items():
            (cut / name).write_bytes(content)
            os.utime(cut / name, (1e9, 1e9))
        done = stageid(*command, "cut", "--resume")
        if done.returncode == 2 and "log recover" in done.stderr:
            stageid("log", "recover", "cut/run.slog", "-o", "whole.slog")
            os.replace(WORK / "whole.slog", cut / "run.slog")
            done = stageid(*command, "cut", "--resume")
        if done.returncode != trace.returncode:
            failures.append(f"identify: order {order}: exit code {done.returncode}: {done.stderr[-300:]}")
            continue
        resumed = numbers(cut)
        if not np.array_equal(resumed[0], response) or resumed[1] != submodels:
            failures.append(f"identify: order {order}: other results")
    print(f"identify: {orders} orders")


def check_output(command, existing, failures):
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir()
    name = next(pathlib.Path(word).name for word in words(command) if word.startswith("out/"))
    old = b"another file"
    if existing:
        (OUT / name).write_bytes(old)
    trace = Trace(words(command))
    allowed = {trace.final[name], old if existing else None}
    seen = set()
    for order in range(OUTPUT_ORDERS):
        files, _ = trace.cut()
        content = files.get(name)
        seen.add(content)
        if content not in allowed:
            failures.append(f"{command}: order {order}: neither as before nor complete")
            break
    if seen != allowed:
        failures.append(f"{command}: only {len(seen)} of 2 contents were seen: is the recorder at work?")


def main():
    prepare(PROGRAM, CONFIGS, WORK)
    OUT.mkdir()
    failures = []
    trace = Trace(words("run"))
    check_log("o.slog", trace, trace.final["o.slog"], 10 * ORDERS, failures)
    check_identify(ORDERS, failures)
    for command in list(COMMANDS)[1:]:  # the first is run
        check_output(command, False, failures)
        if command != "recover":  # logs are never overwritten
            check_output(command, True, failures)
    print(f"{len(COMMANDS) - 1} commands: {OUTPUT_ORDERS} orders of a new file each, as many of a replaced one")
    print("\n".join(failures[:50]), f"\n{len(failures)} failures")
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
