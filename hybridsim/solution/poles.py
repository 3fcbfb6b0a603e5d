"""A run across the zero of a denominator is pointed out: what follows a pole, or a 0/0, has no meaning."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hybridsim.model.denominators import denominators

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hybridsim.engine.trajectory import Trajectory
    from hybridsim.model.model import Model

_LOOKS = 64  # at states of a run: a denominator that passes zero seldom comes back between two of them


def poles_passed(model: Model, trajectory: Trajectory) -> Iterator[str]:
    """A sentence for each denominator of a rate that has changed its sign in a run."""
    every = denominators(model)
    segments = trajectory.segments if every else ()
    count = sum(len(segment.s) for segment in segments)
    if count < 2:
        return
    names = [state.name for state in model.states]
    parameters = model.parameter_values()
    stride = max(count // _LOOKS, 1)
    times, states = [], []
    for number, segment in enumerate(segments):
        last = len(segment.s) - 1
        for k in sorted({*range(0, last + 1, stride), *((last,) if number == len(segments) - 1 else ())}):
            times.append(float(segment.origin.plus(float(segment.s[k]))))
            states.append(segment.x[k])
    for divisor in every:
        signs = np.array(
            [
                divisor.sign({**parameters, "t": t, **dict(zip(names, x.tolist(), strict=True))})
                for t, x in zip(times, states, strict=True)
            ]
        )
        changed = np.flatnonzero(signs[1:] * signs[:-1] < 0)
        if len(changed):
            before, after = times[changed[0]], times[changed[0] + 1]
            yield (
                f"the denominator {divisor.text} in the rate of {divisor.state} passes zero between t = {before:.9g} "
                f"and {after:.9g}: the rate has a pole there or is 0/0, and what follows means nothing; end the run "
                "before by a monitor, or write the rate so that its denominator stays away from zero"
            )
