"""
A relay that slides
===================

A relay on ``s = x + v/2`` drives a mass. If the motion leads to the surface ``s = 0`` from both sides, the state slides
along the surface (Filippov). The relay does not chatter, and the motion on the surface is ``x' = -2 x``.
"""

import math

import hybridsim as hs
from hybridsim import plot

model = hs.Model(
    "relay",
    states=[hs.State("x", 2.0, "v"), hs.State("v", 0.0, "-3*s")],
    surfaces=[hs.SwitchingSurface("s", "x + v/2")],
)
sol = hs.simulate(model, (0, 4))
for piece in sol.modes["s"]:
    print(f"{piece.mode:8s} from t = {piece.t0:.12f}")

# %%
# On the surface the state decays exactly as exp(-2 t).

began = sol.modes["s"][-1].t0
print("x(4) =", sol(4.0)[0], "expected", sol(began)[0] * math.exp(-2 * (4 - began)))
plot.save(plot.phase_portrait(sol, "x", "v"), "relay.png")
