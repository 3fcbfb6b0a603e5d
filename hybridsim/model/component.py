"""A small automaton: modes with flows, guards that stay >= 0 while they last, choices of what comes next."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from hybridsim.expr import Expression
from hybridsim.model.declared import Declared, as_tuple
from hybridsim.model.frozen_map import FrozenMap


@dataclass(frozen=True)
class Choice(Declared):
    """One way on from a guard: to mode ``to`` if ``when`` holds, after ``reset``; both taken at x-.

    Parameters
    ----------
    to : str
        Name of the mode that follows.
    when : str or float, optional
        Condition, an expression; None always holds.
    reset : mapping of str to str or float, optional
        State or discrete state to the expression that gives its new value, or to ``"+= amount"``, which adds:
        amounts of one instant are summed in any order.
    place : Place, optional
        Where it is written, for the messages of errors.

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
    """A scalar that must stay >= 0 while its mode lasts.

    Parameters
    ----------
    name : str
        What the guard is called in events.
    expr : str or float
        The scalar, smooth in its mode.
    then : str, Choice or sequence of these, optional
        Choices in order, the first whose condition holds is taken; a text is the mode to go to. Empty where a
        surface decides.
    fatal : str, optional
        A message instead of choices: the run ends with status ``inconsistent`` where the guard would go
        negative.
    place : Place, optional
        Where it is written, for the messages of errors.

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

    def __post_init__(self) -> None:
        self._texts("name", "fatal")
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
    """A flow and its domain: ``der`` replaces rates of states, ``set`` gives the component's variables.

    Parameters
    ----------
    name : str
        What the mode is called in its component.
    guards : sequence of Guard, optional
        What must stay >= 0 while it lasts.
    der : mapping of str to str or float, optional
        State to the rate that replaces its own.
    set : mapping of str to str or float, optional
        Variable to its expression in this mode.
    flow : callable, optional
        Function (t, x, p) that replaces all rates in a model whose rates are a Python function (see `Model`).
    place : Place, optional
        Where it is written, for the messages of errors.

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
    """A scalar s(t, x) with a mode on either side and one that holds s = 0.

    Parameters
    ----------
    function : str or float
        S.
    unknown : str
        The variable that holds it, solved for from ds/dt = 0, in which it must be linear.
    above, below, hold : str
        Mode for s > 0, for s < 0, and on s = 0. Without one below, s cannot become negative: where it comes
        to zero there is an impact, and ``hold`` keeps s and ds/dt at zero, solved for from d2s/dt2 = 0.
    jump_above, jump_below : str or float
        Value of ``unknown`` at the limit of holding minus its value in ``above`` at s = 0+ (in ``below`` at s
        = 0-). Identically zero where nothing jumps at a release (mu_s = mu_k).
    unique : bool, optional
        The motion must be the only admissible one. Otherwise what holds comes first, as static friction does,
        and the unknown has to oppose s; without a mode below it has to push s up.
    restitution : str or float, optional
        Of impacts, where there is no mode below; over the model's names and ``speed``, that of approach.
    place : Place, optional
        Where it is written, for the messages of errors.

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
                f"below is {self.below!r} and restitution {self.restitution!r}",
                "a surface has a mode below, or a restitution of its impacts",
            )

    @property
    def is_unilateral(self) -> bool:
        """Whether its function cannot become negative."""
        return self.below is None

    @property
    def modes(self) -> tuple[str, ...]:
        """The modes that it decides between."""
        return (self.above, self.hold) if self.below is None else (self.above, self.below, self.hold)


@dataclass(frozen=True)
class Component(Declared):
    """An automaton of its own: one of its modes is active at any time.

    Parameters
    ----------
    name : str
        What the component is called; its modes are named ``name.mode``.
    modes : sequence of Mode
        The modes, of which there is at least one.
    initial : str, optional
        Mode at t0; None where a surface decides it from x0. With a single mode it is that one.
    surface : Surface, optional
        Given, the guards have no choices: the decisions go by admissibility.
    limit : str or Choice, optional
        Where to go, after which reset, where infinitely many of its transitions follow each other in a finite time: a
        ball that bounces ever lower, a hose between two tanks that run dry. The time is that to which their
        intervals add up. Without it the run ends there with status ``accumulation``.
    place : Place, optional
        Where it is written, for the messages of errors.

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
        given: object = self.initial
        if isinstance(given, Mode):  # where the name of the first mode goes
            remedy = "give several modes as a list, [hs.Mode(...), hs.Mode(...)]"
            raise self._fault(f"initial is the mode {given.name!r}", remedy)
        self._texts("name", "initial")
        self._parts("modes", Mode)
        limit: object = self.limit
        if isinstance(limit, str):
            object.__setattr__(self, "limit", Choice(limit, place=self.place))
        elif not (limit is None or isinstance(limit, Choice)):
            raise self._fault(f"limit is {limit!r}", "give the name of a mode, or hs.Choice(...)")
        if not (self.surface is None or isinstance(self.surface, Surface)):
            raise self._fault(f"surface is {self.surface!r}", "give hs.Surface(...)")
        if self.initial is None and self.surface is None and len(self.modes) == 1:
            object.__setattr__(self, "initial", self.modes[0].name)

    @property
    def variables(self) -> tuple[str, ...]:
        """The names that its modes set, in order of appearance, the surface's unknown first."""
        unknown = [self.surface.unknown] if self.surface else []
        return tuple(dict.fromkeys(unknown + [name for mode in self.modes for name in mode.set]))

    def mode(self, name: str) -> Mode:
        """The mode of that name; KeyError if there is none."""
        for mode in self.modes:
            if mode.name == name:
                return mode
        raise KeyError(name)


@dataclass(frozen=True)
class Corner(Component):
    """A component that the program makes of a corner such as ``abs(v)``; its two modes, ``+`` and ``-``, agree at zero.

    Or of a jump in time alone, such as ``sign(t - 1)``. It is decided as any other. A run keeps it apart from what the
    model declares (`hybridsim.model.smoothing`).
    """


@dataclass(frozen=True)
class LoadAutomaton(Component):
    """The automaton of the load of a contact that opens: its mode is that of the load's sign."""
