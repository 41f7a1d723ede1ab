"""Relaxed gaits as a search sees them: where they start, and how long they take every direction on every piece.

Durations have a bound of 0 below; directions of two joints are angles, of more joints any vectors, divided by their length.
"""

from __future__ import annotations

import numpy as np

from colloc.collocation.shape_checks import ShapeCheck, shape_checks
from colloc.gaits.control_problem import ControlProblem
from colloc.gaits.path_samples import Gait, symmetric_samples
from colloc.gaits.relaxed import Mixture
from colloc.gaits.symmetry import end_conditions
from colloc.mechanics.bodies import Pairs
from colloc.numerics.mesh import Mesh
from colloc.reduced.constraints import Constraints
from colloc.reduced.given import Given

_NEAR = 0.6
"""A check that is nearer to its bound than this [rad, or body lengths] is among the rows."""
_CELLS = 3
"""Mesh intervals of a piece: where links begin to stick the velocities have kinks, which are narrow for small delta."""
_LONGEST = 1.0
"""Time in one of several directions on a piece [rad], at most. A gait that loops at one shape could go on for ever."""
_LOOP = 0.05
"""Time that a mixture begun along a path spends in every other direction, as a share of that along the path."""
_SAMPLES = 2000


class MixtureSpace:
    """Relaxed gaits of a number of pieces by their parameters; attributes as `colloc.reduced.program.SearchSpace`.

    Parameters
    ----------
    control : ControlProblem
        Of a class `colloc.gaits.relaxed.Relaxed`.
    pieces : int
    far : pairs of links more than two apart that are kept from crossing.
    scheme : str, optional
    directions : int, optional
        Other than those of the class, to see what more would be worth.
    """

    def __init__(self, control: ControlProblem, pieces: int, far: Pairs = (), scheme: str = "", directions: int = 0) -> None:
        self.control, self.pieces, admissible = control, pieces, control.admissible
        self.given = Given(None, np.arange(pieces + 1.0), scheme or control.scheme, far)
        self._symmetry, self._limit = admissible.gait.symmetry, admissible.joint_limit
        self.n_joint, self.n_direction = admissible.n_joint, directions or admissible.gait.directions
        self.mesh = control.mesh(np.arange(pieces * _CELLS + 1.0) / _CELLS, scheme)
        piece = np.repeat(np.arange(pieces), _CELLS * self.mesh.scheme.s)
        self._piece, self._part = piece, self.mesh.times - piece
        self._in_piece = (piece == np.arange(pieces)[:, None]).astype(float)
        self._checks = shape_checks(admissible.body, far)
        self._first, self._last = end_conditions(self._symmetry, self.n_joint)
        count = pieces * self.n_direction
        self.time = slice(self.n_joint, self.n_joint + count)
        self.n = self.time.stop + count * (1 if self.n_joint == 2 else self.n_joint)
        self.own = np.arange(self.n)
        self.lower, self.upper = np.full(self.n, -np.inf), np.full(self.n, np.inf)
        # a side of a polygon goes across the square of admissible angles at most
        longest = _LONGEST if self.n_direction > 1 else 2 * self._limit * np.sqrt(self.n_joint)
        self.lower[self.time], self.upper[self.time] = 0.0, longest
        # instants of the checks as means of the shapes where pieces meet
        ends = np.eye(pieces + 1)
        self._watch = np.vstack([ends, 0.5 * (ends[:-1] + ends[1:])])
        self._least = 2 * np.pi * admissible.smallest_shape_speed * admissible.gait.fraction

    def _split(self, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Durations ``(n_piece, n_direction)``, directions as they are parametrised, and as unit vectors."""
        durations = v[self.time].reshape(self.pieces, self.n_direction)
        raw = v[self.time.stop :].reshape(self.pieces, self.n_direction, -1)
        if self.n_joint == 2:
            return durations, raw, np.concatenate([np.cos(raw), np.sin(raw)], axis=2)
        return durations, raw, raw / np.linalg.norm(raw, axis=2, keepdims=True)

    def member(self, v: np.ndarray) -> Mixture:
        durations, _, directions = self._split(v)
        return Mixture(np.maximum(durations, 0.0), directions, v[: self.n_joint], self._symmetry)

    def parameters(self, gait: Gait) -> np.ndarray:
        """Parameters of a mixture of so many pieces, or of one along the path of another gait."""
        mixture = gait if isinstance(gait, Mixture) else self._along(gait)
        raw = mixture.directions
        if self.n_joint == 2:
            raw = np.arctan2(raw[..., 1], raw[..., 0])
        return np.concatenate([mixture.start, mixture.durations.ravel(), raw.ravel()])

    laid = parameters

    def _along(self, gait: Gait) -> Mixture:
        """A mixture that follows a path: the first direction along it, the others spread, for a small part of the time."""
        points = symmetric_samples(gait, self._symmetry, _SAMPLES)
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points), axis=0))])
        at = np.linspace(0.0, along[-1], self.pieces + 1)
        steps = np.diff(np.stack([np.interp(at, along, row) for row in points])).T
        size = np.linalg.norm(steps, axis=1, keepdims=True)
        ahead = (steps / np.maximum(size, 1e-300))[:, None]
        turn = 2 * np.pi * np.arange(1, self.n_direction) / self.n_direction
        if self.n_joint == 2:
            c, s = np.cos(turn)[None, :, None], np.sin(turn)[None, :, None]
            others = c * ahead + s * np.stack([-ahead[..., 1], ahead[..., 0]], axis=2)
        else:
            others = np.random.default_rng(0).standard_normal((self.pieces, self.n_direction - 1, self.n_joint))
            others /= np.linalg.norm(others, axis=2, keepdims=True)
        shares = np.concatenate([[1.0], np.full(self.n_direction - 1, _LOOP)])
        return Mixture(size * shares, np.concatenate([ahead, others], axis=1), points[:, 0], self._symmetry)

    def full_parameters(self, v: np.ndarray) -> np.ndarray:
        """There is no other program: they are v."""
        return v

    def phase_mesh(self, gait: Mixture) -> Mesh:
        """The pieces in phases of a member."""
        return Mesh(self.mesh.scheme, gait.phases[: self.pieces + 1])

    def at(self, v: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Angles, directions and durations at the points of the mesh: a block of columns for each direction."""
        durations, _, directions = self._split(v)
        shapes = self.member(v).shapes
        angles = shapes[:, self._piece] + self._part * np.diff(shapes)[:, self._piece]
        rates = directions[self._piece].transpose(2, 1, 0).reshape(self.n_joint, -1)
        return np.tile(angles, self.n_direction), rates, durations[self._piece].T.ravel()

    def pulled_back(self, v: np.ndarray, on_shape: np.ndarray, on_pace: np.ndarray) -> np.ndarray:
        durations, raw, directions = self._split(v)
        on = on_shape.reshape(len(on_shape), self.n_direction, self.mesh.n_point, -1)
        on_angles = on[..., : self.n_joint].sum(axis=1)
        here = np.einsum("np,kpj->knj", self._in_piece, on_angles)
        within = np.einsum("np,kpj->knj", self._in_piece * self._part, on_angles)
        since = np.cumsum(here[:, ::-1], axis=1)[:, ::-1]
        on_rates = np.einsum("np,kapj->knaj", self._in_piece, on[..., self.n_joint :])
        on_time = np.einsum("np,kap->kna", self._in_piece, on_pace.reshape(on.shape[:3]))
        return self._on_parameters(since[:, 0], within + since - here, on_time, on_rates, durations, raw, directions)

    @staticmethod
    def _on_parameters(
        on_start: np.ndarray,
        on_step: np.ndarray,
        on_time: np.ndarray,
        on_rates: np.ndarray,
        durations: np.ndarray,
        raw: np.ndarray,
        directions: np.ndarray,
    ) -> np.ndarray:
        """Derivatives by v, from those by the start, the steps of the shape, durations and directions; k of them each."""
        on_time = on_time + np.einsum("knj,naj->kna", on_step, directions)
        on_rates = on_rates + durations[:, :, None] * on_step[:, :, None]
        if raw.shape[2] == 1:
            on_raw = on_rates[..., 1] * directions[..., 0] - on_rates[..., 0] * directions[..., 1]
        else:
            along = (on_rates * directions).sum(axis=-1, keepdims=True)
            on_raw = (on_rates - along * directions) / np.linalg.norm(raw, axis=2, keepdims=True)
        k = len(on_start)
        return np.concatenate([on_start, on_time.reshape(k, -1), on_raw.reshape(k, -1)], axis=1)

    def _through_shapes(self, v: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Derivatives ``(k, n)`` of numbers from those by the shapes where pieces meet, ``(k, n_piece + 1, n_joint)``."""
        since = np.cumsum(weights[:, ::-1], axis=1)[:, ::-1]
        return self._on_parameters(since[:, 0], since[:, 1:], np.zeros(1), np.zeros(1), *self._split(v))

    def constraints(self, v: np.ndarray, later: float = 0.0) -> Constraints:
        """What closes the path, checks on shapes where pieces meet and in their middle, and the path's length.

        Ends and middles of pieces move with those alone: `later` changes nothing.
        """
        angles, limit = self.member(v).shapes @ self._watch.T, self._limit
        kinds, watched, low, high, excess = dict[str, np.ndarray](), [], [], [], -np.inf
        closing = np.zeros(len(self._first))
        for check in self._checks:
            values = check.along(angles)
            beyond = check.excess(values, limit)
            at = np.flatnonzero(beyond > -_NEAR)
            lower, upper = check.nearer_bounds(values[at], limit)
            kinds[check.name] = at
            if at.size:
                watched.append((check, self._watch[at]))
            low.append(lower)
            high.append(upper)
            excess = max(excess, float(beyond.max()))
        return Constraints(
            kinds,
            np.concatenate([closing, *low, [self._least]]),
            np.concatenate([closing, *high, [np.inf]]),
            excess,
            lambda v: self._rows(watched, v),
            lambda v: self._row_slopes(watched, v),
        )

    def metric(self, v: np.ndarray) -> np.ndarray | None:
        """None: parameters are alike."""
        return None

    def _rows(self, watched: list[tuple[ShapeCheck, np.ndarray]], v: np.ndarray) -> np.ndarray:
        shapes = self.member(v).shapes
        values = [check.along(shapes @ at.T) for check, at in watched]
        return np.concatenate([self._first @ shapes[:, 0] + self._last @ shapes[:, -1], *values, [v[self.time].sum()]])

    def _row_slopes(self, watched: list[tuple[ShapeCheck, np.ndarray]], v: np.ndarray) -> np.ndarray:
        shapes = self.member(v).shapes
        closing = np.zeros((len(self._first), self.pieces + 1, self.n_joint))
        closing[:, 0] += self._first
        closing[:, -1] += self._last
        weights = [closing]
        for check, at in watched:
            there = shapes @ at.T
            slope = check.slope(there, check.itself(there)[None]).full()
            weights.append(np.einsum("jw,wn->wnj", slope, at))
        length = np.zeros((1, self.n))
        length[0, self.time] = 1.0
        return np.vstack([self._through_shapes(v, np.concatenate(weights)), length])
