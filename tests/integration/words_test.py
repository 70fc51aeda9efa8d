#!/usr/bin/env python3
"""Each table of words (kWords, excitation/words) has one word per value of its enumeration, all different.

The compiler cannot check this: a value that was added without a word would be printed as "unknown".

    words_test.py SOURCE_DIR
"""

import pathlib
import re
import sys

ENUM = re.compile(r"enum class (\w+)[^{;]*\{([^}]*)\}")
TABLE = re.compile(r"kWords<([\w:]+)> =\s*\{([^;]*)\};")
COMMENT = re.compile(r"//[^\n]*")


def number_of_values(body):
    """One more than the largest value; a value may be given as a number."""
    value = -1
    for entry in filter(None, (entry.strip() for entry in body.split(","))):
        value = int(entry.split("=")[1], 0) if "=" in entry else value + 1
    return value + 1


def faults(name, text):
    text = COMMENT.sub("", text)
    enums = {}
    for enum in ENUM.finditer(text):
        enums.setdefault(enum[1], []).append((enum.start(), enum[2]))
    for table in TABLE.finditer(text):
        words = re.findall(r'"((?:[^"\\]|\\.)*)"', table[2])
        before = [body for start, body in enums.get(table[1].split("::")[-1], []) if start < table.start()]
        if not before:
            yield f"{name}: the words of {table[1]} belong behind the enumeration, in the same file"
        elif len(words) != number_of_values(before[-1]):
            yield f"{name}: {table[1]} has {number_of_values(before[-1])} values and {len(words)} words"
        if len(set(words)) != len(words):
            yield f"{name}: {table[1]} has the same word twice"


def self_test():
    enum = "enum class A : int { one,  // first, of two\n two };\n"
    table = 'inline constexpr std::array kWords<B::A> = {%s};'
    for words, expected in (('"a", "b, c"', 0), ('"a"', 1), ('"a", "a"', 1), ('"a", "b", "c"', 1)):
        assert len(list(faults("a.hpp", enum + table % words))) == expected, words
    assert len(list(faults("a.hpp", table % '"a", "b"'))) == 1
    assert not list(faults("a.hpp", "enum class A { one = 1, two };" + table % '"unknown", "a", "b"'))


def main():
    self_test()
    root = pathlib.Path(sys.argv[1])
    found, tables = [], 0
    for floor in ("excitation", "hal", "acquisition", "frf", "estimation", "tools"):
        for path in sorted(path for path in (root / floor).rglob("*") if path.suffix in (".hpp", ".cpp")):
            text = path.read_text()
            if path.name == "words.hpp":
                continue
            tables += len(TABLE.findall(text))
            found += faults(path.relative_to(root).as_posix(), text)
    print("\n".join(found or [f"{tables} tables of words"]))
    return 1 if found or tables == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
