"""The ratios that the engine aims at, from the lines of one run."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from rivals.race import Line, Times

Found = Mapping[str, Sequence[Line]]
_BOUND = 1e-11
EQUAL_ERROR = "SciPy restarted over `dop853`, equal error"
_LINEAR, _SMOOTH = ("P1", "P2", "two-masses"), ("P1", "P2", "belt", "stribeck")  # scenes that have an aim


@dataclass(frozen=True)
class Ratio:
    """What is compared on a scene: the least times of both sides in seconds, the ratio of their medians; the aim."""

    what: str
    scene: str
    first: float
    second: float
    of_medians: float
    asked: str
    note: str = ""

    @property
    def value(self) -> float:
        """The second over the first."""
        return self.second / self.first

    def meets(self, value: float) -> bool:
        """Whether a ratio is what is aimed at; without an aim any is."""
        if not self.asked:
            return True
        words, bound = self.asked.rsplit(maxsplit=1)
        if words == "above":
            return value > float(bound)
        return value <= float(bound) if words == "at most" else value >= float(bound)

    @property
    def verdict(self) -> str:
        """Whether the aim is met, by the least times and by the medians."""
        by = (self.meets(self.value), self.meets(self.of_medians))
        if not self.asked:
            return ""
        return {(True, True): "yes", (True, False): "not by medians", (False, True): "by medians alone"}.get(
            by, "**no**"
        )


def ratios(found: Found) -> list[Ratio]:
    """All that can be formed; times are the least, with events alone."""
    result: list[Ratio] = []
    for scene, lines in found.items():
        by = {line.method.name: line for line in lines}
        exact, limit, heyoka = by.get("exact"), by.get("closed-form"), by.get("heyoka@1e-12")
        if exact and limit and limit.events and exact.events:
            first, second = limit.events.least, _inside(exact)
            middle = statistics.median(exact.events.inside) / limit.events.middle
            aim = "at most 5" if scene in _LINEAR else ""
            result.append(
                Ratio("kernel of `exact` over the closed form by hand", scene, first, second, middle, aim)
            )
        if exact and exact.events and heyoka and heyoka.events:
            aim = "at least 4" if scene in _LINEAR else ""
            result.append(Ratio("heyoka over `exact` in all", scene, *_times(exact, heyoka), aim))
        tight, rival = _cheapest(lines, "taylor@"), _cheapest(lines, "heyoka@")
        if tight and tight.events and rival and rival.events:
            note = f"{tight.method.label} ({tight.errors.states:.0e}), {rival.method.label} ({rival.errors.states:.0e})"
            result.append(
                Ratio(
                    "heyoka over `taylor`, error at most 1e-11",
                    scene,
                    *_times(tight, rival),
                    "above 1" if scene in _SMOOTH else "",
                    note,
                )
            )
        dop853 = by.get("dop853@1e-09")
        scans = [line for line in lines if line.method.name.startswith("scipy@") and line.errors.right]
        if dop853 and dop853.events and len(scans) > 1:
            seconds, note = _at_error(scans, dop853.errors.states, lambda times: times.least)
            middle, _ = _at_error(scans, dop853.errors.states, lambda times: times.middle)
            result.append(
                Ratio(
                    EQUAL_ERROR,
                    scene,
                    dop853.events.least,
                    seconds,
                    middle / dop853.events.middle,
                    "at least 100",
                    note,
                )
            )
        tsit5, diffrax = by.get("tsit5@1e-06"), by.get("diffrax@1e-06")
        if tsit5 and tsit5.events and diffrax and diffrax.events:
            note = f"errors {diffrax.errors.states:.0e}, {tsit5.errors.states:.0e}"
            note += "" if diffrax.errors.right else "; events of diffrax wrong"
            result.append(
                Ratio(
                    "diffrax over `tsit5`, both at 1e-6",
                    scene,
                    *_times(tsit5, diffrax),
                    "above 1",
                    note,
                )
            )
    return sorted(result, key=lambda ratio: ratio.what)


def _times(first: Line, second: Line) -> tuple[float, float, float]:
    """The least times of both, and the ratio of the medians."""
    assert first.events is not None and second.events is not None
    return first.events.least, second.events.least, second.events.middle / first.events.middle


def _inside(line: Line) -> float:
    assert line.events is not None
    return min(line.events.inside)


def _cheapest(lines: Sequence[Line], begins: str) -> Line | None:
    """The cheapest of a method's settings whose events are right and whose error is within the bound."""
    good = [
        line
        for line in lines
        if line.method.name.startswith(begins)
        and line.events
        and line.errors.right
        and line.errors.states <= _BOUND
    ]
    return min(good, key=lambda line: line.events.least if line.events else math.inf, default=None)


def _at_error(lines: Sequence[Line], error: float, time: Callable[[Times], float]) -> tuple[float, str]:
    """Seconds at an error: between two settings, or beyond the last two, on a straight line in logarithms."""
    points = sorted(
        (math.log(line.errors.states), math.log(time(line.events))) for line in lines if line.events
    )
    at = math.log(error)
    k = max(0, min(sum(x < at for x, _ in points) - 1, len(points) - 2))
    (x0, y0), (x1, y1) = points[k], points[k + 1]
    note = f"at an error of {error:.0e}" + ("" if x0 <= at <= points[-1][0] else ", extrapolated")
    return math.exp(y0 + (y1 - y0) * (at - x0) / (x1 - x0)), note
