"""This module chooses the runs of a comparison: series of runs of one integrator with several settings."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from hybridsim.analysis.compare.comparison_request import named_options, row_of_integrators
from hybridsim.errors import UsageError
from hybridsim.integrators import integrator_class

RTOLS = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
STEPS_PER_PERIOD = (300, 600, 1200, 2400, 4800)
# SciPy's own event finding is shown for its default method and its best one only, to keep the chart readable.
_ALSO_NATIVE = ("scipy-rk45", "scipy-dop853")
_PERIODS = 10  # periods assumed for a run without a period, if the step is a fraction of one


@dataclass(frozen=True)
class Series:
    """One series of runs in a comparison: an integrator with several values of one option.

    Parameters
    ----------
    integrator : a registered name.
    varied : name of the varied option, such as "rtol" or "steps_per_period"; "v0" for a regularised form.
    values : its values.
    options : further options; an option may be a function of the varied value.
    label : name in the table and the chart; by default the integrator and its options.
    regularized : kind of the regularised form (see `Model.regularized`) that is run instead of the model.
    """

    integrator: str
    varied: str
    values: tuple[float, ...]
    options: Mapping[str, Any] = field(default_factory=dict)
    label: str = ""
    regularized: str = ""

    def __post_init__(self) -> None:
        if not self.values:
            raise UsageError(
                f"no values of {self.varied} are given for {self.integrator}", remedy="use at least one value"
            )
        if (self.varied == "v0") != bool(self.regularized):
            raise UsageError(
                f"`varied` is {self.varied!r}, which does not fit `regularized` = {self.regularized!r}",
                remedy="vary `v0` if and only if `regularized` is set",
            )
        if not self.label:
            shown = {name: value for name, value in self.options.items() if name != "period"}
            details = ", ".join(f"{name}={_shown(value)}" for name, value in shown.items())
            name = f"{self.regularized}, {self.integrator}" if self.regularized else self.integrator
            object.__setattr__(self, "label", f"{name} ({details})" if details else name)

    def options_at(self, value: float) -> dict[str, Any]:
        """Return the options of the run for one value of the varied option."""
        others = {name: item(value) if callable(item) else item for name, item in self.options.items()}
        return others if self.regularized else {self.varied: value, **others}


def _shown(value: Any) -> str:
    if callable(value):
        return "varied"
    return f"{value:g}" if isinstance(value, float) else str(value)


def choose_series(
    requested: Sequence[str | tuple[str, Mapping[str, Any]] | Series] | None,
    rtols: Sequence[float] | None = None,
    steps: Sequence[int] | None = None,
    untimed_span: float | None = None,
) -> tuple[Series, ...]:
    """Return the series of runs that a comparison makes, each with one integrator and several settings.

    Parameters
    ----------
    requested : names, (name, options) or `Series`; by default all registered integrators.
    rtols : tolerances of the integrators with adaptive steps.
    steps : steps per period of the others.
    untimed_span : length of the run if the model has no period; a tenth of it then counts as one.
    """
    line = functools.partial(_line, rtols=rtols, steps=steps, untimed_span=untimed_span)
    chosen: list[Series] = []
    if requested is None:
        from hybridsim.integrators import list_integrators

        for integrator in list_integrators():
            chosen += [
                line(integrator.name, options, label) for options, label in _shown_unasked(integrator.name)
            ]
    else:
        for item in row_of_integrators(requested):
            chosen.append(item if isinstance(item, Series) else line(*named_options(item)))
    if not chosen:
        raise UsageError("no integrators to compare", remedy="use names from hybridsim.list_integrators()")
    labels = [series.label for series in chosen]
    repeated = [label for label in labels if labels.count(label) > 1]
    if repeated:
        raise UsageError(
            f"two series of runs have the label {repeated[0]!r}",
            remedy="use a different label for each series",
        )
    return tuple(chosen)


def _line(
    name: str,
    options: Mapping[str, Any],
    label: str = "",
    *,
    rtols: Sequence[float] | None,
    steps: Sequence[int] | None,
    untimed_span: float | None,
) -> Series:
    if "adaptive" not in integrator_class(name).lacks:
        return Series(name, "rtol", tuple(RTOLS if rtols is None else rtols), options, label)
    counts = tuple(STEPS_PER_PERIOD if steps is None else steps)
    if untimed_span is None:
        return Series(name, "steps_per_period", counts, options, label)
    return Series(name, "steps_per_period", counts, {**options, "period": untimed_span / _PERIODS}, label)


def _shown_unasked(name: str) -> list[tuple[Mapping[str, Any], str]]:
    """Return the options and the label of each default series of an integrator."""
    if name in _ALSO_NATIVE:
        return [({}, ""), ({"events": "native"}, f"{name}, native events")]
    if name != "rk4-dichotomy":
        return [({}, "")]
    published: Any = integrator_class(name)

    def eps_v(steps: float) -> float:
        return published.eps_v * (published.steps_per_period / steps) ** 2

    # In the published form a sticking body creeps, and the zero-velocity zone does not shrink with the step.
    refined = {"stick_velocity": "zero", "eps_v": eps_v}
    return [({}, ""), (refined, f"{name}, refined")]
