"""
Why a body on a slope creeps under tanh
=======================================

Friction can hold a block on a slope. The smoothed friction force ``mu N tanh(v/v0)`` is zero at rest. With this force
the block creeps, at the speed ``v0 artanh(tan(alpha)/mu)``.
"""

from math import atanh

import numpy as np
from matplotlib.figure import Figure

import hybridsim as hs
from hybridsim import plot


def block(law: str, **values: float) -> hs.Model:
    """A block on a slope of tan(alpha) = 0.3 under friction with mu = 0.4, pushed a little at the start."""
    return hs.Model(
        law,
        states=[hs.State("x", 0, "v", unit="m"), hs.State("v", 0.5, "9.81*0.3 - f", unit="m/s")],
        contacts=[hs.Contact("f", velocity="v", normal="9.81", law=law, arguments=values | {"mu": 0.4})],
    )


runs = {"set-valued: it sticks": hs.simulate(block("coulomb"), (0, 5))}
for v0 in (1e-2, 3e-3):
    runs[f"tanh, v0 = {v0:g} m/s: it creeps"] = hs.simulate(block("tanh", v0=v0), (0, 5))
    print(
        f"v0 = {v0:g}: speed {runs[f'tanh, v0 = {v0:g} m/s: it creeps'](5.0)[1]:.9f}, "
        f"expected {v0 * atanh(0.3 / 0.4):.9f}"
    )

# %%

figure = Figure(figsize=(7, 4), layout="constrained")
axes = figure.subplots()
t = np.linspace(0, 5, 501)
for (label, sol), colour in zip(runs.items(), ["#000000", "#0072b2", "#d55e00"], strict=True):
    axes.plot(t, sol(t)[0], color=colour, label=label)
axes.set_xlabel("t in s")
axes.set_ylabel("x in m")
axes.legend()
plot.save(axes, "creep.png")
