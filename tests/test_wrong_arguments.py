"""Every argument of every public call, with a value of each wrong kind: it is taken, or refused by name."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import cache
from inspect import Parameter, signature
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.errors import HybridsimError

# Words would start long runs, or mean themselves what another test looks at.
_NOT_TRIED = {"progress", "model", "settle", "max_periods", "executor", "reference", "integrators", "budget"}


def wrong_values() -> Iterator[tuple[str, Any]]:
    """Values of kinds that hardly any argument takes."""
    yield "None", None
    yield "a text", "abc"
    yield "NaN", math.nan
    yield "infinity", math.inf
    yield "beyond all doubles", 10**400
    yield "complex", 1j
    yield "a matrix", np.ones((2, 3))
    yield "an iterator", iter([1.0, 2.0])
    yield "an object", object()
    yield "an unknown name", {"q": 1}
    yield "None in a list", [None]
    yield "bytes", b"x"
    yield "ragged", [[1], [1, 2]]
    yield "no list items", []
    yield "an array without dimensions", np.array(3.0)
    yield "complex numbers", np.array([1j, 2])


@cache
def tiny() -> hs.Model:
    """One forced state."""
    return hs.Model(
        "tiny", states=[hs.State("x", 1, "-a*x + b*sin(w*t)")], parameters={"a": 1.0, "b": 1.0, "w": 2.0}
    )


@cache
def sliding() -> hs.Solution:
    """A run with a contact, whose methods are called."""
    return hs.simulate("dfcs", (0, 0.05), integrator="taylor")


@cache
def mechanical() -> hs.MechanicalSystem:
    """One mass with one contact."""
    contact = hs.MechanicalContact("f", [1.0], 1.0, "coulomb", {"mu": 0.3})
    return hs.MechanicalSystem([1.0], None, [1.0], contacts=[contact], q0=[1.0])


CALLS: dict[str, tuple[Callable[[], Callable[..., Any]], Callable[[], dict[str, Any]]]] = {
    "State": (lambda: hs.State, lambda: {"name": "x", "start": 1, "der": "-x"}),
    "Parameter": (lambda: hs.Parameter, lambda: {"name": "p", "value": 1.0}),
    "Output": (lambda: hs.Output, lambda: {"name": "o", "expr": "x"}),
    "Discrete": (lambda: hs.Discrete, lambda: {"name": "d", "start": 1}),
    "Monitor": (lambda: hs.Monitor, lambda: {"name": "m", "expr": "x"}),
    "Schedule": (lambda: hs.Schedule, lambda: {"name": "m", "times": [1.0]}),
    "Guard": (lambda: hs.Guard, lambda: {"name": "g", "expr": "x", "then": hs.Choice("a")}),
    "Choice": (lambda: hs.Choice, lambda: {"to": "m"}),
    "Mode": (lambda: hs.Mode, lambda: {"name": "m"}),
    "Component": (lambda: hs.Component, lambda: {"name": "c", "modes": [hs.Mode("a")]}),
    "SwitchingSurface": (lambda: hs.SwitchingSurface, lambda: {"name": "s", "expr": "x"}),
    "Contact": (
        lambda: hs.Contact,
        lambda: {"name": "f", "velocity": "v", "normal": 1, "law": "coulomb", "arguments": {"mu": 1}},
    ),
    "FrictionLaw": (lambda: hs.FrictionLaw, lambda: {"name": "l", "slip": "N", "stick": "N"}),
    "LawTable": (lambda: hs.LawTable, lambda: {"name": "mu", "at": [0, 1], "values": [1, 2]}),
    "Impact": (lambda: hs.Impact, lambda: {"name": "i", "gap": "x", "restitution": 0.5}),
    "Input": (lambda: hs.Input, lambda: {"name": "u", "kind": "table", "times": [0, 1], "values": [0, 1]}),
    "Harmonic": (lambda: hs.Harmonic, lambda: {"omega": 1.0}),
    "MechanicalContact": (
        lambda: hs.MechanicalContact,
        lambda: {"name": "f", "direction": [1.0], "normal": 1.0, "law": "coulomb", "arguments": {"mu": 1}},
    ),
    "MechanicalImpact": (
        lambda: hs.MechanicalImpact,
        lambda: {"name": "p", "direction": [1.0], "gap": 1.0, "restitution": 0.5},
    ),
    "MechanicalSystem": (lambda: hs.MechanicalSystem, lambda: {"M": [1.0], "C": None, "K": [1.0]}),
    "simulate": (lambda: hs.simulate, lambda: {"model": tiny(), "t_span": (0, 0.1), "integrator": "taylor"}),
    "simulate a mechanical system": (
        lambda: hs.simulate,
        lambda: {"model": mechanical(), "t_span": (0, 0.1)},
    ),
    "to_ivp": (lambda: hs.to_ivp, lambda: {"model": hs.load("dfcs"), "z": {"f": "slip+"}}),
    "linearize": (lambda: hs.linearize, lambda: {"model": hs.Model("l", states=[hs.State("x", 1, "-x")])}),
    "sensitivities": (lambda: hs.sensitivities, lambda: {"solution": sliding()}),
    "steady_state": (lambda: hs.steady_state, lambda: {"model": tiny(), "integrator": "taylor"}),
    "sweep": (
        lambda: hs.sweep,
        lambda: {"model": tiny(), "values": {"b": [1.0]}, "measure": "amplitude.x", "after": 1},
    ),
    "frequency_response": (
        lambda: hs.frequency_response,
        lambda: {"model": tiny(), "frequencies": [1.0], "frequency": "w"},
    ),
    "bifurcation": (
        lambda: hs.bifurcation,
        lambda: {"model": tiny(), "parameter": "b", "values": [1.0], "settle": 1, "samples": 1},
    ),
    "continuation": (
        lambda: hs.continuation,
        lambda: {"model": tiny(), "parameter": "b", "bounds": (1.0, 1.01), "max_points": 2},
    ),
    "load": (lambda: hs.load, dict),
    "load_law": (lambda: hs.load_law, dict),
    "load_solution": (lambda: hs.load_solution, dict),
    "chain_on_belt": (lambda: hs.chain_on_belt, lambda: {"n": 2}),
    "two_blocks_on_belt": (lambda: hs.two_blocks_on_belt, dict),
    "three_coupled_blocks": (lambda: hs.three_coupled_blocks, dict),
    "Solution()": (lambda: sliding().__call__, lambda: {"t": 0.01}),
    "Solution.output": (lambda: sliding().output, lambda: {"name": "x"}),
    "Solution.event_times": (lambda: sliding().event_times, lambda: {"component": "f"}),
    "Solution.event_states": (lambda: sliding().event_states, lambda: {"component": "f"}),
    "Solution.explain": (lambda: sliding().explain, lambda: {"number": 0}),
    "Solution.table": (lambda: sliding().table, dict),
    "Solution.resume": (lambda: sliding().resume, dict),
}


@pytest.mark.parametrize("call", CALLS)
def test_a_value_of_a_wrong_kind_is_taken_or_refused_by_name(
    call: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # a text may be taken for the name of a file that is to be written
    function, good = (make() for make in CALLS[call])
    for argument in signature(function).parameters.values():
        if argument.kind in (Parameter.VAR_POSITIONAL, Parameter.VAR_KEYWORD) or argument.name in _NOT_TRIED:
            continue
        for kind, value in wrong_values():
            if value is None and argument.default is None:
                continue
            try:
                function(**{**good, argument.name: value})
            except HybridsimError as refused:
                assert str(refused)
            except Exception as fault:
                pytest.fail(f"{call}({argument.name} = {kind}): {type(fault).__name__}: {fault}")
