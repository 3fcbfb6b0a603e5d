"""This package holds the simpler models of `advise`; each rung states what it drops and when it does not apply."""

from __future__ import annotations

from hybridsim.analysis.rungs.at_rest import AtRest
from hybridsim.analysis.rungs.constant_coefficient import ConstantAtMeanSpeed, ConstantAtRest
from hybridsim.analysis.rungs.equivalent_viscous import EquivalentViscous
from hybridsim.analysis.rungs.no_friction import NoFriction
from hybridsim.analysis.rungs.no_stop import NoStop
from hybridsim.analysis.rungs.one_coefficient import OneCoefficient
from hybridsim.analysis.rungs.regularised import Arctan, Karnopp, Tanh
from hybridsim.analysis.rungs.rung import DoesNotApply, NothingToDrop, Rung, Scene

__all__ = ["LADDER", "DoesNotApply", "NothingToDrop", "Rung", "Scene"]

# From the simplest up: no motion, linear models, a formula, fewer numbers in the law, the law without its
# corner.
LADDER: tuple[Rung, ...] = (
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
