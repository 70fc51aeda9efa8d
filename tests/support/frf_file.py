"""frf.h5 files as another program would write them (docs/formats.md)."""

import h5py
import numpy as np


def write_frf(path, frequency_hz, response, variance=None, *, inputs=None, outputs=None, units=("N", "m"),
              datasets=(), **attributes):
    """`response`: lines x outputs x inputs. `units`: of inputs and outputs. `attributes` replace the defaults: no
    sampling, no delay."""
    with h5py.File(path, "w") as file:
        file.attrs.update({"format": "stageid-frf", "format_version": 1, "sample_rate_hz": 0.0, "hold": "none",
                           "compensated": "none", "delay_s": 0.0, **attributes})
        file["frequency_hz"], file["response"] = frequency_hz, response
        if variance is not None:
            file["noise_variance"] = np.broadcast_to(variance, response.shape)
        for name, values in dict(datasets).items():
            file[name] = values
        sides = (("inputs", inputs, units[0], response.shape[2]), ("outputs", outputs, units[1], response.shape[1]))
        for name, channels, unit, count in sides:
            file[name] = channels or [f"{name[0]}{i}" for i in range(count)]
            file[name].attrs["unit"] = unit
