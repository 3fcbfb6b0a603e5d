"""
Which integrator is right, and what does it cost?
=================================================

One chart for one's own model: error against time of the run, held against a reference that is
tighter than all of them. Hollow markers have a wrong sequence of modes.
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
