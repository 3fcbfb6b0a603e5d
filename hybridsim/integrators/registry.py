"""This module registers integrators: built-in integrators, and integrators of plug-ins with an entry point."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import fields
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any, get_type_hints

from hybridsim.errors import UsageError, near, nearest
from hybridsim.integrators.contract import Integrator
from hybridsim.integrators.options import LARGEST, fits, kind_description

ENTRY_POINT = "hybridsim.integrators"
_OURS = (
    "runge_kutta.dop853:Dop853",
    "runge_kutta.tsit5:Tsit5",
    "rosenbrock.rodas5p:Rodas5P",
    "closed_form.method:Exact",
    "taylor.method:Taylor",
    "scipy.solvers:ScipyDOP853",
    "scipy.solvers:ScipyRK45",
    "scipy.solvers:ScipyRK23",
    "scipy.solvers:ScipyRadau",
    "scipy.solvers:ScipyBDF",
    "scipy.solvers:ScipyLSODA",
    "sundials.cvode:CvodeAdams",
    "sundials.cvode:CvodeBDF",
    "fixed_step.published:Rk4Dichotomy",
    "fixed_step.published:Rk4Sign",
    "fixed_step.moreau:Moreau",
)


@cache
def _registered() -> dict[str, type[Integrator]]:
    found: dict[str, type[Integrator]] = {}
    for place in _OURS:
        module, name = place.split(":")
        integrator = getattr(import_module(f"hybridsim.integrators.{module}"), name)
        found[integrator.name] = integrator
    for entry in entry_points(group=ENTRY_POINT):
        integrator = entry.load()
        if not (isinstance(integrator, type) and issubclass(integrator, Integrator)):
            raise UsageError(
                f"the entry point {entry.name} = {entry.value} does not name an Integrator class",
                remedy=f"make {entry.value} a subclass of hybridsim.integrators.contract.Integrator",
            )
        if integrator.name in found and found[integrator.name] is not integrator:
            raise UsageError(
                f"{entry.value} has the name {integrator.name!r}, which another integrator already has",
                remedy="choose another name",
            )
        found[integrator.name] = integrator
    return found


def list_integrators() -> tuple[type[Integrator], ...]:
    """Return all integrators that can be selected by name; built-in integrators come first.

    Returns
    -------
    tuple of type
        The integrator classes, with attributes such as ``name``, ``title``, ``order`` and ``lacks``.

    Examples
    --------
    >>> import hybridsim as hs
    >>> [integrator.name for integrator in hs.list_integrators()][:5]
    ['dop853', 'tsit5', 'rodas5p', 'exact', 'taylor']
    """
    return tuple(_registered().values())


def integrator_class(name: str) -> type[Integrator]:
    """Return the integrator class with a given name."""
    found = _registered()
    if name not in found:
        remedy = nearest(name, found, kind="integrators")
        raise UsageError(
            f"there is no integrator {name!r}",
            remedy=f"{remedy} (`hybridsim integrators` and hs.list_integrators() list all integrators)",
        )
    return found[name]


@contextmanager
def registered(method: str | type[Integrator]) -> Iterator[str]:
    """Make an integrator class available by its name within a `with` block, even if it is not registered."""
    if isinstance(method, str):
        yield integrator_class(method).name
        return
    found = _registered()
    before = found.get(method.name)
    if before is not None and before is not method:
        raise UsageError(
            f"{method.__name__} has the name {method.name!r}, which {before.__name__} already has",
            remedy="choose another name",
        )
    found[method.name] = method
    try:
        yield method.name
    finally:
        if before is None:
            del found[method.name]


@cache
def option_names(cls: type[Any]) -> tuple[str, ...]:
    """Return the options of an integrator: the fields of its dataclass."""
    return tuple(f.name for f in fields(cls))


_START = (
    "pass initial values as x0=..., by name ({'x': 1.0}) or in the order in which the states are declared"
)
_PARAMETERS = "pass values of parameters as params={...}"
_SPAN = "pass both ends of the run as t_span=(t0, t1)"
_STEP = "use max_step=... to limit the step, or step=... with integrator='moreau' or 'rk4-dichotomy'"
# Keywords of SciPy's solve_ivp and of other tools, with their counterparts here.
_ELSEWHERE = {
    "y0": _START,
    "u0": _START,
    "method": "choose the method with integrator=..., such as 'scipy-rk45'",
    "solver": "choose the method with integrator=..., such as 'scipy-rk45'",
    "events": "declare monitors in the model, hs.Monitor(name, expression); zeros of guards are always found",
    "args": _PARAMETERS,
    "p": _PARAMETERS,
    "dense_output": "omit dense_output: every solution is a function of time, sol(t)",
    "vectorized": "omit vectorized: the model is compiled",
    "jac": "omit jac: derivatives are computed from the model's expressions",
    "t0": _SPAN,
    "t1": _SPAN,
    "tspan": _SPAN,
    "t_end": _SPAN,
    "dt": _STEP,
    "h": _STEP,
}


def keyword_elsewhere(keyword: str) -> str | None:
    """Return the remedy for a keyword of another tool: the name of the equivalent argument of `simulate`."""
    return _ELSEWHERE.get(keyword)


class UnknownOption(UsageError):
    """The error for an option that the chosen integrator does not have."""

    option = integrator = ""


def make_integrator(name: str, options: dict[str, Any], keywords: Iterable[str] = ()) -> Integrator:
    """Return the integrator with a given name and options."""
    cls = integrator_class(name)
    known = option_names(cls)
    for option in options:
        if option not in known:
            remedy = nearest(option, known, kind=f"options of {name}") if known else f"{name} has no options"
            close = near(option, (*known, *keywords))
            remedy = nearest(option, close) if close else remedy
            what = f"simulate() has no argument {option!r}, and {name} has no option {option!r}"
            what = what if keywords else f"{name} has no option {option!r}"
            fault = UnknownOption(what, remedy=keyword_elsewhere(option) or remedy)
            fault.option, fault.integrator = option, name
            raise fault
    kinds = get_type_hints(cls) if options else {}
    for option, value in options.items():
        if not fits(value, kinds[option]):
            is_large = isinstance(value, int) and value > LARGEST and fits(1, kinds[option])
            remedy = f"use {kind_description(kinds[option])}" + (f", at most {LARGEST}" if is_large else "")
            raise UsageError(f"{name}: `{option}` cannot be {value!r}", remedy=remedy)
    return cls(**options)
