"""Onset of squeal in a brake, by linearisation and by simulation side by side.

    python docs/studies/brake.py

Writes docs/studies/brake.md and docs/images/brake.png. The scene is models/mode-coupling.toml; both are held against
the closed form of its eigenvalues.
"""

from __future__ import annotations

import cmath
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

import hybridsim as hs
from hybridsim.plot.shared import style

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "studies" / "brake.md"
PICTURE = ROOT / "docs" / "images" / "brake.png"
FRICTION = np.round(np.arange(0.60, 0.9001, 0.01), 10)
DAMPING = (0.05, 0.1, 0.2)
SHAKE = 1e-5  # of x, from where sliding is steady: at most a tenth of the belt's speed at the end of WATCHED
WATCHED, STEP = 60.0, 0.1  # over which a small shake is watched, and how often
SETTLED, LOOKED_AT = 3000.0, 100.0  # until a motion has settled, and over which its amplitude is taken
SQUEALING = 0.1  # the damping whose settled motions are looked at
LARGE = 1.0  # a shake well above the amplitude of the stick-slip cycle


def closed_form(mu: float, c: float) -> float:
    """Largest real part of the roots of (lambda^2 + c lambda + 2)^2 = 1 - 4 mu/3."""
    roots = []
    for side in (1, -1):
        s = 2.0 + side * cmath.sqrt(1.0 - 4.0 * mu / 3.0)
        roots += [(-c + sign * cmath.sqrt(c * c - 4.0 * s)) / 2.0 for sign in (1, -1)]
    return max(root.real for root in roots)


def threshold(c: float) -> float:
    """mu at which the largest real part is zero: lambda = i sqrt(2), c sqrt(2) = sqrt(4 mu/3 - 1)."""
    return 0.75 * (1.0 + 2.0 * c * c)


def linearised(mu: float, c: float) -> float:
    """Growth by `hs.linearize` in sliding."""
    found = hs.linearize("mode-coupling", "slip-", params={"mu": mu, "c": c})
    assert found.is_equilibrium and found.admissible
    return found.growth


def simulated(mu: float, c: float) -> float:
    """Growth of a small shake in a run, with nothing but its states at equal steps.

    States at t and t + STEP are linked by one matrix; least squares over the run gives it, its eigenvalues the growth
    (dynamic mode decomposition). The run must not reach stick, or else the shake was not small.
    """
    model = hs.load("mode-coupling").with_(mu=mu, c=c)
    rest = hs.linearize(model, "slip-").x
    sol = hs.simulate(
        model, (0.0, WATCHED), x0=rest + np.array([SHAKE, 0.0, 0.0, 0.0]), rtol=1e-12, atol=1e-12 * SHAKE
    )
    assert sol.success and not sol.events, (mu, c, sol.message)
    states = sol(np.arange(0.0, WATCHED, STEP)) - rest[:, None]
    # each pair of instants counts alike, however small the shake is by then
    scale = np.abs(states).max(axis=0)
    before, after = states[:, :-1] / scale[:-1], states[:, 1:] / scale[:-1]
    step, *_ = np.linalg.lstsq(before.T, after.T, rcond=None)
    return float(np.log(np.abs(np.linalg.eigvals(step)).max()) / STEP)


def amplitude(mu: float, c: float, shake: float) -> float:
    """Half the range of x that is left when all has settled, after a shake."""
    model = hs.load("mode-coupling").with_(mu=mu, c=c)
    rest = hs.linearize(model, "slip-").x
    sol = hs.simulate(
        model, (0.0, SETTLED), x0=rest + np.array([shake, 0.0, 0.0, 0.0]), rtol=1e-9, atol=1e-12
    )
    assert sol.success, sol.message
    x = sol(np.linspace(SETTLED - LOOKED_AT, SETTLED, 4001))[0]
    return float(np.ptp(x)) / 2.0


def onsets(c: float) -> tuple[float, float, float]:
    """mu at which a small shake begins to grow: closed form, linearised, simulated."""
    exact = threshold(c)
    found = [
        brentq(growth, 0.5 * (0.75 + exact), exact + 0.05, args=(c,), xtol=1e-12)
        for growth in (linearised, simulated)
    ]
    return exact, *found


def picture(growth: dict[float, np.ndarray], sizes: dict[float, np.ndarray]) -> None:
    """Growth and settled amplitude over the coefficient of friction."""
    figure = style.figure(style.BROAD, 4.2)
    left, right = figure.subplots(1, 2)
    fine = np.linspace(FRICTION[0], FRICTION[-1], 601)
    for i, c in enumerate(DAMPING):
        colour = style.PALETTE[i]
        left.plot(fine, [closed_form(mu, c) for mu in fine], color=colour, lw=1.2, label=f"c = {c:g}")
        left.plot(FRICTION, growth[c][0], "s", ms=7, mfc="none", color=colour)
        left.plot(FRICTION, growth[c][1], ".", ms=5, color=style.INK)
        left.axvline(threshold(c), color=colour, lw=0.9, ls=":")
    left.plot([], [], "s", ms=7, mfc="none", color=style.GREY, label="linearize")
    left.plot([], [], ".", ms=5, color=style.INK, label="simulation")
    left.axhline(0.0, color=style.INK, lw=0.8)
    left.set(xlabel="coefficient of friction µ", ylabel="growth rate")
    left.legend(
        fontsize=9, loc="lower left", bbox_to_anchor=(0, 1), ncols=3, frameon=False, borderaxespad=0.2
    )
    for shake, marker, colour in ((LARGE, "s", style.PALETTE[1]), (SHAKE, ".", style.PALETTE[0])):
        right.plot(
            FRICTION,
            sizes[shake],
            marker,
            ms=7,
            mfc="none",
            color=colour,
            label=f"x starts {shake:g} away",
        )
    right.axvline(threshold(SQUEALING), color=style.GREY, lw=0.9, ls=":", label="onset, closed form")
    right.set(xlabel="coefficient of friction µ", ylabel=f"final amplitude of x, c = {SQUEALING:g}")
    right.legend(
        fontsize=9, loc="lower left", bbox_to_anchor=(0, 1), ncols=2, frameon=False, borderaxespad=0.2
    )
    for axes in (left, right):
        style.dress(axes)
    style.save(figure, PICTURE)


def page(
    growth: dict[float, np.ndarray],
    onset: dict[float, tuple[float, float, float]],
    sizes: dict[float, np.ndarray],
) -> str:
    """The page, with its figures."""
    rows = []
    for c in DAMPING:
        exact, by_matrix, by_run = onset[c]
        truth = np.array([closed_form(mu, c) for mu in FRICTION])
        apart = [float(abs(measured - truth).max()) for measured in growth[c]]
        rows.append(
            f"| {c:g} | {exact:.6f} | {by_matrix:.9f} ({abs(by_matrix - exact):.0e}) | "
            f"{by_run:.9f} ({abs(by_run - exact):.0e}) | {apart[0]:.0e} | {apart[1]:.0e} |"
        )
    table = "\n".join(rows)
    shown = "\n".join(
        f"| {mu:.2f} | {closed_form(mu, SQUEALING):+.5f} | {growth[SQUEALING][0][i]:+.5f} | "
        f"{growth[SQUEALING][1][i]:+.5f} | {sizes[SHAKE][i]:.4f} | {sizes[LARGE][i]:.4f} |"
        for i, mu in enumerate(FRICTION)
        if i % 3 == 0
    )
    squeals = sizes[SHAKE] > 1e-3
    assert np.array_equal(squeals, sizes[LARGE] > 1e-3)  # what the last sentence says
    return f"""# When does a brake begin to squeal?

At which coefficient of friction does a brake begin to squeal? In this model squeal begins at **mu = (3/4) (1 + 2
c^2)**, where c is the damping. Linearization and simulation both agree with this closed form. Below the onset no
squeal was found, even after a large disturbance.

The model `models/mode-coupling.toml` is the model of Hoffmann, Fischer, Allgaier and Gaul (2002,
[doi:10.1016/S0093-6413(02)00254-9](<https://doi.org/10.1016/S0093-6413(02)00254-9>)). A block pressed on a belt moves
along and across the belt. Friction couples the two motions, because the normal load depends on the motion across the
belt. The coefficient of friction is constant, so the squeal is not caused by friction that decreases with the
speed. The page [Find the onset of squeal](../how-to/squeal.md) treats squeal from friction that decreases with the
speed. The script `python docs/studies/brake.py` finds the onset in three ways:

- **Closed form.** While the block slides, the eigenvalues lambda of the motion satisfy lambda^2 + c lambda + 2 =
  +-sqrt(1 - 4 mu/3). Up to mu = 3/4 both motions decay with the rate c/2. At mu = 3/4 their frequencies are equal.
  For a larger mu one of the motions grows if c is small enough. At the onset of growth, one eigenvalue is i sqrt(2).
- **Linearization.** `hs.linearize` in the mode `slip-` gives the coefficient at which its `growth` is zero.
- **Simulation.** The run starts {SHAKE:g} away from steady sliding, and lasts {WATCHED:g} units of time without an
  event. The script fits a matrix that maps the states at one time to the states {STEP:g} later (dynamic mode
  decomposition, Schmid 2010, [doi:10.1017/S0022112010001217](https://doi.org/10.1017/S0022112010001217)). The largest
  eigenvalue of the matrix gives the growth.

| c | onset, closed form | `linearize` (error) | simulation (error) | error of the growth, `linearize` | simulation |
| --- | --- | --- | --- | --- | --- |
{table}

The last two columns are the largest differences from the closed form between mu = {FRICTION[0]:g} and
{FRICTION[-1]:g}. The differences are largest at mu = 3/4. At mu = 3/4 two eigenvalues are equal. A small error of
the matrix then changes both eigenvalues by the square root of this error.

![Growth of a small disturbance, and the final amplitude, over the coefficient of friction](../images/brake.png)

The next table is for the damping c = {SQUEALING:g}.

| mu | growth, closed form | `linearize` | simulation | final amplitude, disturbance of {SHAKE:g} | of {LARGE:g} |
| --- | --- | --- | --- | --- | --- |
{shown}

The simulation also gives the final motion. At mu = {FRICTION[squeals][0]:.2f} and above, a small disturbance grows
until the block sticks to the belt in every cycle. Just above the onset the final amplitude is already
{sizes[SHAKE][squeals][0]:.2f}. A disturbance of {LARGE:g} is larger than the amplitude of the limit cycle. After
such a disturbance the motion settles to the limit cycle too. Below the onset even this large disturbance causes no
squeal.
"""


def main() -> None:
    """Run everything, draw, write the page."""
    growth = {c: np.array([[g(mu, c) for mu in FRICTION] for g in (linearised, simulated)]) for c in DAMPING}
    onset = {c: onsets(c) for c in DAMPING}
    sizes = {
        shake: np.array([amplitude(mu, SQUEALING, shake) for mu in FRICTION]) for shake in (SHAKE, LARGE)
    }
    picture(growth, sizes)
    PAGE.write_text(page(growth, onset, sizes), encoding="utf-8")
    print(PAGE)


if __name__ == "__main__":
    main()
