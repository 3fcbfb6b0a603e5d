"""This module defines known inputs: tables over time, periodic waves and chirps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from os import PathLike
from pathlib import Path

from hybridsim.errors import ModelError
from hybridsim.expr import Expression
from hybridsim.files import path_text
from hybridsim.model.parts.declared import Declared
from hybridsim.model.parts.quantities import Discrete
from hybridsim.model.toml.table_file import read_columns
from hybridsim.model.units.seconds import REMEDY, in_seconds

KINDS = ("table", "wave", "chirp", "held", "connected")
SHAPES = ("square", "triangle", "sawtooth", "sine")
INTERPOLATIONS = ("linear", "cubic", "previous")
# Required fields of each kind (REQUIRED), and fields with defaults (OPTIONAL).
REQUIRED = {
    "table": ("times", "values"),
    "wave": ("shape", "period"),
    "chirp": ("f0", "f1", "duration"),
    "held": (),
    "connected": (),
}
OPTIONAL = {
    "table": ("interpolation", "phase", "unit", "time_unit"),
    "wave": ("amplitude", "phase", "offset", "duty", "unit"),
    "chirp": ("amplitude", "phase", "unit"),
    "held": ("value", "unit"),
    "connected": ("unit",),
}
_DEFAULTS: dict[str, dict[str, object]] = {
    "table": {"interpolation": "linear"},
    "wave": {"amplitude": 1, "phase": 0, "offset": 0},
    "chirp": {"amplitude": 1, "phase": 0},
    "held": {"value": 0, "unit": ""},
}


@dataclass(frozen=True)
class Input(Declared):
    """A named function of time.

    table
        Values at increasing times with linear or natural cubic interpolation, and constant beyond both ends. Two equal
        times make a jump (linear only). With "previous" each value holds until the next time, where it jumps; such a
        table becomes a linear one with jumps. ``phase`` is a delay in time.
    wave
        offset + amplitude s((t - phase)/period), s of period 1; ``phase`` is a delay in time.
        square: +1 for a fraction below ``duty`` (0.5), else -1; sine: sin(2 pi tau); triangle: 0 at 0, 1 at 1/4, -1 at
        3/4; sawtooth: from -1 rising to 1, where it jumps back.
    chirp
        amplitude sin(phase + 2 pi (f0 t + (f1 - f0) t^2/(2 duration))) for 0 <= t <= duration; the frequency goes from
        f0 to f1, and is f0 before and f1 after. ``phase`` is an angle in radians.
    held
        A value that `Simulator` sets from outside; it is constant between two calls. It is ``value`` at the start, and
        during the whole of a run by `simulate`. ``x0`` can replace it. A model lists it in ``discrete``.
    connected
        A signal that a part receives: the model that contains the part gives it an expression (see `Use`).

    Parameters
    ----------
    name : str
        Name of the input in expressions.
    kind : str
        "table", "wave", "chirp", "held" or "connected".
    times, values : sequence of float, optional
        Times and values (k,) of a table.
    interpolation : str, optional
        Interpolation of a table, "linear", "cubic" or "previous".
    shape : str, optional
        Shape of a wave, "square", "sine", "triangle" or "sawtooth".
    amplitude, period, phase, offset, duty, f0, f1, duration, value : str or float, optional
        Expressions of parameters.
    unit : str, optional
        Unit of the values.
    file : str or path, optional
        Path of a CSV file with the times and values of a table, instead of ``times`` and ``values``. It is read at
        once; the input contains the numbers.
    columns : pair of str or int, optional
        Names or indices of the columns of ``file`` with time and value; the first two by default.
    time_unit : str, optional
        Unit of the times of a table, such as "ms". They are converted to seconds, and the input then has ``"s"``. By
        default times have the unit of the model's time.
    place : Place, optional
        Place of the declaration, for error messages.

    Examples
    --------
    >>> import hybridsim as hs
    >>> hs.Input("u", "wave", shape="square", amplitude="A", period=2).expressions["amplitude"]
    Expression(text='A')
    """

    name: str
    kind: str
    times: tuple[float, ...] = ()
    values: tuple[float, ...] = ()
    interpolation: str | None = None
    shape: str | None = None
    amplitude: Expression | None = None
    period: Expression | None = None
    phase: Expression | None = None
    offset: Expression | None = None
    duty: Expression | None = None
    f0: Expression | None = None
    f1: Expression | None = None
    duration: Expression | None = None
    value: Expression | None = None
    unit: str | None = None
    file: str | PathLike[str] | None = None
    columns: Sequence[str | int] | None = None
    time_unit: str | None = None

    def __post_init__(self) -> None:
        self._texts("name", "kind", "interpolation", "shape", "unit", "time_unit")
        if self.file is not None:
            self._read_file()
        elif self.columns is not None:
            raise self._fault("`columns` is set without `file`", "set `file`, the path of a CSV file")
        defaults = dict(_DEFAULTS.get(self.kind, {}))
        if self.shape == "square":
            defaults["duty"] = 0.5
        for name, value in defaults.items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)
        self._expressions("amplitude", "period", "phase", "offset", "duty", "f0", "f1", "duration", "value")
        self._numbers("times", "values")
        if self.time_unit is not None:
            self._convert_times(self.time_unit)
        if self.interpolation == "previous":
            self._write_steps()

    def _convert_times(self, unit: str) -> None:
        times = in_seconds(self.times, unit)
        if times is None:
            raise self._fault(f"`time_unit` cannot be {unit!r}", REMEDY)
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "time_unit", "s")

    def _write_steps(self) -> None:
        """Convert a piecewise constant table to a linear table with jumps; the checks report an invalid table."""
        rises = all(before < after for before, after in pairwise(self.times))
        if rises and len(self.times) == len(self.values) >= 2:
            first, *later = zip(self.times, self.values, strict=True)
            points = [first]
            for time, value in later:
                points += [(time, points[-1][1]), (time, value)]
            times, values = zip(*points, strict=True)
            for name, entry in {"times": times, "values": values, "interpolation": "linear"}.items():
                object.__setattr__(self, name, entry)

    def _read_file(self) -> None:
        """Read the times and values of a table from its file, and store them as numbers in the input."""
        assert self.file is not None
        extra = [name for name in ("times", "values") if getattr(self, name)]
        if self.kind != "table" or extra:
            other_field = f"`{extra[0]}`" if extra else f"the kind '{self.kind}'"
            raise self._fault(
                f"`file` and {other_field} cannot be combined", "use `file` for an input of kind 'table'"
            )
        pair: object = self.columns
        is_pair = isinstance(pair, list | tuple) and len(pair) == 2
        if pair is not None and not (is_pair and all(type(c) in (str, int) for c in self.columns or ())):
            raise self._fault(f"`columns` cannot be {pair!r}", "use two names or indices, [time, value]")
        times, values = read_columns(Path(path_text(self.file)), self.columns)
        for name, entry in {"times": times, "values": values, "file": None, "columns": None}.items():
            object.__setattr__(self, name, entry)

    def as_held(self) -> HeldInput:
        """Convert an input of kind "held" to a `HeldInput`."""
        known = {"place", "name", "kind", *OPTIONAL["held"]}
        extra = [name for name in self.__dataclass_fields__ if name not in known and getattr(self, name)]
        if extra:
            raise self._fault(f"an input of kind 'held' cannot have '{extra[0]}'", f"remove '{extra[0]}'")
        assert self.value is not None and self.unit is not None
        return HeldInput(self.name, self.value, self.unit, place=self.place)

    def not_connected(self, model: str) -> ModelError:
        """Return the error for a run of a model in which nothing is connected to this input."""
        return self.error(
            f"nothing is connected to the input '{self.name}' of model {model}",
            f'use the model as a part of another one, by [use.NAME] with connect = {{ {self.name} = "..." }}, '
            "or replace the input by a parameter",
        )

    @property
    def subject(self) -> str:
        """The name of the input in messages."""
        return f"input {self.name}"

    @property
    def expressions(self) -> dict[str, Expression]:
        """The fields of the input that are expressions of parameters, by name."""
        fields = ("amplitude", "period", "phase", "offset", "duty", "f0", "f1", "duration", "value")
        return {name: getattr(self, name) for name in fields if getattr(self, name) is not None}


@dataclass(frozen=True)
class HeldInput(Discrete):
    """An input of kind "held" in the form that the engine uses: a discrete state that no reset changes.

    Parameters
    ----------
    name : str
        Name of the input.
    start : str or float
        Its initial value.
    unit : str, optional
        Unit, for labels and the check of units.
    place : Place, optional
        Place of the declaration, for error messages.
    """


def held_as_discrete(
    inputs: tuple[Input, ...], discrete: tuple[Discrete, ...]
) -> dict[str, tuple[Declared, ...]]:
    """Return inputs and discrete states as the engine computes them; inputs of kind "held" become discrete states."""
    held = tuple(declared.as_held() for declared in inputs if declared.kind == "held")
    return {"inputs": tuple(i for i in inputs if i.kind != "held"), "discrete": (*discrete, *held)}
