"""What people type by mistake: every public function and class answers with a sentence, and numbers
are what they are."""

import inspect
import json
import warnings

import numpy as np
import pytest

import colloc
from colloc import (
    Axis,
    Chain,
    CollocError,
    Foot,
    Free,
    Friction,
    Harmonic,
    Objective,
    OwnLaw,
    PathLimit,
    PowerLaw,
    Problem,
    ProblemError,
    Quantity,
    Study,
    Viscous,
    ellipse,
)  # fmt: skip
from colloc.system.errors import OrderWarning

GAIT = ellipse(0.0, 1.2, 0.8)
PROBLEM = Problem("quick", gait=Harmonic(1, "bilateral"), delta=1e-2)
ON = {"body": Chain(), "friction": Friction(), "gait": GAIT, "delta": 1e-2}
TABLE = [[0.1, 1, 2], [0.2, 1, 2], [0.3, 1, 2], [0.5, 1, 2], [1, 1, 2]]
NEEDED = {
    "Axis": {"name": "mu_t", "values": (1, 2)},
    "Basis": {"columns": (np.sin(np.arange(64) * np.pi / 32),)},
    "Corners": {"corners": np.array([[1, 0, -1.0], [0, 1, 0]])}, "Coupled": {
    "gears": ((1.0,), (1.0,))},
    "Foot": {"link": 0}, "Fourier": {"mean": [0, 0], "cos": [[1.0], [0]], "sin": [[0], [1.0]]},
    "Pad": {"link": 0},
    "Objective": {"expression": "distance/work"}, "PathLimit": {"name": "x", "function": "moment",
    "most": 1.0},
    "Problem": {"name": "x"}, "Quantity": {"name": "heat", "density": "sum(moment**2)"},
    "Reference": {"efficiency": 1.0, "tolerance": 0.1, "source": "x"}, "Wheel": {"link": 0},
    "Study": {"name": "s", "axes": (Axis("mu_t", (1, 2)),), "problem": lambda mu_t: PROBLEM},
    "certify": {"answer": None}, "ellipse": {"A0": 0.0, "A1": 1.0, "B1": 1.0},
    "evaluate": {"problem": PROBLEM, "gait": None}, "fitted_friction": {"table": TABLE},
    "inertial_motion": {**ON, "froude": 0.0},
    "load": {"path": "none.h5"}, "load_problem": {"path": "none.py"}, "motion_from_rest": {**ON,
    "froude": 0.0},
    "multistart": {"problem": "none.py"}, "pareto_front": {"problem": PROBLEM, "points": 1},
    "replay": {"body": Chain(), "friction": Friction(), "path": GAIT, "delta": 0.0},
    "save": {"solution": None, "path": "s.h5"},
    "slope_motion": {**ON, "grade": 2.0}, "slow_enough": {**ON, "loss": 0.0},
    "solve": {"problem": "none.py"},
    "solve_balance": {"body": Chain(), "friction": Friction(), "angles": GAIT.mean,
    "rates": GAIT.mean, "delta": 0.0},
    "steer": {"problem": PROBLEM, "turns": []}, "sweep": {"study": "none.py"},
}  # fmt: skip
"""Arguments that are there in any case; of what would compute for long, one is wrong, so that
nothing is computed."""
MADE_BY_COLLOC = {"FittedFriction", "Known", "Solution", "Starts", "Free", "CollocError",
"NotConvergedError", "ProblemError",
                  "StoreError"}  # fmt: skip


BAD = [
    None,
    "a",
    -1,
    float("nan"),
    float("inf"),
    [],
    {},
    10**400,
    b"x",
    1j,
    np.bool_(True),
    object(),
    Friction,
    ["a"],
]


@pytest.mark.parametrize("name", [name for name in colloc.__all__ if name not in MADE_BY_COLLOC])
def test_a_wrong_argument_of_a_public_name_ends_in_a_sentence(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made, needed, said = getattr(colloc, name), NEEDED.get(name, {}), []
    for each in inspect.signature(made).parameters.values():
        for value in BAD:
            try:
                made(**{**needed, "offset" if each.kind is each.VAR_KEYWORD else each.name: value})
            except CollocError as error:
                said.append(str(error))
    assert all(10 < len(each) < 1000 and each[-1] in ".?" for each in said), said
    assert said or not inspect.signature(made).parameters


@pytest.mark.parametrize(
    "name", [name for name in NEEDED if name[0].islower() and name != "ellipse"]
)
def test_a_function_that_lacks_an_argument_or_has_none_of_that_name_says_so(name):
    with pytest.raises(ProblemError, match=f"{name}: missing a required argument"):
        getattr(colloc, name)()
    with pytest.raises(ProblemError, match=f"{name}: got an unexpected keyword argument 'colour'"):
        getattr(colloc, name)(**NEEDED[name], colour=1)


KINDS = [np.float32, np.float16, np.float64, np.longdouble]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    "field",
    ["delta", "delta_start", "smallest_shape_speed", "froude", "joint_limit", "torque_limit"],
)
def test_numbers_of_numpy_are_the_numbers_of_python(kind, field):
    usual = {"gait": Harmonic(1), "smallest_shape_speed": 0.01}
    stated = Problem("x", **usual | {field: kind(0.5)})
    if field != "torque_limit" and field != "froude":
        stated = stated.with_(torque_limit=np.array([kind(0.25), kind(0.5)]))
    assert type(getattr(stated, field)) is float
    json.dumps(stated.to_dict())
    assert (
        Problem.from_dict(stated.to_dict()).hash == stated.hash == stated.with_(**{field: 0.5}).hash
    )


def test_equal_problems_have_equal_hashes_however_their_numbers_are_written():
    feet, same_feet = (
        (Foot(0, 1), Foot(1), Foot(2, 0)),
        (Foot(np.int64(0), 1.0), Foot(1, np.float32(0.5)), Foot(2, 0.0)),
    )
    one = Problem(
        "x", body=Chain(feet=feet), friction=Friction(1, 1, 1), gait=Harmonic(1), joint_limit=2
    )
    other = Problem(
        "x", body=Chain(feet=same_feet), friction=Friction(1.0, np.float32(1), np.int8(1)),
        gait=Harmonic(np.int32(1)),
        joint_limit=2.0, shrinking=np.bool_(False), intervals=np.int64(24),
    )  # fmt: skip
    assert one.with_(intervals=24).hash == other.hash
    assert one.friction == other.friction
    assert isinstance(one.friction.mu_t, float)
    assert other.shrinking is False


@pytest.mark.parametrize(
    ("made", "read"),
    [
        (lambda: Friction(0.11, 0.14, 0.20), "mu_t=0.11, mu_f=0.14, mu_b=0.2"),
        (lambda: Friction(0.3), "mu_t=0.3, mu_f=1, mu_b=1"),
        (lambda: Friction(1, 1, mu_b=2), "mu_t=1, mu_f=1, mu_b=2"),
        (lambda: colloc.Elliptic(2, 1, 1), "Elliptic.mu_t=2, mu_f=1, mu_b=1"),
        (lambda: PowerLaw(0.5, 2.0), "mu_t=2, mu_f=1, mu_b=1"),
        (lambda: Viscous(2, 1), "normal=2, tangential=1"),
    ],
)
def test_coefficients_that_differ_and_have_no_names_warn_how_they_are_read(made, read):
    with pytest.warns(OrderWarning, match=f"read as .*{read}"):
        made()


def test_coefficients_that_are_equal_or_named_do_not_warn():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        law = Friction(mu_f=0.11, mu_b=0.14, mu_t=0.20)
        assert Friction(0.2, 0.2, 0.2).isotropic
        assert PowerLaw(0.5).power == 0.5
        assert law.in_units_of(0.1).mu_b == pytest.approx(1.4)


SENTENCES = {
    "a constant objective": (lambda: Objective("1"), "speaks of nothing"),
    "a constant objective without a value": (lambda: Objective("log(-1)"), "speaks of nothing"),
    "an objective that is flat": (lambda: Objective("distance ** 1000"), "too flat or too steep"),
    "an objective times nothing": (lambda: Objective("0 * distance"), "too flat or too steep"),
    "an objective over nothing": (lambda: Objective("distance / work + 1/0"),
    "no finite real number"),
    "a root of what is negative": (lambda: Objective("distance * (-1) ** 0.5"),
    "no finite real number"),
    "a power beyond all bounds": (lambda: Quantity("heat", "sum(moment ** 2) * 9.0**9**9"),
    "no finite real number"),
    "a number beyond all bounds": (lambda: Objective(f"distance * 1{'0' * 400}"),
    "no value|no finite"),
    "a function of too many": (lambda: OwnLaw("-sqrt(vs, vn)", "-vn"),
    "sqrt takes 1 argument, not 2"),
    "a function of too few": (lambda: PathLimit("p", "where(power > 0)", 1.0),
    "where takes 3 arguments, not 1"),
    "friction over zero": (lambda: OwnLaw("1/0", "-vn/speed"), "no finite real number"),
    "friction over the norm": (lambda: OwnLaw("-vs/sqrt(vs**2+vn**2)", "-2*vn/sqrt(vs**2+vn**2)"),
    "divide by speed"),
    "friction of lists": (lambda: OwnLaw([], "-vn"), "must be text"),
    "a class for a law": (lambda: Foot(0, friction=Friction), r"as Friction\(\)"),
    "a text for yes": (lambda: Problem("x", shrinking="no"), "shrinking must be True or False, "
                                                             "not 'no'"),
    "a number for yes": (lambda: colloc.Concertina(backwards=1), "backwards must be True or False"),
    "a goal without a value": (lambda: Problem("x", at_least="distance"), "at_least names what "
                                                                          "must be reached"),
    "goals in threes": (lambda: Problem("x", at_least=[("distance", 0.1, 0.2)]),
    "at_least names what must be reached"),
    "friction that is viscous": (lambda: Problem("x", delta=1e308), "delta .* at most 1000"),
    "an axis called like a column": (lambda: Axis("efficiency", (1, 2)),
    "as a column of the results is"),
    "an axis called like a dimension": (lambda: Axis("joint", (1, 2)),
    "as a column of the results is"),
    "an axis without a name": (lambda: Axis(None, (1, 2)), "must be a Python name"),
    "a seed of 23 digits": (lambda: colloc.multistart(PROBLEM, 1, seed=10**22), "seed must be"),
    "a seed of a study of 23 digits": (lambda: Study("s", (Axis("x", (1,)),), lambda x: PROBLEM,
    seed=10**22), "seed must be"),
    "no workers": (lambda: colloc.multistart(PROBLEM, workers=0), "workers must be a whole number "
                                                                  "of at least 1"),
    "no time": (lambda: colloc.multistart(PROBLEM, time_limit=-1), "time_limit must be positive"),
    "a million years of periods": (
        lambda: colloc.slope_motion(**ON, grade=0.1, heading=0.0, periods=10**9),
        "periods must be .* from 1 to 10000",
    ),
    "periods from rest": (lambda: colloc.motion_from_rest(**ON, froude=0.1, periods=10**9),
    "periods must be"),
    "quantities that are a number": (lambda: Objective("distance", quantities=3),
    "3 is no quantity"),
    "a list of lists of different lengths": (
        lambda: colloc.solve_balance(Chain(), Friction(), [[1.0, 2.0], [3.0]], np.ones((2, 1)),
        1e-3), "angles must be numbers",
    ),
    "complex angles": (
        lambda: colloc.solve_balance(Chain(), Friction(), 1j * np.ones((2, 4)), np.ones((2, 4)),
        1e-3), "angles must be",
    ),
    "a law by its name": (lambda: colloc.replay(Chain(), "friction", GAIT, 1e-3),
    "friction must be a Law"),
    "a body by its length": (lambda: colloc.replay(3, Friction(), GAIT, 1e-3), "body must be a"),
    "a path of numbers": (lambda: colloc.replay(Chain(), Friction(), [1.0, 2.0], 1e-3),
    "path must be a function"),
    "an argument twice": (lambda: Friction(1, mu_t=2), "was given mu_t twice"),
    "a pace that is no number": (lambda: Problem("x", froude=Free("a", 1)), "two numbers above 0"),
    "a start that points nowhere": (lambda: colloc.Fourier([0], [[1]], [[0]], theta=float("nan")),
    "theta must be a number"),
    "a whole number as a text": (lambda: colloc.solve(PROBLEM, starts="3"),
    "starts must be a whole number or None, not '3'"),
    "a fraction of a start": (lambda: colloc.solve(PROBLEM, starts=1.5), "starts must be a whole "
                                                                         "number or None, not 1.5"),
    "starts that are true": (lambda: colloc.solve(PROBLEM, starts=True), "starts must be a whole "
                                                                         "number or None, not True"),
    "a reference of words": (lambda: colloc.Reference("high", 0.1, "me"), "efficiency must be a "
                                                                          "number"),
    "an axis that is a number": (lambda: Axis("x", 3), "values of an axis must be"),
    "an axis beyond all bounds": (lambda: Axis("x", (10**400,)), "values of an axis must be"),
    "a sampler that is none": (lambda: colloc.multistart(PROBLEM, 1, sampler="x"),
    "sampler must be one of latin-hypercube"),
    "an output that is a folder": (lambda: colloc.solve(PROBLEM, 1, output="."),
    "output must name a file"),
    "breaks that are no phases": (
        lambda: colloc.replay(Chain(), Friction(), GAIT, 1e-2, breaks=(float("nan"), 5.0)),
        "breaks must be numbers",
    ),
    "a billion instants": (lambda: colloc.replay(Chain(), Friction(), GAIT, 1e-2, instants=10**9),
    "at most 10000000"),
    "a billion points": (lambda: colloc.pareto_front(PROBLEM, points=10**9), "2 to 1000 points"),
    "a word that Python keeps": (lambda: Quantity("lambda", "sum(rate**2)"),
    "a name of its own that is a word"),
    "a motion that is nothing": (lambda: Problem("x", motion=[]), "motion must be"),
    "more links than memory can compare": (
        lambda: Problem.from_dict({**PROBLEM.to_dict(), "body": {"kind": "Chain",
        "lengths": [1e-4] * 10_000}}),
        "the body has 9999 joints, and 100 are allowed",
    ),
    "a link that is nothing": (lambda: Chain((1e-12, 0.5 - 1e-12, 0.5)), "no link may be shorter "
                                                                         "than 1e-06"),
    "a joint limit of no dimension": (lambda: Problem("x", joint_limit=np.array(9.0)),
    "joint_limit must lie"),
}  # fmt: skip


@pytest.mark.parametrize("case", SENTENCES)
def test_what_cannot_be_meant_is_refused_in_a_sentence(case):
    made, words = SENTENCES[case]
    with pytest.raises(ProblemError, match=words):
        made()


@pytest.mark.parametrize("value", [None, -1, float("nan"), {}, object()])
def test_a_solution_refuses_what_cannot_be_meant(value, three_link, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    wrong = [
        lambda: three_link.sample("a"), lambda: three_link.export(value, period=4),
        lambda: three_link.animate(value),
        lambda: three_link.export("x.csv", period=4, rate=value), lambda: three_link.robot(1, 1, 1,
        max_speed="fast"),
        lambda: three_link.robot(1e300, 1, 1), lambda: three_link.robot(1, 1, value),
        lambda: colloc.save(three_link, "."),
        lambda: three_link.export("x.csv", period=4, periods=10**9),
        lambda: three_link.sample([float("nan")]),
    ]  # fmt: skip
    for each in wrong:
        with pytest.raises(ProblemError):
            each()


def test_what_a_problem_file_raises_is_told_even_if_it_cannot_say_itself(tmp_path):
    (tmp_path / "x.py").write_text(
        "class Mute(Exception):\n    def __str__(self):\n        raise KeyError\nraise Mute\n"
    )
    with pytest.raises(ProblemError, match="line 4: Mute"):
        colloc.load_problem(tmp_path / "x.py")
    (tmp_path / "y.py").write_bytes(b"\x00")
    with pytest.raises(ProblemError, match=r"y.py: .*null bytes"):
        colloc.load_problem(tmp_path / "y.py")


def test_a_problem_file_with_a_byte_order_mark_is_read(tmp_path):
    text = "from colloc import *\nPROBLEM = Problem('x')\n"
    (tmp_path / "x.py").write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert colloc.load_problem(tmp_path / "x.py").name == "x"


def test_what_a_problem_file_raises_cannot_drive_the_terminal(tmp_path):
    (tmp_path / "x.py").write_text(
        "raise ValueError('\\x1b]0;owned\\x07\\x1b[2J \\u202e backwards \\r gone')\n"
    )
    with pytest.raises(ProblemError) as caught:
        colloc.load_problem(tmp_path / "x.py")
    assert str(caught.value).isprintable()
    assert r"\x1b[2J" in str(caught.value)
