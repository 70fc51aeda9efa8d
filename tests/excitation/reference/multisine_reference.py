#!/usr/bin/env python3
"""Writes multisine_reference.hpp: what stageid's multisines must be, computed apart from it.

Everything is done again from the published definitions: the generator MT19937-64 (Matsumoto and
Nishimura 2004; constants as in the C++ standard, [rand.predef]), SplitMix64, and the multisine as a
plain sum of cosines instead of an FFT.

    /usr/bin/python3 multisine_reference.py > multisine_reference.hpp
"""

import numpy as np

MASK = (1 << 64) - 1


class Mt19937_64:
    """The 64-bit Mersenne Twister."""

    def __init__(self, seed):
        self.state = [seed & MASK]
        for i in range(1, 312):
            last = self.state[-1]
            self.state.append((6364136223846793005 * (last ^ (last >> 62)) + i) & MASK)
        self.index = 312

    def twist(self):
        for i in range(312):
            upper = self.state[i] & 0xFFFFFFFF80000000
            lower = self.state[(i + 1) % 312] & 0x7FFFFFFF
            word = (upper | lower) >> 1
            if lower & 1:
                word ^= 0xB5026F5AA96619E9
            self.state[i] = self.state[(i + 156) % 312] ^ word
        self.index = 0

    def next(self):
        if self.index == 312:
            self.twist()
        word = self.state[self.index]
        self.index += 1
        word ^= (word >> 29) & 0x5555555555555555
        word ^= (word << 17) & 0x71D67FFFEDA60000
        word ^= (word << 37) & 0xFFF7EEE000000000
        return (word ^ (word >> 43)) & MASK

    def uniform(self):
        return (self.next() >> 11) * 2.0**-53


def splitmix64(word):
    word = (word + 0x9E3779B97F4A7C15) & MASK
    word = ((word ^ (word >> 30)) * 0xBF58476D1CE4E5B9) & MASK
    word = ((word ^ (word >> 27)) * 0x94D049BB133111EB) & MASK
    return word ^ (word >> 31)


def stream_seed(seed, first, second):
    return splitmix64((splitmix64((splitmix64(seed) + first) & MASK) + second) & MASK)


def phases(seed, count):
    generator = Mt19937_64(seed)
    return np.array([2.0 * np.pi * generator.uniform() for _ in range(count)])


def multisine(lines, amplitude, phase, samples):
    n = np.arange(samples)
    return sum(a * np.cos(2 * np.pi * l * n / samples + p)
               for l, a, p in zip(lines, amplitude, phase))


def left_out(seed, odd_lines, group):
    generator = Mt19937_64(stream_seed(seed, 0, 0))
    kept = []
    for first in range(0, len(odd_lines), group):
        lines = list(odd_lines[first:first + group])
        if len(lines) == group:
            del lines[int(generator.uniform() * group)]
        kept += lines
    return kept


def array(name, values, kind="double"):
    body = ", ".join(repr(v) for v in values)
    return f"inline const std::vector<{kind}> {name} = {{{body}}};"


def main():
    # The check value that the C++ standard gives for the default seed.
    check = Mt19937_64(5489)
    assert [check.next() for _ in range(10000)][-1] == 9981545732273789042
    # The first output of Vigna's splitmix64.c from state 0.
    assert splitmix64(0) == 0xE220A8397B1DCDAF

    print("// Written by multisine_reference.py; do not edit.")
    print("#pragma once\n\n#include <cstdint>\n#include <vector>\n")
    print("namespace stageid::test::reference {\n")

    # One multisine: odd lines, rms 2.5, seed 20240229, amplitudes 1, 1/2, 1/3 ... before scaling.
    lines = np.arange(1, 16, 2)
    shape = 1.0 / np.arange(1, len(lines) + 1)
    phase = phases(20240229, len(lines))
    amplitude = 2.5 * shape / np.sqrt(np.sum(shape**2) / 2)
    print(array("kPhaseRad", [float(v) for v in phase]))
    print(array("kAmplitude", [float(v) for v in amplitude]))
    print(array("kSamples", [float(v) for v in multisine(lines, amplitude, phase, 40)]))

    # Odd-random lines 1 .. 99 in groups of 4, seed 7.
    print(array("kOddRandomLines", left_out(7, range(1, 100, 2), 4), "int"))

    # Realization 2, axis 3 of the plan with seed 2^64 - 5.
    seed = stream_seed(2**64 - 5, 2, 3)
    print(f"inline constexpr std::uint64_t kStreamSeed = {seed}U;")
    print(array("kStreamPhaseRad", [float(v) for v in phases(seed, 8)]))
    print("\n}  // namespace stageid::test::reference")


if __name__ == "__main__":
    main()
