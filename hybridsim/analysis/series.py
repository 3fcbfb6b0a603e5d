"""Which runs make up a comparison: a line for each integrator, a run for each setting on it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from hybridsim.errors import UsageError
from hybridsim.integrators import integrator_class, list_integrators

RTOLS = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
STEPS_PER_PERIOD = (300, 600, 1200, 2400, 4800)


@dataclass(frozen=True)
class Series:
    """One line of a comparison.

    Parameters
    ----------
    integrator : a registered name.
    varied : name of the option that is varied, such as "rtol" or "steps_per_period".
    values : its values.
    options : further options; a function of the value where they go with it.
    label : name in the table and the chart; the integrator's and the options if not given.
    """

    integrator: str
    varied: str
    values: tuple[float, ...]
    options: Mapping[str, Any] = field(default_factory=dict)
    label: str = ""

    def __post_init__(self) -> None:
        if not self.values:
            raise UsageError(f"no values of {self.varied} for {self.integrator}", remedy="give at least one")
        if not self.label:
            details = ", ".join(f"{name}={_shown(value)}" for name, value in self.options.items())
            object.__setattr__(
                self, "label", f"{self.integrator} ({details})" if details else self.integrator
            )

    def options_at(self, value: float) -> dict[str, Any]:
        """Options of the run with the varied one at a value."""
        others = {name: item(value) if callable(item) else item for name, item in self.options.items()}
        return {self.varied: value, **others}


def _shown(value: Any) -> str:
    if callable(value):
        return "varied"
    return f"{value:g}" if isinstance(value, float) else str(value)


def choose_series(
    wanted: Sequence[str | tuple[str, Mapping[str, Any]] | Series] | None,
    rtols: Sequence[float] | None,
    steps: Sequence[int] | None,
) -> tuple[Series, ...]:
    """The lines of a comparison.

    Parameters
    ----------
    wanted : names, (name, options) or `Series`; all registered integrators if not given.
    rtols : tolerances of the integrators that adapt their step.
    steps : steps a period of those that do not.
    """
    if isinstance(wanted, str):
        wanted = [wanted]
    chosen: list[Series] = []
    for item in default_choice() if wanted is None else wanted:
        if isinstance(item, Series):
            chosen.append(item)
            continue
        name, options = (item, {}) if isinstance(item, str) else item
        if "adaptive" in integrator_class(name).lacks:
            values = tuple(STEPS_PER_PERIOD if steps is None else steps)
            chosen.append(Series(name, "steps_per_period", values, options))
        else:
            chosen.append(Series(name, "rtol", tuple(RTOLS if rtols is None else rtols), options))
    if not chosen:
        raise UsageError("no integrators to compare", remedy="name some, see hybridsim.list_integrators()")
    repeated = [series.label for series in chosen if [s.label for s in chosen].count(series.label) > 1]
    if repeated:
        raise UsageError(f"two lines are called {repeated[0]!r}", remedy="give one of them another label")
    return tuple(chosen)


def default_choice() -> list[str | tuple[str, Mapping[str, Any]] | Series]:
    """Every registered integrator."""
    return [integrator.name for integrator in list_integrators()]
