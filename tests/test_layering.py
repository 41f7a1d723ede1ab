"""Data flows one way: imports point down, heavy libraries are named in one place, modules stay short."""

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LEVELS = {
    0: [
        "symmetry",
        "arrays",
        "errors",
        "schemes",
        "parallel",
        "json_cache",
        "spline",
        "replaced_file",
        "markup",
        "progress",
        "interruption",
        "task_pool",
        "sealed_file",
        "file_lock",
        "minimax_program",
        "multiplier_estimate",
        "machine_code",
        "command_end",
        "private_folder",
    ],
    1: ["arcs", "path_gait", "friction", "body", "gait", "contact", "mesh", "motion", "curve", "point_friction", "chart"],
    2: [
        "path_class",
        "path_samples",
        "gait_fields",
        "balance",
        "problem",
        "damped_newton",
        "bump_body",
        "ellipses",
        "equivalence",
        "modal_body",
        "modal_problem",
    ],
    3: [
        "fixed_point",
        "layout",
        "blocks",
        "program",
        "constraint_rows",
        "shape_checks",
        "path_kernels",
        "path_geometry",
        "path_transcription",
        "kernels",
        "newton_balance",
        "velocity_callback",
        "path_replay",
        "warm_start",
        "worst_instants",
        "transcription",
        "smooth_balance",
        "bump_balance",
        "bump_transcription",
        "sampling",
        "far_contact",
        "fine_motion",
        "kinks",
        "mesh_error",
        "smooth_batch",
        "stop_request",
        "modal_balance",
        "modal_transcription",
        "balanced_velocity",
    ],
    4: [
        "nlp",
        "path_start",
        "level",
        "solution",
        "problem_file",
        "store",
        "refinement",
        "smooth_period",
        "array_store",
        "velocity_map",
        "static_friction",
        "motion_record",
        "smooth_record",
        "coulomb_motion",
        "loaded_balance",
        "potential",
        "bound_sampling",
        "infinitesimal",
        "closure",
        "solution_card",
        "condensed",
        "condensed_program",
        "prediction",
        "problem_study",
        "store_file",
        "gait_class",
        "exchange",
        "cycle_search",
    ],
    5: [
        "verify",
        "diagnosis",
        "continuation",
        "compiled_problem",
        "level_run",
        "concertina",
        "epsilon_study",
        "chain_study",
        "bump_optimum",
        "wave_optimum",
        "map_store",
        "sweep",
        "flap",
        "study",
        "bound",
        "bound_margin",
        "basins",
        "store_archive",
        "delta_limit",
        "trajectory",
        "motion_frames",
        "modal_optimum",
    ],
    6: [
        "optimise",
        "campaign",
        "multistart",
        "gap",
        "homotopy",
        "prolongation",
        "figures",
        "figures_smooth",
        "figures_classes",
        "figures_bound",
        "solve",
        "figures_style",
        "figures_bodies",
        "figures_maps",
        "figures_crawlers",
        "figures_paper",
        "command_options",
        "command",
        "recheck",
        "compare",
        "export",
        "report_charts",
        "report_page",
        "report",
        "figures_publication",
        "figures_animation",
        "animate",
        "figures_studies",
        "figures_precision",
    ],
    7: ["study_cell", "study_journal", "study_run", "study_table", "store_study", "sweep_study"],
}
LEVEL = {module: level for level, modules in LEVELS.items() for module in modules}
ONLY = {"matplotlib": "figures", "h5py": "store"}


def modules():
    return {path.stem: path for path in (ROOT / "colloc").glob("*.py") if path.stem not in ("__init__", "__main__")}


def imported(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


def test_every_module_has_a_level():
    assert set(modules()) == set(LEVEL)


def test_imports_point_down_or_within_a_level_without_cycles():
    graph = {}
    for name, path in modules().items():
        own = {m.split(".")[1] for m in imported(path) if m.startswith("colloc.")}
        graph[name] = own
        for other in own:
            assert LEVEL[other] <= LEVEL[name], f"{name} imports {other} from above"
    while graph:
        free = {name for name, needs in graph.items() if not needs & set(graph)}
        assert free, f"import cycle among {sorted(graph)}"
        graph = {name: needs for name, needs in graph.items() if name not in free}


def test_heavy_libraries_are_named_in_one_kind_of_module():
    for name, path in modules().items():
        for module in imported(path):
            library = module.split(".")[0]
            if library in ONLY:
                assert ONLY[library] in name, f"{name} names {library}"


def test_the_numpy_side_never_loads_casadi():
    numpy_side = [m for m in LEVEL if "casadi" in {i.split(".")[0] for i in imported(modules()[m])}]
    assert set(numpy_side) <= {
        "arrays",
        "balanced_velocity",
        "blocks",
        "bump_transcription",
        "condensed",
        "condensed_program",
        "kernels",
        "machine_code",
        "modal_transcription",
        "newton_balance",
        "nlp",
        "path_geometry",
        "path_kernels",
        "path_transcription",
        "shape_checks",
        "stop_request",
        "worst_instants",
        "transcription",
        "velocity_callback",
    }


def test_only_one_module_names_ipopt():
    assert [n for n, p in modules().items() if '"ipopt"' in p.read_text(encoding="utf-8")] == ["nlp"]


def test_modules_are_short():
    for name, path in modules().items():
        assert len(path.read_text(encoding="utf-8").splitlines()) <= 350, name


def test_no_public_name_is_shadowed_by_a_module():
    """Importing colloc.x sets the attribute x of colloc, so a function of that name would vanish once it is used."""
    import colloc

    assert not set(colloc.__all__) & set(modules())
