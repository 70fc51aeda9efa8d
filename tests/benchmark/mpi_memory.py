#!/usr/bin/python3
"""Memory, processor time and traffic of fits to many channels in several processes.

    mpi_memory.py write FRF OUTPUTS INPUTS LINES MODES
    mpi_memory.py measure MPI_PROGRAM FRF PROCESSES [FLAG...]

`write` writes an FRF with noise, line by line, and the modes beside it (FRF with .json). `measure` fits in so many
processes, with the flags of `stageid fit`, and prints for every process peak memory and processor time, and the bytes
sent. Needs /usr/bin/time.
"""

import hashlib
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
import h5py  # noqa: E402
import numpy as np  # noqa: E402

NOISE = 1e-2  # of the rms response


def write(path, outputs, inputs, lines, modes):
    random = np.random.default_rng(1)
    channels = outputs * inputs
    frequency_hz = np.linspace(50.0, 1000.0, lines)
    modes_hz = np.linspace(100.0, 950.0, modes) * (1.0 + 0.1 / modes * random.uniform(-1.0, 1.0, modes))
    zeta = 0.02
    residues = random.standard_normal((channels, modes))
    s = 2j * np.pi * frequency_hz[:, None]
    w = 2.0 * np.pi * modes_hz
    basis = w**2 / (s**2 + 2.0 * zeta * w * s + w**2)
    noise = NOISE * np.sqrt(np.mean(np.abs(residues[:100] @ basis.T) ** 2))
    with h5py.File(path, "w") as file:
        file.attrs.update({"format": "stageid-frf", "format_version": 1, "sample_rate_hz": 0.0, "hold": "none",
                           "compensated": "none", "delay_s": 0.0})
        file["frequency_hz"] = frequency_hz
        shape = (lines, outputs, inputs)
        response = file.create_dataset("response", shape, complex)
        variance = file.create_dataset("noise_variance", shape, float)
        for name, count, unit in (("inputs", inputs, "N"), ("outputs", outputs, "m")):
            file[name] = [f"{name[0]}{i}" for i in range(count)]
            file[name].attrs["unit"] = unit
        for k in range(lines):
            of_line = residues @ basis[k].real + 1j * (residues @ basis[k].imag)
            of_line += noise / np.sqrt(2.0) * random.standard_normal(2 * channels).view(complex)
            response[k] = of_line.reshape(shape[1:])
            variance[k] = np.full(shape[1:], noise**2)
    path.with_suffix(".json").write_text(json.dumps(
        {"format": "stageid-modes", "format_version": 1,
         "modes": [{"frequency_hz": f, "damping_ratio": zeta} for f in modes_hz]}))


def measure(program, frf, processes, flags):
    with tempfile.TemporaryDirectory() as folder:
        model = pathlib.Path(folder) / "model.json"
        begin = time.perf_counter()
        done = subprocess.run(
            ["mpirun", "--quiet", "--allow-run-as-root", "--oversubscribe", "-n", str(processes),
             "/usr/bin/time", "-o", f"{folder}/times", "-a", "-f", "%M %U %S",
             program, "--verbosity", "debug", "fit", frf, "-o", model, "--threads", "1", *flags],
            capture_output=True, text=True)
        seconds = time.perf_counter() - begin
        for name in sorted(pathlib.Path(folder).glob("model.*")):
            print(f"{name.name} {hashlib.sha256(name.read_bytes()).hexdigest()[:16]}")
        print(f"{processes} processes, exit code {done.returncode}, {seconds:.1f} s")
        print("\n".join(re.findall(r".*(?:messages|cost:|relative error).*", done.stdout + done.stderr)))
        for line in sorted(pathlib.Path(f"{folder}/times").read_text().splitlines()):
            if re.fullmatch(r"\d+ [\d.]+ [\d.]+", line):
                kilobytes, user, system = map(float, line.split())
                print(f"peak {kilobytes / 1e6 * 1.024:.3f} GB, processor {user + system:.1f} s")
        if done.returncode not in (0, 3):
            print(done.stderr)


if sys.argv[1] == "write":
    write(pathlib.Path(sys.argv[2]), *map(int, sys.argv[3:]))
else:
    measure(sys.argv[2], sys.argv[3], int(sys.argv[4]), sys.argv[5:])
