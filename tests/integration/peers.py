"""The other end of a connection, by hand: it can also send what a library would not."""
import binascii
import contextlib
import os
import pathlib
import pty
import resource
import select
import socket
import struct
import threading
import tty

RUN_KEY, SETPOINT_SEQUENCE, MEASUREMENT = 24, 26, 300  # addresses of Modbus registers


def words(*numbers):
    """Registers of 32-bit numbers."""
    return [word for number in numbers for word in (number >> 16 & 0xFFFF, number & 0xFFFF)]


def number(registers, index=0):
    return registers[index] << 16 | registers[index + 1]


def resident_bytes(process):
    return int(pathlib.Path(f"/proc/{process}/statm").read_text().split()[1]) * resource.getpagesize()


class Connection:
    def __init__(self, port=None, accepted=None):
        self.socket = accepted or socket.create_connection(("127.0.0.1", port), timeout=10)
        self.socket.settimeout(10)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def close(self):
        self.socket.close()

    def receive(self, count):
        data = b""
        while len(data) < count:
            part = self.socket.recv(count - len(data))
            if not part:
                raise ConnectionError("the peer has closed the connection")
            data += part
        return data


class ModbusConnection(Connection):
    """Frames of Modbus TCP: transaction, protocol, length, unit; then function and data."""

    def frame(self):
        transaction, protocol, length, unit = struct.unpack(">HHHB", self.receive(7))
        assert protocol == 0
        return transaction, unit, self.receive(length - 1)

    def send_frame(self, transaction, unit, pdu):
        self.socket.sendall(struct.pack(">HHHB", transaction, 0, len(pdu) + 1, unit) + pdu)


class ModbusClient(ModbusConnection):
    """One request at a time."""

    transaction = 0

    def send(self, pdu, unit=1):
        self.transaction += 1
        self.send_frame(self.transaction, unit, pdu)
        transaction, answered, reply = self.frame()
        assert (transaction, answered) == (self.transaction, unit)
        return reply

    def ask(self, pdu, unit=1):
        """The registers of the reply, or its exception."""
        reply = self.send(pdu, unit)
        if reply[0] & 0x80:
            return f"exception {reply[1]}"
        return list(struct.unpack(f">{reply[1] // 2}H", reply[2:])) if pdu[0] in (3, 4, 23) else []

    def read(self, first, count):
        return self.ask(struct.pack(">BHH", 3, first, count))

    def write(self, first, values):
        return self.ask(struct.pack(f">BHHB{len(values)}H", 16, first, len(values), 2 * len(values), *values))

    def exchange(self, first, values, read_first, count):
        return self.ask(struct.pack(f">BHHHHB{len(values)}H", 23, read_first, count, first, len(values),
                                    2 * len(values), *values))

    def state(self):
        return number(self.read(208, 2))

    def command(self, code):
        """1 accepted, 2 refused"""
        echo = number(self.read(214, 2))
        return number(self.exchange(2, words(code, echo + 1), 214, 4), 2)

    def run_command(self, code, sequence, key=0, seed=3):
        return self.exchange(16, words(code, sequence, 0, seed, key), MEASUREMENT, 16)

    def setpoint(self, key, sequence, u=(0, 0)):
        return self.exchange(RUN_KEY, words(key, sequence, *u), MEASUREMENT, 16)


def modbus_crc(frame):
    """The two bytes behind a frame on a serial line."""
    crc = 0xFFFF
    for byte in frame:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return struct.pack("<H", crc)


class SharedLine:
    """A serial line between a host and a node: the frames of other units pass by before the host has its reply. After
    so many replies, the node is cut off and the frames never end."""

    def __init__(self, frames, replies=float("inf")):
        self.frames, self.replies = b"".join(frames), replies
        pairs = [pty.openpty() for _ in range(2)]
        (self.host, _), (self.node, _) = pairs
        self.ends = []
        for _, end in pairs:
            tty.setraw(end)
            self.ends.append(os.ttyname(end))
        self.descriptors = [one for pair in pairs for one in pair]
        self.closed = False
        self.thread = threading.Thread(target=self.carry)
        self.thread.start()

    def close(self):
        self.closed = True
        self.thread.join()
        for descriptor in self.descriptors:
            os.close(descriptor)

    def carry(self):
        while not self.closed:
            if self.replies <= 0 and select.select([], [self.host], [], 0.1)[1]:
                os.write(self.host, self.frames)
            ready, _, _ = select.select([self.host, self.node], [], [], 0.1 if self.replies > 0 else 0)
            for end in ready:
                data = os.read(end, 4096)
                if self.replies <= 0:
                    continue
                if end == self.node:
                    self.replies -= 1
                    os.write(self.node, self.frames)
                os.write(self.node if end == self.host else self.host, data)


class ModbusRelay:
    """A wire between hosts and a node. `alter(first, sample, registers)` may change the registers of a reply: the
    address of the first one, and the sample of the run or None. If it returns False, the node is frozen from there
    on, and the host is flooded with that reply."""

    def __init__(self, node_port, alter):
        self.node_port, self.alter = node_port, alter
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        threading.Thread(target=self.accept, daemon=True).start()

    def close(self):
        self.listener.close()

    def accept(self):
        with contextlib.suppress(OSError):
            while True:
                host = ModbusConnection(accepted=self.listener.accept()[0])
                threading.Thread(target=self.relay, args=(host,), daemon=True).start()

    def relay(self, host):
        node = ModbusConnection(self.node_port)
        with contextlib.suppress(OSError), contextlib.closing(host), contextlib.closing(node):
            while True:
                transaction, unit, request = host.frame()
                node.send_frame(transaction, unit, request)
                _, _, reply = node.frame()
                flood = False
                if request[0] in (3, 23) and request[0] == reply[0]:
                    reply, flood = self.altered(request, reply)
                while flood:
                    host.send_frame(transaction - 1 & 0xFFFF, unit, reply)
                host.send_frame(transaction, unit, reply)

    def altered(self, request, reply):
        first = struct.unpack_from(">H", request, 1)[0]
        registers = list(struct.unpack(f">{reply[1] // 2}H", reply[2:]))
        sample = None
        if request[0] == 23 and struct.unpack_from(">H", request, 5)[0] == RUN_KEY:
            sample = struct.unpack_from(">I", request, 10 + 2 * (SETPOINT_SEQUENCE - RUN_KEY))[0]
        flood = self.alter(first, sample, registers) is False
        return reply[:2] + struct.pack(f">{len(registers)}H", *registers), flood


def sealed(identifier, head, payload, length):
    """The data of a CAN FD frame: six bytes of the head, a checksum, the payload, zeros up to the length."""
    body = payload.ljust(length - 8, b"\0")
    return head + struct.pack("<H", binascii.crc_hqx(struct.pack("<H", identifier) + head + body, 0xFFFF)) + body


CAN_COMMAND, CAN_STATE = 0x080, 0x200
HELLO, START, STOP, UPLOAD, ARM, TRIGGER, DOWNLOAD = 1, 2, 3, 16, 18, 19, 20


def can_command(code, sequence, a=0, b=0, c=0, d=0, host=0x01020304, session=0):
    return sealed(CAN_COMMAND, struct.pack("<HBBH", sequence, code, 0, 0),
                  struct.pack("<QQIIIIB", a, b, c, d, host, session, 2), 48)


class ZeroMqPeer(Connection):
    """ZMTP 3.0."""

    def __init__(self, port=None, accepted=None, kind=b"DEALER"):
        super().__init__(port, accepted)
        self.socket.sendall(b"\xff" + bytes(8) + b"\x7f\x03\0" + b"NULL".ljust(20, b"\0") + bytes(32))
        self.receive(64)
        ready = b"\x05READY" + b"\x0bSocket-Type" + struct.pack(">I", len(kind)) + kind
        self.socket.sendall(bytes([4, len(ready)]) + ready)
        self.frame()

    def frame(self):
        flags, size = self.receive(2)
        if flags & 2:
            size = int.from_bytes(bytes([size]) + self.receive(7), "big")
        return self.receive(size)

    @staticmethod
    def encode(*parts):
        data = b""
        for i, part in enumerate(parts):
            more = int(i + 1 < len(parts))
            size = bytes([more, len(part)]) if len(part) < 256 else bytes([more | 2]) + struct.pack(">Q", len(part))
            data += size + part
        return data

    def send(self, *parts):
        self.socket.sendall(self.encode(*parts))


class ZeroMqHub:
    """Connects one host with nodes behind one address. Flooded, it hands nothing on but random messages."""

    def __init__(self, server, node_ports):
        self.flooded = threading.Event()
        self.host = ZeroMqPeer(accepted=server.accept()[0], kind=b"ROUTER")
        self.nodes = [ZeroMqPeer(port) for port in node_ports]
        for one in (self.to_nodes, self.flood, *(lambda node=node: self.to_host(node) for node in self.nodes)):
            threading.Thread(target=self.until_closed, args=(one,), daemon=True).start()

    def close(self):
        self.flooded.set()
        for peer in (self.host, *self.nodes):
            with contextlib.suppress(OSError):  # the peer may be gone
                peer.socket.shutdown(socket.SHUT_RDWR)
            peer.close()

    def until_closed(self, carry):
        with contextlib.suppress(OSError):
            while True:
                carry()

    def to_nodes(self):
        text = self.host.frame()
        for node in self.nodes:
            node.send(text)

    def to_host(self, node):
        text = node.frame()
        if not self.flooded.is_set():
            self.host.send(text)

    def flood(self):
        self.flooded.wait()
        self.host.send(os.urandom(72))
