"""This module runs the least-squares method from a first guess."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from hybridsim.analysis.fit.residuals import Residuals
from hybridsim.analysis.progress import Progress


class Search:
    """Finds minima of the sum of squares."""

    def __init__(
        self, residuals: Residuals, loss: str, most: int, progress: Progress | None, starts: int
    ) -> None:
        self.residuals, self._loss, self._most, self._progress = residuals, loss, most, progress
        self._done, self._total = 0, most * starts

    def best_from(self, guess: np.ndarray, noise: Mapping[str, float]) -> OptimizeResult | None:
        """Return the best point reached from a guess, or None if the guess cannot be simulated.

        Where a quantity jumps, the sum of squares has steps, and a point that coarse differences reach is the guess.
        """
        if not np.isfinite(self.residuals.predicted(guess)).all():
            return None
        if self.residuals.has_jumps(guess):
            guess = self._minimum(guess, noise, is_coarse=True).x
        return self._minimum(guess, noise)

    def most_promising(self, guesses: list[np.ndarray], noise: Mapping[str, float]) -> list[np.ndarray]:
        """Return the guesses that can be simulated, in order of their sums of squares."""
        residuals = self.residuals
        weights = 1.0 / np.array([noise[name] for name in residuals.quantity])
        sums = [
            float(np.sum(((residuals.measured - residuals.predicted(x)) * weights) ** 2)) for x in guesses
        ]
        ranked = sorted((value, k) for k, value in enumerate(sums) if math.isfinite(value))
        return [guesses[k] for _, k in ranked]

    def _minimum(
        self, guess: np.ndarray, noise: Mapping[str, float], is_coarse: bool = False
    ) -> OptimizeResult:
        residuals = self.residuals
        weights = 1.0 / np.array([noise[name] for name in residuals.quantity])
        bounds = np.array([unknown.coordinate_bounds for unknown in residuals.unknowns.values()]).T

        def weighted(x: np.ndarray) -> np.ndarray:
            found: np.ndarray = (residuals.measured - residuals.predicted(x)) * weights
            return found

        def slopes(x: np.ndarray) -> np.ndarray:
            self._report(weighted(x))
            found: np.ndarray = -residuals.slopes(x, is_coarse) * weights[:, None]
            return np.where(np.isfinite(found), found, 0.0)

        if not slopes(guess).any():  # the method would divide by zero
            cost = 0.5 * float(np.sum(weighted(guess) ** 2))
            same = residuals.predicted(guess)
            return OptimizeResult(
                x=guess, cost=cost, status=1, message="no unknown has an effect", predicted=same
            )
        result = least_squares(
            weighted, guess, slopes, bounds, x_scale=residuals.sizes, loss=self._loss, max_nfev=self._most,
            xtol=1e-4 if is_coarse else 1e-10, ftol=1e-4 if is_coarse else 1e-12, gtol=None,
        )  # fmt: skip
        result.predicted = residuals.predicted(result.x)
        return result

    def _report(self, weighted: np.ndarray) -> None:
        if self._progress is not None:
            text = f"residual {math.sqrt(float(np.mean(weighted**2))):.4g} times the noise"
            self._progress(min(self._done, self._total), self._total, text)
        self._done += 1

    def noise_of(self, result: OptimizeResult) -> dict[str, float]:
        """Return the standard deviation of the residuals of each quantity."""
        residuals = self.residuals
        off = residuals.measured - result.predicted
        factor = len(off) / (len(off) - len(residuals.unknowns))  # degrees of freedom
        least = 1e-14 * float(np.abs(residuals.measured).max(initial=0.0)) or 1e-300
        return {
            name: max(math.sqrt(factor * float(np.mean(off[residuals.quantity == name] ** 2))), least)
            for name in residuals.names
        }
