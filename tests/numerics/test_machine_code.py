"""Compiled code computes what CasADi interprets, to the last bit, and whatever is wrong with it costs speed only."""

import os
import shutil
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from colloc import Chain, FreePath, Friction, Harmonic, Polygon, Problem, ellipse
from colloc.collocation.path_equations import arc, path_point
from colloc.collocation.point_equations import balance_steps, point_function
from colloc.numerics.machine_code import FOLDER, code_folder, compiler, compiling, machine_code
from colloc.search.compiled_problem import DIFFERENTIATED_ONCE, compile_problem
from colloc.system.errors import ProblemError, StoreError

needs_compiler = pytest.mark.skipif(not any(map(shutil.which, ("cc", "gcc", "clang"))), reason="no C compiler")
needs_posix = pytest.mark.skipif(sys.platform == "win32", reason="POSIX permissions")
THIRD = Chain((1 / 3,) * 3)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv(FOLDER, str(tmp_path / "code"))
    for function in DIFFERENTIATED_ONCE:
        function.cache_clear()
    yield tmp_path / "code"
    for function in DIFFERENTIATED_ONCE:
        function.cache_clear()


def long_function(operations=1500, scale=1.0):
    x = ca.SX.sym("x", 2)
    y = x
    for k in range(operations // 4):
        y = ca.sin(scale * y + k)
    return ca.Function("tower", [x], [y])


def is_compiled(function):
    return "External" in repr(function)


@needs_compiler
def test_derivatives_are_equal_to_the_last_bit_at_random_and_at_hard_points(folder):
    law = Friction(1.7, 1, 1.3)
    interpreted = point_function("condensed", THIRD, law)
    newton = balance_steps(THIRD, law)
    compile_problem(Problem("any", friction=law, gait=Harmonic(1), guess=ellipse(0.3, 1.0, 0.5)))
    compiled = point_function("condensed", THIRD, law)
    assert is_compiled(compiled.hessian)
    assert not is_compiled(interpreted.hessian)
    rng = np.random.default_rng(3)
    for delta in (1.0, 1e-4, 1e-12):
        local, z, weight = rng.normal(size=(8, 50)), rng.normal(size=(3, 50)), rng.normal(size=(5, 50))
        local[:, 0], z[:, 0] = 0.0, 0.0  # at rest
        z[2, 1] = local[3:5, 1] = 0.0  # pure translation
        deltas = np.full((1, 50), delta)
        instants = (local[1:3], local[3:5], z, deltas)
        pairs = [
            (interpreted.value(local, z, deltas), compiled.value(local, z, deltas)),
            (interpreted.jacobian(local, z, deltas), compiled.jacobian(local, z, deltas)),
            (interpreted.hessian(local, z, deltas, weight), compiled.hessian(local, z, deltas, weight)),
            *zip(newton(*instants), balance_steps(THIRD, law)(*instants), strict=True),
        ]
        for a, b in pairs:
            np.testing.assert_array_equal(a.full(), b.full())


@needs_compiler
def test_nothing_is_compiled_unasked_and_what_was_compiled_is_found_again(folder):
    function = long_function()
    assert machine_code([function]) == [function]
    assert not folder.exists()
    with compiling():
        assert is_compiled(machine_code([function])[0])
    assert is_compiled(machine_code([long_function()])[0])
    assert not is_compiled(machine_code([long_function(scale=1.1)])[0])
    assert len(list(folder.iterdir())) == 1


@needs_compiler
def test_free_paths_share_their_code_and_so_do_polygons(folder):
    """Neither bounds on curvature, meshes, numbers of corners, symmetries nor guesses are part of the code."""
    path = Problem("p", ellipse(0, 1.5, 1.0), gait=FreePath(2.0, "bilateral"), intervals=8)
    compile_problem(path)
    compile_problem(path.with_(gait=Polygon(3, "bilateral")))
    kept = set(folder.iterdir())
    compile_problem(path.with_(gait=FreePath(8.0, "none"), guess=ellipse(0.2, 1.8, 1.2), intervals=11))
    compile_problem(path.with_(gait=Polygon(5, "none"), intervals=20))
    assert set(folder.iterdir()) == kept
    point = path_point(path.body, path.friction, arc)
    assert is_compiled(point.hessian)
    assert path_point(path.body, path.friction, arc) is point


@needs_compiler
def test_small_functions_stay_interpreted(folder):
    with compiling():
        assert not is_compiled(machine_code([long_function(operations=100)])[0])


@needs_compiler
@pytest.mark.parametrize("damage", [b"", b"not a library", None], ids=["empty", "text", "another function's"])
def test_a_damaged_library_is_not_used_and_the_next_compilation_mends_it(folder, damage):
    function = long_function()
    with compiling():
        machine_code([function])
    (library,) = folder.iterdir()
    if damage is None:
        with compiling():
            machine_code([long_function(scale=1.1)])
        (other,) = set(folder.iterdir()) - {library}
        damage = other.read_bytes()
    library.unlink()
    library.write_bytes(damage)
    assert not is_compiled(machine_code([function])[0])
    with compiling():
        assert is_compiled(machine_code([function])[0])


@needs_compiler
@needs_posix
@pytest.mark.parametrize("part", ["folder", "library"])
def test_code_that_others_could_have_written_is_not_run(part, folder):
    function = long_function()
    with compiling():
        machine_code([function])
    (library,) = folder.iterdir()
    assert folder.stat().st_mode & 0o777 == 0o700
    assert library.stat().st_mode & 0o777 == 0o600
    path = {"folder": folder, "library": library}[part]
    for mode in (0o770, 0o707):
        path.chmod(mode)
        assert not is_compiled(machine_code([function])[0])
    path.chmod(0o700)
    assert is_compiled(machine_code([function])[0])


@needs_compiler
@needs_posix
def test_no_code_is_put_where_others_can_write(folder):
    folder.mkdir(mode=0o755)
    folder.chmod(0o777)
    with compiling(), pytest.raises(StoreError, match="can be written by others: chmod go-w it"):
        machine_code([long_function()])
    assert not list(folder.iterdir())


@needs_compiler
@needs_posix
@pytest.mark.parametrize("part", ["folder", "library"])
def test_code_of_another_user_is_not_run(part, folder, monkeypatch):
    function = long_function()
    with compiling():
        machine_code([function])
    (library,) = folder.iterdir()
    theirs = {"folder": folder, "library": library}[part]
    stat = os.stat

    def other(path, **options):
        found = list(stat(path, **options))
        return os.stat_result([*found[:4], 4711, *found[5:]]) if Path(path) == theirs else os.stat_result(found)

    monkeypatch.setattr("colloc.system.private_folder.os.stat", other)
    assert not is_compiled(machine_code([function])[0])
    if part == "folder":
        with compiling(), pytest.raises(StoreError, match="belongs to another user"):
            machine_code([function])


def test_without_a_compiler_or_switched_off_the_user_is_told(folder, monkeypatch):
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(ProblemError, match="no C compiler"), compiling():
        pass
    monkeypatch.setenv(FOLDER, "off")
    assert code_folder() is None
    assert compiler() is None
    with pytest.raises(ProblemError, match="switched off"), compiling():
        pass


@needs_compiler
def test_a_compiler_that_fails_is_quoted_and_leaves_nothing(folder, monkeypatch, tmp_path):
    broken = tmp_path / "cc"
    broken.write_text("#!/bin/sh\necho 'out of patience' >&2\nexit 1\n")
    broken.chmod(0o755)
    monkeypatch.setenv("CC", str(broken))
    with compiling(), pytest.raises(StoreError, match="out of patience"):
        machine_code([long_function()])
    assert not list(folder.glob("*.so"))


def test_a_user_without_a_home_or_a_readable_cache_has_no_code(monkeypatch, tmp_path):
    for name in (FOLDER, "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    with monkeypatch.context() as without:
        without.setattr("os.path.expanduser", lambda path: path)  # as where there is no home
        assert code_folder() is None
    a_file = tmp_path / "file"
    a_file.write_text("")
    monkeypatch.setenv(FOLDER, str(a_file / "below"))
    function = long_function()
    assert machine_code([function]) == [function]


@needs_compiler
def test_a_folder_that_cannot_be_written_is_named(monkeypatch, tmp_path):
    a_file = tmp_path / "file"
    a_file.write_text("")
    monkeypatch.setenv(FOLDER, str(a_file / "below"))
    with compiling(), pytest.raises(StoreError, match="below"):
        machine_code([long_function()])


def test_a_program_that_is_no_compiler_is_named(folder, monkeypatch, tmp_path):
    broken = tmp_path / "cc"
    broken.write_bytes(b"\x00\x01")
    broken.chmod(0o755)
    monkeypatch.setenv("CC", str(broken))
    with compiling(), pytest.raises(StoreError, match="could not be run"):
        machine_code([long_function()])
