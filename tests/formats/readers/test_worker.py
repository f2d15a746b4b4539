"""The process apart: whatever happens in it becomes one sentence, and the next file is read."""

import os
import threading

import pytest

import unruly
from hmpim.errors import ArgumentError, FormatError, MissingExtraError
from hmpim.formats.readers import Layout
from hmpim.formats.readers.worker import close_worker, pool, shielded

LIMIT = 1.0  # GiB


@pytest.fixture(autouse=True)
def limited(monkeypatch):
    monkeypatch.setenv("HMPIM_READER_MEMORY", str(LIMIT))


@pytest.fixture
def ask(tmp_path):
    reader = shielded(unruly.UNRULY)

    def listed(act):
        path = tmp_path / f"file.{act}"
        path.write_bytes(act.encode())
        return reader.channels(path, Layout())

    return listed


def process(contents):
    return int(contents.channels[1].name)


def test_many_files_are_read_by_one_process_that_is_not_ours(ask, tmp_path):
    seen = {process(ask("-")) for _ in range(20)}
    assert len(seen) == 1
    assert seen != {os.getpid()}


def test_what_was_read_comes_back_whole(ask, tmp_path):
    contents = ask("-")
    assert (contents.band, contents.inputs, contents.channels[0].unit) == ((0.1, 20.0), ("u",), "V")
    u, y = shielded(unruly.UNRULY).read(tmp_path / "file.-", ["u", "y"], Layout())
    assert u.time is y.time
    assert u.time.tolist() == [0, 1, 2, 3]
    assert y.findings[0].message == "Cut."


@pytest.mark.parametrize(
    ("act", "error", "words"),
    [
        ("c", FormatError, r"'file\.c' cannot be read as unruly: the reader crashed \(SIGSEGV\)"),
        ("l", FormatError, "ended by itself with code 3"),
        ("m", FormatError, r"needs more than the 1 GiB.*HMPIM_READER_MEMORY"),
        ("r", FormatError, "^it is of last year$"),
        ("e", MissingExtraError, r"pip install 'hmpim\[none\]'"),
        ("b", FormatError, r"is damaged, or not the unruly file it starts as \(KeyError: 'a\\nb'"),
        ("q", FormatError, "SystemExit"),
        ("p", FormatError, "PermissionError: a reader may not do subprocess.Popen"),
        ("n", FormatError, "a reader may not do socket.getaddrinfo"),
        ("w", FormatError, "a reader may not write"),
        ("k", FormatError, "a reader may not do pickle.find_class"),
    ],
)
def test_what_goes_wrong_there_is_one_sentence_here(ask, tmp_path, act, error, words):
    ask("-")
    with pytest.raises(error, match=words) as caught:
        ask(act)
    assert "\n" not in str(caught.value)
    assert ask("-").format == "unruly"  # and the next file is read
    assert not (tmp_path / "file.new").exists()


def test_memory_stays_below_the_limit(ask):
    ask("-")
    with pytest.raises(FormatError, match="needs more than"):
        ask("m")
    # The one that was asked again died, so look at how far another gets before it gives up.
    ask("-")
    assert 0 < pool._STATE["worker"].peak < LIMIT * 2**30


def test_a_dead_worker_is_replaced_and_a_living_one_kept(ask):
    first = process(ask("-"))
    with pytest.raises(FormatError, match="last year"):
        ask("r")
    assert process(ask("-")) == first
    with pytest.raises(FormatError, match="crashed"):
        ask("c")
    assert process(ask("-")) != first


def test_an_earlier_file_is_not_held_against_a_later_one(ask):
    """A worker that died in between, killed from outside, is no fault of the file."""
    first = process(ask("-"))
    os.kill(first, 9)
    assert process(ask("-")) != first


def test_what_a_library_prints_does_not_garble_the_answer(ask):
    assert ask("t").channels[0].name == "u"


def test_a_file_that_takes_for_ever_is_given_up(ask, monkeypatch):
    monkeypatch.setenv("HMPIM_READER_TIME", "0.2")
    with pytest.raises(FormatError, match=r"not done after .* s.*HMPIM_READER_TIME"):
        ask("h")
    monkeypatch.delenv("HMPIM_READER_TIME")
    assert ask("-").format == "unruly"


def test_several_threads_take_turns(ask):
    found = []
    threads = [threading.Thread(target=lambda: found.append(process(ask("-")))) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 8
    assert len(set(found)) == 1


@pytest.mark.parametrize("text", ["much", "-1", "0", "nan"])
def test_a_limit_that_is_none_is_refused(ask, monkeypatch, text):
    monkeypatch.setenv("HMPIM_READER_MEMORY", text)
    with pytest.raises(ArgumentError, match=r"HMPIM_READER_MEMORY=.* is not a positive number"):
        ask("-")


def test_closing_twice_is_harmless(ask):
    first = process(ask("-"))
    close_worker()
    close_worker()
    assert process(ask("-")) != first
