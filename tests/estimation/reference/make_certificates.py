#!/usr/bin/env python3
"""Writes certificates.json beside itself: small problems and their solutions, computed with 60 digits by mpmath.

Needs python3-mpmath; the tests only read the file. The numbers of a problem are doubles. The solution is that of exactly
these doubles, rounded to doubles at the end. As for the certified values of NIST's Statistical Reference Datasets, it is
independent of our code.

"digits" contains the accuracy that a problem permits: -log10 of the largest relative change of a quantity when every
number of the problem changes by the relative 2^-53, the error of a rounded double. It is the worst of three changes with
random signs. Changes of a covariance are relative to the deviations of both parameters.

Two more numbers describe the methods of docs/theory.md. "cancellation" belongs to the partial fractions of a gradient:
the sum of their magnitudes over the magnitude of their sum. "condition" is the condition number of the normal equations
of a fit, scaled to unit diagonal.
"""
import json
import pathlib

from certificate_basis import (basis_problems, cancellation, check_hold, hold_integral_problems, model_problem,
                               solve_basis, solve_hold_integral, solve_model)
from certificate_fits import certified_fit, fit_problems
from certificate_frf import frf_problem, solve_frf
from certificate_numbers import certified


def lines_of(problems):
    return '[\n' + ',\n'.join(json.dumps(x) for x in problems) + ']'


check_hold()
sections = {
    'hold_integrals': [certified(x, solve_hold_integral) for x in hold_integral_problems()],
    'basis': [certified(x, solve_basis) | ({'cancellation': cancellation(x)} if x['a'] else {})
              for x in basis_problems()],
    'models': [certified(model_problem(), solve_model)],
    'fits': [certified_fit(*x) for x in fit_problems()],
    'frf': [certified(frf_problem(), solve_frf)],
}
pathlib.Path(__file__).with_name('certificates.json').write_text(
    '{\n' + ',\n'.join(f'"{name}": {lines_of(problems)}' for name, problems in sections.items()) + '\n}\n')
