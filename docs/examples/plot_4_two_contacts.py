"""
Two blocks on a belt
====================

Two blocks on a belt are coupled by a spring. After every event both contacts are decided together, and the order of
declaration has no effect. The change of the kinetic and elastic energy equals the work of the contacts, to rounding.
"""

import numpy as np

import hybridsim as hs
from hybridsim import plot

V = 0.3
system = hs.MechanicalSystem(
    M=[1.0, 1.0],
    C=None,
    K=[[2.0, -1.0], [-1.0, 2.0]],
    contacts=[
        hs.MechanicalContact(
            name, {i: 1}, normal=1, base=V, law="static-kinetic", arguments={"mu_s": mu_s, "mu_k": 0.2}
        )
        for i, (name, mu_s) in enumerate([("left", 0.5), ("right", 0.4)])
    ],
    v0=[V, V],
)
sol = hs.simulate(system, (0, 40))
print(sol.status, len(sol.events), "changes of mode")

# %%
# This is the system as an ordinary model, whose runs can be drawn.

sol = hs.simulate(system.to_model(), (0, 40))
plot.save(plot.time_history(sol, ["q1", "q2", "v1", "v2"]), "blocks.png")

# %%
# The work of the contacts is the integral of -f q' over time, by Gauss quadrature between any two events. This work is
# compared with the change of the energy.

nodes, weights = np.polynomial.legendre.leggauss(20)
ends = np.unique([0.0, *(event.t for event in sol.events), 40.0])
middle, half = (ends[1:] + ends[:-1]) / 2, (ends[1:] - ends[:-1]) / 2
t = (middle[:, None] + half[:, None] * nodes).ravel()
state = dict(zip(sol.names, sol(t), strict=True))
power = -sum(sol.output(name, t) * state[v] for name, v in [("left", "v1"), ("right", "v2")])
given = float(np.sum((half[:, None] * weights).ravel() * power))


def energy(y: np.ndarray) -> float:
    """Kinetic, and of the three springs."""
    q1, v1, q2, v2 = y
    return (v1**2 + v2**2 + q1**2 + q2**2 + (q1 - q2) ** 2) / 2


print("given by the contacts:", given)
print("change of the energy: ", energy(sol(40.0)) - energy(sol(0.0)))
