"""This module lists the test cases of the comparison suite, and the kind of error that each test case shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Scene:
    """A model with parameters and a time span, and the kind of error that it shows.

    Parameters
    ----------
    name, title : for the table and the chart.
    model : name of a packaged model.
    why : the property of this scene that the others lack.
    params : parameter values that replace the declared ones.
    periods, t_end : length of the run, in periods of the forcing or in the model's unit of time.
    needs : capabilities (keys of `CAPABILITIES`) without which a wrong sequence of modes is expected.
    """

    name: str
    title: str
    model: str
    why: str
    params: Mapping[str, float | str] = field(default_factory=dict)
    periods: float | None = None
    t_end: float | None = None
    needs: tuple[str, ...] = ()


SCENES: tuple[Scene, ...] = (
    Scene(
        "P1",
        "P1: two stops a period",
        "dfcs",
        "The published point (He et al. 2026, Table 1 with F0 = 30 N): the body sticks twice in each period.",
        {"F0": 30, "N": 40, "omega": "0.6*sqrt(k/m)"},
        periods=6,
    ),
    Scene(
        "P2",
        "P2: barely moving",
        "dfcs",
        "The published point with F0 = 22 N: the force exceeds the limit of 20 N by little, so stick fills most of a "
        "period, and a release is a small difference of large forces.",
        {"F0": 22, "N": 40, "omega": "0.64*sqrt(k/m)"},
        periods=6,
    ),
    Scene(
        "no-stop",
        "No stop: velocity crosses zero",
        "dfcs",
        "Forced hard above resonance, the body turns round without a stop: each zero of the velocity is a crossing, "
        "and no stick erases earlier errors.",
        {"F0": 60, "N": 40, "omega": "1.4*sqrt(k/m)"},
        periods=8,
    ),
    Scene(
        "grazing",
        "Near grazing: stops that barely happen",
        "dfcs",
        "At 0.2 of resonance the body swings within each half period, and its velocity comes back to almost zero. In "
        "the closed form it would reach -5.2e-4, -1.0e-4 and -1.2e-5 of its largest value in the first three "
        "half periods after the first, which makes short stops, and turns above +7e-6 in the later ones, which makes "
        "none. The modes are right only if the velocity is accurate to about 1e-5 and both zeros of a pair are "
        "found.",
        {"F0": 62.035, "N": 40, "omega": "0.2*sqrt(k/m)"},
        periods=3,
        needs=("multiple-roots",),
    ),
    Scene(
        "belt",
        "Belt: friction falls with speed",
        "belt",
        "A limit cycle without forcing and with a nonlinear force: one stick and one slip in each cycle.",
        t_end=40.0,
    ),
    Scene(
        "static-kinetic",
        "Pulled slider: the force jumps",
        "static-kinetic",
        "Static friction above kinetic: at each release the acceleration jumps, after a stick that is forty times as "
        "long as the slip.",
        t_end=12.0,
    ),
    Scene(
        "bouncing-ball",
        "Bouncing ball: the state jumps",
        "bouncing-ball",
        "Impacts that follow each other faster and faster, and a rest. Around a jump errors are measured from the "
        "same side of it, and as a distance of the graphs.",
        t_end=2.8,
    ),
    Scene(
        "stribeck",
        "Stribeck law: not linear in slip",
        "dfcs-stribeck",
        "The reference model with friction that falls with speed: no closed form, and a jump at each release.",
        periods=5,
    ),
    Scene(
        "base-isolation",
        "Base-isolated storey, ground motion",
        "base-isolation",
        "Four states under an input with a thousand knots: each knot ends a step, so that long steps are not possible.",
        t_end=3.0,
    ),
)


def scene_names() -> tuple[str, ...]:
    """Return the names of the test cases, in order."""
    return tuple(scene.name for scene in SCENES)
