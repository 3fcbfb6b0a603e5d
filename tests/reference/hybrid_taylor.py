"""A hybrid system followed by Taylor series in 32 digits; slow, short, and without any of the package's rules.

A system is a dictionary of modes. A mode is a flow over series, named guards over series (the mode lasts while
they are >= 0) and the mode and state that follow each guard. Decisions are taken with ten digits to spare, so a
quantity below 1e-20 is zero.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from reference.series import MP, Series

ORDER = 30
ZERO = MP.mpf(10) ** -20
DEFECT = MP.mpf(10) ** -25

Flow = Callable[[Series, Sequence[Series]], Sequence[Any]]
Guard = Callable[[Series, Sequence[Series]], Series]
Next = Callable[[Any, Sequence[Any]], tuple[str, Sequence[Any]]]


@dataclass(frozen=True)
class Mode:
    """A flow, and for each guard what follows it."""

    flow: Flow
    guards: Mapping[str, tuple[Guard, Next]] = field(default_factory=dict)


@dataclass(frozen=True)
class Run:
    """Events (t, guard, from, to, state after) and the series pieces (t, step, mode, series)."""

    events: tuple[tuple[Any, str, str, str, tuple[Any, ...]], ...]
    pieces: tuple[tuple[Any, Any, str, tuple[Series, ...]], ...]

    def state(self, t: float) -> tuple[float, ...]:
        """State at t, right-continuous."""
        t0, _, _, series = next(piece for piece in reversed(self.pieces) if piece[0] <= t)
        return tuple(float(s(MP.mpf(t) - t0)) for s in series)


def follow(modes: Mapping[str, Mode], mode: str, start: Sequence[Any], t0: Any, t1: Any) -> Run:
    """Follow the system from `start` at t0 to t1."""
    t, x, events, pieces = MP.mpf(t0), [MP.mpf(value) for value in start], [], []
    while True:
        series, step = expand(modes[mode].flow, t, x, MP.mpf(t1) - t)
        time = Series([t, 1])
        found = [
            (at, name)
            for name, (guard, _) in modes[mode].guards.items()
            if (at := first_negative(guard(time, series), step)) is not None
        ]
        at, name = min(found, default=(step, ""))
        pieces.append((t, at, mode, tuple(series)))
        t, x = t + at, [s(at) for s in series]
        if name:
            source, (mode, x) = mode, modes[mode].guards[name][1](t, x)
            x = [MP.mpf(value) for value in x]
            events.append((t, name, source, mode, tuple(x)))
        elif t >= t1:
            return Run(tuple(events), tuple(pieces))


def expand(flow: Flow, t: Any, x: Sequence[Any], longest: Any) -> tuple[list[Series], Any]:
    """Taylor series of the motion from x at t, and a step at whose end it still satisfies its equation."""
    coefficients = [[value] for value in x]
    for n in range(ORDER):
        rates = flow(Series([t, 1] + [0] * (n - 1) if n else [t]), [Series(c) for c in coefficients])
        for column, rate in zip(coefficients, rates, strict=True):
            value = rate[n] if isinstance(rate, Series) else MP.mpf(rate if n == 0 else 0)
            column.append(value / (n + 1))
    series = [Series(c) for c in coefficients]
    size = max(abs(s[n]) ** (MP.mpf(1) / n) for s in series for n in (ORDER - 1, ORDER))
    step = min(longest, DEFECT ** (MP.mpf(1) / ORDER) / max(size, MP.mpf(10) ** -3))
    while True:
        end = [s(step) for s in series]
        rates = flow(Series([t + step]), [Series([value]) for value in end])
        defects = [
            abs(
                sum(n * s[n] * step ** (n - 1) for n in range(1, ORDER + 1))
                - (r[0] if isinstance(r, Series) else r)
            )
            for s, r in zip(series, rates, strict=True)
        ]
        if max(defects) <= DEFECT * (1 + max(abs(value) for value in end)):
            return series, step
        step = step * MP.mpf("0.7")


def first_negative(guard: Series, step: Any) -> Any | None:
    """First time in [0, step] just after which the guard is negative, or None."""
    sizes = [abs(value) * step**n for n, value in enumerate(guard.c)]
    leading = next((n for n, size in enumerate(sizes) if size > ZERO * max(sizes)), None)
    if leading is None:
        return None
    rest = Series(guard.c[leading:])  # zeros at the start are what led here
    if rest[0] < 0:
        return MP.mpf(0)
    a, points = MP.mpf(0), 200
    for i in range(1, points + 1):
        b = step * i / points
        if rest(b) < 0:
            while b - a > MP.mpf(10) ** -31 * (1 + step):
                middle = (a + b) / 2
                a, b = (middle, b) if rest(middle) >= 0 else (a, middle)
            return b
        a = b
    return None
