"""
Two simulators that exchange forces
===================================

A block on a moving belt pulls a second block by a spring. Each block has its own simulator, as in a co-simulation of
two programs. The simulators exchange the force of the spring and the position at communication points, whose distance
in time is H. Between these points both values are constant. The reference is a simulator of the whole model. The error
is of first order in H.
"""

import matplotlib.pyplot as plt
import numpy as np

import hybridsim as hs
from hybridsim import plot

parameters = {"m": 1, "k": 40, "N": 4, "belt": 0.5}
friction = {"law": "coulomb", "arguments": {"mu": 0.3}, "normal": "N"}
spring = "k*(x - y)"

first = hs.Model(
    "on-the-belt",
    parameters=parameters,
    inputs=[hs.Input("y", "held")],
    states=[hs.State("x", 0.5, "v"), hs.State("v", 0, f"(-{spring} - 30*x - f)/m")],
    contacts=[hs.Contact("f", velocity="v - belt", **friction)],
)
second = hs.Model(
    "behind",
    parameters=parameters,
    inputs=[hs.Input("pull", "held", unit="N")],
    states=[hs.State("y", -0.5, "w"), hs.State("w", 0, "(pull - 25*y - g)/m")],
    contacts=[hs.Contact("g", velocity="w", **friction)],
)
whole = hs.Model(
    "whole",
    parameters=parameters,
    states=[
        hs.State("x", 0.5, "v"), hs.State("v", 0, f"(-{spring} - 30*x - f)/m"),
        hs.State("y", -0.5, "w"), hs.State("w", 0, f"({spring} - 25*y - g)/m"),
    ],
    contacts=[hs.Contact("f", velocity="v - belt", **friction), hs.Contact("g", velocity="w", **friction)],
)  # fmt: skip

a, b = hs.Simulator(first, integrator="exact"), hs.Simulator(second, integrator="exact")


def coupled(end, points):
    """The positions at the end, with the exchange at equidistant points; all events of both."""
    events = [*a.start(0.0), *b.start(0.0)]
    for t in np.linspace(0, end, points + 1)[1:]:
        x, y = a.state["x"], b.state["y"]
        events += a.advance(t, {"y": y})
        events += b.advance(t, {"pull": parameters["k"] * (x - y)})
    return np.array([a.state["x"], b.state["y"]]), events


truth = hs.simulate(whole, (0, 1.0), integrator="exact")
expected = np.array([truth.y[0, -1], truth.y[2, -1]])
distances, errors = [], []
for points in (300, 600, 1200, 2400):
    found, events = coupled(1.0, points)
    distances.append(1.0 / points)
    errors.append(np.abs(found - expected).max())
    print(
        f"H = {distances[-1]:.5f}: error {errors[-1]:.2e}, {len(events)} events; the whole has {len(truth.events)}"
    )

# %%
# If H is halved, the error is halved too.

print("ratios", np.round(np.array(errors[:-1]) / errors[1:], 2))

figure, axes = plt.subplots(layout="constrained")
axes.loglog(distances, errors, "o-", label="two simulators")
axes.loglog(distances, errors[-1] * np.array(distances) / distances[-1], "--", label="first order in H")
axes.set(xlabel="H", ylabel="error of the positions at t = 1")
axes.legend()
plot.save(axes, "cosimulation.png")
