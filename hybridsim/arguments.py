"""This module checks the arguments of `simulate`; errors name the argument, its value and the remedy."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from hybridsim.errors import UsageError, nearest
from hybridsim.model import Model
from hybridsim.model.library import loaded
from hybridsim.model.parts.remedies import remedy_for_state
from hybridsim.presentation.progress_bar import callback as callback

if TYPE_CHECKING:
    from hybridsim.engine.record.limits import Limits
    from hybridsim.engine.record.retention import Retention
    from hybridsim.engine.system.system import System
    from hybridsim.integrators.contract import Integrator

# The smallest useful rtol: 100 units in the last place, as in SciPy.
SMALLEST_RTOL = 100 * 2.0**-52
RTOL = 1e-9


def without_a_name(value: Any) -> UsageError:
    """Return the error for a positional argument after `t_span`, such as `y0` in SciPy's `solve_ivp`."""
    shown = repr(value)
    if isinstance(value, Mapping):
        remedy = f"pass params={shown} for parameters, or x0={shown} for initial values"
    elif is_row(value):
        remedy = f"pass x0={shown}"
    elif isinstance(value, str):
        remedy = f"pass integrator={shown}"
    else:
        remedy = "pass it as a keyword, such as x0=..., params=... or rtol=..."
    return UsageError(f"simulate() accepts {shown} only as a keyword argument", remedy=remedy)


def cannot_be(what: str, value: Any, remedy: str) -> UsageError:
    """Return the error for a wrong value; `what` names the argument, or is a phrase with its name."""
    return UsageError(f"{f'`{what}`' if what.isidentifier() else what} cannot be {value!r}", remedy=remedy)


def number(value: Any, what: str, remedy: str = "use a number") -> float:
    """Return a real number as float; other types raise an error."""
    found = value if type(value) is float else as_real(value)
    if found is None:
        raise cannot_be(what, value, remedy)
    return found


def as_real(value: Any) -> float | None:
    """Return a real number as float, or None for other types, including complex numbers."""
    if isinstance(value, str | bytes | bool | np.bool_ | complex | np.complexfloating) or is_row(value):
        return None
    if isinstance(value, np.ndarray) and value.dtype.kind not in "iufO":
        return None
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return None


def finite_number(value: Any, what: str) -> float:
    """Return a finite real number as float, or raise an error."""
    found = number(value, what, "use a finite number")
    if not math.isfinite(found):
        raise cannot_be(what, value, "use a finite number")
    return found


def whole_number(value: Any, what: str, least: int, most: int) -> int:
    """Return an integer within bounds; bools are rejected."""
    found = int(value) if isinstance(value, int | np.integer) and not isinstance(value, bool) else least - 1
    if not least <= found <= most:
        raise cannot_be(what, value, f"use a whole number from {least} to {most}")
    return found


def text(value: Any, what: str) -> str:
    """Return a string, or raise an error."""
    if not isinstance(value, str):
        raise cannot_be(what, value, "use a name (a string)")
    return value


def known_name(value: Any, known: Sequence[str], message: str, kind: str) -> str:
    """Return a name if it is known, or raise an error that begins with the text `message`."""
    if not isinstance(value, str) or value not in known:
        raise UsageError(f"{message} {value!r}", remedy=nearest(str(value), known, kind=kind))
    return value


def known_entry(name: Any, known: Sequence[str], argument: str, what: str, kind: str) -> None:
    """Raise an error for an unknown name in an argument; `what` is a phrase such as "a state of model 'm'"."""
    if name not in known:
        message = f"`{argument}` contains {name!r}, which is not {what}"
        raise UsageError(message, remedy=nearest(str(name), known, kind=kind))


def known_mode(mode: Any, modes: Sequence[str], argument: str, component: str) -> int:
    """Return the index of a mode of a component, or raise an error."""
    if mode not in modes:
        message = f"`{argument}` of {component} is {mode!r}, which is not a mode of {component}"
        raise UsageError(message, remedy=nearest(str(mode), modes, kind="modes"))
    return modes.index(mode)


def flag(value: Any, what: str) -> bool:
    """Return a bool, or raise an error."""
    if not isinstance(value, bool | np.bool_):
        raise cannot_be(what, value, "use True or False")
    return bool(value)


def side_of_event(side: Any) -> str:
    """Return the requested side of an event, '-' or '+'."""
    if not (isinstance(side, str) and side in ("+", "-")):
        raise cannot_be("side", side, "use '-' (before the event) or '+' (after it)")
    return side


def real_array(value: Any, what: str, remedy: str) -> np.ndarray:
    """Return finite real numbers as an array of any shape."""
    try:
        found = np.asarray(value)
    except ValueError:  # rows of different lengths
        raise cannot_be(what, value, remedy) from None
    if found.dtype.kind == "O":
        items = [as_real(item) for item in found.flat]
        found = np.array([math.nan if item is None else item for item in items]).reshape(found.shape)
    if found.dtype.kind not in "iuf" or not np.isfinite(found).all():
        raise cannot_be(what, value, remedy)
    return found.astype(float)


def is_row(value: Any) -> bool:
    """Return whether a value is a sequence, but not a string, a mapping or a zero-dimensional array."""
    if type(value) in (tuple, list):
        return True
    if isinstance(value, np.ndarray):
        return value.ndim > 0
    return isinstance(value, Iterable) and not isinstance(value, str | bytes | Mapping)


def numbers(value: Any, what: str, remedy: str) -> np.ndarray:
    """Return a sequence of real numbers as a one-dimensional array."""
    if not is_row(value):
        raise cannot_be(what, value, remedy)
    if isinstance(value, np.ndarray) and value.ndim == 1 and value.dtype.kind in "iuf":
        return value.astype(float)
    return np.array([number(item, f"a value of `{what}`", remedy) for item in value], dtype=float)


def as_times(t: Any) -> np.ndarray:
    """Return one time or a sequence of times as an array (k,)."""
    remedy = "use a time, or a sequence of times"
    try:
        found = np.asarray(t)
    except ValueError:  # rows of different lengths
        raise cannot_be("t", t, remedy) from None
    if found.dtype.kind == "O" and found.ndim == 1:
        return numbers(found.tolist(), "t", remedy)
    if found.dtype.kind == "O" and found.ndim == 0:
        return np.array([number(t, "t", remedy)])
    if found.dtype.kind not in "iuf" or found.ndim > 1:
        raise cannot_be("t", t, remedy)
    return np.atleast_1d(found.astype(float, copy=False))


def chosen_model(model: Any, params: Any) -> Model:
    """Return the model, which may be given by name or path; `params` changes its parameters."""
    if not isinstance(model, Model):
        model = loaded(model)
    if params is None:
        return model
    if not isinstance(params, Mapping) or not all(isinstance(name, str) for name in params):
        raise cannot_be("params", params, "use a dict of parameter names and values, such as {'F0': 30.0}")
    return model.with_(**params)


def time_span(t_span: Any) -> tuple[float, float]:
    """Return the finite times (t0, t1)."""
    remedy = "use two numbers, (t0, t1)"
    if is_row(t_span):
        t_span = t_span if isinstance(t_span, tuple | list | np.ndarray) else list(t_span)
        remedy += "; pass output times as `t_eval`" if len(t_span) > 2 else ""
    return two_numbers(t_span, "t_span", remedy, "; a monitor can end a run early")


def two_numbers(value: Any, argument: str, remedy: str, but: str = "") -> tuple[float, float]:
    """Return two finite numbers; `but` is added to the remedy for infinite numbers."""
    if not is_row(value):
        raise cannot_be(argument, value, remedy)
    ends = [number(t, f"a value of `{argument}`", remedy) for t in value]
    if len(ends) != 2:
        shown = repr(value) if len(ends) < 5 else f"{len(ends)} numbers from {ends[0]!r} to {ends[-1]!r}"
        raise UsageError(f"`{argument}` cannot be {shown}", remedy=remedy)
    if not all(map(math.isfinite, ends)):
        raise cannot_be(argument, value, f"use two finite numbers{but}")
    return ends[0], ends[1]


def start_values(model: Model, x0: Any, keyword: str = "x0") -> tuple[dict[str, float], Model]:
    """Return initial values by name, and the model with the discrete states of `x0`; `keyword` names `x0` in errors."""
    if x0 is None:
        return {}, model
    names = [s.name for s in model.states]
    if not isinstance(x0, Mapping):
        each = f"use one number for each of {', '.join(names)}, or a dict of names and numbers"
        values = numbers(x0, keyword, each)
        if len(values) != len(names):
            raise UsageError(
                f"`{keyword}` has {len(values)} values, but model '{model.name}' has {len(names)} states "
                f"({', '.join(names)})",
                remedy="use one value for each state, or a dict of names and values",
            )
        x0 = dict(zip(names, values, strict=True))
    discrete = [d.name for d in model.discrete]
    found: dict[str, float] = {}
    for name, value in x0.items():
        if name not in names + discrete:
            raise UsageError(
                f"`{keyword}` contains {name!r}, which is not a state of model '{model.name}'",
                remedy=remedy_for_state(model, str(name)),
            )
        remedy = f"use a number; for an expression use model.with_start({name}=...)"
        found[name] = number(value, f"`{keyword}` of {name}", remedy)
        if not math.isfinite(found[name]):
            raise UsageError(f"`{keyword}` of {name} cannot be {value!r}", remedy="use a finite number")
    changed = {n: v for n, v in found.items() if n in discrete}
    return {n: v for n, v in found.items() if n in names}, model.with_start(**changed) if changed else model


def integrator_name(integrator: Any) -> str:
    """Return the name of an integrator or "auto", or raise an error."""
    if not isinstance(integrator, str):
        raise cannot_be("integrator", integrator, "use a name; hs.list_integrators() lists them")
    return integrator


def refuse_unused(method: Integrator, **tolerances: Any) -> None:
    """Reject tolerances that a fixed-step method would ignore; None means that a tolerance was not set."""
    unused = [name for name, value in tolerances.items() if value is not None]
    if unused and "adaptive" in method.lacks:
        raise UsageError(
            f"{method.name} does not accept {', '.join(unused)}: {method.lacks['adaptive']}",
            remedy=f"use an option that 'hybridsim integrators {method.name}' lists, or another integrator",
        )


def relative_tolerance(rtol: Any) -> float:
    """Return rtol, which lies between 100 units in the last place and 1."""
    remedy = f"use a number from {SMALLEST_RTOL!r} to below 1"
    value = RTOL if rtol is None else number(rtol, "rtol", remedy)
    if not (SMALLEST_RTOL <= value < 1.0):
        raise cannot_be("rtol", rtol, remedy)
    return value


def step_bound(value: Any, name: str) -> float:
    """Return a limit of the step size as a positive number."""
    bound = number(value, name, "use a positive number")
    if not bound > 0.0:
        raise cannot_be(name, value, "use a positive number")
    return bound


def absolute_tolerances(model: Model, atol: Any, rtol: float, start: np.ndarray) -> np.ndarray:
    """Return atol for each state; the default is rtol * 1e-3 * nominal size."""
    sizes = zip(model.states, start.tolist(), strict=True)
    values = np.array([1e-3 * rtol * (state.nominal or abs(x) or 1.0) for state, x in sizes])
    if atol is None:
        return values
    names = [s.name for s in model.states]
    remedy = f"use a number >= 0, or one for each of {', '.join(names)}"
    if isinstance(atol, Mapping):
        for name, value in atol.items():
            known_entry(name, names, "atol", f"a state of model '{model.name}'", "states")
            values[names.index(name)] = number(value, f"`atol` of {name}")
    elif is_row(atol):
        values = numbers(atol, "atol", remedy)
    else:
        values[:] = number(atol, "atol", remedy)
    if values.shape != start.shape or not (np.isfinite(values).all() and (values >= 0).all()):
        raise cannot_be("atol", atol, remedy)
    return values


def initial_modes(system: System, z0: Any) -> np.ndarray:
    """Return the index of the initial mode of each component, or -1 if a surface selects the mode."""
    z = system.initial_modes.copy()
    if z0 is None:
        return z
    components = [a.name for a in system.declared]
    if not isinstance(z0, Mapping):
        raise cannot_be("z0", z0, "use a dict of component names and mode names")
    for name, mode in z0.items():
        known_entry(name, components, "z0", f"a component of model '{system.model.name}'", "components")
        c = components.index(name)
        z[c] = known_mode(mode, system.automata[c].modes, "z0", name)
    return z


def retention_of(save: Any, system: System) -> Retention:
    """Return the parts of the run to store; `save` is a word, or the length of time before the end of the run."""
    from hybridsim.engine.record.retention import ALL, EVENTS, NOTHING, Retention

    retentions = {"all": ALL, "events": EVENTS, "nothing": NOTHING}
    if isinstance(save, str) and save in retentions:
        return retentions[save]
    if isinstance(save, str) and save == "last-period":
        from hybridsim.engine.system.period import system_period

        length = system_period(system)
        if length is None:
            raise UsageError(
                f"`keep` is 'last-period', but model '{system.model.name}' has no forcing period",
                remedy="use a length of time: keep=1.5 stores the last 1.5 time units",
            )
        return Retention(length, length)
    remedy = "use 'all', 'events', 'last-period', 'nothing', or a length of time"
    length = number(save, "keep", remedy)
    if not length > 0.0:
        raise cannot_be("keep", save, remedy)
    return Retention(length, length)


def run_limits(limits: Any) -> Limits:
    """Return the limits of the run from a dict of names and numbers."""
    from hybridsim.engine.record.limits import UNLIMITED, Limits

    if limits is None:
        return UNLIMITED
    names = [f.name for f in fields(Limits)]
    if not isinstance(limits, Mapping):
        remedy = f"use a dict with the keys {', '.join(names)}, such as {{'events': 1000}}"
        raise cannot_be("limits", limits, remedy)
    for name, value in limits.items():
        known_name(name, names, "Unknown limit", "limits")
        if not number(value, f"the limit {name!r}") > 0.0:
            raise cannot_be(f"the limit {name!r}", value, "use a positive number")
    return Limits(**{name: float(value) for name, value in limits.items()})


def time_grid(
    t_eval: Sequence[float] | None, span: tuple[float, float], retention: Retention, save: Any
) -> np.ndarray | None:
    """Return the output times, which must lie in the stored part of the run."""
    if t_eval is None:
        return None
    if retention.segments is None:
        raise UsageError(
            f"`t_eval` needs the states over time, which keep={save!r} does not store",
            remedy="remove `t_eval`, or use keep='all'",
        )
    grid = numbers(t_eval, "t_eval", "use times from t0 to t1")
    low, high = min(span), max(span)
    if len(grid) and not (grid.min() >= low and grid.max() <= high):
        bad = float(grid[~((grid >= low) & (grid <= high))][0])
        raise UsageError(
            f"`t_eval` contains {bad:.9g}, outside `t_span` ({span[0]:.9g}, {span[1]:.9g})",
            remedy="use times from t0 to t1",
        )
    if retention.segments < math.inf and (np.abs(span[1] - grid) > retention.segments).any():
        raise UsageError(
            f"`t_eval` contains times before the last {retention.segments:.9g} of the run, which "
            f"keep={save!r} does not store",
            remedy="use later times, or keep='all'",
        )
    return grid
