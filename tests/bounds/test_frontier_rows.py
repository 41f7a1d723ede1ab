"""Which kept bounds hold for a row of the table from both sides."""

import json

import numpy as np
import pytest

from scripts import frontier_rows
from scripts.frontier_rows import Row, guaranteed_bound, smallest_bound

ISOTROPIC = (1.0, 1.0, 1.0)


def test_a_bound_holds_for_smaller_limits_and_larger_widths_and_friction_alone_gives_one():
    known = {"1-1-1-2.5-4-0 bound": {"sampled": 0.7}, "1-1-1-3.1416-4-0 bound": {"sampled": 0.9}}
    assert smallest_bound(Row(ISOTROPIC, 2.0, 4, 0.03), known) == 0.7
    assert smallest_bound(Row(ISOTROPIC, float(np.pi), 4, 0.0), known) == 0.9
    assert smallest_bound(Row(ISOTROPIC, 2.0, 5, 0.0), known) == 1.0
    assert smallest_bound(Row((0.5, 1.0, 5.0), 2.0, 4, 0.0), known) == 2.0


@pytest.mark.parametrize(("left", "bound"), [(0, 0.47), (3, np.inf)])
def test_what_is_proved_in_parts_holds_once_every_part_has_closed_all_cells(tmp_path, monkeypatch, left, bound):
    proof = {"lengths": [1 / 3] * 3, "law": "Friction", "mu": [1.0, 1.0, 1.0], "joint_limit": float(np.pi)}
    proof |= {"target": 0.47, "guaranteed": 0.47}
    parts = [proof | {"part": [k, 2], "open_cells": left * (k - 1)} for k in (1, 2)]
    file = tmp_path / "guaranteed.json"
    file.write_text(json.dumps(parts))
    monkeypatch.setattr(frontier_rows, "PROVED", file)
    assert guaranteed_bound(Row(ISOTROPIC, 2.5, 3, 0.0)) == bound
    assert guaranteed_bound(Row((3.0, 1.0, 1.0), 2.5, 3, 0.0)) == np.inf
