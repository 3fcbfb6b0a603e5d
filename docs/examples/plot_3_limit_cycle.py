"""
A limit cycle and how it grows with the belt's speed
====================================================

:func:`hybridsim.steady_state` finds the motion on which a model settles, with derivatives that are
carried through every event; :func:`hybridsim.sweep` does it for many parameters.
"""

import numpy as np

import hybridsim as hs
from hybridsim import plot

belt = hs.load("belt")
cycle = hs.steady_state(belt)
print(cycle.kind, "period", cycle.period, "stable", cycle.stable)
print("share of time in stick:", cycle.stick_fraction["f"])

# %%
# In the plane of displacement and speed the straight piece is stick: the mass goes with the belt.

sol = hs.simulate(belt, (0, 40))
plot.save(plot.phase_portrait(sol, "x", "v"), "orbit.png")

# %%
# Faster belts shorten the period, and the part of it that is spent in stick.

swept = hs.sweep(belt, {"v_belt": np.linspace(0.05, 0.5, 19)}, ["period", "stick_fraction.f"])
plot.save(swept.plot(), "sweep.png")
