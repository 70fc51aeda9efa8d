"""A `stageid node` and a `stageid run` in processes of their own, and what stands between them."""
import contextlib
import dataclasses
import pathlib
import re
import signal
import subprocess
import sys
import time

from pymodbus.client import ModbusTcpClient

sys.path.append(str(pathlib.Path(__file__).parents[1]))
from peers import ModbusRelay, SharedLine  # noqa: E402

STATUS, STATE, CAUSE, BOOT_ID = 200, 208, 210, 204
STATES = ['not ready', 'switch on disabled', 'ready', 'switched on', 'operation enabled', 'measuring', 'quick stop',
          'fault reaction', 'fault']


@dataclasses.dataclass(frozen=True)
class Patience:
    """What is promised of a line. A test of time-outs must know how long the line itself may take."""

    response_s: float
    worst_reply_s: float
    watchdog_s: float  # of the node: longer than a late reply and its repetition
    run_s: float  # a run that takes longer has not detected the fault


# A pty hands its bytes on in a worker of the kernel, a transaction passes four of them, and on a busy machine one took
# 0.6 s (eight busy loops on two cores; 1.9 s for a process of nice 8) where a pipe or socket took 0.03 s.
TCP = Patience(response_s=0.4, worst_reply_s=1.0, watchdog_s=3, run_s=40)
RTU = Patience(response_s=2.0, worst_reply_s=3.0, watchdog_s=6, run_s=150)


class Bench:
    """Files and processes of one test in one folder."""

    def __init__(self, program, source, work):
        self.program, self.work = program, pathlib.Path(work)
        self.work.mkdir(parents=True, exist_ok=True)
        self.stage_text = (pathlib.Path(source) / 'configs/stage/small_stage_modbus.yaml').read_text()
        self.experiment_text = (pathlib.Path(source) / 'configs/experiment/small_stage_modbus.yaml').read_text()
        self.processes = []
        self.nodes = 0
        self.exit = contextlib.ExitStack()  # of what is no process

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.exit.close()
        for process in self.processes:
            if process.poll() is None:
                process.send_signal(signal.SIGCONT)
                process.kill()
            process.wait()

    def start(self, *command, **keywords):
        process = subprocess.Popen([str(word) for word in command], text=True, **keywords)
        self.processes.append(process)
        return process

    def serial_line(self):
        """Two ends of a line. Parity N only: a pty takes no other one twice."""
        ends = [self.work / f'line{len(self.processes)}{end}' for end in 'ab']
        self.start('socat', *[f'pty,raw,echo=0,link={end}' for end in ends])
        while not all(end.exists() for end in ends):
            time.sleep(0.01)
        return ends

    def shared_line(self, *words):
        """Two ends of a line on which other units talk, too: see SharedLine."""
        return self.exit.enter_context(contextlib.closing(SharedLine(*words))).ends

    def node(self, *options, tcp=True, own_watchdog=False):
        """A node that is ready, and its port (TCP). Its watchdog is that of the slowest line it serves, or its own."""
        patience = RTU if '--modbus-rtu' in options else TCP
        stage = self.stage('node', backend='sim')
        # A file, because a pipe would fill up.
        said = self.work / f'node{self.nodes}.txt'
        self.nodes += 1
        with open(said, 'w') as out:
            process = self.start(self.program, 'node', stage, *(['--modbus-tcp', 0] if tcp else []),
                                 *([] if own_watchdog else ['--watchdog', patience.watchdog_s]), *options, stdout=out,
                                 stderr=subprocess.STDOUT)
        process.said = said
        while 'ends it' not in said.read_text():
            if process.poll() is not None:
                raise RuntimeError(f'the node ended: {said.read_text()}')
            time.sleep(0.01)
        found = re.search(r'127\.0\.0\.1:(\d+)', said.read_text())
        return process, int(found.group(1)) if found else None

    def relay(self, port, alter):
        """The port of a wire to that node."""
        return self.exit.enter_context(contextlib.closing(ModbusRelay(port, alter))).port

    def stage(self, name, backend='modbus', door='tcp: {port: 1502}', supervisor=None, unit=1):
        text = re.sub(r'# The supervisor.*?(?=actuators:)', '', self.stage_text, flags=re.S)
        text = re.sub(r'modbus:\n(  .*\n)+', '', text)
        line = RTU if door.startswith('rtu') else TCP
        group = (f'modbus: {{{door}, unit: {unit}, response_s: {line.response_s}, '
                 f'worst_reply_s: {line.worst_reply_s}, device_s: 1e-3}}\n')
        text = text.replace('backend: modbus', f'backend: {backend}') + group
        if supervisor:
            text += (f'supervisor:\n  modbus: {{tcp: {{port: {supervisor}}}}}\n'
                     '  poll_period_s: 0.2\n  gravity_compensator_n: [20, 32]\n  temperature_k: [285, 310]\n'
                     '  enable_s: 3\n')
        path = self.work / f'{name}.yaml'
        path.write_text(text)
        return path

    def experiment(self, stage, name='experiment', short=False):
        text = self.experiment_text.replace('../stage/small_stage_modbus.yaml', str(stage))
        if short:
            for old, new in (('axes: [a1, a2, a3]', 'axes: [a1]'), ('period_s: 10', 'period_s: 2.5'),
                             ('transient_periods: 2', 'transient_periods: 1'), ('  periods: 3', '  periods: 1')):
                assert old in text
                text = text.replace(old, new)
        path = self.work / f'{name}.yaml'
        path.write_text(text)
        return path

    def start_run(self, experiment, log, *options):
        return self.start(self.program, 'run', experiment, '-o', log, *options, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE)

    def run(self, *arguments):
        return subprocess.run([self.program, *map(str, arguments)], capture_output=True, text=True, timeout=120)


def registers(port, first, count, unit=1):
    client = ModbusTcpClient('127.0.0.1', port=port)
    assert client.connect(), 'nobody listens'
    reply = client.read_holding_registers(first, count, slave=unit)
    client.close()
    assert not reply.isError(), reply
    return reply.registers


def number(port, address, unit=1):
    high, low = registers(port, address, 2, unit)
    return high << 16 | low


def wait_for_state(port, wanted):
    """Up to ten seconds; whatever is found then is returned."""
    for _ in range(500):
        state = STATES[number(port, STATE)]
        if state in wanted:
            return state
        time.sleep(0.02)
    return state
