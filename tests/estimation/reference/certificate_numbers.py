"""Numbers of certified problems, exact or changed by their rounding; see make_certificates.py."""
import random

from mpmath import log10, mp, mpc, mpf, pi, sqrt

mp.dps = 60
CHANGES = 3
ROUNDING = mpf(2)**-53
NEGLIGIBLE = mpf(10)**-50


def through(change, x):
    """The same nested lists with every double as an mp number, after the change."""
    if isinstance(x, dict):
        return {key: through(change, value) for key, value in x.items()}
    if isinstance(x, list):
        return [through(change, value) for value in x]
    return change(x) if isinstance(x, float) else x


def rounded(x):
    """The nearest doubles; a complex number as [re, im]."""
    if isinstance(x, (list, tuple)):
        return [rounded(value) for value in x]
    return [float(x.real), float(x.imag)] if isinstance(x, mpc) else float(x)


def complex_of(pairs):
    return [mpc(re, im) for re, im in pairs]


def relative_change(name, found, exact):
    if name == 'covariance':
        n = int(sqrt(len(exact)) + mpf('0.5'))
        scale = [sqrt(exact[i * n + i] * exact[j * n + j]) for i in range(n) for j in range(n)]
    else:
        scale = [abs(x) for x in exact]
    return max(abs(a - b) / s for a, b, s in zip(found, exact, scale))


def certified(problem, solve):
    """The problem with its solution. solve: problem -> {quantity: list of numbers}."""
    exact = solve(through(mpf, problem))
    largest = dict.fromkeys(exact, ROUNDING)
    signs = random.Random(1)
    for _ in range(CHANGES):
        found = solve(through(lambda x: x * (1 + (ROUNDING if signs.random() < 0.5 else -ROUNDING)), problem))
        for name, values in found.items():
            largest[name] = max(largest[name], relative_change(name, values, exact[name]))
    digits = {name: round(float(-log10(change)), 1) for name, change in largest.items()}
    return problem | {'solution': {name: rounded(values) for name, values in exact.items()}, 'digits': digits}


def mode(frequency_hz, damping):
    """a_1, a_2 as doubles."""
    omega = 2 * pi * mpf(frequency_hz)
    return [float(2 * mpf(damping) / omega), float(1 / omega**2)]
