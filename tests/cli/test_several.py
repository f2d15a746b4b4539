"""`hmpim identify a.csv b.csv …`: repeats, levels, and inputs that are one and the same."""

import html
import json
import re
from pathlib import Path

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


def test_several_records_and_one_sheet_do_not_go_together(tmp_path):
    files = [write(tmp_path / f"{k}.csv", {"u": U, "y": U}) for k in range(2)]
    done = run(*files, "--input", "u", "--output", "y", "--sign", tmp_path / "r.html")
    assert done.exit_code == 2
    assert done.stderr == (
        "hmpim: --sign applies to one record, but 2 are given; leave it out, or give one\n"
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


def test_repeats_have_a_page(tmp_path):
    files = [
        write(
            tmp_path / f"run{k}.csv", {"u": U, "y": output(U, natural=8.0 + 0.5 * (k == 2), seed=k)}
        )
        for k in range(3)
    ]
    page = tmp_path / "r.html"
    done = run(
        *files, "--input", "u", "--output", "y", "-q", "--report", page, "--operator", "M. Ohm"
    )
    assert done.exit_code == 0, done.stderr
    text = page.read_text(encoding="utf-8")
    assert "<dt>Operator</dt><dd>M. Ohm</dd>" in text
    assert 'class="verdict doubtful"' in text  # one run has another natural frequency
    averages, by_run = (cells(text, caption) for caption in ("Averages over", "By run"))
    natural = averages["Natural frequency"]
    assert natural[-1] == "do not agree"
    assert float(natural[5].split(" / ")[0].replace("·10⁴", "e4").replace("·10³", "e3")) > 100.0
    assert averages["Scale factor"][-1] == "agree"
    assert list(by_run) == ["run0.csv", "run1.csv", "run2.csv"]
    assert "8.5" in " ".join(by_run["run2.csv"])
    first = text.index("Bode plot of 3 measured responses")
    assert text.index("−90° bandwidth of each record") < first  # beside two parameters, not above
    drawn = text[first : text.index("</svg>", first)]
    assert all(f"run{k}.csv" in drawn for k in range(3))  # each run's response, by name


def cells(text, caption):
    """Rows of the table with this caption, by what they are called."""
    table = text[text.index(f"<caption><span>{caption}") :]
    rows = re.findall(r"<tr>(.*?)</tr>", table[: table.index("</table>")], re.S)[1:]
    shown = [[html.unescape(c) for c in re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", r)] for r in rows]
    return {row[0]: row[1:] for row in shown}


def test_levels_have_a_page(tmp_path):
    files = [
        write(
            tmp_path / f"{k}.csv",
            {"u": k * U, "y": output(k * U, natural=8.0 + 0.2 * (k - 1), seed=k)},
        )
        for k in (1, 4, 2)
    ]
    page = tmp_path / "l.html"
    done = run(*files, "--input", "u", "--output", "y", "-q", "--report", page)
    assert done.exit_code == 0, done.stderr
    levels = sorted(np.ptp(k * U) / 2 for k in (1, 2, 4))  # pictures are in this order
    named = ", ".join(f"{one:.4g}" for one in levels)
    assert f"Natural frequency at each amplitude: {named}." in page.read_text(encoding="utf-8")
    text = page.read_text(encoding="utf-8")
    assert f"3 levels: not linear above an amplitude of {levels[0]:.4g}." in text
    assert text.index("By amplitude of u") < text.index("<svg")  # the figures, then the pictures
    by_run = cells(text, "By run")  # what was compared is in the other table
    assert list(by_run) == ["1.csv", "2.csv", "4.csv"]
    assert [row[0] for row in by_run.values()] == [f"{one:.4g}" for one in levels]
    assert len(by_run["1.csv"]) == 6  # amplitude, verdict, structure, fit, bias, noise
    shown = cells(text, "By amplitude")["Natural frequency (Hz)"]
    assert [float(cell.split("\u00a0")[0].split(" ")[0]) for cell in shown[:3]] == pytest.approx(
        [8.0, 8.2, 8.6], abs=0.05
    )


def test_several_records_have_a_pdf(tmp_path):
    files = [
        write(tmp_path / f"{k}.csv", {"u": U, "y": output(U, natural=8.0, seed=k)}) for k in (0, 1)
    ]
    done = run(*files, "--report", tmp_path / "r.pdf")
    assert done.exit_code == 0, done.stderr
    assert (tmp_path / "r.pdf").read_bytes().startswith(b"%PDF")
    assert run(*files, "--report", tmp_path / "r.docx").exit_code == 2


def test_levels_are_named_with_their_unit_and_a_doubtful_figure_is_marked(tmp_path):
    pages, data = [], tmp_path / "l.json"
    for bent in (0.0, 0.02):
        records = []
        for k in (1, 2):
            y = output(k * U, natural=8.0, seed=k)
            y = y + bent * np.abs(y) * y * (k == 2)
            records.append(
                hmpim.Record.from_arrays({"u": k * U}, {"y": y}, fs=FS, units={"u": "V", "y": "V"})
            )
        for k, record in enumerate(records):
            hmpim.save(record, tmp_path / f"{k}.h5")
        page = tmp_path / f"{bent}.html"
        done = run(tmp_path / "0.h5", tmp_path / "1.h5", "--report", page, "--json", data)
        assert done.exit_code == 0, done.stderr
        pages.append(page.read_text(encoding="utf-8"))
        assert "Parameter, at amplitude (V)" in " ".join(done.stdout.split())
    (pair,) = json.loads(data.read_text(encoding="utf-8"))["pairs"]
    assert pair["amplitude_unit"] == "V"
    small, large = (f"{np.ptp(k * U) / 2:.4g}" for k in (1, 2))
    assert f"2 levels: linear at all amplitudes, from {small} to {large} V." in pages[0]
    assert 'class="verdict ok"' in pages[0]
    assert "Doubt" not in pages[0]
    assert f"Some figures are doubtful at {large} V." in pages[1]
    assert f"<li>Doubtful at {large} V: " in pages[1]
    assert 'class="verdict doubtful"' in pages[1]
    sure, doubtful = cells(pages[1], "By amplitude")["Scale factor"][:2]
    assert not sure.endswith("?")
    assert doubtful.endswith("\u00a0?")
    assert not doubtful.endswith("? ?")


def test_what_is_refused_names_the_files(tmp_path):
    y = output(U, natural=3.0, seed=1)
    first = write(tmp_path / "a.csv", {"u": U, "y": y})
    for name, columns, words in (
        ("b.csv", {"u": U, "y": y}, "'a.csv' and 'b.csv' hold the same samples"),
        ("c.csv", {"u": U[::-1], "y": y}, r"of 'c.csv' differs from that of 'a.csv' by \d+ %"),
    ):
        done = run(first, write(tmp_path / name, columns))
        assert done.exit_code == 2
        assert re.search(words, done.stderr), done.stderr


def test_a_record_that_cannot_be_used_is_named(tmp_path):
    good = [
        write(tmp_path / f"{k}.csv", {"u": U, "y": output(U, natural=8.0, seed=k)})
        for k in range(2)
    ]
    still = write(tmp_path / "still.csv", {"u": 0.0 * U, "y": output(U, natural=8.0, seed=3)})
    short = tmp_path / "short.csv"
    lines = (tmp_path / "0.csv").read_text().splitlines()
    short.write_text("\n".join(lines[:9]) + "\n")
    louder = write(tmp_path / "louder.csv", {"u": 2 * U, "y": output(2 * U, natural=8.0, seed=1)})
    roles = ("--input", "u", "--output", "y")
    for files, bad in (
        ([*good, still], still),
        ([still, *good], still),
        ([*good, str(short)], str(short)),
        ([good[0], louder, str(short)], str(short)),
    ):
        done = run(*files, *roles)
        assert done.exit_code == 2, done.stdout
        assert repr(Path(bad).name) in done.stderr
        assert "inf" not in done.stderr
        assert done.stderr.count("\n") == 1


def test_records_that_are_not_alike_are_named_by_their_files(tmp_path):
    one = write(tmp_path / "record 1.csv", {"u": U, "y": output(U, natural=8.0, seed=1)})
    other = write(tmp_path / "other.csv", {"u": U[::-1], "y": output(U, natural=8.0, seed=2)})
    done = run(one, other, "--input", "u", "--output", "y")
    assert "input 'u' of 'other.csv' differs from that of 'record 1.csv' by" in done.stderr
    (tmp_path / "day 2").mkdir()
    same = write(tmp_path / "day 2" / "record 1.csv", {"u": U, "y": output(U, natural=8.0, seed=1)})
    done = run(one, same, "--input", "u", "--output", "y")
    assert f"{one!r} and {same!r} hold the same samples" in done.stderr
    done = run(one, one, "--input", "u", "--output", "y", "--together")
    assert f"{one!r} and {one!r} hold the same samples" in done.stderr
