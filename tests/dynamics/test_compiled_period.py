"""A period in one call of the kernel is that of the NumPy solvers, and so are its derivatives."""

from contextlib import nullcontext

import numpy as np
import pytest

from colloc import Chain, Foot, Friction, Problem, Wheel
from colloc.dynamics.compiled_period import CompiledPeriod
from colloc.dynamics.dynamics import Shapes
from colloc.mechanics.native_kernel import native_kernel
from colloc.reduced.motion import ReducedMotion
from colloc.search.iterate import space_near
from tests.shared.cases import cases
from tests.shared.without_kernel import numpy_instead

pytestmark = pytest.mark.skipif(native_kernel() is None, reason="no C compiler")
ROUGH = Friction(mu_t=1.7, mu_f=1.0, mu_b=1.3)
FEET = tuple(Foot(k) for k in range(3))
ASKEW = [Wheel(0, 0.3, axle=True, angle=0.4 * s, offset=0.05 * s) for s in (1, -1)]
CASES = """
three links: gait=Harmonic(2)
different friction each way: gait=Harmonic(2), friction=ROUGH
an elliptic law: gait=Harmonic(2), friction=Elliptic(mu_t=2.0, mu_f=1.0, mu_b=1.5)
seven links of many lengths: body=Chain((0.1, 0.2, 0.15, 0.1, 0.2, 0.1, 0.15)), friction=ROUGH
links on feet: body=Chain(feet=FEET), gait=Harmonic(2)
wheels on axles, two of them askew: body=Chain(feet=(*ASKEW, Foot(1), Wheel(2, axle=True, rolling=0.3)))
a wheel between two pads: body=Chain((0.3, 0.4, 0.3), feet=(Pad(0, 0.1, 0.6), Wheel(1), Pad(2)))
half a period, and points that neighbours share: gait=Harmonic(1, "antipodal"), scheme="hermite-simpson"
delta relative to the speed: gait=Polygon(4), friction=ROUGH
turning as a whole: gait=Harmonic(2), rotation=0.7
turning as a whole at a pace of its own: gait=Polygon(4), rotation=0.7
a number of points that no vector divides: gait=BSpline(7), intervals=7, scheme="radau-3"
"""
CASES = cases(CASES, globals())


def numbers(problem, delta, seed=0):
    """Totals and their gradients along a walk, with the motion before as the first guess."""
    space, v = space_near(problem, problem.guess)
    motion, rng, found = ReducedMotion(space.control.dynamics, space.mesh, space), None, []
    rng = np.random.default_rng(seed)
    for _ in range(4):
        v = v + 0.02 * rng.normal(size=v.size)
        values, slopes = motion.values(v, delta), motion.gradients(v, delta)
        found.append(np.concatenate([[*values.values()], *slopes.values()]))
    return np.array(found)


@pytest.mark.parametrize("delta", [1e-1, 1e-3, 1e-5])
@pytest.mark.parametrize("case", CASES)
def test_totals_and_gradients_are_those_of_numpy(case, delta):
    problem = Problem("p", **({"intervals": 12} | CASES[case]))
    compiled = numbers(problem, delta)
    with numpy_instead():
        reference = numbers(problem, delta)
    scale = np.abs(reference).max(axis=1, keepdims=True)
    # rounding of friction is 1e-16 / delta, and gradients hold it once more
    np.testing.assert_allclose(compiled, reference, rtol=0, atol=1e-9 * scale.max())


def five_links():
    problem = Problem("p", body=Chain((0.2,) * 5), friction=ROUGH, intervals=20)
    space, v = space_near(problem, problem.guess)
    angles, rates, pace = space.at(v)
    compiled = CompiledPeriod.of(space.control.dynamics, space.mesh)
    return compiled, Shapes(angles, rates, 1e-4, pace=pace), np.zeros((3, angles.shape[1]))


def test_instants_that_newton_loses_are_balanced_all_the_same():
    compiled, shapes, rest = five_links()
    expected, *_ = compiled.simulate(shapes, rest)
    for size in (1.0, 100.0, np.nan):
        wild, *_ = compiled.simulate(
            shapes, size * np.random.default_rng(0).normal(size=rest.shape)
        )
        np.testing.assert_allclose(wild, expected, rtol=0, atol=1e-8)


def test_a_body_whose_joints_rest_rests():
    compiled, shapes, rest = five_links()
    expected, *_ = compiled.simulate(shapes, rest)
    shapes.rates[:, ::7] = 0.0
    z, out, _ = compiled.simulate(shapes, rest)
    assert not np.vstack([z, out])[:, ::7].any()
    np.testing.assert_allclose(z[:, 1:7], expected[:, 1:7], rtol=0, atol=1e-8)


def test_a_shape_that_is_no_number_has_no_motion():
    compiled, shapes, rest = five_links()
    shapes.angles[1, 5] = np.nan
    assert compiled.simulate(shapes, rest) is None


@pytest.mark.parametrize("by", [nullcontext, numpy_instead])
def test_velocities_to_start_from_miss_by_the_square_of_the_change(by, monkeypatch):
    """They follow the branch they are on, where several velocities balance a body."""
    problem = Problem("p", body=Chain((0.2,) * 5), friction=ROUGH, intervals=20)
    space, v = space_near(problem, problem.guess)
    change, missed = np.random.default_rng(0).normal(size=v.size), []
    for h in (1e-3, 1e-4):
        with by():
            near, far = (ReducedMotion(space.control.dynamics, space.mesh, space) for _ in range(2))
            balanced = far.at(v + h * change, 1e-4).z
            near.gradients(v, 1e-4)
            with monkeypatch.context() as patch:
                for module in ("compiled_period", "dynamics"):
                    patch.setattr(f"colloc.dynamics.{module}._TOLERANCE", 1e12)
                predicted = near.at(v + h * change, 1e-4).z
        missed.append(float(np.median(np.abs(predicted - balanced))))
    assert missed[0] < 1e-4
    assert missed[1] == pytest.approx(missed[0] / 100, rel=0.2)
