"""Commands that go wrong as those of users do, in chapters. messages_files.py makes the files that they name."""

import dataclasses

# What the edits of a case change, by its name in messages.txt.
ORIGINALS = {
    "the stage": "configs/stage/small_stage.yaml",
    "the experiment": "configs/experiment/small_stage.yaml",
    "the limits": "configs/experiment/small_stage_limits.yaml",
    "the Modbus stage": "configs/stage/small_stage_modbus.yaml",
    "the map": "configs/import/bench_csv.yaml",
}
STAGE, EXPERIMENT, LIMITS, _, MAP = ORIGINALS.values()
CASES = []


@dataclasses.dataclass
class Case:
    chapter: str
    name: str
    command: str  # without the program
    edits: list  # of (key of ORIGINALS, (old text, new text))
    needs: tuple = ()  # files beside those that the command names
    rounded: bool = False  # its numbers depend on rounding
    read_only: bool = False  # the folder cannot be written
    file_bytes: int | None = None  # the largest file that can be written
    keeps: bool = False  # keeps what it has written, as a log
    environment: dict = dataclasses.field(default_factory=dict)


def chapter(title):
    def case(name, command, *edits, **properties):
        CASES.append(Case(title, name, command, list(edits), **properties))

    return case


def stage(old, new):
    return "the stage", (old, new)


def controller(text):
    return stage("controller:\n  z: &loop {crossover_hz: 20, integrator_hz: 2, lead_zero_hz: 6, lead_pole_hz: 80, "
                 "lowpass_hz: 200}\n  Ry: *loop", f"controller: {text}")


def fault(entry):
    return stage("controller:", f"faults: [{entry}]\ncontroller:")


def experiment(old, new):
    return "the experiment", (old, new)


def import_map(old, new):
    return "the map", (old, new)


FIT = "fit frf.h5 -o new.json"
CHECK_STAGE, CHECK = f"config check {STAGE}", f"config check {EXPERIMENT}"
STOPPED = {"keeps": True, "rounded": True}
DESIGN, RUN = f"design {EXPERIMENT} -o new.h5", f"run {EXPERIMENT} -o new.slog"
IMPORT = f"import bench.csv -o new.h5 --map {MAP}"

case = chapter("Command line")
case("Misspelled command", "vaildate model.json frf.h5")
case("Misspelled subcommand", "log informations run.slog")
case("Missing subcommand", "log")
case("Missing file argument", "fit -o new.json")
case("Missing output", "fit frf.h5")
case("Misspelled flag", "fit frf.h5 -o new.json --wieghting unit")
case("Flag of another command", "modes frf.h5 --weighting unit")
case("Flag without its value", "fit frf.h5 -o")
case("One limit of a band", "fit frf.h5 -o new.json --band 100")
case("Surplus argument", "modes frf.h5 held_back.h5")
case("Word instead of a number", "modes frf.h5 --prominence high")
case("Word instead of a delay", "frf run.slog -o new.h5 --compensate delay --delay short")
case("Number out of its range", f"node {STAGE} --modbus-tcp 99999")
case("Unknown verbosity", "--verbosity loud modes frf.h5")
case("Negative number of threads", f"{FIT} --threads -2")
case("Unknown value of a choice", "frf run.slog -o new.h5 --method welch")
case("Damping ratio of 1 for a mode", f"{FIT} --modes 181:1")
case("Flag given twice", "modes frf.h5 --kind response --kind whitened")
case("Help on an unknown command", "help fti")
case("Errors as JSON", "--json modes missing.h5")
case("Standard output on a full disk", "modes frf.h5 > /dev/full")

case = chapter("Files that cannot be opened")
case("Missing frequency response", "fit missing.h5 -o new.json")
case("Missing log", "frf missing.slog -o new.h5")
case("Missing experiment file", f"run missing.yaml -o new.slog")
case("Missing stage file", CHECK, experiment("../stage/small_stage.yaml", "../stage/big_stage.yaml"))
case("Folder instead of a frequency response", "fit folder -o new.json")
case("Folder instead of an experiment file", "run configs -o new.slog")
case("Output in a missing folder", "fit frf.h5 -o results/new.json")
case("Folder as output", "fit frf.h5 -o folder")
case("Output that is the input", "export model.json -o model.json")
case("Folder without write permission", "modes frf.h5 -o new.json", read_only=True)
case("Log in a folder without write permission", RUN, read_only=True)
case("Full disk during a measurement", RUN, file_bytes=200_000, **STOPPED)
case("Full disk during an estimate", "frf run.slog -o new.h5", file_bytes=20_000)
case("Log that exists", f"run {EXPERIMENT} -o run.slog", keeps=True)
case("Unsupported ending of a model", "export model.json -o model.docx")
case("Unsupported ending of a log", f"run {EXPERIMENT} -o new.csv")
case("Unsupported ending of a conversion", "log convert run.slog -o run.xlsx")
case("Unsupported picture", "plot cmif frf.h5 -o picture.jpg")
case("Report that is not a page", "report frf.h5 -o report.pdf")
case("Workbench without a response", "open model.json")
case("Folder for models of a read-only workbench", "open frf.h5 -o folder")
case("Comparison of a workbench with a log", "open frf.h5 --compare run.slog")
case("Rate of alarms without a unit", "watch model.json run.slog --false-alarms 3")
case("Log that is too short to watch", "watch model.json run.slog")
case("Run to watch around a missing model", f"{RUN} --watch none.json")
case("Option of a watch without a watch", f"{RUN} --memory 10")

case = chapter("Files of the wrong kind")
case("Log instead of a frequency response", "fit run.slog -o new.json")
case("Frequency response instead of a log", "frf frf.h5 -o new.h5")
case("Frequency response instead of a model", "validate frf.h5 held_back.h5")
case("Model instead of a frequency response", "fit model.json -o new.json")
case("Stage file instead of an experiment file", f"run {STAGE} -o new.slog")
case("Experiment file instead of a stage file", f"node {EXPERIMENT} --modbus-tcp 0")
case("Map instead of an experiment file", f"config check {MAP}")
case("Modes instead of a model", "export modes.json -o new.mat")
case("Text instead of a log", "frf letter.txt -o new.h5")
case("Text instead of a frequency response", "modes letter.h5")
case("JSON of another program", "validate notes.json frf.h5")
case("HDF5 of another program", "fit foreign.h5 -o new.json")
case("Text in a report", "report letter.txt -o new.html")

case = chapter("Stage and experiment files")
case("Empty configuration", "config check empty.yaml")
case("Random bytes", "config check noise.yaml")
case("Latin-1 text", "config check latin1.yaml")
case("Unbalanced bracket", "config check brackets.yaml")
case("Tabs as indentation", "config check tabs.yaml")
case("Alias that refers to itself", "config check alias.yaml")
case("Misspelled key", CHECK_STAGE, stage("sample_rate_hz:", "sampel_rate_hz:"))
case("Key with another unit", CHECK_STAGE, stage("delay_s: 600e-6 ", "delay_us: 600 "))
case("Missing key", CHECK_STAGE, stage("sample_rate_hz: 2000\n", ""))
case("Number with a unit", CHECK_STAGE, stage("limit_n: 40,", "limit_n: 40 N,"))
case("Decimal comma", CHECK_STAGE, stage("mass_kg: 8", "mass_kg: '8,5'"))
case("Number that is not a number", CHECK_STAGE, stage("mass_kg: 8", "mass_kg: .nan"))
case("Negative mass", CHECK_STAGE, stage("mass_kg: 8", "mass_kg: -8"))
case("Direction that is not a unit vector", CHECK_STAGE, stage("direction: [0, 0, 1]", "direction: [0, 1, 1]"))
case("Position with two coordinates", CHECK_STAGE, stage("[-0.20, -0.12, 0]", "[-0.20, -0.12]"))
case("Fault of an unknown mode", CHECK_STAGE, fault("{kind: mode_frequency, mode: 12, value: 0.1}"))
case("Fault with a negative frequency", CHECK_STAGE, fault("{kind: mode_frequency, mode: 6, value: -1.2}"))
case("Fault with too much damping", CHECK_STAGE, fault("{kind: mode_damping, value: 80}"))
case("Fault of a mode with a channel", CHECK_STAGE, fault("{kind: mode_damping, channel: s1, value: 0.1}"))
case("Fault that cannot be gradual", CHECK_STAGE, fault("{kind: dead_sensor, channel: s1, ramp_s: 1}"))
case("Duplicate channel", CHECK_STAGE, stage("name: a2", "name: a1"))
case("Limit in N of a current", CHECK_STAGE, stage("unit: N, position_m: [-0.20", "unit: A, position_m: [-0.20"))
case("Limit in two units", CHECK_STAGE, stage("limit_n: 40,", "limit_n: 40, limit: 40,"))
case("Missing limit", CHECK_STAGE, stage("limit_n: 40, ", ""))
case("Bias above the limit", CHECK_STAGE, stage("limit_n: 40,", "limit_n: 40, bias_n: 50,"))
case("Controller of two kinds", CHECK_STAGE, stage("  Ry: *loop", "  state_space: {d: [1, 0, 0, 1, 0, 1]}"))
case("Controller with a matrix of the wrong size", CHECK_STAGE, stage(
    "  Ry: *loop", "  Ry: *loop\n  state_space: {d: [1, 0]}"))
case("Controller in a file of unknown kind", CHECK_STAGE, controller("loop.doc"))
case("Duplicate key", CHECK_STAGE, stage("delay_s: 600e-6", "sample_rate_hz: 1000\ndelay_s: 600e-6"))
case("Undefined anchor", CHECK_STAGE, stage("Ry: *loop", "Ry: *lopp"))
case("Unknown back end", CHECK_STAGE, stage("backend: sim", "backend: ethercat"))
case("Back end without its group", f"run {EXPERIMENT} -o new.slog --backend can")
case("Crossover above half the sample rate", CHECK_STAGE, stage("crossover_hz: 20", "crossover_hz: 1500"))
case("Axis that the actuators cannot control", CHECK_STAGE, stage("  Ry: *loop", "  x: *loop"))
case("Fault of an unknown channel", CHECK_STAGE, fault("{kind: sensor_offset, channel: s9, value: 1e-6}"))
case("Unknown axis", CHECK, experiment("axes: [a1, a2, a3]", "axes: [a1, a2, a4]"))
case("Two levels", CHECK, experiment("{rms_n: 1.0}", "{rms_n: 1.0, peak_n: 2.0}"))
case("Two levels for three axes", CHECK, experiment("{rms_n: 1.0}", "{rms_n: [1.0, 2.0]}"))
case("Period that is not a number of samples", CHECK, experiment("period_s: 0.25", "period_s: 0.2501"))
case("Band above half the sample rate", CHECK, experiment("band_hz: [16, 800]", "band_hz: [16, 1800]"))
case("Reversed band", CHECK, experiment("band_hz: [16, 800]", "band_hz: [800, 16]"))
case("Band between two lines", DESIGN, experiment("band_hz: [16, 800]", "band_hz: [17, 18]"))
case("Held-back realization that is not measured", CHECK, experiment("realization: 3 ", "realization: 4 "))
case("Every realization held back", CHECK, experiment("realizations: 3", "realizations: 1"),
     experiment("realization: 3 ", "realization: 1 "))  # fmt: skip
case("Text for a weighting", CHECK, experiment("fit:\n", "fit:\n  weighting: noise\n"))
case("Suspension frequencies of a free body", CHECK, experiment("rigid_body: suspension", "rigid_body: full"))
case("Three mistakes at once", CHECK, experiment("period_s: 0.25", "period: 0.25"),
     experiment("seed: 7", "seed: seven"), experiment("lines: all", "lines: some"))  # fmt: skip
case("Unknown word for schema", "config schema stages")

case = chapter("Design and measurement")
case("Limit that would be exceeded", DESIGN, experiment("{rms_n: 1.0}", "{rms_n: 20.0}"), rounded=True)
case("Unstable controller", DESIGN, stage("crossover_hz: 20", "crossover_hz: 150"), rounded=True)
case("Controller with little margin", DESIGN, stage("crossover_hz: 20", "crossover_hz: 45"), rounded=True)
case("Pilot that has not been measured", f"design {LIMITS} -o new.h5")
case("Accuracy without a prior", f"{DESIGN} --accuracy 1e-6")
case("Excitation of another experiment", f"{RUN} --excitation excitation.h5", experiment("seed: 7", "seed: 8"))
case("Excitation that is a log", f"{RUN} --excitation run.slog")
case("Unknown back end on the command line", f"{RUN} --backend ethercat")
case("Replay without a log", f"{RUN} --backend replay")
case("Replay of a text", f"{RUN} --backend replay --replay letter.txt")
case("Controller of the stage itself, simulated", RUN, controller("peer"))
case("Plugin that is missing", RUN, stage("backend: sim", "backend: plugin\nplugin: {library: libbench.so}"))
case("Plugin that is not a library", RUN, stage("backend: sim", "backend: plugin\nplugin: {library: ../../letter.txt}"),
     needs=("letter.txt",))  # fmt: skip
case("Nobody at the address of a stage", "run configs/experiment/small_stage_modbus.yaml -o new.slog",
     *2 * [("the Modbus stage", ("port: 1502", "port: 1"))],
     ("the Modbus stage", ("\nsupervisor:", "\nsupervisor:\n  enable_s: 0.1")), keeps=True)  # fmt: skip
case("CAN frames of a stage without CAN", f"config dbc {STAGE} -o new.dbc")
case("Manual into a file", "manual -o letter.txt")
case("Resume with another experiment", f"run {EXPERIMENT} -o run.slog --resume", experiment("seed: 7", "seed: 8"),
     keeps=True)  # fmt: skip
case("Sensor that jumps", RUN, fault("{kind: sensor_offset, channel: s1, from_cycle: 1500, value: 2e-3}"), **STOPPED)
case("Sensor without a value", RUN, fault("{kind: nan_sensor, channel: s1, from_cycle: 1500}"), **STOPPED)
case("Open interlock", RUN, fault("{kind: interlock, from_cycle: 1500}"), **STOPPED)
case("Missed cycles", RUN, fault("{kind: missed_cycle, from_cycle: 1500, cycles: 400}"), **STOPPED)
case("Sensor that sticks", RUN, fault("{kind: stuck_sensor, channel: s2, from_cycle: 1500}"), **STOPPED)
REVERSED = "{kind: actuator_gain, channel: a1, from_cycle: 1500, value: -1}"
case("Actuator with the wrong sign", RUN, fault(REVERSED), **STOPPED)
case("Dashboard on a port that does not exist", f"{RUN} --dashboard 80800")
case("Node without a link", f"node {STAGE}")
case("Watchdog shorter than a repetition", f"node {STAGE} --modbus-tcp 0 --watchdog 0.06")
case("Directory of an earlier identification", f"identify {EXPERIMENT} -o .", needs=("run.slog",), keeps=True)
case("Identification with all axes at once", f"identify {EXPERIMENT} -o new", experiment("axes:", "scheme: simultaneous\n  axes:"))

case = chapter("Logs")
case("Truncated log", "log verify cut.slog")
case("Truncated log in an estimate", "frf cut.slog -o new.h5", rounded=True)
case("Changed byte", "log verify flipped.slog")
case("Random bytes as a log", "frf noise.slog -o new.h5")
case("Empty log", "log info empty.slog")
case("Run without sensors", "frf log_without_sensors.h5 -o new.h5")
case("Sensors with fewer rows", "frf log_rows.h5 -o new.h5")
case("Sample that is not finite", "frf log_nan.h5 -o new.h5")
case("Wrong period", "frf log_period.h5 -o new.h5")
case("Two runs with the same numbers", "frf log_twice.h5 -o new.h5")
case("No excitation recorded", "frf log_still.h5 -o new.h5")
case("Log without runs", "frf log_empty.h5 -o new.h5")
case("Negative sample rate", "log info log_rate.h5")
case("Dead sensor", "frf log_dead.h5 -o new.h5", rounded=True)
case("Unknown actuator", "frf run.slog -o new.h5 --inputs a1,a7")
case("Unknown sensor", "frf run.slog -o new.h5 --outputs z")
case("Realization that was not measured", "frf run.slog -o new.h5 --realizations 7")
case("Realization zero", "frf run.slog -o new.h5 --realizations 0")
case("More transient periods than periods", "frf run.slog -o new.h5 --transient-periods 9")
case("Delay without compensation", "frf run.slog -o new.h5 --delay 1e-4")
case("Even number of lines", "frf run.slog -o new.h5 --smooth-covariance 4")
case("Frequency response to be verified", "log verify frf.h5")
case("Conversion of a truncated log", "log convert cut.slog -o new.h5", rounded=True)
case("Controller file with an unknown sensor", "log info run.slog --health --stage integrator.yaml")
case("Recovery of a file that is not a log", "log recover letter.txt -o new.slog")

case = chapter("Frequency responses")
case("Empty file", "fit empty.h5 -o new.json")
case("Random bytes as a frequency response", "fit noise.h5 -o new.json")
case("Truncated frequency response", "fit cut.h5 -o new.json")
case("Response that is not finite", "fit frf_nan.h5 -o new.json")
case("Falling frequencies", "fit frf_falling.h5 -o new.json")
case("Inputs and outputs exchanged", "fit frf_transposed.h5 -o new.json")
case("Magnitudes instead of complex numbers", "fit frf_real.h5 -o new.json")
case("Version of the future", "fit frf_version.h5 -o new.json")
case("Unknown hold", "fit frf_hold.h5 -o new.json")
case("No response", "fit frf_without_response.h5 -o new.json")
case("Negative variance", "fit frf_variance.h5 -o new.json")
case("Duplicate output", "modes frf_duplicate.h5")

case = chapter("Fit")
case("Band outside of the data", f"{FIT} --band 2000 3000")
case("Reversed band of a fit", f"{FIT} --band 800 120")
case("Band with three lines", f"{FIT} --band 100 110 --modes 4")
case("Misspelled weighting", f"{FIT} --weighting relativ")
case("Weights of another shape", f"{FIT} --weighting weights_shape.h5")
case("Negative weights", f"{FIT} --weighting weights_negative.h5")
case("Weights of zero", f"{FIT} --weighting weights_zero.h5")
case("Weights with another name", f"{FIT} --weighting weights_other.h5")
case("Indefinite weights", f"{FIT} --weighting weights_indefinite.h5 --modes 4")
case("Variances that the data lack", "fit frf_bare.h5 -o new.json --weighting noise_variance")
case("Likelihood without covariances", "fit frf_bare.h5 -o new.json --weighting likelihood")
case("Missing file of modes", f"{FIT} --modes candidates.json")
case("Negative frequency of a mode", f"{FIT} --modes modes_negative.json")
case("Empty list of modes", f"{FIT} --modes modes_none.json", rounded=True)
case("Zero modes", f"{FIT} --modes 0")
case("Mode above half the sample rate", f"{FIT} --modes 180,1800")
case("Unknown rigid body", f"{FIT} --rigid-body springs")
case("Suspension within the band", f"{FIT} --rigid-body suspension:200:300")
case("Nothing to fit", f"{FIT} --modes none --rigid-body none")
case("Submodel without an order", f"{FIT} --submodel m=2")
case("Misspelled key of a submodel", f"{FIT} --submodel order=2")
case("Improper submodel", f"{FIT} --submodel n=2,m=5,f=180")
case("Rank of a submodel that is not a mode", f"{FIT} --submodel n=4,f=180:420 --residue-rank 1")
case("Delay with a unit", f"{FIT} --delay 600us")
case("Delay of a second", f"{FIT} --delay 1.0")
case("Response of zero", "fit frf_zero.h5 -o new.json")
case("Too few modes", f"{FIT} --band 120 800 --modes 1 --rigid-body none", rounded=True)
case("Too many modes", f"{FIT} --band 120 800 --modes 9 --direct-term full", rounded=True)
case("Search without a budget", f"{FIT} --search-seconds 1e-6", rounded=True)
case("Covariance in the file of the model", f"{FIT} --covariance new.json")

case = chapter("Validation, export, report and figures")
case("Truncated model", "validate cut.json held_back.h5", rounded=True)
case("Empty model", "validate empty.json held_back.h5")
case("Model of the future", "validate model_version.json held_back.h5")
case("Model without submodels", "export model_without_submodels.json -o new.mat")
case("Text for a number in a model", "validate model_text.json held_back.h5")
case("Numerator with a number too many", "validate model_shape.json held_back.h5")
case("Model of another stage", "validate model_renamed.json held_back.h5")
case("Data of another stage", "validate model.json frf_renamed.h5")
case("Model in other units", "validate model_units.json held_back.h5")
case("Data that do not match", "validate model.json frf_zero.h5", rounded=True)
case("Band without lines", "validate model.json held_back.h5 --band 3000 4000")
case("Unknown driving point", "export model.json -o new.h5 --driving-point s1 a9")
case("Driving point of a frequency response", "export frf.h5 -o new.mat --driving-point s1 a1")
case("Controller view of another stage", "export model.json -o view.json --controller-view configs/stage/wafer_stage.yaml")
case("Controller view as a matrix file", "export model.json -o view.mat --controller-view configs/stage/small_stage.yaml")
case("Covariance without a controller", "export model.json -o view.json --covariance frf.h5")
case("Response instead of a covariance", "export model.json -o view.json --controller-view configs/stage/small_stage.yaml --covariance frf.h5")
case("C code with a name that is not C's", "export model.json -o my-plant.h")
case("Unsupported version of MATLAB", "export model.json -o new.mat --mat-version 6")
case("Unknown figure", "plot nyquist frf.h5 -o new.pdf")
case("Figure of one element without channels", "plot entry frf.h5 -o new.pdf")
case("Figure of an unknown channel", "plot bode frf.h5 -o new.pdf --output-channel s3")
case("Figure without data", "plot bode modes.json -o new.pdf")
case("Figure without gnuplot", "plot cmif frf.h5 -o new.pdf", environment={"PATH": "/nowhere"})

case = chapter("Fleets")
case("Nothing to do", "fleet")
case("Surplus argument of a query", "fleet query new.db modes all")
case("Experiment file instead of a fleet file", f"fleet {EXPERIMENT}")
case("Number of workers below 0", "fleet --workers -1 fleet_typo.yaml")
case("Unknown subcommand of a fleet", "fleet fleet_typo.yaml reports")
case("Misspelled key of a fleet file", "fleet fleet_typo.yaml")
case("Pattern without a log", "fleet fleet_empty.yaml")
case("Table without logs", "fleet fleet_table.yaml", needs=("words.csv",))
case("Table with a wrong time", "fleet fleet_times.yaml", needs=("times.csv",))
case("Log that does not exist", "fleet job fleet_empty.yaml missing.slog")
case("Tag without a value", "fleet job fleet_empty.yaml run.slog --tag temperature")
case("Store that does not exist", "fleet query missing.db")
case("Text as a store", "fleet report letter.txt -o new.html")

case = chapter("Import")
case("Array file without a map", "import frf.mat -o new.slog")
case("Table without a map", "import bench.csv -o new.h5")
case("Map without an output", f"import bench.csv --map {MAP}")
case("Unknown kind of file", "import letter.txt -o new.h5")
case("Text as a table", f"import letter.csv -o new.h5 --map {MAP}")
case("Empty table", f"import empty.csv -o new.h5 --map {MAP}")
case("Row with a number too many", f"import ragged.csv -o new.h5 --map {MAP}")
case("Word in a table", f"import words.csv -o new.h5 --map {MAP}")
case("Two columns of one name", f"import duplicate.csv -o new.h5 --map {MAP}")
case("Open quote", f"import quote.csv -o new.h5 --map {MAP}")
case("Column that the table lacks", IMPORT, import_map("actuator a2 [N]", "actuator a4 [N]"))
case("One name for two columns", IMPORT, import_map("names: [s1, s2]", "names: [s1]"))
case("Rows past the end", IMPORT, import_map("first_row: 20000, rows: 2500", "first_row: 20000, rows: 9000"))
SECOND_RUN = "experiment: 1, first_row: 2500"
case("Two runs of one number in a map", IMPORT, import_map(SECOND_RUN, "experiment: 0, first_row: 2500"))
case("Wrong period in a map", IMPORT, import_map("period_samples: 500", "period_samples: 250"))
case("Ambiguous unit", IMPORT, import_map("names: [s1, s2], unit: m}", "names: [s1, s2], unit: g}"))
case("Unknown kind of a map", IMPORT, import_map("kind: log", "kind: logs"))
case("Misspelled key of a map", IMPORT, import_map("sensors:", "sensor:"))
case("Truncated MATLAB file", "import cut.mat")
case("Random bytes as a MATLAB file", "import noise.mat")
case("Truncated archive", "import cut.npz")
case("Python objects", "import objects.npz")
case("Truncated universal file", "import cut.unv -o new.h5")
case("Truncated binary universal file", "import cut.uff -o new.h5", rounded=True)
case("Text as a universal file", "import letter.unv -o new.h5")
case("Mode shapes as a frequency response", "import shapes.unv -o new.h5")
case("Touchstone without ports", "import nameless.snp -o new.h5")
case("Unknown Touchstone parameters", "import option.s1p -o new.h5")
case("Truncated Touchstone file", "import cut.s2p -o new.h5")
case("Touchstone 2", "import version.s1p -o new.h5")
