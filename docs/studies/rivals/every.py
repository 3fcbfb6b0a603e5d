"""All methods of the study: hybridsim's, and of its rivals those that are installed."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec

from rivals import (
    closed_form_four_states,
    closed_form_two_states,
    ours,
    published_rk4,
    scipy_restart,
    sundials_adams,
)
from rivals.method import Method


def _heyoka() -> list[Method]:
    from rivals import heyoka_taylor

    tight, loose = heyoka_taylor.method(1e-11, shown=False), heyoka_taylor.method(1e-10, shown=False)
    return [heyoka_taylor.method(1e-12), tight, loose]


def _diffrax() -> list[Method]:
    from rivals import diffrax_tsit5

    return [diffrax_tsit5.method(1e-6)]


def _casadi() -> list[Method]:
    from rivals import casadi_erk

    return [casadi_erk.method(1e-9)]


def _pathsim() -> list[Method]:
    from rivals import pathsim_rkck54

    return [pathsim_rkck54.method(1e-6)]


# Library, and what it is good for.
_OPTIONAL: tuple[tuple[str, Callable[[], list[Method]]], ...] = (
    ("heyoka", _heyoka),
    ("diffrax", _diffrax),
    ("casadi", _casadi),
    ("pathsim", _pathsim),
)


def methods() -> tuple[list[Method], list[str]]:
    """The methods, and the libraries that are not installed."""
    found = [
        closed_form_two_states.method(),
        closed_form_four_states.method(),
        ours.method("exact"),
        ours.method("exact", label="exact, with objects", shown=False, objects=True),
        ours.method("taylor", 1e-12),
        ours.method("taylor", 1e-10, shown=False),
        ours.method("taylor", 1e-11, shown=False),
        ours.method("taylor", 1e-13, shown=False),
        ours.method("dop853", 1e-9),
        ours.method("tsit5", 1e-6),
        ours.method("auto"),
        scipy_restart.method(1e-9),
        scipy_restart.method(1e-7, shown=False),
        scipy_restart.method(1e-11, shown=False),
        sundials_adams.method(1e-9),
        published_rk4.dichotomy(),
        published_rk4.tanh(),
    ]
    lacking = []
    for library, make in _OPTIONAL:
        if find_spec(library):
            found += make()
        else:
            lacking.append(library)
    return found, lacking
