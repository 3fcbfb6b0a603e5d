"""Compare the orders at which regularized and spring-like laws approach the set-valued law with those of theory.

    python docs/studies/limits_of_laws.py

Writes docs/studies/limits-of-laws.md and docs/images/limits-of-laws.png. The set-valued law is the oscillator's
closed form (tests/reference), which shares no code with the package.
"""

from __future__ import annotations

import math
import sys
import time
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

import hybridsim as hs
from hybridsim.plot.shared import style

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))
from reference.dfcs_closed_form import Motion, Oscillator

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "studies" / "limits-of-laws.md"
PICTURE = ROOT / "docs" / "images" / "limits-of-laws.png"
# e: v0 over the largest speed, mu N/stiffness over the largest displacement
SMALL = 10.0 ** -np.arange(1.0, 5.01, 0.5)
PERIODS, POINTS = 3, 6001
RTOL = 1e-10  # of the runs: their own errors are below those of the laws by a factor of a hundred and more
FITTED = 3  # smallest values, a decade, over which the order is fitted


@dataclass(frozen=True)
class Law:
    """A law that has the set-valued one as its limit, and the order of its error at releases and at reversals."""

    name: str
    says: str
    integrator: str
    at_releases: tuple[float, bool]  # exponent, and whether a logarithm goes with it
    at_reversals: tuple[float, bool]
    is_spring: bool = False


LAWS = (
    Law("karnopp", "stopped in the band abs(v) < v0", "exact", (2.0, False), (1.0, False)),
    Law("tanh", "mu N tanh(v/v0)", "rodas5p", (1.0, True), (1.0, False)),
    Law("arctan", "mu N (2/pi) atan(v/v0)", "rodas5p", (2 / 3, False), (1.0, True)),
    Law("jenkins", "spring k, slider mu N", "exact", (1.0, False), (0.5, False), True),
    Law("dahl", "z' = v - sigma/(mu N) abs(v) z", "dop853", (2 / 3, False), (0.5, False), True),
    Law(
        "lugre",
        "Dahl and the damping sqrt(sigma_0 m) of bristles",
        "dop853",
        (2 / 3, False),
        (0.5, False),
        True,
    ),
)
COLOURS = dict(zip((law.name for law in LAWS), style.PALETTE))
MARKERS = dict(zip((law.name for law in LAWS), style.MARKERS))


class Scene:
    """The reference model with a forcing, from a start, and its motion with the set-valued law."""

    def __init__(self, name: str, says: str, force: float, ratio: float, start: tuple[float, float]) -> None:
        self.name, self.says = name, says
        base = hs.load("dfcs").with_(F0=force)
        values = base.parameter_values()
        omega = ratio * math.sqrt(values["k"] / values["m"])
        states = [hs.State("x", start[0], "v", nominal=1e-4)]
        states.append(hs.State("v", start[1], "(F0*sin(omega*t) - c*v - k*x - f)/m", nominal=0.1))
        self.model = hs.Model("limits", states, base.with_(omega=omega).parameters, contacts=base.contacts)
        self.m, self.limit = values["m"], values["mu"] * values["N"]
        self.end = PERIODS * 2.0 * math.pi / omega
        oscillator = Oscillator(self.m, values["c"], values["k"], self.limit, self.limit, force, omega)
        self.motion: Motion = oscillator.run(0.0, self.end, *start)
        self.t = np.linspace(0.0, self.end, POINTS)
        x, v, mode = np.array([self.motion.state(t) for t in self.t]).T
        self.x, self.largest, self.fastest = x, abs(x).max(), abs(v).max()
        self.sticks = float(np.mean(mode == 0))
        changes = [piece.mode for piece in self.motion.pieces]
        self.releases = sum(a == 0 for a in changes[:-1])
        self.reversals = sum(a * b == -1 for a, b in pairwise(changes))

    def expected(self, law: Law) -> tuple[float, bool]:
        """Order of the error, which is the lowest of the orders of the events that happen."""
        orders = [law.at_releases] * bool(self.releases) + [law.at_reversals] * bool(self.reversals)
        return min(orders, key=lambda order: (order[0], not order[1]))

    def with_law(self, law: Law, small: float) -> hs.Model:
        """The model with another law and a given relative width or deflection."""
        if not law.is_spring:
            return self.model.regularized(law.name, v0=small * self.fastest)
        stiffness = self.limit / (small * self.largest)
        arguments: dict[str, str | float] = {
            "jenkins": {"mu": "mu", "k": stiffness},
            "dahl": {"mu": "mu", "sigma": stiffness},
            "lugre": {
                "mu_s": "mu", "mu_k": "mu", "v_s": 1.0,
                "sigma_0": stiffness, "sigma_1": math.sqrt(stiffness * self.m), "sigma_2": 0.0,
            },
        }[law.name]  # fmt: skip
        nominal = {"F": self.limit} if law.name == "jenkins" else {"z": small * self.largest}
        contact = hs.Contact("f", "v", "N", law.name, arguments, nominal=nominal)
        return hs.Model("limits", self.model.states, self.model.parameters, contacts=[contact])

    def error(self, law: Law, small: float) -> float:
        """Largest difference of the displacement, in units of the largest displacement."""
        rtol = {} if law.integrator == "exact" else {"rtol": RTOL}
        sol = hs.simulate(self.with_law(law, small), (0.0, self.end), integrator=law.integrator, **rtol)
        assert sol.success, (law.name, small, sol.message)
        return float(np.abs(sol(self.t)[0] - self.x).max() / self.largest)


def scenes() -> list[Scene]:
    """One that sticks sometimes, one that sticks most of the time, and one that reverses without stick."""
    turning = hs.steady_state("dfcs", params={"F0": 60, "omega": "1.4*sqrt(k/m)"}).solution
    x, v = (float(value) for value in turning(0.0))
    return [
        Scene("stick and slip", "F0 = 30 N, r = 0.6, from rest", 30.0, 0.6, (0.0, 0.0)),
        Scene("long sticks", "F0 = 24 N, r = 0.2, from rest", 24.0, 0.2, (0.0, 0.0)),
        Scene("no stick", "F0 = 60 N, r = 1.4, its steady motion", 60.0, 1.4, (x, v)),
    ]


def slope(errors: np.ndarray) -> float:
    """Exponent over the smallest values."""
    return float(np.polyfit(np.log(SMALL[-FITTED:]), np.log(errors[-FITTED:]), 1)[0])


def theory(order: tuple[float, bool], errors: np.ndarray) -> np.ndarray:
    """The law of theory through the last error."""
    exponent, has_logarithm = order
    shape = SMALL**exponent * (np.log(1.0 / SMALL) if has_logarithm else 1.0)
    return errors[-1] * shape / shape[-1]


def order_text(order: tuple[float, bool], letter: str = "e") -> str:
    """An order as it is written."""
    power = {2.0: f"{letter}^2", 1.0: letter, 2 / 3: f"{letter}^(2/3)", 0.5: f"{letter}^(1/2)"}[order[0]]
    return f"{power} log(1/{letter})" if order[1] else power


def picture(found: dict[str, dict[str, np.ndarray]], every: list[Scene]) -> None:
    """A panel for each scene."""
    figure = style.figure(style.BROAD, 4.2)
    panels = figure.subplots(1, len(every), sharey=True)
    for panel, scene in zip(panels, every):
        for law in LAWS:
            errors, colour = found[scene.name][law.name], COLOURS[law.name]
            panel.loglog(SMALL, errors, MARKERS[law.name], ms=5, color=colour, label=law.name)
            panel.loglog(SMALL[2:], theory(scene.expected(law), errors)[2:], "-", lw=1.0, color=colour)
        share = f": {100 * scene.sticks:.0f} % of the time in stick" if scene.sticks else ""
        panel.set_title(f"{scene.name}{share}", fontsize=9, loc="left")
        panel.set(xlabel="e")
        style.dress(panel)
    panels[0].set(ylabel="largest error of x / max |x|")
    panels[0].plot([], [], "-", lw=1.0, color=style.INK, label="order of theory, drawn for e up to 1e-2")
    style.put_title(figure, "e is v0/max |v|, or (mu N/stiffness)/max |x|", size=10)
    style.legend_below(figure, panels[0].get_legend_handles_labels()[0])
    style.save(figure, PICTURE)


def main() -> None:
    """Run all, draw, write the page."""
    every = scenes()
    found: dict[str, dict[str, np.ndarray]] = {}
    for scene in every:
        found[scene.name] = {}
        for law in LAWS:
            began = time.perf_counter()
            errors = np.array([scene.error(law, small) for small in SMALL])
            found[scene.name][law.name] = errors
            print(
                f"{scene.name:15s} {law.name:8s} {slope(errors):.3f} of {order_text(scene.expected(law))}, "
                f"{time.perf_counter() - began:.0f} s",
                flush=True,
            )
    picture(found, every)
    PAGE.write_text(page(found, every), encoding="utf-8")
    print(PAGE)


def page(found: dict[str, dict[str, np.ndarray]], every: list[Scene]) -> str:
    """The page, with its figures."""
    rows = []
    for law in LAWS:
        cells = []
        for scene in every:
            errors, order = found[scene.name][law.name], scene.expected(law)
            expected = slope(theory(order, errors))
            cells.append(f"{order_text(order)}: {expected:.2f} | {slope(errors):.2f} | {errors[-1]:.1e}")
        rows.append(f"| `{law.name}` | " + " | ".join(cells) + " |")
    table = "\n".join(rows)
    heads = " | ".join(f"{scene.name}: theory | observed | error at 1e-5" for scene in every)
    about = "\n".join(
        f"| *{scene.name}* | {scene.says} | {100 * scene.sticks:.0f} % | {scene.releases} | {scene.reversals} |"
        for scene in every
    )
    forms = "\n".join(
        f"| `{law.name}` | {law.says} | {order_text(law.at_releases)} | {order_text(law.at_reversals)} |"
        for law in LAWS
    )
    return f"""# Laws with Coulomb's law as their limit

How fast does the motion with a regularized or spring-like friction law approach the motion with Coulomb's law? The
order depends on the law and on the events of the motion. With `karnopp` the error is of order 2 at a release and of
order 1 at a reversal. With the spring-like laws the error is only of order 1/2 at a reversal. The observed orders
agree with theory.

Each law has a small parameter. For a regularized law this parameter is the velocity v0. The friction force changes
its sign at speeds below v0. For a spring-like law the parameter is the inverse of the contact stiffness. The script
`python docs/studies/limits_of_laws.py` runs the oscillator `dfcs` with mu_s = mu_k over {PERIODS} periods. The
script compares the motion with a closed form of the motion with Coulomb's law. There are three scenes:

| scene | forcing and start | time in stick | releases | reversals without stick |
| --- | --- | --- | --- | --- |
{about}

For a regularized law, the relative width e is v0 divided by the largest speed. For a spring-like law, e is the
deflection mu N/stiffness divided by the largest displacement. The error is the largest error of the displacement x
during the run.

![Error over the width of a law, six laws in three scenes](../images/limits-of-laws.png)

The table compares the theoretical order with the order that is observed in the smallest decade of e.

| law | {heads} |
| --- | {" | ".join(["---"] * (3 * len(every)))} |
{table}

## The orders of theory

Two kinds of events cause the error: a release from stick, and a reversal without stick. The larger of the two errors
dominates.

| law | force | release | reversal |
| --- | --- | --- | --- |
{forms}

**Release.** Let s be the time since the applied force exceeded mu N, and let the applied force be mu N + r s. With
Coulomb's law the velocity v of the body with mass m is given by m v = r s^2/2. Let mu N - d be the friction force of
another law. With this other law, the equation of motion is m v' = r s + d. Near s = 0 there is an interval in which
d and r s have the same order of magnitude. The error is the additional velocity at the end of this interval.

- `tanh`: d = 2 mu N exp(-2 v/v0). The velocity v is then of size v0, and the time s is of size v0^(1/2). The
  velocity also has a factor log(1/v0), because d must decrease from mu N to r s.
- `arctan`: d = (2/pi) mu N v0/v. The velocity v is of size s^2, and d is of size s. Therefore s^3 is of size v0,
  and v is of size v0^(2/3).
- `dahl`, `lugre`: d = mu N exp(-sigma x/(mu N)), with the stiffness sigma. The displacement x is then of size
  1/sigma, the time s of size sigma^(-1/3) and the velocity v of size sigma^(-2/3). The damping of the bristles is
  sqrt(sigma_0 m) v d/(mu N), which is smaller than d by a factor of sigma^(-1/6).
- `jenkins`: d = 0 when the force reaches mu N. At each stop the body begins to vibrate on the spring of the
  contact. This vibration causes the error, because its amplitude at the release is of size 1/k.
- `karnopp`: the release is located exactly. At the stop before the release, the body sticks too early by the time
  v0/a, where a is its deceleration. The distance to the true position of the stop is v0^2/(2 a).

**Reversal.** At a reversal the friction force changes by 2 mu N. With Coulomb's law this change is a jump.

- `tanh`, `arctan`, `karnopp`: the change takes the time v0/a, where a is the acceleration. The velocity then has an
  error of size v0. With `arctan` the force approaches its limit slowly, like v0/(a s) after the time s. With
  `arctan` the integral of this difference over s gives an error of size v0 log(1/v0).
- `jenkins`, `dahl`, `lugre`: during the change of the force the body moves by a distance of size 1/stiffness. The
  body starts from rest with a finite acceleration, so this movement takes a time of size stiffness^(-1/2). The error
  of the velocity is also of size stiffness^(-1/2). If a body reverses without stick, a spring-like law is therefore
  a poor model of Coulomb's law.

## References

- Regularizations by a function of the velocity, and their run times: Pennestri et al., Nonlinear Dynamics 83 (2016)
  1785, [doi:10.1007/s11071-015-2485-3](https://doi.org/10.1007/s11071-015-2485-3).
- Convergence of the solutions of regularized equations to Filippov solutions: Filippov, *Differential
  Equations with Discontinuous Righthand Sides* (1988),
  [doi:10.1007/978-94-015-7793-9](https://doi.org/10.1007/978-94-015-7793-9).
- Karnopp's law, [doi:10.1115/1.3140698](https://doi.org/10.1115/1.3140698).
- Dahl's law, [doi:10.2514/3.61511](https://doi.org/10.2514/3.61511).
- LuGre's law, [doi:10.1109/9.376053](https://doi.org/10.1109/9.376053).
"""


if __name__ == "__main__":
    main()
