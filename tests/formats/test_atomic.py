import errno
import os
from pathlib import Path

import pytest

from hmpim.errors import ArgumentError
from hmpim.formats.atomic import check_writable, replacing, write_text


def test_all_went_well(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with replacing(path) as place:
        place.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_a_failure_leaves_what_was_there(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")

    def stopped_half_way():
        with replacing(path) as place:
            place.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stopped_half_way()
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "real.txt").write_text("old")
    (tmp_path / "link.txt").symlink_to(tmp_path / "real.txt")
    with replacing(tmp_path / "link.txt") as place:
        place.write_text("new")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "real.txt").read_text() == "new"


def test_the_file_has_the_usual_permissions(tmp_path):
    with replacing(tmp_path / "a.txt") as place:
        place.write_text("new")
    (tmp_path / "b.txt").write_text("new")
    assert (tmp_path / "a.txt").stat().st_mode == (tmp_path / "b.txt").stat().st_mode


def test_what_is_no_plain_file_is_written_to_as_it_is():
    with replacing("/dev/null") as place:
        place.write_text("gone")
    assert not os.path.isfile("/dev/null")


def test_a_missing_folder_and_a_folder_are_refused(tmp_path):
    with (
        pytest.raises(ArgumentError, match="does not exist; make it first"),
        replacing(tmp_path / "no" / "a.txt"),
    ):
        pass
    with pytest.raises(ArgumentError, match="is a folder"), replacing(tmp_path):
        pass


def test_rights_of_the_file_replaced_stay(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    path.chmod(0o640)
    write_text(path, "new")
    assert path.stat().st_mode & 0o777 == 0o640


def test_a_full_disk_leaves_what_was_there(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")

    def full():
        with replacing(path):
            raise OSError(28, "No space left on device")

    with pytest.raises(ArgumentError, match="cannot be written: No space left on device"):
        full()
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_what_cannot_be_written_is_refused_up_front(tmp_path, monkeypatch):
    check_writable(tmp_path / "run.h5", size=1000)
    assert os.listdir(tmp_path) == []
    with pytest.raises(ArgumentError, match="does not exist; make it first"):
        check_writable(tmp_path / "no" / "run.h5")
    with pytest.raises(ArgumentError, match="is a folder; name a file in it"):
        check_writable(tmp_path)
    with pytest.raises(ArgumentError, match=r"needs 1e\+12 MB, but its disk has .* make room"):
        check_writable(tmp_path / "run.h5", size=10**18)
    with pytest.raises(ArgumentError, match="cannot be written"):
        check_writable("/proc/run.h5")
    with pytest.raises(ArgumentError, match="cannot be written"):
        check_writable(tmp_path / ("x" * 300))


def test_a_disk_that_is_read_only_is_said_of_the_file_that_was_named(tmp_path, monkeypatch):
    def refused(*_, **__):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), "probe")

    monkeypatch.setattr(os, "open", refused)
    monkeypatch.setattr(Path, "unlink", refused)
    with pytest.raises(ArgumentError, match=r"run\.h5' cannot be written: Read-only file system"):
        check_writable(tmp_path / "run.h5")
