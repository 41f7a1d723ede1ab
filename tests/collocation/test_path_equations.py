"""Derivatives of points on arcs, swept back by hand, against the Jacobian of the arcs'
expression."""

import numpy as np
import pytest

from colloc.collocation.path_equations import along_arcs, along_shape, arc, excess_turn


@pytest.mark.parametrize("n_joint", [3, 5])
@pytest.mark.parametrize("turn", [0.0, 1e-3, 0.1, 2.0], ids="turned by about {} rad".format)
def test_weights_swept_back_by_hand_are_those_of_the_jacobian(n_joint, turn):
    rng, points = np.random.default_rng(n_joint), 40
    t0 = rng.normal(size=(n_joint, points))
    t1 = t0 / np.linalg.norm(t0, axis=0) + turn / np.sqrt(n_joint) * rng.normal(size=t0.shape)
    t0, t1 = (t / np.linalg.norm(t, axis=0) for t in (t0, t1))
    shape = np.concatenate([rng.normal(size=t0.shape), t0, t1, rng.uniform(0.2, 2.0, (1, points))])
    given = np.stack([rng.uniform(size=points), rng.uniform(0.01, 0.2, points)])
    on_place, on_speed = rng.normal(size=(3, points, 2 * n_joint)), rng.normal(size=(3, points))
    expected = along_shape(arc(n_joint))(shape, given, on_place, on_speed)
    np.testing.assert_allclose(
        along_arcs(n_joint)(shape, given, on_place, on_speed), expected, rtol=1e-12, atol=1e-13
    )


@pytest.mark.parametrize(("radius", "arcs"), [(0.5, 6), (2.0, 12)])
def test_a_circle_is_bent_as_much_as_its_curvature_allows_and_a_little_more_by_that_angle(
    radius, arcs
):
    """Run through once at the mean shape speed of its radius, in equal arcs."""
    for more in (0.0, 1e-6):
        turn = 2 * np.pi / arcs + more
        found = excess_turn(2, 1 / radius).value(
            [1.0, 0.0, np.cos(turn), np.sin(turn), radius], 1 / arcs, 1e-4
        )
        assert float(found) == pytest.approx(more * np.cos(np.pi / arcs), abs=1e-11)
