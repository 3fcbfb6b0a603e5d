"""The named numbers of a model: parameters, states, discrete states and outputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from numbers import Real

from hybridsim.expr import Expression
from hybridsim.model.declared import Declared
from hybridsim.model.frozen_map import FrozenMap


@dataclass(frozen=True)
class Parameter(Declared):
    """A constant of a run: a number, or an expression of other parameters such as ``0.6*sqrt(k/m)``."""

    name: str
    value: Expression
    unit: str = ""
    title: str = ""

    def __post_init__(self) -> None:
        self._texts("name")
        self._expressions("value")


@dataclass(frozen=True)
class State(Declared):
    """A continuous state: x' = der, x(t0) = start.

    Parameters
    ----------
    start : initial value, an expression of parameters.
    der : its rate over everything the model names; a mode may override it in its own ``der``. 0 where the model's
        rates are a Python function.
    unit : for people; never computed with.
    nominal : typical size in that unit, from which the absolute tolerance follows; None takes it from the
        run.
    """

    name: str
    start: Expression
    der: Expression
    unit: str = ""
    nominal: float | None = None

    def __post_init__(self) -> None:
        self._texts("name")
        self._expressions("start", "der")
        nominal: object = self.nominal
        if not (nominal is None or isinstance(nominal, Real)):
            raise self._fault(f"nominal is {self.nominal!r}", "give a number, or leave it out")


@dataclass(frozen=True)
class Discrete(Declared):
    """A state that only resets and clock ticks change."""

    name: str
    start: Expression
    unit: str = ""

    def __post_init__(self) -> None:
        self._texts("name")
        self._expressions("start")


@dataclass(frozen=True)
class Output(Declared):
    """A named expression to look at; it changes nothing.

    ``modes`` maps ``"component.mode"`` to the expression that replaces ``expr`` in that mode; where several
    apply the last one counts.
    """

    name: str
    expr: Expression
    unit: str = ""
    modes: Mapping[str, Expression] = field(default_factory=FrozenMap)

    def __post_init__(self) -> None:
        self._texts("name")
        self._expressions("expr", functions=True)
        self._maps("modes")
