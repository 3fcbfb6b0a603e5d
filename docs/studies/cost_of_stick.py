"""Compare the cost of the oscillator with friction and without, by several methods, over 100 periods from rest.

    python docs/studies/cost_of_stick.py [--turns 30] [--out DIR]

Writes docs/studies/cost-of-stick.md (or DIR). Times are processor time of one process, the least of several turns.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import hybridsim as hs

sys.path.insert(0, str(Path(__file__).parent))

from rivals.page import machine, seconds
from rivals.race import Times, take_turns
from rivals.scenes import PERIODS, Scene, scene

ROOT = Path(__file__).parents[2]
SCENES = ("P1", "P2")
STEPS = tuple(300 * 2**i for i in range(9))  # of rk4-sign in a period
BOUND = 0.01  # of the amplitude
JUDGED = 50  # last periods whose amplitudes are judged: the chatter has no period
Run = Callable[[], Any]


def frictionless(here: Scene) -> hs.Model:
    """The same oscillator without its contact."""
    p = here.model.parameter_values()
    return hs.Model(
        "frictionless",
        parameters=[hs.Parameter(name, p[name]) for name in ("m", "c", "k", "F0", "omega")],
        states=[
            hs.State("x", 0, "v", nominal=1e-4),
            hs.State("v", 0, "(F0*sin(omega*t) - c*v - k*x)/m", nominal=1e-1),
        ],
    )


def main() -> None:
    """Measure, and write the page."""
    options = _options()
    runs: dict[tuple[str, str, str], Run] = {}
    for name in SCENES:
        here = scene(name)
        for method, rtol in (("exact", None), ("taylor", 1e-12), ("dop853", 1e-9), ("tsit5", 1e-6)):
            keywords = {"integrator": method, **({} if rtol is None else {"rtol": rtol})}
            models = {"friction": here.model, "free": frictionless(here)}
            for what, model in models.items():
                runs[name, method, what] = _run(model, here, keywords, keep="events")
                runs[name, method, f"{what}, grid"] = _run(model, here, keywords, t_eval=here.grid)
        runs[name, "rk4-dichotomy", "friction"] = _run(here.model, here, {"integrator": "rk4-dichotomy"})
        runs[name, "rk4-sign", "friction"] = _run(here.model, here, {"integrator": "rk4-sign"})
    needed = {name: _needed(scene(name)) for name in SCENES}
    for name in SCENES:
        if needed[name] is not None:
            keywords = {"integrator": "rk4-sign", "steps_per_period": needed[name]}
            runs[name, "rk4-sign", "1 %"] = _run(scene(name).model, scene(name), keywords)
    times = _timed(runs, options.turns)
    text = (Path(__file__).parent / "rivals" / "cost_text.txt").read_text()
    written = text.format(
        machine=machine(),
        exact=_ratios(times),
        published=_published(times, needed),
        judged=JUDGED,
        least=min(_of_states(times)),
        most=max(_of_states(times)),
    )
    (options.out / "studies").mkdir(parents=True, exist_ok=True)
    (options.out / "studies" / "cost-of-stick.md").write_text(written)
    print(written)


def _run(model: hs.Model, here: Scene, keywords: dict[str, Any], **more: Any) -> Run:
    def run() -> Any:
        sol = hs.simulate(model, (0.0, here.end), **keywords, **more)
        assert sol.success, sol.message
        return sol.stats.get("kernel_time", 0.0), sol.y if "t_eval" in more else None

    return run


def _timed(runs: dict[tuple[str, str, str], Run], turns: int) -> dict[tuple[str, str, str], Times]:
    times = {key: Times() for key in runs}
    for run in runs.values():
        run()
    take_turns([(times[key], run, lambda outcome: outcome[0]) for key, run in runs.items()], turns)
    return times


def _amplitudes(here: Scene, keywords: dict[str, Any]) -> np.ndarray:
    """(max - min)/2 of x in each of the last periods, from the points that are there."""
    share = 400
    grid = here.end - here.period * np.arange(JUDGED * share, -1, -1) / share
    sol = hs.simulate(here.model, (0.0, here.end), t_eval=grid, **keywords)
    x = sol.y[0]
    rows = [x[i * share : (i + 1) * share + 1] for i in range(JUDGED)]
    return np.array([(row.max() - row.min()) / 2 for row in rows])


def _needed(here: Scene) -> int | None:
    """The fewest steps per period from which on rk4-sign keeps the bound in all of the last periods."""
    true = float(_amplitudes(here, {"integrator": "exact"})[-1])
    found: int | None = None
    for steps in STEPS:
        apart = np.abs(_amplitudes(here, {"integrator": "rk4-sign", "steps_per_period": steps}) / true - 1)
        print(
            f"{here.name}: rk4-sign, T/{steps}: amplitude off by {apart.min():.1e} to {apart.max():.1e}",
            flush=True,
        )
        if apart.max() > BOUND:
            found = None
        elif found is None:
            found = steps
    return found


def _of_states(times: dict[tuple[str, str, str], Times]) -> list[float]:
    """The ratios of the times with and without friction, for the same states."""
    grids = [key[:2] for key in times if key[2] == "free, grid"]
    return [times[*key, "friction, grid"].least / times[*key, "free, grid"].least for key in grids]


def _ratios(times: dict[tuple[str, str, str], Times]) -> str:
    rows = [
        "| scene | method | result | with friction | without | ratio |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    methods = list(dict.fromkeys(method for _, method, what in times if what == "free"))
    for name in SCENES:
        for method in methods:
            for what, upper, lower in (
                ("the events", "friction", "free"),
                ("2000 states", "friction, grid", "free, grid"),
            ):
                a, b = times[name, method, upper], times[name, method, lower]
                rows.append(_row(name, method, what, a.least, b.least))
                if lower == "free" and any(a.inside) and any(b.inside):
                    rows.append(
                        _row(
                            name,
                            method,
                            "the events, compiled loop alone",
                            min(a.inside),
                            min(b.inside),
                        )
                    )
    return "\n".join(rows)


def _row(name: str, method: str, what: str, upper: float, lower: float) -> str:
    parts = (upper / PERIODS, lower / PERIODS)
    return f"| {name} | {method} | {what} | {seconds(parts[0])} | {seconds(parts[1])} | {upper / lower:.2f} |"


def _published(times: dict[tuple[str, str, str], Times], needed: dict[str, int | None]) -> str:
    rows = [
        "| scene | method | time per period | compared with `rk4-sign`, T/1200 |",
        "| --- | --- | --- | --- |",
    ]
    for name in SCENES:
        base = times[name, "rk4-sign", "friction"].least
        lines = [
            ("`rk4-sign`, T/1200 (no stick)", base),
            ("`rk4-dichotomy`, T/1200", times[name, "rk4-dichotomy", "friction"].least),
        ]
        if needed[name] is None:
            lines.append((f"`rk4-sign`: not within 1 % at T/{STEPS[-1]} either", math.nan))
        else:
            steps = needed[name]
            lines.append((f"`rk4-sign`, T/{steps} (the least for 1 %)", times[name, "rk4-sign", "1 %"].least))
        lines.append(("`exact`", times[name, "exact", "friction"].least))
        for label, value in lines:
            cells = (
                f"{seconds(value / PERIODS)} | {100 * (value / base - 1):+.0f} %"
                if value == value
                else "- | -"
            )
            rows.append(f"| {name} | {label} | {cells} |")
    rows.append("| | the paper, its own methods | - | more than +225 % |")
    return "\n".join(rows)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--turns", type=int, default=30, help="turns of each run")
    parser.add_argument("--out", type=Path, default=ROOT / "docs", help="where studies/ is")
    return parser.parse_args()


if __name__ == "__main__":
    main()
