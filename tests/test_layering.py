"""Data flows one way: imports point down the packages and never in a circle; heavy libraries are named in few places."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
PACKAGES = tuple(re.findall(r"^\| `(\w+)` \|", PAGE, re.MULTILINE))
"""The packages of the library as the page lists them, lower ones first: a module imports its own package and lower ones."""
BESIDE = {"__init__", "__main__", "solve"}
"""What lies beside the packages: the face, ``python -m colloc`` and ``python -m colloc.solve``."""
MOST_FILES, MOST_LINES = 16, 350
ONLY = {
    "matplotlib": {"pictures"},
    "jinja2": {"pictures"},
    "h5py": {"system", "results", "studies"},
    "casadi": {"numerics", "collocation", "reduced", "search"},
}


def packages():
    return {path.name for path in (ROOT / "colloc").iterdir() if (path / "__init__.py").exists()}


def modules():
    """Dotted name below colloc to path, of all modules in packages."""
    return {f"{path.parent.name}.{path.stem}": path for path in (ROOT / "colloc").glob("*/*.py") if path.stem != "__init__"}


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


def test_no_circles_between_modules():
    known = modules()
    graph = {
        name: {".".join(other.split(".")[1:3]) for other in imported(path) if other.startswith("colloc.")} & set(known) - {name}
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
    assert [name for name, path in modules().items() if '"ipopt"' in path.read_text(encoding="utf-8")] == ["search.nlp"]


def test_packages_and_modules_are_small():
    known = modules()
    for package in PACKAGES:
        assert sum(name.startswith(f"{package}.") for name in known) <= MOST_FILES, package
    for name, path in known.items():
        assert len(path.read_text(encoding="utf-8").splitlines()) <= MOST_LINES, name


def test_no_public_name_is_shadowed_by_a_package():
    """Importing colloc.x sets the attribute x of colloc, so a function of that name would vanish once it is used.

    ``colloc.solve`` is both: its module can be called (tests/test_face.py).
    """
    import colloc

    assert set(colloc.__all__) & (set(PACKAGES) | BESIDE) == {"solve"}


def test_what_is_bound_late_exists():
    """The face names functions of higher packages for lower ones; these are the only imports that do not point down."""
    import colloc  # binds
    from colloc.system import late_binding

    assert colloc
    assert all(callable(late_binding.bound(name)) for name in late_binding._WHERE)
    users = {name for name, path in modules().items() if "late_binding import bound" in path.read_text(encoding="utf-8")}
    assert users == {"results.solution", "studies.pareto"}


def test_the_page_names_what_exists_and_fits_a_screen():
    for name in re.findall(r"`([\w/]+(?:\.py|/))`", PAGE):
        assert (ROOT / name).exists(), name
    assert len(PAGE.splitlines()) <= 50
