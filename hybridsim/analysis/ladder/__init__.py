"""This package contains the simplified models of `advise`, each with a statement of the features that it leaves out."""

from __future__ import annotations

from hybridsim.analysis.ladder.at_rest import AtRest
from hybridsim.analysis.ladder.constant_coefficient import ConstantAtMeanSpeed, ConstantAtRest
from hybridsim.analysis.ladder.equivalent_viscous import EquivalentViscous
from hybridsim.analysis.ladder.ladder_step import DoesNotApply, LadderStep, NothingToDrop, Scene
from hybridsim.analysis.ladder.no_friction import NoFriction
from hybridsim.analysis.ladder.no_stop import NoStop
from hybridsim.analysis.ladder.one_coefficient import OneCoefficient
from hybridsim.analysis.ladder.regularised import Arctan, Karnopp, Tanh

__all__ = ["LADDER", "DoesNotApply", "LadderStep", "NothingToDrop", "Scene"]

# From the simplest up: no motion, linear models, a formula, fewer numbers in the law, the law without its
# corner.
LADDER: tuple[LadderStep, ...] = (
    AtRest(),
    NoFriction(),
    EquivalentViscous(),
    NoStop(),
    ConstantAtRest(),
    ConstantAtMeanSpeed(),
    OneCoefficient(),
    Tanh(),
    Arctan(),
    Karnopp(),
)
