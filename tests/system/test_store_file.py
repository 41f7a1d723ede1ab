"""HDF5 files of results: what texts and numbers become, and that nothing of variable length is left to read."""

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from shared.store_samples import HDF5_KINDS, Samples

from colloc.system.errors import StoreError
from colloc.system.sealed_file import SEAL_SIZE, write_sealed
from colloc.system.store_file import (
    LARGEST_ARRAY,
    LARGEST_FILE,
    LONGEST_IN_ARRAY,
    LONGEST_TEXT,
    array,
    attribute,
    mark,
    new_file,
    put,
    put_attribute,
    sealed_file,
    text,
)
from scripts.paper.array_store import read_arrays, write_arrays

FOR_NETCDF = {"DIMENSION_LIST", "REFERENCE_LIST"}
"""References of dimension scales, which colloc writes for other readers and never reads."""
TEXTS = ["", "1", "ä", "Reibung \N{GREEK SMALL LETTER MU}_t / µ_f", "tab\tand\nline", "nul\0inside", "\N{SNAKE}" * 500]


@pytest.fixture(scope="module")
def samples(solved, tmp_path_factory):
    return Samples(tmp_path_factory.mktemp("kinds"), solved("three_link")[0])


def returned(path, value):
    """What a dataset and an attribute give back."""
    with new_file(path) as file:
        mark(file, "test", 1)
        put(file, "value", value, units="1")
        put_attribute(file, "value", value)
    with sealed_file(path, "test", 1) as file:
        assert attribute(file["value"], "units") == "1"
        return array(file, "value"), attribute(file, "value")


@pytest.mark.parametrize("value", TEXTS)
def test_texts_round_trip(tmp_path, value):
    assert returned(tmp_path / "x.h5", value) == (value, value)


@settings(max_examples=50, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.text(st.characters(exclude_categories=["Cs"]), max_size=20), max_size=5))
def test_lists_of_texts_round_trip_but_for_trailing_nuls(tmp_path, values):
    for found in returned(tmp_path / "x.h5", np.array(values, dtype=object)):
        assert found.tolist() == [value.rstrip("\0") for value in values]


def test_trailing_nuls_are_not_kept_and_what_utf8_cannot_hold_is_replaced(tmp_path):
    assert returned(tmp_path / "x.h5", "a\0b\0\0") == ("a\0b", "a\0b")
    assert returned(tmp_path / "x.h5", "\0") == ("", "")
    assert returned(tmp_path / "x.h5", "name \udcff") == ("name ?", "name ?")


@pytest.mark.parametrize("value", [True, 3, -2.5, [1.0, np.nan], [[1, 2]], [True, False], np.zeros((0, 2)), np.float32(0.5)])
def test_numbers_round_trip_with_their_types(tmp_path, value):
    for found in returned(tmp_path / "x.h5", value):
        np.testing.assert_array_equal(found, value)
        assert np.shape(found) == np.shape(value)
        assert np.asarray(found).dtype.kind == np.asarray(value).dtype.kind


def test_a_long_text_does_not_make_an_array_of_texts_unreadable(tmp_path):
    found, _ = returned(tmp_path / "x.h5", ["short", "ä" * 10 * LONGEST_IN_ARRAY])
    assert found[0] == "short"
    assert len(found[1]) == LONGEST_IN_ARRAY
    assert found[1].endswith("ä…")
    longest = "x" * LONGEST_TEXT
    assert returned(tmp_path / "x.h5", longest) == (longest, longest)
    for write in (put, put_attribute):
        with pytest.raises(StoreError, match="too long"), new_file(tmp_path / "x.h5") as file:
            write(file, "value", longest + "x")
        with pytest.raises(TypeError, match="neither"), new_file(tmp_path / "x.h5") as file:
            write(file, "value", ["text", None])


def test_limits_of_size_are_to_the_byte_and_those_of_the_documentation(tmp_path):
    assert (LARGEST_FILE, LONGEST_TEXT, LONGEST_IN_ARRAY) == (256 * 2**20, 2**20, 2000)  # docs/howto/studies.md
    assert LARGEST_ARRAY == LARGEST_FILE / 2
    path = tmp_path / "x.h5"
    with new_file(path) as file:
        mark(file, "test", 1)
        put(file, "numbers", np.arange(5.0))
        put(file, "texts", ["abc", "de"])
    size = path.stat().st_size
    with sealed_file(path, "test", 1, largest=size) as file:
        assert array(file, "numbers", largest=40).size == 5
        assert array(file, "texts", largest=2 * 3 * 4).tolist() == ["abc", "de"]  # NumPy takes four bytes a character
        for name, needed in (("numbers", 40), ("texts", 24)):
            with pytest.raises(StoreError, match="too large"):
                array(file, name, largest=needed - 1)
    with pytest.raises(StoreError, match="too large"), sealed_file(path, "test", 1, largest=size - 1):
        pass


def test_a_number_is_no_text(tmp_path):
    with new_file(tmp_path / "x.h5") as file:
        mark(file, "test", 1)
        put(file, "value", 1.0)
    with pytest.raises(StoreError, match="not a text"), sealed_file(tmp_path / "x.h5", "test", 1) as file:
        text(file, "value")


@pytest.mark.parametrize("kind", HDF5_KINDS)
def test_nothing_of_variable_length_in_chunks_or_squeezed_is_written(samples, kind):
    seen = []

    def visit(_, item):
        for name in set(item.attrs) - FOR_NETCDF:
            seen.append(item.attrs.get_id(name).get_type())
        if isinstance(item, h5py.Dataset):
            assert item.chunks is None
            assert item.compression is None
            seen.append(item.id.get_type())

    with h5py.File(samples.write(kind)) as file:
        visit("", file)
        file.visititems(visit)
    assert len(seen) > 5
    for found in seen:
        assert found.get_class() in (h5py.h5t.STRING, h5py.h5t.INTEGER, h5py.h5t.FLOAT, h5py.h5t.ENUM)
        assert found.get_class() != h5py.h5t.STRING or not found.is_variable_str()


@pytest.mark.parametrize("kind", HDF5_KINDS)
def test_readers_touch_no_data_of_variable_length(samples, kind, monkeypatch):
    """Also not the references of dimension scales, which the study file holds for xarray."""
    samples.write(kind)
    before = samples.read(kind)
    read = h5py.AttributeManager.__getitem__

    def watched(self, name):
        assert name not in FOR_NETCDF
        return read(self, name)

    def refuse(*_):
        raise AssertionError("scales were asked for")

    monkeypatch.setattr(h5py.AttributeManager, "__getitem__", watched)
    monkeypatch.setattr(h5py.Dataset, "dims", property(refuse))
    assert samples.read(kind) == before


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("solution", "answer/x"),
        ("solution", "problem"),
        ("arrays", "a/b"),
        ("study", "status"),
    ],
)
def test_metadata_carry_checksums_of_their_own(samples, kind, name):
    """A header whose bits changed is refused by HDF5, whoever seals the file anew."""
    path = samples.write(kind)
    data = path.read_bytes()[:-SEAL_SIZE]
    assert data[8] == 2  # superblock of HDF5 1.8: also old readers know it
    with h5py.File(path) as file:
        heads = [0, *(h5py.h5o.get_info(file[place].id).addr for place in ("/", name))]
    assert [data[head : head + 4] for head in heads] == [b"\x89HDF", b"OHDR", b"OHDR"]
    for head in heads:
        for byte in range(0, 44, 4):
            write_sealed(path, data[: head + byte] + bytes([data[head + byte] ^ 1]) + data[head + byte + 1 :])
            with pytest.raises(StoreError):
                samples.read(kind, path)


def test_files_of_an_older_or_newer_colloc_are_told_apart_from_damage(tmp_path):
    path = tmp_path / "x.h5"
    for version, age, remedy in ((1, "an older", "Move it away, and make it again"), (3, "a newer", "Update colloc")):
        with new_file(path) as file:
            mark(file, "test", version)
        with pytest.raises(StoreError, match=f"{age} colloc: its format is {version}.*{remedy}"), sealed_file(path, "test", 2):
            pass
    with h5py.File(path, "w") as file:  # as colloc wrote its first files
        file.attrs["format"], file.attrs["format_version"] = "test", 1
    write_sealed(path, path.read_bytes())
    with (
        pytest.raises(StoreError, match="an older colloc wrote it, or another program"),
        sealed_file(path, "test", 2),
    ):
        pass
    write_sealed(path, b"no HDF5")
    with pytest.raises(StoreError, match="no HDF5 file"), sealed_file(path, "test", 2):
        pass


def test_plain_h5py_reads_texts(tmp_path):
    path = tmp_path / "x.h5"
    write_arrays(path, {"names": np.array(["ä", "bb"]), "one": "text"}, attributes={"note": "µ"})
    with h5py.File(path) as file:
        assert file["names"].asstr()[()].tolist() == ["ä", "bb"]
        assert file["one"].asstr()[()] == "text"
        assert file.attrs["note"].decode() == "µ"
    assert read_arrays(path)["names"].tolist() == ["ä", "bb"]
