"""The compiled kernel: the same bits on any threads and in any batch; faults cost speed only."""

import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from shared.address_sanitizer import stays_within_its_arrays
from shared.instants import random_instants

from colloc import Chain, Friction, solve_balance
from colloc.dynamics.compiled_period import CompiledPeriod
from colloc.dynamics.dynamics import QuasiStatic, Shapes, TotalGradient
from colloc.mechanics import native_kernel as native_kernel_module
from colloc.mechanics.native_kernel import library, native_kernel
from colloc.numerics.mesh import Mesh
from colloc.numerics.schemes import scheme
from colloc.system.environment import available_threads
from colloc.system.errors import SlowWarning

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
    fresh.setattr(
        metadata,
        "distributions",
        lambda name: [SimpleNamespace(locate_file=lambda folder: built.parent)],
    )
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
    angles = rng.uniform(-3, 3, (n, mesh.n_point)) + 2e5 * (np.arange(mesh.n_point) == 5)
    shapes = Shapes(angles, rng.normal(size=(n, mesh.n_point)), 1e-3)
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
from colloc import Chain, Friction, solve_balance
from colloc.mechanics import native_kernel
from colloc.mechanics.fixed_point import motion_and_derivatives
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
"""


@needs_kernel
@pytest.mark.slow
def test_it_reads_and_writes_nothing_beyond_its_arrays():
    stays_within_its_arrays(WITHIN_ITS_ARRAYS)
