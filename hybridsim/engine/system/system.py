"""This module binds a model to parameter values: compiled functions, run-time vector, series."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from hybridsim.engine.native.kernels import Precompiled
from hybridsim.engine.native.model_functions import evaluate, evaluate_rows
from hybridsim.engine.series.bounded import ORDER, run_series
from hybridsim.engine.series.high_orders import high_rows
from hybridsim.engine.series.layout import SIGNAL_SLOTS, Layout
from hybridsim.engine.series.optimise import OptimisedTape, has_corners, optimised
from hybridsim.engine.series.registers import Registers
from hybridsim.engine.series.short_series import Series
from hybridsim.engine.system.automaton import Automaton, automaton_of
from hybridsim.engine.system.finite_differences import run_differences, run_jacobian
from hybridsim.engine.system.instant import Instant, phase_of, rest_of_rate
from hybridsim.engine.system.modules import compiled
from hybridsim.engine.system.per_structure import per_structure
from hybridsim.engine.system.signals import Signal
from hybridsim.model.parts.model import Model
from hybridsim.model.smoothing.explicit_corners import smoothed
from hybridsim.model.smoothing.steps_in_time import constant_inputs
from hybridsim.model.toml.automata import SINGLE

_MAX_CACHED = 64  # most cached rates per structure
_NO_DISCRETE = np.zeros(0)


class _Frame:
    """The attributes that all systems of one structure share; they become attributes of each system."""

    def __init__(self, model: Model, data: dict[str, Any]) -> None:
        self.names: tuple[str, ...] = tuple(s.name for s in model.states)
        self.n = len(self.names)
        self.layout = Layout(len(model.parameters), len(model.discrete), data["rates"], len(model.inputs))
        # the run-time vector behind the parameters, before a segment
        self.beyond_parameters = [0.0] * (self.layout.size - self.layout.parameters)
        self.beyond_parameters[self.layout.pin_at - self.layout.parameters] = 1.0
        self.automata: tuple[Automaton, ...] = tuple(
            automaton_of(c, g) for c, g in zip(model.all_components(), data["guards"], strict=True)
        )
        self.resets: dict[tuple[Any, ...], tuple[int, tuple[str, ...]]]
        self.resets = {key: (number, targets) for number, (key, targets) in enumerate(data["resets"])}
        self.monitor_names: tuple[str, ...] = tuple(m.name for m in model.monitors)
        self.owner = np.zeros(data["guard_count"], dtype=np.int64)  # component of each guard
        for c, automaton in enumerate(self.automata):
            for numbers in automaton.guards:
                self.owner[list(numbers)] = c
        self.has_surface = np.array([a.has_surface for a in self.automata], dtype=np.bool_)
        self.is_corner = np.array([a.is_corner for a in self.automata], dtype=np.bool_)
        # not corners with the same rates on both sides, nor whole numbers, which only follow their arguments
        follows = [a.is_corner and (not a.is_step or a.number != "") for a in self.automata]
        self.may_accumulate = ~np.array(follows, dtype=np.bool_)
        self.is_unilateral = np.array([a.is_unilateral for a in self.automata], dtype=np.bool_)
        # true for impacts or resets; friction and relays alone do not bounce
        self.may_bounce = bool((self.is_unilateral | ~(self.has_surface | self.is_corner)).any())
        # corners and loads: their modes follow from the state
        self.led = tuple(c for c, a in enumerate(self.automata) if a.is_corner or a.is_load)
        # places of whole numbers in the run-time vector, by component
        discrete = {d.name: self.layout.discrete_at + k for k, d in enumerate(model.discrete)}
        self.numbers = {c: discrete[a.number] for c, a in enumerate(self.automata) if a.number}
        self.declared = self.automata[: len(self.automata) - int(self.is_corner.sum())]  # without corners
        self.component_numbers = np.arange(len(self.automata))
        self.initial_modes = np.array([a.initial for a in self.automata], dtype=np.int64)
        self.guard_table = self._guard_table()
        self.guard_count: int = data["guard_count"]
        self.surface_of: tuple[int, ...] = data["surfaces"]  # component of each surface
        self.clusters: tuple[tuple[int, ...], ...] = data["clusters"]
        # see `hybridsim.engine.lowering.stop_coupling.StopCoupling`
        self.stop_couplings: tuple[tuple[int, int, bool], ...] = data["stop_couplings"]
        self.pins: dict[int, tuple[int, ...]] = data["pins"]
        self.projected: dict[int, tuple[int, ...]] = data["projected"]
        self.linear: dict[str, tuple[bool, ...]] = data["linear"]
        self.quantities: tuple[str, ...] = data["quantities"]
        # the parameters that `effects` read, or None if they read more than parameters
        self.effects_read: tuple[int, ...] | None = data["effects_read"]
        self.rates_read = np.array(data["rates_read"], dtype=np.int64)  # the parameters that `rates_at` reads
        self.has_tape: bool = data["tape"] is not None  # whether the model consists of expressions

    def _guard_table(self) -> np.ndarray:
        """Return the guard numbers of every mode (components, modes, widest), padded with -1."""
        most = max((len(a.modes) for a in self.automata), default=0)
        widest = max((len(g) for a in self.automata for g in a.guards), default=0)
        table = np.full((len(self.automata), most, max(widest, 1)), -1, dtype=np.int64)
        for c, automaton in enumerate(self.automata):
            for m, numbers in enumerate(automaton.guards):
                table[c, m, : len(numbers)] = numbers
        return table


class _Rates(NamedTuple):
    """The rates at which angles grow in time, at some values of the parameters that they depend on."""

    exact: np.ndarray  # (R, 2), see `System.rates_at`
    fastest: float
    turning: tuple[tuple[int, list[float]], ...]  # place of each angle in the run-time vector, and its rate


def _rates_at_values(system: System, _: bytes) -> _Rates:
    exact = system.rates_at(system._base)
    fastest = max(map(abs, exact[:, 0].tolist()), default=0.0)
    return _Rates(exact, fastest, tuple(enumerate(exact.tolist(), system.layout.phases_at)))


_rates_of = per_structure(_rates_at_values, most=_MAX_CACHED)
_frame_of = per_structure(lambda system: _Frame(system.model, system.code.data))
_registers_of = per_structure(lambda system: Registers(system.code.data["tape"], system.layout))
_has_corners = per_structure(lambda system: has_corners(system.code.data["tape"]))


@per_structure
def _optimised_tape(system: System, modes: bytes) -> OptimisedTape:
    z = np.frombuffer(modes, dtype=np.int64)
    active = np.flatnonzero(system.active(z))
    return optimised(system.code.data["tape"], system.mode_rows(z), active, system.registers.separate)


@per_structure
def _high_rows(system: System, modes: bytes) -> list[tuple[int, ...]]:
    z = np.frombuffer(modes, dtype=np.int64)
    tape = system.optimised_tape(z)
    monitored = (*tape.guards[system.active(z)].tolist(), *tape.monitors.tolist())
    rows = list(map(tuple, tape.rows.tolist()))
    return high_rows(rows, tape.states.tolist(), tape.derivatives.tolist(), monitored)


_run_series = Precompiled(run_series)


class System(_Frame):
    """A model with parameter values, on which integrators and the mode loop work.

    Parameters
    ----------
    as_written : keep corners inside modes as they are, instead of making them components that follow the declared ones
        (`hybridsim.model.smoothing.explicit_corners`).
    """

    def __init__(self, model: Model, as_written: bool = False) -> None:
        written, self.model = model, model if as_written else smoothed(model)
        self.code = compiled(self.model)
        self.__dict__ = vars(_frame_of(self)) | vars(self)
        self.written = written  # kept alive, because `system_cache` finds systems by its identity
        model = self.model
        self.values = model.parameter_values()
        self._base = np.array([*self.values.values(), *self.beyond_parameters])
        self.exact_rates, self.fastest, self._turning = _rates_of(self, self._base[self.rates_read].tobytes())
        self._start, self.discrete_start = [*model.start_values().values()], _NO_DISCRETE
        discrete: dict[str, float] = {}
        if model.discrete:
            discrete = model.discrete_values()
            self.discrete_start = np.array([*discrete.values()])  # in the order of the state vector
        self.signals: tuple[Signal, ...] = ()
        if model.inputs:
            numbers = {**discrete, **constant_inputs(model), **self.values}
            self.signals = tuple(Signal(i, numbers) for i in model.inputs)
        self.starts: dict[tuple[Any, ...], Any] = {}  # cache of `hybridsim.engine.events.start`
        self.tables: dict[tuple[float, bool], Any] = {}  # cache of `hybridsim.engine.linear.tables`
        self.with_corners: Any = None  # cache of `hybridsim.engine.events.monitor_corners`
        if self.has_tape:
            self.registers: Registers = _registers_of(self)  # of the tape's inputs and results

    @property
    def has_corners(self) -> bool:
        """Return whether a flow, guard or monitor has a corner or a jump inside a mode."""
        return self.has_tape and _has_corners(self)

    @cached_property
    def is_linear(self) -> bool:
        """Return whether the flow of every mode is linear in the states."""
        return all(all(modes) for modes in self.linear.values())

    @cached_property
    def event_names(self) -> tuple[str, ...]:
        """Return the names that events can have: components, monitors, schedules, inputs."""
        model = self.model
        named = (self.automata, model.monitors, model.schedules, model.inputs)
        return tuple(part.name for parts in named for part in parts)

    @property
    def rates(self) -> np.ndarray:
        """Return the rates (R,) at which angles grow in time, rounded to doubles."""
        rates: np.ndarray = self.exact_rates[:, 0]
        return rates

    @property
    def can_hold(self) -> bool:
        """Return whether some mode holds states on a surface."""
        return bool(self.pins or self.projected)

    def holds(self, z: np.ndarray) -> bool:
        """Return whether a mode in the combination `z` holds states on a surface."""
        return any(z[c] == self.automata[c].hold for c in (*self.pins, *self.projected))

    def evaluated(self, z: np.ndarray) -> list[int]:
        """Return the indices of the states that holding modes among `z` compute from constraints."""
        return [i for c, held in self.pins.items() if z[c] == self.automata[c].hold for i in held]

    # -- values ---------------------------------------------------------------------------------------------

    def start_state(self, overrides: Mapping[str, float]) -> np.ndarray:
        """Return the initial states in the order of the state vector."""
        start = np.array(self._start)
        for name, value in overrides.items():
            start[self.names.index(name)] = value
        return start

    def vector(self, origin: Instant, discrete: np.ndarray, forward: bool = True) -> np.ndarray:
        """Return the run-time vector of a segment whose local time starts at `origin`."""
        p = self._base.copy()
        at = self.layout
        p[at.discrete_slice] = discrete
        p[at.origin_at] = origin.high + origin.low
        for place, (rate, rest) in self._turning:
            p[place] = phase_of(origin.high, origin.low, rate, rest * origin.high)
        for k, signal in enumerate(self.signals):
            place = at.signals_at + SIGNAL_SLOTS * k
            p[place : place + SIGNAL_SLOTS] = signal.piece(origin, forward)
        return p

    def discrete(self, p: np.ndarray) -> np.ndarray:
        """Return the discrete states from a run-time vector."""
        return p[self.layout.discrete_slice]

    def mode_names(self, z: np.ndarray) -> dict[str, str]:
        """Return the mode of every component by name."""
        return {a.name: a.modes[m] for a, m in zip(self.automata, z, strict=True)}

    def hot_functions(self) -> tuple[str, ...]:
        """Return the functions that every run needs; other functions are compiled on first use."""
        names = ["flow", *(["guards"] if self.guard_count else []), *(["project"] if self.can_hold else [])]
        names += ["monitors"] if self.monitor_names else []
        return tuple(names)

    # -- functions ------------------------------------------------------------------------------------------

    def address(self, name: str) -> Any:
        """Return the address of a compiled function, for kernels."""
        return self.code.address(name)

    def rates_at(self, p: np.ndarray) -> np.ndarray:
        """Return the rates (R, 2) at which angles grow in time, at the parameter values in `p`.

        A rate is the sum of a number and a rest. The rest is not zero for a wave, whose period is exact.
        """
        module, none = self.code.module, (np.zeros(0), p, np.zeros(0, dtype=np.int64))
        waves, found = self.code.data["of_waves"], np.zeros((self.layout.phases, 2))
        module.rates(0.0, *none, found[:, 0])
        if waves:
            periods = np.zeros(len(waves))
            module.periods(0.0, *none, periods)
            for k, period in zip(waves, periods.tolist(), strict=True):
                found[k, 1] = rest_of_rate(found[k, 0], period)
        return found

    def flow(self, s: float, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return the rates dx/dt (n,) of the states."""
        out = np.empty(self.n)
        evaluate(self.address("flow"), s, x, p, z, out)
        return out

    def project(self, s: float, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return the states x with every held state computed from its constraint."""
        if not self.can_hold:
            return x
        out = np.empty(self.n)
        evaluate(self.address("project"), s, np.ascontiguousarray(x), p, z, out)
        return out

    def rows(
        self, name: str, count: int, s: np.ndarray, x: np.ndarray, p: np.ndarray, z: np.ndarray
    ) -> np.ndarray:
        """Evaluate a function at k points, given by times (k,) and states (k, n), as rows (k, count)."""
        out = np.empty((len(s), count))
        evaluate_rows(self.address(name), s, x, p, z, out)
        return out

    def jumps(self, s: float, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return the jumps (2 m,) of the unknowns of m surfaces after a release to either side."""
        out = np.zeros(2 * len(self.surface_of))
        self._in_python("jumps", s, x, p, z, out)
        return out

    def effects(self, s: float, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> dict[int, float]:
        """Return the effect of each unknown on the rate of its own surface; the effect of friction is negative."""
        out = np.zeros(len(self.surface_of))
        self._in_python("effects", s, x, p, z, out)
        return {c: float(out[k]) for k, c in enumerate(self.surface_of)}

    def impulses(
        self, s: float, x: np.ndarray, p: np.ndarray, z: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return derivatives of the surfaces (m, n), the effects of impulses on the states, and loads (2, m, m).

        u is the rate of a gap, or a relative velocity; see `hybridsim.engine.lowering.impulse_rows`.
        """
        n, m = self.n, len(self.surface_of)
        out = np.zeros(2 * m * (n + m))
        self._in_python("impulses", s, x, p, z, out)
        return (
            out[: m * n].reshape(m, n),
            out[m * n : 2 * m * n].reshape(m, n),
            out[2 * m * n :].reshape(2, m, m),
        )

    def gap_slopes(self, s: float, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return d(gap)/dx (m, n) of the surfaces, or zero for surfaces that are not gaps."""
        out = np.zeros(len(self.surface_of) * self.n)
        self._in_python("gap_slopes", s, x, p, z, out)
        return out.reshape(-1, self.n)

    def restitutions(
        self, s: float, x: np.ndarray, p: np.ndarray, z: np.ndarray, speeds: np.ndarray
    ) -> np.ndarray:
        """Return the coefficients of restitution (m,) at given approach speeds (m,)."""
        out = np.zeros(len(self.surface_of))
        self._in_python("restitutions", s, np.concatenate([x, speeds]), p, z, out)
        return out

    def choose(self, component: int, mode: int, guard: int, s: float, x: Any, p: Any, z: Any) -> int:
        """Return the number of the first choice of a guard whose condition holds, or -1."""
        out = np.zeros(1)
        has_value = self._in_python("choose", s, x, p, np.array([*z, component, mode, guard]), out)
        return int(out[0]) if has_value else -1  # a condition that is not a number counts as false

    def apply_reset(
        self, key: tuple[Any, ...], s: float, x: Any, p: Any, z: Any, x_plus: Any, p_plus: Any
    ) -> None:
        """Write the values that one reset sets, evaluated at (s, x, p, z)."""
        if key in self.resets:
            at = self.layout.discrete_slice
            out = np.concatenate([x_plus, p_plus[at]])
            if not self._in_python("reset", s, x, p, np.array([*z, self.resets[key][0]]), out):
                discrete = [d.name for d in self.model.discrete]
                out[[[*self.names, *discrete].index(name) for name in self.resets[key][1]]] = np.nan
            x_plus[:], p_plus[at] = out[: self.n], out[self.n :]

    def _in_python(self, name: str, s: float, x: Any, p: Any, z: Any, out: np.ndarray) -> bool:
        """Evaluate a rarely called function in Python; return whether the function has a value.

        Outside the domain of a function of the standard library there is none, and out is filled with NaN.
        """
        with np.errstate(all="ignore"):  # nan is handled by the callers
            try:
                getattr(self.code.module, name)(s, x, p, z, out)
            except (ValueError, ArithmeticError):
                if name != "reset":  # a reset sets only some of them
                    out[:] = np.nan
                return False
        return True

    # -- series ---------------------------------------------------------------------------------------------

    def guards_of(self, z: np.ndarray) -> np.ndarray:
        """Return the indices of the active guards in the modes `z`: one row per component, padded with -1."""
        return np.asarray(self.guard_table[self.component_numbers, z])

    def guard_title(self, guard: int, z: np.ndarray) -> str:
        """Return the name of a guard in the modes `z`, for messages."""
        automaton, mode = self.automata[self.owner[guard]], int(z[self.owner[guard]])
        name = automaton.guard_names[mode][automaton.guards[mode].index(guard)]
        of = "" if automaton.name == SINGLE else f" of {automaton.name}"
        return f"guard {name}{of} in mode {automaton.modes[mode]}"

    def active(self, z: np.ndarray) -> np.ndarray:
        """Return a mask of the guards that are active in the modes `z`."""
        mask = np.zeros(self.guard_count, dtype=np.bool_)
        numbers = self.guards_of(z)
        mask[numbers[numbers >= 0]] = True
        return mask

    def mode_rows(self, z: np.ndarray) -> list[tuple[int, ...]]:
        """Return the instruction tape of the modes `z`."""
        rows: list[tuple[int, ...]] = []
        for component, branches in self.code.data["tape"]["parts"]:
            rows += branches[0 if component < 0 else z[component]]
        return rows

    def optimised_tape(self, z: np.ndarray) -> OptimisedTape:
        """Return the optimised instruction tape of the modes `z`, for series of any order."""
        return _optimised_tape(self, z.tobytes())

    def high_rows(self, z: np.ndarray) -> list[tuple[int, ...]]:
        """Return the instructions that compute states, active guards and monitors at high orders."""
        return _high_rows(self, z.tobytes())

    def series(
        self,
        s: float,
        x: np.ndarray,
        p: np.ndarray,
        z: np.ndarray,
        x_error: np.ndarray,
        s_error: float,
        with_numbers: bool = False,
    ) -> Series:
        """Return Taylor coefficients up to third order of guards, surfaces, monitors and states.

        with_numbers: whether the bounds include the roundoff of the numbers in the model.
        """
        if not self.has_tape:
            return self._differences(s, x, p, z, x_error, s_error)
        tape, count = self.optimised_tape(z), self.registers.count
        V, E = np.empty((count, ORDER + 1)), np.empty((count, ORDER + 1))
        x, x_error, p = (np.ascontiguousarray(array, dtype=float) for array in (x, x_error, p))
        inputs = self.registers.with_roundoff(p) if with_numbers else self.registers.inputs
        _run_series(
            tape.constant_rows, tape.rows, inputs, tape.derivatives, s, s_error, x, x_error, p, V, E
        )  # fmt: skip
        V, E = V.take(tape.results, 0), E.take(tape.results, 0)
        guards, surfaces = self.n, self.n + self.guard_count
        monitors = surfaces + len(self.surface_of)
        rows = slice(guards), slice(guards, surfaces), slice(surfaces, monitors), slice(monitors, None)
        return Series(
            V[rows[0]], E[rows[0]], V[rows[1]], E[rows[1]], V[rows[2]], E[rows[2]], V[rows[3]], E[rows[3]]
        )

    def _differences(
        self, s: float, x: np.ndarray, p: np.ndarray, z: np.ndarray, x_error: np.ndarray, s_error: float
    ) -> Series:
        """Return the Taylor series by finite differences, for models of Python functions."""
        guards = self.guard_count
        shape = (guards + len(self.monitor_names), ORDER + 1)
        C, G, E = np.empty((self.n, ORDER + 1)), np.empty(shape), np.empty(shape)
        p = self._probing(p)
        run_differences(
            self.address("flow"), self.address("guards_and_monitors"), s, float(p[self.layout.origin_at]) + s, s_error,
            np.ascontiguousarray(x, dtype=float), x_error, p, z, C, G, E,
        )  # fmt: skip
        none = np.empty((0, ORDER + 1))
        guard_rows, monitor_rows = slice(guards), slice(guards, None)
        return Series(
            C,
            np.full_like(C, np.nan),
            G[guard_rows],
            E[guard_rows],
            none,
            none,
            G[monitor_rows],
            E[monitor_rows],
        )

    def jacobian(self, s: float, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return the Jacobian d(dx/dt)/dx (n, n) by differences, for models of Python functions."""
        out = np.empty((self.n, self.n))
        t = float(p[self.layout.origin_at]) + s
        run_jacobian(self.address("flow"), s, t, x, self._probing(p), z, out)
        return out

    def _probing(self, p: np.ndarray) -> np.ndarray:
        """Return a copy of the run-time values for trial calls, in which errors of user functions are not reported."""
        p = p.copy()
        p[self.layout.pin_at] = 0.0
        return p
