"""Data flows one way: imports point down the packages and never in a circle; heavy libraries are
named in few places; what checks shares nothing with what finds."""

import ast
import dataclasses
import importlib
import inspect
import re
from pathlib import Path

import colloc
from colloc.system.environment import higher

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
PACKAGES = tuple(re.findall(r"^- `(\w+)`: ", PAGE, re.MULTILINE))
"""The packages of the library as the page lists them, lower ones first."""
BESIDE = {"__init__", "__main__", "solve"}
"""What lies beside the packages: the face, ``python -m colloc`` and ``python -m colloc.solve``."""
ONLY = {
    "matplotlib": {"pictures"},
    "jinja2": {"pictures"},
    "h5py": {"system", "results"},
    "casadi": {"numerics", "dynamics", "transcription", "reduced", "search"},
}
COLLOCATED = re.compile(
    r"colloc\.(dynamics\.(collocated|states|dynamics|control_problem)|numerics\.mesh|transcription|reduced|search)\b"
)
ADAPTIVE = "adaptive_motion differential_motion replay dry_friction"


def imported(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


MODULES = {
    f"{path.parent.name}.{path.stem}": set(imported(path))
    for path in (ROOT / "colloc").glob("*/*.py")
    if path.stem != "__init__"
}
"""What all modules in packages import, by their dotted names below colloc."""


def test_the_packages_are_the_ones_the_page_lists_and_nothing_lies_beside_them():
    folders = {path.parent.name for path in (ROOT / "colloc").glob("*/__init__.py")}
    assert folders == set(PACKAGES)
    assert {path.stem for path in (ROOT / "colloc").glob("*.py")} == BESIDE
    # importing colloc.x sets the attribute x of colloc, so a function of that name would vanish;
    # colloc.solve is both: its module can be called (tests/test_face.py)
    assert set(colloc.__all__) & (set(PACKAGES) | BESIDE) == {"solve"}


def test_imports_point_down_the_packages():
    for name, needs in MODULES.items():
        level = PACKAGES.index(name.partition(".")[0])
        for other in needs:
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
    graph = {
        name: {".".join(each.split(".")[1:3]) for each in needs} & MODULES.keys() - {name}
        for name, needs in MODULES.items()
    }
    while graph:
        free = {name for name, needs in graph.items() if not needs & set(graph)}
        assert free, f"import circle among {sorted(graph)}"
        graph = {name: needs for name, needs in graph.items() if name not in free}


def test_heavy_libraries_are_named_in_few_packages():
    for name, needs in MODULES.items():
        for module in needs:
            allowed = ONLY.get(module.split(".")[0])
            assert allowed is None or name.partition(".")[0] in allowed, f"{name} names {module}"


def test_what_checks_a_motion_shares_no_mesh_and_no_program_with_what_found_it():
    wanted, seen = {f"verification.{name}" for name in ADAPTIVE.split()}, set()
    assert wanted <= MODULES.keys()
    while wanted:
        name = wanted.pop()
        seen.add(name)
        shared = sorted(filter(COLLOCATED.match, MODULES[name]))
        assert not shared, f"{name} imports {shared}"
        wanted |= {each.removeprefix("colloc.") for each in MODULES[name]} & MODULES.keys() - seen


def test_data_classes_that_compare_by_their_fields_hold_no_array():
    """An array has no truth value: comparing two such values would end in an error of NumPy's."""
    for module in map(importlib.import_module, (f"colloc.{name}" for name in MODULES)):
        for thing in vars(module).values():
            if inspect.isclass(thing) and thing.__module__ == module.__name__:
                made = vars(thing).get("__dataclass_params__")
                fields = dataclasses.fields(thing) if made and made.eq else ()
                held = [f.name for f in fields if f.compare and "ndarray" in str(f.type)]
                assert not held, f"{thing.__name__} compares {held}"


def test_what_lower_packages_import_on_use_exists():
    """`higher` names what packages above offer: the only imports that do not point down."""
    for name in MODULES.keys() - {"system.environment"}:
        text = (ROOT / f"colloc/{name.replace('.', '/')}.py").read_text(encoding="utf-8")
        for place in re.findall(r'higher\(\s*"([^"]+)"', text):
            assert callable(higher(place)), f"{name}: {place}"
