"""A claim of a paper, what came of it here, and the verdict, ready for a machine to read."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any


class Verdict(Enum):
    """What became of a claim."""

    REPRODUCED = "reproduced"
    SHAPE = "reproduced in shape only"
    NOT = "not reproduced"
    ARTEFACT = "an artefact of discretisation"

    def __str__(self) -> str:
        return self.value


@dataclass(frozen=True)
class Claim:
    """One claim and its verdict.

    Parameters
    ----------
    name : short and unique, such as "figure 10".
    figure : the figures of the paper that it is read from.
    claim : in words.
    paper : the paper's own figures.
    ours : ours for every variant that the paper leaves open.
    closest : the variant that comes nearest to the paper.
    exact : the exact counterpart.
    why : the verdict in one sentence.
    step_study : where the verdict is an artefact of discretisation, what the step does to it.
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
        """What JSON can hold."""
        plain = {name: getattr(self, name) for name in self.__dataclass_fields__}
        plain["verdict"] = str(self.verdict)
        if not self.step_study:
            del plain["step_study"]
        return plain


def plain(value: Any) -> Any:
    """The same in lists, mappings, numbers of six digits and text; what is no number is None, as JSON has it."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):  # numpy arrays and numbers
        return plain(value.tolist())
    if isinstance(value, float):
        return float(f"{value:.6g}") if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    return [plain(item) for item in value]
