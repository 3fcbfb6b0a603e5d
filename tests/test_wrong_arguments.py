"""Every argument of every public call, with a value of each wrong kind: it is taken, or refused by name.

The calls are those of `hybridsim.__all__`: a new one, or a new method of a result, fails until it is listed here.
"""

from __future__ import annotations

import inspect
import math
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from inspect import Parameter, signature
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.errors import HybridsimError

_SECONDS = 60.0  # of a processor for one call; those here take a second, compiling apart

# Other words by which an argument may be called in the message.
_ALSO = {
    "params": ("parameter",),
    "x0": ("state",),
    "z0": ("component",),
    "journal": ("path",),
    "levels": ("to sweep over", "value of", "values of"),
    "frequency": ("to sweep over",),
    "quantity": ("measure",),
    "regularized": ("regularis",),
    "kind": ("regularis",),
    "name": ("quantity", "law"),
    "path": ("cannot be read", "states"),
    "data": ("the file",),
    "held_out": ("data", "the file", "record"),
    "records": ("data", "the file", "column", "record"),
    "unknowns": ("unknown", "bound"),
    "starts": ("first guess",),
    "text": ("TOML",),
    "number": ("event",),
    "v0": ("unknown name",),
    "uncertain": ("range",),
    "rtols": ("rtol",),
    "values": ("to sweep over", "value of"),
    "frequencies": ("value of", "values of"),
    "name_or_path": ("model", "path"),
}
# Made by calls and not by users; errors.
_RESULTS = {
    *("Event", "Explanation", "SavedState", "Solution", "SteadyState", "Sweep", "LawComparison", "LawFits"),
    *(
        "Comparison",
        "SuiteComparison",
        "Advice",
        "Branch",
        "Equilibrium",
        "Linearization",
        "LyapunovExponents",
        "Sensitivities",
        "Fit",
    ),
    *(
        "HybridsimError",
        "ExpressionError",
        "ModelError",
        "SimulationError",
        "UsageError",
        "Place",
        "__version__",
    ),
}
# Of declarations only these methods are for users.
_METHODS = {
    "LawTable": {"fit"},
    "Model": {"from_toml", "regularized"},
    "Simulator": {"run", "start", "advance", "set", "output", "restore"},
}
_NOT_CALLED = {"Place.at", "Place.inside"}


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
def started() -> hs.Simulator:
    """A simulator that has started."""
    sim = hs.Simulator(tiny(), integrator="taylor")
    sim.start(0.0)
    return sim


def sliding() -> hs.Solution:
    """A run with a contact, whose methods are called."""
    return hs.simulate("dfcs", (0, 0.05), integrator="taylor")


def integrated(t_span: Any = None) -> float:
    """The integral of a quantity over part of a run."""
    return sliding().integral("x", t_span=t_span)


@cache
def settled() -> hs.SteadyState:
    """A steady motion, whose methods are called."""
    return hs.steady_state("dfcs", integrator="exact")


@cache
def swept() -> hs.Sweep:
    """A sweep, whose methods are called."""
    return hs.sweep(tiny(), {"b": [1.0, 2.0]}, "amplitude.x", after=1)


@cache
def compared() -> hs.Comparison:
    """A comparison, whose methods are called."""
    return hs.compare(tiny(), (0, 0.1), integrators=["taylor"], rtols=[1e-6], repeat=1)


@cache
def fitted() -> hs.Fit:
    """A fit of one start value to three samples."""
    return hs.fit(tiny(), {"t": [0, 1, 2], "x": [1, 2, 3]}, {"x(0)": (0, 2)})


@cache
def suite() -> hs.SuiteComparison:
    """A comparison of scenes, whose methods are called."""
    return hs.compare_suite(
        scenes=["bouncing-ball"], integrators=["taylor"], rtols=[1e-6], steps=[300], repeat=1
    )


@cache
def advised() -> hs.Advice:
    """Advice, whose methods are called."""
    return hs.advise("dfcs", "amplitude.x", rungs=["no-friction"], integrators=False)


@cache
def branch() -> hs.Branch:
    """A branch, whose methods are called."""
    return hs.continuation(tiny(), "b", (1.0, 1.01), max_points=2)


@cache
def moved() -> hs.Solution:
    """A run of a mechanical system, whose methods are called."""
    return hs.simulate(mechanical(), (0, 0.1))


@cache
def stepped() -> hs.Solution:
    """The same by time stepping."""
    return hs.simulate(mechanical(), (0, 0.1), integrator="moreau", step=0.01)


@cache
def mechanical() -> hs.MechanicalSystem:
    """One mass with one contact."""
    contact = hs.MechanicalContact("f", [1.0], 1.0, "coulomb", {"mu": 0.3})
    return hs.MechanicalSystem([1.0], None, [1.0], contacts=[contact], q0=[1.0])


def forced() -> hs.MechanicalSystem:
    """A mechanical system with a harmonic force."""
    return mechanical().with_(C=[0.5], forcing=[hs.Harmonic(1.0, sin=1.0)])


CALLS: dict[str, tuple[Callable[[], Callable[..., Any]], Callable[[], dict[str, Any]]]] = {
    "State": (lambda: hs.State, lambda: {"name": "x", "start": 1, "der": "-x"}),
    "Parameter": (lambda: hs.Parameter, lambda: {"name": "p", "value": 1.0}),
    "Output": (lambda: hs.Output, lambda: {"name": "o", "expr": "x"}),
    "Discrete": (lambda: hs.Discrete, lambda: {"name": "d", "start": 1}),
    "Monitor": (lambda: hs.Monitor, lambda: {"name": "m", "expr": "x"}),
    "Schedule": (lambda: hs.Schedule, lambda: {"name": "m", "times": [1.0]}),
    "Shape": (lambda: hs.Shape, lambda: {"name": "s", "kind": "mass", "at": ("x", 0)}),
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
    "Use": (
        lambda: hs.Use,
        lambda: {"name": "part", "model": hs.load("belt"), "start": {"x": 1}, "repeat": 2},
    ),
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
    "Simulator": (lambda: hs.Simulator, lambda: {"model": tiny(), "integrator": "taylor"}),
    "Simulator.run": (lambda: hs.Simulator(tiny(), integrator="taylor").run, lambda: {"t_span": (0, 0.1)}),
    "Simulator.start": (lambda: hs.Simulator(tiny(), integrator="taylor").start, lambda: {"t0": 0.0}),
    "Simulator.advance": (lambda: started().advance, lambda: {"to": 0.1}),
    "Simulator.set": (lambda: started().set, lambda: {"inputs": {}}),
    "Simulator.output": (lambda: started().output, lambda: {"name": "x"}),
    "Simulator.restore": (lambda: started().restore, lambda: {"saved": started().save()}),
    "simulate a mechanical system": (
        lambda: hs.simulate,
        lambda: {"model": mechanical(), "t_span": (0, 0.1)},
    ),
    "Model": (lambda: hs.Model, lambda: {"name": "m", "states": [hs.State("x", 1, "-x")]}),
    "Surface": (
        lambda: hs.Surface,
        lambda: dict.fromkeys(
            ("function", "unknown", "above", "below", "hold", "jump_above", "jump_below"), "x"
        ),
    ),
    "advise": (
        lambda: hs.advise,
        lambda: {
            "model": "dfcs",
            "quantity": "maximum.x",
            "t_span": (0, 0.01),
            "rungs": ["no-friction"],
            "integrators": False,
            "budget": 1e4,
        },
    ),
    "compare_laws": (
        lambda: hs.compare_laws,
        lambda: {"model": "dfcs", "laws": ["coulomb"], "t_span": (0, 0.01)},
    ),
    "compare": (
        lambda: hs.compare,
        lambda: {
            "model": tiny(),
            "t_span": (0, 0.1),
            "integrators": ["taylor"],
            "rtols": [1e-6],
            "repeat": 1,
            "budget": 1e4,
        },
    ),
    "compare_suite": (
        lambda: hs.compare_suite,
        lambda: {
            "scenes": ["bouncing-ball"],
            "integrators": ["taylor"],
            "rtols": [1e-6],
            "steps": [300],
            "repeat": 1,
            "budget": 1e4,
        },
    ),
    "equilibria": (lambda: hs.equilibria, lambda: {"model": "belt"}),
    "list_models": (lambda: hs.list_models, dict),
    "list_integrators": (lambda: hs.list_integrators, dict),
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
    "steady_state of a structure": (lambda: hs.steady_state, lambda: {"model": forced()}),
    "sweep of a structure": (
        lambda: hs.sweep,
        lambda: {"model": forced(), "values": {"omega": [1.0]}, "measure": "amplitude.q1"},
    ),
    "frequency_response of a structure": (
        lambda: hs.frequency_response,
        lambda: {"model": forced(), "frequencies": [1.0]},
    ),
    "lyapunov_exponents": (lambda: hs.lyapunov_exponents, lambda: {"model": tiny(), "duration": 1.0}),
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
    "Solution.resume": (lambda: sliding().resume, lambda: {"t_end": 0.06}),
    "Solution.save": (lambda: sliding().save, lambda: {"path": "s.hsol"}),
    "Solution.animate": (
        lambda: sliding().animate,
        lambda: {"path": "s.gif", "quantities": [], "speed": 0.1, "fps": 1},
    ),
    "Solution.plot": (lambda: sliding().plot, lambda: {"t_span": (0.0, 0.01)}),
    "Solution.integral": (lambda: integrated, lambda: {"t_span": (0.0, 0.01)}),
    "Solution.stored_energy": (lambda: moved().stored_energy, lambda: {"t": 0.1}),
    "Solution.report": (lambda: sliding().report, lambda: {"path": "s.html"}),
    "Solution.to_csv": (lambda: sliding().to_csv, lambda: {"path": "s.csv"}),
    "Solution.to_npz": (lambda: sliding().to_npz, lambda: {"path": "s.npz"}),
    "Solution.to_pandas": (lambda: sliding().to_pandas, dict),
    "Solution.to_xarray": (lambda: sliding().to_xarray, dict),
    "Solution.output by series": (lambda: moved().output, lambda: {"name": moved().names[0]}),
    "Solution.event_times by series": (lambda: moved().event_times, lambda: {"component": "f"}),
    "Solution.table by series": (lambda: moved().table, dict),
    "Solution.to_csv by series": (lambda: moved().to_csv, lambda: {"path": "m.csv"}),
    "Solution.to_npz by series": (lambda: moved().to_npz, lambda: {"path": "m.npz"}),
    "Solution.to_pandas by series": (lambda: moved().to_pandas, dict),
    "Solution.to_xarray by series": (lambda: moved().to_xarray, dict),
    "Solution.output by time stepping": (lambda: stepped().output, lambda: {"name": stepped().names[0]}),
    "Solution.event_times by time stepping": (lambda: stepped().event_times, lambda: {"component": "f"}),
    "Solution.table by time stepping": (lambda: stepped().table, dict),
    "Solution.to_csv by time stepping": (lambda: stepped().to_csv, lambda: {"path": "t.csv"}),
    "Solution.to_npz by time stepping": (lambda: stepped().to_npz, lambda: {"path": "t.npz"}),
    "Solution.to_pandas by time stepping": (lambda: stepped().to_pandas, dict),
    "Solution.to_xarray by time stepping": (lambda: stepped().to_xarray, dict),
    "SteadyState.harmonic": (lambda: settled().harmonic, lambda: {"name": "x"}),
    "SteadyState.held_mode": (lambda: settled().held_mode, lambda: {"contact": "f"}),
    "SteadyState.plot": (lambda: settled().plot, dict),
    "SteadyState.to_dict": (lambda: settled().to_dict, dict),
    "Sweep.plot": (lambda: swept().plot, dict),
    "Sweep.to_csv": (lambda: swept().to_csv, lambda: {"path": "w.csv"}),
    "Sweep.to_json": (lambda: swept().to_json, dict),
    "Comparison.floor": (lambda: compared().floor, lambda: {"quantity": "state"}),
    "Comparison.reading": (
        lambda: compared().reading,
        lambda: {"row": compared().rows[0], "quantity": "state"},
    ),
    "Comparison.scaled": (
        lambda: compared().scaled,
        lambda: {"errors": compared().rows[0].errors, "quantity": "state"},
    ),
    "Comparison.to_csv": (lambda: compared().to_csv, lambda: {"path": "c.csv"}),
    "Comparison.to_json": (lambda: compared().to_json, dict),
    "SuiteComparison.cheapest": (lambda: suite().cheapest, dict),
    "SuiteComparison.to_csv": (lambda: suite().to_csv, lambda: {"path": "u.csv"}),
    "SuiteComparison.to_json": (lambda: suite().to_json, dict),
    "Element": (
        lambda: hs.Element,
        lambda: {"name": "e", "kind": "saturation", "input": "x", "lower": -1, "upper": 1},
    ),
    "Unknown": (lambda: hs.Unknown, lambda: {"low": 0.1, "high": 1.0}),
    "Record": (lambda: hs.Record, lambda: {"data": {"t": [0, 1, 2], "x": [1, 2, 3]}}),
    "fit": (
        lambda: hs.fit,
        lambda: {"model": tiny(), "records": {"t": [0, 1, 2], "x": [1, 2, 3]}, "unknowns": {"x(0)": (0, 2)}},
    ),
    "fit_laws": (
        lambda: hs.fit_laws,
        lambda: {
            "model": "free-decay",
            "records": {"t": [0, 0.1, 0.2, 0.3], "x": [1, 1, 1, 1]},
            "laws": [("coulomb", {"mu": (0.1, 0.2)})],
        },
    ),
    "Fit.interval": (lambda: fitted().interval, lambda: {"name": "x(0)"}),
    "Fit.solution": (lambda: fitted().solution, dict),
    "Advice.to_json": (lambda: advised().to_json, dict),
    "Sensitivities.at": (lambda: hs.sensitivities(sliding(), ["mu"]).at, lambda: {"t": 0.01}),
    "Sensitivities.of": (
        lambda: (
            lambda reading, quantities, t_span: hs.sensitivities(sliding(), ["mu"]).of(
                reading, quantities, t_span=t_span
            )
        ),
        lambda: {"reading": "maximum", "quantities": "x", "t_span": (0, 0.01)},
    ),
    "SteadyState.sensitivities": (lambda: settled().sensitivities, lambda: {"parameters": ["mu"]}),
    "SteadySensitivities.of": (
        lambda: lambda reading, quantities: settled().sensitivities(["mu"]).of(reading, quantities),
        lambda: {"reading": "mean", "quantities": "x"},
    ),
    "Sensitivities.plot": (lambda: hs.sensitivities(sliding(), ["mu"]).plot, dict),
    "LawComparison.plot": (lambda: hs.compare_laws("dfcs", ["coulomb"], (0, 0.01)).plot, dict),
    "Branch.plot": (lambda: branch().plot, lambda: {"name": "x"}),
    "Branch.amplitude": (lambda: branch().amplitude, lambda: {"name": "x"}),
    "Model.from_toml": (lambda: hs.Model.from_toml, lambda: {"text": "schema = 1"}),
    "LawTable.fit": (lambda: hs.LawTable.fit, lambda: {"at": [0, 1, 2], "values": [1, 2, 2], "knots": 2}),
    "Model.regularized": (lambda: hs.load("dfcs").regularized, lambda: {"kind": "tanh", "v0": 0.1}),
}


def public_calls() -> Iterator[str]:
    """What is public and takes arguments, results' methods included."""
    for name in hs.__all__:
        thing = getattr(hs, name)
        if name not in _RESULTS:
            yield name
        if inspect.isclass(thing) and not issubclass(thing, BaseException):
            for method, function in inspect.getmembers(thing, callable):
                if method.startswith("_") or not (name in _RESULTS or method in _METHODS.get(name, ())):
                    continue
                if set(signature(function).parameters) - {"self"} and f"{name}.{method}" not in _NOT_CALLED:
                    yield f"{name}.{method}"


def test_every_public_call_is_listed() -> None:
    missing = set(public_calls()) - CALLS.keys()
    assert not missing, f"give these a line in CALLS: {sorted(missing)}"


class Endless(BaseException):
    """A call that takes longer than it may; no part of the package takes it for an error of its own."""


@contextmanager
def limited() -> Iterator[None]:
    """End what takes more of the processor than a call may, where the system can tell."""
    if not hasattr(signal, "setitimer"):
        yield
        return

    def ring(*_: object) -> None:
        raise Endless

    usual = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, _SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, usual)


@pytest.mark.parametrize("call", CALLS)
def test_a_value_of_a_wrong_kind_is_taken_or_refused_by_name(
    call: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # a text may be taken for the name of a file that is to be written
    function, good = (make() for make in CALLS[call])
    faults = []
    for argument in signature(function).parameters.values():
        if argument.kind in (Parameter.VAR_POSITIONAL, Parameter.VAR_KEYWORD) or argument.name == "place":
            continue
        for kind, value in wrong_values():
            if value is None and argument.default is None:
                continue
            what = f"{call}({argument.name} = {kind})"
            try:
                with limited():
                    function(**{**good, argument.name: value})
            except HybridsimError as refused:
                names = (argument.name, *_ALSO.get(argument.name, ()))
                if not any(name in str(refused) for name in names):
                    faults.append(f"{what} does not name the argument: {refused}")
                if not refused.remedy:
                    faults.append(f"{what} has no remedy: {refused}")
            except (Endless, Exception) as fault:
                faults.append(f"{what}: {type(fault).__name__}: {fault}")
    assert not faults, "\n".join(faults)
