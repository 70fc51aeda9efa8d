#!/usr/bin/python3
"""Experiments over Modbus TCP and RTU, and other programs at our node.

    peer_test.py PROGRAM SOURCE_DIR WORK_DIR

The FRF measured through the wire is that of the simulator in the process, but for the wire's quantization;
mbpoll and pymodbus read what docs/modbus-map.md says; a link that is too slow is refused with its figures.
"""
import json
import pathlib
import random
import signal
import socket
import struct
import subprocess
import sys
import time
import unittest

import h5py
import numpy as np
from pymodbus.client import ModbusTcpClient

from bench import Bench, BOOT_ID, RTU, STATE, STATUS, number, registers, wait_for_state
from peers import ModbusConnection, resident_bytes
from processes import run_side_by_side

PROGRAM, SOURCE, WORK = sys.argv[1:4]
MAP = (pathlib.Path(SOURCE) / 'docs/modbus-map.md').read_text()


def map_row(name):
    """Address and type of an entry, as the document for people says."""
    for line in MAP.splitlines():
        cells = [cell.strip() for cell in line.strip('|').split('|')]
        if len(cells) == 7 and cells[2].split('[')[0] == name:
            return int(cells[0]), cells[3]
    raise KeyError(name)


def forged_request(dice):
    """Of someone who wants to control the run, and guesses its key."""
    words = [dice.choice((1, 2, dice.getrandbits(32))) for _ in range(5)]
    return struct.pack('>BHHHHB5I', 23, 300, 10, dice.choice((16, 24, 26)), 10, 20, *words)


def random_request(dice):
    """Of a function and length that the node knows, or not."""
    pdu = bytearray(dice.randbytes(dice.randrange(1, 60)))
    pdu[0] = dice.choice((3, 4, 6, 16, 23))
    if len(pdu) > 9 and dice.random() < 0.5:  # consistent lengths, low addresses
        pdu[1] = pdu[3] = pdu[5] = pdu[7] = 0
        if pdu[0] == 16:
            pdu[4] = (len(pdu) - 6) // 2
    # Commands of the supervisor do not belong to the run: any client may ask for a quick stop.
    at = 6 if pdu[0] == 23 else 2
    if pdu[0] not in (3, 4) and len(pdu) > at:
        pdu[at] |= 16
    return bytes(pdu)


def flood_with_requests(port, rounds, connections):
    """Ten forged and a hundred random requests per round. Returns how many were answered."""
    dice, answered = random.Random(7), 0
    clients = [ModbusConnection(port) for _ in range(connections)]
    for _ in range(rounds // connections):
        for client in clients:
            requests = [forged_request(dice) for _ in range(10)] + [random_request(dice) for _ in range(100)]
            for i, pdu in enumerate(requests):
                requests[i] = struct.pack('>HHHB', i, 0, len(pdu) + 1, 1) + pdu
            client.socket.sendall(b''.join(requests))
        for client in clients:
            answered += sum(client.frame()[0] == i for i in range(len(requests)))
    for client in clients:
        client.close()
    return answered


class ModbusTest(unittest.TestCase):
    folder = pathlib.Path(WORK)

    def setUp(self):
        self.bench = Bench(PROGRAM, SOURCE, self.folder)
        self.addCleanup(self.bench.__exit__)

    def succeed(self, *words):
        done = self.bench.run(*words)
        self.assertEqual(done.returncode, 0, done.stderr)
        return done

    def frf(self, stage, name, *options):
        log, frf = self.bench.work / f'{name}.slog', self.bench.work / f'{name}.h5'
        for command in (('run', self.bench.experiment(stage, name), '-o', log, '--pace', 0, *options),
                        ('frf', log, '-o', frf)):
            self.succeed(*command)
        with h5py.File(frf) as file:
            return file['response'][:], file['noise_variance'][:]

    def expect_same_frf(self, stage):
        through_wire, _ = self.frf(stage, 'wire')
        inside, variance = self.frf(stage, 'inside', '--backend', 'sim')
        # One count: u 2^-29 N (2 N in 2^31 - 1 counts), y 2^-35 m (40 mm); each adds a white error of count / sqrt(12). The
        # sensor noise of 1e-7 m rms is 1e4 times that, so the quantization's part of the FRF is 1e-4 of its
        # standard deviation; three times that for three actuators and the loop, ten for the extremes.
        deviation = np.abs(through_wire - inside) / np.sqrt(variance)
        self.assertLess(np.median(deviation), 3e-4)
        self.assertLess(np.sqrt(np.mean(np.abs(through_wire - inside) ** 2) / np.mean(variance)), 3e-3)
        self.assertGreater(np.max(deviation), 0.0, 'nothing was quantized: was it the wire at all?')

    def test_tcp_gives_the_same_frf(self):
        _, port = self.bench.node()
        self.expect_same_frf(self.bench.stage('stage', door=f'tcp: {{port: {port}}}'))

    def test_rtu_gives_the_same_frf(self):
        here, there = self.bench.serial_line()
        self.bench.node('--modbus-rtu', there, '--modbus-parity', 'N', tcp=False)
        self.expect_same_frf(self.bench.stage('stage', door=f'rtu: {{device: {here}, parity: N}}'))

    def test_a_supervised_stage_is_enabled_and_disabled(self):
        _, port = self.bench.node()
        stage = self.bench.stage('stage', door=f'tcp: {{port: {port}}}', supervisor=port)
        self.assertEqual(wait_for_state(port, ('switch on disabled',)), 'switch on disabled')
        self.frf(stage, 'supervised')
        self.assertEqual(wait_for_state(port, ('switch on disabled',)), 'switch on disabled')

    def held_experiment(self, port):
        stage = self.bench.stage('held_stage', door=f'tcp: {{port: {port}}}')
        stage.write_text(stage.read_text().replace(
            'stuck_sensor_s', 'between_runs: hold\nrealtime: {misses_allowed: 1000}\nstuck_sensor_s'))
        experiment = self.bench.experiment(stage, 'held', short=True)
        experiment.write_text(experiment.read_text().replace('axes: [a1]', 'axes: [a1, a2, a3]').replace(
            'realizations: 1', 'realizations: 2'))
        return experiment

    def test_a_held_stage_is_in_one_run_of_the_node_from_first_to_last(self):
        _, port = self.bench.node()
        experiment = self.held_experiment(port)
        log = self.bench.work / 'held.slog'
        done = self.bench.run('run', experiment, '-o', log, '--pace', 5)
        self.assertIn(done.returncode, (0, 3), done.stderr)  # late cycles on a busy machine
        self.assertIn('6 of 6 runs complete', done.stdout)
        events = [json.loads(line) for line in (self.bench.work / 'held.events.jsonl').read_text().splitlines()]
        holds = [event for event in events if event['event'] == 'hold']
        self.assertEqual(len(holds), 5)
        states = [event['state'] for event in events if event['event'] == 'state']
        self.assertEqual(states.count('measuring'), 1, states)
        done = self.bench.run('run', experiment, '-o', self.bench.work / 'fast.slog', '--pace', 0)
        self.assertEqual(done.returncode, 2)
        self.assertIn("needs the wall clock, because the watchdog of the node runs by it. Set 'pace: 1'", done.stderr)

    def test_ctrl_c_stops_a_held_stage(self):
        _, port = self.bench.node()
        log = self.bench.work / 'held.slog'
        run = self.bench.start_run(self.held_experiment(port), log, '--pace', 5)
        self.assertEqual(wait_for_state(port, {'measuring'}), 'measuring')
        time.sleep(1.5)
        run.send_signal(signal.SIGINT)
        _, said = run.communicate(timeout=20)
        self.assertEqual(run.returncode, 130, said)
        self.assertNotIn(wait_for_state(port, {'switch on disabled', 'operation enabled'}), ('measuring', 'fault'))

    def test_an_interrupted_experiment_is_resumed_with_a_new_node(self):
        node, port = self.bench.node('--modbus-fault', 'dead_server@3500')
        stage = self.bench.stage('stage', door=f'tcp: {{port: {port}}}')
        experiment, log = self.bench.experiment(stage), self.bench.work / 'run.slog'
        self.assertEqual(self.bench.run('run', experiment, '-o', log, '--pace', 0).returncode, 1)
        node.terminate()
        self.assertEqual(node.wait(), 0)
        self.bench.start(PROGRAM, 'node', self.bench.stage('node', backend='sim'), '--modbus-tcp', port,
                         stdout=subprocess.DEVNULL)
        while subprocess.run(['mbpoll', '-m', 'tcp', '-p', str(port), '-1', '127.0.0.1'],
                             capture_output=True).returncode != 0:
            pass
        done = self.succeed('run', experiment, '-o', log, '--pace', 0, '--resume')
        self.assertIn('3 of 3 runs complete (1 of them before)', done.stdout)

    def test_mbpoll_reads_our_map(self):
        _, port = self.bench.node()
        # mbpoll counts references from 1; -B: the more significant word first.
        for name, wanted in (('magic', 0x53544749), ('map_version', 2), ('actuators', 3), ('sensors', 2)):
            address, _ = map_row(name)
            done = subprocess.run(['mbpoll', '-m', 'tcp', '-p', str(port), '-r', str(address + 1), '-t', '4:int', '-B',
                                   '-1', '127.0.0.1'], capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertRegex(done.stdout, rf'\[{address + 1}\]:\s+{wanted}\b')

    def test_mbpoll_enables_the_stage_over_rtu(self):
        here, there = self.bench.serial_line()
        _, port = self.bench.node('--modbus-rtu', there, '--modbus-parity', 'N')
        address, _ = map_row('command')
        done = subprocess.run([*self.mbpoll_rtu(address), str(here), '1', '77'], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertEqual(wait_for_state(port, ('operation enabled',)), 'operation enabled')
        echo, _ = map_row('command_echo')
        done = subprocess.run([*self.mbpoll_rtu(echo), '-1', str(here)], capture_output=True, text=True)
        self.assertRegex(done.stdout, rf'\[{echo + 1}\]:\s+77\b')

    @staticmethod
    def mbpoll_rtu(address):
        return ['mbpoll', '-m', 'rtu', '-b', '115200', '-P', 'none', '-s', '2', '-o', str(RTU.response_s), '-r',
                str(address + 1), '-t', '4:int', '-B']

    def test_pymodbus_reads_numbers_of_every_type(self):
        _, port = self.bench.node()
        for name, wanted in (('gravity_compensator', 8 * 9.81 / 3), ('temperature', 295.0), ('sample_rate', 50.0),
                             ('actuator_scale', 2.0 ** -29), ('sensor_scale', 2.0 ** -35)):
            address, kind = map_row(name)
            self.assertEqual(kind, 'float32')
            raw = struct.pack('>2H', *registers(port, address, 2))
            self.assertAlmostEqual(struct.unpack('>f', raw)[0] / wanted, 1.0, places=6)

    def test_pymodbus_is_refused_what_it_may_not(self):
        _, port = self.bench.node()
        client = ModbusTcpClient('127.0.0.1', port=port)
        client.connect()
        self.addCleanup(client.close)
        # Beyond the map, a read-only register, too many, another unit, an unsupported function.
        self.assertEqual(client.read_holding_registers(9999, 2, slave=1).exception_code, 2)
        self.assertEqual(client.write_register(STATUS, 1, slave=1).exception_code, 2)
        self.assertEqual(client.read_holding_registers(STATE, 2, slave=9).exception_code, 11)
        self.assertEqual(client.read_coils(0, 1, slave=1).exception_code, 1)
        self.assertEqual(number(port, STATE), 1, 'the node must have come through unharmed')

    def test_a_second_host_is_refused_and_the_first_one_completes(self):
        _, port = self.bench.node()
        stage = self.bench.stage('stage', door=f'tcp: {{port: {port}}}')
        experiment = self.bench.experiment(stage, short=True)
        first = self.bench.start_run(experiment, self.bench.work / 'first.slog', '--pace', 1)
        self.assertEqual(wait_for_state(port, {'measuring'}), 'measuring')
        second = self.bench.run('run', experiment, '-o', self.bench.work / 'second.slog')
        self.assertEqual(second.returncode, 1, second.stderr)
        self.assertIn('another host measures with this stage', second.stderr)
        out, err = first.communicate(timeout=60)
        self.assertIn(first.returncode, (0, 3), err)  # late cycles on a busy machine
        self.assertIn('1 of 1 run complete', out)
        self.assertIn(' 0 missing', out)

    # 1 000 idle and 100 slow clients, 10 000 forged requests of two connections, 100 000 random ones.
    def test_a_run_is_the_same_beside_a_crowd_and_forged_requests(self):
        node, port = self.bench.node()
        stage = self.bench.stage('stage', door=f'tcp: {{port: {port}}}')
        experiment = self.bench.experiment(stage, short=True)
        experiment.write_text(experiment.read_text().replace('  periods: 1', '  periods: 2000'))

        def samples(name, meanwhile=lambda run: None):
            run = self.bench.start_run(experiment, self.bench.work / f'{name}.slog', '--pace', 0)
            meanwhile(run)
            out, err = run.communicate(timeout=100)
            self.assertEqual(run.returncode, 0, out + err)
            self.succeed('log', 'convert', self.bench.work / f'{name}.slog', '-o', self.bench.work / f'{name}.csv')
            return (self.bench.work / f'{name}.csv').read_bytes()

        def attack(run):
            self.assertEqual(wait_for_state(port, {'measuring'}), 'measuring')
            before = resident_bytes(node.pid)
            for number_of in range(1100):
                client = socket.create_connection(('127.0.0.1', port))
                self.addCleanup(client.close)
                if number_of % 11 == 0:
                    client.sendall(bytes(5))  # half a header
            answered = flood_with_requests(port, 1000, connections=10)
            self.assertIsNone(run.poll(), 'the run lasts longer than the attack')
            self.assertEqual(answered, 110_000)
            self.assertLess(resident_bytes(node.pid) - before, 8 << 20)

        quiet = samples('quiet')
        self.assertGreater(quiet.count(b'\n'), 150_000)
        self.assertEqual(samples('loud', attack), quiet)

    def test_a_node_ends_beside_clients_that_stall(self):
        node, port = self.bench.node()
        clients = [socket.create_connection(('127.0.0.1', port)) for _ in range(16)]
        for number_of, client in enumerate(clients):
            self.addCleanup(client.close)
            client.setblocking(False)
            try:
                # Half a header, or requests whose replies are not read.
                client.send(bytes(5) if number_of % 2 else struct.pack('>HHHBBHH', 1, 0, 6, 1, 3, 0, 100) * 5000)
            except BlockingIOError:
                pass
        began = time.monotonic()
        node.terminate()
        self.assertEqual(node.wait(10), 0)
        self.assertLess(time.monotonic() - began, 2.0)

    def test_two_starts_have_two_boot_ids(self):
        ids = [number(self.bench.node()[1], BOOT_ID) for _ in range(2)]
        self.assertNotEqual(ids[0], ids[1])

    def expect_refusal(self, exit_code, message, **stage):
        stage = self.bench.stage('stage', **stage)
        done = self.bench.run('run', self.bench.experiment(stage), '-o', self.bench.work / 'run.slog', '--pace', 0)
        self.assertEqual(done.returncode, exit_code, done.stderr)
        self.assertIn(message, done.stderr)
        # After several seconds, a line of progress may be added.
        self.assertEqual(len([line for line in done.stderr.splitlines() if line.startswith('stageid:')]), 1)
        self.assertFalse((self.bench.work / 'run.slog').exists() and exit_code == 2)

    def test_a_link_that_is_too_slow_is_refused_with_its_figures(self):
        # Written 4 + 2 x 3 registers, read 12 + 2 x 2: 33 + 37 bytes of 11 bits and two gaps of 3.5 characters at
        # 9600 baud are 88.2 ms, the device takes 1 ms.
        self.expect_refusal(2, '89.2 ms (33 + 37 bytes at 9600 baud)', door='rtu: {device: /dev/null, baud: 9600}')

    def test_another_unit_is_named(self):
        _, port = self.bench.node('--modbus-unit', 5)
        self.expect_refusal(1, 'unit 1: refused: Target device failed to respond', door=f'tcp: {{port: {port}}}')

    def test_silence_is_named(self):
        here, there = self.bench.serial_line()
        self.bench.node('--modbus-rtu', there, '--modbus-parity', 'N', '--modbus-unit', 5)
        self.expect_refusal(1, f'unit 1: no reply within {RTU.response_s:g} s', door=f'rtu: {{device: {here}, parity: N}}')


if __name__ == '__main__':
    sys.exit(run_side_by_side(ModbusTest, 4, alone=['test_a_run_is_the_same_beside_a_crowd_and_forged_requests']))
