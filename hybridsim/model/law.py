"""A friction law: the force as a function of velocity, load and, where it remembers, of states of its own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from hybridsim.expr import Expression
from hybridsim.model.component import Mode
from hybridsim.model.declared import Declared, as_tuple
from hybridsim.model.frozen_map import FrozenMap
from hybridsim.model.law_table import LawTable
from hybridsim.model.quantities import State

SPEED = "v"
NORMAL = "N"
LOAD_RATE = "dN"
INDEX = "i"
FORCE = "force"


@dataclass(frozen=True)
class FrictionLaw(Declared):
    """The friction force as a declaration, in one of two forms.

    Set-valued, with a mode of its own for rest; v >= 0 is the magnitude of the relative velocity::

        slip :  |f| = slip(v, N),   forward and backward alike unless ``slip_backward`` is given
        stick:  -stick_backward(N) <= f <= stick(N)

    Single-valued, with states of its own or none; v is the relative velocity with its sign::

        f = force(v, N, z),   z' = der(v, N, z)

    Parameters
    ----------
    name : str
        What the law is called.
    slip, stick : str or float, optional
        Expressions of ``v`` (slip alone), ``N`` (normal load) and the law's own parameters.
    parameters : mapping of str to str, float or None, or sequence of str, optional
        Name to default (a number or an expression of the others); a default of None, or a plain sequence of
        names, makes them arguments that every contact has to give.
    title, source : str, optional
        What it is, and where it comes from.
    slip_backward, stick_backward : str or float, optional
        Where they differ from the forward ones; both are magnitudes.
    force : str or float, optional
        Expression of ``v``, ``N``, ``dN`` (rate of the load), parameters, states and definitions.
    states : sequence of State, optional
        `State` objects; in a contact f the state z is called ``f_z``.
    definitions : mapping of str to str or float, optional
        Named parts of the other expressions.
    modes : sequence of Mode, optional
        With ``initial``, an automaton of the law: modes with guards, rates ``der`` of the states and, with
        ``set``, a ``force`` of their own.
    initial : str, optional
        The mode at t0.
    copies : str, optional
        Parameter that says how many copies of the law act in parallel, each with its own states and modes;
        the force is the sum, the index of a copy is ``i`` = 1, 2, ...
    tables : sequence of LawTable, optional
        Named functions of one argument, given by points.
    place : Place, optional
        Where it is written, for the messages of errors.

    Examples
    --------
    >>> FrictionLaw("coulomb", slip="mu*N", stick="mu*N", parameters=["mu"]).parameters
    {'mu': None}
    >>> z = State("z", 0, "v - k/(mu*N)*abs(v)*z")
    >>> FrictionLaw("dahl", parameters=["mu", "k"], states=[z], force="k*z").is_set_valued
    False
    """

    name: str
    # None where the law gives a force, and nowhere else; most readers have to do with set-valued laws alone
    slip: Expression = None  # type: ignore[assignment]  # None in a law with memory alone, which nobody asks for it
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

    def __post_init__(self) -> None:
        self._texts("name", "initial", "copies")
        self._expressions("slip", "stick", "slip_backward", "stick_backward", "force")
        given: object = self.parameters
        if not isinstance(given, Mapping):
            names = as_tuple(given)
            if not all(isinstance(name, str) for name in names):
                raise self._fault(
                    f"parameters is {given!r}", "give names, or a mapping from names to defaults"
                )
            object.__setattr__(self, "parameters", dict.fromkeys(names))
        self._maps("parameters", "definitions")
        self._parts("states", State)
        self._parts("modes", Mode)
        self._parts("tables", LawTable)
        if self.initial is None and len(self.modes) == 1:
            object.__setattr__(self, "initial", self.modes[0].name)
        given_forms = [name for name in ("slip", "stick") if getattr(self, name) is not None]
        if self.force is None and len(given_forms) < 2:
            raise self._fault(
                "it gives neither slip and stick nor a force",
                "give slip and stick (magnitudes), or force (with its sign)",
            )
        if self.force is not None and given_forms:
            raise self._fault("it gives both slip or stick and a force", "give slip and stick, or force")

    @property
    def is_set_valued(self) -> bool:
        """Whether rest is a mode with a range of forces, to be solved for."""
        return self.force is None

    def expressions(self) -> Iterator[tuple[str, Expression]]:
        """Every expression of the law with the words for where it stands, defaults of parameters left out."""
        for name in ("slip", "stick", "slip_backward", "stick_backward", "force"):
            if (value := getattr(self, name)) is not None:
                yield name, value
        for name, value in self.definitions.items():
            yield f"definition {name}", value
        for table in self.tables:
            yield f"table {table.name}, over", table.over
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
