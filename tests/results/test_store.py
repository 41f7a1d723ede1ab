"""Results files: round trip, plain h5py, and damage."""

import gzip
from pathlib import Path

import h5py
import numpy as np
import pytest

from colloc.results.store import load, save
from colloc.system.errors import StoreError
from colloc.system.sealed_file import write_sealed


def test_round_trip_keeps_everything(three_link, tmp_path):
    again = load(save(three_link, tmp_path / "a b" / "ü.h5"))
    assert again.problem.hash == three_link.problem.hash
    assert again.status == "solved"
    assert again.certificate == three_link.certificate
    assert again.source == three_link.source
    assert len(again.levels) == len(three_link.levels)
    assert again.starts == three_link.starts > 1
    assert [other.value for other in again.others] == [other.value for other in three_link.others]
    np.testing.assert_array_equal(again.last.x, three_link.last.x)
    t = np.linspace(0, 2, 11)
    np.testing.assert_array_equal(again.sample(t).tail, three_link.sample(t).tail)


def test_plain_h5py_reads_the_motion_with_units(three_link, tmp_path):
    with h5py.File(save(three_link, tmp_path / "x.h5")) as file:
        angles = file["motion/joint_angles"]
        assert angles.attrs["units"] == b"rad"
        assert angles.shape == (2, file["motion/t"].size)
        assert file.attrs["status"].decode() == "solved"
        assert "PROBLEM" in file["source"].asstr()[()]
        assert file["levels/000"].attrs["delta"] == three_link.levels[0].delta


def test_nothing_is_left_behind_and_a_failed_write_keeps_the_old_file(three_link, tmp_path, monkeypatch):
    path = save(three_link, tmp_path / "x.h5")
    before = path.read_bytes()

    def broken(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("colloc.results.store._write_motion", broken)
    with pytest.raises(StoreError, match="No space left"):
        save(three_link, path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["x.h5"]


def test_missing_foreign_and_damaged_files_are_refused(three_link, tmp_path):
    with pytest.raises(StoreError, match="there is no file"):
        load(tmp_path / "none.h5")
    (tmp_path / "text.h5").write_text("hello")
    with pytest.raises(StoreError, match="not a readable"):
        load(tmp_path / "text.h5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = [1.0]
    with pytest.raises(StoreError, match="carries no checksum"):
        load(tmp_path / "other.h5")
    write_sealed(tmp_path / "other.h5", (tmp_path / "other.h5").read_bytes())
    with pytest.raises(StoreError, match="not a colloc solution"):
        load(tmp_path / "other.h5")
    good = save(three_link, tmp_path / "good.h5")
    data = good.read_bytes()
    (tmp_path / "cut.h5").write_bytes(data[: len(data) // 2])
    with pytest.raises(StoreError):
        load(tmp_path / "cut.h5")
    with h5py.File(good, "a") as file:
        del file["problem"]
        file["problem"] = '{"name": "x"}'
    with pytest.raises(
        StoreError, match=r"good.h5 was changed after colloc wrote it, and cannot be read any more: /problem holds"
    ):
        load(good)


def test_xarray_opens_every_group_of_a_solution_with_named_dimensions(three_link, tmp_path):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    path = save(three_link, tmp_path / "x.h5")
    sizes = {}
    for group in ("/", "gait", "motion", "certificate", "levels/000"):
        with xarray.open_dataset(path, group=group, engine="h5netcdf") as data:
            assert not any(name.startswith("phony_dim") for name in data.sizes)
            assert set(data.dims) <= {"joint", "harmonic", "t", "velocity", "axis", "check", "edge", "variable", "constraint"}
            sizes |= data.sizes
            if group == "motion":
                assert data.joint_angles.dims == ("joint", "t")
                assert data.t.values[-1] == 1.0
                np.testing.assert_array_equal(data.centre, three_link.sample(data.t.values).centre)
    assert (sizes["joint"], sizes["axis"], sizes["velocity"]) == (2, 2, 3)
    assert sizes["check"] == len(three_link.certificate.checks)


def test_a_file_of_an_earlier_colloc_is_read_and_verified(tmp_path, capsys):
    """Written on 21 November 2026, when this format was new: without other optima, without errors of distance and work."""
    from colloc.commands.main import main as colloc

    path = tmp_path / "earlier.h5"
    path.write_bytes(gzip.decompress(Path(__file__).with_name("solution_of_november_2026.h5.gz").read_bytes()))
    solution = load(path)
    assert (solution.status, solution.others) == ("solved", ())
    assert solution.certificate.efficiency == pytest.approx(0.25967706, abs=1e-8)
    assert np.isnan(solution.certificate.distance_error)
    # what it says of delta -> 0 was extrapolated in another way, and states no error
    assert colloc(["verify", str(path)]) == 4
    assert "an efficiency for delta -> 0 of 0.26006181, which is off by 3.2e-05" in capsys.readouterr().out


@pytest.fixture
def former(tmp_path):
    """Written by the colloc of 21 November 2026, 15:00, on the quick problem: the last of format 2."""
    path = tmp_path / "former.h5"
    path.write_bytes(gzip.decompress(Path(__file__).with_name("solution_of_format_2.h5.gz").read_bytes()))
    return path


def test_a_file_of_the_former_format_is_read_verified_and_saved_as_the_present_one(former, tmp_path, capsys):
    from colloc.commands.main import main as colloc

    solution = load(former)
    assert (solution.status, solution.problem.name, solution.last.delta) == ("solved", "quick", 1e-2)
    with h5py.File(former) as file:
        np.testing.assert_array_equal(solution.last.x, file[f"levels/{len(solution.levels) - 1:03d}/x"])
        np.testing.assert_array_equal(solution.gait.cos, file["gait/cos"])
        assert solution.source == file["source"].asstr()[()]
        assert [check.meaning for check in solution.certificate.checks] == file["certificate/meaning"].asstr()[()].tolist()
    again = load(save(solution, tmp_path / "present.h5"))
    assert again.certificate.checks == solution.certificate.checks
    # what it says of delta -> 0 was extrapolated in another way, and states no error
    assert colloc(["verify", str(former)]) == 4
    assert "an efficiency for delta -> 0 of 0.26006179, which is off by 3.2e-05" in capsys.readouterr().out


def test_nothing_of_a_former_file_is_read_whose_seal_does_not_fit_or_that_is_older_still(former):
    data = former.read_bytes()
    former.write_bytes(data[:5000] + bytes([data[5000] ^ 1]) + data[5001:])
    with pytest.raises(StoreError, match="checksum does not fit"):
        load(former)
    former.write_bytes(data)
    with h5py.File(former, "a") as file:
        file.attrs["format_version"] = 1
    with pytest.raises(StoreError, match="carries no checksum"):
        load(former)
    write_sealed(former, former.read_bytes())
    with pytest.raises(StoreError, match="not a colloc solution of format 2 or 3"):
        load(former)


def test_a_former_file_that_keeps_hdf5_busy_is_given_up(former, monkeypatch):
    monkeypatch.setattr("colloc.results.former_format._SECONDS", 1e-3)
    with pytest.raises(StoreError, match="came to no end"):
        load(former)
