"""This module defines frictional contacts, which expand to automata and states."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike

from hybridsim.errors import ModelError, nearest
from hybridsim.expr import Expression, parse, substitute
from hybridsim.expr.evaluate import dependency_order
from hybridsim.model.laws.law import LOAD_RATE, NORMAL, SPEED, FrictionLaw
from hybridsim.model.laws.law_with_states import components_of, states_of
from hybridsim.model.parts.component import Choice, Component, Guard, LoadAutomaton, Mode, Surface
from hybridsim.model.parts.declared import Declared
from hybridsim.model.parts.frozen_map import FrozenMap
from hybridsim.model.parts.quantities import State

_ZERO = parse(0)


@dataclass(frozen=True)
class Contact(Declared):
    """Dry friction between two bodies; its name is the friction force, which opposes the relative velocity.

    A positive force opposes a positive relative velocity: a body that slides with v has ``- f`` in its
    equation of motion.

    Parameters
    ----------
    name : str
        Name of the friction force, which other expressions use.
    velocity : str or float
        Relative velocity, an expression of states, inputs, parameters and t.
    normal : str or float
        Normal load, >= 0. A guard ends the run if a varying load becomes negative.
    law : FrictionLaw, str or path
        A `FrictionLaw`, the name of a packaged law, or the path of a file with a law.
    arguments : mapping of str to str or float, optional
        Values of the law's parameters, numbers or expressions of the model's names. Missing ones have the defaults of
        the law.
    opens : bool, optional
        If True, the contact lifts off when the load would become negative, and has no force until the load is
        positive again. A contact f then has an automaton ``f_N`` with the modes ``closed`` and ``open``; ``f_N`` is
        also the name of the load.
    start, nominal : mapping of str to float, optional
        Start values and nominal sizes of the law's states, by their names in the law; they replace those of the law.
    place : Place, optional
        Place of the declaration, for error messages.

    Examples
    --------
    >>> Contact("f", velocity="v", normal="N", law="coulomb", arguments={"mu": 0.5}).component().modes[0].set
    {'f': Expression(text='0.5*N')}
    >>> [s.name for s in Contact("f", "v", "N", "dahl", {"mu": 0.5, "sigma": 1e4}).states()]
    ['f_z']
    """

    name: str
    velocity: Expression
    normal: Expression
    law: FrictionLaw
    arguments: Mapping[str, Expression] = field(default_factory=FrozenMap)
    opens: bool = False
    start: Mapping[str, Expression] = field(default_factory=FrozenMap)
    nominal: Mapping[str, float] = field(default_factory=FrozenMap)

    def __post_init__(self) -> None:
        self._texts("name")
        self._expressions("velocity", "normal")
        self._maps("arguments", "start")
        self._flags("opens")
        self._sizes("nominal")
        law: object = self.law
        if isinstance(law, str | PathLike):
            from hybridsim.model.library import load_law

            object.__setattr__(self, "law", load_law(law))
        elif not isinstance(law, FrictionLaw):
            raise self._fault(f"`law` cannot be {law!r}", "use hs.FrictionLaw(...), or the name of a law")

    def component(self, constants: Collection[str] = ()) -> Component:
        """Return the automaton with the contact's name; for a set-valued law it has three modes.

        ::

            slip+ : velocity >= 0,  f = +slip(v = velocity)
            slip- : velocity <= 0,  f = -slip_backward(v = -velocity)
            stick : velocity = 0,   -stick_backward <= f <= stick,  f from d(velocity)/dt = 0

        Parameters
        ----------
        constants : collection of str, optional
            Constant names (the parameters of the model). A normal load with any other name has a guard in every mode.

        Raises
        ------
        ModelError
            For an unknown or a missing argument of the law.
        """
        return next(part for part in self.components(constants) if part.name == self.name)

    def components(
        self, constants: Collection[str] = (), load_rate: Callable[[], Expression] | None = None
    ) -> tuple[Component, ...]:
        """Return all automata of the contact: its own, and the automata of copies, lift-off and tables.

        Parameters
        ----------
        load_rate : returns the rate of a varying load, for laws that use it.
        """
        varies = self._varies(constants)
        if varies not in self._expanded:
            self._expanded[varies] = tuple(self._components(varies, load_rate))
        return self._expanded[varies]

    def states(
        self, constants: Collection[str] = (), load_rate: Callable[[], Expression] | None = None
    ) -> tuple[State, ...]:
        """Return the states that the friction law adds to the model."""
        return states_of(self, self.values(self._varies(constants), load_rate)) if self.law.states else ()

    def _varies(self, constants: Collection[str]) -> bool:
        return bool(self.normal.names - set(constants))

    @cached_property
    def _expanded(self) -> dict[bool, tuple[Component, ...]]:
        """Cache of `components`, shared by copies of a model with other values."""
        return {}

    def _components(self, varies: bool, load_rate: Callable[[], Expression] | None) -> Iterator[Component]:
        values = self.values(varies, load_rate)
        loaded: tuple[Guard, ...] = ()
        if varies and not self.opens:
            message = (
                f"normal load of contact {self.name} became negative: {self.normal.text} < 0; if the contact can lift "
                "off, set `opens = true`, otherwise correct the sign of the load"
            )
            loaded = (Guard("normal", self.normal, fatal=message, place=self.place),)
        if self.law.is_set_valued:
            yield self._set_valued(loaded)
        else:
            yield from components_of(self, values, loaded)
        if self.opens:
            yield self._lifting(values)
        for table in self.law.tables:
            names = {**values, SPEED: self._argument_speed()}
            argument = substitute(table.over, names)
            across = None if table.across is None else substitute(table.across, names)
            from_zero = table.over.text == SPEED and self.law.is_set_valued
            yield from table.bound(values).components(self.variable(table.name), argument, across, from_zero)

    def variable(self, name: str) -> str:
        """Return the name that a state, table or load of the friction law has in the model."""
        return f"{self.name}_{name}"

    @property
    def table_variables(self) -> tuple[str, ...]:
        """The names of the variables that contain the values of the law's tables."""
        return tuple(self.variable(table.name) for table in self.law.tables)

    @property
    def table_speed(self) -> str | None:
        """The name of the variable with which tables of the speed are read, or None if there is no such table."""
        asked = any(SPEED in names for table in self.law.tables for names in table.arguments())
        return self.variable(SPEED) if asked and self.law.is_set_valued else None

    def _argument_speed(self) -> Expression:
        """Return the argument of tables: the speed for a set-valued law, otherwise the velocity."""
        return parse(self.variable(SPEED)) if self.law.is_set_valued else self.velocity

    def _lifting(self, values: Mapping[str, Expression]) -> Component:
        """Return the lift-off automaton, whose two modes set the load to its expression or to zero."""
        name, place = self.variable(NORMAL), self.place
        away = Guard("load", self.normal, (Choice("open"),), place=place)
        back = Guard("load", self._form("-load", load=self.normal), (Choice("closed"),), place=place)
        closed, opened = {name: self.normal}, {name: parse(0)}
        if LOAD_RATE in values:
            closed[self.variable(LOAD_RATE)] = values[LOAD_RATE]
            opened[self.variable(LOAD_RATE)] = parse(0)
        modes = (Mode("closed", (away,), set=closed), Mode("open", (back,), set=opened))
        return LoadAutomaton(name, modes, initial="closed", place=place)

    def _set_valued(self, loaded: tuple[Guard, ...]) -> Component:
        force = parse(self.name, self.place)
        backward = self._form("-v", v=self.velocity)
        forward_slip = self.slip_force(self.velocity)
        backward_slip = self._form("-f", f=self.slip_force(backward, backward=True))
        at_rest, backward_at_rest = self.onset_force(), self.onset_force(backward=True)
        limit, backward_limit = self.limit_force(), self.limit_force(backward=True)
        upper = self._form("limit - f", limit=limit, f=force)
        lower = self._form("limit + f", limit=backward_limit, f=force)
        forward_set, backward_set, stick_set = {self.name: forward_slip}, {self.name: backward_slip}, {}
        speed = self.table_speed
        if speed is not None:
            forward_set[speed], backward_set[speed], stick_set[speed] = self.velocity, backward, parse(0)
        modes = (
            Mode("slip+", (Guard("velocity", self.velocity), *loaded), set=forward_set),
            Mode("slip-", (Guard("velocity", backward), *loaded), set=backward_set),
            Mode("stick", (Guard("upper", upper), Guard("lower", lower), *loaded), set=stick_set),
        )
        surface = Surface(
            function=self.velocity,
            unknown=self.name,
            above="slip+",
            below="slip-",
            hold="stick",
            jump_above=self._form("limit - slip", limit=limit, slip=at_rest),
            jump_below=self._form("slip - limit", limit=backward_limit, slip=backward_at_rest),
        )
        return Component(self.name, modes, surface=surface, place=self.place)

    def onset_force(self, backward: bool = False) -> Expression:
        """Return the magnitude of the force at the onset of slip, as an expression in names of the model."""
        slip = (self.law.slip_backward if backward else None) or self.law.slip
        return self._at_rest(f"onset{backward}", slip, {SPEED: _ZERO})

    def slip_force(self, speed: Expression, *, backward: bool = False) -> Expression:
        """Return the magnitude of the slip force at a speed >= 0, as an expression in names of the model."""
        slip = (self.law.slip_backward if backward else None) or self.law.slip
        assert slip is not None  # always set in a set-valued law
        return substitute(self._form("slip", slip=slip), {SPEED: speed, **self.values()})

    def slip_force_at(self, speed: float, backward: bool = False) -> Expression:
        """Return the magnitude of the slip force at a numeric speed; the force is computed once."""
        slip = (self.law.slip_backward if backward else None) or self.law.slip
        assert slip is not None  # always set in a set-valued law
        key = f"slip {speed} {backward}"
        if key not in self._forces:
            names = {SPEED: parse(speed), **self.values()} | self._tables_at(speed, self.values())
            self._forces[key] = substitute(self._form("slip", slip=slip), names)
        return self._forces[key]

    def _tables_at(self, speed: float, values: Mapping[str, Expression]) -> dict[str, Expression]:
        """Return the value of each table of the speed at a numeric speed."""
        tables = [table.bound(values) for table in self.law.tables if table.over.text == SPEED]
        return {table.name: table.expression_at(speed, self.variable(table.name)) for table in tables}

    def limit_force(self, backward: bool = False) -> Expression:
        """Return the largest force in stick, as an expression in names of the model."""
        stick = (self.law.stick_backward if backward else None) or self.law.stick
        return self._at_rest(f"limit{backward}", stick, {})

    def _at_rest(self, which: str, force: Expression | None, names: dict[str, Expression]) -> Expression:
        """Return a force of a set-valued law at zero speed; the force is computed once."""
        assert force is not None
        if which not in self._forces:
            names |= self.values()
            names |= self._tables_at(0.0, names)
            self._forces[which] = substitute(self._form("force", force=force), names)
        return self._forces[which]

    @cached_property
    def _forces(self) -> dict[str, Expression]:
        return {}

    def _form(self, template: str, **parts: Expression) -> Expression:
        """Fill a template with expressions; errors in the result point to the line of the contact."""
        return substitute(parse(template, self.velocity.place or self.place), parts)

    def values(
        self, varies: bool = True, load_rate: Callable[[], Expression] | None = None
    ) -> dict[str, Expression]:
        """Return the expression for each name of the law, except for the speed and the law's states."""
        law = self.law
        for name, value in self.arguments.items():
            if name not in law.parameters:
                remedy = nearest(name, law.parameters, kind="parameters of the law")
                if any(name in expr.names for _, expr in law.expressions()):
                    remedy = f"add '{name}' to the `parameters` of the law"
                raise ModelError(
                    f"contact {self.name}: the law '{law.name}' has no parameter '{name}'",
                    place=value.place or self.place,
                    remedy=remedy,
                )
        own = {**law.parameters, **self.arguments}
        missing = [name for name, value in own.items() if value is None]
        if missing:
            raise self.error(
                f"contact {self.name}: the law '{law.name}' needs a value for '{missing[0]}'",
                f"add {missing[0]} = ... to the law of the contact, or a default to the law",
            )
        defaults = {
            name: value for name, value in law.parameters.items() if name not in self.arguments and value
        }
        values: dict[str, Expression] = dict(self.arguments)
        for name in dependency_order(defaults, f"defaults of the law '{law.name}'"):
            values[name] = substitute(defaults[name], values)
        values |= {table.name: parse(self.variable(table.name)) for table in law.tables}
        if load_rate is not None and any(LOAD_RATE in e.names for _, e in law.expressions()):
            values[LOAD_RATE] = load_rate() if varies else parse(0)
        load = parse(self.variable(NORMAL), self.normal.place) if self.opens else self.normal
        return {NORMAL: load, **values}
