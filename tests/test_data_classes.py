"""What kind of thing each of the library's data classes is: a value, which others may be equal to,
or one of its own."""

import dataclasses
import importlib
import inspect
import pkgutil

import colloc

# fmt: off
VALUES = {
    "BSpline", "Basis",
    "Bound", "Budget", "Certificate", "Check", "Concertina", "CrawlerBody", "Domain", "Elliptic",
    "FeetLaw", "Foot",
    "Friction", "GaitClass", "Harmonic", "JointMap", "Limit", "Links", "ModalBody", "Objective",
    "OwnLaw", "Period", "Polygon",
    "Coupled", "Paced", "PacedOnSlope", "PathLimit", "PathLimits", "PotentialSpace",
    "Quantity", "Regime", "Slope",
    "PowerLaw", "Prescribed", "Problem", "ProblemFile", "Reference", "Replay", "Saved",
    "TensorSpline",
    "Serpenoid", "Viscous", "Wave", "Lost", "Task", "Axis", "Study", "Effort", "SecondOrder",
    "Step", "Gap",
}
MUTABLE = {
    "Archive", "Candidate", "CellState", "Run", "Solution", "State",
    "_Heard",
    "_Meshes", "_State",
}
# fmt: on


def data_classes():
    modules = (
        m.name
        for m in pkgutil.walk_packages(colloc.__path__, "colloc.")
        if not m.name.endswith(("__main__", "._kernel"))
    )
    for name in modules:
        for thing in vars(importlib.import_module(name)).values():
            if (
                inspect.isclass(thing)
                and thing.__module__ == name
                and "__dataclass_params__" in vars(thing)
            ):
                yield thing


def test_values_compare_and_hash_by_their_fields_and_nothing_else_does():
    """Arrays have no truth value, so what holds them is no value."""
    by_fields = {c for c in data_classes() if c.__dataclass_params__.eq and c.__name__ != "_Heard"}
    assert {c.__name__ for c in by_fields} == VALUES
    held = {
        c.__name__: [
            f.name for f in dataclasses.fields(c) if f.compare and "ndarray" in str(f.type)
        ]
        for c in by_fields
    }
    assert not {name: fields for name, fields in held.items() if fields}
    assert all(c.__hash__ is not None for c in by_fields)


def test_only_what_is_under_way_can_be_changed():
    assert {c.__name__ for c in data_classes() if not c.__dataclass_params__.frozen} == MUTABLE


def test_classes_are_printed_by_their_fields_or_a_method_of_their_own():
    """Gaits by that of all gaits."""
    gaits = {"Combination", "Corners", "Fourier", "Phases", "SerpenoidSeries"}
    assert {c.__name__ for c in data_classes() if not c.__dataclass_params__.repr} == gaits
