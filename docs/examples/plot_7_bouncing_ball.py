"""
A ball whose bounces accumulate
===============================

A ball dropped from 1 m bounces with a restitution of 0.7. Infinitely many impacts happen before
``sqrt(2 h/g) (1 + e)/(1 - e)``. After this time the contact is closed, and the run continues.
"""

import math

import hybridsim as hs
from hybridsim import plot

ball = hs.Model(
    "ball",
    states=[hs.State("h", 1, "w", unit="m"), hs.State("w", 0, "-9.81 + p", unit="m/s")],
    impacts=[hs.Impact("p", gap="h", restitution=0.7)],
    outputs=[hs.Output("p", "p", unit="N")],
)
sol = hs.simulate(ball, (0, 4))

closed = sol.modes["p"][-1]
print(closed.mode, "from t =", closed.t0)
print("expected         ", math.sqrt(2 / 9.81) * (1 + 0.7) / (1 - 0.7))
plot.save(plot.time_history(sol, ["h", "w", "p"]), "ball.png")
