"""This module draws and animates a run and writes its report, as a part of `Solution`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import Any

from hybridsim.calls import refusing
from hybridsim.solution.files.in_tables import InTables


class InPictures(InTables):
    """The picture, the animation and the report of a run, as a part of `Solution`."""

    @refusing
    def plot(self, *quantities: str, t_span: tuple[float, float] | None = None) -> Any:
        """Draw quantities over time, and the modes under them; see `hybridsim.plot.time_history`.

        Parameters
        ----------
        *quantities : names of states, outputs, forces and inputs; by default the first four states, and the first four
            outputs.
        t_span : part of the run; by default all, or the last few of very many periods.

        Returns
        -------
        TimeHistoryAxes
            The axes. A notebook shows them, and ``hs.plot.save(sol.plot(), "run.png")`` writes them to a file.

        Raises
        ------
        UsageError
            For an unknown quantity, a part outside the run, or a run without states between its start and end.

        Examples
        --------
        >>> import hybridsim as hs
        >>> picture = hs.simulate("dfcs", (0, 0.1)).plot("x", "f")
        >>> [axes.get_ylabel() for axes in picture.quantities]
        ['x [µm]', 'f [N]']
        """
        # The plot package is a layer above this one, so it is imported only on demand.
        return import_module("hybridsim.plot").time_history(self, quantities or None, t_span=t_span)

    @refusing
    def animate(
        self,
        path: str | PathLike[str],
        quantities: Sequence[str] | None = None,
        *,
        t_span: tuple[float, float] | None = None,
        speed: float | None = None,
        fps: float = 20.0,
        dark: bool = False,
        progress: Callable[[float], None] | bool | None = None,
    ) -> Path:
        """Write the moving mechanism next to its curves and modes to a file; the model needs a `drawing`.

        Parameters
        ----------
        path : ends in .gif, .html (a page with a player) or .mp4 (needs the program ffmpeg).
        quantities : names of the drawn states and outputs; by default the first two states, and [] for none.
        t_span : part of the run; by default all, or the last few of very many periods.
        speed : time of the model per second of the animation; by default a round number for about 8 s.
        fps : frames per second, at most 50; there are at most 1000 frames.
        dark : whether the background is dark.
        progress : True for a bar, or a function that is called with the finished part, from 0 to 1.

        Returns
        -------
        Path
            The path of the file.

        Raises
        ------
        UsageError
            For a model without a drawing, for too many frames, and for .mp4 if ffmpeg is not installed.

        Examples
        --------
        >>> import hybridsim as hs
        >>> hs.simulate("belt", (0, 30)).animate("belt.gif", ["x"])  # doctest: +SKIP
        """
        # The plot package is a layer above this one, so it is imported only on demand.
        draw = import_module("hybridsim.plot").animate
        written: Path = draw(
            self, path, quantities, t_span=t_span, speed=speed, fps=fps, dark=dark, progress=progress
        )
        return written

    @refusing
    def report(self, path: str | PathLike[str]) -> Path:
        """Write the run as one HTML page: curves, modes, events with reasons, cost, and instructions to repeat the run.

        The page needs no other file and no connection. It stays below 5 MB: of a very long run it has the whole curves
        of the first and last part, and the range of each quantity in short intervals between them.

        Parameters
        ----------
        path : ends in .html.

        Returns
        -------
        Path
            The path of the file.

        Raises
        ------
        UsageError
            For another file type, for a run of a `MechanicalSystem`, or if the file cannot be written.

        Examples
        --------
        >>> import hybridsim as hs
        >>> hs.simulate("dfcs", (0, 0.1)).report("dfcs.html")  # doctest: +SKIP
        """
        written: Path = import_module("hybridsim.report").write_report(self, path)
        return written
