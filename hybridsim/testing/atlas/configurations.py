"""The methods of the atlas: every integrator, and other common methods, each with its own settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import hybridsim as hs
from hybridsim.errors import UsageError, nearest
from hybridsim.integrators.contract import Integrator
from hybridsim.testing import measuring
from hybridsim.testing.atlas.cooldown import CooldownRK45
from hybridsim.testing.scene import Scene
from hybridsim.testing.study import (
    CUT_SHORT,
    NOT_LOCATED,
    STEPS,
    Setting,
    allowed_errors,
    fixed_step,
    integrator,
    settings_for,
)

# Regularised forms: widths in units of the scene's speed, and steps per unit of time. Both decrease together, so that
# an explicit method stays stable if the friction force is of the order of mass * speed / unit.
WIDTHS = (1e-2, 1e-3, 1e-4)
FINE_STEPS = (1200, 12_000, 120_000)
MOST_STEPS = 2e6  # largest number of steps per run of these forms
# Length of the cooldown in units of the scene's time, at a tolerance at which other errors are negligible.
COOLDOWNS, RTOL = (1e-2, 1e-3, 1e-4), 1e-9
RIVALS: dict[str, type[Integrator]] = {
    CooldownRK45.name: CooldownRK45
}  # methods that are not registered as integrators


@dataclass(frozen=True)
class Configuration:
    """A method of the atlas: an integrator with its options, and the settings of its runs.

    Parameters
    ----------
    name, title : name in the matrix, and description.
    integrator : the name of a registered integrator.
    kind : "best" for the best settings of the integrator; "published" for its defaults with three step sizes; "native"
        for SciPy's own event handling; "cooldown"; or the form of `Model.regularized` to run.
    """

    name: str
    title: str
    integrator: str
    kind: str = "best"
    options: Mapping[str, Any] = field(default_factory=dict)

    @property
    def method(self) -> type[Integrator]:
        """The class of the integrator."""
        return RIVALS.get(self.integrator) or integrator(self.integrator)

    @property
    def is_compiled(self) -> bool:
        """Whether long runs are cheap, because the loop over the steps is compiled."""
        return self.method.has_compiled_loop or self.method.start is Integrator.start

    @property
    def form(self) -> str:
        """The name of the regularized form, or an empty string."""
        return self.kind if self.kind in ("tanh", "karnopp") else ""

    def settings(self, scene: Scene) -> tuple[Setting, ...]:
        """Return the runs of the study, from loose to tight."""
        if self.kind == "published":
            return tuple(
                fixed_step(steps, {"steps_per_period": steps, "period": scene.unit}, scene) for steps in STEPS
            )
        if self.kind == "cooldown":
            return tuple(
                Setting(
                    f"cooldown {t:.0e}",
                    {"cooldown": t * scene.unit, "rtol": RTOL},
                    max(RTOL, scene.floor),
                    1.0,
                )
                for t in COOLDOWNS
            )
        if self.form:
            length = abs(scene.span[1] - scene.span[0]) / scene.unit
            return tuple(
                replace(
                    fixed_step(steps, {"step": scene.unit / steps, "v0": width * scene.speed}, scene),
                    text=f"v0 {width:.0e}, unit/{steps}",
                )
                for width, steps in zip(WIDTHS, FINE_STEPS, strict=True)
                if steps * length <= MOST_STEPS
            )
        return settings_for(self.method, scene)

    def tolerances(self, scene: Scene) -> tuple[float, float]:
        """Return the errors of event times and states that are allowed at the tightest setting."""
        if self.kind == "cooldown":
            return max(scene.tol_t, CUT_SHORT * RTOL), max(scene.tol_x, CUT_SHORT * RTOL)
        if self.form:
            return max(scene.tol_t, NOT_LOCATED), max(scene.tol_x, NOT_LOCATED)
        return allowed_errors(self.method, scene)

    def applies(self, scene: Scene) -> str:
        """Return the reason why a test case is not run, or an empty string."""
        if self.form and not measuring.load(scene).contacts:
            return "the model has no friction contact to regularize"
        if self.form and not scene.truth.states:
            return "only the modes of the motion are known, and a regularized contact has no modes"
        if self.form and not self.settings(scene):
            return "too long for its steps"
        return ""


def configurations() -> tuple[Configuration, ...]:
    """Return all methods: the registered integrators at their best settings, and other common methods."""
    found: list[Configuration] = []
    for one in hs.list_integrators():
        if one.name == "rk4-dichotomy":
            found += [
                Configuration(
                    "rk4-dichotomy",
                    "the method as published: 16 bisections, eps_v = 8e-4, velocity not reset in stick",
                    one.name,
                    "published",
                ),
                Configuration(
                    "rk4-dichotomy refined",
                    "the published method with located release, zero velocity in stick and decreasing eps_v",
                    one.name,
                ),
            ]
        else:
            found.append(Configuration(one.name, one.title, one.name))
    for one in hs.list_integrators():
        if one.name.startswith("scipy-"):
            found.append(
                Configuration(
                    f"{one.name} native",
                    f"{one.title} with the events of solve_ivp",
                    one.name,
                    "native",
                    {"events": "native"},
                )
            )
    found.append(Configuration("scipy-rk45 cooldown", CooldownRK45.title, CooldownRK45.name, "cooldown"))
    for form in ("tanh", "karnopp"):
        found.append(
            Configuration(
                f"rk4 {form}",
                f"classic RK4 with {form} friction; step and width decrease together",
                "rk4-sign",
                form,
            )
        )
    return tuple(found)


def chosen(names: tuple[str, ...] | None) -> tuple[Configuration, ...]:
    """Return the methods with the given names, or of the given integrators; without arguments, all methods.

    Regularised forms belong to no integrator and must be named themselves.
    """
    every = configurations()
    if names is None:
        return every
    known = [one.name for one in every]
    for name in names:
        if name not in known:
            raise UsageError(
                f"Unknown integrator {name!r} in the atlas", remedy=nearest(name, known, kind="integrators")
            )
    return tuple(one for one in every if one.name in names or (one.integrator in names and not one.form))
