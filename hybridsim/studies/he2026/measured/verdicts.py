"""This module defines a claim of a paper, our results for it, and the verdict, in machine-readable form."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any


class Verdict(Enum):
    """The verdict on a claim."""

    REPRODUCED = "reproduced"
    SHAPE = "reproduced in shape only"
    NOT = "not reproduced"
    ARTEFACT = "an artefact of discretization"

    def __str__(self) -> str:
        return self.value


@dataclass(frozen=True)
class Claim:
    """One claim and its verdict.

    Parameters
    ----------
    name : short and unique, such as "figure 10".
    figure : the figures of the paper that it is read from.
    claim : its text.
    paper : the paper's own numbers.
    ours : our numbers for every variant that the paper leaves open.
    closest : the variant that is nearest to the paper.
    exact : the exact counterpart.
    why : the reason for the verdict.
    step_study : for an artefact of discretization, the effect of the step on it.
    """

    name: str
    figure: str
    claim: str
    paper: Mapping[str, Any]
    ours: Mapping[str, Mapping[str, Any]]
    closest: str
    exact: Mapping[str, Any]
    verdict: Verdict
    why: str
    step_study: Mapping[str, Any] = field(default_factory=dict)

    def to_plain(self) -> dict[str, Any]:
        """Return the claim as plain values for JSON."""
        plain = {name: getattr(self, name) for name in self.__dataclass_fields__}
        plain["verdict"] = str(self.verdict)
        if not self.step_study:
            del plain["step_study"]
        return plain
