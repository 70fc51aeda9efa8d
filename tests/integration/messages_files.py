"""The files that the cases of messages_cases.py name: measured and fitted by the program, or damaged here."""

import json
import pathlib
import shutil
import subprocess

import h5py
import numpy as np

# name -> the command that writes it
WRITTEN = {
    "run.slog": "run configs/experiment/small_stage.yaml -o run.slog",
    "frf.h5": "frf run.slog -o frf.h5 --realizations 1,2",
    "held_back.h5": "frf run.slog -o held_back.h5 --realizations 3",
    "model.json": "fit frf.h5 -o model.json --band 120 800 --direct-term full",
    "modes.json": "modes frf.h5 -o modes.json --band 120 800",
    "log.h5": "log convert run.slog -o log.h5",
    "bench.csv": "log convert run.slog -o bench.csv",
    "frf.csv": "export frf.h5 -o frf.csv",
    "frf.npz": "export frf.h5 -o frf.npz",
    "frf.unv": "export frf.h5 -o frf.unv",
    "frf.uff": "export frf.h5 -o frf.uff",
    "frf.mat": "export frf.h5 -o frf.mat",
    "model.unv": "export model.json -o model.unv",
    "excitation.h5": "design configs/experiment/small_stage.yaml -o excitation.h5",
}

# name -> the whole text
TEXTS = {
    "empty.yaml": "", "empty.h5": "", "empty.slog": "", "empty.json": "", "empty.csv": "", "empty.unv": "",
    "letter.txt": "Dear colleague,\nthe log is on the server.\n",
    "letter.h5": "Dear colleague,\nthe log is on the server.\n",
    "letter.csv": "Dear colleague,\nthe log is on the server.\n",
    "letter.unv": "Dear colleague,\nthe log is on the server.\n",
    "notes.json": '{"author": "me", "text": "measured on Monday"}\n',
    "brackets.yaml": "format: stageid-stage\nactuators: [{name: a1, unit: N}\nsample_rate_hz: 2000\n",
    "tabs.yaml": "format: stageid-stage\nplant:\n\tmass_kg: 8\n",
    "alias.yaml": "format: stageid-stage\nplant: &plant [*plant]\n",
    "quote.csv": 'time,"force a1\n0,1\n',
    "ragged.csv": "a,b\n1,2\n3,4,5\n",
    "words.csv": "a,b\n1,2\n3,n/a\n",
    "duplicate.csv": "a,a\n1,2\n",
    "fleet_typo.yaml": "format: stageid-fleet\nlogs: ['*.slog']\nstores: new.db\n",
    "fleet_empty.yaml": "format: stageid-fleet\nlogs: ['nowhere/*.slog']\nstore: new.db\nresults: new\n",
    "fleet_table.yaml": "format: stageid-fleet\ntable: words.csv\nstore: new.db\nresults: new\n",
    "fleet_times.yaml": "format: stageid-fleet\ntable: times.csv\nstore: new.db\nresults: new\n",
    "times.csv": "log,time_utc\nrun.slog,05/04/2026\n",
    "nameless.snp": "# HZ S RI R 50\n1 0 0\n",
    "option.s1p": "# HZ Q RI R 50\n1 0 0\n",
    "cut.s2p": "# HZ S RI R 50\n1 0 0 0 0 0 0 0 0\n2 0 0 0\n",
    "version.s1p": "[Version] 2.0\n# HZ S RI R 50\n1 0 0\n",
    "integrator.yaml": "format: stageid-controller\nsensors: [s1, s2]\nactuators: [a1, a2, a3]\nsample_rate_hz: 2000\n"
                       "transfer: [{sensor: s3, actuator: a1, numerator: [1], denominator: [1, -1]}]\n",
}  # fmt: skip


class Files:
    """Writes each file once, into `folder`."""

    def __init__(self, program, source, folder):
        self.program, self.folder = program, folder
        shutil.copytree(source / "configs", folder / "configs")

    def path(self, name):
        path = self.folder / name
        if not path.exists():
            self.write(name, path)
        return path

    def write(self, name, path):
        if name in WRITTEN:
            words = WRITTEN[name].split()
            for word in words:
                if word in WRITTEN and word != name:
                    self.path(word)
            done = subprocess.run([self.program, *words], cwd=self.folder, capture_output=True, text=True)
            if done.returncode != 0:
                raise SystemExit(f"stageid {WRITTEN[name]}: exit code {done.returncode}\n{done.stderr}")
        elif name in TEXTS:
            path.write_text(TEXTS[name])
        else:
            DAMAGED[name](self, path)


def names():
    return {*WRITTEN, *TEXTS, *DAMAGED}


DAMAGED = {}


def damaged(*file_names):
    def register(function):
        for name in file_names:
            DAMAGED[name] = function
        return function

    return register


@damaged("cut.h5", "cut.slog", "cut.json", "cut.npz", "cut.unv", "cut.uff", "cut.mat")
def cut(files, path):
    """The first three fifths, as of a copy that broke off."""
    whole = {"cut.h5": "frf.h5", "cut.slog": "run.slog", "cut.json": "model.json"}.get(path.name, f"frf{path.suffix}")
    data = files.path(whole).read_bytes()
    path.write_bytes(data[: len(data) * 3 // 5])


@damaged("noise.h5", "noise.slog", "noise.yaml", "noise.json", "noise.mat", "noise.unv")
def noise(_, path):
    path.write_bytes(np.random.default_rng(1).bytes(4096))


@damaged("flipped.slog")
def flipped(files, path):
    data = bytearray(files.path("run.slog").read_bytes())
    data[len(data) // 2] ^= 0x10
    path.write_bytes(data)


@damaged("latin1.yaml")
def latin1(_, path):
    path.write_bytes("format: stageid-stage\nname: Prüfstand\n".encode("latin-1"))


@damaged("objects.npz")
def objects(_, path):
    np.savez(path, G=np.array([{"a": 1}, None], dtype=object))


@damaged("shapes.unv")
def shapes(files, path):
    """The mode shapes alone: datasets 55, which begin and end with a line -1."""
    parts = files.path("model.unv").read_text().split("    -1\n")
    path.write_text("".join(f"    -1\n{part}    -1\n" for part in parts if part.split()[:1] == ["55"]))


@damaged("folder")
def folder(_, path):
    path.mkdir()


def replace(f, name, values):
    attributes = dict(f[name].attrs)
    del f[name]
    f[name] = values
    f[name].attrs.update(attributes)


# Changes of an HDF5 file.
def assign(name, place, value):
    return lambda f: f[name].__setitem__(place, value)


def remake(name, change):
    return lambda f: replace(f, name, change(f[name][:]))


def attribute(name, value, of="/"):
    return lambda f: f[of].attrs.__setitem__(name, value)


def remove(name):
    return lambda f: f.__delitem__(name)


def in_every_run(change):
    return lambda f: [change(run) for run in f["runs"].values()]


def without_variances(f):
    for name in ("noise_variance", "total_variance", "residual_covariance", "input_factor", "confidence_radius"):
        f.pop(name, None)
    for name in ("noise_dof", "total_dof"):
        f.attrs.pop(name, None)


# name -> the file that is copied, what is changed in it
EDITED = {
    "frf_nan.h5": ("frf.h5", assign("response", (5, 1, 2), np.nan)),
    "frf_falling.h5": ("frf.h5", remake("frequency_hz", lambda f: f[::-1])),
    "frf_transposed.h5": ("frf.h5", remake("response", lambda G: np.swapaxes(G, 1, 2))),
    "frf_real.h5": ("frf.h5", remake("response", abs)),
    "frf_version.h5": ("frf.h5", attribute("format_version", 2)),
    "frf_hold.h5": ("frf.h5", attribute("hold", "first order")),
    "frf_without_response.h5": ("frf.h5", remove("response")),
    "frf_variance.h5": ("frf.h5", assign("noise_variance", (0, 0, 0), -1.0)),
    "frf_bare.h5": ("frf.h5", without_variances),
    "frf_renamed.h5": ("held_back.h5", assign("inputs", ..., ["f1", "f2", "f3"])),
    "frf_zero.h5": ("frf.h5", assign("response", ..., 0)),
    "frf_duplicate.h5": ("frf.h5", assign("outputs", ..., ["s1", "s1"])),
    "foreign.h5": ("frf.h5", attribute("format", "bench")),
    "log_without_sensors.h5": ("log.h5", remove("runs/0003/sensors")),
    "log_rows.h5": ("log.h5", remake("runs/0003/sensors", lambda y: y[:-7])),
    "log_nan.h5": ("log.h5", assign("runs/0003/sensors", (1234, 1), np.nan)),
    "log_period.h5": ("log.h5", attribute("period_samples", 400)),
    "log_twice.h5": ("log.h5", attribute("experiment", 0, of="runs/0004")),
    "log_still.h5": ("log.h5", in_every_run(assign("excitation", ..., 0))),
    "log_dead.h5": ("log.h5", in_every_run(assign("sensors", np.s_[:, 1], 3e-6))),
    "log_empty.h5": ("log.h5", lambda f: (f.__delitem__("runs"), f.create_group("runs"))),
    "log_rate.h5": ("log.h5", attribute("sample_rate_hz", -2000.0)),
    "model_version.json": ("model.json", lambda m: m.update(format_version=7)),
    "model_without_submodels.json": ("model.json", lambda m: m.pop("submodels")),
    "model_text.json": ("model.json", lambda m: m.update(sample_rate_hz="fast")),
    "model_shape.json": ("model.json", lambda m: m["submodels"][0]["numerator"][0][0].append(1.0)),
    "model_renamed.json": ("model.json", lambda m: m.update(outputs=["z1", "z2"])),
    "model_units.json": ("model.json", lambda m: m.update(output_units=["m/s^2", "m/s^2"])),
    "modes_negative.json": ("modes.json", lambda m: m["modes"][0].update(frequency_hz=-180.0)),
    "modes_none.json": ("modes.json", lambda m: m.update(modes=[])),
}


@damaged(*EDITED)
def edited(files, path):
    of, change = EDITED[path.name]
    if path.suffix == ".json":
        content = json.loads(files.path(of).read_text())
        change(content)
        path.write_text(json.dumps(content, indent=1))
        return
    shutil.copyfile(files.path(of), path)
    with h5py.File(path, "r+") as f:
        change(f)


LINES, OUTPUTS, INPUTS = 197, 2, 3  # of frf.h5
INDEFINITE = np.diag([-1e9, *5 * [1e9]]).astype(complex)
WEIGHTS = {
    "weights_shape.h5": ("weights", np.ones((10, OUTPUTS, INPUTS))),
    "weights_negative.h5": ("weights", -np.ones((LINES, OUTPUTS, INPUTS))),
    "weights_zero.h5": ("weights", np.zeros((LINES, OUTPUTS, INPUTS))),
    "weights_other.h5": ("my_weights", np.ones((LINES, OUTPUTS, INPUTS))),
    "weights_indefinite.h5": ("weight_matrices", np.tile(INDEFINITE, (LINES, 1, 1))),
}


@damaged(*WEIGHTS)
def weights(_, path):
    name, values = WEIGHTS[path.name]
    with h5py.File(path, "w") as f:
        f[name] = values


def copy(files, name, into):
    """The file `name` in the folder `into`."""
    source = files.path(name)
    target = pathlib.Path(into) / name
    if source.is_dir():
        shutil.copytree(source, target)
    else:
        shutil.copyfile(source, target)
