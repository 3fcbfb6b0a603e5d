"""This module defines hybrid automata: components with modes, guards, choices and surfaces."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from hybridsim.expr import Expression, parse
from hybridsim.model.parts.declared import Declared, as_tuple
from hybridsim.model.parts.frozen_map import FrozenMap

DIRECTIONS = ("up", "down", "both")


@dataclass(frozen=True)
class Choice(Declared):
    """A transition of a guard to the mode ``to`` if ``when`` is true; ``reset`` sets the new state.

    Parameters
    ----------
    to : str
        Name of the next mode.
    when : str or float, optional
        Condition, an expression; None is always true.
    reset : mapping of str to str or float, optional
        New value of each changed state or discrete state, as an expression, or ``"+= amount"``. Amounts added at
        the same instant are summed.
    place : Place, optional
        Place of the declaration, for error messages.

    Examples
    --------
    >>> import hybridsim as hs
    >>> hs.Choice("fall", reset={"v": "-e*v"}).reset
    {'v': Expression(text='-e*v')}
    """

    to: str
    when: Expression | None = None
    reset: Mapping[str, Expression] = field(default_factory=FrozenMap)

    def __post_init__(self) -> None:
        self._texts("to")
        self._expressions("when", functions=True)
        self._maps("reset", functions=True)


@dataclass(frozen=True)
class Guard(Declared):
    """A scalar function that stays >= 0 while its mode is active.

    Parameters
    ----------
    name : str
        Name of the guard in events.
    expr : str or float
        The scalar, smooth in its mode.
    then : str, Choice or sequence of these, optional
        Choices in order of priority; the first one with a true condition is used. A string is the name of the
        next mode. Empty if the component has a surface.
    fatal : str, optional
        A message instead of choices: the run ends with status ``inconsistent`` when the guard would become
        negative.
    direction : str, optional
        "up" (from below zero), "down" (from above) or "both": the guard fires only at such a crossing of zero, and its
        expression may have any sign when the mode begins. A jump of the state across zero is a crossing. By default
        the guard fires as soon as its expression is negative.
    place : Place, optional
        Place of the declaration, for error messages.

    Examples
    --------
    >>> import hybridsim as hs
    >>> hs.Guard("warm", "high - T", "off").then[0].to
    'off'
    """

    name: str
    expr: Expression
    then: tuple[Choice, ...] = ()
    fatal: str | None = None
    direction: str | None = None

    def __post_init__(self) -> None:
        self._texts("name", "fatal")
        self._texts("direction", known=DIRECTIONS)
        self._expressions("expr", functions=True)
        choices = tuple(
            Choice(choice, place=self.place) if isinstance(choice, str) else choice
            for choice in as_tuple(self.then)
        )
        object.__setattr__(self, "then", choices)
        self._parts("then", Choice)
        object.__setattr__(self, "fatal", self.fatal or None)


@dataclass(frozen=True)
class Mode(Declared):
    """A mode of a component: ``der`` replaces rates of states, ``set`` defines the component's variables.

    Parameters
    ----------
    name : str
        Name of the mode in its component.
    guards : sequence of Guard, optional
        Guards, which stay >= 0 while the mode lasts.
    der : mapping of str to str or float, optional
        Rates that replace those of the states, by state.
    set : mapping of str to str or float, optional
        Expressions of the component's variables in this mode.
    flow : callable, optional
        Function (t, x, p) that replaces all rates in a model whose rates are a Python function (see `Model`).
    place : Place, optional
        Place of the declaration, for error messages.

    Examples
    --------
    >>> import hybridsim as hs
    >>> hs.Mode("on", guards=[hs.Guard("warm", "high - T", "off")], set={"heat": "P"}).set
    {'heat': Expression(text='P')}
    """

    name: str
    guards: tuple[Guard, ...] = ()
    der: Mapping[str, Expression] = field(default_factory=FrozenMap)
    set: Mapping[str, Expression] = field(default_factory=FrozenMap)
    flow: Callable[..., Any] | None = None

    def __post_init__(self) -> None:
        self._texts("name")
        self._parts("guards", Guard)
        self._maps("der", "set")
        self._functions("flow")


@dataclass(frozen=True)
class Surface(Declared):
    """A surface s(t, x) = 0 with a mode on each side and a mode that holds s = 0.

    Parameters
    ----------
    function : str or float
        The function s(t, x).
    unknown : str
        The variable that holds s = 0. It is computed from ds/dt = 0, in which it must be linear.
    above, below, hold : str
        Modes for s > 0, s < 0 and s = 0. Without a mode below, s cannot become negative: there is an impact when
        it reaches zero, and in ``hold`` the unknown is computed from d2s/dt2 = 0.
    jump_above, jump_below : str or float
        Value of ``unknown`` at the limit of ``hold`` minus its value in ``above`` at s = 0+ (in ``below`` at s =
        0-). Identically zero if the force does not jump at release (mu_s = mu_k).
    unique : bool, optional
        If True, the run continues only if exactly one motion is admissible. If False, ``hold`` has priority, as in
        static friction, and the unknown must oppose s; without a mode below it must push s up.
    restitution : str or float, optional
        Coefficient of restitution, only without a mode below; it may use the names of the model and ``speed``, the
        approach speed.
    place : Place, optional
        Place of the declaration, for error messages.

    Examples
    --------
    >>> import hybridsim as hs
    >>> friction = hs.Contact("f", "v", "N", "coulomb", {"mu": 0.5}).component().surface
    >>> friction.unknown, friction.above, friction.below, friction.hold
    ('f', 'slip+', 'slip-', 'stick')
    """

    function: Expression
    unknown: str
    above: str
    below: str | None
    hold: str
    jump_above: Expression
    jump_below: Expression
    unique: bool = False
    restitution: Expression | None = None

    def __post_init__(self) -> None:
        self._texts("unknown", "above", "hold")
        if self.below is not None:
            self._texts("below")
        self._expressions("function", "jump_above", "jump_below", "restitution")
        if (self.below is None) == (self.restitution is None):
            raise self._fault(
                f"`below` is {self.below!r} and `restitution` is {self.restitution!r}, but exactly one is needed",
                "set either `below` or `restitution`",
            )

    @property
    def is_unilateral(self) -> bool:
        """Whether the function cannot become negative."""
        return self.below is None

    @property
    def modes(self) -> tuple[str, ...]:
        """The modes from which the surface selects."""
        return (self.above, self.hold) if self.below is None else (self.above, self.below, self.hold)


@dataclass(frozen=True)
class Component(Declared):
    """A hybrid automaton; exactly one of its modes is active at any time.

    Parameters
    ----------
    name : str
        Name of the component; its modes are named ``name.mode``.
    modes : sequence of Mode
        The modes, at least one.
    initial : str, optional
        Mode at t0. None is allowed with a single mode, and with a surface, which selects the mode from x0.
    surface : Surface, optional
        Surface that selects the next mode by admissibility; the guards then have no choices.
    limit : str or Choice, optional
        Next mode, with an optional reset, at a point where infinitely many transitions accumulate in finite time (a
        Zeno point), such as a ball that comes to rest by bouncing. The time is the sum of the intervals. Without a
        limit the run ends there with status ``accumulation``.
    place : Place, optional
        Place of the declaration, for error messages.

    Examples
    --------
    >>> import hybridsim as hs
    >>> off = hs.Mode("off", guards=[hs.Guard("cold", "T - low", "on")], set={"heat": 0})
    >>> on = hs.Mode("on", guards=[hs.Guard("warm", "high - T", "off")], set={"heat": "P"})
    >>> hs.Component("thermostat", [off, on], initial="on").variables
    ('heat',)
    """

    name: str
    modes: tuple[Mode, ...]
    initial: str | None = None
    surface: Surface | None = None
    limit: Choice | None = None

    def __post_init__(self) -> None:
        initial_mode: object = self.initial
        if isinstance(initial_mode, Mode):  # a second mode passed instead of a list
            remedy = "pass several modes as a list, [hs.Mode(...), hs.Mode(...)]"
            raise self._fault(f"`initial` cannot be the mode object {initial_mode.name!r}", remedy)
        self._texts("name", "initial")
        self._parts("modes", Mode)
        limit: object = self.limit
        if isinstance(limit, str):
            object.__setattr__(self, "limit", Choice(limit, place=self.place))
        elif not (limit is None or isinstance(limit, Choice)):
            raise self._fault(f"`limit` cannot be {limit!r}", "use the name of a mode, or hs.Choice(...)")
        if not (self.surface is None or isinstance(self.surface, Surface)):
            raise self._fault(f"`surface` cannot be {self.surface!r}", "use hs.Surface(...)")
        if self.initial is None and self.surface is None and len(self.modes) == 1:
            object.__setattr__(self, "initial", self.modes[0].name)

    @property
    def variables(self) -> tuple[str, ...]:
        """The variables that the modes set; the unknown of the surface comes first."""
        unknown = [self.surface.unknown] if self.surface else []
        return tuple(dict.fromkeys(unknown + [name for mode in self.modes for name in mode.set]))

    def mode(self, name: str) -> Mode:
        """Return the mode with a given name, or raise KeyError."""
        for mode in self.modes:
            if mode.name == name:
                return mode
        raise KeyError(name)


@dataclass(frozen=True)
class Corner(Component):
    """A component made for a corner such as ``abs(v)``; its two modes, ``+`` and ``-``, agree at zero.

    A jump that depends on time alone, such as ``sign(t - 1)``, is treated likewise. Its mode is selected as that of any
    other component, but results list it separately from the declared components
    (`hybridsim.model.smoothing.explicit_corners`).
    """


@dataclass(frozen=True)
class WholeNumber(Corner):
    """A corner made for ``floor(u)``: one mode, with the guards u < k + 1 and u >= k of the discrete state k.

    Parameters
    ----------
    number : name of the discrete state k, which jumps.
    argument : the expression u.
    """

    number: str = field(default="", kw_only=True)
    argument: Expression = field(default=parse(0), kw_only=True)


@dataclass(frozen=True)
class MonitorCorner(Corner):
    """A corner that replaces a monitor, so that compiled loops can run the model."""


@dataclass(frozen=True)
class LoadAutomaton(Component):
    """The automaton of a contact that can lift off; its mode follows the sign of the load."""
