"""How heavy a blade's damper should be: resonant amplitude and work per cycle against its load, in one sweep.

    python docs/studies/blade_damper.py [--loads 33]

Writes docs/studies/blade-damper.md and docs/images/blade-damper.png. The model is models/blade-damper.toml. The
limits of no damper and of a stuck damper have closed forms. The optimum is compared with that of the first harmonic.
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path

import numpy as np
from matplotlib.ticker import LogLocator, NullFormatter
from scipy.optimize import brentq, minimize_scalar

import hybridsim as hs
from hybridsim.plot.shared import style

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "studies" / "blade-damper.md"
PICTURE = ROOT / "docs" / "images" / "blade-damper.png"
FREQUENCIES = np.linspace(960.0, 1130.0, 171)  # rad/s, beyond both resonances, for the curves of response
BRACKET = 990.0, 1110.0  # rad/s, in which the highest point is looked for: the response has one
LIGHTEST, HEAVIEST = 0.01, 1e4  # N
SHOWN = (1.0, 50.0, 157.0, 1000.0, 10000.0)  # N, whose curves of response are drawn
CLOSE = 1e-3  # rad/s to which the resonance is found: of the amplitude, (CLOSE/half width)^2/2 = 1e-7
TOL = 1e-8  # of the steady states


def resonance(model: hs.Model) -> dict[str, float]:
    """Largest amplitude over the frequency, where it is, and the work of friction in a cycle there."""

    def lowered(omega: float) -> float:
        steady = hs.steady_state(model.with_(omega=omega), tol=TOL)
        assert steady.success, (steady.kind, omega)
        return -float(steady.amplitude["x"])

    best = minimize_scalar(lowered, bounds=BRACKET, method="bounded", options={"xatol": CLOSE})
    steady = hs.steady_state(model.with_(omega=best.x), tol=TOL)
    return {"amplitude": steady.amplitude["x"], "omega": best.x, "work": steady.dissipated["f"]}


class Blade:
    """The closed forms: a linear blade at both ends, and the first harmonic in between."""

    def __init__(self, model: hs.Model) -> None:
        values = model.parameter_values()
        self.m, self.k, self.kd, self.mu, self.force = (values[n] for n in ("m", "k_b", "k_d", "mu", "F0"))
        self.c = 2.0 * values["zeta"] * math.sqrt(self.k * self.m)

    def linear_peak(self, stiffness: float) -> float:
        """max over omega of F0/|k - m omega^2 + i c omega|."""
        zeta = self.c / (2.0 * math.sqrt(stiffness * self.m))
        return self.force / (2.0 * zeta * math.sqrt(1.0 - zeta**2) * stiffness)

    def first_harmonic(self, load: float) -> float:
        """Amplitude where x lags the force by a quarter: pi A F0 = pi c omega A^2 + 4 mu N (A - mu N/k_d)."""
        limit = self.mu * load
        stuck = self.linear_peak(self.k + self.kd)
        if stuck <= limit / self.kd:
            return stuck

        def excess(a: float) -> float:
            slips = math.acos(1.0 - 2.0 * limit / (self.kd * a))
            stiffness = self.k + self.kd / math.pi * (slips - 0.5 * math.sin(2.0 * slips))
            lost = math.pi * self.c * math.sqrt(stiffness / self.m) * a**2 + 4.0 * limit * (
                a - limit / self.kd
            )
            return math.pi * a * self.force - lost

        # above: the free blade with the damper as nothing but a loss; below: where the damper begins to slip
        return float(
            brentq(excess, limit / self.kd * (1.0 + 1e-12), 1.1 * self.force / (self.c * 900.0), xtol=1e-18)
        )


def picture(found: hs.Sweep, curves: hs.Sweep, blade: Blade) -> None:
    """Curves of response, the optimum, and the work."""
    loads = found.axes["N"]
    figure = style.figure(style.BROAD, 4.8)
    left, right = figure.subfigures(1, 2, width_ratios=(1.0, 1.05))
    response = left.subplots()
    for i, load in enumerate(SHOWN):
        response.semilogy(
            FREQUENCIES, 1e3 * curves["amplitude.x"][i], color=style.PALETTE[i], label=f"N = {load:g} N"
        )
    response.set(xlabel="frequency of the excitation [rad/s]", ylabel="amplitude of x [mm]")
    response.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    response.yaxis.set_major_formatter("{x:g}")
    response.yaxis.set_minor_formatter(NullFormatter())
    response.legend(
        fontsize=9, ncols=2, loc="lower left", bbox_to_anchor=(0, 1), frameon=False, borderaxespad=0.2
    )
    upper, lower = right.subplots(2, 1, sharex=True)
    fine = np.geomspace(loads[0], loads[-1], 400)
    theory = [1e3 * blade.first_harmonic(load) for load in fine]
    upper.loglog(fine, theory, color=style.PALETTE[1], label="first harmonic")
    upper.loglog(loads, 1e3 * found["amplitude"], "o", ms=4, color=style.PALETTE[0], label="steady state")
    for stiffness, text, at, dash in (
        (blade.k, "no damper", 0.012, ":"),
        (blade.k + blade.kd, "stuck damper", 0.012, "--"),
    ):
        level = 1e3 * blade.linear_peak(stiffness)
        upper.axhline(level, color=style.INK, lw=0.9, ls=dash)
        offset, side = (3, "bottom") if text == "no damper" else (-3, "top")
        upper.annotate(text, (at, level), (0, offset), textcoords="offset points", va=side, fontsize=9)
    upper.set(ylabel="resonant\namplitude [mm]", ylim=(0.3, 14.0))
    upper.legend(fontsize=9, loc="lower left", frameon=False)
    slipping = slips(found, blade)
    lower.loglog(
        loads[slipping],
        loop_area(found, blade)[slipping],
        color=style.PALETTE[2],
        label="$4 \\mu N (A - \\mu N/k_d)$",
    )
    lower.loglog(
        loads[slipping], found["work"][slipping], "o", ms=4, color=style.PALETTE[0], label="integrated"
    )
    lower.set(xlabel="normal load N [N]", ylabel="work of friction\nper cycle [J]")
    lower.legend(fontsize=9, loc="lower center", frameon=False)
    for axes in (response, upper, lower):
        style.dress(axes)
    style.save(figure, PICTURE)


def slips(found: hs.Sweep, blade: Blade) -> np.ndarray:
    """Where the damper slips at resonance: its spring would have to hold more than mu N."""
    return found["amplitude"] > blade.mu * found.axes["N"] / blade.kd * (1.0 + 1e-9)


def loop_area(found: hs.Sweep, blade: Blade) -> np.ndarray:
    """Area of the parallelogram of f over x at the amplitude measured, J."""
    limit = blade.mu * found.axes["N"]
    return 4.0 * limit * np.maximum(found["amplitude"] - limit / blade.kd, 0.0)


def main() -> None:
    """Sweep, check against the closed forms, draw, write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--loads", type=int, default=33, help="how many normal loads")
    count = parser.parse_args().loads
    model = hs.load("blade-damper")
    blade = Blade(model)
    loads = np.sort(
        np.append(np.geomspace(LIGHTEST, HEAVIEST, count), math.pi * blade.force / (2.0 * blade.mu))
    )
    found = hs.sweep(
        model,
        {"N": loads},
        resonance,
        units={"amplitude": "m", "omega": "rad/s", "work": "J"},
        progress=lambda done, total, _: print(f"{done}/{total}", file=sys.stderr, flush=True),
    )
    curves = hs.sweep(model, {"N": SHOWN, "omega": FREQUENCIES}, ["amplitude.x"], tol=TOL)
    assert not found.failed.any() and not curves.failed.any(), (found, curves)
    picture(found, curves, blade)
    PAGE.write_text(page(found, blade), encoding="utf-8")
    print(PAGE)


def page(found: hs.Sweep, blade: Blade) -> str:
    """The page, with its figures."""
    loads, peaks, area = found.axes["N"], found["amplitude"], loop_area(found, blade)
    slipping = slips(found, blade)
    ends = blade.linear_peak(blade.k), blade.linear_peak(blade.k + blade.kd)
    off = peaks[0] / ends[0] - 1.0, peaks[-1] / ends[1] - 1.0
    work = float(np.max(abs(found["work"][slipping] / area[slipping] - 1.0)))
    harmonic = np.array([blade.first_harmonic(load) for load in loads])
    best = int(peaks.argmin())
    formula = int(np.argmin(abs(loads - math.pi * blade.force / (2.0 * blade.mu))))
    rows = "\n".join(
        f"| {loads[i]:.4g} | {found['omega'][i]:.2f} | {1e3 * peaks[i]:.5f} | {1e3 * harmonic[i]:.5f} | "
        f"{found['work'][i] if slipping[i] else 0.0:.4g} |"
        for i in sorted(
            {0, 5, 10, 15, 18, 19, 20, 21, 22, formula, 25, 28, len(loads) - 1} & set(range(len(loads)))
        )
    )
    light = 4.0 * blade.mu * loads[0] / (math.pi * blade.force)
    return f"""# How heavy should a blade's damper be?

Which normal load N makes the damper under the platform of a turbine blade most effective? The best load in this study
is **{loads[best]:.1f} N**, with a resonant amplitude of {
        1e3 * peaks[best]:.4f} mm. Without a damper the resonant amplitude is {
        ends[0] / peaks[best]:.1f} times as
        large as with the best load. With a damper that always sticks, the amplitude is {
        ends[1]
        / peaks[best]:.1f} times as large. With a very small load, the damper dissipates almost nothing. With
        a very large load, the damper sticks, and only makes the blade stiffer.

The model `models/blade-damper.toml` is one mode of the blade with a Jenkins element (Griffin 1980,
[doi:10.1115/1.3230256](https://doi.org/10.1115/1.3230256)). The script `python docs/studies/blade_damper.py` runs
one `hs.sweep` over N. For each load the script finds the largest amplitude over the frequency.

![Response over frequency, resonant amplitude and work per cycle over the load](../images/blade-damper.png)

| N / N | peak at omega / (rad/s) | resonant amplitude / mm | first harmonic / mm | work in a cycle / J |
| --- | --- | --- | --- | --- |
{rows}

## Checks

- **No normal load.** The peak of the blade alone is F0/(c omega_d) = {1e3 * ends[0]:.6f} mm, with omega_d =
  sqrt(k_b/m - (c/2m)^2). At N = {loads[0]:g} N the relative difference of the sweep from this peak is {
        off[0]:.2e}. The
  reason is friction in the damper, which decreases the peak by the relative amount
  4 mu N/(pi F0) = {light:.2e}.
- **Damper that always sticks.** With the stiffness k_b + k_d the peak of the amplitude is {
        1e3 * ends[1]:.6f} mm.
  At N = {loads[-1]:g} N the relative difference of the sweep from this peak is {off[1]:.1e}.
- **Work.** For any motion with the amplitude A and two reversals per period, the loop of the force f over x is a
  parallelogram. The area of this loop is 4 mu N (A - mu N/k_d). At all loads at which the damper slips, the
  integrated work differs from this area by at most {work:.1e}.
- **First harmonic.** Assume x = A cos(theta) at resonance. The forcing then does the work pi F0 A per cycle. The
  damping c and the damper dissipate pi c omega A^2 + 4 mu N (A - mu N/k_d). The work and the losses are equal. For
  c = 0 and with P = mu N, the balance of work and losses gives A = 4 P^2/(k_d (4 P - pi F0)). The smallest amplitude
  is **A = pi F0/k_d** = {1e3 * math.pi * blade.force / blade.kd:.4f} mm at **N = pi F0/(2 mu)** =
  {
        loads[
            formula
        ]:.2f} N, with the stiffness k_b + k_d/2. With the damping c (line in the picture) the smallest
  amplitude is {1e3 * harmonic[formula]:.4f} mm. In the sweep the smallest amplitude is {
        1e3 * peaks[formula]:.4f}
  mm. Below N = pi F0/(4 mu) = {
        loads[formula]
        / 2:.1f} N friction alone cannot limit the resonance. This theory assumes that x is a sine.
        Over all loads its amplitude differs from that of the sweep by up to
        {100 * float(np.max(abs(harmonic / peaks - 1.0))):.2f} %.
"""


if __name__ == "__main__":
    main()
