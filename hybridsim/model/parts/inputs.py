"""Known signals: tables over time, periodic waves and chirps, whose jumps and knots are scheduled events."""

from __future__ import annotations

from dataclasses import dataclass

from hybridsim.expr import Expression
from hybridsim.model.parts.declared import Declared

KINDS = ("table", "wave", "chirp")
SHAPES = ("square", "triangle", "sawtooth", "sine")
INTERPOLATIONS = ("linear", "cubic")
# Required fields of each kind (REQUIRED), and fields with defaults (OPTIONAL).
REQUIRED = {"table": ("times", "values"), "wave": ("shape", "period"), "chirp": ("f0", "f1", "duration")}
OPTIONAL = {
    "table": ("interpolation",),
    "wave": ("amplitude", "phase", "offset", "duty"),
    "chirp": ("amplitude", "phase"),
}
_DEFAULTS: dict[str, dict[str, object]] = {
    "table": {"interpolation": "linear"},
    "wave": {"amplitude": 1, "phase": 0, "offset": 0},
    "chirp": {"amplitude": 1, "phase": 0},
}


@dataclass(frozen=True)
class Input(Declared):
    """A named function of time.

    table
        Values at increasing times with linear or natural cubic interpolation, and constant beyond both ends. Two equal
        times make a jump (linear only).
    wave
        offset + amplitude s((t - phase)/period), s of period 1; ``phase`` is a delay in time.
        square: +1 for a fraction below ``duty`` (0.5), else -1; sine: sin(2 pi tau); triangle: 0 at 0, 1 at 1/4, -1 at
        3/4; sawtooth: from -1 rising to 1, where it jumps back.
    chirp
        amplitude sin(phase + 2 pi (f0 t + (f1 - f0) t^2/(2 duration))) for 0 <= t <= duration; the frequency goes from
        f0 to f1, and is f0 before and f1 after. ``phase`` is an angle in radians.

    Parameters
    ----------
    name : str
        Name of the input in expressions.
    kind : str
        "table", "wave" or "chirp".
    times, values : sequence of float, optional
        Times and values (k,) of a table.
    interpolation : str, optional
        Interpolation of a table, "linear" or "cubic".
    shape : str, optional
        Shape of a wave, "square", "sine", "triangle" or "sawtooth".
    amplitude, period, phase, offset, duty, f0, f1, duration : str or float, optional
        Expressions of parameters.
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

    def __post_init__(self) -> None:
        self._texts("name", "kind", "interpolation", "shape")
        defaults = dict(_DEFAULTS.get(self.kind, {}))
        if self.shape == "square":
            defaults["duty"] = 0.5
        for name, value in defaults.items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, value)
        self._expressions("amplitude", "period", "phase", "offset", "duty", "f0", "f1", "duration")
        self._numbers("times", "values")

    @property
    def subject(self) -> str:
        """The name of the input in messages."""
        return f"input {self.name}"

    @property
    def expressions(self) -> dict[str, Expression]:
        """The expressions of parameters by field name."""
        fields = ("amplitude", "period", "phase", "offset", "duty", "f0", "f1", "duration")
        return {name: getattr(self, name) for name in fields if getattr(self, name) is not None}
