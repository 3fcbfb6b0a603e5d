"""What `solve_ivp`'s own event finding gets wrong in the scenes, and by which mechanism."""

from __future__ import annotations

CLOSED = "closed sign test"
ENDS = "only step ends"
BRENT = "Brent's method"
TWO_VALUES = "two values at a step end"
NUMBERS = "no number in a trial"
LONG = "a long run"
DENSE = "a zero of the dense output"

MECHANISMS = {
    CLOSED: "the sign test is closed at both ends of a step: what is zero where a run or a restart begins fires at "
    "once if it is negative, or again zero, at the end of the first step",
    ENDS: "signs are tested at the ends of a step only: of two zeros within one step neither is seen, and what dips "
    "below zero and comes back in a step has not happened",
    BRENT: "its root finder stops with an error after 100 iterations where a zero is of third order",
    TWO_VALUES: "signs are tested on the state at the end of a step and the zero is sought on the dense output, which "
    "differs there by rounding: the root finder stops with an error, finding no change of sign",
    LONG: "no fault of the events: a thousand periods without damping take more steps than there is time for, or lose "
    "more digits than the scene allows",
    DENSE: "a zero is found on the dense output, which is less accurate than the steps: errors stay where it leaves "
    "them",
    NUMBERS: "the step beyond the domain of the model is tried and its Jacobian or its state is no number; the solver "
    "stops or goes astray before the event is looked for",
}

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
