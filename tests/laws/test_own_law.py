"""A law stated as formulas: read, differentiated, and checked for what solvers rely on."""

import pickle

import numpy as np
import pytest

from colloc.laws.own_law import OwnLaw
from colloc.laws.resistance import PowerLaw, Viscous
from colloc.mechanics.chain import Chain
from colloc.mechanics.fixed_point import motion_and_derivatives
from colloc.mechanics.friction import Friction

COULOMB = OwnLaw("-where(vs > 0, 1, 1.5)*vs/speed", "-2*vn/speed")


def test_traits_are_found_from_samples():
    assert (COULOMB.degree, COULOMB.reversible, COULOMB.regularised) == (0.0, False, True)
    drag = OwnLaw("-vs", "-1.8*vn")
    assert (drag.degree, drag.reversible, drag.regularised) == (1.0, True, False)
    weaker = OwnLaw("-vs/speed*(1 + exp(-speed))", "-vn/speed*(1 + exp(-speed))")
    assert (weaker.degree, weaker.reversible) == (None, True)
    assert weaker.smallest == pytest.approx(1 + np.exp(-1))


@pytest.mark.parametrize(
    ("own", "built_in"),
    [
        (COULOMB, Friction(mu_t=2.0, mu_f=1.0, mu_b=1.5)),
        (OwnLaw("-vs", "-2*vn"), Viscous(normal=2.0, tangential=1.0)),
        (
            OwnLaw("-vs/sqrt(speed)", "-2*vn*speed**(-0.5)"),
            PowerLaw(0.5, mu_t=2.0, mu_f=1.0, mu_b=1.0),
        ),
    ],
    ids=["Coulomb", "viscous", "power"],
)
def test_a_stated_law_moves_a_body_as_the_built_in_one_does(own, built_in):
    rng, body = np.random.default_rng(1), Chain()
    at = rng.uniform(-1.5, 1.5, (2, 10)), rng.normal(size=(2, 10)), 1e-4
    found = []
    for law in (own, built_in):
        solved = body.solve(law, *at).require()
        found.append(
            (
                solved.z,
                body.motion(law, *at, solved).power,
                motion_and_derivatives(body, law, *at, solved)[1],
            )
        )
    for a, b in zip(*found, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-7 * np.abs(b).max())


def test_a_law_of_ones_own_goes_to_other_processes():
    """As many starts on several processes need it, also once it has been used."""
    law = OwnLaw("-vs/speed * (1 + exp(-speed))", "-2*vn/speed")
    one, delta = np.array([[0.3]]), np.array([[1e-3]])
    again = pickle.loads(pickle.dumps(law))
    assert again.density(one, one, delta) == law.density(one, one, delta)
