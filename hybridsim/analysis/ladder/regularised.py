"""This module defines simplified models with a single-valued friction force, such as tanh."""

from __future__ import annotations

from hybridsim.analysis.ladder.ladder_step import DoesNotApply, LadderStep, Scene, need_stick
from hybridsim.errors import HybridsimError
from hybridsim.model import Model

SHARE = 0.01  # of the largest sliding speed; makes the regularised region narrow compared with the motion


class _Regularised(LadderStep):
    """A simplified model whose friction force is smooth for |v| < v0; see `Model.regularized`."""

    def apply(self, scene: Scene) -> Model:
        """Return the model with every contact regularised."""
        need_stick(scene.model)
        v0 = scene.v0
        if v0 is None:
            if not scene.peak:
                raise DoesNotApply(
                    "no contact slips in the motion of the full model, so no sliding speed is known from which "
                    "`v0` can be computed"
                )
            v0 = SHARE * scene.peak
        try:
            return scene.model.regularized(self.name, v0=v0)
        except HybridsimError as error:
            raise DoesNotApply(error.message) from error


class Tanh(_Regularised):
    """The simplified model with f = slip(|v|) tanh(v/v0)."""

    name = "tanh"
    title = "regularised, tanh(v/v0)"
    drops = "stick: under a load the body creeps at a speed of the order of v0"


class Arctan(_Regularised):
    """The simplified model with f = slip(|v|) (2/pi) atan(v/v0)."""

    name = "arctan"
    title = "regularised, (2/pi) atan(v/v0)"
    drops = "stick, and the full friction force, which is only approached at high speed"


class Karnopp(_Regularised):
    """The simplified model in which a body with |v| < v0 is stopped."""

    name = "karnopp"
    title = "Karnopp's dead band |v| < v0"
    drops = "slow sliding: below v0 the body is stopped"
