"""Objects of other packages, which are imported only when they are asked for."""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray

    from stageid import Frf, Model


def _package(name: str, asked_by: str) -> Any:
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        raise ImportError(f"{asked_by} requires the package {name}: pip install {name}", name=name) from None


def _common_unit(units: list[str | None]) -> str | None:
    """Of all channels; in parentheses unless it is one word."""
    unit = units[0] if len(set(units)) == 1 else None
    return unit if unit is None or unit.isalnum() else f"({unit})"


def to_xarray(self: "Frf") -> "xarray.Dataset":
    package = _package("xarray", "Frf.to_xarray()")
    axes = ("frequency", "output", "input")
    output, input = _common_unit(self.output_units), _common_unit(self.input_units)
    unit = f"{output}/{input}" if output and input else None

    def variable(values: Any, unit: str | None, **attributes: Any) -> Any:
        known = {name: value for name, value in {"units": unit, **attributes}.items() if value is not None}
        return axes, values, known

    variables = {"response": variable(self.response, unit)}
    for name, values, dof in (("noise_variance", self.noise_variance, self.noise_dof),
                              ("total_variance", self.total_variance, self.total_dof)):
        if values is not None:
            variables[name] = variable(values, unit and f"({unit})^2", degrees_of_freedom=dof)
    coordinates = {"frequency": ("frequency", self.frequency_hz, {"units": "Hz"}),
                   "output": self.outputs, "input": self.inputs,
                   "output_unit": ("output", [unit or "" for unit in self.output_units]),
                   "input_unit": ("input", [unit or "" for unit in self.input_units])}
    attributes = {name: getattr(self, name) for name in ("sample_rate_hz", "hold", "compensated", "delay_s",
                                                        "provenance_json") if getattr(self, name) is not None}
    dataset: "xarray.Dataset" = package.Dataset(variables, coordinates, attributes)
    return dataset


def to_control(self: "Model", *, sampled: bool | None = None) -> Any:
    package = _package("control", "Model.to_control()")
    names = {"inputs": self.inputs, "outputs": self.outputs}
    if sampled is None:
        sampled = self.sample_rate_hz is not None
    if not sampled:
        return package.ss(*self.state_space(), **names)
    system = self.sampled_state_space()
    return package.ss(*system.with_delays(), 1.0 / system.sample_rate_hz, **names)
