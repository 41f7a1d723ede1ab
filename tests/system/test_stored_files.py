"""Rows by key: kept to the bit, all of a call or none."""

import sqlite3
from contextlib import closing
from functools import partial

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from shared.store_samples import HDF5_KINDS, Samples

from benchmarks.tables import cached
from colloc import StoreError
from colloc.system.row_file import CACHE, put_rows, read_rows
from colloc.system.store_file import array, attribute, mark, new_file, open_file, put, put_attribute

KIND = "colloc test 1"
CHARACTERS = st.characters(exclude_categories=["Cs"])
FIXTURES = [HealthCheck.function_scoped_fixture]
NUMBERS = True, 3, -2.5, [1.0, np.nan], [[1, 2]], [True, False], np.zeros((0, 2)), np.float32(0.5)
TEXTS = ["", "1", "ä", "Reibung \N{GREEK SMALL LETTER MU}_t / µ_f", "tab\tand\nline", "nul\0inside"]
TEXTS += ["\N{SNAKE}" * 500]


def test_rows_come_back_as_they_were_in_the_order_in_which_their_keys_came(tmp_path):
    path = tmp_path / "ö new" / "x?#%.sqlite"
    assert read_rows(path, KIND) == {}
    put_rows(path, KIND, {"b": [1 / 3, -0.0, 1e-300], "a": {"ä": None}})
    put_rows(path, KIND, {"c": 2**60, "b": [2 / 3]})
    assert list(read_rows(path, KIND).items()) == [("b", [2 / 3]), ("a", {"ä": None}), ("c", 2**60)]
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def with_statement(path, statement):
    put_rows(path, KIND, {"a": 1})
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute(statement)


@pytest.mark.parametrize(
    "content",
    [
        f'CREATE TRIGGER t AFTER INSERT ON "{KIND}" BEGIN DELETE FROM "{KIND}"; END',
        "CREATE VIEW v AS WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT x "
        "FROM c",
        "CREATE TABLE other (a)",
        *(b"short", b"text " * 1000, b"SQLite format 3\0" + bytes(5000)),
    ],
)
def test_no_database_or_one_with_more_than_its_table_is_refused_and_left_as_it_is(
    content, tmp_path
):
    path, said = tmp_path / "x.sqlite", "is not a colloc test 1|no database|not a database"
    (path.write_bytes if isinstance(content, bytes) else partial(with_statement, path))(content)
    before = path.read_bytes()
    for attempt in (lambda: read_rows(path, KIND), lambda: put_rows(path, KIND, {"b": 2})):
        with pytest.raises(StoreError, match=said):
            attempt()
    assert path.read_bytes() == before


@pytest.mark.parametrize("row", ["'b', NULL", "'c', 'd'", "'e', '{0}'", "'f', x'00'"])
def test_a_file_with_a_row_that_cannot_be_read_is_refused_in_a_sentence(row, tmp_path):
    path = tmp_path / "x.sqlite"
    with_statement(path, f'INSERT INTO "{KIND}" VALUES ({row.format("[" * 100_000)})')
    with pytest.raises(StoreError, match=f"x.sqlite cannot be read as a {KIND}"):
        read_rows(path, KIND)


def test_damaged_pages_are_refused_in_a_sentence_or_read(tmp_path):
    path, whole = tmp_path / "x.sqlite", {f"key{k}": [k / 3] * 10 for k in range(100)}
    put_rows(path, KIND, whole)
    data, rng, said = path.read_bytes(), np.random.default_rng(1), []
    for begin in rng.integers(len(data) - 100, size=20):
        path.write_bytes(data[:begin] + rng.bytes(100) + data[begin + 100 :])
        try:
            said.append(f"{path} {len(read_rows(path, KIND))} rows")
        except StoreError as error:
            said.append(str(error))
    assert all(each.startswith(f"{path} ") for each in said)


def test_a_reader_finishes_what_a_killed_writer_began(tmp_path):
    """A file amid a transaction, with its rollback journal, as kill -9 leaves both."""
    path, left = tmp_path / "x.sqlite", tmp_path / "left.sqlite"
    put_rows(path, KIND, {"a": "x" * 10_000})
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute("PRAGMA cache_size = 1")  # so that pages are written before the end
        connection.execute("BEGIN IMMEDIATE")
        connection.execute(f"""UPDATE "{KIND}" SET value = '{"y" * 100_000}'""")
        left.write_bytes(path.read_bytes())
        journal = (tmp_path / "x.sqlite-journal").read_bytes()
        left.with_name("left.sqlite-journal").write_bytes(journal)
    assert read_rows(left, KIND) == {"a": "x" * 10_000}


def test_a_value_is_computed_once(tmp_path):
    path = tmp_path / "x.sqlite"
    assert cached(path, "key", lambda: (1, 2)) == [1, 2]
    assert cached(path, "key", lambda: pytest.fail("not taken from the file")) == [1, 2]
    assert read_rows(path, CACHE) == {"key": [1, 2]}


def returned(path, value):
    """What a dataset and an attribute give back."""
    with new_file(path) as file:
        mark(file, "test", 1)
        put(file, "value", value, units="1")
        put_attribute(file, "value", value)
    with open_file(path, "test", 1) as file:
        assert attribute(file["value"], "units") == "1"
        return array(file, "value"), attribute(file, "value")


@settings(max_examples=50, deadline=None, derandomize=True, suppress_health_check=FIXTURES)
@given(st.lists(st.text(CHARACTERS, max_size=20), max_size=5))
def test_lists_of_texts_round_trip_but_for_trailing_nuls(tmp_path, values):
    for found in returned(tmp_path / "x.h5", np.array(values, dtype=object)):
        assert found.tolist() == [value.rstrip("\0") for value in values]


@pytest.mark.parametrize("value", [*TEXTS, *NUMBERS])
def test_texts_and_numbers_round_trip_with_their_types(tmp_path, value):
    for found in returned(tmp_path / "x.h5", value):
        np.testing.assert_array_equal(found, value)
        assert np.shape(found) == np.shape(value)
        assert np.asarray(found).dtype.kind == np.asarray(value).dtype.kind


@pytest.mark.parametrize("kind", HDF5_KINDS)
def test_a_damaged_file_is_refused_in_a_sentence_or_read(three_link, kind, tmp_path):
    """Cut, or with one byte in 20 exchanged; HDF5's own checksums cover what describes the data."""
    samples, rng = Samples(tmp_path / "kinds", three_link), np.random.default_rng(1)
    data = samples.write(kind).read_bytes()
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
