"""A comparison with everything in it: six lines, wrong modes, failures, errors below the uncertainty."""

from __future__ import annotations

from hybridsim.analysis.compare.comparison import Comparison
from hybridsim.analysis.compare.errors_against_reference import Errors
from hybridsim.analysis.compare.mode_sequence import SequenceVerdict
from hybridsim.analysis.compare.rows import Cost, Row

PERIOD = 0.0148


def comparison() -> Comparison:
    rows = []
    adaptive = {
        "scipy-dop853": (0.9, 0.055),
        "scipy-rk45": (0.6, 0.16),
        "cvode-bdf": (1.4, 0.12),
        "cvode-adams": (1.0, 0.09),
    }
    for name, (base, growth) in adaptive.items():
        for digits in (4, 6, 8, 10, 12):
            error = base * 10.0**-digits
            time = base * 10 ** (growth * (digits - 4))
            errors = Errors(error, error / 2, max(error * PERIOD / 40, 1e-16), SequenceVerdict())
            times = (time * 0.95, time, time * 1.2)
            rows.append(
                Row(
                    name, name, ("rtol", 10.0**-digits), {"rtol": 10.0**-digits}, "finished", errors=errors,
                    cost=Cost(times, 70_000, 60_000, 3_000, repetitions=3),
                )
            )  # fmt: skip
    for label, error, order, sequence in (
        ("rk4-dichotomy", 0.15, 0.1, SequenceVerdict()),
        ("rk4-dichotomy (stick_velocity=zero)", 8e-4, 1.0, SequenceVerdict()),
        ("rk4-sign", 0.04, 0.7, SequenceVerdict(120, 35_000, 80)),
    ):
        for steps in (300, 600, 1200, 2400, 4800):
            size = error * (1200 / steps) ** order
            time = steps / 1200 * 5e-3
            errors = Errors(size, size / 3, size * PERIOD / 20, sequence)
            cost = Cost((time * 0.97, time, time * 1.1), 4 * steps * 100, steps, steps * 100, repetitions=3)
            rows.append(
                Row(
                    label.split()[0], label, ("steps_per_period", steps), {"steps_per_period": steps},
                    "finished", errors=errors, cost=cost,
                )
            )  # fmt: skip
    rows.append(
        Row("other", "third-party", ("rtol", 1e-6), {"rtol": 1e-6}, "refused", "it cannot run backward")
    )
    return Comparison(
        title="dfcs: Single-degree-of-freedom dry friction constrained system",
        t_span=(0.0, 100 * PERIOD),
        period=PERIOD,
        reference="closed form of the forced oscillator with Coulomb friction",
        uncertainty=Errors(3e-13, 4e-14, 4e-16, SequenceVerdict()),
        rows=tuple(rows),
        repeat=3,
        provenance={"hybridsim": "0.1", "python": "3.11", "numpy": "2", "cpus": 2, "model": "dfcs"},
    )
