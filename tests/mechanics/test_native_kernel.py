"""The compiled kernel: the same bits on any threads and in any batch; faults cost speed only; a period in
one call of it is that of the NumPy solvers, and so are its derivatives."""

import os
import shutil
import subprocess
import sys
from contextlib import nullcontext
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from colloc import Chain, Foot, Friction, Problem, Wheel, solve_balance
from colloc.dynamics.compiled_period import CompiledPeriod
from colloc.dynamics.dynamics import QuasiStatic, Shapes, TotalGradient
from colloc.mechanics import native_kernel as native_kernel_module
from colloc.mechanics.native_kernel import library, native_kernel
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme
from colloc.reduced.motion import ReducedMotion
from colloc.search.iterate import space_near
from colloc.system.environment import available_threads
from colloc.system.errors import SlowWarning
from research.guarantee.c_compiler import c_compiler
from tests.conftest import ROOT
from tests.shared.cases import cases
from tests.shared.mechanics import numpy_instead, random_instants

needs_kernel = pytest.mark.skipif(native_kernel() is None, reason="no C compiler")
N_TIME = 9001


@pytest.fixture
def fresh(monkeypatch):
    """The kernel is looked for again, before and after."""
    library.cache_clear()
    yield monkeypatch
    monkeypatch.undo()
    library.cache_clear()


def fields(law, angles, rates):
    found = solve_balance(Chain(), law, angles, rates, 1e-5)
    parts = found.z, found.residual, found.iterations, found.anchor, found.anchor_velocity
    return np.vstack(parts)


@needs_kernel
@pytest.mark.parametrize("law", [Friction(), Friction(mu_t=1.7, mu_f=1, mu_b=1.3)], ids=str)
def test_an_instant_has_the_same_bits_on_repetition_on_threads_and_in_any_batch(monkeypatch, law):
    angles, rates = random_instants(N_TIME)
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    once = fields(law, angles, rates)
    np.testing.assert_array_equal(fields(law, angles, rates), once)
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    np.testing.assert_array_equal(fields(law, angles, rates), once)
    few = slice(4321, 4371)
    np.testing.assert_array_equal(fields(law, angles[:, few], rates[:, few]), once[:, few])


@needs_kernel
def test_views_with_any_strides_are_read_right():
    angles, rates = random_instants(40)
    whole = solve_balance(Chain(), Friction(), angles, rates, 1e-3)
    there = angles[:, ::-1], np.asfortranarray(rates[:, ::-1])
    back = solve_balance(Chain(), Friction(), *there, 1e-3, start=whole.z[:, ::-1])
    np.testing.assert_allclose(back.z[:, ::-1], whole.z, rtol=0, atol=1e-9)


def test_threads_are_those_asked_for(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "5")
    assert available_threads() == 5
    monkeypatch.setenv("OMP_NUM_THREADS", "all")
    assert available_threads() >= 1


@pytest.mark.skipif(
    native_kernel_module.built_kernel(Path(str(native_kernel_module.SOURCES))) is None,
    reason="not built",
)
def test_a_clone_that_was_not_built_uses_the_kernel_that_was_installed(fresh):
    """As `python -m colloc.solve` does in a clone, after an installation from it."""
    built = Path(library()._name)
    library.cache_clear()
    fresh.setattr(native_kernel_module, "find_spec", lambda name: None)
    installed = [SimpleNamespace(locate_file=lambda folder: built.parent)]
    fresh.setattr(metadata, "distributions", lambda name: installed)
    assert native_kernel() is not None


def test_without_a_kernel_of_its_own_sources_numpy_gives_the_answer(fresh, tmp_path):
    at = Chain(), Friction(), *random_instants(5), 1e-3
    known = solve_balance(*at).z
    changed = tmp_path / "native"
    shutil.copytree(native_kernel_module.SOURCES, changed)
    (changed / "parts.h").write_text((changed / "parts.h").read_text() + "/* changed */")
    fresh.setattr(native_kernel_module, "SOURCES", changed)
    library.cache_clear()
    with pytest.warns(SlowWarning, match="by NumPy.*not built, or its sources changed since"):
        assert native_kernel() is None
    assert native_kernel() is None  # said once
    np.testing.assert_allclose(solve_balance(*at).z, known, rtol=0, atol=1e-9)


def test_solving_a_balance_loads_neither_casadi_nor_matplotlib():
    code = (
        "import sys, numpy as np; from colloc import Chain, Friction, solve_balance;"
        "solve_balance(Chain(), Friction(), np.ones((2, 3)), np.ones((2, 3)), 1e-3).require();"
        "assert not {'casadi', 'matplotlib', 'numba'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@needs_kernel
@pytest.mark.parametrize("lengths", [(1 / 3,) * 3, (0.3, 0.2, 0.15, 0.35)], ids=len)
def test_a_period_has_the_same_bits_with_any_number_of_lanes(fresh, lengths):
    """With time points that no number of lanes divides, and where joints turn by many turns."""
    body, kernel = Chain(lengths), library()
    mesh = Mesh(scheme("radau-3"), np.linspace(0.0, 1.0, 8))
    rng, n = np.random.default_rng(3), body.n_joint
    angles = rng.uniform(-3, 3, (n, mesh.n_point))
    angles[:, 5] = 2.0**40  # whose sums are exact in any order
    shapes = Shapes(angles, rng.normal(size=(n, mesh.n_point)), 1e-3)
    with numpy_instead():
        start = solve_balance(body, Friction(), *shapes[:2], 1e-3).z
    seen = []
    for lanes in (2, 4, 8)[: {2: 1, 4: 2, 8: 3}[kernel.colloc_lanes()]]:
        for name in ("colloc_period", "colloc_period_vjp"):
            function = kernel[f"{name}_{lanes}"]
            function.argtypes = getattr(kernel, name).argtypes
            fresh.setattr(kernel, name, function)
        period = CompiledPeriod.of(QuasiStatic(body, Friction()), mesh)
        z, out, totals = period.simulate(shapes, start + 1e-3)
        np.testing.assert_allclose(z, start, rtol=0, atol=1e-10)
        slopes = period.vjp(shapes, z, out, [TotalGradient(1 + 1j, 1.0, 1.0)])
        seen.append((z, out, [totals.displacement, totals.work], *slopes))
    for other in seen:
        for one, same in zip(seen[0], other, strict=True):
            np.testing.assert_array_equal(one, same)


WITHIN_ITS_ARRAYS = """
import numpy as np
from colloc import Chain, Friction, Harmonic, Polygon, Problem, solve_balance
from colloc.mechanics import native_kernel
from colloc.mechanics.contact import far_pairs
from colloc.mechanics.fixed_point import motion_and_derivatives
from colloc.mechanics.solution_branches import all_balanced_velocities
from colloc.transcription.shape_constraints import shape_checks
from colloc.reduced import compiled_search
from colloc.reduced.program import ReducedProgram
from colloc.search.iterate import space_near
from colloc.dynamics.compiled_period import CompiledPeriod
from colloc.dynamics.dynamics import QuasiStatic, Shapes, TotalGradient
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme
from research.guarantee.c_compiler import compiled_library
from research.guarantee.kernel import FLAGS

flags = *FLAGS, "-O1", "-fsanitize=address"
native_kernel.built_kernel = lambda sources: compiled_library(sources / "kernel.c", flags, {})
assert native_kernel.library() is not None
rng = np.random.default_rng(0)
for lengths in ((0.4, 0.6), (0.3, 0.2, 0.15, 0.35)):
    body, n = Chain(lengths), len(lengths) - 1
    at = rng.uniform(-3, 3, (n, 20)), rng.normal(size=(n, 20))
    for law in (Friction(), Friction(mu_t=10, mu_b=3)):
        assert native_kernel.native_kernel(body, law) is not None
        motion_and_derivatives(body, law, *at, 1e-4, solve_balance(body, law, *at, 1e-4))
        for method in ("newton", "fixed_point"):
            solve_balance(body, law, *at, 1e-2, method=method, max_iterations=20, start=np.zeros((3, 20)))
        mesh = Mesh(scheme("hermite-simpson"), np.linspace(0.0, 1.0, 7))
        period = CompiledPeriod.of(QuasiStatic(body, law), mesh)
        shapes = Shapes(*(each[:, : mesh.n_point] for each in at), 1e-3)
        z, out, totals = period.simulate(shapes, np.full((3, mesh.n_point), np.nan))
        period.vjp(shapes, z, out, [TotalGradient(1 + 1j, 1.0, 1.0)] * 2)
        all_balanced_velocities(body, law, *at, 1e-4)
    checks = shape_checks(Chain(lengths, width=0.01), far_pairs(body), (9.0,) * n)
    which = np.repeat(np.arange(len(checks.names)), 20)
    shapes = np.tile(at[0], len(checks.names))
    checks.slopes(which, shapes, checks.shares(which, shapes))
for gait in (Harmonic(2), Polygon(6)):
    for distance in (0.1, 2.0):  # the second is more than there is: a wider quadratic program
        problem = Problem("x", gait=gait, joint_limit=1.2, at_least={"distance": distance})
        space, v = space_near(problem, problem.guess)
        program = ReducedProgram(space, 1e-3)
        program.place_rows(v)
        if isinstance(gait, Harmonic):
            program.follow_worst()
        assert program.constraints.kernel_rows is not None
        compiled_search.nearest(program, v, np.eye(v.size), 1e-6, 5)
        compiled_search.minimize(program, v, 0.4, 1e-9, 20)
"""


PROOF_WITHIN_ITS_ARRAYS = """
import numpy as np
from colloc import Chain, Friction
from research.guarantee import kernel
from research.guarantee.enclosure import CORNERS, Cells, ReferencePoint, by_convexity, corner_motions
from research.guarantee.loaded_balance import loaded_balance

kernel.FLAGS += ("-O1", "-fsanitize=address")
rng = np.random.default_rng(0)
for lengths in ((0.4, 0.6), (0.3, 0.2, 0.15, 0.35)):
    body, n = Chain(lengths), len(lengths) - 1
    at = rng.uniform(-3, 3, (n, 20)), rng.normal(size=(n, 20))
    loaded_balance(body, Friction(), *at, 0.1 * rng.normal(size=(3, 20)), np.zeros((3, 20)), 1e-4)
size = np.full((3, 20), 0.01)
low = rng.uniform(-1, 1, (3, 20))
points = (low[:, :, None] + size[:, :, None] * CORNERS.T[:, None]).reshape(3, -1)
cells = Cells(low, size, points, np.arange(160).reshape(20, 8))
point = ReferencePoint(np.zeros(160), *np.zeros((4, 20)))
by_convexity(Chain(), Friction(), cells, corner_motions(Chain(), Friction(), cells), point)
"""


@needs_kernel
@pytest.mark.slow
@pytest.mark.parametrize(
    "code", [WITHIN_ITS_ARRAYS, PROOF_WITHIN_ITS_ARRAYS], ids=["kernel", "proof"]
)
def test_compiled_code_reads_and_writes_nothing_beyond_its_arrays(code):
    """Under the address sanitizer, in a process of its own."""
    quiet = {"capture_output": True, "text": True}
    asked = [c_compiler(), "-print-file-name=libasan.so"]
    library = subprocess.run(asked, **quiet).stdout.strip()
    if not os.path.isabs(library):
        pytest.skip("the compiler has no address sanitizer")
    environment = {**os.environ, "LD_PRELOAD": library, "ASAN_OPTIONS": "detect_leaks=0"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, cwd=ROOT, **quiet)
    assert done.returncode == 0, done.stderr[-2000:]


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
    for _ in range(2):
        v = v + 0.02 * rng.normal(size=v.size)
        values, slopes = motion.values(v, delta), motion.gradients(v, delta)
        found.append(np.concatenate([[*values.values()], *slopes.values()]))
    return np.array(found)


@needs_kernel
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


@needs_kernel
def test_instants_that_newton_loses_are_balanced_joints_at_rest_rest_what_is_no_number_has_no_motion():
    compiled, shapes, rest = five_links()
    expected, *_ = compiled.simulate(shapes, rest)
    for size in (1.0, 100.0, np.nan):
        wild = compiled.simulate(shapes, size * np.random.default_rng(0).normal(size=rest.shape))[0]
        np.testing.assert_allclose(wild, expected, rtol=0, atol=1e-8)
    shapes.rates[:, ::7] = 0.0
    z, out, _ = compiled.simulate(shapes, rest)
    assert not np.vstack([z, out])[:, ::7].any()
    np.testing.assert_allclose(z[:, 1:7], expected[:, 1:7], rtol=0, atol=1e-8)
    shapes.angles[1, 5] = np.nan
    assert compiled.simulate(shapes, rest) is None


@needs_kernel
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
