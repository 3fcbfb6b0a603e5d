"""This module provides the code of a model of Python functions in place of a generated module."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from hybridsim.engine.lowering.reset_keys import resets_of
from hybridsim.engine.native import kernels
from hybridsim.engine.system.user_functions.forms import Forms, Parts, Scalar, number, parts_of, rates, value
from hybridsim.engine.system.user_functions.surroundings import surroundings
from hybridsim.errors import ModelError
from hybridsim.expr import function_name

if TYPE_CHECKING:
    from hybridsim.model.parts.model import Model


class RunRecord(Protocol):
    """The part of a run's record to which user functions add warnings."""

    status: str
    message: str

    def warn(self, message: str) -> None:
        """Count one occurrence of a warning."""


class PythonCode:
    """The Python functions of a model, compiled by numba if possible.

    It has the interface of `hybridsim.engine.system.modules.Compiled`; ``data["tape"]`` is None.
    """

    seconds = 0.0

    def __init__(self, model: Model) -> None:
        self.model = model
        self.parts = parts = parts_of(model)
        _refuse_other_arguments(parts)
        self.forms = Forms(parts)
        self.resets = [
            (key, {name: value(e) for name, e in reset.items()}) for key, reset in resets_of(model)
        ]  # state -> function or number
        self.conditions = _conditions(model)
        self.data = _data(model, self.resets)
        guards_and_monitors = (*parts.guards, *parts.monitors)
        self._rows: dict[str, tuple[Scalar, ...]] = {
            "guards": parts.guards,
            "monitors": parts.monitors,
            "quantities": parts.outputs,
            "guards_and_monitors": guards_and_monitors,
        }
        nothing = self.forms.row(())
        self.module = SimpleNamespace(
            flow=self.forms.flow,
            **{name: self.forms.row(scalars) for name, scalars in self._rows.items()},
            **dict.fromkeys(
                (
                    "surfaces",
                    "jumps",
                    "effects",
                    "rates",
                    "impulses",
                    "gap_slopes",
                    "restitutions",
                    "stepped",
                ),
                nothing,
            ),
            choose=self._choose,
            reset=self._reset,
        )
        self._addresses: dict[str, Any] = {}
        self.shared: dict[Any, Any] = {}
        self._compiler: Any = None
        self.refused = ""  # reason of numba if it cannot compile them
        self._surroundings = surroundings(self._functions)
        if kernels.ENABLED:
            from hybridsim.engine.system.user_functions.compiled import Compiler

            self._compiler = Compiler(parts)
            self.refused = self._compiler.refused

    @property
    def _functions(self) -> list[Callable[..., Any]]:
        parts = self.parts
        scalars = [scalar.function for scalar in (*parts.guards, *parts.monitors, *parts.outputs)]
        return [f for f in (*(flow for _, flow in parts.flows), *scalars) if callable(f)]

    @property
    def is_current(self) -> bool:
        """Return whether the global variables that the functions read are unchanged since compilation."""
        is_live = self._compiler is None or bool(self.refused)
        return is_live or surroundings(self._functions) == self._surroundings

    def address(self, name: str) -> Any:
        """Return the address of a function by its name, such as flow, guards or monitors."""
        if name not in self._addresses:
            self._addresses.setdefault(name, self._addressed(name))
        return self._addresses[name][0]

    def _addressed(self, name: str) -> tuple[Any, Any]:
        form = getattr(self.module, name)
        if self._compiler is None:
            return form, form
        if self.refused:
            from hybridsim.engine.system.user_functions.compiled import called_back

            width = self.parts.states if name == "flow" else len(self._rows[name])
            return called_back(form, self.parts, len(self.model.all_components()), width)
        compiled: tuple[Any, Any] = (
            self._compiler.flow() if name == "flow" else self._compiler.row(self._rows[name])
        )
        return compiled

    def last_failure(self) -> str:
        """Return the last exception of a run as text, or an empty text, and clear the exception."""
        if self._compiler is not None and not self.refused:
            self._compiler.replay(self.forms.failures)
        last, self.forms.failures.last = self.forms.failures.last, ""
        return last

    def flow_without_value(self, s: float, x: np.ndarray, p: np.ndarray, z: np.ndarray) -> str:
        """Return as text which function returned a rate that is not finite, with its arguments.

        The text is empty if the flow raises an error. `report` covers that case, even if compiled code does not raise,
        as in a division by zero.
        """
        function, call_arguments = self.forms.flow_of(z), self.forms.arguments(s, x, p)
        try:
            with np.errstate(all="ignore"):  # nan is what it looks for
                found = rates(function, self.parts.states, *call_arguments)
        except Exception as fault:  # user code may raise anything
            self.forms.failures.note(function, call_arguments[0], fault, True)
            return ""
        if np.isfinite(found).all():
            return ""
        shown = ", ".join(f"{rate:g}" for rate in found)
        return (
            f": the function {function_name(function)} returned ({shown}); look for a division by zero there"
        )

    @property
    def refusal_message(self) -> str:
        """Return the reason why the functions are not compiled."""
        return f"numba cannot compile the model's Python functions ({self.refused})"

    def report(self, trajectory: RunRecord) -> None:
        """Add warnings on derivatives, compilation and exceptions to the record of a run."""
        if self._rows["guards_and_monitors"]:
            trajectory.warn(
                "derivatives of guards and monitors are finite differences of the Python functions"
            )
        if self.refused:
            trajectory.warn(f"{self.refusal_message}, so the functions run as uncompiled Python")
        failure = self.last_failure()
        if failure and trajectory.status not in ("finished", "terminated"):
            trajectory.message += f"; {failure}"

    def check(self, x: np.ndarray, p: np.ndarray) -> None:
        """Call each function once in plain Python, to report mistakes with the name of the function.

        Values that are not numbers there (outside the domain, or in an inactive mode) are left to the run.
        """
        t, state, named = self.forms.arguments(0.0, x, p)
        flows = [(function, True) for _, function in self.parts.flows]
        scalars = (*self._rows["guards_and_monitors"], *self.parts.outputs)
        others = [(scalar.function, False) for scalar in scalars if callable(scalar.function)]
        for function, is_flow in flows + others:
            try:
                if is_flow:
                    rates(function, self.parts.states, t, state.copy(), named)
                else:
                    number(function, t, state.copy(), named)
            except ModelError:
                raise
            except (ArithmeticError, ValueError):
                continue
            except Exception as fault:  # user code may raise anything; the error names its place
                name = function_name(function)
                message = f"the function {name} raised {type(fault).__name__}: {fault} at t = {t!r}"
                remedy = f"call {name}(t, x, p) with the initial values to see where it fails"
                raise ModelError(message, remedy=remedy) from fault

    # -- functions called once per event, in plain Python ---------------------------------------------------

    def _choose(self, s: float, x: Any, p: Any, z: Any, out: Any) -> int:
        """Write the number of the first true condition of a guard to `out`."""
        c, m, g = (int(k) for k in z[-3:])
        out[0] = -1.0
        for k, condition in enumerate(self.conditions[c, m, g]):
            if condition is None or self.forms.number(condition, s, x, p):
                out[0] = float(k)
                break
        return 0

    def _reset(self, s: float, x: Any, p: Any, z: Any, out: Any) -> int:
        """Write the values of a reset, as the generated function `reset` does."""
        names = [state.name for state in self.model.states]
        for name, function in self.resets[int(z[-1])][1].items():
            out[names.index(name)] = self.forms.number(function, s, x, p)
        return 0


def _refuse_other_arguments(parts: Parts) -> None:
    """Raise an error for a function that does not accept time, states and parameters."""
    scalars = (*parts.guards, *parts.monitors, *parts.outputs)
    functions = [function for _, function in parts.flows] + [scalar.function for scalar in scalars]
    for function in filter(callable, functions):
        try:
            inspect.signature(function).bind(0.0, None, None)
        except ValueError:  # C functions may have no signature; the first call will show
            continue
        except TypeError:
            name = function_name(function)
            raise ModelError(
                f"the function {name} takes {inspect.signature(function)}, but is called with (t, x, p)",
                remedy="define the function with three arguments: the time, the states in order, and the parameters "
                "by name (p.NAME), even if the function does not use all of them",
            ) from None


def _conditions(model: Model) -> dict[tuple[int, int, int], tuple[Any, ...]]:
    return {
        (c, m, g): tuple(None if choice.when is None else value(choice.when) for choice in guard.then)
        for c, component in enumerate(model.all_components())
        for m, mode in enumerate(component.modes)
        for g, guard in enumerate(mode.guards)
    }


def _data(model: Model, resets: list[tuple[tuple[Any, ...], dict[str, Any]]]) -> dict[str, Any]:
    count, guards = 0, []
    for component in model.all_components():
        numbers = []
        for mode in component.modes:
            numbers.append(tuple(range(count, count + len(mode.guards))))
            count += len(mode.guards)
        guards.append(tuple(numbers))
    linear = {component.name: (False,) * len(component.modes) for component in model.all_components()}
    return {
        "guards": tuple(guards),
        "guard_count": count,
        "surfaces": (),
        "pins": {},
        "projected": {},
        "clusters": (),
        "stop_couplings": (),
        "rates": 0,
        "of_waves": (),
        "linear": {"": (False,)} | linear,
        "quantities": tuple(output.name for output in model.outputs),
        "resets": tuple((key, tuple(reset)) for key, reset in resets),
        "effects_read": (),  # there are no surfaces
        "rates_read": (),
        "tape": None,
    }
