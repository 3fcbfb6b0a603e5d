"""Closed forms over time, which mpmath differentiates, beside the derivatives of a run."""

from __future__ import annotations

from collections.abc import Callable

import mpmath as mp
import pytest

import hybridsim as hs

EXACT, ELSE = 1e-10, 1e-8  # relative


def slope(form: Callable[..., mp.mpf], values: dict[str, float], name: str) -> float:
    """The derivative of a closed form by one of its values, in 40 digits."""
    with mp.workdps(40):
        fixed = {key: mp.mpf(value) for key, value in values.items()}
        return float(mp.diff(lambda q: form(**(fixed | {name: q})), fixed[name]))


def check(
    solution: hs.Solution,
    forms: dict[str, Callable[..., mp.mpf]],
    values: dict[str, float],
    times: list[float],
    error: float = EXACT,
) -> hs.Sensitivities:
    """Compare the derivatives of quantities at times by all values, which are parameters of the model."""
    found = hs.sensitivities(solution, list(values))
    known = {name: solution.model.parameter_values()[name] for name in values}
    at = found.at(times, list(forms))
    for k, t in enumerate(times):
        for i, form in enumerate(forms.values()):
            expected = [
                slope(lambda form=form, t=t, **v: form(mp.mpf(t), **v), known, name) for name in known
            ]
            size = max(1e-3, *map(abs, expected))
            assert at.by_parameter[k, i] == pytest.approx(expected, rel=error, abs=error * size), (t, i)
    return found
