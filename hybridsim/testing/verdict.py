"""The verdict on a study, with its reason and the observed order of convergence."""

from __future__ import annotations

import math
import re

from hybridsim.errors import HybridsimError
from hybridsim.testing.clock import Endless
from hybridsim.testing.measuring import ENDED, Measured
from hybridsim.testing.study import Setting, Study, error_faults, within

RIGHT = "right"
WRONG_ANSWER = "wrong answer"
WRONG_SEQUENCE = "wrong mode sequence"
HANG = "hang (bounded)"
REFUSED = "refused"
ERROR = "error"
NOT_RUN = "not run"
LACKS = "lacks"  # only used by `outcome`, which skips scenes beyond an integrator's stated limits; the atlas runs them
VERDICTS = {
    RIGHT: "the event sequence is correct, and at the tightest setting the errors are within the scene's tolerance",
    WRONG_ANSWER: "the run ends without an error, but its numbers are wrong or do not converge",
    WRONG_SEQUENCE: "an event is missed, invented or out of order, or a mode is wrong",
    HANG: "the run exceeds its limit of time or steps",
    REFUSED: "the method reports that it cannot run the scene, with the reason, before the run or when it stops",
    ERROR: "the run ends in an unexpected exception",
    NOT_RUN: "not applicable: no friction to regularize, or too many steps for a method that steps in Python",
}
WRONG = (WRONG_ANSWER, WRONG_SEQUENCE)


def verdict(study: Study) -> tuple[str, str]:
    """Return the verdict, and a sentence about the first error."""
    for setting, run in study.done:
        found, sentence = of_run(run)
        if found != RIGHT:
            return found, f"{setting.text}: {sentence}"
    if study.failure is not None:
        text, error = study.failure
        if isinstance(error, Endless):
            return HANG, f"{text}: {error}"
        found = REFUSED if isinstance(error, HybridsimError) else ERROR
        return found, f"{text}: {one_line(refusal(error))}"
    if within(study.done[-1][1], study.tolerances):
        return RIGHT, ""
    faults = error_faults(study.done, study.tolerances)
    return (WRONG_ANSWER, faults[-1]) if faults else (RIGHT, "")


def of_run(run: Measured) -> tuple[str, str]:
    """Return the verdict on one run and its reason; numeric errors are not considered."""
    # a run that stops early and states the reason does not mislead the user
    silent = WRONG_ANSWER if run.status in ENDED else REFUSED
    if run.ending:
        return (HANG if run.status == "limit" else silent), one_line(run.ending[0])
    if run.sequence:
        return WRONG_SEQUENCE, one_line(run.sequence[0])
    if run.checks:
        return silent, one_line(run.checks[0])
    return RIGHT, ""


def refusal(error: Exception) -> str:
    """Return the text of an error with its remedy; an unexpected exception is called an internal error."""
    if isinstance(error, HybridsimError):
        return "; ".join(part for part in (error.message, error.remedy) if part)
    return f"internal error, please report it: {type(error).__name__}: {error}"


def one_line(text: str) -> str:
    """Return a message on one line, in which paths are shortened to file names."""
    return re.sub(r"\s+", " ", re.sub(r"\S*/([\w.-]+\.toml)", r"\1", text)).strip()


def order(done: tuple[tuple[Setting, Measured], ...]) -> float | None:
    """Return the observed order of convergence at the two finest settings, or None if the order is not visible."""
    if len(done) < 2 or "rtol" in done[-1][0].options:
        return None
    (before, coarse), (setting, fine) = done[-2:]
    if any(run.ending or run.sequence for run in (coarse, fine)):
        return None
    lengths = [_steps(one.text) for one in (before, setting)]
    usable = fine.state_error > setting.excused and coarse.state_error > before.excused
    if not usable or not math.isfinite(coarse.state_error + fine.state_error):
        return None
    return math.log(coarse.state_error / fine.state_error) / math.log(lengths[1] / lengths[0])


def _steps(text: str) -> float:
    return float(text.rpartition("/")[2])
