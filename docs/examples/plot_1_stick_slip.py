"""
A block that sticks and slips
=============================

A block on a table is pulled over a spring whose far end moves at a constant speed. Friction at rest
is higher than in motion, so the block moves in jerks: it holds until the spring pulls with ``mu_s m
g``, and each hold lasts ``2 (mu_s - mu_k) m g/(k V)``.
"""

import hybridsim as hs
from hybridsim import plot

block = hs.Model(
    "jerky-block",
    parameters={"m": 1.0, "k": 100.0, "V": 0.02, "mu_s": 0.4, "mu_k": 0.3},
    states=[
        hs.State("stretch", 0, "V - v", unit="m"),
        hs.State("v", 0, "(k*stretch - f)/m", unit="m/s"),
    ],
    contacts=[
        hs.Contact(
            "f",
            velocity="v",
            normal="9.81*m",
            law="static-kinetic",
            arguments={"mu_s": "mu_s", "mu_k": "mu_k"},
        )
    ],
    outputs=[hs.Output("f", "f", unit="N")],
)
sol = hs.simulate(block, (0, 6))

held = [piece.t1 - piece.t0 for piece in sol.modes["f"] if piece.mode == "stick"][1:-1]
print("each hold, s:", [f"{duration:.12f}" for duration in held])
print("expected,  s:", f"{2 * 0.1 * 9.81 / (100 * 0.02):.12f}")

# %%
# The strip below the curves shows the modes; the force follows the spring while the block holds.

plot.save(plot.time_history(sol, ["stretch", "v", "f"]), "stick-slip.png")
