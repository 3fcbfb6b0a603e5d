"""Random periodic motions whose multipliers have a closed form, for `steady_state`."""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy.linalg

import hybridsim as hs

CLOSE = 1e-6


def of_a_clock(rng: random.Random) -> tuple[str, np.ndarray, float, int]:
    """Linear decays that a clock resets, by a linear map: the model, its multipliers, the period, resets in it."""
    n = rng.choice([1, 2, 2])
    A = -np.diag([rng.randint(3, 20) / 10 for _ in range(n)])
    R = np.diag([rng.randint(-15, 25) / 10 for _ in range(n)])
    if n == 2:
        A[1, 0], R[0, 1], R[1, 0] = (rng.randint(-10, 10) / 10 for _ in range(3))
    period = rng.choice([0.5, 1.0, 2.0])
    offset = rng.choice([0.0, round(rng.uniform(0.1, 0.9) * period, 2)])
    names, shift = "xy"[:n], [rng.randint(-10, 10) / 10 for _ in range(n)]
    rows = [" + ".join(f"{A[i, j]}*{names[j]}" for j in range(n)) + f" + {shift[i]}" for i in range(n)]
    sets = [" + ".join(f"{R[i, j]}*{names[j]}" for j in range(n)) + " + 1" for i in range(n)]
    changes = [i for i in range(n) if i == 0 or rng.random() < 0.7]
    for i in set(range(n)) - set(changes):
        R[i] = np.eye(n)[i]
    reset = ", ".join(f'{names[i]} = "{sets[i]}"' for i in changes)
    states = "\n".join(f'{names[i]} = {{ start = {shift[i]}, der = "{rows[i]}" }}' for i in range(n))
    text = f"schema = 1\nname = 'clocked'\n[states]\n{states}\n"
    text += f"[clocks.c]\nperiod = {period}\noffset = {offset}\nset = {{ {reset} }}\n"
    return text, np.linalg.eigvals(R @ scipy.linalg.expm(A * period)), period, 1


def of_a_guard(rng: random.Random) -> tuple[str, np.ndarray, float, int]:
    """A state that decays to a level and is put back there, and one that only follows, by a linear map."""
    a, b, c = (rng.randint(5, 15) / 10 for _ in range(3))
    high, low, factor = rng.randint(8, 20) / 10, rng.randint(1, 6) / 10, rng.randint(-20, 25) / 10
    period = float(np.log(high / low) / a)
    reset = f'x = "{high}", y = "{factor}*y + {rng.randint(0, 5) / 10}"'
    text = f"schema = 1\nname = 'refilled'\n[states]\nx = {{ start = {high}, der = '-{a}*x' }}\n"
    text += f"y = {{ start = {rng.randint(1, 9) / 10}, der = '{c}*x - {b}*y' }}\n"
    if rng.random() < 0.5:
        text += (
            f"[monitors.m]\nexpr = 'x - {low}'\ndirection = 'down'\naction = 'reset'\nreset = {{ {reset} }}\n"
        )
    else:
        text += "[components.c]\ninitial = 'a'\n[components.c.modes.a]\n"
        text += f"guards.g = {{ expr = 'x - {low}', then = [{{ to = 'a', reset = {{ {reset} }} }}] }}\n"
    return text, np.array([factor * np.exp(-b * period)]), period, 1


def steady_states(number: int) -> Iterator[dict[str, Any]]:
    """The steady state of one random motion that repeats, beside its closed form."""
    rng = random.Random(number * 13 + 3)
    text, multipliers, period, count = rng.choice([of_a_clock, of_a_guard])(rng)
    if np.abs(multipliers).max() > 0.9:  # it grows, or settles too slowly to be waited for
        return
    try:
        found = hs.steady_state(hs.Model.from_toml(text))
        ours = np.asarray(found.multipliers)
        resets = sum(bool((e.x_plus != e.x_minus).any()) for e in found.solution.events)
        if abs(found.period - period) > CLOSE:
            yield {"kind": "differs", "detail": f"period right {period!r} got {found.period!r}"}
        elif not found.stable or len(ours) != len(multipliers) or _apart(ours, multipliers) > CLOSE:
            yield {
                "kind": "differs",
                "detail": f"multipliers right {multipliers} got {ours} ({found.stable})",
            }
        elif resets != count:
            yield {"kind": "differs", "detail": f"events of a period right {count} got {resets}"}
    except hs.HybridsimError as error:
        yield {"kind": "refused", "detail": f"{error}"[:300]}


def _apart(ours: np.ndarray, right: np.ndarray) -> float:
    """How far each of the one is from the nearest of the other."""
    gaps = np.abs(np.asarray(ours, dtype=complex)[:, None] - right[None, :])
    return float(max(gaps.min(axis=0).max(), gaps.min(axis=1).max()))
