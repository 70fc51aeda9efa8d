from collections.abc import Iterator, Sequence
from os import PathLike
from typing import Any, TypedDict, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

File = Union[str, PathLike[str]]
Reals = NDArray[np.float64]
Complexes = NDArray[np.complex128]

class StageidError(Exception): ...
class RequestError(StageidError, ValueError): ...
class FormatError(StageidError, ValueError): ...
class FileError(StageidError, OSError): ...
class StageError(StageidError, RuntimeError): ...

class Run(TypedDict):
    realization: int
    experiment: int
    complete: bool
    excitation: Reals
    actuators: Reals
    sensors: Reals
    marked: NDArray[np.uint8]

class CandidateMode(TypedDict):
    frequency_hz: float
    damping_ratio: float
    cmif_curve: int

class StabilizationPole(TypedDict):
    order: int
    frequency_hz: float
    damping_ratio: float
    stable_frequency: bool
    stable_damping: bool

class Finding(TypedDict):
    severity: str
    cause: str
    channel: str
    what: str
    figure: str
    remedy: str

class Mode(TypedDict):
    natural_frequency_hz: float
    natural_frequency_std_hz: float | None
    damping_ratio: float
    damping_ratio_std: float | None
    modal_mass: float
    output_shape: Complexes
    input_shape: Complexes
    modal_mass_std: float | None
    output_shape_std: Complexes | None
    input_shape_std: Complexes | None

class Covariance(TypedDict):
    name: list[str]
    unit: list[str]
    value: Reals
    sandwich: Reals
    likelihood: Reals
    response_variance: Reals
    confidence_radius: Reals

class Submodel(TypedDict):
    integrators: int
    denominator: list[float]
    numerator: list[Reals]
    numerator_std: list[Reals]

class ModePair(TypedDict):
    first: int
    second: int
    frequency_difference: float
    output_mac: float
    input_mac: float

class Log:
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
        actuator_units: Sequence[str] | None = None,
        sensor_units: Sequence[str] | None = None,
        marked: ArrayLike | None = None,
    ) -> None: ...
    @property
    def sample_rate_hz(self) -> float: ...
    @property
    def period_samples(self) -> int: ...
    @property
    def transient_periods(self) -> int: ...
    @property
    def excitation(self) -> list[str]: ...
    @property
    def actuators(self) -> list[str]: ...
    @property
    def sensors(self) -> list[str]: ...
    @property
    def actuator_units(self) -> list[str]: ...
    @property
    def sensor_units(self) -> list[str]: ...
    def __len__(self) -> int: ...
    def __iter__(self) -> Iterator[Run]: ...
    def __getitem__(self, run: int) -> Run: ...
    def arrays(self) -> tuple[Reals, Reals, Reals]: ...

class Frf:
    def __init__(
        self,
        frequency_hz: ArrayLike,
        response: ArrayLike,
        *,
        noise_variance: ArrayLike | None = None,
        total_variance: ArrayLike | None = None,
        noise_dof: float = 0.0,
        total_dof: float = 0.0,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        input_units: Sequence[str] | None = None,
        output_units: Sequence[str] | None = None,
        sample_rate_hz: float = 0.0,
        hold: str = "none",
    ) -> None: ...
    @property
    def frequency_hz(self) -> Reals: ...
    @property
    def response(self) -> Complexes: ...
    @property
    def noise_variance(self) -> Reals | None: ...
    @property
    def total_variance(self) -> Reals | None: ...
    @property
    def noise_dof(self) -> float: ...
    @property
    def total_dof(self) -> float: ...
    @property
    def correlated_lines(self) -> float: ...
    @property
    def inputs(self) -> list[str]: ...
    @property
    def outputs(self) -> list[str]: ...
    @property
    def input_units(self) -> list[str]: ...
    @property
    def output_units(self) -> list[str]: ...
    @property
    def sample_rate_hz(self) -> float: ...
    @property
    def hold(self) -> str: ...
    @property
    def compensated(self) -> str: ...
    @property
    def delay_s(self) -> float: ...
    @property
    def provenance_json(self) -> str: ...
    @property
    def health(self) -> list[Finding]: ...
    def select(
        self,
        *,
        band_hz: Sequence[float] | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
    ) -> Frf: ...
    def compensate(self, what: str, delay_s: float) -> Frf: ...
    def confidence_radius(self, level: float = 0.95, variance: str = "noise") -> Reals: ...

class Model:
    @property
    def inputs(self) -> list[str]: ...
    @property
    def outputs(self) -> list[str]: ...
    @property
    def sample_rate_hz(self) -> float: ...
    @property
    def hold(self) -> str: ...
    @property
    def input_delay_s(self) -> Reals: ...
    @property
    def output_delay_s(self) -> Reals: ...
    @property
    def input_delay_std_s(self) -> Reals | None: ...
    @property
    def output_delay_std_s(self) -> Reals | None: ...
    @property
    def submodels(self) -> list[Submodel]: ...
    @property
    def fit(self) -> dict[str, Any]: ...
    @property
    def provenance_json(self) -> str: ...
    def response(self, frequency_hz: ArrayLike) -> Complexes: ...
    def modes(self) -> list[Mode]: ...
    def state_space(self) -> tuple[Reals, Reals, Reals, Reals]: ...
    def sampled_state_space(
        self,
    ) -> tuple[Reals, Reals, Reals, Reals, NDArray[np.int64], NDArray[np.int64]]: ...
    def save(self, file: File) -> None: ...

class Fit:
    @property
    def model(self) -> Model: ...
    @property
    def trustworthy(self) -> bool: ...
    @property
    def status(self) -> str: ...
    @property
    def message(self) -> str: ...
    @property
    def cost(self) -> list[float]: ...
    @property
    def decisions(self) -> list[str]: ...
    @property
    def removal_cost(self) -> list[float]: ...
    @property
    def response_variance(self) -> Reals | None: ...
    @property
    def covariance(self) -> Covariance | None: ...

def call(*args: object) -> int: ...
def multisine(
    sample_rate_hz: float,
    period_samples: int,
    low_hz: float,
    high_hz: float,
    rms: float,
    seed: int,
    *,
    lines: str = "all",
    shape: ArrayLike | None = None,
    crest_iterations: int = 0,
) -> Reals: ...
def simulate(config: File) -> Log: ...
def read_log(file: File) -> Log: ...
def frf(
    logs: Log | File | Sequence[Log | File],
    *,
    inputs: Sequence[str] = ...,
    outputs: Sequence[str] = ...,
    realizations: Sequence[int] = ...,
    transient_periods: int | None = None,
    method: str = "periodic",
    covariance: str = "diagonal",
    periods: str = "consistent",
    covariance_lines: int = 1,
    health: bool = True,
    stage: File | None = None,
    threads: int = 0,
) -> Frf: ...
def read_frf(file: File) -> Frf: ...
def write_frf(file: File, frf: Frf) -> None: ...
def modes(frf: Frf, *, kind: str = "accelerance", prominence_db: float = 3.0) -> list[CandidateMode]: ...
def cmif(frf: Frf, *, kind: str = "response") -> Reals: ...
def stabilization(
    frf: Frf, *, most_order: int = 80, delay_s: float = 0.0
) -> list[StabilizationPole]: ...
def fit(
    frf: Frf | File,
    *,
    band_hz: Sequence[float] | None = None,
    modes: str | int | Sequence[float] | PathLike[str] | None = None,
    weighting: File | None = None,
    hold: str = "",
    delay: str | float | None = None,
    rigid_body: str | int | None = None,
    residue_rank: str | int = "full",
    damping: str = "",
    direct_term: str = "",
    submodels: Sequence[str] = ...,
    method: str = "riv",
    max_iterations: int = 100,
    search_seconds: float = 180.0,
    threads: int = 0,
    covariance: bool = False,
) -> Fit: ...
def read_model(file: File) -> Model: ...
def validate(model: Model, frf: Frf, *, band_hz: Sequence[float] | None = None) -> dict[str, Any]: ...
def pair_modes(first: Model, second: Model) -> list[ModePair]: ...
