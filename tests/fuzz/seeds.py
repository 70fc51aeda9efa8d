#!/usr/bin/python3
"""Writes small inputs for each fuzz target that has none yet, made by the program itself.

    seeds.py PROGRAM SOURCE_DIR OUTPUT_DIR
"""

import pathlib
import shutil
import subprocess
import sys
import zipfile

PROGRAM, SOURCE, OUTPUT = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
WORK = OUTPUT.parent / "seed_work"


def stageid(*arguments):
    done = subprocess.run([PROGRAM, *arguments], cwd=WORK, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 3):
        sys.exit(f"stageid {' '.join(arguments)}: {done.stderr}")


def seed(target, *files):
    folder = OUTPUT / target
    if folder.exists():
        return
    folder.mkdir(parents=True)
    for file in files:
        data = file if isinstance(file, bytes) else file.read_bytes()
        (folder / f"seed{len(list(folder.iterdir()))}").write_bytes(data)


def main():
    shutil.rmtree(WORK, ignore_errors=True)
    WORK.mkdir(parents=True)
    shutil.copytree(SOURCE / "configs", WORK / "configs")
    stageid("identify", "configs/experiment/small_stage_pilot.yaml", "-o", ".")
    stageid("log", "convert", "run.slog", "-o", "log.h5")
    for ending in ("csv", "npz", "mat", "uff", "unv"):
        stageid("export", "frf.h5", "-o", f"frf.{ending}")
    for ending in ("npz", "mat", "h5", "uff"):
        stageid("export", "model.json", "-o", f"model.{ending}")
    stageid("export", "model.json", "-o", "model73.mat", "--mat-version", "7.3")
    configs = WORK / "configs"
    seed("yaml", *configs.glob("*/small*.yaml"), b"a: &a {x: 1}\nb: {<<: *a, y: [1, 2]}\n")
    seed("stage", *configs.glob("stage/small*.yaml"))
    seed("map", *configs.glob("import/*.yaml"))
    seed("slog", WORK / "run.slog")
    seed("torn_slog", WORK / "run.slog", (WORK / "run.slog").read_bytes()[:100_000])
    seed("hdf5_log", WORK / "log.h5")
    seed("hdf5_frf", WORK / "frf.h5")
    seed("excitation", WORK / "excitation.h5")
    seed("hdf5_arrays", WORK / "frf.h5", WORK / "model.h5")
    seed("model", WORK / "model.json")
    seed("modes", WORK / "modes.json")
    seed("uff", WORK / "frf.uff", WORK / "frf.unv", WORK / "model.uff")
    seed("mat", WORK / "frf.mat", WORK / "model.mat", WORK / "model73.mat")
    seed("npz", WORK / "frf.npz", WORK / "model.npz")
    with zipfile.ZipFile(WORK / "frf.npz") as archive:
        seed("npy", *(archive.read(name) for name in archive.namelist()))
    seed("csv", b"".join((WORK / "frf.csv").read_bytes().splitlines(True)[:8]), b'time,"a b"\n0,1\n1,2\n', b"0;1,5\n1;2,5\n")
    seed("touchstone", b"! x\n# HZ S RI R 50\n" + b"".join(b"%d 1 0 0.5 0.1 0.5 0.1 1 0\n" % k for k in range(1, 5)))
    seed("modbus", bytes.fromhex("00010000000601030000000a"), bytes.fromhex("0103000000044409"),
         bytes.fromhex("17000000040010000204000100020000"), bytes.fromhex("10000000020400010002"))
    seed("can", *(bytes([1, 0, kind, 1, 0, 0, 0, 0]) + bytes(length) for kind, length in ((1, 25), (2, 32), (3, 56))))
    seed("dashboard", b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nRange: bytes=0-,0-\r\n\r\n",
         b"POST /abort HTTP/1.1\r\nContent-Length: 5\r\nX-Stageid: abort\r\n\r\nabort")
    shutil.rmtree(WORK)


if __name__ == "__main__":
    main()
