"""What every gait is for its reader: a function of the phase, and words. The kinds of gaits say what the words are."""

from __future__ import annotations

import numpy as np


class GaitFunction:
    """Base of the kinds of gaits: ``gait(t)`` gives joint angles and rates, so a gait can stand where a path is asked for.

    Examples
    --------
    >>> from colloc import ellipse
    >>> gait = ellipse(A0=0, A1=2, B1=1)
    >>> angles, rates = gait([0, 0.25])
    >>> angles
    array([[ 2.,  1.],
           [-2.,  1.]])
    >>> print(gait)
    joint 1: +0.0000 +2.0000 cos 2πt +1.0000 sin 2πt
    joint 2: +0.0000 -2.0000 cos 2πt +1.0000 sin 2πt
    """

    @property
    def n_joint(self) -> int:
        raise NotImplementedError

    def angles(self, t: np.ndarray) -> np.ndarray:
        """Joint angles ``(n_joint, n_time)`` at phases t ``(n_time,)``."""
        raise NotImplementedError

    def rates(self, t: np.ndarray) -> np.ndarray:
        """Joint rates ``(n_joint, n_time)`` per period at phases t."""
        raise NotImplementedError

    def lines(self) -> list[str]:
        """The gait in words or as a formula."""
        raise NotImplementedError

    def __call__(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.angles(t), self.rates(t)

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self.n_joint} joint{'s' if self.n_joint > 1 else ''}>"
