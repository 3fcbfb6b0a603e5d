"""
A block that sticks and slips
=============================

A spring pulls a block on a table. The far end of the spring moves at the constant speed V. Static friction is higher
than kinetic friction, so that the block moves in jerks. The block sticks until the spring force is ``mu_s m g``. Each
stick after the first lasts ``2 (mu_s - mu_k) m g/(k V)``.
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
# The strip below the curves shows the modes. In stick the friction force equals the spring force.

plot.save(plot.time_history(sol, ["stretch", "v", "f"]), "stick-slip.png")
