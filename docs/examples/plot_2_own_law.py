"""
A friction law of one's own
===========================

The friction of this law first decreases and then increases with the speed, as ``mu(v) = mu0/(1 + delta |v|) + eta
|v|``. The normal load grows with the displacement. ``slip`` is the magnitude of the force in motion, and ``stick`` is
the limit at rest.
"""

import hybridsim as hs
from hybridsim import plot

law = hs.FrictionLaw(
    "weakening-viscous",
    parameters=["mu0", "delta", "eta"],
    slip="N*(mu0/(1 + delta*abs(v)) + eta*abs(v))",
    stick="mu0*N",
)
values = {"mu0": 0.5, "delta": 4.0, "eta": 0.1}
plot.save(plot.friction_law(law, values, speed=3), "law.png")

# %%
# On a moving belt, a mass on a spring sticks and slips under this law. The velocity of the contact is the velocity of
# the mass relative to the belt. The load of the contact is an expression of the states.

model = hs.Model(
    "mass-on-belt",
    parameters={"V": 0.6},
    states=[hs.State("x", 0, "v", unit="m"), hs.State("v", 0, "-x - f", unit="m/s")],
    contacts=[hs.Contact("f", velocity="v - V", normal="1 + 0.3*x**2", law=law, arguments=values)],
    outputs={"f": "f"},
)
sol = hs.simulate(model, (0, 40))
print(sol.status, "with", sol.message)
plot.save(plot.time_history(sol, ["x", "v", "f"]), "run.png")
