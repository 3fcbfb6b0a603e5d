"""Recompute truths.json: the cases whose answer is no formula, in 32 digits by Taylor series.

    python -m conformance.recompute        (in tests/; takes some minutes)

Each system is written out here a second time, mode by mode, from the equations of cases.json; nothing of the
package is used. An event is [t, component, mode that begins]; states are listed by time.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

from reference.arithmetic import multiprecision
from reference.dfcs_closed_form import Oscillator
from reference.hybrid_taylor import Mode, follow
from reference.series import MP, Series, exp, sin_cos, tanh

from conformance.recompute_table import states
from hybridsim.testing.catalogue.sensitivity import GRAZING_FORCE, GRAZING_START
from hybridsim.testing.facts import HERE

NAMES = {1: "slip+", -1: "slip-", 0: "stick"}


def belt(delta: int) -> dict[str, Mode]:
    belt_speed = MP.mpf("0.2")

    def slip(side: int) -> Mode:
        def stop(t: Any, x: Sequence[Any]) -> tuple[str, Sequence[Any]]:
            return ("stick" if abs(x[0]) <= 1 else NAMES[-side]), (x[0], belt_speed)

        return Mode(
            lambda t, x: (x[1], -x[0] - side / (1 + side * delta * (x[1] - belt_speed))),
            {"f": (lambda t, x: side * (x[1] - belt_speed), stop)},
        )

    stick = Mode(
        lambda t, x: (x[1], 0),
        {
            "f": (lambda t, x: 1 - x[0], lambda t, x: ("slip-", (1, x[1]))),
            "f ": (lambda t, x: 1 + x[0], lambda t, x: ("slip+", (-1, x[1]))),
        },
    )
    return {"slip+": slip(1), "slip-": slip(-1), "stick": stick}


def stribeck() -> dict[str, Mode]:
    limit = MP.mpf("15.015")

    def drive(t: Series) -> Series:
        return 25 * sin_cos(t * (MP.pi / 2))[0]

    def slip(side: int) -> Mode:
        def stop(t: Any, x: Sequence[Any]) -> tuple[str, Sequence[Any]]:
            force = 25 * MP.sin(MP.pi / 2 * t)
            return (NAMES[0] if abs(force) <= limit else NAMES[int(MP.sign(force))]), (x[0], 0)

        return Mode(
            lambda t, x: (x[1], drive(t) - x[1] - side * (5 + 10 * exp(-2 * side * x[1]))),
            {"f": (lambda t, x: side * x[1], stop)},
        )

    stick = Mode(
        lambda t, x: (0, 0),
        {
            "f": (lambda t, x: limit - drive(Series([t[0], 1] + [0] * 29)), lambda t, x: ("slip+", x)),
            "f ": (lambda t, x: limit + drive(Series([t[0], 1] + [0] * 29)), lambda t, x: ("slip-", x)),
        },
    )
    return {"slip+": slip(1), "slip-": slip(-1), "stick": stick}


def elastogap() -> dict[str, Mode]:
    """Mode names: free, and side (right, left) with the damper acting, pressing (clipped in) or letting go."""
    modes: dict[str, Mode] = {}
    for name, s in (("right", 1), ("left", -1)):

        def depth(x: Sequence[Series], s: int = s) -> Series:
            return s * x[0] - MP.mpf("0.5")

        def damping(x: Sequence[Series], s: int = s) -> Series:
            return s * x[1] * MP.mpf("1.5")

        def to(mode: str) -> Callable[[Any, Sequence[Any]], tuple[str, Sequence[Any]]]:
            return lambda t, x: (mode, x)

        modes[name] = Mode(
            lambda t, x, s=s, depth=depth, damping=damping: (x[1], -s * (10 * depth(x) + damping(x))),
            {
                "press": (lambda t, x, p=depth, d=damping: 10 * p(x) - d(x), to(f"{name}-press")),
                "release": (lambda t, x, p=depth, d=damping: 10 * p(x) + d(x), to(f"{name}-release")),
            },
        )
        modes[f"{name}-press"] = Mode(
            lambda t, x, s=s, depth=depth: (x[1], -20 * s * depth(x)),
            {
                "act": (lambda t, x, p=depth, d=damping: d(x) - 10 * p(x), to(name)),
                "leave": (lambda t, x, p=depth: p(x), to("free")),
            },
        )
        modes[f"{name}-release"] = Mode(
            lambda t, x: (x[1], 0),
            {
                "leave": (lambda t, x, p=depth: p(x), to("free")),
                "act": (lambda t, x, p=depth, d=damping: -10 * p(x) - d(x), to(name)),
            },
        )
    half = MP.mpf("0.5")
    modes["free"] = Mode(
        lambda t, x: (x[1], 0),
        {
            "right": (lambda t, x: half - x[0], lambda t, x: ("right-press", x)),
            "left": (lambda t, x: half + x[0], lambda t, x: ("left-press", x)),
        },
    )
    return modes


def relay() -> dict[str, Mode]:
    def side(s: int) -> Mode:
        def over(t: Any, x: Sequence[Any]) -> tuple[str, Sequence[Any]]:
            return ("minus" if s > 0 else "plus"), (0, x[1], x[2])

        return Mode(
            lambda t, x: (x[1], x[2], -3 * x[1] - 2 * x[2] - s), {"mode": (lambda t, x: s * x[0], over)}
        )

    return {"plus": side(1), "minus": side(-1)}


def blocks() -> dict[str, Mode]:
    limit = MP.mpf("0.3")

    def load(i: int, q: Sequence[Any], v: Sequence[Any]) -> Any:
        ends = {0: (-q[0], q[1] - q[0]), 1: (q[0] - q[1], q[2] - q[1]), 2: (q[1] - q[2], 0 * q[2])}
        return ends[i][0] + ends[i][1] - v[i]

    def name(sides: Sequence[int]) -> str:
        return ",".join(NAMES[s] for s in sides)

    def mode(sides: tuple[int, int, int]) -> Mode:
        def flow(t: Series, x: Sequence[Series]) -> list[Any]:
            rates = [load(i, x[:3], x[3:]) - sides[i] * limit if sides[i] else 0 for i in range(3)]
            return [*x[3:], *rates]

        def changed(i: int, to: int, stopped: bool) -> Callable[[Any, Sequence[Any]], Any]:
            def then(t: Any, x: Sequence[Any]) -> tuple[str, Sequence[Any]]:
                y = [*x]
                target = to
                if stopped:
                    y[3 + i] = MP.mpf(0)
                    force = load(i, y[:3], y[3:])
                    target = 0 if abs(force) <= limit else int(MP.sign(force))
                return name([*sides[:i], target, *sides[i + 1 :]]), y

            return then

        guards: dict[str, Any] = {}
        for i, side in enumerate(sides):
            if side:
                guards[f"f{i + 1}"] = (lambda t, x, i=i, s=side: s * x[3 + i], changed(i, 0, True))
                continue
            for to in (1, -1):
                label = f"f{i + 1}" + " " * (to < 0)
                guards[label] = (
                    lambda t, x, i=i, to=to: limit - to * load(i, x[:3], x[3:]),
                    changed(i, to, False),
                )
        return Mode(flow, guards)

    return {name(sides): mode(sides) for sides in product((1, 0, -1), repeat=3)}


def stop() -> dict[str, Mode]:
    """impact-oscillator with its swing a ten-thousandth beyond the stop; the force as the scene gives it."""
    zeta2, omega, e = MP.mpf("0.1"), MP.mpf("2.5"), MP.mpf("0.8")

    def hit(t: Any, x: Sequence[Any]) -> tuple[str, Sequence[Any]]:
        return "free", (1, -e * x[1])

    return {
        "free": Mode(
            lambda t, x: (x[1], MP.mpf(GRAZING_FORCE) * sin_cos(t * omega)[1] - zeta2 * x[1] - x[0]),
            {"mode": (lambda t, x: 1 - x[0], hit)},
        )
    }


def micro_slip() -> dict[str, Any]:
    """The closed form of a force a ten-thousandth above the limit, in 30 digits."""
    motion = Oscillator(1, 0, 1, 1, 1, 1 + 1e-4, 0.5, multiprecision(30)).run(0, 40, 0)
    events = [[float(change.t), "f", NAMES[change.mode]] for change in motion.changes]
    times = [2.0, 3.0, 5.0, 9.0, 12.0, 20.0, 30.0, 40.0]
    return {"events": events, "states": [[t, *(float(v) for v in motion.state(t)[:2])] for t in times]}


def vibrating_table() -> dict[str, Any]:
    """First landings and states of the ball on the vibrating table."""
    landings, found = states(1.0, [round(0.025 * n, 3) for n in range(1, 41)])
    return {"events": [[t, "p", "landing"] for t in landings], "states": found}


def truth(
    modes: dict[str, Mode], mode: str, start: Sequence[Any], span: tuple[Any, Any], times: Sequence[float]
) -> dict[str, Any]:
    run = follow(modes, mode, start, *span)
    events = []
    for t, guard, source, target, _ in run.events:
        component = guard.strip() if guard.strip().startswith("f") else "mode"
        if "," in target:
            was, now = source.split(","), target.split(",")
            target = now[next(i for i in range(3) if f"f{i + 1}" == component)]
            assert [a != b for a, b in zip(was, now, strict=True)].count(True) == 1
        events.append([float(t), component, target])
    return {"events": events, "states": [[t, *run.state(t)] for t in times]}


def main() -> None:
    smooth = {"smooth": Mode(lambda t, x: (x[1], (1 - x[0] * x[0]) * x[1] - x[0]))}
    creep = {"smooth": Mode(lambda t, x: (x[1], -x[0] - tanh(1000 * x[1])))}
    fifth = MP.mpf(1) / 5
    truths = {
        "LEINE-3": truth(belt(3), "slip-", (1, fifth), (0, 60), (1, 5, 20, 50, 60)),
        "NOS-codim1": truth(belt(1), "slip-", (MP.mpf("-0.8"), -1), (0, 40), (1, 5, 10, 20, 40)),
        "MSL-stribeck": truth(stribeck(), "stick", (0, 0), (0, 5), (1, 2, 3, 5)),
        "MSL-elastogap": truth(elastogap(), "right", (2, 0), (0, 5), (0.5, 1, 2, 3, 5)),
        "SIC-relayosc": truth(relay(), "plus", (0, 0.6752372371178297, 0), (0, 100), (1, 10, 100)),
        "NOS-blocks0": truth(blocks(), "slip-,slip+,slip+", (-1, 1, -1, -1, 1, 1), (0, 12), (1, 2, 3, 12)),
        "FMI-vdp": truth(smooth, "smooth", (2, 0), (0, 20), (1, 5, 10, 20)),
        "grazing-stop": truth(stop(), "free", GRAZING_START, (0, 15), (1, 2.5, 4, 6, 9, 12, 15)),
        "micro-slip": micro_slip(),
        "vibrating-table": vibrating_table(),
        "TANH-1e-3": truth(creep, "smooth", (MP.mpf("10.5"), 0), (0, 20), (5, 16, 20)),
    }
    (HERE / "truths.json").write_text(json.dumps(truths, indent=1) + "\n")


if __name__ == "__main__":
    main()
