"""Data flows one way: imports point down the packages and never in a circle; heavy libraries are
named in few places."""

import ast
import importlib
import re
import sys
from pathlib import Path

import pytest

from benchmarks.numbers import numbers

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
PACKAGES = tuple(re.findall(r"^\| `(\w+)` \|", PAGE, re.MULTILINE))
"""The packages of the library as the page lists them, lower ones first: a module imports its own
package and lower ones."""
BESIDE = {"__init__", "__main__", "solve"}
"""What lies beside the packages: the face, ``python -m colloc`` and ``python -m colloc.solve``."""
STAGES = ("explore", "descend", "refine", "confirm", "certify", "choose")
MOST_ON_THE_WAY = 10
"""Modules that a problem passes on its way to a solution, each called by `search.solve` itself."""
ONLY = {
    "matplotlib": {"pictures"},
    "jinja2": {"pictures"},
    "h5py": {"system", "results"},
    "casadi": {"numerics", "motion", "transcription", "reduced", "search"},
}


def packages():
    return {path.name for path in (ROOT / "colloc").iterdir() if (path / "__init__.py").exists()}


def modules():
    """Dotted name below colloc to path, of all modules in packages."""
    return {
        f"{path.parent.name}.{path.stem}": path
        for path in (ROOT / "colloc").glob("*/*.py")
        if path.stem != "__init__"
    }


def imported(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def test_the_packages_are_the_ones_the_page_lists_and_nothing_lies_beside_them():
    assert packages() == set(PACKAGES)
    assert {path.stem for path in (ROOT / "colloc").glob("*.py")} == BESIDE


def test_the_init_files_of_packages_are_empty():
    for package in PACKAGES:
        assert (ROOT / "colloc" / package / "__init__.py").read_text(encoding="utf-8") == ""


def test_imports_point_down_the_packages():
    for name, path in modules().items():
        level = PACKAGES.index(name.partition(".")[0])
        for other in imported(path):
            if other.startswith("colloc."):
                package = other.split(".")[1]
                assert package in PACKAGES, f"{name} imports {other}"
                assert PACKAGES.index(package) <= level, f"{name} imports {other} from above"


def test_the_library_imports_nothing_that_lies_outside_it():
    outside = {path.name for path in ROOT.iterdir() if path.is_dir()} - {"colloc"}
    assert {"research", "scripts", "benchmarks", "tests"} <= outside
    for path in (ROOT / "colloc").rglob("*.py"):
        assert not outside & {module.split(".")[0] for module in imported(path)}, path


def test_no_circles_between_modules():
    known = modules()
    graph = {
        name: {
            ".".join(other.split(".")[1:3])
            for other in imported(path)
            if other.startswith("colloc.")
        }
        & set(known) - {name}
        for name, path in known.items()
    }
    while graph:
        free = {name for name, needs in graph.items() if not needs & set(graph)}
        assert free, f"import circle among {sorted(graph)}"
        graph = {name: needs for name, needs in graph.items() if name not in free}


def test_heavy_libraries_are_named_in_few_packages():
    for name, path in modules().items():
        for module in imported(path):
            allowed = ONLY.get(module.split(".")[0])
            assert allowed is None or name.partition(".")[0] in allowed, f"{name} names {module}"


def test_only_one_module_names_ipopt():
    assert [
        name for name, path in modules().items() if '"ipopt"' in path.read_text(encoding="utf-8")
    ] == ["search.ipopt"]


def called_from(module, run):
    """Modules of the library that a module calls while something runs, in the order of their first
    call."""
    found = []

    def watch(frame, event, _):
        if (
            event == "call"
            and frame.f_back is not None
            and frame.f_back.f_globals.get("__name__") == module
        ):
            name = frame.f_globals.get("__name__", "")
            if name.startswith("colloc.") and name != module and name not in found:
                found.append(name)

    before = sys.getprofile()
    sys.setprofile(watch)
    try:
        run()
    finally:
        sys.setprofile(before)
    return found


def test_a_problem_passes_few_modules_on_its_way_to_a_solution_in_the_order_of_the_page():
    import colloc
    from colloc.search.solve import solve

    problem = colloc.Problem("way", gait=colloc.Harmonic(1, "bilateral"), delta=1e-2)
    way = called_from("colloc.search.solve", lambda: solve(problem, 2))
    stages = [name.rpartition(".")[2] for name in way if name.rpartition(".")[2] in STAGES]
    assert stages == list(STAGES)
    assert (
        len([name for name in way if name.startswith(("colloc.search", "colloc.results"))])
        <= MOST_ON_THE_WAY
    ), way


def test_no_stage_knows_what_comes_after_it_or_who_calls_it():
    later = {stage: {"solve", *STAGES[k + 1 :]} for k, stage in enumerate(STAGES)}
    later["explore"] -= {"descend"}  # the promising starts are followed to the end
    for stage in ("refine", "confirm"):
        later[stage] -= {"certify"}  # whose thresholds they keep
    known = modules()
    for stage, others in later.items():
        names = {
            other
            for other in imported(known[f"search.{stage}"])
            if other.startswith("colloc.search.")
        }
        assert not {name.split(".")[2] for name in names} & others, stage


def test_no_public_name_is_shadowed_by_a_package():
    """Importing colloc.x sets the attribute x of colloc, so a function of that name would vanish
    once it is used.

    ``colloc.solve`` is both: its module can be called (tests/test_face.py).
    """
    import colloc

    assert set(colloc.__all__) & (set(PACKAGES) | BESIDE) == {"solve"}


def test_what_is_bound_late_exists():
    """The face names functions of higher packages for lower ones; these are the only imports that
    do not point down."""
    import colloc  # binds
    from colloc.system import late_binding

    assert colloc
    assert all(callable(late_binding.bound(name)) for name in late_binding._WHERE)
    users = {
        name
        for name, path in modules().items()
        if "late_binding import bound" in path.read_text(encoding="utf-8")
    }
    assert users == {"results.solution", "results.robot", "studies.pareto", "studies.steering"}


def test_the_page_names_what_exists_and_fits_a_screen():
    for name in re.findall(r"`([\w/]+(?:\.py|/))`", PAGE):
        assert (ROOT / name).exists(), name
    assert len(PAGE.splitlines()) <= 75


def test_the_engine_takes_no_problem_apart():
    """`colloc.gaits.control_problem` does that once; motions, programs and errors of meshes are
    made from its parts."""
    for name, path in modules().items():
        if name.partition(".")[0] in ("motion", "verification", "transcription", "reduced"):
            assert "colloc.gaits.problem" not in set(imported(path)), name
            assert not re.search(
                r"\.problem\b", path.read_text(encoding="utf-8").replace("colloc.gaits.problem", "")
            ), name


MOST_MEMBERS, WIDER = 15, {"Body": 45, "Law": 16}
"""Of a protocol, and of those that are still wider; these may only get fewer."""


def members(name, protocols):
    """Of a protocol: its own, and those of the protocols that it derives from."""
    node = protocols[name]
    own = {item.target.id for item in node.body if isinstance(item, ast.AnnAssign)}
    own |= {item.name for item in node.body if isinstance(item, ast.FunctionDef)}
    bases = [base.id for base in node.bases if isinstance(base, ast.Name) and base.id in protocols]
    return own.union(*(members(base, protocols) for base in bases))


def test_a_protocol_has_few_members():
    classes = {
        node.name: node
        for path in modules().values()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef)
        and any(getattr(base, "id", "") == "Protocol" for base in node.bases)
    }
    counted = {name: len(members(name, classes)) for name in classes}
    assert {
        name: n for name, n in counted.items() if n > MOST_MEMBERS and n > WIDER.get(name, 0)
    } == {}


COLLOCATED = re.compile(
    r"colloc\.(motion\.(collocated|states|kinds)|numerics\.mesh|transcription|reduced|search)\b"
)
ADAPTIVE = (
    "played",
    "replay",
    "panels",
    "adaptive_motion",
    "slope",
    "inertial_motion",
    "dry_balance",
    "dry_friction",
)


def test_what_checks_a_motion_shares_no_mesh_and_no_program_with_what_found_it():
    known, wanted = modules(), {f"verification.{name}" for name in ADAPTIVE}
    assert wanted <= known.keys()
    seen = set()
    while wanted:
        name = wanted.pop()
        seen.add(name)
        others = set(imported(known[name]))
        assert not any(map(COLLOCATED.match, others)), (
            f"{name} imports {sorted(filter(COLLOCATED.match, others))}"
        )
        wanted |= {other.removeprefix("colloc.") for other in others} & known.keys() - seen


NUMBERS = {
    "explore": 8,
    "descend": 3,
    "refine": 5,
    "confirm": 3,
    "certify": 10,
    "solve": 2,
    "converge": 4,
    "effort": 2,
}
"""At most so many numbers that somebody has set, in the stages of a search: `python -m
benchmarks.numbers` says what each trades. They may become fewer."""


@pytest.mark.parametrize("stage", NUMBERS)
def test_a_stage_is_steered_by_few_numbers(stage):
    module = importlib.import_module(f"colloc.search.{stage}")
    assert len(list(numbers(module))) <= NUMBERS[stage]
