"""HDF5 files of results: what texts and numbers become, and what is refused."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from shared.store_samples import HDF5_KINDS, Samples

from colloc.system.errors import StoreError
from colloc.system.store_file import array, attribute, mark, new_file, open_file, put, put_attribute

TEXTS = ["", "1", "ä", "Reibung \N{GREEK SMALL LETTER MU}_t / µ_f", "tab\tand\nline", "nul\0inside"]
TEXTS += ["\N{SNAKE}" * 500]


@pytest.fixture(scope="module")
def samples(solved, tmp_path_factory):
    return Samples(tmp_path_factory.mktemp("kinds"), solved("three_link")[0])


def returned(path, value):
    """What a dataset and an attribute give back."""
    with new_file(path) as file:
        mark(file, "test", 1)
        put(file, "value", value, units="1")
        put_attribute(file, "value", value)
    with open_file(path, "test", 1) as file:
        assert attribute(file["value"], "units") == "1"
        return array(file, "value"), attribute(file, "value")


@pytest.mark.parametrize("value", TEXTS)
def test_texts_round_trip(tmp_path, value):
    assert returned(tmp_path / "x.h5", value) == (value, value)


CHARACTERS = st.characters(exclude_categories=["Cs"])
FIXTURES = [HealthCheck.function_scoped_fixture]


@settings(max_examples=50, deadline=None, derandomize=True, suppress_health_check=FIXTURES)
@given(st.lists(st.text(CHARACTERS, max_size=20), max_size=5))
def test_lists_of_texts_round_trip_but_for_trailing_nuls(tmp_path, values):
    for found in returned(tmp_path / "x.h5", np.array(values, dtype=object)):
        assert found.tolist() == [value.rstrip("\0") for value in values]


@pytest.mark.parametrize(
    "value",
    [True, 3, -2.5, [1.0, np.nan], [[1, 2]], [True, False], np.zeros((0, 2)), np.float32(0.5)],
)
def test_numbers_round_trip_with_their_types(tmp_path, value):
    for found in returned(tmp_path / "x.h5", value):
        np.testing.assert_array_equal(found, value)
        assert np.shape(found) == np.shape(value)
        assert np.asarray(found).dtype.kind == np.asarray(value).dtype.kind


@pytest.mark.parametrize("kind", HDF5_KINDS)
def test_a_damaged_file_is_refused_in_a_sentence_or_read(samples, kind, tmp_path):
    """Cut, or with one byte in 20 exchanged; HDF5's own checksums cover what describes the data."""
    data, rng = samples.write(kind).read_bytes(), np.random.default_rng(1)
    damaged = [data[:-1], data[: len(data) // 2], data[:10], b"", b"no HDF5", bytes(8) + data[8:]]
    for begin in rng.integers(len(data) - 100, size=20):
        damaged.append(data[:begin] + rng.bytes(100) + data[begin + 100 :])
    refused = []
    for number, content in enumerate(damaged):
        path = tmp_path / f"{number}.h5"
        path.write_bytes(content)
        try:
            samples.read(kind, path)
        except StoreError as error:
            refused.append(str(error).removeprefix(f"{path} "))
    assert len(refused) >= 6
    assert all(each.startswith("is not a readable colloc ") for each in refused)
    assert not [each for each in refused if "\n" in each]


def test_files_of_an_older_or_newer_colloc_and_of_another_kind_are_told_apart(tmp_path):
    path = tmp_path / "x.h5"
    for version, remedy in ((1, "Make it again"), (3, "Update colloc")):
        with new_file(path) as file:
            mark(file, "test", version)
        said = f"its format is {version}, where this colloc reads 2. {remedy}"
        with pytest.raises(StoreError, match=said):
            open_file(path, "test", 2).__enter__()
    with pytest.raises(StoreError, match="is not a readable colloc study: it is a test"):
        open_file(path, "colloc study", 2).__enter__()
    with pytest.raises(StoreError, match="there is no file"):
        open_file(tmp_path, "test", 2).__enter__()


def test_what_is_missing_or_no_dataset_is_named(tmp_path):
    with new_file(tmp_path / "x.h5") as file:
        mark(file, "test", 1)
        file.create_group("group")
    for read, name in ((array, "none"), (array, "group"), (attribute, "none")):
        refused = pytest.raises(StoreError, match=f"x.h5 .*{name}.* is missing")
        with refused, open_file(tmp_path / "x.h5", "test", 1) as file:
            read(file, name)
