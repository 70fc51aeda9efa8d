"""An independent reader of universal files, to the letter of the published format: for the tests."""

import struct

import numpy as np

TEXT_WIDTHS = {2: [13], 4: [20], 5: [13, 13], 6: [20, 20]}
BINARY_CODES = {2: "f", 4: "d", 5: "ff", 6: "dd"}


def fields(line, widths):
    out, at = [], 0
    for width in widths:
        out.append(line[at:at + width].strip())
        at += width
    return out


class File:
    """The lines of a file, and the bytes between them."""

    def __init__(self, path):
        self.data, self.at = path.read_bytes(), 0

    def bytes(self, size):
        self.at += size
        return self.data[self.at - size:self.at]

    def line(self):
        return self.bytes(self.data.index(b"\n", self.at) + 1 - self.at)[:-1].decode()


def read(path):
    """A list of datasets: dictionaries with key "dataset" and what the dataset holds."""
    file, found = File(path), []
    line = file.line
    while file.at < len(file.data):
        assert line() == "    -1"
        head = line()
        number = int(head[:6])
        dataset = {"dataset": number}
        found.append(dataset)
        if number == 55:
            read_mode(line, dataset)
            continue
        if number == 58:
            read_function(file, head, dataset)
        elif number == 164:
            dataset["code"] = int(line()[:10])
            dataset["factors"] = [float(x.replace("D", "E")) for x in fields(line(), [25, 25, 25])]
            line()
        else:
            dataset["lines"] = [line() for _ in range(7)]
        assert line() == "    -1", dataset
    return found


def read_function(file, head, out):
    line = file.line
    out["binary"] = head[6:7] == "b"
    out["id"] = [line().rstrip() for _ in range(5)]
    record = fields(line(), [5, 10, 5, 10, 1, 10, 10, 4, 1, 10, 10, 4])
    out["type"], out["response"], out["reference"] = int(record[0]), record[5:8], record[9:12]
    form = fields(line(), [10, 10, 10, 13, 13, 13])
    kind, count, even = int(form[0]), int(form[1]), int(form[2])
    out["axes"] = [fields(line(), [10, 5, 5, 5, 1, 20, 1, 20]) for _ in range(4)]
    widths = ([] if even else [13]) + TEXT_WIDTHS[kind]
    if out["binary"]:
        order, floating, lines, size = [int(x) for x in fields(head[7:], [6, 6, 12, 12])]
        assert (order, floating, lines) == (1, 2, 11)
        # Abscissas of double precision, as most readers take them; the format has "f".
        code = "<" + ("" if even else "d") + BINARY_CODES[kind]
        assert struct.calcsize(code) * count == size
        table = np.array(list(struct.iter_unpack(code, file.bytes(size))))
    else:
        values = []
        while len(values) < count * len(widths):
            text = line()
            while text:
                width = widths[len(values) % len(widths)]
                values.append(float(text[:width]))
                text = text[width:]
        table = np.array(values).reshape(count, -1)
    out["x"] = float(form[3]) + float(form[4]) * np.arange(count) if even else table[:, 0]
    ordinate = table if even else table[:, 1:]
    out["y"] = ordinate[:, 0] if kind in (2, 4) else ordinate[:, 0] + 1j * ordinate[:, 1]


def read_mode(line, out):
    out["id"] = [line().rstrip() for _ in range(5)]
    record = [int(x) for x in fields(line(), [10] * 6)]
    out["analysis"], out["data_type"], per_node = record[1], record[4], record[5]
    counts = [int(x) for x in fields(line(), [10] * 4)]
    reals = fields(line(), [13] * counts[1])
    out["reals"] = [float(x) for x in reals]
    out["nodes"], out["values"] = [], []
    per_line = per_node * (2 if out["data_type"] == 5 else 1)
    text = line()
    while text != "    -1":
        out["nodes"].append(int(text))
        values = []
        while len(values) < per_line:
            text = line()
            values += [float(text[k:k + 13]) for k in range(0, len(text), 13)]
        out["values"].append(values)
        text = line()
