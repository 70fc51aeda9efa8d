#!/usr/bin/env python3
"""Requests as hostile pages and programs would send them to a workbench that may write: a foreign Host, no token or a
wrong one, no header of the page, paths out of the server, large bodies, 500 connections. All are refused, and the
workbench goes on unchanged.

    hostile_requests.py PROGRAM CONFIGS WORK
"""

import pathlib
import random
import shutil
import socket
import sys

from open_program import OpenProgram, identify

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "dashboard"))
from browser import expect, verdict

PATHS = ["/", "/events", "/response.json", "/act", "/abort", "/metrics", "/watch.json"]
OUTSIDE = ["/../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "/..%2fmodel.json", "//etc/passwd", "/model.json", "/frf.h5", "/act/../act"]
ACTIONS = [b'{"kind": "save", "name": "hostile"}', b'{"kind": "remove", "frequency_hz": 422.2}', b'{"kind": "undo"}',
           b'{"kind": "refit", "modes": "auto"}']


def exchange(program, request):
    """Status of the answer; 0: hung up without one."""
    with socket.create_connection((program.address.hostname, program.address.port), timeout=20) as link:
        try:
            link.sendall(request)
            link.shutdown(socket.SHUT_WR)
            head = link.recv(64)
        except OSError:
            head = b""
    return int(head.split()[1]) if head.startswith(b"HTTP/1.1 ") else 0


def hostile(program, draw):
    """One request that lacks something that only the page has, or asks for what is not there."""
    token = program.address.query.split("=")[1]
    kind = draw.choice(["host", "token", "header", "path", "body", "junk", "method", "preflight"])
    host, query, header, method = program.address.netloc, f"?token={token}", "X-Stageid: act\r\n", "POST"
    path, body = draw.choice(PATHS), draw.choice(ACTIONS)
    if kind == "host":
        host = draw.choice(["evil.example", f"evil.example:{program.address.port}", "", "127.0.0.1:1", f"localhost.evil:{program.address.port}"])
        method = draw.choice(["GET", "POST"])
    elif kind == "token":
        wrong = "".join(draw.choice("0123456789abcdef") for _ in range(32))
        query = draw.choice(["", "?token=", f"?token={wrong}", f"?token={token[:-1]}", f"?token={token}0", f"?TOKEN={token}"])
        method = draw.choice(["GET", "POST"])
    elif kind == "header":
        path, header = draw.choice(["/act", "/abort"]), draw.choice(["", "X-Stageid: launch\r\n", "Origin: http://evil.example\r\n"])
    elif kind == "path":
        path, method = draw.choice(OUTSIDE), draw.choice(["GET", "POST"])
    elif kind == "body":
        path, body = "/act", draw.choice([b"x" * 2000, b"[" * 1500, body + b" " * 100000])
    elif kind == "method":
        method, path = draw.choice(["PUT", "DELETE", "PATCH"]), draw.choice(PATHS)
    elif kind == "preflight":
        method, header = "OPTIONS", "Origin: http://evil.example\r\nAccess-Control-Request-Method: POST\r\nAccess-Control-Request-Headers: x-stageid\r\n"
    if kind == "junk":
        return kind, bytes(draw.randrange(256) for _ in range(draw.randrange(1, 3000)))
    head = f"{method} {path}{query} HTTP/1.1\r\nHost: {host}\r\n{header}Content-Length: {len(body)}\r\nConnection: close\r\n\r\n"
    return kind, head.encode() + (body if method != "GET" else b"")


def idle_connections(program, count):
    links = []
    for number in range(count):
        link = socket.socket()
        link.setblocking(False)
        link.connect_ex((program.address.hostname, program.address.port))
        links.append(link)
    return links


def main():
    program, configs, work = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    identify(program, configs, work / "day", 1)
    files = {file: file.read_bytes() for file in (work / "day").iterdir()}
    running = OpenProgram(program, work / "day", "--write")
    try:
        before = running.settled()
        draw = random.Random(1)
        for number in range(100):
            kind, request = hostile(running, draw)
            status = exchange(running, request)
            expect(status == 0 or 400 <= status < 500, f"request {number} ({kind}): status {status}: {request[:200]}")
            expect(running.process.poll() is None, f"request {number} ({kind}) ended the program")
        links = idle_connections(running, 500)
        expect(running.settled() == before, "the state changed")
        for link in links:
            link.close()
        expect(running.settled() == before, "the state changed")
        expect({file: file.read_bytes() for file in (work / "day").iterdir()} == files, "a file was written")
        good = f"POST /act?{running.address.query} HTTP/1.1\r\nHost: {running.address.netloc}\r\nX-Stageid: act\r\n"
        body = b'{"kind": "remove", "frequency_hz": 422.2}'
        expect(exchange(running, f"{good}Content-Length: {len(body)}\r\n\r\n".encode() + body) == 200, "the page is refused too")
        expect(len(running.settled()["states"]) == 2, "the page's own action has no effect")
        expect(running.interrupt() == 130, "it did not end in order")
    finally:
        running.close()
    return verdict()


if __name__ == "__main__":
    sys.exit(main())
