"""
Which integrator is right, and what does it cost?
=================================================

The chart shows the error of each integrator over the time of its run. You can draw it for your own model. The reference
has a tighter tolerance than all these runs. A hollow marker means a wrong mode sequence.
"""

import hybridsim as hs
from hybridsim import plot

comparison = hs.compare(
    hs.load("static-kinetic"),
    t_span=(0, 12),
    integrators=["exact", "taylor", "dop853", "tsit5", "scipy-dop853", "rk4-dichotomy"],
    rtols=[1e-4, 1e-6, 1e-8, 1e-10],
)
print(comparison.table())
plot.save(plot.work_precision(comparison), "comparison.png")
