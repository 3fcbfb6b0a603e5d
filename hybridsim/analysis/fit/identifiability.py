"""This module finds combinations of unknowns that the data of a fit do not determine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_NULL = 1e-5  # of the largest singular value; difference quotients have errors of this order
_LARGEST = 30.0  # standard deviation relative to the sizes; a larger one may come from such errors
_TAKES_PART = 0.03  # of the largest component


@dataclass(frozen=True)
class Undetermined:
    """A joint change of unknowns that leaves all measured quantities unchanged.

    names : the unknowns that take part; changes : their relative changes, of which the largest is 1.
    """

    names: tuple[str, ...]
    changes: tuple[float, ...]

    def __str__(self) -> str:
        if len(self.names) == 1:
            return f"the data do not determine {self.names[0]}"
        listed = " and ".join([", ".join(self.names[:-1]), self.names[-1]])
        parts = ", ".join(f"{name} {c:+.3g} %" for name, c in zip(self.names, self.changes, strict=True))
        text = f"the data do not determine {listed} separately: the joint change {parts} has no effect"
        if len(self.names) == 2 and abs(abs(self.changes[0] / self.changes[1]) - 1.0) < 0.02:
            sign = "*" if self.changes[0] * self.changes[1] < 0.0 else "/"
            text += f"; they determine {self.names[0]}{sign}{self.names[1]}"
        return text


def undetermined(
    names: list[str], slopes: np.ndarray, per_value: np.ndarray
) -> tuple[list[Undetermined], np.ndarray]:
    """Return the undetermined combinations, and the scaled covariance (n, n) after their removal.

    A combination is undetermined if its derivative is zero within the errors of difference quotients, or if its
    standard deviation is far above the sizes of the unknowns.

    slopes : (m, n), derivatives of the samples, relative to their noise, by the unknowns, relative to their sizes.
    per_value : (n,), the sizes relative to the values.
    """
    _, singular, rows = np.linalg.svd(slopes, full_matrices=False)
    is_null = singular <= np.maximum(_NULL * singular.max(initial=0.0), 1.0 / _LARGEST)
    inverse = np.where(is_null, 0.0, 1.0 / np.where(is_null, 1.0, singular))
    covariance = (rows.T * inverse**2) @ rows
    found = []
    for row in rows[is_null]:
        changes = row * per_value
        changes = changes / changes[np.argmax(np.abs(changes))]
        taking_part = np.flatnonzero(np.abs(changes) > _TAKES_PART)
        found.append(
            Undetermined(
                tuple(names[int(k)] for k in taking_part), tuple(float(changes[k]) for k in taking_part)
            )
        )
        covariance[taking_part, taking_part] = np.inf
    return found, covariance
