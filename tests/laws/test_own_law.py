"""A law stated as formulas: read, differentiated, checked for what the solvers rely on, and refused
where that fails."""

import pickle

import numpy as np
import pytest

from colloc.gaits.harmonic import Harmonic, ellipse
from colloc.gaits.problem import Problem
from colloc.laws.own_law import OwnLaw
from colloc.laws.resistance import PowerLaw, Viscous
from colloc.mechanics.chain import Chain
from colloc.mechanics.fixed_point import motion_and_derivatives
from colloc.mechanics.friction import Friction
from colloc.search.solve import solve
from colloc.system.errors import ProblemError

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


@pytest.mark.parametrize(
    ("tangential", "normal", "said"),
    [
        ("vs/speed", "-vn/speed", "does not oppose the motion"),
        ("-vs/speed", "-vn/speed + 0.1*vn/speed*exp(speed)", "does not oppose the motion"),
        ("-vs/speed", "0.1*vn/(1 + speed)", "does not oppose the motion"),
        ("-vs/speed - 0.5*vn/speed", "-vn/speed", "left and right"),
        ("-vs/abs(vs + 1) - where(vs < 0, 0, 1e-9)", "-vn", "rest"),
        ("-vs/(speed - speed)", "-vn", "no finite value"),
        ("-vs/speed", "where(vs > 0, -2, -1.5)*vn/speed", "jumps where vs changes its sign"),
        (
            "-vs",
            "-vn - where(vn > 0, 1, -1)*where(vn*vn > 0, 1, 0)",
            "jumps where vn changes its sign",
        ),
        ("-vs/speeed", "-vn", "speaks of speeed"),
        ("-vs +", "-vn", "is no formula"),
        ("-vs.real", "-vn", "is no formula that can be differentiated"),
        ("__import__('os')", "-vn", "is no formula|speaks of"),
        ("-vs**vs", "-vn", "exponent"),
    ],
)
def test_what_is_no_law_of_friction_is_refused_with_its_reason(tangential, normal, said):
    with pytest.raises(ProblemError, match=said):
        OwnLaw(tangential, normal)


@pytest.mark.slow
def test_a_stated_law_has_the_optimum_of_the_built_in_one():
    values = []
    for law in (Friction(mu_t=2.0, mu_f=1.0, mu_b=1.0), OwnLaw("-vs/speed", "-2*vn/speed")):
        problem = Problem(
            "own",
            friction=law,
            gait=Harmonic(1, "bilateral"),
            guess=ellipse(0, 2.5, 1.2),
            mesh_tolerance=1e-3,
        )
        solution = solve(problem, 1)
        assert solution.status == "solved"
        values.append(solution.efficiency)
    assert values[0] == pytest.approx(values[1], rel=1e-6)


def test_a_law_of_ones_own_goes_to_other_processes():
    """As many starts on several processes need it, also once it has been used."""
    law = OwnLaw("-vs/speed * (1 + exp(-speed))", "-2*vn/speed")
    one, delta = np.array([[0.3]]), np.array([[1e-3]])
    again = pickle.loads(pickle.dumps(law))
    assert again.density(one, one, delta) == law.density(one, one, delta)
