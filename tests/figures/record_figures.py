#!/usr/bin/env python3
"""Runs some thirty commands and records a hash of every number that they write.

    record_figures.py PROGRAM SOURCE_DIR WORK_DIR FIGURES.json [--against OLDER.json]

A change of structure may not change a figure. Record the figures with the program before the change, and again after
it with --against: every output whose numbers differ is printed, exit status 1.

Hashed are the numbers of a file: datasets and attributes of HDF5, arrays of .npz and .mat, numbers of JSON, every
number of a text format. Left out is what differs between two runs of one program: times, durations, paths, versions
and fingerprints of files that contain them. Needs the Python that numpy, scipy and h5py are packaged for.
"""

import argparse
import hashlib
import json
import math
import pathlib
import re
import subprocess
import sys

import h5py
import numpy
import scipy.io

NOT_FIGURES = re.compile(r"time|_at$|created|duration|seconds|wall|cpu|version|fingerprint|uuid|host|path|provenance|"
                         r"latency|jitter|late|bytes|pid|threads|metadata|elapsed")
NUMBER = re.compile(rb"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w])")
DATE = re.compile(rb"\d{4}-\d\d-\d\d[T ][\d:.]+Z?|\d\d-[A-Z][a-z]{2}-\d\d(?:\d\d)? ?[\d:]*|\d\d:\d\d:\d\d")


class Figures:
    """A hash of numbers, fed in a fixed order."""

    def __init__(self):
        self.hash = hashlib.sha256()
        self.count = 0

    def add(self, name, values):
        values = numpy.ascontiguousarray(values)
        self.hash.update(f"{name} {values.dtype} {values.shape}\n".encode())
        self.hash.update(values.tobytes())
        self.count += values.size

    def text(self):
        return f"{self.hash.hexdigest()[:24]} {self.count}"


def of_hdf5(path, figures):
    def visit(name, item):
        for key, value in sorted(item.attrs.items()):
            value = numpy.asarray(value)
            if value.dtype.kind in "biufc" and not NOT_FIGURES.search(key):
                figures.add(f"{name}@{key}", value)
        if isinstance(item, h5py.Dataset) and item.dtype.kind in "biufcV" and not NOT_FIGURES.search(name):
            figures.add(name, item[()])

    with h5py.File(path) as file:
        visit("/", file)
        file.visititems(visit)


def of_json(value, figures, name=""):
    if isinstance(value, dict):
        for key in sorted(value):
            if not NOT_FIGURES.search(key):
                of_json(value[key], figures, f"{name}/{key}")
    elif isinstance(value, list):
        for i, entry in enumerate(value):
            of_json(entry, figures, f"{name}/{i}")
    elif isinstance(value, (bool, int, float)) and math.isfinite(value):
        figures.add(name, numpy.float64(value))


def of_text(data, figures):
    numbers = NUMBER.findall(DATE.sub(b"", data))
    figures.hash.update(b"\n".join(numbers))
    figures.count += len(numbers)


def of_file(path):
    figures = Figures()
    suffix = path.suffix
    if suffix == ".h5" or (suffix == ".mat" and path.read_bytes()[:10] == b"MATLAB 7.3"):
        of_hdf5(path, figures)
    elif suffix == ".mat":
        for name, value in sorted(scipy.io.loadmat(path).items()):
            if isinstance(value, numpy.ndarray) and value.dtype.kind in "biufc" and not NOT_FIGURES.search(name):
                figures.add(name, value)
    elif suffix == ".npz":
        with numpy.load(path) as arrays:
            for name in sorted(arrays.files):
                if arrays[name].dtype.kind in "biufc" and not NOT_FIGURES.search(name):
                    figures.add(name, arrays[name])
    elif suffix == ".json":
        of_json(json.loads(path.read_text()), figures)
    elif suffix == ".uff":
        lines = path.read_bytes().split(b"\n")  # the headers carry dates, the rest is binary
        of_text(b"\n".join(line for line in lines if b"stageid" not in line), figures)
    else:
        of_text(path.read_bytes(), figures)
    return figures.text()


def commands(source, data):
    """(name, arguments, outputs). A stand-in {w} is the folder of the work."""
    experiment, stage = source / "configs/experiment", source / "configs/stage"
    small = experiment / "small_stage.yaml"
    yield "design small", ["design", small, "-o", "{w}/excitation.h5"], ["excitation.h5"]
    yield "design paper", ["design", experiment / "wafer_stage_paper.yaml", "-o", "{w}/paper.h5", "--force"], ["paper.h5"]
    yield "design zippered", ["design", experiment / "small_stage_zippered.yaml", "-o", "{w}/zip.h5"], ["zip.h5"]
    yield "run small", ["run", small, "-o", "{w}/run.slog"], []
    yield "run small by rotation", ["run", experiment / "small_stage_zippered.yaml", "-o", "{w}/zip.slog"], []
    for kind in ("h5", "csv", "mat"):
        yield f"convert {kind}", ["log", "convert", "{w}/run.slog", "-o", f"{{w}}/run.{kind}"], [f"run.{kind}"]
    yield "health", ["--json", "log", "info", "{w}/run.slog", "--health"], ["health.json"]
    yield "frf", ["frf", "{w}/run.slog", "-o", "{w}/frf.h5", "--realizations", "1,2"], ["frf.h5"]
    yield "frf held back", ["frf", "{w}/run.slog", "-o", "{w}/held.h5", "--realizations", "3"], ["held.h5"]
    yield "frf lpm", ["frf", "{w}/run.slog", "-o", "{w}/lpm.h5", "--method", "lpm"], ["lpm.h5"]
    yield "frf zippered", ["frf", "{w}/zip.slog", "-o", "{w}/zipfrf.h5"], ["zipfrf.h5"]
    yield "frf full", ["frf", "{w}/run.slog", "-o", "{w}/full.h5", "--covariance", "full"], ["full.h5"]
    yield "modes", ["modes", "{w}/frf.h5", "-o", "{w}/modes.json"], ["modes.json"]
    yield "fit", ["fit", "{w}/frf.h5", "-o", "{w}/model.json"], ["model.json"]
    yield "fit given", ["fit", "{w}/frf.h5", "-o", "{w}/given.json", "--rigid-body", "suspension:0.4:0.5",
                        "--direct-term", "full"], ["given.json"]
    yield "fit general", ["fit", "{w}/frf.h5", "-o", "{w}/general.json", "--damping", "general"], ["general.json"]
    yield "fit likelihood", ["fit", "{w}/full.h5", "-o", "{w}/likelihood.json", "--weighting", "likelihood"], \
        ["likelihood.json"]
    yield "validate", ["--json", "validate", "{w}/model.json", "{w}/held.h5"], ["validate.json"]
    for kind in ("h5", "mat", "npz", "csv", "unv", "py", "m"):
        yield f"export model {kind}", ["export", "{w}/model.json", "-o", f"{{w}}/model.{kind}"], [f"model.{kind}"]
    for kind in ("mat", "npz", "csv", "unv", "uff"):
        yield f"export frf {kind}", ["export", "{w}/frf.h5", "-o", f"{{w}}/x.{kind}"], [f"x.{kind}"]
        yield f"import frf {kind}", ["import", f"{{w}}/x.{kind}", "-o", f"{{w}}/from_{kind}.h5"], [f"from_{kind}.h5"]
    yield "pilot", ["run", experiment / "wafer_stage_pilot.yaml", "-o", "{w}/pilot.slog"], []
    yield "quick stage", ["identify", experiment / "wafer_stage_quick.yaml", "-o", "{w}/quick"], \
        ["quick/frf.h5", "quick/model.json", "quick/summary.json", "quick/excitation.h5"]
    if not data.is_dir():
        return
    yield "foreign log", ["frf", data / "foreign_log/log.h5", "-o", "{w}/foreign.h5"], ["foreign.h5"]
    for name, arguments in {
            "iss1r_exact": ["--modes", "12"], "iss1r_noise60": ["--modes", "12"], "two_inertia_1x2": [], "wafer4x13": [],
            "f16_1x3": ["--modes", "11"]}.items():
        yield f"fit {name}", ["fit", data / f"frf/{name}.h5", "-o", f"{{w}}/{name}.json", *arguments], [f"{name}.json"]


def main():
    parser = argparse.ArgumentParser()
    for name in ("program", "source", "work", "figures"):
        parser.add_argument(name, type=pathlib.Path)
    parser.add_argument("--against", type=pathlib.Path)
    given = parser.parse_args()
    source, work = given.source.resolve(), given.work.resolve()
    work.mkdir(parents=True, exist_ok=True)
    found = {}
    for name, arguments, outputs in commands(source, source.parent / "shared/data"):
        words = [str(a).replace("{w}", str(work)) for a in arguments]
        done = subprocess.run([given.program.resolve(), *words], capture_output=True, check=False, cwd=work)
        found[f"{name}: exit code"] = str(done.returncode)
        if "--json" in words:
            (work / outputs[0]).write_bytes(done.stdout)
        for output in outputs:
            path = work / output
            found[f"{name}: {output}"] = of_file(path) if path.exists() else "missing"
        print(f"{name}: exit {done.returncode}", flush=True)
    given.figures.write_text(json.dumps(found, indent=1) + "\n")
    if not given.against:
        return 0
    older = json.loads(given.against.read_text())
    different = [name for name in sorted(older.keys() | found.keys()) if older.get(name) != found.get(name)]
    for name in different:
        print(f"DIFFERENT {name}: {older.get(name)} -> {found.get(name)}")
    print(f"{len(found)} figures, {len(different)} different")
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
