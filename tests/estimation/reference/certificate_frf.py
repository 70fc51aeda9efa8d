"""Certified problem: the response of a closed loop and its variances from recorded samples."""
import random

from mpmath import conj, exp, eye, lu_solve, matrix, mpc, mpf, pi, zeros

FRF_LINES = [1, 2, 3, 5, 7]


def frf_problem():
    """2 outputs, 2 inputs, 3 realizations of 2 experiments with 4 periods; noise of 1e-3 in the loop."""
    samples, draw = 24, random.Random(11)

    def phase():
        return exp(mpc(0, 2 * pi * mpf(draw.random())))

    def period(spectra):
        """Samples of both channels from their spectra."""
        return [[float(2 * sum((X[c] * exp(mpc(0, 2 * pi * line * n / samples))).real
                               for line, X in zip(FRF_LINES, spectra))) for c in range(2)] for n in range(samples)]

    G = [matrix([[mpc(2, -line), mpc(0.4, 0.3)], [mpc(-0.6, 0.1 * line), mpc(1, 1)]]) / line for line in FRF_LINES]
    K = matrix([[mpf('0.3'), mpf('-0.1')], [mpf('0.2'), mpf('0.4')]])
    runs = []
    for realization in range(3):
        R = [[phase(), phase()] for _ in FRF_LINES]
        for experiment in range(2):
            r = [matrix([x[0], (-1)**experiment * x[1]]) for x in R]
            run = {'realization': realization, 'experiment': experiment, 'excitation': period(r), 'actuators': [],
                   'sensors': []}
            for _ in range(4):
                v = [mpf('1e-3') * matrix([phase() + phase(), phase()]) for _ in FRF_LINES]
                u = [lu_solve(eye(2) + K * g, x - K * w) for g, x, w in zip(G, r, v)]
                run['actuators'] += period(u)
                run['sensors'] += period([g * x + w for g, x, w in zip(G, u, v)])
            runs.append(run)
    return {'name': 'closed_loop', 'sample_rate_hz': 960.0, 'period_samples': samples, 'lines': FRF_LINES, 'runs': runs}


def spectrum(rows, line):
    """DFT / number of samples, a column over the channels."""
    n = len(rows)
    turns = [exp(mpc(0, -2 * pi * line * i / n)) / n for i in range(n)]
    return matrix([sum(t * row[c] for t, row in zip(turns, rows)) for c in range(len(rows[0]))])


def side_by_side(columns):
    return matrix([[column[i] for column in columns] for i in range(len(columns[0]))])


def adjoint(M):
    return M.T.apply(conj)


def solve_frf(problem):
    """docs/theory.md, section 3, line by line; matrices are stacked by columns."""
    n, M, P = problem['period_samples'], 3, 4
    out = {name: [] for name in ('response', 'noise_variance', 'total_variance', 'residual_covariance', 'input_factor')}
    for line in problem['lines']:
        Z_mean, G, A_sum, C_sum, noise = zeros(4, 2), [], zeros(2), zeros(2), zeros(2)
        for m in range(M):
            R, Z, scatter = [], [], zeros(4)
            for run in problem['runs'][2 * m:2 * m + 2]:
                R.append(spectrum(run['excitation'], line))
                records = [y + u for y, u in zip(run['sensors'], run['actuators'])]
                periods = [spectrum(records[p * n:(p + 1) * n], line) for p in range(P)]
                Z.append(sum(periods, zeros(4, 1)) / P)
                for z in periods:
                    scatter += (z - Z[-1]) * adjoint(z - Z[-1])
            R, Z = side_by_side(R), side_by_side(Z)
            Z_mean += Z * R**-1 / M
            U_inverse = Z[2:, :]**-1
            G.append(Z[:2, :] * U_inverse)
            left = zeros(2, 4)
            left[:, :2], left[:, 2:] = eye(2), -G[-1]
            C = left * scatter * adjoint(left) / (2 * (P - 1))
            A = (U_inverse.T * U_inverse.apply(conj)) / P  # sum over e of q_e q_e^H / P
            A_sum += A * P / M**2
            C_sum += C / P / M
            for i in range(2):
                for j in range(2):
                    noise[i, j] += A[j, j].real * C[i, i].real / M**2
        mean = sum(G, zeros(2)) / M
        total = matrix(2)
        for g in G:
            for i in range(2):
                for j in range(2):
                    total[i, j] += abs(g[i, j] - mean[i, j])**2 / (M * (M - 1))
        for name, values in (('response', Z_mean[:2, :] * Z_mean[2:, :]**-1), ('noise_variance', noise),
                             ('total_variance', total), ('residual_covariance', C_sum), ('input_factor', A_sum)):
            out[name] += list(values.T)
    return out
