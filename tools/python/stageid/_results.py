"""The classes of results, in SI units. They are plain data: pickle, copy and dataclasses.asdict() work on all."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["CandidateMode", "Covariance", "Finding", "FitRecord", "LogArrays", "Mode", "ModePair", "Run",
           "SampledStateSpace", "StabilizationPole", "StateSpace", "Submodel", "Validation"]

Reals = NDArray[np.float64]
Complexes = NDArray[np.complex128]


class LogArrays(NamedTuple):
    """Samples of M realizations of E experiments of S samples, with P samples per period."""

    r: Reals
    """Excitation, one period, [M, E, P, n_r]."""
    u: Reals
    """Actuators, [M, E, S, n_u]."""
    y: Reals
    """Sensors, [M, E, S, n_y]."""


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """One run of a log: S samples of one experiment of one realization, with P samples per period."""

    realization: int
    """Counted from 1."""
    experiment: int
    """Counted from 1."""
    complete: bool
    """False if the run was interrupted."""
    excitation: Reals
    """One period, [P, n_r]."""
    actuators: Reals
    """[S, n_u], column-major."""
    sensors: Reals
    """[S, n_y], column-major."""
    marked: NDArray[np.bool_]
    """[S]; True: the sample is not used."""

    def __repr__(self) -> str:
        return (f"<Run of realization {self.realization}, experiment {self.experiment}, {len(self.sensors)} samples"
                f"{'' if self.complete else ', incomplete'}>")


@dataclass(frozen=True)
class Finding:
    """A finding in the data."""

    severity: str
    """'fault', 'doubt' or 'not checked'. With a fault, the program ends with exit code 3."""
    cause: str
    channel: str | None
    """Names of the channels; None: the whole log."""
    what: str
    """What is wrong, or what was not checked."""
    figure: str | None
    """The number on which the finding is based."""
    remedy: str | None
    """What to do, or what the check needs."""


@dataclass(frozen=True)
class CandidateMode:
    """A peak of the mode indicator."""

    frequency_hz: float
    damping_ratio: float
    """From the half-power width."""
    cmif_curve: int
    """Curve of the mode indicator, counted from 1."""


@dataclass(frozen=True)
class StabilizationPole:
    """A pole of one order of a stabilization diagram."""

    order: int
    frequency_hz: float
    damping_ratio: float
    stable_frequency: bool
    """The order before has a pole at almost the same frequency."""
    stable_damping: bool
    """The same for the damping ratio; implies stable_frequency."""


@dataclass(frozen=True, eq=False, repr=False)
class Mode:
    """A mode of a model.

    P_i(s) = output_shape input_shape^T / (modal_mass (s^2 + 2 zeta omega s + omega^2)) for proportional damping. Both
    shapes have norm 1, and the leading component of output_shape is real and positive.
    The standard deviations are of first order; None: unknown.

    References
    ----------
    D. J. Ewins, Modal Testing, 2nd ed. (2000), section 2.8.
    """

    natural_frequency_hz: float
    damping_ratio: float
    modal_mass: float
    """kg for N and m."""
    output_shape: Complexes
    """[n_y]."""
    input_shape: Complexes
    """[n_u]."""
    natural_frequency_std_hz: float | None
    damping_ratio_std: float | None
    modal_mass_std: float | None
    output_shape_std: Complexes | None
    """[n_y]; the real part is the deviation of the real parts, the imaginary part that of the imaginary parts."""
    input_shape_std: Complexes | None
    """[n_u]; as output_shape_std."""

    def __repr__(self) -> str:
        return f"<Mode {self.natural_frequency_hz:.6g} Hz, damping ratio {self.damping_ratio:.4g}>"


@dataclass(frozen=True, eq=False, repr=False)
class Submodel:
    """P_i(s) = (B_0 + B_1 s + ...) / (s^integrators (1 + a_1 s + ...)), s in rad/s; equations (1) to (4) of the paper.

    The paper is M. van der Hulst et al., Frequency domain identification for multivariable motion control systems.
    """

    integrators: int
    denominator: Reals
    """[1, a_1, ..., a_n]."""
    numerator: Reals
    """B_0, B_1, ...: [m + 1, n_y, n_u]."""
    numerator_std: Reals | None
    """Standard deviations, of the same shape; None: unknown."""

    def __repr__(self) -> str:
        return (f"<Submodel of order {self.integrators + len(self.denominator) - 1}, {self.integrators} integrators, "
                f"{len(self.numerator)} numerator coefficients>")


@dataclass(frozen=True)
class FitRecord:
    """The fit of a model, as model.json contains it."""

    cost: float
    """1/(2N) sum vec(E)^H W vec(E); equation (8) of the paper."""
    weighting: str | None
    iterations: int
    status: str | None
    """How the fit ended; None: unknown, as for models of other programs."""
    relative_rms_error: float | None
    """sqrt(mean |E|^2/|G|^2) over the lines of the responding channels; None: no channel responds."""
    band_hz: tuple[float, float] | None
    """Lowest and highest line; None: unknown."""


@dataclass(frozen=True, eq=False, repr=False)
class Covariance:
    """The covariance of p parameters and of the model's response on N lines."""

    name: list[str]
    """Place of each parameter in model.json, such as 'submodels[0].denominator[1]'."""
    unit: list[str]
    value: Reals
    """[p]."""
    sandwich: Reals
    """Covariance of the estimate, [p, p]; the standard deviations of the model are based on it."""
    likelihood: Reals
    """[2 sum Re{J^H W J}]^-1, [p, p]: equal to sandwich if the weights are the inverse variances."""
    response_variance: Reals
    """E|dP|^2 on the fitted lines, [N, n_y, n_u]."""
    confidence_radius: Reals
    """|dP| is below it with probability 0.95, [N, n_y, n_u]."""

    def __repr__(self) -> str:
        return f"<Covariance of {len(self.name)} parameters, {len(self.response_variance)} lines>"


@dataclass(frozen=True, eq=False, repr=False)
class Validation:
    """Comparison of a model with data to which it was not fitted. All fields that need variances are None without."""

    relative_rms_error: float | None
    """sqrt(mean |E|^2/|G|^2) over the lines of the responding channels; None: no channel responds."""
    normalized_error: float | None
    """sqrt(sum |E|^2 / sum |G|^2); None: the response is zero."""
    variance: str | None
    """What the error is compared with: 'noise', 'total' or 'scatter'."""
    chi_square_per_dof: float | None
    """Mean of |E|^2 over the variance."""
    expected_chi_square: float | None
    """Its expected value if the error is noise: nu / (nu - 1) for a variance with nu complex degrees of freedom;
    None also if that mean does not exist."""
    explained: bool
    """False: the error is clearly more than noise and known distortion."""
    reason: str | None
    """Why the error is not explained."""
    whitened_above_95: float | None
    """Share of |E|^2 above the 95 % point of noise, ideally 0.05."""
    whiteness: float | None
    """Largest autocorrelation of the whitened error over lines, lags 1 to 10; None also with fewer than 20 lines."""
    whiteness_limit: float | None
    """99 % limit of whiteness."""
    channel_error: Reals
    """Relative rms error per channel, [n_y, n_u]; NaN: the channel does not respond."""

    def __repr__(self) -> str:
        error = "" if self.relative_rms_error is None else f" relative error {self.relative_rms_error:.3g},"
        chi_square = "" if self.chi_square_per_dof is None else f" chi-square {self.chi_square_per_dof:.3g},"
        return f"<Validation:{error}{chi_square} {'explained' if self.explained else 'not explained'}>"


@dataclass(frozen=True)
class ModePair:
    """A mode of one model and the corresponding mode of another."""

    first: int
    """Index into modes() of the first model."""
    second: int
    """Index into modes() of the second model."""
    frequency_difference: float
    """Relative: (f_second - f_first) / f_first."""
    output_mac: float
    """0 to 1: |phi_a^H phi_b|^2 / (|phi_a|^2 |phi_b|^2) of the output shapes."""
    input_mac: float
    """The same of the input shapes."""


class StateSpace(NamedTuple):
    """x' = A x + B u, y = C x + D u, where x' is the derivative or the next sample."""

    A: Reals
    """[n, n]."""
    B: Reals
    """[n, n_u]."""
    C: Reals
    """[n_y, n]."""
    D: Reals
    """[n_y, n_u]."""


@dataclass(frozen=True, eq=False, repr=False)
class SampledStateSpace:
    """A model behind a zero-order hold, exact at the samples, with whole samples of delay beside the system.

    x[n+1] = A x[n] + sum_j B_j u_j[n - input_delay_samples_j]
    y_i[n + output_delay_samples_i] = C_i x[n] + sum_j D_ij u_j[n - input_delay_samples_j]
    """

    system: StateSpace
    sample_rate_hz: float
    input_delay_samples: NDArray[np.int64]
    """[n_u]."""
    output_delay_samples: NDArray[np.int64]
    """[n_y]."""

    def with_delays(self) -> StateSpace:
        """The system with the delays as states: one shift register per delayed channel.

        Raises RequestError if a delay is negative.
        """
        delayed = _in_series(_shift_registers(self.input_delay_samples), self.system)
        return _in_series(delayed, _shift_registers(self.output_delay_samples))

    def __repr__(self) -> str:
        n_y, n_u = self.system.D.shape
        most = self.input_delay_samples.max() + self.output_delay_samples.max()
        return (f"<SampledStateSpace {n_y} x {n_u}, {len(self.system.A)} states, {self.sample_rate_hz:g} Hz, "
                f"delays up to {most} samples>")


def _in_series(first: StateSpace, second: StateSpace) -> StateSpace:
    A = np.block([[first.A, np.zeros((len(first.A), len(second.A)))], [second.B @ first.C, second.A]])
    return StateSpace(A, np.vstack([first.B, second.B @ first.D]), np.hstack([second.D @ first.C, second.C]),
                      second.D @ first.D)


def _shift_registers(samples: NDArray[np.int64]) -> StateSpace:
    """y_c[n] = u_c[n - samples_c]."""
    if samples.min() < 0:
        from stageid import RequestError
        raise RequestError("with_delays: a negative delay has no state space. Fit the model with a delay of at least 0")
    end = np.cumsum(samples)
    size, channels = int(end[-1]), len(samples)
    A, B, C = np.eye(size, k=-1), np.zeros((size, channels)), np.zeros((channels, size))
    for channel in np.flatnonzero(samples):
        first = end[channel] - samples[channel]
        A[first, :] = 0.0
        B[first, channel] = 1.0
        C[channel, end[channel] - 1] = 1.0
    return StateSpace(A, B, C, np.diag((samples == 0).astype(float)))
