"""What several rooms' tests share: the measured records, the paper's system, closed forms."""

import gc
import os
import signal
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

import collecting
from tests_support import examples, field_chirp, second_order_lag, study_size

# A busy machine is slow; that is no failure of what is tested. In `make test` the examples are
# the same every time; new ones are for `make studies` to find, and many more of them.
settings.register_profile(
    "hmpim",
    examples(25),
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    derandomize="HMPIM_EXAMPLES" not in os.environ,
)
settings.load_profile("hmpim")

# A shell that starts a job in the background has it ignore Ctrl-C, and all that it starts with it.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

gc.disable()  # until tests are collected: nothing of what is imported is garbage


def pytest_configure(config):
    config.pluginmanager.register(collecting)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers():
    """Three processes for two cores: a fifth of the time, tests wait for a process or a clock."""
    cores = os.cpu_count() or 1
    return cores + cores // 2


DATA = Path(__file__).parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def measured():
    """Folder of measured records; the test is skipped where it is absent."""
    if not DATA.is_dir():
        pytest.skip(
            f"measured records are not here: no folder ../shared/data beside {DATA.parents[1].name}"
        )
    return DATA


@pytest.fixture(params=["few", pytest.param("many", marks=pytest.mark.study)])
def seeds(request) -> int:
    """How many seeds a study takes: few in `make test`, HMPIM_SEEDS (200) in `make studies`.

    Few are 20 unless the test says otherwise: `@pytest.mark.few(50)`.
    """
    if request.param == "many":
        return study_size(200)
    few = request.node.get_closest_marker("few")
    return few.args[0] if few else 20


@pytest.fixture(scope="session")
def field_record():
    """Time, input and noise-free output of the record every tool is compared on.

    Second order 10 Hz, ζ 0.4, delay 150 ms, bias 0.6, 10 s at 200 Hz.
    """
    time = np.arange(2000) / 200.0
    y = second_order_lag(time, field_chirp, delay=0.15, natural_frequency=10.0, damping_ratio=0.4)
    return time, field_chirp(time), y + 0.6


@pytest.fixture(autouse=True)
def breaking_checks(monkeypatch):
    """A check that raises fails the test; within ``with breaking_checks():`` it is only said."""
    from hmpim.identify.judgement import checks as attempts

    said = attempts.failed

    def raised(name, error):
        raise error

    monkeypatch.setattr(attempts, "failed", raised)

    @contextmanager
    def allowed():
        with monkeypatch.context() as patch:
            patch.setattr(attempts, "failed", said)
            yield

    return allowed
