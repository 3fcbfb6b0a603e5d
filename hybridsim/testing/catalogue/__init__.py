"""The packaged test cases, by class of trouble."""

from __future__ import annotations

from dataclasses import replace

from hybridsim.testing.catalogue import (
    accumulation,
    coincidences,
    conditions,
    contacts,
    corners,
    curved_gaps,
    elements,
    events,
    impacts,
    instants,
    loads,
    monitors,
    oscillators,
    sensitivity,
    sliding,
    stability,
    starts,
    stiffness,
    stops,
    surface_guards,
    thresholds,
    timed,
)
from hybridsim.testing.scene import Scene
from hybridsim.testing.stories import with_stories

# Models whose rates or guards are not linear in the states: v**2, exp(v), tanh(v/eps), 1/(1 + delta |v|), x*y, ...
NONLINEAR = {
    "belt", "stribeck", "corridor-modes", "circle", "vdp", "tanh", "parachute", "tank", "disc", "powers",
    "drag", "circle-surface", "sliding-circle", "drum", "discs", "sides-of-contacts",
}  # fmt: skip


def _with_linearity(scene: Scene) -> Scene:
    return replace(scene, needs=scene.needs | {"nonlinear"}) if scene.file in NONLINEAR else scene


SCENES: tuple[Scene, ...] = with_stories(
    tuple(
        _with_linearity(scene)
        for part in (
            events,
            timed,
            coincidences,
            instants,
            monitors,
            corners,
            conditions,
            starts,
            oscillators,
            contacts,
            thresholds,
            surface_guards,
            sliding,
            accumulation,
            impacts,
            curved_gaps,
            loads,
            stops,
            stiffness,
            stability,
            sensitivity,
            elements,
        )
        for scene in part.scenes()
    )
)
