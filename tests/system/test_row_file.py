"""Rows by key: kept to the bit, all of a call or none, and nothing that was changed is believed."""

import sqlite3
from contextlib import closing

import pytest

from colloc.system import row_file
from colloc.system.errors import StoreError
from colloc.system.row_file import CACHE, LARGEST_FILE, LARGEST_ROW, cached, put_rows, read_rows

KIND = "colloc test 1"


def test_rows_come_back_as_they_were_in_the_order_in_which_their_keys_came(tmp_path):
    path = tmp_path / "ö new" / "x?#%.sqlite"
    assert read_rows(path, KIND).values == {}
    put_rows(path, KIND, {"b": [1 / 3, -0.0, 1e-300], "a": {"ä": None}})
    put_rows(path, KIND, {"c": 2**60, "b": [2 / 3]})
    assert list(read_rows(path, KIND).values.items()) == [("b", [2 / 3]), ("a", {"ä": None}), ("c", 2**60)]
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def test_a_changed_row_is_left_out_and_counted(tmp_path):
    path = tmp_path / "x.sqlite"
    put_rows(path, KIND, {f"key{k}": {"efficiency": 0.25} for k in range(3)})
    path.write_bytes(path.read_bytes().replace(b"0.25", b"0.26", 1))
    found = read_rows(path, KIND)
    assert (len(found.values), len(found.damaged)) == (2, 1)
    assert all(value == {"efficiency": 0.25} for value in found.values.values())


def forged(path, *statements):
    put_rows(path, KIND, {"a": 1})
    with closing(sqlite3.connect(path)) as connection, connection:
        for statement in statements:
            connection.execute(statement)


@pytest.mark.parametrize(
    "statement",
    [
        f'CREATE TRIGGER t AFTER INSERT ON "{KIND}" BEGIN DELETE FROM "{KIND}"; END',
        "CREATE VIEW v AS WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT x FROM c",
        "CREATE TABLE other (a)",
    ],
)
def test_a_file_with_anything_but_its_one_table_is_refused_by_readers_and_writers(statement, tmp_path):
    path = tmp_path / "x.sqlite"
    forged(path, statement)
    before = path.read_bytes()
    for attempt in (lambda: read_rows(path, KIND), lambda: put_rows(path, KIND, {"b": 2})):
        with pytest.raises(StoreError, match="is not a colloc test 1"):
            attempt()
    assert path.read_bytes() == before


def test_a_file_that_lost_its_table_is_no_empty_one(tmp_path):
    """One changed byte takes it: as many tables as the first page says there are."""
    path = tmp_path / "x.sqlite"
    put_rows(path, KIND, {"a": 1})
    data = bytearray(path.read_bytes())
    data[103:105] = b"\0\0"
    path.write_bytes(data)
    for attempt in (lambda: read_rows(path, KIND), lambda: put_rows(path, KIND, {"b": 2})):
        with pytest.raises(StoreError, match="its table is missing"):
            attempt()
    assert path.read_bytes() == data


def test_rows_of_forged_types_are_left_out(tmp_path):
    path = tmp_path / "x.sqlite"
    forged(path, f"""INSERT INTO "{KIND}" VALUES (NULL, 1, 2), ('b', x'00', NULL), ('c', 'd', 'e')""")
    found = read_rows(path, KIND)
    assert (found.values, len(found.damaged)) == ({"a": 1}, 3)


def test_endless_and_nested_rows_are_met_in_bounded_memory(tmp_path):
    path = tmp_path / "x.sqlite"
    nested = "[" * 100_000
    digest = row_file._sum(b"n", nested.encode()).decode()
    forged(path, f"""INSERT INTO "{KIND}" VALUES ('n', '{digest}', '{nested}')""")
    found = read_rows(path, KIND)
    assert (found.values, len(found.damaged)) == ({"a": 1}, 1)
    forged(path, f"""INSERT INTO "{KIND}" VALUES ('long', '', zeroblob({2 * LARGEST_ROW}))""")
    with pytest.raises(StoreError, match="too big"):
        read_rows(path, KIND)
    with open(tmp_path / "big.sqlite", "wb") as file:
        file.truncate(LARGEST_FILE + 1)
    with pytest.raises(StoreError, match="too large"):
        read_rows(tmp_path / "big.sqlite", KIND)


def test_a_reader_finishes_what_a_killed_writer_began(tmp_path):
    """The file in the middle of a transaction, with its rollback journal, as kill -9 leaves both."""
    path, left = tmp_path / "x.sqlite", tmp_path / "left.sqlite"
    put_rows(path, KIND, {"a": "x" * 10_000})
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        connection.execute("PRAGMA cache_size = 1")  # so that pages are written before the end
        connection.execute("BEGIN IMMEDIATE")
        connection.execute(f"""UPDATE "{KIND}" SET value = '{"y" * 100_000}'""")
        left.write_bytes(path.read_bytes())
        left.with_name("left.sqlite-journal").write_bytes((tmp_path / "x.sqlite-journal").read_bytes())
    assert read_rows(left, KIND).values == {"a": "x" * 10_000}


def test_without_locks_of_the_file_system_files_beside_keep_writers_apart(tmp_path, monkeypatch):
    path = tmp_path / "x.sqlite"
    monkeypatch.setattr(row_file, "_has_locks", lambda folder: False)
    monkeypatch.setattr(row_file, "_PATIENCE", 0.1)
    put_rows(path, KIND, {"a": 1})
    with closing(sqlite3.connect(f"{path.as_uri()}?vfs=unix-dotfile", uri=True, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(StoreError, match="database is locked"):
            put_rows(path, KIND, {"b": 2})
    put_rows(path, KIND, {"b": 2})
    assert read_rows(path, KIND).values == {"a": 1, "b": 2}


def test_a_value_is_computed_once(tmp_path):
    path = tmp_path / "x.sqlite"
    assert cached(path, "key", lambda: (1, 2)) == [1, 2]
    assert cached(path, "key", lambda: pytest.fail("not taken from the file")) == [1, 2]
    assert read_rows(path, CACHE).values == {"key": [1, 2]}
