"""
How little model is enough?
===========================

:func:`hybridsim.advise` compares simpler models with the full model. It names the simplest model that answers a
question within a tolerance. In this example the question is the amplitude of a forced oscillator within 1 %.
"""

import hybridsim as hs
from hybridsim import plot

advice = hs.advise("dfcs", quantity="amplitude.x", tol=0.01, params={"F0": 60.0})
print(advice.table())
plot.save(plot.advice(advice), "advice.png")

# %%
# This picture shows the amplitude and the time in stick over the frequency, for three normal loads.

response = hs.frequency_response("dfcs", [100.0 + 20 * i for i in range(61)], {"N": [20, 40, 60]})
plot.save(response.plot(over="omega"), "response.png")
