"""This module saves solutions to archive files with model, settings, trajectory and checkpoint.

The file is a zip of NumPy arrays (`numpy.savez`). One of them, the header, is JSON text. Nothing is pickled, so that
reading a file runs no code from it.
"""

from __future__ import annotations

import hashlib
import io
import json
from dataclasses import asdict
from os import PathLike
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from hybridsim import __version__
from hybridsim.calls import refusing
from hybridsim.engine.record.blocks import OccurrenceList
from hybridsim.engine.record.checkpoint import Checkpoint, Pace
from hybridsim.engine.record.counters import Counters
from hybridsim.engine.record.retention import Retention
from hybridsim.engine.record.segments import Occurrence
from hybridsim.engine.record.trajectory import Task, Trajectory
from hybridsim.engine.system.instant import Instant
from hybridsim.engine.system.tolerances import Tolerances
from hybridsim.errors import HybridsimError, UsageError
from hybridsim.files import fields_of, path_text, whole_file
from hybridsim.integrators.registry import make_integrator
from hybridsim.model import Model
from hybridsim.solution.files.archive_checks import check_checkpoint, check_events, check_header, check_task
from hybridsim.solution.files.array_file import open_regular, read_arrays
from hybridsim.solution.model_trajectory import ModelTrajectory
from hybridsim.solution.solution import Solution

if TYPE_CHECKING:
    from hybridsim.engine.record.checkpoint import Checkpoint
    from hybridsim.solution.run import Run
    from hybridsim.solution.solution import Solution

FORMAT, VERSION = "hybridsim solution", 4
_HEADER, _SEAL = "header", "digest"
_REMEDY = "use a file written by sol.save(...)"
_FAULTS = (ValueError, KeyError, TypeError, AttributeError, IndexError, OverflowError, RecursionError)


def save(solution: Solution, path: str | PathLike[str]) -> None:
    """Write a solution to a file; see `Solution.save`."""
    stored = _stored(solution)
    with whole_file(path) as partly, open(partly, "wb") as file:
        np.savez(file, **stored)  # type: ignore[arg-type]  # its keywords are arrays, and one is a flag


def to_bytes(solution: Solution) -> bytes:
    """Return the content of a solution's archive as bytes, for another process."""
    file = io.BytesIO()
    np.savez(file, **_stored(solution))  # type: ignore[arg-type]  # as above
    return file.getvalue()


def of_bytes(stored: bytes) -> Solution:
    """Return the solution from the bytes of its archive."""
    return _read(io.BytesIO(stored), "the solution that another process sent")


def _stored(solution: Solution) -> dict[str, np.ndarray]:
    """Return the arrays of a solution's archive by name."""
    from hybridsim.solution.block_arrays import taken_apart

    run, trajectory = solution._run, solution._of_model.record
    task, counters = run.task, trajectory.counters
    arrays: dict[str, np.ndarray] = {**fields_of(task, "x0", "z0", "discrete"), "atol": task.tolerances.atol}
    if run.grid is not None:
        arrays["grid"] = run.grid
    kinds: list[str] = []
    for kind, parts in taken_apart(trajectory.segments.blocks):
        arrays |= {f"segments/{len(kinds)}/{name}": part for name, part in parts.items()}
        kinds.append(kind)
    occurrences = [o for block in trajectory.hidden or trajectory.occurrences.blocks for o in block]
    arrays["events/instants"] = np.array([o.instant for o in occurrences]).reshape(-1, 2)
    arrays["events/words"] = np.array([o[1:6] for o in occurrences], dtype=str).reshape(-1, 5)
    arrays["events/directions"] = np.array([o.direction for o in occurrences], dtype=np.int64)
    for name in ("x_minus", "x_plus"):
        rows = np.array([getattr(o, name) for o in occurrences], dtype=float)
        arrays[f"events/{name}"] = rows.reshape(len(occurrences), run.system.n)
    checkpoint = trajectory.checkpoint
    header = {
        "format": FORMAT,
        "version": VERSION,
        "hybridsim": __version__,
        "model": run.model.to_toml(),
        "method": {"name": run.method.name, "options": vars(run.method)},
        "span": [task.t0, task.t1],
        "tolerances": fields_of(task.tolerances, "rtol", "max_step", "first_step"),
        "keep": list(task.retention),
        "save": run.save,
        "reason": run.reason,
        "kinds": kinds,
        "hidden": len(occurrences) - len(trajectory.occurrences),
        **fields_of(trajectory, "status", "message", "taken_over", "warnings", "warnings_there"),
        "counters": asdict(counters),
        "cost": list(solution._of_model.cost),
    }
    if checkpoint is not None:
        arrays |= {f"checkpoint/{name}": array for name, array in checkpoint.arrays.items()}
        header["checkpoint"] = {
            "names": list(checkpoint.arrays),
            **fields_of(checkpoint, "instant", "settled", "segments", "occurrences"),
            "paces": list(checkpoint.paces.items()),
        }
    header["arrays"] = list(arrays)
    text = json.dumps(header, default=int)  # NumPy's whole numbers
    seal = np.frombuffer(_digest(text, arrays).encode(), dtype=np.uint8)
    return arrays | {_HEADER: np.frombuffer(text.encode(), dtype=np.uint8), _SEAL: seal}


@refusing
def load_solution(path: str | PathLike[str]) -> Solution:
    """Load a solution that `Solution.save` wrote.

    The events, the modes and the states at the run's own steps are bit for bit those that were saved. So are
    ``resume()`` and the dense output of steps in compiled loops; the dense output of other steps agrees to
    rounding.

    Parameters
    ----------
    path : str or path
        The file.

    Returns
    -------
    Solution
        The solution as it was saved.

    Raises
    ------
    UsageError
        If the file is not a saved solution, is damaged, or was written by a later version.

    Examples
    --------
    >>> import hybridsim as hs
    >>> hs.simulate("dfcs", t_span=(0, 0.1)).save("run.hsol")  # doctest: +SKIP
    >>> hs.load_solution("run.hsol").status  # doctest: +SKIP
    'finished'
    """
    name = path_text(path)
    with open_regular(name, _REMEDY) as file:
        try:
            return _read(file, name)
        except OSError as error:
            raise UsageError(f"{name} cannot be read: {error.strerror or error}", remedy=_REMEDY) from error


def _read(file: IO[bytes], name: str) -> Solution:
    try:
        arrays = read_arrays(file)
        if _HEADER not in arrays:
            raise ValueError("the header is missing")
        text = arrays.pop(_HEADER).tobytes().decode()
        seal = arrays.pop(_SEAL, np.zeros(0)).tobytes().decode()
        header = json.loads(text)
        if not isinstance(header, dict) or header.get("format") != FORMAT:
            raise ValueError("the header does not have the format of a saved solution")
    except (ValueError, RecursionError) as error:
        raise UsageError(f"{name} is not a saved solution: {error}", remedy=_REMEDY) from error
    if header.get("version") != VERSION:
        raise UsageError(
            f"{name} has file version {header.get('version')!r}, written by hybridsim {header.get('hybridsim')}; "
            f"this hybridsim reads version {VERSION}",
            remedy="read the file with the version of hybridsim that wrote it",
        )
    if seal != _digest(text, arrays):
        raise UsageError(f"{name} is damaged: its content does not match its checksum", remedy=_REMEDY)
    try:
        return _put_together(header, arrays)
    except HybridsimError as error:
        raise UsageError(f"{name}: {error.message}", remedy=error.remedy or _REMEDY) from error
    except _FAULTS as error:
        raise UsageError(f"{name} is damaged: {type(error).__name__}: {error}", remedy=_REMEDY) from error


def _put_together(header: dict[str, Any], arrays: dict[str, np.ndarray]) -> Solution:
    from hybridsim.solution.block_arrays import put_together

    check_header(header)
    run = _run(header, arrays)
    trajectory = Trajectory(run.system, run.task.retention)
    stored = ((kind, _below(arrays, f"segments/{k}/")) for k, kind in enumerate(header["kinds"]))
    trajectory.segments.blocks = put_together(run.system, stored)
    events = _below(arrays, "events/")
    check_events(events, header["hidden"], run.system)
    found = OccurrenceList()
    for k, (kind, component, guard, source, target) in enumerate(events["words"].tolist()):
        instant, direction = Instant(*events["instants"][k].tolist()), int(events["directions"][k])
        states = (events["x_minus"][k], events["x_plus"][k])
        found.append(Occurrence(instant, kind, component, guard, source, target, direction, *states))
    shown = OccurrenceList(found[header["hidden"] :])
    trajectory.hidden = [found] if header["hidden"] else []
    trajectory.occurrences.blocks = [shown] if shown else []
    trajectory.counters = Counters(**header["counters"])
    trajectory.status, trajectory.message = header["status"], header["message"]
    taken_over = header.get("taken_over")
    trajectory.taken_over = taken_over and (str(taken_over[0]), float(taken_over[1]))
    trajectory.warnings, trajectory.warnings_there = header["warnings"], header["warnings_there"]
    if "checkpoint" in header:
        noted, span = header["checkpoint"], (run.task.t0, run.task.t1)
        check_checkpoint(noted, _below(arrays, "checkpoint/"), run.system, span)
        trajectory.checkpoint = _checkpoint(noted, arrays)
    return Solution(ModelTrajectory(run, trajectory, *header["cost"]))


def _run(header: dict[str, Any], arrays: dict[str, np.ndarray]) -> Run:
    from hybridsim.engine.system.system_cache import system_of
    from hybridsim.integrators.automatic import successor_of
    from hybridsim.solution.run import Run

    model = Model.from_toml(header["model"])
    system = system_of(model)
    check_task(header, arrays, system)
    tolerances = Tolerances(atol=arrays["atol"], **header["tolerances"])
    (t0, t1), retention = header["span"], Retention(*header["keep"])
    successor = successor_of(header["method"]["name"], system) if header["reason"] else None
    task = Task(
        t0, t1, arrays["x0"], arrays["z0"], tolerances, arrays["discrete"], retention, successor=successor
    )
    method = make_integrator(header["method"]["name"], header["method"]["options"])
    return Run(model, system, method, task, arrays.get("grid"), header["save"], header["reason"])


def _checkpoint(header: dict[str, Any], arrays: dict[str, np.ndarray]) -> Checkpoint:
    paces = {
        c: Pace(
            last and Instant(*last),
            tuple(intervals),
            longest,
            forecast and tuple(forecast),
            steadiest and tuple(steadiest),
        )
        for c, (last, intervals, longest, forecast, steadiest) in header["paces"]
    }
    return Checkpoint(
        Instant(*header["instant"]),
        {name: arrays[f"checkpoint/{name}"] for name in header["names"]},
        header["settled"] and Instant(*header["settled"]),
        paces,
        header["segments"],
        header["occurrences"],
    )


def _digest(text: str, arrays: dict[str, np.ndarray]) -> str:
    """Return a hash of the header and the arrays of an archive."""
    digest = hashlib.sha256(text.encode())
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def _below(arrays: dict[str, np.ndarray], head: str) -> dict[str, np.ndarray]:
    return {name.removeprefix(head): array for name, array in arrays.items() if name.startswith(head)}
