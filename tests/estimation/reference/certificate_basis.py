"""Certified problems: hold integrals, basis functions and state spaces."""
from mpmath import cos, exp, expm, eye, lu_solve, mp, mpc, mpf, pi, sin, sqrt, zeros

from certificate_numbers import NEGLIGIBLE, complex_of, mode, rounded, through

SAMPLE_RATE_HZ = 4096.0  # its reciprocal is a double, so that a delay of one sample is one
LINES = [x * SAMPLE_RATE_HZ for x in (1e-3, 0.03, 0.1, 0.25, 0.49)]
DELAYS = [x / SAMPLE_RATE_HZ for x in (0.0, 0.37, 1.0, 2.7)]


def polynomial_product(p, q):
    out = [mpf(0)] * (len(p) + len(q) - 1)
    for i, a in enumerate(p):
        for j, b in enumerate(q):
            out[i + j] += a * b
    return out


def held_response(power, denominator, period, delay, right, angles):
    """s^power / denominator (ascending powers) behind a zero-order hold, delayed and sampled, at z = e^{j angle}.

    From the controllable state space over one sample, in which the input changes once: two integrals of the matrix
    exponential.
    right: the limit from larger delays where the response jumps.
    """
    order = len(denominator) - 1
    monic = [x / denominator[-1] for x in denominator]
    C = [mpf(0)] * (order + 1)
    C[power] = 1 / denominator[-1]
    D = C[order]
    C = [C[i] - D * monic[i] for i in range(order)]
    A = zeros(order + 1)  # with the input as a constant state
    for i in range(order - 1):
        A[i, i + 1] = 1
    for i in range(order):
        A[order - 1, i] = -monic[i]
    A[order - 1, order] = 1

    def moved(t):
        E = expm(A * t)
        return E[:order, :order], E[:order, order]

    samples = delay / period
    whole = mp.floor(samples)
    late = (samples - whole) * period
    after, now = moved(period - late)
    before = after * moved(late)[1]
    whole_step = moved(period)[0]
    out = []
    for angle in angles:
        z = exp(mpc(0, angle))
        states = lu_solve(z * eye(order) - whole_step, now + before / z)
        value = sum(c * x for c, x in zip(C, states)) * exp(mpc(0, -angle * whole))
        out.append(value + D * exp(mpc(0, -angle * (whole + (1 if late > 0 or right else 0)))))
    return out


def plain_response(power, denominator, delay, omega):
    s = [mpc(0, w) for w in omega]
    return [x**power / sum(d * x**i for i, d in enumerate(denominator)) * exp(-x * delay) for x in s]


def solve_hold_integral(problem):
    """(e^x - 1) / lambda, x = lambda t, and its derivative to lambda."""
    t = problem['t_s']
    poles = complex_of(problem['poles'])
    value = [(exp(z * t) - 1) / z for z in poles]
    return {'value': value, 'derivative': [(t * exp(z * t) - v) / z for z, v in zip(poles, value)]}


def hold_integral_problems():
    """Poles of natural frequencies from far below to above the sample rate, around 0.5 / t too."""
    t, angles = 1 / SAMPLE_RATE_HZ, (1e-8, 1e-3, 0.49, 0.51, 3.0, 9.0)
    return [{'name': f'hold_integral_{name}', 't_s': t,
             'poles': [rounded(x / t * mpc(-damping, sqrt(1 - mpf(damping)**2))) for x in angles]}
            for name, damping in (('1e_4', 1e-4), ('0_9', 0.9))]


def solve_basis(problem):
    """Values and derivatives to a_q, delay by delay and function by function; of s^0 also that to the delay."""
    rate = problem['sample_rate_hz']
    omega = [2 * pi * f for f in problem['frequency_hz']]
    a = [mpf(1)] + problem['a']
    origin = [mpf(0)] * problem['integrators'] + [mpf(1)]
    squared = polynomial_product(a, a)
    out = {'value': [], 'delay': [], 'gradient': []}
    for delay in problem['delay_s']:
        def function(power, denominator, right=False):
            denominator = polynomial_product(origin, denominator)
            if problem['hold'] == 'none':
                return plain_response(power, denominator, delay, omega)
            return held_response(power, denominator, 1 / rate, delay, right, [w / rate for w in omega])

        out['delay'] += [-x for x in function(1, a, right=True)]
        for m in range(problem['numerator_degree'] + 1):
            out['value'] += function(m, a)
            for q in range(1, len(a)):
                out['gradient'] += [-x for x in function(m + q, squared)]
    return {name: values for name, values in out.items() if values}


def cancellation(problem):
    """Of the fractions of s^m / A^2, which are larger than it far below the poles."""
    _, a1, a2 = a = [mpf(1)] + through(mpf, problem['a'])
    rate = mpf(problem['sample_rate_hz'])
    omega = [2 * pi * mpf(f) for f in problem['frequency_hz']]
    root = sqrt(mpc(a1**2 - 4 * a2))
    poles = [(-a1 + root) / (2 * a2), (-a1 - root) / (2 * a2)]

    def function(power, denominator, delay):
        if problem['hold'] == 'none':
            return plain_response(power, denominator, delay, omega)
        return held_response(power, denominator, 1 / rate, delay, False, [w / rate for w in omega])

    largest = mpf(1)
    for delay in through(mpf, problem['delay_s']):
        for m in range(1, problem['numerator_degree'] + len(a)):
            size = [mpf(0)] * len(omega)
            for pole, other in (poles, poles[::-1]):
                double = pole**m / (a2 * (pole - other))**2
                simple = m * double / pole - 2 * double / (pole - other)
                for residue, denominator in ((simple, [-pole, mpf(1)]), (double, [pole**2, -2 * pole, mpf(1)])):
                    size = [x + abs(residue * y) for x, y in zip(size, function(0, denominator, delay))]
            exact = function(m, polynomial_product(a, a), delay)
            largest = max(largest, max(x / abs(y) for x, y in zip(size, exact)))
    return float(largest)


def check_hold():
    """The same from the response to one held sample, which has decayed to nothing after 300 samples."""
    a = [mpf(x) for x in mode(0.1 * SAMPLE_RATE_HZ, 0.9)]
    T, delay, angle = 1 / mpf(SAMPLE_RATE_HZ), mpf(DELAYS[3]), 2 * pi * mpf(0.25)
    decay, turn = a[0] / (2 * a[1]), sqrt(1 / a[1] - (a[0] / (2 * a[1]))**2)

    def step(t):
        return 1 - exp(-decay * t) * (cos(turn * t) + decay / turn * sin(turn * t)) if t > 0 else mpf(0)

    found = sum((step(n * T - delay) - step((n - 1) * T - delay)) * exp(mpc(0, -n * angle)) for n in range(300))
    exact = held_response(0, [mpf(1)] + a, T, delay, False, [angle])[0]
    assert abs(found - exact) < NEGLIGIBLE * abs(exact)


def basis_problems():
    plants = [('rigid_body', 2, [], 0)]
    plants += [(name, 0, mode(0.1 * SAMPLE_RATE_HZ, damping), 1)
               for name, damping in (('damping_1e_4', 1e-4), ('damping_0_01', 0.01), ('damping_0_9', 0.9))]
    return [{'name': f'{name}_{word}', 'hold': hold, 'sample_rate_hz': SAMPLE_RATE_HZ, 'frequency_hz': LINES,
             'delay_s': DELAYS, 'integrators': integrators, 'a': a, 'numerator_degree': degree}
            for name, integrators, a, degree in plants for hold, word in (('none', 'continuous'), ('exact', 'held'))]


def solve_model(problem):
    """Responses, vec of outputs x inputs line by line: continuous without delays, and sampled with them."""
    rate = problem['sample_rate_hz']
    omega = [2 * pi * f for f in problem['frequency_hz']]
    plain, held = [], []
    for input_delay, u in zip(problem['input_delay_s'], range(2)):
        for output_delay, y in zip(problem['output_delay_s'], range(2)):
            plain.append([mpc(0)] * len(omega))
            held.append([mpc(0)] * len(omega))
            for s in problem['submodels']:
                denominator = [mpf(0)] * s['integrators'] + [mpf(1)] + s['a']
                for m, B in enumerate(s['numerator']):
                    values = plain_response(m, denominator, mpf(0), omega)
                    plain[-1] = [old + B[y][u] * x for old, x in zip(plain[-1], values)]
                    values = held_response(m, denominator, 1 / rate, input_delay + output_delay, False,
                                           [w / rate for w in omega])
                    held[-1] = [old + B[y][u] * x for old, x in zip(held[-1], values)]
    return {name: [x for line in zip(*channels) for x in line]
            for name, channels in (('continuous', plain), ('sampled', held))}


def model_problem():
    T = 1 / SAMPLE_RATE_HZ
    return {
        'name': 'state_space', 'outputs': 2, 'inputs': 2, 'sample_rate_hz': SAMPLE_RATE_HZ, 'frequency_hz': LINES,
        'input_delay_s': [0.0, 0.37 * T], 'output_delay_s': [0.25 * T, 1.5 * T],
        'submodels': [
            {'integrators': 2, 'a': [], 'numerator': [[[1.7e5, -0.6e5], [0.4e5, 2.1e5]]]},
            {'integrators': 0, 'a': mode(300.0, 0.01),
             'numerator': [[[1.0, -0.5], [0.8, 0.3]], [[1e-5, 2e-5], [-3e-5, 1e-5]]]},
            {'integrators': 0, 'a': mode(1100.0, 0.002), 'numerator': [[[0.2, 0.7], [-0.4, 0.5]]]},
            {'integrators': 0, 'a': [1e-3], 'numerator': [[[0.9, 0.2], [0.1, -0.6]]]}]}
