"""Series as straight machine code: the same as the interpreters of their tapes, to the last bit, in every mode."""

from __future__ import annotations

import itertools
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

import hybridsim as hs
from hybridsim.engine.native.kernels import ENABLED, call_series, kernel
from hybridsim.engine.native.model_functions import compile_series
from hybridsim.engine.roots.defect_check import ahead_size, look_ahead
from hybridsim.engine.roots.dense_guards import guards_at, series_along
from hybridsim.engine.roots.first_exit import to_bernstein
from hybridsim.engine.series.bounded import ORDER
from hybridsim.engine.series.emit_bernstein import LEADING, bernstein_text
from hybridsim.engine.series.emit_bounds import bounds_text, can_bound
from hybridsim.engine.series.emit_series import ends_text, series_text
from hybridsim.engine.series.interpreter import expand, measure
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.programs import mode_code
from hybridsim.engine.system.programs.code_cache import CodeCache
from hybridsim.engine.system.programs.mode_code import constant_rows, constant_sources, mode_tape
from hybridsim.engine.system.programs.mode_tables import tape_cache_of
from hybridsim.engine.system.series_at import SeriesRun
from hybridsim.engine.system.system import System
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.integrators.runge_kutta.segments import series_of

pytestmark = pytest.mark.skipif(not ENABLED, reason="there is no machine code")

# every operation that is written out, and the modes of contacts, switches and impacts
SCENES = ("dfcs", "dfcs-stribeck", "belt", "square-wave", "bouncing-ball", "static-kinetic")
RATES = {
    "exp": "exp(-x*x)",
    "quotient": "x/(1 + x*x) - 2/(3 + sin(t))",
    "reciprocals": "1/(2 - x/a) + a/(3 + x/2) - 1/(2 + x*x) + 1/(2 + t)",
    "root": "sqrt(2 + x) + sqrt(t + 1)",
    "sines": "sin(x)*cos(3*t)",
    "tan": "tan(x/2) + 0.1*tanh(3*x)",
    "constants": "a*x/(1 + a*a) - x/3 - exp(a)/7",
}


@kernel
def called(code: int, s: float, error: float, x: Any, guards: Any, constants: Any, out: Any) -> None:
    """Call a function of series."""
    call_series(code, s, error, x, guards, constants, out)


@kernel
def looked(
    rows: Any,
    flow_registers: Any,
    order: int,
    s: float,
    d: float,
    guard_registers: Any,
    C: Any,
    U: Any,
    W: Any,
    out: Any,
) -> None:
    """What is ahead, by the interpreter."""
    look_ahead(0, rows, flow_registers, order, s, d, guard_registers, C, U, W, out)


@kernel
def sized(code: int, U: Any, guard_registers: Any, order: int, h: float, powers: Any, totals: Any) -> None:
    """Sizes of series."""
    measure(code, U, guard_registers, order, h, powers, totals)


@kernel
def ended(
    code: int,
    rows: Any,
    flow_registers: Any,
    s: float,
    x: Any,
    guard_registers: Any,
    W: Any,
    out: Any,
    guards: Any,
) -> bool:
    """Series at the end of a step."""
    return series_of(code, rows, rows, flow_registers, s, x, guard_registers, W, out, guards)


@kernel
def went(
    code: int, rows: Any, inputs: Any, s: float, x: Any, guard_registers: Any, V: Any, W: Any, out: Any
) -> None:
    """Guards along a step."""
    series_along(code, rows, inputs, s, x, guard_registers, V, W, out)


@kernel
def met(
    code: int, rows: Any, inputs: Any, s: float, x: Any, guard_registers: Any, W: Any, rates: Any, out: Any
) -> None:
    """Values of guards."""
    guards_at(code, rows, inputs, s, x, guard_registers, W, rates, out)


def systems() -> dict[str, System]:
    """Models by name."""
    found = {name: System(hs.load(name)) for name in SCENES}
    for name, rate in RATES.items():
        states = [hs.State("x", 0.25, der=rate)]
        monitors = [hs.Monitor("late", "x - 2")]
        found[name] = System(
            hs.Model(name, states=states, parameters=[hs.Parameter("a", 0.7)], monitors=monitors)
        )
    return found


SYSTEMS = systems()


def modes_of(system: System) -> Any:
    """All vectors of modes, of many the first."""
    every = itertools.product(*(range(len(a.modes)) for a in system.automata))
    return [np.array(z, dtype=np.int64) for z in itertools.islice(every, 6)]


def start_of(system: System) -> tuple[np.ndarray, np.ndarray]:
    """A run-time vector and a state."""
    discrete = np.array(list(system.model.discrete_values().values()), dtype=float)
    return system.vector(Instant(0.3), discrete), 0.5 + 0.3 * np.sin(np.arange(1.0, 1.0 + system.n))


@pytest.mark.parametrize("name", SYSTEMS)
def test_series_and_what_is_ahead_of_them(name: str, tmp_path: Path) -> None:
    system = SYSTEMS[name]
    p, x = start_of(system)
    for i, z in enumerate(modes_of(system)):
        run = SeriesRun(system, p, z, Tolerances(1e-9, np.zeros(system.n)))
        tape, order, n = mode_tape(system, z), run.order, system.n
        assert tape.is_known
        (series, values, ahead, sizes), _keep = compile_series(
            tmp_path / f"{i}",
            ("series_0", "values_0", "ahead_0", "sizes_0"),
            partial(series_text, tape, order),
        )
        guard_registers, fading = np.array(tape.guards, dtype=np.int64), np.array(tape.fading, dtype=np.int64)
        constants, interpreted = run.V.copy(), run.V.copy()
        run.expand(0.1, x, 1.0)
        expected, guards = run.V[run.states], run.V[guard_registers]
        C, with_fading = np.empty((n, order + 1)), np.empty((len(guard_registers) + len(fading), order + 1))
        U = with_fading[: len(guard_registers)]
        called(series, 0.1, 0.0, x, with_fading, constants, C)
        np.testing.assert_array_equal(C, expected)
        np.testing.assert_array_equal(U, guards)
        np.testing.assert_array_equal(with_fading[len(guard_registers) :], run.V[fading])
        d = 0.01
        found, want = np.empty((2, ahead_size(order, n, len(guard_registers))))
        called(ahead, 0.1, d, C, U, constants, found)
        looked(
            run.optimised.rows,
            run.flow_registers,
            order,
            0.1,
            d,
            guard_registers,
            expected,
            guards,
            interpreted,
            want,
        )
        np.testing.assert_array_equal(found, want)
        measured = np.empty(order + 1 + len(with_fading))
        called(sizes, d, 0.0, C, with_fading, constants, measured)
        for code in (0, sizes):
            both = np.empty_like(measured)
            rows = np.arange(len(with_fading))
            sized(code, with_fading, rows, order, d, both[: order + 1], both[order + 1 :])
            np.testing.assert_array_equal(measured, both)
        # from there, where order 0 is known, and by itself
        x1 = found[order + 1 : order + 1 + n].copy()
        run.expand(0.1 + d, x1, 1.0)
        called(series, 0.1 + d, 1.0, x1, with_fading, constants, C)
        np.testing.assert_array_equal(C, run.V[run.states])
        rates, at = np.empty(n), np.empty(len(guard_registers))
        called(values, 0.1 + d, 0.0, x1, at, constants, rates)
        np.testing.assert_array_equal(rates, run.V[run.optimised.derivatives, 0])
        np.testing.assert_array_equal(at, run.V[guard_registers, 0])


@pytest.mark.parametrize("name", SYSTEMS)
def test_short_series_with_bounds(name: str, tmp_path: Path) -> None:
    system = SYSTEMS[name]
    p, x = start_of(system)
    x_error = 1e-15 * np.arange(1.0, 1.0 + system.n)
    for i, z in enumerate(modes_of(system)):
        tape, rows, active = mode_tape(system, z), constant_rows(system, z), np.flatnonzero(system.active(z))
        assert can_bound(tape, rows)
        (code,), _keep = compile_series(
            tmp_path / f"{i}",
            ("bounds_0",),
            partial(bounds_text, tape, rows, constant_sources(system), active.tolist(), system.guard_count),
        )
        out = np.empty((2, system.guard_count, ORDER + 1))
        called(code, 0.1, 1e-17, x, x_error, p, out)
        expected = system.series(0.1, x, p, z, x_error, 1e-17)
        np.testing.assert_array_equal(out[0, active], expected.guards[active])
        np.testing.assert_array_equal(out[1, active], expected.guard_bounds[active])


def test_bernstein_forms(tmp_path: Path) -> None:
    order = 14
    names = [f"bernstein_{order + 1 - zeros}" for zeros in range(LEADING)]
    codes, _keep = compile_series(tmp_path / "forms", names, lambda: bernstein_text(order))
    for zeros, code in enumerate(codes):
        a = np.cos(np.arange(order + 1.0 - zeros) ** 2)
        found, expected = np.empty((2, len(a)))
        called(code, 0.0, 0.0, a, a, a, found)
        to_bernstein(a, expected)
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("name", SYSTEMS)
def test_series_at_the_ends_of_steps_and_guards_along_them(name: str, tmp_path: Path) -> None:
    system, terms, first, order, s = SYSTEMS[name], 4, 7, 11, 0.1
    p, x = start_of(system)
    for i, z in enumerate(modes_of(system)):
        tape, optimised = mode_tape(system, z), system.optimised_tape(z)
        guard_registers = np.array(tape.guards, dtype=np.int64)
        constants = SeriesRun(system, p, z, Tolerances(1e-9, np.zeros(system.n))).V
        V, W = (np.pad(constants[:, :1], ((0, 0), (0, order))) for _ in range(2))
        codes, _keep = compile_series(
            tmp_path / f"{i}",
            [f"{part}_0" for part in ("ends", "first", "along", "values")],
            partial(ends_text, tape, terms, first, order),
        )
        inputs, n, count = system.registers.inputs, system.n, len(guard_registers)
        flow_registers = (inputs.time[0], inputs.states, optimised.derivatives)
        made = []
        for code in (0, codes[0]):
            out, guards = np.empty((n, terms)), np.empty((count, terms))
            assert ended(code, optimised.rows, flow_registers, s, x, guard_registers, W, out, guards)
            made.append((out, guards))
        compare(*made)
        U, C = np.empty((count, terms)), np.empty((n, first + 1))
        called(codes[1], s, 0.0, x, U, W, C)
        expand(optimised.rows, optimised.rows[:0], flow_registers, first, s, x, V)
        compare((C, U), (V[inputs.states, : first + 1], V[guard_registers, :terms]))
        along = np.cos(np.arange(n * (order + 1.0)) ** 2).reshape(n, order + 1)
        made = []
        for code in (0, codes[2]):
            U = np.empty((count, order + 1))
            went(code, optimised.rows, inputs, s, along, guard_registers, V, W, U)
            made.append((U,))
        compare(*made)
        made = []
        for code in (0, codes[3]):
            values = np.empty(count)
            met(code, optimised.rows, inputs, s, x, guard_registers, W, np.empty(n), values)
            made.append((values,))
        compare(*made)


def compare(first: Any, second: Any) -> None:
    """The same to the last bit."""
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("integrator", ["taylor", "dop853", "tsit5"])
@pytest.mark.parametrize("name", ["dfcs-stribeck", "dfcs"])
def test_a_run_is_the_same_with_code_and_without(
    name: str, integrator: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first run goes by the interpreters alone, the last by machine code."""
    model, runs = hs.load(name), []
    code = System(model).code
    with patch.dict(code.shared, clear=True):  # what other runs have left behind is code already
        for steps in (2**62, 1, 1):
            monkeypatch.setattr(mode_code, "KNOWN", steps)
            monkeypatch.setattr(mode_code, "WORTH", steps)
            runs.append(hs.simulate(model, (0, 0.1), integrator=integrator))
        tapes, shared = (
            tape_cache_of(System(model)).tapes,
            [list(made.values()) for made in code.shared.values()],
        )
        made = [
            cache.of(tapes).arrays[: len(cache.functions)]
            for cache in itertools.chain(*shared)
            if isinstance(cache, CodeCache)
        ]
        assert any(np.all(addresses) for addresses in made) and tapes.bounds.all()
    assert len(runs[0].events) > 4
    for other in runs[1:]:
        np.testing.assert_array_equal(other.t, runs[0].t)
        np.testing.assert_array_equal(other.y, runs[0].y)
