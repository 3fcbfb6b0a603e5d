"""This module defines friction laws: the force as a function of velocity, load and internal states."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from hybridsim.errors import nearest
from hybridsim.expr import Expression
from hybridsim.model.laws.law_table import LawTable
from hybridsim.model.parts.component import Mode
from hybridsim.model.parts.declared import Declared, as_tuple
from hybridsim.model.parts.frozen_map import FrozenMap
from hybridsim.model.parts.quantities import State

SPEED = "v"
NORMAL = "N"
LOAD_RATE = "dN"
INDEX = "i"
FORCE = "force"


@dataclass(frozen=True)
class FrictionLaw(Declared):
    """A friction law, which is either set-valued or single-valued.

    A set-valued law has a stick mode; v >= 0 is the magnitude of the relative velocity::

        slip :  |f| = slip(v, N),   the same in both directions unless ``slip_backward`` is set
        stick:  -stick_backward(N) <= f <= stick(N)

    A single-valued law may have states z; v is the signed relative velocity::

        f = force(v, N, z),   z' = der(v, N, z)

    Parameters
    ----------
    name : str
        Name of the law.
    slip, stick : str or float, optional
        Expressions of ``v`` (only in slip), ``N`` (normal load) and the parameters of the law.
    parameters : mapping of str to str, float or None, or sequence of str, optional
        Default of each parameter, a number or an expression of other parameters. Without a default (None, or a plain
        sequence of names) every contact must set the parameter.
    title, source : str, optional
        Description and reference.
    slip_backward, stick_backward : str or float, optional
        Magnitudes in backward direction, if they differ from the forward ones.
    force : str or float, optional
        Expression of ``v``, ``N``, ``dN`` (rate of the load), parameters, states and definitions.
    states : sequence of State, optional
        `State` objects; in a contact f the state z is named ``f_z``.
    definitions : mapping of str to str or float, optional
        Named expressions that the other expressions use.
    modes : sequence of Mode, optional
        Modes of the law, with guards, rates ``der`` of the states and, in ``set``, the ``force``.
    initial : str, optional
        The mode at t0.
    copies : str, optional
        Parameter with the number of copies of the law that act in parallel. Each copy has its own states and modes
        and its index ``i`` = 1, 2, ...; the force is the sum.
    tables : sequence of LawTable, optional
        Named functions of one argument, defined by points.
    units : mapping of str to str, optional
        Units of parameters and of values of tables, by name, for the check of units.
    place : Place, optional
        Place of the declaration, for error messages.

    Examples
    --------
    >>> FrictionLaw("coulomb", slip="mu*N", stick="mu*N", parameters=["mu"]).parameters
    {'mu': None}
    >>> z = State("z", 0, "v - k/(mu*N)*abs(v)*z")
    >>> FrictionLaw("dahl", parameters=["mu", "k"], states=[z], force="k*z").is_set_valued
    False
    """

    name: str
    # both are None in a single-valued law and set in a set-valued law
    slip: Expression = None  # type: ignore[assignment]  # only read in set-valued laws
    stick: Expression = None  # type: ignore[assignment]  # likewise
    parameters: Mapping[str, Expression | None] = field(default_factory=FrozenMap)
    title: str = ""
    source: str = ""
    slip_backward: Expression | None = None
    stick_backward: Expression | None = None
    force: Expression | None = None
    states: tuple[State, ...] = ()
    definitions: Mapping[str, Expression] = field(default_factory=FrozenMap)
    modes: tuple[Mode, ...] = ()
    initial: str | None = None
    copies: str | None = None
    tables: tuple[LawTable, ...] = ()
    units: Mapping[str, str] = field(default_factory=FrozenMap)

    def __post_init__(self) -> None:
        self._texts("name", "initial", "copies")
        self._expressions("slip", "stick", "slip_backward", "stick_backward", "force")
        parameters: object = self.parameters
        if not isinstance(parameters, Mapping):
            names = as_tuple(parameters)
            if not all(isinstance(name, str) for name in names):
                raise self._fault(
                    f"`parameters` cannot be {parameters!r}",
                    "use a list of names, or a dict of names and defaults",
                )
            object.__setattr__(self, "parameters", dict.fromkeys(names))
        self._maps("parameters", "definitions")
        self._parts("states", State)
        self._parts("modes", Mode)
        self._parts("tables", LawTable)
        self._units()
        if self.initial is None and len(self.modes) == 1:
            object.__setattr__(self, "initial", self.modes[0].name)
        forms = [name for name in ("slip", "stick") if getattr(self, name) is not None]
        if self.force is None and len(forms) < 2:
            raise self._fault(
                "the law needs either both `slip` and `stick`, or `force`",
                "set `slip` and `stick` (magnitudes), or `force` (with its sign)",
            )
        if self.force is not None and forms:
            raise self._fault(
                "the law has `force` together with `slip` or `stick`",
                "set either both `slip` and `stick`, or `force`",
            )

    def _units(self) -> None:
        """Check that the units are texts, each of a parameter or a table."""
        units: object = self.units
        texts = units.items() if isinstance(units, Mapping) else [(None, None)]
        if not all(isinstance(name, str) and isinstance(text, str) for name, text in texts):
            raise self._fault(f"`units` cannot be {units!r}", 'use a dict such as {"v_s": "m/s"}')
        known = [*self.parameters, *(table.name for table in self.tables)]
        for name in self.units:
            if name not in known:
                remedy = nearest(name, known, kind="parameters and tables of the law")
                raise self._fault(f"`units` contains {name!r}", remedy)
        object.__setattr__(self, "units", FrozenMap({name: u for name, u in self.units.items() if u}))

    @property
    def is_set_valued(self) -> bool:
        """Whether the law has a stick mode with a range of forces."""
        return self.force is None

    def expressions(self) -> Iterator[tuple[str, Expression]]:
        """Yield every expression of the law, except defaults, with a description of its place."""
        for name in ("slip", "stick", "slip_backward", "stick_backward", "force"):
            if (value := getattr(self, name)) is not None:
                yield name, value
        for name, value in self.definitions.items():
            yield f"definition {name}", value
        for table in self.tables:
            yield f"table {table.name}, over", table.over
            if table.across is not None:
                yield f"table {table.name}, across", table.across
            for value in table.expressions():
                yield f"table {table.name}, values", value
        for state in self.states:
            yield f"state {state.name}, start", state.start
            yield f"state {state.name}, der", state.der
        for mode in self.modes:
            for name, value in (*mode.der.items(), *mode.set.items()):
                yield f"mode {mode.name}, {name}", value
            for guard in mode.guards:
                yield f"mode {mode.name}, guard {guard.name}", guard.expr
                for choice in guard.then:
                    if choice.when is not None:
                        yield f"mode {mode.name}, guard {guard.name}, when", choice.when
                    for name, value in choice.reset.items():
                        yield f"mode {mode.name}, guard {guard.name}, reset of {name}", value
