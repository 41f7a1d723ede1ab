"""Problems that have no meaning are refused as they are stated, in a sentence."""

import numpy as np
import pytest

import colloc
from colloc import ProblemError

NAMES = {name: getattr(colloc, name) for name in colloc.__all__} | {"np": np}
BUMP = np.sin(2 * np.pi * np.arange(50) / 50)
MIRRORED = colloc.Harmonic(1, "bilateral")
NAMES |= {"BUMP": BUMP, "MIRRORED": MIRRORED, "DRAG": colloc.Viscous(normal=2, tangential=1)}
STATED = r"""
joint_limit=((0.0, 1.0), 1.0) -> straight body
joint_limit=((-1.0, 0.0), 1.0) -> straight body
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
limits=["moment < 1"] -> PathLimit
limits=3 -> PathLimit
limits=[PathLimit("heat", "moment**2", -1.0)] -> must be positive
limits=[PathLimit("heat", "moment**2", "x")] -> must be positive
objective="driven efficiency", formulation="implicit velocity" -> formulation 'full'
objective=Objective("distance / heat") -> speaks of heat
objective=Objective("1 / mine", quantities=[Quantity("mine", "moment**2")]) -> no sum over the joints
objective=Objective("1 / work", quantities=[Quantity("work", "sum(rate)")]) -> a name of its own
froude=-1.0 -> not negative
froude="fast" -> not negative
froude=0.1, gait=MIRRORED -> run backwards
froude=0.1, gait=Polygon(4) -> leaves the pace open
froude=0.1, body=ModalBody(), gait=Harmonic(1) -> of a ModalBody
froude=0.1, gait=Harmonic(1), grade=0.1, rotation=1.0 -> on a slope a body that a period turns
froude=0.1, gait=Harmonic(1), grade=2.0 -> slides down for ever
froude=0.1, gait=Harmonic(1), objective="driven efficiency" -> single joints
froude=0.1, gait=Harmonic(1), scheme="lobatto-4" -> gauss-N
froude=0.1, gait=Harmonic(1), formulation="implicit velocity" -> only the formulation
froude=0.1, body=Chain((0.5, 0.5)), gait=Harmonic(3, "antipodal") -> own axis of symmetry
froude=0.1, body=Chain((0.5, 0.5)), gait=Harmonic(2), rotation=1.0 -> never turn
froude=(1.0, 0.1) -> the smaller one first
froude=(-1.0, 0.1) -> above 0
froude=(0.1, np.inf) -> two numbers
froude=(0.1, 1.0, 2.0) -> two numbers
froude=(0.1, 1.0), objective="1 / length" -> depends on it
froude=(0.1, 1.0), objective="distance / period", gait=Polygon(4) -> of a class Harmonic
objective="distance / period" -> state the pace
grade=1.0 -> slides down for ever
grade=-1.0 -> grade must be
grade="steep" -> grade must be
grade=0.1, gait=Polygon(symmetry="bilateral") -> no part of a period follows from another: take Polygon
grade=0.1, body=CrawlerBody() -> only a Chain
grade=0.1, objective="turning" -> the objective speaks of the rotation
grade=0.1, rotation=0.1 -> a body that a period turns has no gait that repeats
grade=0.1, formulation="implicit velocity" -> only the formulation 'full'
grade=0.1, scheme="trapezoid" -> a gauss-N or radau-N scheme is needed
grade=0.1, towards="up" -> towards must be a finite angle
towards=1.0 -> towards is a direction on a slope
body=Chain((0.5, 0.5)), gait=Harmonic(1, "antipodal") -> scallop
gait=Polygon(2) -> it retraces its path, and reversed rates
gait=Basis([BUMP]) -> it retraces its path, and reversed rates
body=Chain(feet=(Foot(0, 0.1), Foot(1), Foot(2))), gait=MIRRORED -> read the same from both ends
guess=ellipse(1.0, 1e-6, 0.7e-6), gait=MIRRORED -> hardly moves
guess=ellipse(0.0, 1.0, 2 * np.pi / 3 + 1e-5), gait=MIRRORED -> cross
guess=ellipse(np.pi - 1, 1.0 + 1e-5, 0.1), gait=MIRRORED -> beyond the limit
"""


@pytest.mark.parametrize("line", STATED.strip().splitlines())
def test_what_has_no_meaning_is_refused_in_a_sentence(line):
    fields, words = line.split(" -> ")
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
delta_start=0.0
"""


@pytest.mark.parametrize("fields", TAKEN.strip().splitlines())
def test_what_lies_beside_it_is_taken(fields):
    problem = eval(f"Problem('x', {fields})", NAMES)
    assert colloc.Problem.from_dict(problem.to_dict()).hash == problem.hash


@pytest.mark.parametrize(
    ("name", "taken"),
    [(f"tiny.{end}", False) for end in ("interrupted", "FAILED", "starts", "run", "shrunk")]
    + [(name, False) for name in ("x.front", "x.start-7", "x.former-2", ".", "..", "--help", "-x")]
    + [(name, True) for name in ("tiny.failed.2", "partial", "x.start", "_", "3.5", "a--help")],
)
def test_names_of_files_that_colloc_makes_beside_results_are_refused(name, taken):
    if taken:
        assert colloc.Problem(name).name == name
    else:
        with pytest.raises(ProblemError, match=r"name must (not end|be at most 200 letters)"):
            colloc.Problem(name)
