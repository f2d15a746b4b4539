"""`hmpim identify a.csv b.csv …`: repeats, levels, and inputs that are one and the same."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import hmpim
from hmpim.cli.main import app
from hmpim.identify import same_at_levels

RUNNER = CliRunner()
FS = 100.0
TIME = np.arange(1000) / FS
U = np.sin(2 * np.pi * (0.1 * TIME + 0.9 * TIME**2))


def write(path, columns):
    names, values = list(columns), np.column_stack([TIME, *columns.values()])
    head = ",".join(["time", *names])
    np.savetxt(path, values, delimiter=",", header=head, comments="", fmt="%.9g")
    return str(path)


def output(u, *, natural, seed):
    w = 2 * np.pi * natural
    model = hmpim.Model(delay=0.03, scale_factor=2.0, denominator=(1 / w**2, 0.8 / w, 1.0))
    noise = 0.02 * np.random.default_rng(seed).standard_normal(u.size)
    return hmpim.simulate(model, u, fs=FS, intersample="bandlimited") + noise


def run(*arguments):
    return RUNNER.invoke(app, ["identify", *map(str, arguments)])


def test_repeats_are_averaged_and_their_error_bars_tested(tmp_path):
    files = [
        write(tmp_path / f"{k}.csv", {"u": U, "y": output(U, natural=8.0, seed=k)})
        for k in range(3)
    ]
    target = tmp_path / "r.json"
    done = run(*files, "--input", "u", "--output", "y", "--json", target)
    assert done.exit_code == 0, done.stderr
    assert "3 records of one stimulus" in done.stdout
    assert "Repeatability" in done.stdout
    data = json.loads(target.read_text(encoding="utf-8"))
    assert data["schema"] == "hmpim/repeats/1"
    assert len(data["results"]) == 3
    natural = data["pairs"][0]["parameters"]["natural_frequency"]
    single = data["results"][0]["pairs"][0]["parameters"]["natural_frequency"]["std"]
    assert natural["mean"]["std"] == pytest.approx(single / np.sqrt(3), rel=0.2)
    assert abs(natural["mean"]["value"] - 8.0) < 4 * natural["mean"]["std"]
    assert natural["agree"] is True


def test_one_file_twice_is_not_two_repeats(tmp_path):
    one = write(tmp_path / "one.csv", {"u": U, "y": output(U, natural=8.0, seed=1)})
    copy = tmp_path / "copy.csv"
    copy.write_bytes((tmp_path / "one.csv").read_bytes())
    for other in (one, copy):
        done = run(one, other)
        assert done.exit_code == 2
        assert "hold the same samples; one record given twice is not two repeats" in done.stderr
        assert done.stdout == ""


def test_levels_say_where_the_unit_is_linear(tmp_path):
    files = [
        write(
            tmp_path / f"{k}.csv",
            {"u": k * U, "y": output(k * U, natural=8.0 + 0.2 * (k - 1), seed=k)},
        )
        for k in (1, 2, 4)
    ]
    target = tmp_path / "l.json"
    done = run(*files, "--input", "u", "--output", "y", "--json", target)
    assert done.exit_code == 0, done.stderr
    assert "at several levels" in done.stdout
    data = json.loads(target.read_text(encoding="utf-8"))
    assert data["schema"] == "hmpim/levels/1"
    trends = {trend["name"]: trend for trend in data["pairs"][0]["trends"]}
    assert trends["natural_frequency"]["change"] == pytest.approx(0.6 / 8.0, rel=0.1)
    assert abs(trends["scale_factor"]["change"]) < 0.01
    assert "hardening" in [warning["code"] for warning in data["pairs"][0]["warnings"]]


def test_several_records_and_one_page_do_not_go_together(tmp_path):
    files = [write(tmp_path / f"{k}.csv", {"u": U, "y": U}) for k in range(2)]
    done = run(*files, "--input", "u", "--output", "y", "--report", tmp_path / "r.html")
    assert done.exit_code == 2
    assert done.stderr == (
        "hmpim: --report is about one record, and 2 are given; leave it out, or give one\n"
    )


@pytest.mark.parametrize(
    ("made", "named"),
    [
        (lambda a, b: {"left": a, "right": -3 * a, "other": b}, "left, right"),
        (lambda a, b: {"one": a, "two": b, "three": a - 2 * b}, "one, two, three"),
    ],
)
def test_inputs_that_are_one_are_refused_in_one_line(tmp_path, made, named):
    inputs = made(U, U[::-1].copy())
    path = write(tmp_path / "r.csv", {**inputs, "y": output(U, natural=8.0, seed=0)})
    chosen = [part for name in inputs for part in ("--input", name)]
    done = run(path, *chosen, "--output", "y")
    assert done.exit_code == 2
    assert done.stderr.startswith(f"hmpim: inputs {named} cannot be distinguished: over 100 %")
    assert done.stderr.count("\n") == 1


def test_levels_and_repeats_are_told_apart():
    def record(u):
        return hmpim.Record.from_arrays({"u": u}, {"y": U}, fs=FS)

    assert same_at_levels([record(U), record(1.5 * U)])
    assert not same_at_levels([record(U), record(1.01 * U)])
    assert not same_at_levels([record(U), record(U[::-1].copy())])
    assert not same_at_levels([record(U), record(-2 * U)])
