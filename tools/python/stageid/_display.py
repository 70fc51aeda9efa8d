"""How logs, responses, models and fits are displayed: one line as text, a table in a notebook."""

from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stageid import Fit, Frf, Log, Model


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'' if number == 1 else 's'}"


def _with_deviation(value: float, deviation: float | None) -> str:
    return f"{value:.6g}" if deviation is None else f"{value:.6g} ± {deviation:.2g}"


def _channels(names: Sequence[str], units: Iterable[str | None]) -> str:
    return ", ".join(name if unit is None else f"{name} ({unit})" for name, unit in zip(names, units))


def _table(rows: Iterable[Sequence[str]], head: Sequence[str] = ()) -> str:
    def row(cells: Sequence[str], kind: str) -> str:
        return "<tr>" + "".join(f"<{kind} style='text-align: left'>{escape(cell)}</{kind}>" for cell in cells) + "</tr>"

    return "<table>" + (row(head, "th") if head else "") + "".join(row(cells, "td") for cells in rows) + "</table>"


def _titled(text: str, *parts: str) -> str:
    return f"<div><b>{escape(text.strip('<>'))}</b>{''.join(parts)}</div>"


def log_text(log: "Log") -> str:
    return (f"<Log {_count(len(log), 'run')}, {_count(len(log.realizations), 'complete realization')}, "
            f"{_count(len(log.actuators), 'actuator')}, {_count(len(log.sensors), 'sensor')}, "
            f"{log.sample_rate_hz:g} Hz>")


def log_html(log: "Log") -> str:
    return _titled(log_text(log), _table([
        ("realizations", ", ".join(map(str, log.realizations))),
        ("period", f"{log.period_samples} samples, {log.period_samples / log.sample_rate_hz:g} s"),
        ("transient periods", str(log.transient_periods)),
        ("excitation", ", ".join(log.excitation)),
        ("actuators", _channels(log.actuators, log.actuator_units)),
        ("sensors", _channels(log.sensors, log.sensor_units))]))


def frf_text(frf: "Frf") -> str:
    lines, n_y, n_u = frf.response.shape
    kinds = [kind for kind, variance in (("noise", frf.noise_variance), ("total", frf.total_variance))
             if variance is not None]
    band = f"{frf.frequency_hz[0]:g} to {frf.frequency_hz[-1]:g} Hz"
    return f"<Frf {n_y} x {n_u}, {_count(lines, 'line')}, {band}, {' and '.join(kinds) or 'no'} variance>"


def frf_html(frf: "Frf") -> str:
    rows = [("outputs", _channels(frf.outputs, frf.output_units)), ("inputs", _channels(frf.inputs, frf.input_units)),
            ("hold", frf.hold if frf.compensated is None else f"{frf.hold}, compensated: {frf.compensated}")]
    for name, value in (("sample rate", frf.sample_rate_hz), ("noise degrees of freedom", frf.noise_dof),
                        ("total degrees of freedom", frf.total_dof)):
        if value is not None:
            rows.append((name, f"{value:g}{' Hz' if name == 'sample rate' else ''}"))
    findings = [(f.severity, f.channel or "", f.what, f.remedy or "") for f in frf.health]
    return _titled(frf_text(frf), _table(rows),
                   _table(findings, ("finding", "channel", "what", "remedy")) if findings else "")


def model_text(model: "Model") -> str:
    modes = len(model.modes())
    others = len(model.submodels) - modes
    parts = [f"{len(model.outputs)} x {len(model.inputs)}", _count(modes, "mode")]
    if others:
        parts.append(_count(others, "other submodel"))
    return f"<Model {', '.join([*parts, f'hold {model.hold}'])}>"


def model_html(model: "Model") -> str:
    modes = [(_with_deviation(mode.natural_frequency_hz, mode.natural_frequency_std_hz),
              _with_deviation(mode.damping_ratio, mode.damping_ratio_std)) for mode in model.modes()]
    return _titled(model_text(model), _table(modes, ("natural frequency, Hz", "damping ratio")))


def fit_text(fit: "Fit") -> str:
    trust = "trustworthy" if fit.trustworthy else "not trustworthy"
    cost = f", cost {fit.cost[-1]:.4g}" if fit.cost else ""
    return f"<Fit {trust}, {fit.status}{cost}, {_count(len(fit.model.modes()), 'mode')}>"


def fit_html(fit: "Fit") -> str:
    message = "" if fit.message is None else f"<p>{escape(fit.message)}</p>"
    decisions = "".join(f"<li>{escape(line)}</li>" for line in fit.decisions)
    return _titled(fit_text(fit), message, f"<ul>{decisions}</ul>", model_html(fit.model))
