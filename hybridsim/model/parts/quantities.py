"""This module defines parameters, states, discrete states and outputs of a model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from hybridsim.expr import Expression
from hybridsim.model.parts.declared import Declared
from hybridsim.model.parts.frozen_map import FrozenMap


@dataclass(frozen=True)
class Parameter(Declared):
    """A constant of a run: a number, or an expression of other parameters such as ``0.6*sqrt(k/m)``.

    Parameters
    ----------
    name : str
        Name of the parameter in expressions.
    value : str or float
        Number, or expression of other parameters.
    unit : str, optional
        Unit, for labels and the check of units.
    title : str, optional
        Description.
    place : Place, optional
        Place of the declaration, for error messages.

    Examples
    --------
    >>> import hybridsim as hs
    >>> ratio = [hs.Parameter("k", 4, unit="N/m"), hs.Parameter("w", "sqrt(k)", unit="rad/s")]
    >>> hs.Model("m", states=[hs.State("x", 1, "-w*x")], parameters=ratio).parameter_values()
    {'k': 4.0, 'w': 2.0}
    """

    name: str
    value: Expression
    unit: str = ""
    title: str = ""

    def __post_init__(self) -> None:
        self._texts("name", "unit", "title")
        self._expressions("value")

    def with_value(self, value: Expression) -> Parameter:
        """Return a copy with another value."""
        copy: Parameter = object.__new__(Parameter)
        vars(copy).update(vars(self), value=value)
        return copy


@dataclass(frozen=True)
class State(Declared):
    """A continuous state with x' = der and x(t0) = start.

    Parameters
    ----------
    name : str
        Name of the state in expressions.
    start : str or float
        Initial value, an expression of parameters.
    der : str or float
        Rate, an expression of any names of the model. A mode may replace it in its ``der``. It is 0 if the rates of
        the model are a Python function.
    unit : str, optional
        Unit, for labels and the check of units; it does not affect computations.
    nominal : float, optional
        Typical size in this unit, which sets the default of the absolute tolerance. The default is ``|x0|`` or 1.
    title : str, optional
        What it is, for labels of axes, such as "displacement".
    place : Place, optional
        Place of the declaration, for error messages.

    Examples
    --------
    >>> import hybridsim as hs
    >>> fall = [hs.State("h", 10, der="v", unit="m"), hs.State("v", 0, der="-9.81", unit="m/s")]
    >>> hs.Model("fall", states=fall).start_values()
    {'h': 10.0, 'v': 0.0}
    """

    name: str
    start: Expression
    der: Expression
    unit: str = ""
    nominal: float | None = None
    title: str = ""

    def __post_init__(self) -> None:
        self._texts("name", "unit", "title")
        self._expressions("start", "der")
        if self.nominal is not None:
            object.__setattr__(self, "nominal", self._real("nominal", self.nominal))


@dataclass(frozen=True)
class Discrete(Declared):
    """A state that changes only by resets.

    Parameters
    ----------
    name : str
        Name of the state.
    start : str or float
        Initial value, an expression of parameters.
    unit : str, optional
        Unit, for labels and the check of units.
    title : str, optional
        What it is, for labels of axes, such as "displacement".
    place : Place, optional
        Place of the declaration, for error messages.

    Examples
    --------
    >>> import hybridsim as hs
    >>> bounces = hs.Discrete("bounces", 0)
    >>> hs.Model("m", states=[hs.State("x", 1, "-x")], discrete=[bounces]).discrete_values()
    {'bounces': 0.0}
    """

    name: str
    start: Expression
    unit: str = ""
    title: str = ""

    def __post_init__(self) -> None:
        self._texts("name", "unit", "title")
        self._expressions("start")


@dataclass(frozen=True)
class Output(Declared):
    """A named expression for results; it does not affect the run.

    Parameters
    ----------
    name : str
        Name of the output in `Solution.output`.
    expr : str or float
        Expression of states, inputs, parameters, definitions and t.
    unit : str, optional
        Unit, for labels and the check of units.
    modes : mapping of str to str or float, optional
        Expressions that replace ``expr`` in a mode, by ``"component.mode"``; if several apply, the last one is used.
    title : str, optional
        What it is, for labels of axes, such as "displacement".
    place : Place, optional
        Place of the declaration, for error messages.

    Examples
    --------
    >>> import hybridsim as hs
    >>> energy = hs.Output("E", "v**2/2", unit="J/kg")
    >>> energy.expr
    Expression(text='v**2/2')
    """

    name: str
    expr: Expression
    unit: str = ""
    modes: Mapping[str, Expression] = field(default_factory=FrozenMap)
    title: str = ""

    def __post_init__(self) -> None:
        self._texts("name", "unit", "title")
        self._expressions("expr", functions=True)
        self._maps("modes")
