"""Results files: round trip, plain h5py, and damage."""

import dataclasses

import h5py
import numpy as np
import pytest

from colloc import StoreError, load, save
from colloc.search.options import OPTIONS, TOLERANCES, SearchOptions, Tolerances


def test_round_trip_keeps_everything(three_link, tmp_path):
    again = load(save(three_link, tmp_path / "a b" / "ü.h5"))
    assert again.problem.hash == three_link.problem.hash
    assert again.status == "solved"
    assert again.certificate == three_link.certificate
    assert again.source == three_link.source
    assert Tolerances(**again.settings["tolerances"]) == TOLERANCES
    assert SearchOptions(**again.settings["options"]) == OPTIONS
    assert len(again.history) == len(three_link.history)
    assert again.starts == three_link.starts > 1
    assert [other.value for other in again.others] == [other.value for other in three_link.others]
    np.testing.assert_array_equal(again.answer.x, three_link.answer.x)
    t = np.linspace(0, 2, 11)
    np.testing.assert_array_equal(again.sample(t).tail, three_link.sample(t).tail)


def test_an_answer_met_among_gaits_larger_than_the_problems_own_guess_is_read_back(
    three_link, tmp_path
):
    """The search may go on among gaits that are faster than the usual first guess."""
    gait = three_link.gait
    larger = three_link.answer.problem.with_(smallest_shape_speed=gait.shape_speed, guess=gait)
    answer = dataclasses.replace(three_link.answer, problem=larger)
    small = three_link.problem.with_(guess=gait.scaled(0.5))
    again = load(
        save(dataclasses.replace(three_link, problem=small, answer=answer), tmp_path / "x.h5")
    )
    assert again.answer.problem.hash == larger.hash
    assert again.problem.hash == small.hash


@pytest.mark.parametrize("name", ["distance", "work_error", "value_at_zero_delta", "value"])
def test_a_certificate_without_one_of_its_numbers_or_with_several_for_one_is_refused(
    name, three_link, tmp_path
):
    path, said = save(three_link, tmp_path / "x.h5"), f"attribute {name} of /certificate is missing"
    with h5py.File(path, "a") as file:
        del file["certificate"].attrs[name]
        if name == "value":
            file["certificate"].attrs[name], said = [0.26, 0.27], "TypeError"
    with pytest.raises(StoreError, match=f"not a readable colloc solution: {said}"):
        load(path)


def test_xarray_opens_every_group_of_a_solution_with_named_dimensions(three_link, tmp_path):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    path = save(three_link, tmp_path / "x.h5")
    sizes = {}
    for group in ("/", "gait", "motion", "certificate", "answer", "history"):
        with xarray.open_dataset(path, group=group, engine="h5netcdf") as data:
            assert not any(name.startswith("phony_dim") for name in data.sizes)
            known = "joint harmonic t velocity axis check edge variable constraint step"
            assert set(data.dims) <= set(known.split())
            sizes |= data.sizes
            if group == "motion":
                assert data.joint_angles.dims == ("joint", "t")
                assert data.t.values[-1] == 1.0
                np.testing.assert_array_equal(data.centre, three_link.sample(data.t.values).centre)
    assert (sizes["joint"], sizes["axis"], sizes["velocity"]) == (2, 2, 3)
    assert sizes["check"] == len(three_link.certificate.checks)
