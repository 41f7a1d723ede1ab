"""Folders of code that is run: closed to everybody but their user and the superuser."""

import os

import pytest

from colloc.numerics.c_compiler import is_private, make_private, trespass
from colloc.system.errors import StoreError

pytestmark = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="POSIX permissions")


@pytest.mark.parametrize(
    ("mode", "private"),
    [(0o700, True), (0o755, True), (0o500, True), (0o720, False), (0o702, False), (0o770, False), (0o777, False)],
)
def test_neither_the_group_nor_others_may_be_able_to_write(mode, private, tmp_path):
    folder = tmp_path / "code"
    make_private(folder)
    assert folder.stat().st_mode & 0o777 == 0o700
    file = folder / "x.so"
    file.touch(mode=0o600)
    for made in (folder, file):
        made.chmod(mode)
        assert (trespass(made) == "") == private
        assert is_private(file) == private
        made.chmod(0o700)
    folder.chmod(mode)
    if private:
        make_private(folder)
    else:
        with pytest.raises(StoreError, match="it can be written by others: chmod go-w it"):
            make_private(folder)


@pytest.mark.skipif(getattr(os, "geteuid", lambda: 1)() != 0, reason="only the superuser can give files away")
def test_what_belongs_to_another_user_is_not_trusted_nor_a_link_of_theirs(tmp_path):
    theirs, link = tmp_path / "theirs", tmp_path / "link"
    theirs.mkdir(mode=0o700)
    link.symlink_to(theirs)
    assert trespass(link) == ""
    os.chown(link, 12345, 12345, follow_symlinks=False)
    assert trespass(link) == "belongs to another user"
    os.chown(theirs, 12345, 12345)
    assert trespass(theirs) == "belongs to another user"
