"""The compiled search takes the steps of the one in NumPy, whose program it does not share."""

import numpy as np
import pytest

from colloc.gaits.bspline import BSpline, Polygon
from colloc.gaits.harmonic import Harmonic
from colloc.gaits.problem import Problem
from colloc.mechanics.chain import Chain
from colloc.mechanics.floor_contact import Foot, Wheel
from colloc.mechanics.friction import Friction
from colloc.mechanics.native_kernel import native_kernel
from colloc.numerics import sqp
from colloc.reduced import compiled_search
from colloc.reduced.program import ReducedProgram
from colloc.search.iterate import space_near
from colloc.search.optimise import project_to_zero_rotation

pytestmark = pytest.mark.skipif(native_kernel() is None, reason="the kernel was not built")
_DELTA = 3e-3
_ANISOTROPIC = Friction(mu_t=2.0, mu_f=1.0, mu_b=1.5)
_FOUR, _FIVE = Chain((0.2, 0.3, 0.3, 0.2)), Chain((0.15, 0.2, 0.3, 0.2, 0.15))


def program_of(problem, follow=False):
    gait = project_to_zero_rotation(problem, problem.guess, _DELTA)
    space, v = space_near(problem, gait)
    program = ReducedProgram(space, _DELTA)
    program.place_rows(v)
    if follow:  # at an optimum with the instants fixed, whose rows bind
        v = sqp.minimize(program, v, 0.4, 1e-9, 60).v
        program.place_rows(v)
        program.follow_worst()
    return program, v


def both(problem, follow=False, iterations=60, **settings):
    """Ends by the kernel and by NumPy."""
    ends = []
    for minimize in (compiled_search.minimize, sqp.minimize):
        program, v = program_of(problem, follow)
        assert program.constraints.kernel_rows is not None
        ends.append(minimize(program, v, 0.4, 1e-9, iterations, **settings))
        if minimize is compiled_search.minimize:
            compiled = program
    # the motion that the kernel leaves is that of the gait it leaves
    fresh, _ = program_of(problem, follow)
    v = ends[0].v
    values = fresh.motion.values(v, _DELTA)
    assert compiled.motion.values(v, _DELTA) == pytest.approx(values, abs=1e-11)
    return ends


CASES = {
    "bilateral": {"gait": Harmonic(2, "bilateral")},
    "rotation closed": {"friction": _ANISOTROPIC, "gait": Harmonic(2)},
    "antipodal": {"body": _FOUR, "friction": _ANISOTROPIC, "gait": Harmonic(3, "antipodal")},
    "five links": {"body": _FIVE, "joint_limit": 1.2},
    "turning": {"rotation": 0.3},
    "turning far": {"rotation": 0.3, "at_least": {"distance": 0.1}},
    "spline": {"gait": BSpline(8, symmetry="antipodal")},
    "polygon": {"body": _FOUR, "gait": Polygon(6, "antipodal")},
    "feet": {"body": Chain(feet=1), "friction": _ANISOTROPIC},
    "a wheel": {"body": Chain(feet=(Wheel(0, rolling=0.1, sideways=0.5), Foot(1), Foot(2)))},
    "required values": {"at_least": {"distance": 0.1, "distance**2/work": 0.01}},
    "own objective": {"objective": "2 - work / distance - -distance ** 2 * 3"},
    "limited speeds": {"body": _FOUR, "speed_limit": (5.0, 6.0, 7.0), "joint_limit": 1.5},
    "two harmonics": {"body": _FIVE, "gait": Harmonic(2), "joint_limit": 0.8},
    "slow": {"objective": "2 - work", "smallest_shape_speed": 1.2},
    "slow polygon": {"objective": "2 - work", "smallest_shape_speed": 1.2, "gait": Polygon(6)},
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("follow", [False, True], ids=["fixed instants", "worst instants"])
def test_it_ends_where_numpy_does_after_as_many_steps(case, follow):
    problem = Problem("x", **{"gait": Harmonic(1)} | CASES[case])
    if follow and not isinstance(problem.gait, Harmonic):
        pytest.skip("worst instants are followed for Fourier series")
    ours, reference = both(problem, follow)
    assert ours.iterations == reference.iterations
    assert ours.on_edge == reference.on_edge
    np.testing.assert_allclose(ours.v, reference.v, atol=1e-6)
    assert ours.objective == pytest.approx(reference.objective, rel=1e-9)
    np.testing.assert_allclose(ours.curvature, reference.curvature, rtol=1e-3, atol=1e-3)


def test_bounds_of_parameters_are_kept_and_are_no_edge_of_the_box():
    ends = []
    for minimize in (compiled_search.minimize, sqp.minimize):
        program, v = program_of(Problem("x", gait=Harmonic(1)))
        program.lower, program.upper = v - 0.01, v + 0.02
        ends.append(minimize(program, v, 0.4, 1e-9))
        assert not ends[-1].on_edge
    np.testing.assert_allclose(ends[0].v, ends[1].v, atol=1e-9)
    assert (np.isclose(ends[0].v, v - 0.01) | np.isclose(ends[0].v, v + 0.02)).any()


def test_known_curvature_is_taken_and_left_as_it_was():
    problem = Problem("x", gait=Harmonic(2, "none"))
    program, v = program_of(problem)
    known = compiled_search.minimize(program, v, 0.4, 1e-9).curvature
    before = known.copy()
    ours, reference = both(problem, iterations=3, curvature=known)
    np.testing.assert_allclose(ours.v, reference.v, atol=1e-8)
    assert np.abs(both(problem, iterations=3)[0].v - ours.v).max() > 1e-3
    np.testing.assert_array_equal(known, before)


@pytest.mark.parametrize(("distance", "rotation"), [(2.0, 0.0), (0.25, 0.5)])
def test_of_rows_that_contradict_each_other_the_same_part_is_removed(distance, rotation):
    asked = {"at_least": {"distance": distance}, "rotation": rotation, "joint_limit": 1.0}
    problem = Problem("x", gait=Harmonic(1), **asked)
    ours, reference = both(problem)
    np.testing.assert_allclose(ours.v, reference.v, atol=1e-5)
    program, _ = program_of(problem)
    assert sqp.stationarity(program, ours.v).violation > 0.1


def test_the_nearest_gait_keeps_its_area_and_the_rows(monkeypatch):
    problem = Problem("x", body=_FOUR, gait=Harmonic(2, "none"))
    program, v = program_of(problem)
    area = np.cov(np.random.default_rng(4).normal(size=(v.size, 2 * v.size)))
    target = v + 0.05
    ours = compiled_search.nearest(program, target, area, 1e-10, 40)
    assert ours @ area @ ours == pytest.approx(target @ area @ target, abs=1e-8)
    assert program.rows(ours)[0] == pytest.approx(0.0, abs=1e-8)
    monkeypatch.setattr(compiled_search, "_minimize", lambda *_: None)
    other, _ = program_of(problem)
    np.testing.assert_allclose(
        ours, compiled_search.nearest(other, target, area, 1e-10, 40), atol=1e-6
    )


@pytest.mark.parametrize(
    "problem",
    [
        Problem("x", gait=Harmonic(1, "none"), objective="speed"),
        Problem("x", gait=Harmonic(1, "none"), objective="sqrt(distance) / work"),
        Problem("x", gait=Harmonic(1, "none"), power_limit=1.0),
    ],
)
def test_parts_that_the_kernel_lacks_are_left_to_numpy(problem):
    program, v = program_of(problem)
    ours = compiled_search.minimize(program, v, 0.4, 1e-9, 20)
    program, v = program_of(problem)
    reference = sqp.minimize(program, v, 0.4, 1e-9, 20)
    np.testing.assert_array_equal(ours.v, reference.v)
