# The reference of the package: its types, and the docstrings that help(stageid) shows. Those of the results are in
# _results.py.

from collections.abc import Iterator, Sequence
from os import PathLike
from typing import Any, Final, Literal, Union

import numpy as np
import xarray
from numpy.typing import ArrayLike, NDArray

from stageid._results import *
from stageid._results import Complexes, Reals

__version__: str

File = Union[str, PathLike[str]]

class StageidError(Exception):
    """Base class of all errors of stageid."""

class RequestError(StageidError, ValueError):
    """An invalid request (exit code 2 of the program)."""

class FormatError(StageidError, ValueError):
    """A file has an invalid format or content (exit code 2 of the program)."""

class FileError(StageidError, OSError):
    """A file cannot be read or written (exit code 1 of the program)."""

class StageError(StageidError, RuntimeError):
    """The stage or its link failed (exit codes 1 and 4 of the program)."""

class Log:
    """The samples of an experiment: a sequence of runs, each with its realization and experiment.

    len(log) is the number of runs, and log[i] reads one. The samples of a file are read on access.
    """

    def __init__(
        self,
        r: ArrayLike,
        u: ArrayLike,
        y: ArrayLike,
        *,
        sample_rate_hz: float,
        transient_periods: int = 0,
        excitation: Sequence[str] | None = None,
        actuators: Sequence[str] | None = None,
        sensors: Sequence[str] | None = None,
        actuator_units: Sequence[str | None] | None = None,
        sensor_units: Sequence[str | None] | None = None,
        marked: ArrayLike | None = None,
    ) -> None:
        """A log from arrays: M realizations of E experiments of S samples, with P samples per period.

        u and y are not copied if they are float64 and the channels of a sample are adjacent in memory (C order and
        slices of it). Otherwise they are copied once. Do not change them while an estimate runs.

        Parameters
        ----------
        r : [M, E, P, n_r]
            One period of the excitation per run, in the unit of the actuators.
        u : [M, E, S, n_u]
            Actuators, for example in N. S is a whole number of periods, at least transient_periods + 1.
        y : [M, E, S, n_y]
            Sensors, for example in m.
        sample_rate_hz
            In Hz.
        transient_periods
            Periods to discard at the beginning of every run.
        excitation, actuators, sensors
            Names. None: 'u1', 'u2', ... and 'y1', 'y2', ...; the excitation has the names of the actuators if
            n_r = n_u, else 'r1', 'r2', ...
        actuator_units, sensor_units
            One per channel. None: unknown.
        marked : [M, E, S]
            Nonzero: the sample is not used. None: all samples are used.

        Raises
        ------
        RequestError
            Shapes do not match, or the excitation is not finite.
        FormatError
            The runs are not whole periods.
        """
    sample_rate_hz: Final[float]
    """Sample rate of the loop in Hz."""
    period_samples: Final[int]
    """Samples per period of the excitation."""
    transient_periods: Final[int]
    """Periods at the beginning of every run that an estimate discards."""
    realizations: Final[list[int]]
    """Realizations with a complete run, counted from 1 and ascending."""
    excitation: Final[list[str]]
    """Names of the excited channels, [n_r]."""
    actuators: Final[list[str]]
    """Names of the actuators, [n_u]."""
    sensors: Final[list[str]]
    """Names of the sensors, [n_y]."""
    actuator_units: Final[list[str | None]]
    """Units of the actuators, [n_u]; None: unknown."""
    sensor_units: Final[list[str | None]]
    """Units of the sensors, [n_y]; None: unknown."""
    def __len__(self) -> int:
        """Number of runs, including incomplete ones."""
    def __iter__(self) -> Iterator[Run]:
        """Iterates over the runs."""
    def __getitem__(self, run: int) -> Run:
        """Reads run i, as index of a sequence: from 0, or from the end if negative.

        Raises
        ------
        IndexError
            There is no such run.
        FormatError
            Samples of the file are damaged.
        """
    def arrays(self) -> LogArrays:
        """All complete runs as arrays. For a log in memory, these are its own arrays, not copies.

        Raises
        ------
        RequestError
            Runs are missing, or differ in length.
        FormatError
            Samples of the file are damaged.
        """

class Frf:
    """A frequency response G(j omega_k) with its uncertainty: the content of frf.h5.

    N lines, n_y outputs, n_u inputs. The arrays are read-only views, not copies.
    """

    def __init__(
        self,
        frequency_hz: ArrayLike,
        response: ArrayLike,
        *,
        noise_variance: ArrayLike | None = None,
        total_variance: ArrayLike | None = None,
        noise_dof: float | None = None,
        total_dof: float | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        input_units: Sequence[str | None] | None = None,
        output_units: Sequence[str | None] | None = None,
        sample_rate_hz: float | None = None,
        hold: Literal["none", "zoh"] = "none",
    ) -> None:
        """A frequency response from other data. The arrays are copied. None: unknown.

        Parameters
        ----------
        frequency_hz : [N]
            In Hz, increasing.
        response : [N, n_y, n_u]
            Complex, unit of output over unit of input.
        noise_variance, total_variance : [N, n_y, n_u]
            E|dG|^2 of this response.
        noise_dof, total_dof
            Their complex degrees of freedom.
        inputs, outputs
            Names. None: 'u1', 'u2', ... and 'y1', 'y2', ...
        input_units, output_units
            One per channel.
        sample_rate_hz
            In Hz.
        hold
            'zoh' for a plant in a digital loop (needs the sample rate), else 'none'.

        Raises
        ------
        RequestError
            Shapes do not match, or values are not finite.
        """
    frequency_hz: Final[Reals]
    """Frequencies in Hz, [N], increasing."""
    response: Final[Complexes]
    """G(j omega_k), complex128 [N, n_y, n_u], unit of output over unit of input."""
    noise_variance: Final[Reals | None]
    """E|dG|^2 due to noise, from periods, float64 [N, n_y, n_u]; None: unknown."""
    total_variance: Final[Reals | None]
    """E|dG|^2 due to noise and nonlinearity, from realizations, float64 [N, n_y, n_u]; None: unknown."""
    noise_dof: Final[float | None]
    """Complex degrees of freedom of noise_variance; None: unknown."""
    total_dof: Final[float | None]
    """Complex degrees of freedom of total_variance; None: unknown."""
    correlated_lines: Final[float]
    """Number of lines per independent line in zippered experiments; else 1."""
    inputs: Final[list[str]]
    """Names of the inputs, [n_u]."""
    outputs: Final[list[str]]
    """Names of the outputs, [n_y]."""
    input_units: Final[list[str | None]]
    """Units of the inputs, [n_u]; None: unknown."""
    output_units: Final[list[str | None]]
    """Units of the outputs, [n_y]; None: unknown."""
    sample_rate_hz: Final[float | None]
    """Sample rate of the loop in Hz; None: unknown."""
    hold: Final[str]
    """'zoh' if the response was measured in a digital loop, 'none' for a continuous-time plant."""
    compensated: Final[str | None]
    """'delay' or 'hold' if the response is compensated for it; None: not compensated."""
    delay_s: Final[float | None]
    """Compensated delay in s, without that of the hold; None: not compensated."""
    provenance_json: Final[str]
    """Input files with their hashes, options and versions, as JSON."""
    health: Final[list[Finding]]
    """Findings in the data, as `stageid frf` lists them."""
    def select(
        self,
        *,
        band_hz: Sequence[float] | None = None,
        inputs: str | Sequence[str] | None = None,
        outputs: str | Sequence[str] | None = None,
    ) -> Frf:
        """Selects lines and channels; None: all.

        Parameters
        ----------
        band_hz
            (low, high) in Hz, inclusive.
        inputs, outputs
            One name, or several in the requested order.

        Raises
        ------
        RequestError
            No line remains, or a name is unknown.
        """
    def compensate(self, what: Literal["delay", "hold"], delay_s: float) -> Frf:
        """Removes the delay, or the zero-order hold and the delay, from the response.

        'delay': G e^{j omega (delay_s + T/2)}. 'hold': G e^{j omega delay_s} (j omega T) / (1 - e^{-j omega T}).

        Parameters
        ----------
        what
            'delay' or 'hold'.
        delay_s
            In s, without the delay of the hold.

        Raises
        ------
        RequestError
            The response is already compensated, or its sample rate is unknown.
        """
    def confidence_radius(self, level: float = 0.95, variance: Literal["noise", "total"] = "noise") -> Reals:
        """Radii of circles that contain the true response with a given probability.

        radius^2 = variance F_{2, 2 nu; level}, for a variance with nu complex degrees of freedom.

        Parameters
        ----------
        level
            The probability, between 0 and 1.
        variance
            'noise' or 'total'.

        Returns
        -------
        float64 [N, n_y, n_u]
            In the unit of the response.

        Raises
        ------
        RequestError
            That variance or its degrees of freedom are unknown.

        References
        ----------
        R. Pintelon and J. Schoukens, System Identification, 2nd ed. (2012), section 2.7.
        """
    def to_xarray(self) -> xarray.Dataset:
        """The response and its variances as an xarray.Dataset with the dimensions frequency, output and input.

        The arrays are not copied. Units are in the attributes `units` of the variables and in the coordinates
        output_unit and input_unit. Unknown values are omitted.

        Raises
        ------
        ImportError
            The package xarray is not installed.
        """

class Model:
    """The model P(s) = sum of submodels, with delays: the content of model.json.

    References
    ----------
    M. van der Hulst et al., Frequency domain identification for multivariable motion control systems: applied to a
    prototype wafer stage, equations (1) to (4).
    """

    inputs: Final[list[str]]
    """Names of the inputs, [n_u]."""
    outputs: Final[list[str]]
    """Names of the outputs, [n_y]."""
    sample_rate_hz: Final[float | None]
    """Sample rate of the loop in Hz; None: unknown."""
    hold: Final[str]
    """Hold of the sampled data to which the model was fitted: 'none', 'phase', 'sinc' or 'exact'."""
    input_delay_s: Final[Reals]
    """Delays in s, [n_u]."""
    output_delay_s: Final[Reals]
    """Delays in s, [n_y]."""
    input_delay_std_s: Final[Reals | None]
    """Standard deviations in s, [n_u]; None: the delay was given, or unknown."""
    output_delay_std_s: Final[Reals | None]
    """Standard deviations in s, [n_y]; None: the delay was given, or unknown.

    With delays per channel, the last output is the reference; its deviation is 0.
    """
    submodels: Final[list[Submodel]]
    """The terms of the sum, in SI units, with s in rad/s."""
    fit: Final[FitRecord]
    """How the model was fitted."""
    provenance_json: Final[str]
    """Input files with their hashes, options and versions, as JSON."""
    def response(self, frequency_hz: ArrayLike) -> Complexes:
        """P(j omega) including the hold and the delays of the model. The result is not copied.

        Parameters
        ----------
        frequency_hz : [N]
            In Hz; one number is N = 1.

        Returns
        -------
        complex128 [N, n_y, n_u]
            Unit of output over unit of input.

        Raises
        ------
        RequestError
            A frequency is not finite, or not below the Nyquist frequency of a model with a hold.
        """
    def modes(self) -> list[Mode]:
        """The modes, in the order of the submodels."""
    def state_space(self) -> StateSpace:
        """Minimal continuous-time state space in real modal form, without hold and delays, in rad/s.

        Raises
        ------
        RequestError
            Poles of a submodel coincide, or a submodel is improper.

        References
        ----------
        E. G. Gilbert, SIAM J. Control 1 (1963) 128.
        """
    def sampled_state_space(self) -> SampledStateSpace:
        """State space behind a zero-order hold at sample_rate_hz, exact at the samples, delays included.

        Raises
        ------
        RequestError
            The sample rate is unknown, or as state_space().

        References
        ----------
        K. J. Astrom and B. Wittenmark, Computer-Controlled Systems, 3rd ed. (1997), sections 2.3 and 2.4.
        """
    def to_control(self, *, sampled: bool | None = None) -> Any:
        """The model as control.StateSpace of the package python-control, with the names of inputs and outputs.

        Parameters
        ----------
        sampled
            True: sampled_state_space() with the delays as states. False: state_space(), without the delays.
            None: sampled if the sample rate is known.

        Raises
        ------
        ImportError
            The package control is not installed.
        RequestError
            As state_space() or sampled_state_space(), or a delay is negative.
        """
    def save(self, file: File) -> None:
        """Writes model.json atomically.

        Raises
        ------
        FileError
            The file cannot be written.
        RequestError
            The name does not end in .json.
        """

class Fit:
    """The result of a fit: the model, the decisions on the way, and whether it is trustworthy."""

    model: Final[Model]
    """The fitted model (a copy)."""
    trustworthy: Final[bool]
    """False if `stageid fit` would end with exit code 3."""
    status: Final[str]
    """'gradient_small', 'step_small', or the reason why the fit is not trustworthy."""
    message: Final[str | None]
    """How the fit ended, in one line; None: there is nothing to report."""
    cost: Final[list[float]]
    """Cost 1/(2N) sum vec(E)^H W vec(E) per iteration, beginning with the start; equation (8) of the paper."""
    decisions: Final[list[str]]
    """What was chosen and why, one line per decision."""
    removal_cost: Final[list[float]]
    """Increase of sum W |E|^2 without each submodel."""
    response_variance: Final[Reals | None]
    """E|dP|^2 of the model's response on the fitted lines, float64 [N, n_y, n_u]; None: unknown.

    A read-only view, not a copy.
    """
    covariance: Final[Covariance | None]
    """Covariance of the parameters, as `stageid fit --covariance` writes it; None: not requested, or unknown."""

def call(*args: object) -> int:
    """Runs a command of the program in this process: call('fit', 'frf.h5', '-o', 'model.json').

    Returns
    -------
    int
        The exit code: 0 done, 3 done but the result is not trustworthy, 4 stopped for safety, 1 ended by the stage.

    Raises
    ------
    RequestError, FormatError, FileError, StageError
        The program reports an error.
    """

def multisine(
    sample_rate_hz: float,
    period_samples: int,
    low_hz: float,
    high_hz: float,
    rms: float,
    seed: int,
    *,
    lines: Literal["all", "odd", "odd_random"] = "all",
    shape: ArrayLike | None = None,
    crest_iterations: int = 0,
) -> Reals:
    """One period of a random-phase multisine, x(n) = sum_k A_k cos(2 pi l_k n / N + phi_k).

    Parameters
    ----------
    sample_rate_hz
        In Hz.
    period_samples
        N.
    low_hz, high_hz
        The band in Hz, inclusive.
    rms
        RMS value of the samples, in the unit of the result.
    seed
        The same seed gives the same signal on every machine.
    lines
        'all', 'odd' or 'odd_random'.
    shape : [lines]
        Relative amplitude per line. None: flat.
    crest_iterations
        Number of clipping iterations that lower the crest factor.

    Returns
    -------
    float64 [period_samples]
        Not copied.

    Raises
    ------
    RequestError
        A value is out of range.

    References
    ----------
    R. Pintelon and J. Schoukens, System Identification, 2nd ed. (2012); E. Van der Ouderaa et al. (1988) for the
    crest factor.
    """

def simulate(config: File) -> Log:
    """Runs an experiment file (.yaml) on its simulated stage, in virtual time and in memory.

    The samples are those of `stageid run CONFIG --backend sim --pace 0`. The arrays() of the log are views of the
    recorded rows, not copies. Releases the GIL; Ctrl-C interrupts it.

    Raises
    ------
    FileError, FormatError
        The file cannot be read, or is invalid.
    RequestError
        The experiment is invalid.
    StageError
        A limit or a fault ended the run.
    """

def read_log(file: File) -> Log:
    """Opens a log (.slog or HDF5). Samples are read on access.

    Raises
    ------
    FileError, FormatError
        The file cannot be read, or is not a log.
    """

def frf(
    logs: Log | File | Sequence[Log | File],
    *,
    inputs: str | Sequence[str] | None = None,
    outputs: str | Sequence[str] | None = None,
    realizations: int | Sequence[int] | None = None,
    transient_periods: int | None = None,
    method: Literal["periodic", "lpm"] = "periodic",
    covariance: Literal["diagonal", "full"] = "diagonal",
    periods: Literal["consistent", "unmarked"] = "consistent",
    covariance_lines: int = 1,
    health: bool = True,
    stage: File | None = None,
    threads: int | None = None,
) -> Frf:
    """Estimates the plant's frequency response from closed-loop logs, G = (mean Y) (mean U)^-1 line by line.

    The numbers are those of `stageid frf`. Releases the GIL; Ctrl-C interrupts it.

    Parameters
    ----------
    logs
        A Log, a file name, or a list of these.
    inputs
        One name or several, of actuators. None: those that are excited.
    outputs
        One name or several, of sensors. None: all.
    realizations
        One realization or several, counted from 1. None: all complete ones.
    transient_periods
        Number of periods to discard. None: the value of the log ('lpm': 0).
    method
        'periodic', or 'lpm', which uses whole records and models the transient.
    covariance
        'diagonal' or 'full'.
    periods
        'consistent' replaces short glitches and discards other outliers ('lpm': discards periods with a glitch);
        'unmarked' uses all unmarked periods.
    covariance_lines
        Odd number of lines over which the noise covariance is smoothed.
    health
        True: also examine the data, see Frf.health.
    stage
        Stage file to check the data against. None: the stage file in the log.
    threads
        None: all cores. The result does not depend on it.

    Raises
    ------
    RequestError
        An option is invalid, or the data do not suffice.
    FileError, FormatError
        A file cannot be read, or is invalid.

    References
    ----------
    R. Pintelon and J. Schoukens, System Identification, 2nd ed. (2012), chapters 2, 4 and 7; R. Pintelon et al.,
    Mech. Syst. Signal Process. 24 (2010), for 'lpm'.
    """

def read_frf(file: File) -> Frf:
    """Reads frf.h5.

    Raises
    ------
    FileError, FormatError
        The file cannot be read, or is not a frequency response.
    """

def write_frf(file: File, frf: Frf) -> None:
    """Writes frf.h5 atomically, identical to the file of the program.

    Raises
    ------
    FileError
        The file cannot be written.
    RequestError
        The name does not end in .h5 or .hdf5.
    """

def modes(
    frf: Frf, *, kind: Literal["accelerance", "response", "whitened"] = "accelerance", prominence_db: float = 3.0
) -> list[CandidateMode]:
    """Candidate modes by frequency: prominent peaks of the mode indicator, without crossings of its curves.

    Parameters
    ----------
    kind
        Basis of the indicator, see cmif().
    prominence_db
        Least prominence of a peak, in dB.

    Raises
    ------
    RequestError
        'whitened', but the response has no variances.
    """

def cmif(frf: Frf, *, kind: Literal["response", "accelerance", "whitened"] = "response") -> Reals:
    """Complex mode indicator function: squared singular values of G(j omega_k), largest first.

    Parameters
    ----------
    kind
        'response': G. 'accelerance': omega^2 G. 'whitened': each channel over its standard deviation.

    Returns
    -------
    float64 [min(n_y, n_u), N]
        In the unit of the response squared.

    Raises
    ------
    RequestError
        'whitened', but the response has no variances.

    References
    ----------
    C. Y. Shih et al. (1988); M. van der Hulst et al., section 4.5.
    """

def stabilization(
    frf: Frf, *, most_order: int = 80, delay_s: float = 0.0
) -> list[StabilizationPole]:
    """Poles for the orders 2, 4, ... by least squares in the z plane: an independent check of the modes.

    Releases the GIL; Ctrl-C interrupts it.

    Parameters
    ----------
    most_order
        The highest order.
    delay_s
        Delay in s that is compensated first, including that of the hold.

    Raises
    ------
    RequestError
        There are too few lines.

    References
    ----------
    P. Guillaume et al., Proc. 21st IMAC (2003) 183; B. Cauberghe et al., Mech. Syst. Signal Process. 19 (2005) 1080.
    """

def fit(
    frf: Frf | File,
    *,
    band_hz: Sequence[float] | None = None,
    modes: str | int | Sequence[float] | PathLike[str] | None = None,
    weighting: File | None = None,
    hold: Literal["none", "phase", "sinc", "exact"] | None = None,
    delay: Literal["estimate", "per_channel"] | float | None = None,
    rigid_body: str | int | None = None,
    residue_rank: Literal["full"] | int = "full",
    damping: Literal["proportional", "general"] | None = None,
    direct_term: Literal["none", "full"] | None = None,
    submodels: Sequence[str] | None = None,
    method: Literal["riv", "gn", "sk"] = "riv",
    max_iterations: int = 100,
    search_seconds: float | None = 180.0,
    threads: int | None = None,
    covariance: bool = False,
) -> Fit:
    """Fits the additive model P(s) = sum of modes and rigid body to a frequency response, like `stageid fit`.

    A fit that does not converge is a result: check Fit.trustworthy. Releases the GIL; Ctrl-C interrupts it.

    Parameters
    ----------
    frf
        An Frf or a file name.
    band_hz
        (low, high) in Hz. None: all lines.
    modes
        'auto', 'none', the number of modes, a list of frequencies in Hz, or the name of a modes.json.
        None: 'auto' unless submodels are given.
    weighting
        'unit', 'inverse_magnitude', 'relative', 'noise_variance', 'total_variance', 'likelihood', or the name of an
        HDF5 file with /weights. None: according to the variances of the response.
    hold
        'none', 'phase', 'sinc' or 'exact'. None: according to the response.
    delay
        In s, 'estimate' or 'per_channel'. None: according to the response.
    rigid_body
        'auto', 'none', 'full', a rank, 'suspension' or 'suspension:F1:F2' (Hz).
        None: 'auto', except for accelerations or if submodels are given.
    residue_rank
        Rank of the residues of the modes: 'full' or a number.
    damping
        'proportional' (B_0) or 'general' (B_0 + B_1 s). None: according to the unit of the outputs.
    direct_term
        'none' or 'full'. None: according to the unit of the outputs.
    submodels
        Additional submodels in the form of --submodel, such as 'n=4,m=3,f=120:180'. None: no additional ones.
    method
        'riv', 'gn' or 'sk'.
    max_iterations
        Limit per fit.
    search_seconds
        Budget of the search for modes, in seconds of a typical core (counted as work). None: unlimited.
    threads
        None: all cores. The result does not depend on it.
    covariance
        True: also compute Fit.covariance (at most 4000 parameters).

    Raises
    ------
    RequestError
        An option is invalid, or the data do not suffice.
    FileError, FormatError
        A file cannot be read, or is invalid.

    References
    ----------
    M. van der Hulst et al., Frequency domain identification for multivariable motion control systems: applied to a
    prototype wafer stage, section 3.
    """

def read_model(file: File) -> Model:
    """Reads model.json.

    Raises
    ------
    FileError, FormatError
        The file cannot be read, or is not a model.
    """

def validate(model: Model, frf: Frf, *, band_hz: Sequence[float] | None = None) -> Validation:
    """Compares a model with a response to which it was not fitted.

    Parameters
    ----------
    band_hz
        (low, high) in Hz. None: the band of the fit.

    Raises
    ------
    RequestError
        The response lacks a channel of the model, or has other units.
    """

def pair_modes(first: Model, second: Model) -> list[ModePair]:
    """Pairs the modes of two models with the same channels by frequency and shape, in the order of the first.

    Raises
    ------
    RequestError
        The numbers of channels differ.

    References
    ----------
    R. J. Allemang and D. L. Brown, Proc. 1st IMAC (1982) 110.
    """
