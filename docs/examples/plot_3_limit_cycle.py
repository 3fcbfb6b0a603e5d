"""
A limit cycle and how it grows with the belt's speed
====================================================

:func:`hybridsim.steady_state` finds the motion to which a model settles. This function uses derivatives that
include the effect of every event. :func:`hybridsim.sweep` finds such motions for many parameter values.
"""

import numpy as np

import hybridsim as hs
from hybridsim import plot

belt = hs.load("belt")
cycle = hs.steady_state(belt)
print(cycle.kind, "period", cycle.period, "stable", cycle.stable)
print("share of time in stick:", cycle.stick_fraction["f"])

# %%
# In the plane of displacement and speed, the straight line is stick. The mass then has the speed of the belt.

sol = hs.simulate(belt, (0, 40))
plot.save(plot.phase_portrait(sol, "x", "v"), "orbit.png")

# %%
# On a faster belt the period is shorter, and the share of stick in the period is smaller.

swept = hs.sweep(belt, {"v_belt": np.linspace(0.05, 0.5, 19)}, ["period", "stick_fraction.f"])
plot.save(swept.plot(), "sweep.png")
