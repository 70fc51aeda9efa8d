"""Measures and identifies multivariable motion stages in closed loop; SI units throughout.

Results are identical to those of the program `stageid`, because both use the same compiled functions.
"""

from stageid import _conversions, _display, _native
from stageid._native import *
from stageid._native import __version__
from stageid._results import *

__all__ = ["__version__", *(name for name in globals() if not name.startswith("_"))]

# What needs no compiled code is written in Python.
for _method, _name in ((_conversions.to_xarray, "Frf.to_xarray"), (_conversions.to_control, "Model.to_control")):
    _method.__doc__ = _native._docstring(_name)
Frf.to_xarray = _conversions.to_xarray
Model.to_control = _conversions.to_control
for _kind in (Log, Frf, Model, Fit):
    _kind.__repr__ = getattr(_display, f"{_kind.__name__.lower()}_text")
    _kind._repr_html_ = getattr(_display, f"{_kind.__name__.lower()}_html")
