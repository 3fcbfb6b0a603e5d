"""
A slider over a parameter
=========================

A run of this oscillator takes less than a millisecond. A notebook can therefore simulate it again at every move of a
slider. The slider needs the package ``ipywidgets``. Without this package, the script draws one picture. The block is
released 1 m from the end of its spring. Each half swing takes ``pi`` seconds and reduces the amplitude by ``2 mu g``
(m = k = 1), until the spring cannot overcome friction.
"""

import hybridsim as hs

block = hs.Model(
    "decaying-block",
    parameters={"mu": 0.01},
    states=[hs.State("x", 1.0, "v", unit="m"), hs.State("v", 0.0, "-x - f", unit="m/s")],
    contacts=[hs.Contact("f", velocity="v", normal=9.81, law="coulomb", arguments={"mu": "mu"})],
)


def show(mu=0.01):
    """Simulate the block with one coefficient of friction, and draw it; a notebook shows the picture."""
    sol = hs.simulate(block, (0, 30), params={"mu": mu})
    return sol.plot("x", "f")


sol = hs.simulate(block, (0, 30))
turns = [abs(event.x_plus[0]) for event in sol.events[:3]]
print("turning points, m:", [f"{turn:.6f}" for turn in turns])
print("expected,       m:", [f"{1 - 2 * k * 0.01 * 9.81:.6f}" for k in range(1, len(turns) + 1)])

# %%
# In a notebook this cell shows the slider above the picture.

try:
    from ipywidgets import FloatSlider, interact
except ImportError:
    hs.plot.save(show(), "slider.png")
else:
    interact(show, mu=FloatSlider(value=0.01, min=0.002, max=0.1, step=0.002, readout_format=".3f"))
