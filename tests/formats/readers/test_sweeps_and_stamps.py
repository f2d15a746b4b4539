"""Several sweeps in one log, and clocks of two kinds: each taken for what it is."""

import numpy as np
import pytest

import hmpim
import sample_logs
from hmpim.errors import RecordError
from hmpim.formats import read
from hmpim.formats.files import read_sweeps
from hmpim.formats.options import ReadOptions

FS = 100.0
DELAY = 0.0371
T = np.arange(800) / FS
BOUND = 0.01 / FS  # 1 % of a sample


def sweep(start, stop):
    """A sweep between two rests, and the same, late: each known at any time."""

    def at(t):
        inside = np.clip(t - 1.0, 0.0, 6.0)
        phase = 2 * np.pi * (start * inside + (stop - start) * inside**2 / 12.0)
        return np.sin(phase) * np.sin(np.pi * inside / 6.0) ** 2

    return at(T), at(T - DELAY)


def delay_of(record):
    """Delay in s by the slope of the phase of the cross-spectrum, where there is power."""
    u, y = (np.fft.rfft(c.values) for c in (record.inputs[0], record.outputs[0]))
    omega = 2 * np.pi * np.fft.rfftfreq(record.inputs[0].values.size, 1 / record.fs)
    cross, weight = y * np.conj(u), np.abs(u) ** 4 * (omega < 2 * np.pi * 12)
    phase = np.unwrap(np.angle(cross))
    return float(-np.sum(weight * omega * phase) / np.sum(weight * omega**2))


EPISODES = [sweep(0.3, 6.0), sweep(0.5, 8.0), sweep(0.3, 6.0)]
JOINT = {"inputs": ["action[pan]"], "outputs": ["observation.state[pan]"]}


def test_each_episode_of_a_lerobot_file_is_a_record_of_its_own(tmp_path):
    path = tmp_path / "file-000.parquet"
    sample_logs.lerobot(path, EPISODES, fs=FS)
    with pytest.raises(RecordError, match=r"time starts again.*holds 3 recordings.*--sweep all"):
        read(path, **JOINT)
    records = read_sweeps(path, **JOINT)
    assert len(records) == 3
    for record, (u, _) in zip(records, EPISODES, strict=True):
        place = round(record.inputs[0].time[0] * FS)
        same = u[place : place + record.inputs[0].values.size]
        assert record.inputs[0].values == pytest.approx(same, abs=1e-6)  # float32
        assert record.fs == pytest.approx(FS)
        assert delay_of(record) == pytest.approx(DELAY, abs=BOUND)
    second = read(path, **JOINT, options=ReadOptions(sweep=2))
    assert second.inputs[0].values == pytest.approx(records[1].inputs[0].values, abs=0.02)


def test_sweeps_of_one_clock_are_told_apart(tmp_path):
    """One episode in which the arm sweeps three times: said when read whole, cut on demand."""
    path = tmp_path / "file-000.parquet"
    whole = tuple(np.concatenate([episode[k] for episode in EPISODES]) for k in (0, 1))
    sample_logs.lerobot(path, [whole], fs=FS)
    record = read(path, **JOINT)
    (said,) = [f.message for f in record.findings if f.code == "several_sweeps"]
    assert "3 motions" in said
    records = read_sweeps(path, **JOINT)
    assert [delay_of(record) for record in records] == pytest.approx([DELAY] * 3, abs=BOUND)


BAG = {"outputs": ["/joint_states.position[pan]"]}


def bag(folder, *, stamped):
    """The sensor is stamped when it measures and logged 4 ms later, as the command is at once."""
    path = folder / "bag"
    noise = 0.002 * np.random.default_rng(3).standard_normal(T.size)
    u, y = sweep(0.3, 12.0)
    sample_logs.ros(path, drive_and_answer=(u, y + noise), fs=FS, stamped=stamped)
    return path


def test_stamps_of_two_kinds_make_the_delay_doubtful(tmp_path):
    path = bag(tmp_path, stamped=False)
    record = read(path, inputs=["/cmd.x"], **BAG)
    (said,) = [f for f in record.findings if f.code == "mixed_stamps"]
    assert "/joint_states has its sender's stamps and /cmd only the log's" in said.message
    result = hmpim.identify(record)["/joint_states.position[pan]", "/cmd.x"]
    assert result.delay.verdict == "doubtful"
    assert any(w.code == "mixed_stamps" for w in result.warnings)


def test_stamps_of_one_kind_do_not(tmp_path):
    """The log's for all: the delay holds the 4 ms of transport, and no doubt is left."""
    path = bag(tmp_path, stamped=False)
    record = read(path, inputs=["/cmd.x"], **BAG, options=ReadOptions(stamps="log"))
    assert not [f for f in record.findings if f.code == "mixed_stamps"]
    found = hmpim.identify(record)["/joint_states.position[pan]", "/cmd.x"].delay
    assert found.verdict == "ok"
    assert found.value == pytest.approx(DELAY + 0.004, abs=5 * found.std)
    assert found.std < 1e-3


def test_the_sender_s_for_all_needs_no_word(tmp_path):
    record = read(bag(tmp_path, stamped=True), inputs=["/cmd.vector.x"], **BAG)
    assert not [f for f in record.findings if f.code == "mixed_stamps"]
    assert delay_of(record) == pytest.approx(DELAY, abs=10 * BOUND)
