#!/usr/bin/python3
"""What can go wrong between `stageid run` and a stage or plant behind Modbus, row by row.

    fault_matrix.py PROGRAM SOURCE_DIR WORK_DIR [ROW ...]

The rows run side by side, because each one waits for time-outs nearly all of its time; the slow line goes first.
Each row: the exit code of the contract, a message that names the cause, a log that `log verify` accepts, and a
node that ends in a safe state. A row that cannot be tried is a failure.
"""
import collections.abc
import concurrent.futures
import dataclasses
import json
import pathlib
import random
import re
import shutil
import signal
import sys
import time

from bench import Bench, CAUSE, number, RTU, TCP, wait_for_state
from peers import modbus_crc

DONE, FAILED, WRONG, MARKED, LIMIT, INTERRUPTED = 0, 1, 2, 3, 4, 130
AT_REST = ('switch on disabled', 'fault')
SLOW = 0.05  # of the stage's time: 0.4 s per cycle, so that a line on a busy machine is not late without a fault
SIDE_BY_SIDE = 8
LATE = {'tcp': 0.6, 'rtu': 2.4}  # s: past the response time-out, before the worst reply


@dataclasses.dataclass
class Row:
    name: str
    exit_code: int
    message: str  # part of stderr
    faults: tuple = ()  # of the node
    line: str = 'tcp'  # tcp, rtu, plant (simulated stage, supervisor behind Modbus)
    pace: float = 0.0
    disturb: str = ''  # a later event of a process
    log: bool = True  # whether there is one
    repeated: bool = False  # at least one cycle; more on a busy machine
    own_watchdog: bool = False  # of the node: its default
    misses_allowed: int = 10  # fewer for a slow line, where each one takes two worst replies
    alter: collections.abc.Callable = None  # what the wire makes of a reply: see ModbusRelay
    marked: range = None  # samples in the log
    short: bool = False  # five seconds of one axis at pace 1
    others: tuple = None  # on the line: see SharedLine
    within_s: float = 150.0
    state: tuple = AT_REST  # of the node at the end; empty: unavailable


def fault(text):
    return ('--modbus-fault', text)


# A run has two or more requests for its start and one per sample; a plant is polled at 10 Hz.
def repeated_rows(line, suffix):
    return [Row(name + suffix, MARKED, 'marked', fault(text), line=line, repeated=True) for name, text in (
        ('late reply', f'late_reply@300:{LATE[line]}'), ('half a frame', 'half_frame@300'),
        ('wrong unit once', 'wrong_unit@300'), ('busy once', 'exception@300:6'))]


FIRST = 100  # altered sample
ALWAYS = 10 ** 9
# Registers of a measurement, from address 300 on, and of the description.
BOOT, KEY, STATUS_HIGH, STATUS_LOW, VALID, COUNT = 1, 4, 6, 7, 11, 12
MEASUREMENT, DESCRIPTION, FIRST_SCALE = 300, 500, 8


def samples(change, count=1):
    """Alters some samples of the run."""
    def alter(first, sample, registers):
        if sample is not None and FIRST <= sample < FIRST + count:
            return change(registers)
    return alter


def setting(values, count=1):
    def change(registers):
        for place, value in values.items():
            registers[place] = value
    return samples(change, count)


def status(outcome=0, state=5, cause=0, missed=0, count=1):
    return setting({STATUS_HIGH: missed << 8 | cause, STATUS_LOW: state << 8 | outcome}, count)


def first_sample_without_value(first, sample, registers):
    if first == MEASUREMENT and sample is None:
        registers[VALID] = 1


def no_key(first, sample, registers):
    if first == MEASUREMENT and sample is None:
        registers[KEY:KEY + 2] = 0, 0


def coarse_actuators(first, sample, registers):
    """A scale of 2^-40 N: the wire carries at most 2 mN."""
    if first == DESCRIPTION:
        registers[FIRST_SCALE:FIRST_SCALE + 2] = 0x2B80, 0


def late_by_up_to_a_period(first, sample, registers):
    if sample is not None and sample > 100:
        time.sleep(random.Random(sample).uniform(0.0, 0.02))


def altered(name, exit_code, message, **more):
    return Row(name, exit_code, message, short=True, **more)


def once(name, alter, marked=range(1, 2), **more):
    return altered(name, MARKED, 'marked', alter=alter, marked=marked, **more)


# The rows of docs/stops.md, "Status of a node".
STATUS = [
    once('setpoints missed', status(missed=1, count=ALWAYS)),
    once('late by its own word', status(outcome=1)),
    once('bus passive', status(outcome=5)),
    # Without a value, the force after it is not that of the controller: one more is marked.
    once('one sensor without a value', setting({VALID: 1}), range(2, 3)),
    once('no sensor with a value', setting({VALID: 0}), range(2, 3)),
    once('damaged by its own word', status(outcome=4), range(2, 3)),
    once('five samples without a value', setting({VALID: 0}, 5), range(6, 7)),
    altered('no sensor with a value for good', FAILED, 'too many bad cycles; the last one: stale', marked=range(6, 20),
        alter=setting({VALID: 0}, ALWAYS)),
    altered('a measurement beyond the range of the link', LIMIT, 'sensor s1: jumped from the predicted motion',
        alter=setting({COUNT: 0x7FFF, COUNT + 1: 0xFFFF})),
    altered('stopped at a limit', LIMIT, 'the node has stopped at a limit', alter=status(9, 8, 2)),
    altered('another state', FAILED, 'the node stopped measuring', alter=status(state=4)),
    altered('state fault beside a good outcome', FAILED, 'the node reports a fault', alter=status(0, 8, 5)),
    altered('outcome fault', FAILED, 'the node reports a fault', alter=status(outcome=8)),
    altered('an unknown outcome', FAILED, 'the node sent an unknown code', alter=status(outcome=10)),
    altered('another node answers', FAILED, 'the node was restarted, or a second node answers instead',
        alter=setting({BOOT: 77})),
    altered('no value before the run', FAILED, 'a sensor has no value before the run begins',
        alter=first_sample_without_value),
    altered('no key for the run', FAILED, 'replies do not match the requests', alter=no_key),
    altered('a force that the wire cannot carry', FAILED, "exceeds the range of the node's actuator scale",
        alter=coarse_actuators),
]
OTHER_UNITS = [frame + modbus_crc(frame) for frame in (
    bytes([2, 3, 0, 0, 0, 10]), bytes([2, 3, 20, *range(20)]), bytes([3, 0x83, 2]),
    bytes([2, 16, 0, 1, 0, 1, 2, 1, 3]))]
WIRE = [
    altered('replies late by up to a period', MARKED, 'the jitter limit', alter=late_by_up_to_a_period, pace=1,
        misses_allowed=1000, marked=range(50, 1000)),
    altered('frozen under a flood of old replies', FAILED, 'sends more than it is asked for',
        alter=samples(lambda _: False), within_s=5),
    Row('other units on the line, RTU', DONE, '', line='rtu', others=(OTHER_UNITS,)),
    Row('interrupted on a line that is never silent, RTU', INTERRUPTED, 'interrupted', line='rtu', others=(OTHER_UNITS, 20),
        disturb='interrupt', misses_allowed=4, within_s=25),
]

ROWS = STATUS + WIRE + repeated_rows('tcp', '') + repeated_rows('rtu', ', RTU') + [
    Row('late reply, default watchdog', MARKED, 'marked', fault(f'late_reply@300:{LATE["tcp"]}'), repeated=True,
        own_watchdog=True),
    Row('no reply for good', FAILED, 'no reply within', fault('late_reply@300x0:1.6'), state=()),
    Row('wrong unit for good', FAILED, 'corrupt', fault('wrong_unit@300x0'), state=()),
    Row('wrong unit for good, RTU', FAILED, 'corrupt', fault('wrong_unit@300x0'), line='rtu', state=(),
        misses_allowed=4),
    Row('exception for good', FAILED, 'refused', fault('exception@300x0:4'), state=()),
    Row('dead server', FAILED, 'not connected', fault('dead_server@300'), state=()),
    Row('frozen node', FAILED, 'no reply within', pace=1, disturb='freeze'),
    Row('frozen node, RTU', FAILED, 'no reply within', line='rtu', pace=SLOW, disturb='freeze'),
    Row('killed node', FAILED, 'not connected', pace=1, disturb='kill', state=()),
    Row('restarted node, RTU', FAILED, 'was restarted', line='rtu', pace=SLOW, disturb='restart'),
    Row('interlock seen by the node', FAILED, 'interlock', fault('interlock@300')),
    Row('temperature seen by the node', FAILED, 'temperature', fault('temperature@300:400')),
    Row('gravity compensator seen by the node', FAILED, 'gravity', fault('gravity@300:5')),
    Row('host interrupted', INTERRUPTED, 'interrupted', pace=1, disturb='interrupt'),
    Row('host killed', -signal.SIGKILL, '', pace=1, disturb='kill host', state=('fault',)),
    Row('interlock opens', FAILED, 'interlock is open', fault('interlock@15'), line='plant', pace=1),
    Row('over-temperature', FAILED, '400 K', fault('temperature@15:400'), line='plant', pace=1),
    Row('gravity compensator fails', FAILED, '5 N', fault('gravity@15:5'), line='plant', pace=1),
    Row('heartbeat stands still', FAILED, 'heartbeat stopped', fault('heartbeat@15'), line='plant', pace=1),
    Row('supervisor frozen', FAILED, 'the status is older', line='plant', pace=1, disturb='freeze'),
    Row('supervisor killed', FAILED, 'the status is older', line='plant', pace=1, disturb='kill', state=()),
    Row('supervisor late once', DONE, '', fault('late_reply@2:0.12'), line='plant'),
    Row('interlock open from the start', FAILED, 'interlock is open', fault('interlock'), line='plant', log=False,
        state=()),
    Row('heartbeat never echoed', FAILED, 'heartbeat stopped', fault('heartbeat'), line='plant', log=False),
]


def open_line(bench, row):
    """The node, its TCP port, how to start another one, and the stage file."""
    options = list(row.faults)
    if row.line == 'rtu':
        here, there = bench.serial_line() if row.others is None else bench.shared_line(*row.others)
        options += ['--modbus-rtu', there, '--modbus-parity', 'N']
        stage = bench.stage('stage', door=f'rtu: {{device: {here}, parity: N}}')
    node, port = bench.node(*options, own_watchdog=row.own_watchdog)
    if row.line == 'tcp':
        host_port = port if row.alter is None else bench.relay(port, row.alter)
        stage = bench.stage('stage', door=f'tcp: {{port: {host_port}}}')
    elif row.line == 'plant':
        stage = bench.stage('stage', backend='sim', supervisor=port)
    stage.write_text(stage.read_text() + f'realtime: {{misses_allowed: {row.misses_allowed}}}\n')
    return node, port, options, stage


def disturb(bench, row, node, run, options):
    """@return the port of the node that is there afterwards, if it is another one."""
    if not row.disturb:
        return None
    time.sleep(1.0)  # during the run; the exact time does not matter
    if row.disturb == 'freeze':
        node.send_signal(signal.SIGSTOP)
    elif row.disturb in ('kill', 'restart'):
        node.kill()
        node.wait()
        if row.disturb == 'restart':
            return bench.node(*options)[1]
    elif row.disturb == 'interrupt':
        run.send_signal(signal.SIGINT)
    elif row.disturb == 'kill host':
        run.kill()
    return None


def marked_samples(bench, log):
    runs = json.loads(bench.run('log', 'info', log, '--json').stdout)['runs']
    return sum(run['health']['marked'] for run in runs)


def faults_of(bench, row):
    node, port, options, stage = open_line(bench, row)
    log = bench.work / 'run.slog'
    began = time.monotonic()
    run = bench.start_run(bench.experiment(stage, short=row.short), log, '--pace', row.pace)
    port = disturb(bench, row, node, run, options) or port
    out, err = run.communicate(timeout=(RTU if row.line == 'rtu' else TCP).run_s)
    if time.monotonic() - began > row.within_s:
        yield f'took {time.monotonic() - began:.1f} s'
    if run.returncode != row.exit_code:
        yield f'exit code {run.returncode}, not {row.exit_code}: {out}{err}'
    if row.message not in err:
        yield f'no word of "{row.message}": {err}'
    if len([line for line in err.splitlines() if line.startswith('stageid:')]) > 1:
        yield f'more than one line: {err}'
    if row.repeated and not re.search(r' [1-9]\d* late, 0 missing', out):
        yield f'no late cycle, or a missing one: {out}'
    if log.exists() != row.log:
        yield f'a log {"is" if log.exists() else "is not"} there'
    if log.exists():
        verified = bench.run('log', 'verify', log)
        if verified.returncode not in (0, 3) and row.disturb != 'kill host':
            yield f'log verify: {verified.returncode} {verified.stdout}{verified.stderr}'
        if row.marked is not None and (marked := marked_samples(bench, log)) not in row.marked:
            yield f'{marked} samples are marked, not {row.marked}'
    if row.disturb == 'freeze':
        node.send_signal(signal.SIGCONT)
    if row.state:
        state = wait_for_state(port, row.state)
        if state not in row.state:
            yield f'the node is left in state {state}, cause {number(port, CAUSE)}'


def tried(program, source, folder, row):
    """What was found wrong, and the time that it took."""
    shutil.rmtree(folder, ignore_errors=True)
    began = time.monotonic()
    try:
        with Bench(program, source, folder) as bench:
            found = list(faults_of(bench, row))
    except Exception as error:  # a row that cannot run is a failure; the others still run
        found = [f'{type(error).__name__}: {error}']
    return found, time.monotonic() - began


def main():
    program, source, work = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3])
    wanted = sys.argv[4:]
    rows = sorted((row for row in ROWS if not wanted or row.name in wanted), key=lambda row: row.line != 'rtu')
    failed = 0
    with concurrent.futures.ThreadPoolExecutor(SIDE_BY_SIDE) as pool:
        results = [(row, pool.submit(tried, program, source, work / f'row{ROWS.index(row)}', row)) for row in rows]
        for row, result in results:
            found, took_s = result.result()
            failed += bool(found)
            print(f'{"FAIL" if found else "ok  "} {row.name} ({took_s:.1f} s)', *found, sep='\n     ', flush=True)
    sys.exit(f'{failed} of {len(rows)} rows failed' if failed else 0)


if __name__ == '__main__':
    main()
