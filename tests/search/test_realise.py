"""Finite gaits that come near a relaxed one: of both senses of their loops the better counts."""

from types import SimpleNamespace

import numpy as np
import pytest

from colloc import Friction, Problem, Relaxed
from colloc.gaits.relaxed import Mixture
from colloc.search import realise
from colloc.search.realise import realised_gaits


@pytest.mark.parametrize("better", [1, -1])
def test_loops_run_the_way_that_is_worth_more(better, monkeypatch):
    """Two loops of three directions that add up to nothing; what a certificate would say is their area, or minus that."""
    turn = 2 * np.pi * np.array([0.0, 2.0, 1.0]) / 3
    directions = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    gait = Mixture([[0.3, 0.3, 0.3]], [directions], np.zeros(2))

    def certified(problem, polygon):
        x, y = polygon.corners
        area = 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
        return SimpleNamespace(passed=True, efficiency=better * area)

    monkeypatch.setattr(realise, "finite_certificate", certified)
    problem = Problem("loops", friction=Friction(), gait=Relaxed(3, "none"), delta=1e-3)
    (found,) = realised_gaits(problem, gait, (2,))
    assert found.certificate.efficiency > 0
    assert found.sense == better
