"""The polygon of many corners in results/curated, the best gait of three equal links that is known
within 2.5 rad."""

import json
from pathlib import Path

import numpy as np
import pytest

from colloc import Chain, Friction, replay
from colloc.gaits.bspline import Corners
from colloc.mechanics.contact import crossing_depth

FILE = Path(__file__).resolve().parents[2] / "results/curated/many_corners.json"


def test_the_best_polygon_that_is_known_is_replayed_at_its_value():
    stored = json.loads(FILE.read_text(encoding="utf-8"))
    gait = Corners(stored["corners"], stored["symmetry"])
    assert len(gait.corner_phases) + 1 == 1940
    assert np.abs(gait.vertices).max() < 2.46
    found = replay(Chain(), Friction(), gait, 1e-5 * gait.length, breaks=gait.corner_phases)
    assert found.efficiency == pytest.approx(0.448547, abs=2e-6)
    assert found.distance == pytest.approx(0.677236, abs=2e-6)
    assert crossing_depth(Chain(), gait.angles(np.linspace(0, 1, 20001))).max() == 0
