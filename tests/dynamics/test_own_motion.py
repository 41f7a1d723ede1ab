"""A kind of motion that the library does not know, in this file alone: solved, certified, kept and read like
any other. A body that crawls slowly on the level is pushed along its tail link, as by a propeller."""

from dataclasses import dataclass

import numpy as np
import pytest

from colloc import Chain, Friction, Harmonic, Problem, ellipse, load, save
from colloc.dynamics.dynamics import QuasiStatic, Trajectory
from colloc.gaits import gait_fields
from colloc.gaits.objective import EFFICIENCY
from colloc.gaits.regime import Regime
from colloc.mechanics.densities import LENGTH
from colloc.mechanics.fixed_point import chain_motion, motion_and_derivatives, solve_balance
from colloc.numerics.arrays import namespace
from colloc.search.solve import solve
from colloc.verification.adaptive_motion import Replay, to_tolerance, whole_totals
from colloc.verification.differential_motion import integrate_period
from colloc.verification.mesh_error import ReferenceMotion
from colloc.verification.replay import replay, replayer


class PushedMotion(QuasiStatic):
    """The balance holds instant by instant, with the push; the work is that of the joints."""

    followed = True

    def simulate(self, mesh, shapes, static, states_guess=None, z_guess=None):
        at = self.body, self.law, shapes.angles, shapes.rates, shapes.delta
        pushed = self.regime.pull(np.zeros((1, mesh.n_point)))
        solved = solve_balance(*at, load=pushed, start=z_guess, tolerance=1e-12)
        now = chain_motion(*at, solved, pushed)

        def slopes():
            found = motion_and_derivatives(*at, solved, pushed)[1][:, : 2 * self.body.n_joint]
            found[5] -= self.regime.push * found[3]
            return found, found[:, :0]

        now = now._replace(power=now.actuator_power)
        return Trajectory(static, now, solved.residual < 1e-9, slopes)


@dataclass(frozen=True)
class Pushed(Regime):
    """Slow, on the level, and pushed along the tail link by a force in units of the weight."""

    push: float

    dynamics = PushedMotion
    spent = "friction less what the push does"

    @property
    def label(self):
        return f", pushed by {self.push:g}"

    def describe(self):
        return f"pushed along its tail link by {self.push:g}"

    def in_units_of(self, unit):
        return Pushed(self.push / unit)

    def pull(self, theta):
        return namespace(theta).stack([self.push + 0 * theta, 0 * theta])

    def reference(self, control, gait, delta, mesh, error):
        ran = Gait(control.dynamics.body, control.dynamics.law, gait, delta, self.push).run(error)
        return ReferenceMotion(lambda t: ran.at(t)[:4], error)

    def replay(
        self, body, friction, path, delta, *, tolerance=1e-6, objective=EFFICIENCY, quantities=(),
        **_,
    ):  # fmt: skip
        gait = Gait(body, friction, path, delta, self.push)

        def run(error):
            ran = gait.run(error)
            theta, x, y, work, _ = ran.states[:, -1]
            way = float(np.hypot(x, y))
            return ran, {"distance": way, "work": float(work), "rotation": float(theta)}

        totals = whole_totals([LENGTH, *quantities], path)
        ran, values, errors = to_tolerance(run, tolerance, objective, tolerance, totals)
        t = ran.phases % 1.0
        solved, _ = gait.balanced(t)
        found = {"values": values, "errors": errors, "tail": (t, solved.z), "instants": t.size}
        found |= {"actuator_work": float(ran.states[4, -1]), "objective": objective}
        found |= {"residual": float(solved.residual.max()), "others": {}, "several": 0.0}
        error = float(objective.relative_error(values, errors))
        return Replay(**found, error=error, lever=1.0)


class Gait:
    """Orientation, place, work of the joints, and friction's less the push's."""

    def __init__(self, body, friction, path, delta, push):
        self.at, self.path, self.delta, self.push = (body, friction), path, delta, push

    def balanced(self, t, near=None):
        shapes, pushed = (*self.path(t), self.delta), np.outer([self.push, 0.0], np.ones(t.size))
        solved = solve_balance(*self.at, *shapes, load=pushed, start=near).require()
        return solved, chain_motion(*self.at, *shapes, solved, pushed)

    def rates(self, t, state, near):
        solved, now = self.balanced(np.array([t]), near)
        moved = np.exp(1j * state[0]) * complex(*now.centre[:, 0])
        powers = now.actuator_power[0], now.power[0] - self.push * now.centre[0, 0]
        return np.array([now.z[2, 0], moved.real, moved.imag, *powers]), solved.z

    def run(self, error):
        return integrate_period(self.rates, np.zeros(5), error, longest=4e-3)


PROBLEM = Problem(
    "pushed", ellipse(0, 2.8, 1.3), gait=Harmonic(1, "antipodal"), delta=1e-2, motion=Pushed(0.1)
)


@pytest.mark.slow
def test_a_kind_of_motion_in_one_file_is_solved_certified_kept_and_read(monkeypatch, tmp_path):
    monkeypatch.setattr(gait_fields, "MOTIONS", [Pushed])
    found = solve(PROBLEM, starts=1)
    assert found.status == "solved", found.message
    assert "pushed by 0.1" in repr(PROBLEM)
    assert found.efficiency > 1.1 * replay(Chain(), Friction(), found.gait, 1e-2).efficiency
    read = load(save(found, tmp_path / "pushed.h5"))
    assert (read.problem.motion, read.certificate) == (Pushed(0.1), found.certificate)
    assert read.problem.hash == PROBLEM.hash != PROBLEM.with_(motion=None).hash


def test_without_a_push_it_is_the_motion_on_the_level():
    at = Chain(), Friction(), ellipse(0, 2.8, 1.3), 1e-2
    own, level = replayer(Pushed(0.0))(*at), replay(*at)
    for name in ("distance", "work", "rotation"):
        assert own.values[name] == pytest.approx(level.values[name], abs=1e-6)
