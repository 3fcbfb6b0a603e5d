"""The page of the study: how it was measured, the ratios, a table for each scene."""

from __future__ import annotations

import datetime
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from rivals.race import Line, Times
from rivals.ratios import EQUAL_ERROR, Found, ratios
from rivals.scenes import Scene
from rivals.truth import Errors, Truth

_LIBRARIES = ("numpy", "numba", "scipy", "scikit-sundae", "heyoka", "jax", "diffrax", "casadi", "pathsim")


def page(
    scenes: Mapping[str, Scene], truths: Mapping[str, Truth], found: Found, lacking: Sequence[str], text: str
) -> str:
    """The whole page; `text` has {answer}, {machine}, {missed}, {ratios}, {overhead}, {wrong} and {scenes}."""
    tables = [_scene_table(scenes[name], truths[name], lines) for name, lines in found.items()]
    missing = f" Not installed: {', '.join(lacking)}." if lacking else ""
    return text.format(
        answer=_answer(found),
        machine=machine() + missing,
        ratios=_ratios(found),
        missed=_missed(found),
        wrong=_wrong(found),
        overhead=_overhead(found),
        scenes="\n\n".join(tables),
    )


def machine() -> str:
    """Processor, versions and date."""
    versions = []
    for library in _LIBRARIES:
        try:
            versions.append(f"{library} {version(library)}")
        except PackageNotFoundError:
            continue
    today = datetime.date.today().isoformat()
    with_ = f"{_processor()}, Python {platform.python_version()}, {', '.join(versions)}"
    return f"The runs were made on {today} with {with_}."


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def seconds(value: float) -> str:
    """A time for people."""
    for size, unit in ((1.0, "s"), (1e-3, "ms")):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value * 1e6:.3g} us"


def _cells(times: Times | None) -> str:
    return f"{seconds(times.middle)} | {seconds(times.least)}" if times and times.calls else "- | -"


def _events(errors: Errors) -> str:
    if errors.right is None:
        return "none to judge"
    if errors.right:
        return f"{errors.times:.0e}"
    count = abs(errors.missing or 0)
    return (
        f"**{count} {'missing' if errors.missing and errors.missing > 0 else 'spurious'}**"
        if count
        else "**wrong**"
    )


def _scene_table(scene: Scene, exact: Truth, lines: Sequence[Line]) -> str:
    rows = [
        f"### {scene.title}",
        "",
        f"The scene has {len(exact.t)} events. The reference is a {exact.title}.",
        "",
        "| method | events: median | least | with grid: median | least | first call | states | event times / T |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for line in sorted(lines, key=lambda line: (line.events or line.grid).middle):
        rows.append(
            f"| {line.method.label} | {_cells(line.events)} | {_cells(line.grid)} | {seconds(line.grid.building)} "
            f"| {line.errors.states:.0e} | {_events(line.errors)} |"
        )
    return "\n".join(rows)


def _ratios(found: Found) -> str:
    rows = ["| ratio | aim | scene | times | ratio | of medians | met | |", "| --- " * 8 + "|"]
    for r in ratios(found):
        times = f"{seconds(r.second)} / {seconds(r.first)}"
        cells = (r.what, r.asked, r.scene, times, f"{r.value:.3g}", f"{r.of_medians:.3g}", r.verdict, r.note)
        rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows)


def _answer(found: Found) -> str:
    """A sentence, and the range of each ratio over the scenes."""
    values: dict[str, list[float]] = {}
    for r in ratios(found):
        values.setdefault(r.what, []).append(r.value)
    rows = [f"| {what} | {min(those):.3g} to {max(those):.3g} |" for what, those in values.items()]
    ours = values[EQUAL_ERROR]
    sentence = f"SciPy takes {min(ours):.0f} to {max(ours):.0f} times as long as `dop853` at equal error."
    return "\n".join([sentence, "", "| ratio of run times | over the scenes |", "| --- | --- |", *rows])


def _missed(found: Found) -> str:
    """A sentence on the aims that are not met."""
    with_aim = [r for r in ratios(found) if r.asked]
    missed = [f"{r.what} on {r.scene} ({r.verdict.strip('*')})" for r in with_aim if r.verdict != "yes"]
    if not missed:
        of_all = f"All {len(with_aim)} aims are" if len(with_aim) > 1 else "The aim is"
        return f"{of_all} met in this run, by the shortest times and by the medians."
    return f"Of {len(with_aim)} aims {len(missed)} are not met in every way. They are {', '.join(missed)}."


def _wrong(found: Found) -> str:
    rows = []
    for name, lines in found.items():
        for line in lines:
            if line.errors.right is False:
                rows.append(
                    f"| {name} | {line.method.label} | {_events(line.errors)} | {line.errors.states:.0e} |"
                )
    head = ["| scene | method | events | states, last period |", "| --- | --- | --- | --- |"]
    return "\n".join([*head, *rows]) if rows else "None."


def _overhead(found: Found) -> str:
    rows = [
        "| scene | integrator | in all | compiled loop | rest |",
        "| --- | --- | --- | --- | --- |",
    ]
    for name, lines in found.items():
        for line in lines:
            times = line.events
            if (
                line.method.family != "ours"
                or not line.method.shown
                or times is None
                or not any(times.inside)
            ):
                continue
            k = min(range(len(times.clock)), key=times.clock.__getitem__)
            total, inside = times.clock[k], times.inside[k]
            cells = [name, line.method.label, seconds(total), seconds(inside), seconds(total - inside)]
            rows.append(f"| {' | '.join(cells)} |")
    return "\n".join(rows)
