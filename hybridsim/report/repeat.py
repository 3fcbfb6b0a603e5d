"""This module writes the ways to repeat a run: a call in Python, and a command line."""

from __future__ import annotations

import json
import math
import shlex
from dataclasses import MISSING, fields
from typing import Any, cast

from hybridsim import arguments
from hybridsim.errors import HybridsimError
from hybridsim.model import Model
from hybridsim.model.library import list_models, load
from hybridsim.solution import Solution


class Settings:
    """The settings of a run that differ from the defaults, with the changed parameters and start values.

    ``text`` is the model as TOML, or None for a model of Python functions. ``is_packaged`` is true if the model is a
    packaged one with other parameters or start values; otherwise ``text`` contains these.
    """

    def __init__(self, solution: Solution) -> None:
        self._solution, self._run = solution, solution._run
        model: Model = solution.model
        self.name = model.name
        self.text = _toml(model)
        self.params: dict[str, float | str] = {}
        self.is_packaged = self._compare(model)
        self.x0 = self._start_values()
        self.call = {**self._choices(), **self._limits()}
        task = self._run.task
        self.t_span = (float(task.t0), float(task.t1))
        modes = arguments.initial_modes(self._run.system, None)
        self.z0 = {
            automaton.name: automaton.modes[mode]
            for automaton, mode, usual in zip(self._run.system.automata, task.z0.tolist(), modes.tolist())
            if mode != usual
        }

    def _compare(self, model: Model) -> bool:
        """Return whether the model differs from a packaged model in values only, and store the changed values."""
        if self.text is None or model.name not in {info.name for info in list_models()}:
            return False
        packaged = load(model.name)
        declared = {parameter.name: parameter.value for parameter in packaged.parameters}
        now = {parameter.name: parameter.value for parameter in model.parameters}
        if now.keys() != declared.keys():
            return False
        changed = {name: value for name, value in now.items() if value != declared[name]}
        starts = {state.name: state.start for state in model.states}
        starts |= {part.name: part.start for part in model.discrete}
        known = {*(state.name for state in packaged.states), *(part.name for part in packaged.discrete)}
        if not starts.keys() <= known:
            return False
        if _toml(packaged.with_(**changed).with_start(**starts)) != self.text:
            return False
        self.params = {name: _value(value.text) for name, value in changed.items()}
        return True

    def _start_values(self) -> dict[str, float]:
        """Return the start values of the run that differ from the start values of the named model."""
        model = load(self.name) if self.is_packaged else self._solution.model
        if self.is_packaged and self.params:
            model = model.with_(**self.params)
        usual, task = {**model.start_values(), **model.discrete_values()}, self._run.task
        names = [*self._solution.names, *(part.name for part in model.discrete)]
        actual = dict(zip(names, [*task.x0.tolist(), *task.discrete.tolist()]))
        return {name: value for name, value in actual.items() if name in usual and value != usual[name]}

    def _choices(self) -> dict[str, Any]:
        """Return integrator, options, tolerances and step sizes; each option is a separate argument."""
        run, method = self._run, self._run.method
        tolerances = run.task.tolerances
        found: dict[str, Any] = {"integrator": "auto" if run.reason else method.name}
        for field in fields(cast(Any, method)):
            default = field.default if field.default is not MISSING else None
            if getattr(method, field.name) != default:
                found[field.name] = getattr(method, field.name)
        if "adaptive" not in method.lacks:
            found["rtol"] = tolerances.rtol
            usual = arguments.absolute_tolerances(self._solution.model, None, tolerances.rtol, run.task.x0)
            if (tolerances.atol != usual).any():
                same = len(set(tolerances.atol.tolist())) == 1
                found["atol"] = float(tolerances.atol[0]) if same else tolerances.atol.tolist()
        if math.isfinite(tolerances.max_step):
            found["max_step"] = tolerances.max_step
        if tolerances.first_step is not None:
            found["first_step"] = tolerances.first_step
        return found

    def _limits(self) -> dict[str, Any]:
        limits = {k: v for k, v in vars(self._run.task.limits).items() if math.isfinite(v)}
        found: dict[str, Any] = {"limits": limits} if limits else {}
        return found if self._run.save == "all" else {**found, "keep": self._run.save}

    # -- as text --------------------------------------------------------------------------------------------

    def python(self, version: str) -> str:
        """Return the lines of Python that repeat the run."""
        model = json.dumps(self.name if self.is_packaged else f"{self.name}.toml")
        if self.text is None:
            model = "model"
        named: dict[str, Any] = {"params": self.params, "x0": self.x0, "z0": self.z0}
        keyparts = {name: value for name, value in named.items() if value} | self.call
        lines = [f"import hybridsim as hs  # hybridsim {version}", ""]
        if self.text is None:
            lines.append("# model: as in your program, since Python functions cannot be written here")
        lines += ["sol = hs.simulate(", f"    {model},", f"    t_span={self.t_span!r},"]
        lines += [f"    {name}={value!r}," for name, value in keyparts.items()]
        return "\n".join([*lines, ")"])

    def command(self) -> str | None:
        """Return the command line that repeats the run, or None if there is none."""
        call = dict(self.call)
        save, limits = call.pop("keep", "all"), call.pop("limits", {})
        atol = call.get("atol")
        is_possible = (
            self.text is not None and self.t_span[0] == 0.0 and self.t_span[1] > 0.0 and not self.z0
            and "first_step" not in call and not isinstance(atol, list)
        )  # fmt: skip
        if not is_possible:
            return None
        parts = ["hybridsim", "run", self.name if self.is_packaged else f"{self.name}.toml"]
        for option, values in (("-p", self.params), ("--x0", self.x0)):
            parts += [word for name, value in values.items() for word in (option, f"{name}={_text(value)}")]
        parts += ["--t-end", repr(self.t_span[1])]
        for name in ("integrator", "rtol", "atol", "max_step"):
            if name in call:
                parts += [f"--{name.replace('_', '-')}", _text(call.pop(name))]
        parts += [word for name, value in call.items() for word in ("--option", f"{name}={_text(value)}")]
        parts += [word for name, value in limits.items() for word in ("--limit", f"{name}={_text(value)}")]
        parts += ["--keep", _text(save)] if save != "all" else []
        return shlex.join(parts)


def _toml(model: Model) -> str | None:
    """Return a model as the text of a file, or None if it cannot be written."""
    try:
        return model.to_toml()
    except HybridsimError:
        return None


def _value(text: str) -> float | str:
    """Return a number as a number, and any other expression as text."""
    try:
        return float(text)
    except ValueError:
        return text


def _text(value: object) -> str:
    """Return a value as a word of the command line."""
    if isinstance(value, bool):
        return str(value).lower()
    return value if isinstance(value, str) else repr(value)
