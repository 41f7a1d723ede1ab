r"""Where the potential of the bound wants its knots: the dual residual of the functions that a knot
would add.

The multipliers of the program are a measure that closes for every potential of the space. It need
not close for a function psi outside of it: its mean rate g = int dpsi/dt is the slope of the
program's value in the coefficient of psi. With a penalty on roughness R, functions of slopes g can
lower the value by up to ``g.R^-1.g`` over twice the penalty's weight. So knots are inserted where
that is largest. (The measure's own weight is no guide: it may close well where it is heavy.)
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from colloc.bounds.measure import Measure
from colloc.bounds.potential import PotentialSpace, Samples
from colloc.numerics.spline import TensorSpline

_SHARE = 0.3
"""Of the largest worth, that a knot needs to be inserted together with the best."""
_SINGULAR = 1e-10
"""Added to the roughness, of its mean diagonal: affine functions have none. For these the measure
closes."""


def worth(space: PotentialSpace, measure: Measure) -> float:
    """What the functions of a space can gain over those that the measure closes for, up to a
    factor."""
    rows, _ = Samples(space, measure.motion).rows(np.arange(measure.weight.size), measure.heading)
    slope = rows.T @ measure.weight
    roughness = space.roughness + _SINGULAR * space.roughness.diagonal().mean() * sparse.eye(
        space.size
    )
    return float(slope @ spsolve(roughness.tocsc(), slope))


def with_knots(space: PotentialSpace, added: np.ndarray) -> PotentialSpace:
    """The potentials with more knots, at the angles `added` and their opposites."""
    old = space.spline
    inner = np.unique(np.concatenate([old.knots[1:-1], added, -added]).round(12) + 0.0)
    spline = TensorSpline(old.n_joint, old.limit, inner.size + 1, tuple(inner.tolist()))
    return replace(space, spline=spline)


def with_more_knots(space: PotentialSpace, measure: Measure, intervals: int) -> PotentialSpace:
    """The potentials with knots in the middle of those intervals where they are worth most, at most
    `intervals` in all."""
    knots = space.spline.knots
    middle = 0.5 * (knots[1:] + knots[:-1])
    places = middle[middle > -1e-12]
    values = np.array([worth(with_knots(space, places[[k]]), measure) for k in range(places.size)])
    added: list[float] = []
    for k in np.argsort(-values):
        more = with_knots(space, np.array([*added, places[k]])).spline.intervals
        if added and (values[k] < _SHARE * values.max() or more > intervals):
            break
        added.append(float(places[k]))
    return with_knots(space, np.array(added))
