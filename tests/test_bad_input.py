"""Every public name answers a mistake with a sentence, and numbers are what they are."""

import inspect
import json
import warnings

import numpy as np
import pytest

import colloc
from colloc import (
    Chain,
    Foot,
    Friction,
    Harmonic,
    Objective,
    PowerLaw,
    Problem,
    ProblemError,
    Quantity,
    Wave,
)
from colloc.bounds.sampled import Budget, TensorSpline, efficiency_bound
from colloc.gaits.harmonic import Prescribed
from colloc.smooth.balance import Motion, solve_smooth
from colloc.system.errors import OrderWarning
from colloc.verification.differential_motion import checked_chain
from colloc.verification.dry_friction import dry_friction
from colloc.verification.trajectory import plan_trajectory

GAIT = colloc.ellipse(0.0, 1.2, 0.8)
PROBLEM = Problem("quick", gait=Harmonic(1, "bilateral"), delta=1e-2)
ON = {"body": Chain(), "friction": Friction(), "gait": GAIT, "delta": 1e-2}
AT = (Chain(), Friction())
TINY = 1e-9
ONES = np.ones((2, 4))
DRAG = colloc.Viscous(normal=2, tangential=1)
FIVE, UNEVEN = Chain((0.2,) * 5), ((1, 0), (0.5, 0), (0, 1), (0, 1))
FIRST = {"functions": lambda kind, t, order=0: Harmonic.functions(kind, t, min(order, 1))}
BUMP = np.sin(2 * np.pi * np.arange(50) / 50)
MIRRORED = Harmonic(1, "bilateral")
SAMPLES = [[0.1, 0.1, 0.1], [0.5, 0.5, 0.5], [2.0, 2.0, 2.0]]


class Belt(Chain):
    """One motor for both joints: the kernel would read what is not there."""

    n_joint = 1
    solve = None


HEATS = [Objective("1 / heat", quantities=[Quantity("heat", f"sum(rate**{n})")]) for n in (2, 4)]


def driven(body=None, **said):
    gait = colloc.Coupled(Harmonic(1), **said)
    return Problem("c", body=body or Chain((0.25,) * 4), gait=gait)


def robot(**said):
    return colloc.Robot(**{"length": 0.62, "mass": 0.9, "period": 2.5} | said)


def motion(stages, antipodal=False):
    return Motion(lambda s, t: s, lambda s, t: s, stages=stages, antipodal=antipodal)


def samples(count, rate=2.0, limits=None):
    return plan_trajectory(GAIT, rate, period=count / rate, limits=limits)


def bound(limit, **changes):
    budget = Budget(intervals=2, shapes=2, directions=2, rounds=1, starts=1, first=2, **changes)
    return efficiency_bound(Chain((0.5, 0.5)), Friction(), limit, budget=budget)


def with_one(value):
    return np.where(np.arange(8).reshape(2, 4) == 6, value, 1.0)


def path(angles, rates):
    return lambda t: (np.full((2, t.size), angles), np.full((2, t.size), rates))


NAMES = {name: getattr(colloc, name) for name in colloc.__all__} | globals()
NAMES |= {
    each.__name__: each
    for each in (checked_chain, dry_friction, Prescribed, TensorSpline, Wave, solve_smooth)
}


def cases(text, separator, most=-1):
    """Cells of the lines of a table; alternatives in the first are lines of their own."""
    rows = (line.split(separator, most) for line in text.strip().splitlines())
    return [(each, *rest) for first, *rest in rows for each in first.split(" | ")]


NEEDED = """
Axis: name="mu_t", values=(1, 2)
Basis: columns=(np.sin(np.arange(64) * np.pi / 32),)
Corners: corners=np.array([[1, 0, -1.0], [0, 1, 0]])
Coupled: gears=((1.0,), (1.0,))
Foot: link=0
Fourier: mean=[0, 0], cos=[[1.0], [0]], sin=[[0], [1.0]]
Pad: link=0
Objective: expression="distance/work"
PathLimit: name="x", function="moment", most=1.0
Problem: name="x"
Quantity: name="heat", density="sum(moment**2)"
Reference: efficiency=1.0, tolerance=0.1, source="x"
Wheel: link=0
Study: name="s", axes=(Axis("mu_t", (1, 2)),), problem=lambda mu_t: PROBLEM
certify: answer=None
ellipse: A0=0.0, A1=1.0, B1=1.0
evaluate: problem=PROBLEM, gait=None
identify: problem=PROBLEM, record="none.csv"
fitted_friction: table=[[0.1, 1, 2], [0.2, 1, 2], [0.3, 1, 2], [0.5, 1, 2], [1, 1, 2]]
load: path="none.h5"
load_problem: path="none.py"
motion_from_rest: **ON, froude=0.0
multistart: problem="none.py"
pareto_front: problem=PROBLEM, points=1
replay: body=Chain(), friction=Friction(), path=GAIT, delta=0.0
save: solution=None, path="s.h5"
slope_motion: **ON, grade=2.0
slow_enough: **ON, loss=0.0
solve: problem="none.py"
solve_balance: body=Chain(), friction=Friction(), angles=GAIT.mean, rates=GAIT.mean, delta=0.0
steer: problem=PROBLEM, turns=[]
sweep: study="none.py"
"""
NEEDED = {name: eval(f"dict({words})", NAMES) for name, words in cases(NEEDED, ": ", 1)}
"""Arguments that are there in any case; of what would compute for long, one is wrong, so that
nothing is computed."""
MADE_BY_COLLOC = "FittedFriction Known Solution Starts Free CollocError NotConvergedError ProblemError StoreError"
BAD = [None, "a", -1, np.nan, np.inf, [], {}, 10**400, b"x", 1j, np.bool_(True), object()]
BAD += [Friction, ["a"]]


@pytest.mark.parametrize("name", [n for n in colloc.__all__ if n not in MADE_BY_COLLOC.split()])
def test_a_wrong_argument_of_a_public_name_ends_in_a_sentence(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    made, needed, said = getattr(colloc, name), NEEDED.get(name, {}), []
    for each in inspect.signature(made).parameters.values():
        for value in BAD:
            try:
                made(**{**needed, "offset" if each.kind is each.VAR_KEYWORD else each.name: value})
            except colloc.CollocError as error:
                said.append(str(error))
    assert all(10 < len(each) < 1000 and each[-1] in ".?" for each in said), said
    assert said or not inspect.signature(made).parameters


@pytest.mark.parametrize("name", [n for n in NEEDED if n[0].islower() and n != "ellipse"])
def test_a_function_that_lacks_an_argument_or_has_none_of_that_name_says_so(name):
    with pytest.raises(ProblemError, match=f"{name}: missing a required argument"):
        getattr(colloc, name)()
    with pytest.raises(ProblemError, match=f"{name} has no argument 'colour'; it takes"):
        getattr(colloc, name)(**NEEDED[name], colour=1)


FIELDS = ("delta", "delta_start", "smallest_shape_speed", "froude", "joint_limit", "torque_limit")


@pytest.mark.parametrize("kind", [np.float32, np.float16, np.float64, np.longdouble])
@pytest.mark.parametrize("field", FIELDS)
def test_numbers_of_numpy_are_the_numbers_of_python(kind, field):
    stated = Problem("x", **{"gait": Harmonic(1), "smallest_shape_speed": 0.01, field: kind(0.5)})
    if field not in ("torque_limit", "froude"):
        stated = stated.with_(torque_limit=np.array([kind(0.25), kind(0.5)]))
    assert type(getattr(stated, field)) is float
    json.dumps(stated.to_dict())
    again = Problem.from_dict(stated.to_dict())
    assert again.hash == stated.hash == stated.with_(**{field: 0.5}).hash


def test_equal_problems_have_equal_hashes_however_their_numbers_are_written():
    feet = Foot(0, 1), Foot(1), Foot(2, 0)
    same = Foot(np.int64(0), 1.0), Foot(1, np.float32(0.5)), Foot(2, 0.0)
    kinds = {"gait": Harmonic(np.int32(1)), "joint_limit": np.array(2.0), "shrinking": np.False_}
    laws = Friction(1, 1, 1), Friction(1.0, np.float32(1), np.int8(1))
    one = Problem("x", None, Chain(feet=feet), laws[0], Harmonic(1), joint_limit=2, intervals=24)
    other = Problem("x", None, Chain(feet=same), laws[1], **kinds, intervals=np.int64(24))
    assert one.hash == other.hash
    assert one.friction == other.friction
    assert isinstance(one.friction.mu_t, float)
    assert other.shrinking is False


ORDERS = """
Friction(0.11, 0.14, 0.20) -> mu_t=0.11, mu_f=0.14, mu_b=0.2
Friction(0.3) -> mu_t=0.3, mu_f=1, mu_b=1
Friction(1, 1, mu_b=2) -> mu_t=1, mu_f=1, mu_b=2
Elliptic(2, 1, 1) -> Elliptic.mu_t=2, mu_f=1, mu_b=1
PowerLaw(0.5, 2.0) -> mu_t=2, mu_f=1, mu_b=1
Viscous(2, 1) -> normal=2, tangential=1
"""


@pytest.mark.parametrize(("made", "read"), cases(ORDERS, " -> "))
def test_coefficients_that_differ_and_have_no_names_warn_how_they_are_read(made, read):
    with pytest.warns(OrderWarning, match=f"read as .*{read}"):
        eval(made, NAMES)


def test_coefficients_that_are_equal_or_named_do_not_warn():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        law = Friction(mu_f=0.11, mu_b=0.14, mu_t=0.20)
        assert Friction(0.2, 0.2, 0.2).isotropic
        assert PowerLaw(0.5).power == 0.5
        assert law.in_units_of(0.1).mu_b == pytest.approx(1.4)


SENTENCES = r"""
Objective("1") | Objective("log(-1)") -> uses no quantity
Objective("distance ** 1000") | Objective("0 * distance") -> too flat or too steep
Objective("__import__('os').remove('x')") | Objective("distance.real") | Objective("lambda: 1") | Objective("f'{work}'") | Objective("distance**work") | Objective("True * work") | Objective("distance if work else 0") | Objective("abs(1, 2)") | Objective("speeed") | Objective("distance /") | Objective("") | Objective("distance / 0") | Objective("-distance") | Objective("9**9**9 * distance") | Objective("work < 2") | Objective("1 + " * 200 + "distance") | Objective("where(0 < work < 2, distance, work)") | Objective("-" * 450 + "distance") -> objective
Objective("distance / work + 1/0") | Objective("distance * (-1) ** 0.5") | Quantity("heat", "sum(moment ** 2) * 9.0**9**9") | OwnLaw("1/0", "-vn/speed") -> no finite real number
Objective(f"distance * 1{'0' * 400}") -> no value|no finite
OwnLaw("-sqrt(vs, vn)", "-vn") -> sqrt takes 1 argument, not 2
PathLimit("p", "where(power > 0)", 1.0) -> where takes 3 arguments, not 1
OwnLaw("-vs/sqrt(vs**2+vn**2)", "-2*vn/sqrt(vs**2+vn**2)") -> divide by speed
OwnLaw([], "-vn") -> must be text
Foot(0, friction=Friction) -> as Friction\(\)
Problem("x", shrinking="no") -> shrinking must be True or False, not 'no'
Concertina(backwards=1) -> backwards must be True or False
Problem("x", at_least="distance") | Problem("x", at_least=[("distance", 0.1, 0.2)]) -> at_least must map objectives
Problem("x", delta=1e308) -> delta .* at most 1000
Axis("efficiency", (1, 2)) | Axis("joint", (1, 2)) -> not that of a column of the results
Axis(None, (1, 2)) -> must be a Python name
multistart(PROBLEM, 1, seed=10**22) | Study("s", (Axis("x", (1,)),), lambda x: PROBLEM, seed=10**22) -> seed must be
multistart(PROBLEM, workers=0) -> workers must be a whole number of at least 1
multistart(PROBLEM, time_limit=-1) -> time_limit must be positive
slope_motion(**ON, grade=0.1, heading=0.0, periods=10**9) -> periods must be .* from 1 to 10000
motion_from_rest(**ON, froude=0.1, periods=10**9) -> periods must be
Objective("distance", quantities=3) -> 3 is no quantity
solve_balance(*AT, [[1.0, 2.0], [3.0]], np.ones((2, 1)), 1e-3) -> angles must be numbers
solve_balance(*AT, 1j * ONES, ONES, 1e-3) | solve_balance(*AT, "bent", ONES, 1e-3) -> angles must be
solve_balance(*AT, ONES, None, 1e-3) -> rates must be
solve_balance(*AT, ONES, ONES, "1e-3") -> delta must be
solve_balance(*AT, ONES, ONES, 1e-3, tolerance=0) -> tolerance must be
replay(Chain(), "friction", GAIT, 1e-3) -> friction must be a Law
replay(3, Friction(), GAIT, 1e-3) -> body must be a
replay(*AT, [1.0, 2.0], 1e-3) -> path must be a function
replay(*AT, path(0.7, 0.0), 1e-4) -> does not move
replay(*AT, GAIT, 1e-2, froude=0.3, quantities=["driven_work"], breaks=(0.5,)) -> joint rates jump: leave driven_work out
Friction(1, mu_t=2) -> multiple values for argument 'mu_t'
Problem("x", froude=Free("a", 1)) -> two numbers above 0
Fourier([0], [[1]], [[0]], theta=float("nan")) -> theta must be a number
solve(PROBLEM, starts="3") | solve(PROBLEM, starts=1.5) | solve(PROBLEM, starts=True) -> a whole number or None, not ('3'|1.5|True)
Reference("high", 0.1, "me") -> efficiency must be a number
Axis("x", 3) | Axis("x", (10**400,)) -> values of an axis must be
multistart(PROBLEM, 1, sampler="x") -> sampler must be one of latin-hypercube
solve(PROBLEM, 1, output=".") -> output must name a file
replay(*AT, GAIT, 1e-2, breaks=(float("nan"), 5.0)) -> breaks must be numbers
replay(*AT, GAIT, 1e-2, instants=10**9) -> from 4 to 10000000
pareto_front(PROBLEM, points=10**9) -> 2 to 1000 points
Quantity("lambda", "sum(rate**2)") -> a name of its own that is a word
Problem("x", motion=[]) -> motion must be
Problem.from_dict({**PROBLEM.to_dict(), "body": {"kind": "Chain", "lengths": [1e-4] * 10_000}}) -> 9999 joints, and 100
Chain((1e-12, 0.5 - 1e-12, 0.5)) -> no link may be shorter than 1e-06
Problem("x", joint_limit=np.array(9.0)) -> joint_limit must lie
Corners(corner=np.eye(2)) -> has no argument 'corner'
Fourier(np.eye(2), np.eye(2)) | Fourier(*(1,) * 9) -> Fourier
Problem("x", frction=1) -> did you mean friction
Problem() -> Problem: missing a required argument: 'name'
Friction(mu=1) -> did you mean mu_t, mu_f or mu_b
Harmonic(harmonic=2) -> did you mean harmonics
Problem("x").with_(intervalls=3) -> did you mean intervals
Polygon(colour=1) -> it takes corners, symmetry, axis
solve(5) -> problem must be a Problem
solve(PROBLEM, starts=0) -> starts must be a whole number of at least 1
solve(PROBLEM, seconds=np.nan) -> seconds must be .*, not nan
Chain((0.3, 0.3, 0.4 + 1e-3)) | Chain((0.3, 0.3, 0.4 - 1e-3)) | Chain((0.3, 0.3, 0.4 + 1e-10)) -> must add up to
Chain(width=-0.01) | Chain(width=1 / 3) | Chain(width=np.nan) | Chain(width=np.inf) | Chain(width=True) | Chain(width=None) -> width
Chain(weights=(0.5, 0.5, 0.5)) | Chain(weights=(0.5, 0.5, 0.0)) | Chain(weights=(0.5, 0.5, "x")) | Chain(weights=(0.5, 0.5, np.nan)) -> body\.weights
Chain(weights=(1.0,)) | Chain(masses=(0.5, 0.5)) | Chain(inertias=(0.1, 0.1)) -> one for each of the 3 links
Chain(weights=3.0) -> sequence of numbers
Chain(masses=(0.5, 0.5, 0.5)) -> the body's mass 1
Chain(inertias=(0.1, -0.1, 0.1)) -> not negative
Chain(feet=(Foot(0), Foot(3))) -> numbered 0 to 2
Chain(feet=(Foot(0, weight=0.5), Foot(2, weight=0.4))) -> add up to 1, not 0.9
Chain(feet=(Foot(0, 1.0, 0.5), Foot(1, 0.0, 0.5))) -> at two points at least
Chain(feet=(Foot(0), Foot(2))) -> no foot is on link 1
Chain(feet=(Foot(0, weight=1.0),)) -> two points
Chain(feet=(Foot(0), Foot(1, offset=0.1), Foot(2))) | Chain(feet=(Foot(0), Wheel(1, angle=0.3), Foot(2))) | Chain(feet=(Pad(0, offset=0.1), Pad(1), Pad(2))) | OwnLaw("-vs/speed - 0.5*vn/speed", "-vn/speed") -> left and right
Chain(feet=(Foot(0, 0.2, 1 / 3), Foot(0), Foot(1), Foot(2))) -> bear all that
Chain(feet=-1) -> 0 \(a line\) to
Chain(feet="many") | Chain(feet=0.5) -> sequence of Foot
Foot(0, place=1.2) | Foot(0, place=float("nan")) | Foot(0, 0.9, extent=0.4) | Pad(0, 0.2, 1.2) -> must lie on its link
Foot(0.5) | motion_from_rest(**ON, froude=0.1, periods=0) -> whole number
Foot(0, weight=0.0) -> positive part
Foot(0, offset=float("inf")) -> offset of a foot
Foot(0, friction="oil") -> law of friction
Foot(0, plaze=0.5) -> did you mean place
Foot(0, extent=-0.4) -> from 0 \(a point\) to 1
Pad(0, 0.6, 0.4) -> must end behind where it begins
Pad(0, "tail", 0.4) -> first must be a number, not 'tail'
Pad(0, angle=0.3) -> may be turned
Wheel(0, friction=Friction()) -> take Foot
Friction(mu_t=-1) | Friction(mu_t=np.inf) -> mu_t
Friction(mu_f=0) | Friction(mu_f="1") -> mu_f
Friction(mu_b=np.nan) -> mu_b
Axle(rolling=0.0) -> rolling
Axle(sideways=-1.0) -> sideways
robot(length=62.0) -> 62 metres.*write length=0.62
robot(mass=0.0) -> mass must be a number
robot(period=(3.0, 2.0)) -> the shortest and the longest
robot(idle_power=-1.0) -> idle_power must be a number from 0
robot(backlash=-0.1) -> backlash must be a number from 0
Problem("x", robot=robot(), froude=0.1) -> froude follows from the robot
Problem("x", robot={"length": 1}) -> robot must be a Robot
solve_balance(*AT, ONES, ONES, 0.0) | solve_balance(*AT, ONES, ONES, -1e-4) | solve_balance(*AT, ONES, ONES, np.nan) -> delta
solve_balance(*AT, np.zeros((3, 4)), ONES, 1e-4) | Fourier([0.0], [[1.0]], [[1.0, 2.0]]) -> shape
solve_balance(Belt(), Friction(), np.ones((1, 5)), np.ones((1, 5)), 1e-3) -> not its 2 joints
solve_smooth(Wave().prescribed(), Friction(), np.array([0.1]), 0.0) -> delta must be a positive
solve_smooth(Motion(lambda s, t: s * np.nan, lambda s, t: s), Friction(), np.array([0.1]), 1e-3) -> finite
TensorSpline(2, 2.5, 4, (-1.0, 0.0, 1.2)) | TensorSpline(2, 2.5, 4, (1.0, 0.0, -1.0)) | TensorSpline(2, 2.5, 4, (-3.0, 0.0, 3.0)) | TensorSpline(2, 2.5, 4, (0.0,)) -> graded knots
solve_balance(*AT, ONES, ONES, 1e-4, start=np.zeros((2, 4))) -> start
solve_balance(*AT, ONES, ONES, 1e-4, method="magic") -> method
solve_balance(*AT, ONES, ONES, 1e-4, load=np.ones((3, 4))) | solve_balance(*AT, ONES, ONES, 1e-4, load=np.full((2, 4), np.nan)) | solve_balance(*AT, ONES, ONES, 1e-4, load="x") -> load must be
driven(stuck={5: 0.1}) -> joint 5: the chain has joints 0 to 2
driven(stuck={0: 4.0}) -> between -pi and pi
driven(stuck={0: 0.0, 1: 0.0, 2: 0.0}) -> all joints are stuck
driven(stuck={0: 3.0, 1: 3.0}, gears=((0,), (0,), (1,))) -> links cross
driven(gears=((1, 0), (0, 1))) -> 2 rows, and the chain has 3 joints
driven(gears=((1, 0), (0, 1), (0, 0))) -> joint 2 .* hangs on no motor
driven(gears=((1, 0), (0, 1), (1, 1)), stuck={2: 0.0}) -> is stuck, and hangs on a motor
driven(gears=((1, 1), (1, 1), (1, 1))) -> two motors do the same
driven(gears="belts") | driven(gears=3) -> gears must be
driven(stuck=5) | driven(stuck=[1, 2]) -> stuck gives joints and their angles
driven(stuck=[(1, 0.1), (1, 0.2)]) -> each is named once
driven(ModalBody(3)) -> joints of a Chain
driven(stuck={1: 0.4}).with_(froude=0.05) -> joints all have motors
driven(stuck={1: 0.4}).with_(grade=0.05) -> slope
driven(gears=((1,),) * 3) -> on 1 motor.* goes anywhere
Coupled(Chain(), stuck={1: 0.4}) -> gait=Coupled\(Harmonic\(1\), stuck=
slope_motion(CrawlerBody(), Friction(), GAIT, 1e-2, 0.1) -> only a Chain
slope_motion(Belt(), Friction(), GAIT, 1e-2, 0.1) -> only a Chain, whose joints are its own, can be put on a slope, not Belt
slope_motion(**ON, grade=-0.1) -> grade must be a number of at least 0
slope_motion(**ON, grade=np.nan) -> grade must be
slope_motion(**ON, grade=0.1, periods=0) -> periods must be a whole number from 1
slope_motion(**ON, grade=0.1, heading=np.nan) -> heading must be a number or None, not nan
slope_motion(**ON, grade=0.1, theta="up") -> theta must be a number or None
slope_motion(**ON, grade=0.1, tolerance=0.0) -> tolerance must be a positive finite number
slope_motion(*AT, GAIT, -1.0, 0.1) -> delta must be a positive finite number
slow_enough(ModalBody(), Friction(), GAIT, 1e-2) -> of a ModalBody
slow_enough(Chain(), DRAG, GAIT, 1e-2) -> pace is part
slow_enough(**ON, loss=0.9) -> at most
dry_friction(Chain(), Friction(mu_t=2.0, mu_f=1.0, mu_b=1.5), GAIT) | dry_friction(Chain(), DRAG, GAIT) -> no bounds for delta = 0
dry_friction(ModalBody(2), Friction(), GAIT) -> not for a ModalBody
efficiency_bound(*AT, 4.0) -> joint_limit
efficiency_bound(Chain((1 / 6,) * 6), Friction(), 2.0) -> 5 links
fitted_friction("nowhere.csv") -> cannot read .*nowhere.csv
fitted_friction(np.ones((2, 3))) -> a row for each of at least 3 speeds
fitted_friction([[0.1, 0.5, 0.9], [0.2, np.nan, 0.9], [0.3, 0.5, 0.9]]) | fitted_friction([[0.1, 0.5, 0.9], [0.2, None, 0.9], [0.3, 0.5, 0.9]]) -> table of friction must be a finite
fitted_friction([[0.1, 0.5, 0.9], [0.2, "rough", 0.9], [0.3, 0.5, 0.9]]) -> table of friction must be numbers
fitted_friction(SAMPLES, length=1.0) -> take both
fitted_friction(SAMPLES, length=-1.0, period=2.0) -> length
Problem("x", friction=DRAG, gait=Polygon(6)) | Problem("x", friction=PowerLaw(0.5), gait=Polygon(6)) -> work depends on the pace under .*; use Harmonic
Problem("x", body=Chain((0.5, 0.5)), friction=DRAG, gait=Harmonic(2)) -> scallop theorem
OwnLaw("vs/speed", "-vn/speed") | OwnLaw("-vs/speed", "-vn/speed + 0.1*vn/speed*exp(speed)") | OwnLaw("-vs/speed", "0.1*vn/(1 + speed)") | OwnLaw("1", "-vn/speed") -> does not oppose the motion
OwnLaw("3*vs/speed", "-vn/speed") -> the force \(-?2\.99, .* does not oppose
OwnLaw("0", "-vn/speed") -> nothing resists
OwnLaw("-vs/sqrt(vs**2 + delta**2)", "-vn/sqrt(vn**2 + delta**2)") -> by vs is dry.*state a wheel's friction as Axle
OwnLaw("-vs", "-tanh(vn/delta)") -> by vn is dry.*state a wheel's friction as Axle
OwnLaw("-vs/abs(vs + 1) - where(vs < 0, 0, 1e-9)", "-vn") -> rest
OwnLaw("-vs/(speed - speed)", "-vn") -> no finite value
OwnLaw("-vs/speed", "where(vs > 0, -2, -1.5)*vn/speed") -> jumps where vs changes its sign
OwnLaw("-vs", "-vn - where(vn > 0, 1, -1)*where(vn*vn > 0, 1, 0)") -> jumps where vn changes its sign
OwnLaw("-vs/speeed", "-vn") -> uses speeed
OwnLaw("-vs +", "-vn") -> is no formula
OwnLaw("-vs.real", "-vn") -> is no formula that can be differentiated
OwnLaw("__import__('os')", "-vn") -> is no formula|uses
OwnLaw("-vs**vs", "-vn") -> exponent
evaluate(PROBLEM, np.zeros((3, 20))) -> angles of 3 joints, and the body has 2
evaluate(PROBLEM, np.full((2, 20), np.nan)) -> must be a finite 2-D array
evaluate(PROBLEM, GAIT.angles(np.arange(20) / 60)) -> does not close
evaluate(PROBLEM, GAIT.angles(np.arange(60) / 60), period=0) -> period must be a positive
evaluate(PROBLEM, GAIT.angles(np.arange(60) / 60), period=0.06) -> in the file's unit of time
evaluate(PROBLEM, GAIT.angles(np.arange(60) / 60), harmonics=40) -> 60 samples determine 1 to 28 harmonics
evaluate(PROBLEM, 0.01 * GAIT.angles(np.arange(60) / 60)) -> hardly moves
evaluate(PROBLEM, "nowhere.csv") | Basis("nowhere.csv") -> cannot read nowhere.csv
evaluate(PROBLEM, {"a": 1}) -> gait must be a Fourier, numbers, text, a path or a function
evaluate(Problem("up", gait=Harmonic(1), grade=0.1), GAIT) -> colloc\.slope_motion
evaluate(Problem("x", gait=Harmonic(1), froude=Free(0.1, 1.0), objective="efficiency"), GAIT) | evaluate(Problem("x", gait=Harmonic(1), froude=0.1, objective="distance / period"), GAIT) -> evaluated at one pace
identify(Problem("up", gait=Harmonic(1), grade=0.1), "none.csv") -> up is no gait on the level
steer(PROBLEM, []) | steer(PROBLEM, [4.0]) | steer(PROBLEM, [float("nan")]) -> half a turn|a sequence of numbers
steer(Problem("x", gait=Harmonic(1), rotation=0.1), [0.2]) -> straight
pareto_front(PROBLEM, "speed", "distance/length") -> two objectives
Study("s", (), lambda: PROBLEM) -> at least one Axis
Study("s", [Axis("x", (1,)), Axis("x", (2,))], lambda x: PROBLEM) -> same name
Study("a b", [Axis("x", (1,))], lambda x: PROBLEM) -> name must be
Study("s", [Axis("x", (1,))], lambda x: PROBLEM, chunk=0) -> chunk must be
Study("s", [Axis("x", (1,))], lambda x: PROBLEM, time_limit="long") -> time_limit must be a number
Study("s", [Axis("x", (1,))], 3) -> must be a function
Study("s", [Axis(name, range(1001)) for name in "xy"], lambda x, y: PROBLEM) -> 1000000 cells
Axis("x", (1.0, None)) | Axis("x", ([1.0, 2.0],)) -> values of an axis must be numbers
Axis("x", ()) | Axis("x", (1.0, 1.0)) | Axis("x", (1.0, "a")) | Axis("x", (float("nan"),)) -> axis x
Harmonic(2, "antipodal") -> odd harmonics only.*ask for 1 or 3
Harmonic(6, "antipodal") -> odd harmonics only.*ask for 5 or 7
Harmonic(0) | Harmonic(1.5) -> harmonics
Harmonic(symmetry="mirror") -> symmetry
Harmonic(2).member(np.full(9, 1e308), 2) -> must be a finite
BSpline(4) -> from 5 to 64
BSpline(1, 2) -> knots
BSpline(9, symmetry="antipodal") -> even number of knots
BSpline(8, degree=0) -> degree must be 2, 3, 4 or 5
Basis([np.arange(96.0)]) -> too rough
Basis([np.ones(48)]) -> nothing would move
Basis([np.sin(np.arange(n) * 2 * np.pi / n) for n in (96, 48)]) -> all alike
Basis([np.ones(5)]) -> at least 24
Basis(3) -> a sequence of columns
Polygon(1) -> corners
Polygon(5, "antipodal") -> even
Polygon(4, "bilateral", "edge") -> axis
Corners(np.array([[1.0, 1.0], [0.0, 0.0]])) -> equal neighbours
Corners("triangle") -> numbers
Corners(np.ones((2, 1))) -> at least two columns
Basis([np.full(48, np.nan)]) -> must be finite numbers
Prescribed((0.1, 1.0)) | Prescribed((0.0, 0.6, 0.6, 1.0)) | Prescribed((0.0, 0.5)) -> must ascend from 0 to 1
Friction(mu_t=1e10) -> no floor does
Objective("1 / length", quantities=[Quantity("length", "sum(rate**2)")]) -> has the name of another one
Quantity("x", "sum(1 / (rate - rate))") -> not finite for typical values
Problem.from_dict({**PROBLEM.to_dict(), "body": {"kind": "Belt"}}) -> Belt is none of Chain
replay(ModalBody(2), Chain(feet=(Foot(0), Wheel(1), Foot(2))).law(Friction()), GAIT, 1e-2) -> feet have laws of friction of their own
evaluate(PROBLEM, np.ones((2, 5))) -> angles at 6 times or more
evaluate(PROBLEM, GAIT).cycles_from_rest | replay(Chain(), Friction(), GAIT, 0.1, breaks=[2.0]) | replay(Chain(), Friction(), GAIT, 0.1, breaks=[-0.5]) | replay(Chain(), Friction(), lambda t: (np.array([t, 0 * t]), np.ones((2, t.size))), 0.1) -> cycle|breaks must rise
evaluate(PROBLEM, 40 * GAIT.angles(np.arange(60) / 60)) -> if angles are degrees, say so
evaluate(PROBLEM, GAIT.angles(np.arange(60) / 60), period=200) -> holds 59 of a period of 200
CrawlerBody(0.05).concertina(1.3, way=(0.9,)) | CrawlerBody(0.05).concertina(1.3, way=(0.9, "text")) | CrawlerBody(0.05).concertina(1.3, way=0.9) | CrawlerBody(0.05).concertina(1.3, sides=3) | CrawlerBody(0.05).concertina("wide") -> must be
"""


@pytest.mark.parametrize(("made", "words"), cases(SENTENCES, " -> "))
def test_what_cannot_be_meant_is_refused_in_a_sentence(made, words):
    with pytest.raises(ProblemError, match=words):
        eval(made, NAMES)


STATED = r"""
joint_limit=((0.0, 1.0), 1.0) | joint_limit=((-1.0, 0.0), 1.0) -> straight body
joint_limit=((-1.0, 3.142), 1.0) -> neither beyond 3.142
joint_limit=((-30, 60), 1.0) -> radians
joint_limit=3.142 -> lie in \(0, pi\], not 3.142
joint_limit=(1.0, 0.0) -> lie in \(0, pi\], not 0
joint_limit="wide" -> not 'wide'
joint_limit=(True, 1.0) -> joint_limit
joint_limit=((-1, 1, 2), 1.0) -> least and its largest
joint_limit=((-1, 2),) -> give one for all joints
joint_limit=((-1, 2), (-1, 2)), gait=MIRRORED -> mirrored joints
joint_limit=((-1, 2), (-1, 2)), gait=Harmonic(1, "antipodal") -> both sides
power_limit=1.0, gait=Polygon(4) -> leaves the pace open, but the joints' power is limited
torque_limit=1.0, body=ModalBody(2), gait=Harmonic(1) -> needs the forces
torque_limit=-1.0 -> torque_limit must be positive
power_limit="much" -> power_limit must be positive
power_limit=(1.0, 2.0, 3.0) -> power_limit has 3 values
torque_limit=(1.0, 2.0), gait=MIRRORED -> give them the same torque_limit
speed_limit=5.0, gait=Polygon(3) -> leaves the pace open, but the joints' speed is limited
speed_limit=0.2, gait=MIRRORED -> leaves no gait
speed_limit=0.5, gait=MIRRORED -> with speed_limit the usual first gait
speed_limit=5.0, body=Wave() -> nothing is free in a prescribed motion
speed_limit=(5.0, 8.0), gait=MIRRORED -> give them the same speed_limit
speed_limit=(5.0, 8.0, 5.0) -> has 3 values
speed_limit=-1.0 -> positive and finite
limits=[PathLimit("heat", "moment**2", (1.0, 1.0, 1.0))] -> has 3 values; give one, or 2
limits=[PathLimit("speed", "rate", 9.0)], gait=Polygon(4) -> the speed is limited
limits=[PathLimit("speed", "speed", 9.0)] | objective=Objective("1 / x", quantities=[Quantity("x", "sum(speed**2)")]) -> one of a free pace
limits=["moment < 1"] | limits=3 -> PathLimit
limits=[PathLimit("heat", "moment**2", -1.0)] | limits=[PathLimit("heat", "moment**2", "x")] -> must be positive
objective="driven efficiency", formulation="implicit velocity" -> formulation 'full'
objective=Objective("distance / heat") -> uses heat
objective=Objective("1 / mine", quantities=[Quantity("mine", "moment**2")]) -> no sum over the joints
objective=HEATS[0], at_least=[(HEATS[1], 0.1)] -> two quantities are called heat
objective=Objective("1 / work", quantities=[Quantity("work", "sum(rate)")]) -> a name of its own
froude=-1.0 | froude="fast" -> must be a number of at least 0
froude=0.1, gait=MIRRORED -> run backwards
froude=0.1, gait=Polygon(4) -> leaves the pace open
froude=0.1, body=ModalBody(), gait=Harmonic(1) -> of a ModalBody
froude=0.1, gait=Harmonic(1), grade=0.1, rotation=1.0 -> on a slope a body that a cycle turns
froude=0.1, gait=Harmonic(1), grade=2.0 | grade=1.0 -> slides down for ever
froude=0.1, gait=Polygon(4), objective="driven efficiency" -> joint rates jump
froude=0.1, gait=Harmonic(1), scheme="lobatto-4" -> gauss-N
froude=0.1, gait=Harmonic(1), formulation="implicit velocity" -> only the formulation
froude=0.1, body=Chain((0.5, 0.5)), gait=Harmonic(3, "antipodal") -> no antipodal gait of two equal links
froude=0.1, body=Chain((0.5, 0.5)), gait=Harmonic(2), rotation=1.0 -> never turn
froude=(1.0, 0.1) -> the smaller one first
froude=(-1.0, 0.1) -> above 0
froude=(0.1, np.inf) | froude=(0.1, 1.0, 2.0) -> two numbers
froude=(0.1, 1.0), objective="1 / length" -> depends on it
froude=(0.1, 1.0), objective="distance / period", gait=Polygon(4) -> of a class Harmonic
objective="distance / period" | at_least={"distance / period": 0.1} -> state the pace
grade=-1.0 | grade="steep" -> grade must be
grade=0.1, gait=Polygon(symmetry="bilateral") -> no part of a cycle follows from another: take Polygon
grade=0.1, body=CrawlerBody() -> only a Chain
grade=0.1, objective="turning" -> the objective uses the rotation
grade=0.1, rotation=0.1 -> a body that a cycle turns has no gait that repeats
grade=0.1, formulation="implicit velocity" -> only the formulation 'full'
scheme="spline" | scheme="gauss-0" | scheme="gauss-13" | scheme="radau" | scheme=3 | scheme="" -> unknown scheme
grade=0.1, scheme="trapezoid" -> a gauss-N or radau-N scheme is needed
grade=0.1, towards="up" -> towards must be a finite number
towards=1.0 -> towards is a direction on a slope
body=Chain((0.5, 0.5)), gait=Harmonic(1, "antipodal") -> scallop
gait=Polygon(2) | gait=Basis([BUMP]) -> it retraces its path, and reversed rates
body=Chain(feet=(Foot(0, 0.1), Foot(1), Foot(2))), gait=MIRRORED -> read the same from both ends
guess=ellipse(1.0, 1e-6, 0.7e-6), gait=MIRRORED | guess=ellipse(0.0, 0.0, 0.0), gait=MIRRORED | gait=Polygon(4), guess=Corners(np.array([[0.1, -0.1], [0.0, 0.0]])) -> hardly moves
guess=ellipse(0.0, 1.0, 2 * np.pi / 3 + 1e-5), gait=MIRRORED -> cross
guess=ellipse(2.4, 0.3, 0.5), body=Chain(width=0.12), gait=MIRRORED -> links overlap
guess=ellipse(np.pi - 1, 1.0 + 1e-5, 0.1), gait=MIRRORED -> beyond the limit
gait=type("Lazy", (Harmonic,), FIRST)(), froude=0.2, torque_limit=0.05 -> need second derivatives
motion=PROBLEM.regime, grade=0.1 | motion=PROBLEM.regime, froude=0.1 -> takes the place of grade and froude
gait=Polygon(8), froude=0.2, torque_limit=0.05 -> infinite where joint rates jump
friction=Friction(mu_t=-1, mu_f=1, mu_b=1) -> mu_t
guess=ellipse(0.0, 4.0, 0.8), gait=MIRRORED -> inadmissible: joint
gait=MIRRORED, intervals=1 | gait=Polygon(6), intervals=8 | body=ModalBody(), gait=Harmonic(1, "antipodal"), intervals=1 -> mesh is too small
guess=Fourier([0], [[1]], [[1]]), gait=MIRRORED -> 1 joints
gait=Basis([BUMP, BUMP]) -> depend on one another
gait=Basis([BUMP**2 - 0.5], "antipodal") -> no gait of symmetry 'antipodal' but rest
gait=Basis([np.exp(np.roll(BUMP, 5))], "bilateral") -> no symmetry 'bilateral'
body=Chain((0.25,) * 4), gait=Basis([np.stack([BUMP, np.roll(BUMP, 5)])]) -> angles of 2 joints, and the body has 3
gait=Polygon(4), scheme="trapezoid" -> gauss-N or radau-N
gait=Polygon(4), body=Chain((0.5, 0.5)), guess=Fourier([0.0], [[1.0]], [[0.0]]) -> three links
gait=Polygon(4, "bilateral"), body=Chain((0.2, 0.3, 0.5)) -> both ends
gait=Serpenoid(), body=Chain((0.5, 0.5)) -> at least three links
gait=Coupled(Harmonic(1, "bilateral"), gears=UNEVEN), body=FIVE -> symmetry none or antipodal
gait=Coupled(MIRRORED, stuck={1: 0.4}), body=FIVE | gait=Coupled(Harmonic(1, "antipodal"), stuck={1: 0.4}), body=FIVE -> may have the symmetry none
gait=Harmonic(1), joint_limit=0.05 -> with joint_limit the usual first gait
objective="turning" | at_least={"rotation": 0.1} -> rotation
rotation=0.2, gait=MIRRORED -> bilateral gait turns
rotation=np.inf -> rotation must be
at_least={"distance": "far"} -> finite number
at_least={"size": 1.0} -> uses size
body=ModalBody(2), guess=Fourier([0, 0], [[2], [0]], [[0], [0.1]]), gait=Harmonic(1) -> tangent at .* reaches
body=ModalBody(4), guess=Fourier([0] * 3, [[1]] * 3, [[0]] * 3), gait=Harmonic(1) -> 3 modes but the body has 4
body=ModalBody(4, "fourier"), gait=MIRRORED -> none or antipodal
body=ModalBody(), gait=Harmonic(1), joint_limit=2.0 -> \(0, pi/2\]
body=ModalBody(), gait=Harmonic(1), formulation="full" -> must be one of implicit velocity
body=ModalBody -> body must be a Chain or ModalBody
body=Wave(), gait=Harmonic() -> leave gait out
body=Wave(), gait=Prescribed((0.0, 0.25, 1.0)) -> may have the symmetry antipodal
gait=Prescribed() | body=ModalBody(), gait=Prescribed() -> not prescribed
body=Wave(amplitude=1.8) -> the tangent reaches 1.8 rad
"""


@pytest.mark.parametrize(("fields", "words"), cases(STATED, " -> "))
def test_a_problem_that_has_no_meaning_is_refused_in_a_sentence(fields, words):
    with pytest.raises(ProblemError, match=words):
        eval(f"Problem('x', {fields})", NAMES)


TAKEN = """
joint_limit=((-np.pi, 1), (-1, np.pi)), gait=Harmonic(1)
guess=ellipse(0.0, 1.0, 2 * np.pi / 3), gait=MIRRORED
limits=PathLimit("heat", "moment**2", 1.0)
grade=3.0, friction=DRAG, objective="towing"
gait=Polygon(2), friction=Friction(mu_t=1, mu_f=1, mu_b=2)
gait=Basis([BUMP]), friction=Friction(mu_t=1, mu_f=1, mu_b=2)
froude=0.1, body=Chain((0.4, 0.6)), gait=Harmonic(3, "antipodal"), friction=Friction(mu_t=2.0)
froude=0.1, body=Chain((0.5, 0.5)), gait=Harmonic(2)
froude=0.1, body=Chain((0.5, 0.5)), gait=Harmonic(1, "antipodal"), grade=0.1
delta_start=0.0
gait=Coupled(Harmonic(1, "antipodal"), gears=UNEVEN), body=FIVE
gait=Coupled(Basis([ellipse(0, 1, 1).angles(np.arange(64) / 64), ellipse(0, 1, 1).angles(np.arange(16, 80) / 64)]), gears=UNEVEN), body=FIVE
"""


@pytest.mark.parametrize("fields", TAKEN.strip().splitlines())
def test_what_lies_beside_it_is_taken(fields):
    problem = eval(f"Problem('x', {fields})", NAMES)
    assert Problem.from_dict(problem.to_dict()).hash == problem.hash


def test_names_of_files_that_colloc_makes_beside_results_are_refused():
    for name in ["tiny.failed.2", "partial", "x.start", "_", "3.5", "a--help"]:
        assert Problem(name).name == name
    made = (
        "tiny.interrupted tiny.FAILED tiny.starts tiny.run tiny.shrunk x.front x.start-7 x.former-2"
    )
    for name in (*made.split(), "x" * 300, ".", "..", "--help", "-x"):
        with pytest.raises(ProblemError, match=r"name must (not end|be at most 200 letters)"):
            Problem(name)


LIMITS = """
ModalBody(modes={}); 1, 20; 0, 21
ModalBody(panels={}); 1, 200; 0, 201
ModalBody(order={}); 2, 12; 1, 13
ModalBody(modes={}, basis="fourier"); 2; 3
ModalBody(basis={}); "fourier"; "x"
CrawlerBody(epsilon={}); TINY, 0.5 - TINY; 0, 0.5
CrawlerBody(share={}); TINY, 1 - TINY; 0, 1
CrawlerBody(modes={}); 2, 12; 1, 13
Concertina(bumps={}); 1, 2; 0, 3
Concertina(epsilon={}); TINY, 0.5 - TINY; 0, 0.5
Concertina(bumps=2, epsilon={}); 0.25 - TINY; 0.25
Concertina(share={}); TINY, 1 - TINY; 0, 1
Concertina(amplitude={}); TINY, np.pi / 2 - TINY; 0, np.pi / 2
Wave(profile={}); "standing"; "x"
Wave(amplitude={}); TINY; 0
Wave(waves={}); 1; 0
Wave(steepness={}); TINY; 0
motion({}); (0.0, 0.1, 1.0); (0.1, 1.0), (0.0, 0.5), (0.0, 0.6, 0.6, 1.0)
motion({}, antipodal=True); (0.0, 0.5); (0.0, 1.0)
PowerLaw({}); 0, 2; -TINY, 2 + TINY
replay(*AT, GAIT, 1e-2, instants={}, tolerance=10.0); 4; -2, 0, 2, 3, 4.5
samples({}); 4; 3
samples(9, {}); 0.5; -1.0, np.inf
samples(90, limits={}); 9.0, (9.0, 8.0); 0.0, (1.0, 1.0, 1.0)
samples(9, limits={}); 100.0; 1.0
bound({}); 0.2, np.pi; 0.0, np.pi + 1e-6
bound(1.0, harmonics={}); (1, 3); (1, 2)
checked_chain(*AT, {}); 0, 1 - TINY; -TINY, 1.0, True, np.inf
checked_chain({}, Friction(), 0.1); Chain(); ModalBody()
"""


@pytest.mark.parametrize(("made", "taken", "refused"), cases(LIMITS, "; "))
def test_the_last_that_is_allowed_is_taken_and_what_lies_beyond_is_refused(made, taken, refused):
    for value in eval(f"[{taken}]", NAMES):
        assert eval(made.format("value"), NAMES | {"value": value}) is not None
    for value in eval(f"[{refused}]", NAMES):
        with pytest.raises(ProblemError):
            eval(made.format("value"), NAMES | {"value": value})


WITHIN = """
Fourier([0, 0], [[1], [1]], [[{}], [1]])
Chain(({}, 0.5, 0.5))
Problem("p", GAIT, mesh_tolerance={})
solve_balance(*AT, with_one({}), ONES, 1e-3)
solve_balance(*AT, ONES, with_one({}), 1e-3)
solve_balance(*AT, ONES, ONES, 1e-3, start=np.full((3, 4), {}))
solve_balance(*AT, ONES, ONES, 1e-3, tolerance={})
replay(*AT, path({}, 1.0), 1e-3)
replay(*AT, path(1.0, {}), 1e-3)
solve_smooth(Wave().prescribed(), Friction(), np.array([0.1]), {})
"""


@pytest.mark.parametrize("value", ["np.nan", "np.inf", "-np.inf"])
@pytest.mark.parametrize("made", WITHIN.strip().splitlines())
def test_not_a_number_and_infinity_are_refused_within_arrays_too(made, value):
    with pytest.raises(ProblemError, match=r".{15}"):
        eval(made.format(value), NAMES)


WRONG_OF_A_SOLUTION = """
sample("a")
sample([np.nan])
export(value, period=4)
export("x.csv", period=4, rate=value)
export("x.csv", period=4, periods=10**9)
export("x.txt", period=4)
export("x.csv", period=4, length=1.0)
export("x.csv", period=4, mass=2.0)
export("x.json", period=4, servo=colloc.Servo())
animate(value)
robot(1, 1, 1, max_speed="fast")
robot(1e300, 1, 1)
robot(1, 1, value)
"""


@pytest.mark.parametrize("value", [None, -1, np.nan, {}, object()])
def test_a_solution_refuses_what_cannot_be_meant(value, three_link, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for call in WRONG_OF_A_SOLUTION.strip().splitlines():
        with pytest.raises(ProblemError):
            eval(f"solution.{call}", NAMES | {"solution": three_link, "value": value})
    with pytest.raises(ProblemError):
        colloc.save(three_link, ".")
    assert not list(tmp_path.iterdir())


FILES = {
    "class Mute(Exception):\n    def __str__(self):\n        raise KeyError\nraise Mute\n": "line 4: Mute",
    "\0": r"x.py: .*null bytes",
    "raise ValueError('\\x1b]0;owned\\x07\\x1b[2J \\u202e backwards \\r gone')\n": r"\\x1b\[2J",
}


@pytest.mark.parametrize(("text", "words"), FILES.items())
def test_what_a_problem_file_raises_is_told_and_cannot_drive_the_terminal(text, words, tmp_path):
    (tmp_path / "x.py").write_text(text, encoding="utf-8")
    with pytest.raises(ProblemError, match=words) as caught:
        colloc.load_problem(tmp_path / "x.py")
    assert str(caught.value).isprintable()


SIZED = """from dataclasses import dataclass
from colloc import Harmonic, Problem
@dataclass(frozen=True)
class Size:
    links: int = 3
PROBLEM = Problem("sized", gait=Harmonic(1, "bilateral"))
"""


@pytest.mark.parametrize("first", ["", "from __future__ import annotations\n", "\ufeff"])
def test_a_problem_file_may_define_dataclasses_and_begin_with_a_byte_order_mark(first, tmp_path):
    """As classes of gaits and laws of one's own are; they look for the module they stand in."""
    (tmp_path / "sized.py").write_text(first + SIZED, encoding="utf-8")
    assert colloc.load_problem(tmp_path / "sized.py").name == "sized"
