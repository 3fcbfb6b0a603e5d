"""What `solve_ivp`'s own event finding gets wrong in the scenes, and by which mechanism."""

from __future__ import annotations

# The mechanisms, which the index of the atlas explains.
CLOSED = "closed sign test"
ENDS = "only step ends"
BRENT = "Brent's method"
TWO_VALUES = "two values at a step end"
NUMBERS = "no number in a trial"
LONG = "a long run"
DENSE = "a zero of the dense output"

# scene -> mechanism, and where it is another one with some solvers, solver -> mechanism ("" where it is right)
FAILURES: dict[str, tuple[str, dict[str, str]]] = {
    "BALL2D": (CLOSED, {}),
    "SCI-cubic": (ENDS, {"scipy-rk23": "", "scipy-bdf": ""}),
    "cubic-modes": (ENDS, {"scipy-rk23": "", "scipy-bdf": ""}),
    "double-root": (ENDS, {}),
    "HEY-box": (CLOSED, {"scipy-dop853": "", "scipy-rk45": "", "scipy-radau": TWO_VALUES}),
    "box-from-the-side": (CLOSED, {}),
    "flat-guard": (CLOSED, {}),
    "u-and-its-cube": (BRENT, {}),
    "clock-and-guard-at-once": ("", {"scipy-radau": TWO_VALUES}),
    "sliding-circle": ("", {"scipy-lsoda": CLOSED, "scipy-bdf": CLOSED}),
    "two-relays": (ENDS, {"scipy-rk23": "", "scipy-bdf": ""}),
    "graze-hit": (ENDS, {"scipy-rk23": ""}),
    "micro-slip": (ENDS, {}),
    "many-stops": (ENDS, {}),
    "grazing-stop": (ENDS, {"scipy-rk23": ""}),
    "eight-decades": (DENSE, {"scipy-lsoda": ""}),
    "vibrating-table": (CLOSED, {"scipy-bdf": "", "scipy-lsoda": ""}),
    "rubbing-stop": (CLOSED, {}),
    "exchange": (CLOSED, {}),
    "stop-off-zero": ("", {"scipy-bdf": CLOSED, "scipy-lsoda": CLOSED}),
    "moving-floor": ("", {"scipy-bdf": CLOSED, "scipy-lsoda": CLOSED}),
    "stepped-guard": (CLOSED, {}),
    "elastic-floor": (CLOSED, {}),
    "guards-on-speeds": (CLOSED, {}),
    "guards-on-gaps": (CLOSED, {}),
    "starts-at-zeros": (CLOSED, {}),
    "touch-beside-a-sample": (CLOSED, {"scipy-bdf": "", "scipy-lsoda": ""}),
    "elements-of-loops": ("", {"scipy-bdf": CLOSED, "scipy-lsoda": CLOSED}),
    "sizes-of-sizes": ("", {"scipy-radau": TWO_VALUES}),
    "load-that-ends": (CLOSED, {}),
    "monitors-at-stops": (CLOSED, {}),
    "monitors-at-bounces": (CLOSED, {"scipy-bdf": "", "scipy-lsoda": ""}),
    "monitors-of-a-turning-table": (CLOSED, {}),
    "twisting": ("", {"scipy-radau": TWO_VALUES}),
    "long-swing": ("", {"scipy-rk23": LONG, "scipy-radau": LONG, "scipy-bdf": LONG}),
    "TORR": ("", {"scipy-bdf": NUMBERS, "scipy-lsoda": NUMBERS}),
}


def mechanism(integrator: str, scene: str) -> str:
    """Why `solve_ivp` fails in a scene with a solver; empty where it does not."""
    usual, others = FAILURES.get(scene, ("", {}))
    return others.get(integrator, usual)
