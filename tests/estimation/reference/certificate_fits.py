"""Certified problems: stationary points of small fits without hold, and their covariances."""
import random

from mpmath import cholesky, conj, eigsy, exp, lu_solve, matrix, mpc, mpf, pi, sqrt, zeros

from certificate_numbers import NEGLIGIBLE, certified, complex_of, mode, rounded, through


class Fit:
    """Cost, derivatives and covariance of one problem. Parameters: a of all submodels, the delay, vec B by function."""

    def __init__(self, problem):
        self.problem = problem
        self.outputs, self.inputs = problem['outputs'], problem['inputs']
        self.channels = self.outputs * self.inputs
        self.s = [mpc(0, 2 * pi * f) for f in problem['frequency_hz']]
        self.G = [complex_of(line) for line in problem['response']]
        self.variance = problem.get('noise_variance')
        self.W = [self.weight(k) for k in range(len(self.s))]
        self.coefficients = [(i, q) for i, s in enumerate(problem['submodels']) for q in range(1, len(s['a']) + 1)]
        self.functions = [(i, m) for i, s in enumerate(problem['submodels']) for m in range(s['terms'])]
        self.delay = len(self.coefficients) if 'delay_s' in problem else None
        self.globals = len(self.coefficients) + (self.delay is not None)
        self.size = self.globals + self.channels * len(self.functions)

    def weight(self, k):
        """Of line k: channels x channels."""
        n = self.channels
        if 'weight_matrices' in self.problem:
            values = complex_of(self.problem['weight_matrices'][k])
            return [[values[c + n * d] for d in range(n)] for c in range(n)]
        diagonal = self.problem['weights'][k] if 'weights' in self.problem else [1 / v for v in self.variance[k]]
        return [[diagonal[c] if c == d else mpf(0) for d in range(n)] for c in range(n)]

    def noise(self, k):
        """Covariance of the channels on line k; only the correlations of the two factors are used."""
        C, S = (complex_of(self.problem[name][k]) if name in self.problem else None
                for name in ('residual_covariance', 'input_factor'))

        def correlation(M, n, i, j):
            if i == j:
                return mpf(1)
            return M[i + n * j] / sqrt(M[i + n * i].real * M[j + n * j].real) if M else mpf(0)

        return [[sqrt(self.variance[k][c] * self.variance[k][d])
                 * correlation(C, self.outputs, c % self.outputs, d % self.outputs)
                 * correlation(S, self.inputs, c // self.outputs, d // self.outputs)
                 for d in range(self.channels)] for c in range(self.channels)]

    def line(self, beta, k):
        """E and the columns of J and of second derivatives as {index or pair: list over channels}."""
        s = self.s[k]
        A = [mpf(1)] * len(self.problem['submodels'])
        for p, (i, q) in enumerate(self.coefficients):
            A[i] += beta[p] * s**q
        late = exp(-s * beta[self.delay]) if self.delay is not None else mpf(1)
        F = [late * s**(m - self.problem['submodels'][i]['integrators']) / A[i] for i, m in self.functions]
        n, zero = self.channels, [mpc(0)] * self.channels

        def B(f, c):
            return self.globals + c + n * f

        J, second = [list(zero) for _ in range(self.size)], {}
        parts = [list(zero) for _ in A]
        for f, (i, _) in enumerate(self.functions):
            for c in range(n):
                parts[i][c] += beta[B(f, c)] * F[f]
                J[B(f, c)][c] = F[f]
        P = [sum(part[c] for part in parts) for c in range(n)]
        for p, (i, q) in enumerate(self.coefficients):
            slope = -s**q / A[i]
            J[p] = [slope * x for x in parts[i]]
            for r, (j, other) in enumerate(self.coefficients[:p + 1]):
                if i == j:
                    second[r, p] = [2 * slope * -s**other / A[i] * x for x in parts[i]]
            for f, (j, _) in enumerate(self.functions):
                for c in range(n if i == j else 0):
                    second[p, B(f, c)] = [slope * F[f] if d == c else mpc(0) for d in range(n)]
        if self.delay is not None:
            J[self.delay] = [-s * x for x in P]
            for p in range(self.size):
                if p != self.delay:
                    second[min(p, self.delay), max(p, self.delay)] = [-s * x for x in J[p]]
            second[self.delay, self.delay] = [s * s * x for x in P]
        return [g - p for g, p in zip(self.G[k], P)], J, second

    def times_weight(self, k, X):
        return [sum(w * x for w, x in zip(row, X)) for row in self.W[k]]

    def cost(self, beta):
        total = mpf(0)
        for k in range(len(self.s)):
            E = self.line(beta, k)[0]
            total += sum((conj(e) * w).real for e, w in zip(E, self.times_weight(k, E)))
        return total / (2 * len(self.s))

    def newton_step(self, beta):
        """With the second derivatives. Also returns the largest relative step and the scaled Hessian."""
        gradient, H = zeros(self.size, 1), zeros(self.size)
        for k in range(len(self.s)):
            E, J, second = self.line(beta, k)
            WE = self.times_weight(k, E)
            for p in range(self.size):
                gradient[p] += product(J[p], WE)
                WJ = self.times_weight(k, J[p])
                for r in range(p, self.size):
                    H[p, r] += product(J[r], WJ)
            for (p, r), values in second.items():
                H[p, r] -= product(values, WE)
        for p in range(self.size):
            for r in range(p):
                H[p, r] = H[r, p]
        scale = [1 / sqrt(abs(H[p, p])) for p in range(self.size)]
        scaled = matrix(self.size)
        for p in range(self.size):
            for r in range(self.size):
                scaled[p, r] = scale[p] * H[p, r] * scale[r]
        step = lu_solve(scaled, matrix([scale[p] * gradient[p] for p in range(self.size)]))
        change = [scale[p] * step[p] for p in range(self.size)]
        return [b + d for b, d in zip(beta, change)], max(abs(d / b) for b, d in zip(beta, change)), scaled

    def stationary_point(self, beta):
        for _ in range(40):
            beta, change, H = self.newton_step(beta)
            if change < NEGLIGIBLE:
                cholesky(H)  # raises an exception unless it is a minimum
                return beta
        raise ArithmeticError(self.problem['name'] + ': Newton does not converge')

    def check(self, beta):
        """The differences of the cost around the minimum have no slope, so the derivatives above are right."""
        cost, h = self.cost(beta), mpf(10)**-15
        for p in range(self.size):
            left, right = (self.cost([b * (1 + sign * h) if r == p else b for r, b in enumerate(beta)])
                           for sign in (-1, 1))
            assert abs(right - left) < mpf(10)**-10 * abs(right + left - 2 * cost), (self.problem['name'], p)

    def covariance(self, beta, cost):
        """1/2 M^-1 K M^-1, M = sum Re{J^H W J}, K = sum Re{J^H W C W J}; with unknown noise C = W^-1 times the residual
        per complex degree of freedom."""
        n = self.size
        M, K = zeros(n), zeros(n)
        for k in range(len(self.s)):
            J = self.line(beta, k)[1]
            WJ = [self.times_weight(k, column) for column in J]
            C = self.noise(k) if self.variance else None
            for p in range(n):
                CWJ = [sum(x * y for x, y in zip(row, WJ[p])) for row in C] if C else J[p]
                for r in range(n):
                    M[r, p] += product(J[r], WJ[p])
                    K[r, p] += product(WJ[r], CWJ)
        if not self.variance:
            data = len(self.s) * self.channels
            K *= 2 * len(self.s) * cost / (data - mpf(n) / 2)
        scale = matrix(n)
        for p in range(n):
            scale[p, p] = 1 / sqrt(M[p, p])
        scaled = scale * M * scale
        values = eigsy(scaled, eigvals_only=True)
        self.condition = max(values) / min(values)
        inverse = scale * scaled**-1 * scale
        return inverse * K * inverse / 2

    def solution(self, beta):
        cost = self.cost(beta)
        covariance = self.covariance(beta, cost)
        out = {'cost': [cost], 'parameters': beta, 'covariance': list(covariance), 'frequency_std_hz': [],
               'damping_ratio_std': []}
        for p, (i, q) in enumerate(self.coefficients):
            if q != 1:
                continue
            C = covariance[p:p + 2, p:p + 2]
            a1, a2 = beta[p], beta[p + 1]
            df = matrix([[0, -1 / (4 * pi * a2 * sqrt(a2))]])
            dz = matrix([[1 / (2 * sqrt(a2)), -a1 / (4 * a2 * sqrt(a2))]])
            out['frequency_std_hz'].append(sqrt((df * C * df.T)[0]))
            out['damping_ratio_std'].append(sqrt((dz * C * dz.T)[0]))
        return out


def product(x, y):
    """Re{x^H y}"""
    return sum((a.real * b.real + a.imag * b.imag for a, b in zip(x, y)), mpf(0))


def plant(name, lines, shape, modes, numerators, rigid=None, delay=None, start=1.01):
    """A problem without data, and its true parameters. modes: (frequency, damping); numerators: of each mode, B_0, B_1
    ... as lists over channels. The start has other poles."""
    problem = {'name': name, 'outputs': shape[0], 'inputs': shape[1], 'frequency_hz': lines, 'submodels': []}
    truth, B = [], []
    if rigid:
        problem['submodels'].append({'integrators': 2, 'a': [], 'terms': 1})
        B += [rigid]
    for (frequency, damping), numerator in zip(modes, numerators):
        problem['submodels'].append({'integrators': 0, 'a': mode(start * frequency, 0.7 * damping),
                                     'terms': len(numerator)})
        truth += [mpf(x) for x in mode(frequency, damping)]
        B += numerator
    if delay:
        problem['delay_s'] = 0.8 * delay
        truth.append(mpf(delay))
    return problem, truth + [mpf(x) for function in B for x in function]


def measured(problem, truth, perturbation):
    """Fills in the response, with errors of this relative size and random phases."""
    problem['response'] = [[[0.0, 0.0]] * (problem['outputs'] * problem['inputs']) for _ in problem['frequency_hz']]
    fit, phases = Fit(through(mpf, problem | {'weights': [[1.0] * 4] * len(problem['frequency_hz'])})), random.Random(7)

    def error():
        return mpf(perturbation) * exp(mpc(0, 2 * pi * mpf(phases.random())))

    problem['response'] = [rounded([-e * (1 + error()) for e in fit.line(truth, k)[0]])
                           for k in range(len(problem['frequency_hz']))]


def relative(problem, size, slope=0.0):
    """(size |G|)^2 per line and channel, growing by the slope from line to line."""
    return [[float((mpf(size) * abs(mpc(*g)))**2 * (1 + mpf(slope) * k)) for g in line]
            for k, line in enumerate(problem['response'])]


def inverse(variance):
    return [[1.0 / v for v in line] for line in variance]


def span(first, last, step):
    return [first + step * i for i in range(int((last - first) / step) + 1)]


def fit_problems():
    """Problems and the true parameters."""
    out = []

    def add(perturbation, complete, *arguments, **options):
        problem, truth = plant(*arguments, **options)
        measured(problem, truth, perturbation)
        complete(problem)
        out.append((problem, truth))

    # One mode, equal weights, unknown noise.
    add(1e-3, lambda x: x.update(weights=[[1.0]] * len(x['response'])),
        'one_mode', span(20.0, 215.0, 5.0), (1, 1), [(100.0, 0.02)], [[[1.3]]])

    # Weights 1/|G|^2 and another variance: the sandwich.
    def sandwich(x):
        x.update(weights=inverse(relative(x, 1.0)), noise_variance=relative(x, 1e-2, 0.05))

    add(1e-2, sandwich, 'two_modes', span(20.0, 215.0, 5.0), (2, 1), [(60.0, 0.01), (140.0, 0.03)],
        [[[1.0, -0.4]], [[0.3, 0.8]]])
    # Their distance is half the half-power width.
    add(1e-3, sandwich, 'close_modes', span(80.0, 120.0, 1.0), (2, 1), [(100.0, 0.01), (101.0, 0.01)],
        [[[1.0, 0.6]], [[0.5, -0.7]]], start=1.001)

    def likelihood(x):
        x.update(noise_variance=relative(x, 1e-3))

    add(1e-3, likelihood, 'rigid_body_and_mode', span(10.0, 205.0, 5.0), (1, 1), [(120.0, 0.02)], [[[1.0]]],
        rigid=[2.0e5])
    add(1e-3, likelihood, 'free_delay', span(20.0, 215.0, 5.0), (1, 1), [(70.0, 0.01), (130.0, 0.02)],
        [[[1.0]], [[-0.7]]], delay=4e-4)

    # Correlated outputs and inputs, which the weights ignore.
    def correlated(x):
        sandwich(x)
        lines = range(len(x['response']))
        x['residual_covariance'] = [[[9.0, 0.0], [1.5, 0.05 * k], [1.5, -0.05 * k], [2.0, 0.0]] for k in lines]
        x['input_factor'] = [[[1.0, 0.0], [0.02 * k, -0.7], [0.02 * k, 0.7], [3.0, 0.0]] for k in lines]

    add(1e-2, correlated, 'correlated_noise', span(20.0, 215.0, 5.0), (2, 2), [(60.0, 0.01), (140.0, 0.03)],
        [[[1.0, -0.4, 0.5, 0.9]], [[0.3, 0.8, -0.6, 0.7]]])

    # Full matrices W_k.
    def full(x):
        x['weight_matrices'] = []
        for k, (one, two) in enumerate(inverse(relative(x, 1.0))):
            z = mpc(0.3, 0.01 * k) * sqrt(mpf(one) * mpf(two))
            x['weight_matrices'].append([[one, 0.0], rounded(z), rounded(z.conjugate()), [two, 0.0]])

    add(1e-2, full, 'weight_matrices', span(20.0, 215.0, 5.0), (2, 1), [(60.0, 0.01), (140.0, 0.03)],
        [[[1.0, -0.4]], [[0.3, 0.8]]])
    return out


def certified_fit(problem, truth):
    known, conditions = [truth], []

    def solve(numbers):
        fit = Fit(numbers)
        beta = fit.stationary_point(known[0])
        if known[0] is truth:
            fit.check(beta)
            known[0] = beta
        solution = fit.solution(beta)
        conditions.append(fit.condition)
        return solution

    return certified(problem, solve) | {'condition': float(conditions[0])}
