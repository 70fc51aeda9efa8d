#!/usr/bin/python3
"""What can go wrong between `stageid run` and a stage or plant behind Modbus, row by row.

    fault_matrix.py PROGRAM SOURCE_DIR WORK_DIR [ROW ...]

The rows run side by side, because each one waits for time-outs nearly all of its time; the slow line goes first.
Each row: the exit code of the contract, a message that names the cause, a log that `log verify` accepts, and a
node that ends in a safe state. A row that cannot be tried is a failure.
"""
import concurrent.futures
import dataclasses
import pathlib
import re
import shutil
import signal
import sys
import time

from bench import Bench, CAUSE, number, RTU, TCP, wait_for_state

DONE, FAILED, WRONG, MARKED, INTERRUPTED = 0, 1, 2, 3, 130
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
    state: tuple = AT_REST  # of the node at the end; empty: unavailable


def fault(text):
    return ('--modbus-fault', text)


# A run has two or more requests for its start and one per sample; a plant is polled at 10 Hz.
def repeated_rows(line, suffix):
    return [Row(name + suffix, MARKED, 'marked', fault(text), line=line, repeated=True) for name, text in (
        ('late reply', f'late_reply@300:{LATE[line]}'), ('half a frame', 'half_frame@300'),
        ('wrong unit once', 'wrong_unit@300'), ('busy once', 'exception@300:6'))]


ROWS = repeated_rows('tcp', '') + repeated_rows('rtu', ', RTU') + [
    Row('late reply, default watchdog', MARKED, 'marked', fault(f'late_reply@300:{LATE["tcp"]}'), repeated=True,
        own_watchdog=True),
    Row('no reply for good', FAILED, 'no reply within', fault('late_reply@300x0:1.6'), state=()),
    Row('wrong unit for good', FAILED, 'corrupt', fault('wrong_unit@300x0'), state=()),
    Row('wrong unit for good, RTU', FAILED, 'corrupt', fault('wrong_unit@300x0'), line='rtu', state=()),
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
        here, there = bench.serial_line()
        options += ['--modbus-rtu', there, '--modbus-parity', 'N']
        stage = bench.stage('stage', door=f'rtu: {{device: {here}, parity: N}}')
    node, port = bench.node(*options, own_watchdog=row.own_watchdog)
    if row.line == 'tcp':
        stage = bench.stage('stage', door=f'tcp: {{port: {port}}}')
    elif row.line == 'plant':
        stage = bench.stage('stage', backend='sim', supervisor=port)
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


def faults_of(bench, row):
    node, port, options, stage = open_line(bench, row)
    log = bench.work / 'run.slog'
    run = bench.start_run(bench.experiment(stage), log, '--pace', row.pace)
    port = disturb(bench, row, node, run, options) or port
    out, err = run.communicate(timeout=(RTU if row.line == 'rtu' else TCP).run_s)
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
