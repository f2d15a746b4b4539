"""`hmpim channels`: the table, the page, the JSON, and how it refuses."""

import json
import re

import numpy as np
import pytest
from typer.testing import CliRunner

from hmpim.cli.main import app

RUNNER = CliRunner()


def run(*arguments):
    return RUNNER.invoke(app, [str(a) for a in arguments])


@pytest.fixture
def log(tmp_path):
    t = np.arange(0, 12, 0.005)
    u = np.sin(2 * np.pi * (0.2 * t + 0.5 * t**2))
    late = np.maximum(t - 0.05, 0.0)
    y = np.sin(2 * np.pi * (0.2 * late + 0.5 * late**2))
    rows = [
        f"{a:.3f},{b:.6f},{'' if 400 <= k < 500 else f'{c:.6f}'},{k},on\n"
        for k, (a, b, c) in enumerate(zip(t, u, y, strict=True))
    ]
    path = tmp_path / "log.csv"
    path.write_text("time,cmd [deg],gyro [deg/s],n <&>,state\n" + "".join(rows))
    return path


def test_table_and_proposal(log):
    done = run("channels", log)
    assert done.exit_code == 0, done.stderr
    text = done.stdout
    assert re.search(r"cmd +deg +200 Hz +0 to 11\.995 s +2400 +–", text)
    assert re.search(r"gyro +deg/s +200 Hz .* 1 \(to 0\.505 s\)", text)
    assert re.search("[\u2801-\u28ff]{10}", text)  # a picture
    assert "gyro: 100 of 2400 samples missing." in text
    assert "Holds words, no numbers: state." in text
    assert "No unit is stated for n <&>: say it with --unit NAME=UNIT" in text
    assert "Proposal: 'cmd' in, 'gyro' out." in text
    assert "'gyro': follows 'cmd' by 0.05 s" in text
    assert f"Try: hmpim identify {log} --input cmd --output gyro" in text


def test_what_is_proposed_works(log):
    command = re.search(r"Try: hmpim (.*)", run("channels", log).stdout)[1].split()
    done = run(*command, "--intersample", "bandlimited", "--json", log.with_suffix(".json"))
    assert done.exit_code == 0, done.stderr
    (pair,) = json.loads(log.with_suffix(".json").read_text())["pairs"]
    assert pair["parameters"]["delay"]["value"] == pytest.approx(0.05, abs=1e-4)
    codes = [w["code"] for w in pair["warnings"]]
    assert "missing_samples" in codes


def test_page_and_json(log, tmp_path):
    page, data = tmp_path / "c.html", tmp_path / "c.json"
    done = run("channels", log, "--report", page, "--json", data, "--quiet")
    assert (done.exit_code, done.stdout) == (0, "")
    html = page.read_text()
    assert html.count("<svg") == 2 * 3  # of each, one for a phone
    assert "http" not in html
    assert "n &lt;&amp;&gt;" in html
    assert "n <&>" not in html
    found = json.loads(data.read_text())
    assert found["schema"] == "hmpim/channels/1"
    assert [c["name"] for c in found["channels"]] == ["cmd", "gyro", "n <&>"]
    assert found["channels"][1]["missing"] == 100
    assert found["channels"][1]["longest_gap"] == pytest.approx(0.505)
    assert found["proposal"]["inputs"] == ["cmd"]
    assert found["motions"][0]["kind"] == "sweep"


def test_a_file_without_time_is_listed_and_says_what_it_needs(tmp_path):
    path = tmp_path / "a.txt"
    rows = "".join(f"{k % 7} {(k * k) % 11}\n" for k in range(60))
    path.write_text("a b\n" + rows)
    done = run("channels", path)
    assert done.exit_code == 0
    assert "no time" in done.stdout
    assert "yet: no time is known; name it with --time, or give the rate with --fs" in " ".join(
        done.stdout.split()
    )
    done = run("channels", path, "--fs", 10)
    assert re.search(r"a +– +10 Hz +0 to 5\.9 s", done.stdout)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "there is no file|does not exist|No such file"),
        (b"", "is empty"),
        (b"\x7fELF" + bytes(100), "no reader recognises"),
        (b"a,b\nx,y\nz,w\n", "no rows of numbers"),
    ],
)
def test_bad_files_are_refused_in_one_line(tmp_path, content, words):
    path = tmp_path / "a.csv"
    if content is not None:
        path.write_bytes(content)
    done = run("channels", path)
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert re.search(words, done.stderr), done.stderr


def test_a_page_over_the_record_is_refused(log):
    done = run("channels", log, "--report", log)
    assert done.exit_code == 2
    assert log.read_text().startswith("time,cmd")


def test_complex_numbers_are_no_words(log, tmp_path):
    rows = [row.split(",") for row in log.read_text().splitlines()[1:]]
    path = tmp_path / "complex.csv"
    lines = [f"{t},{u},{u}{float(u):+.6f}i\n" for t, u, *_ in rows]
    path.write_text("time,u,z\n" + "".join(lines))
    done = run("channels", path, "--json", tmp_path / "c.json")
    said = " ".join(done.stdout.split())
    assert "Holds complex numbers: z; save the real part, or the magnitude." in said
    assert "words" not in said
    assert list(json.loads((tmp_path / "c.json").read_text())["unread"]) == ["z"]
    done = run("identify", path, "--input", "u", "--output", "z")
    assert done.exit_code == 2
    assert "i': complex numbers; save the real part" in done.stderr
    path.write_text("time,z\n" + "".join(f"{t},({u}+1j)\n" for t, u, *_ in rows))
    done = run("channels", path)
    assert (done.exit_code, done.stdout) == (2, "")
    assert "no channel of numbers: 'z' holds complex numbers" in done.stderr


def test_rows_whose_newest_sample_comes_first_are_said_to_run_backward(log):
    head, *rows = log.read_text().splitlines(keepends=True)
    log.write_text("".join([head, *rows[::-1]]))
    done = run("channels", log)
    said = " ".join(done.stdout.split())
    assert re.search(r"cmd +deg +200 Hz +0 to 11\.995 s", done.stdout)
    assert (
        "cmd, n <&>: cannot be used yet: time runs backward from the first sample (11.995 s) to "
        "the last (0 s); sort the rows by time."
    ) in said
    assert "starts again" not in said
    assert "No channel can be used as it is, so no input and output are proposed." in said
    done = run("identify", log, "--input", "cmd", "--output", "gyro")
    assert done.exit_code == 2
    assert "runs backward from the first sample (11.995 s) to the last (0 s)" in done.stderr


def test_a_file_of_two_recordings_says_how_one_is_taken(tmp_path):
    path = tmp_path / "two.csv"
    rows = "".join(f"{k / 100},{k % 7},{k % 5}\n" for k in range(200))
    path.write_text("time,u,y\n" + rows + rows)
    said = " ".join(run("channels", path).stdout.split())
    assert (
        "u, y: time starts again, so that there are 2 recordings; take one with --sweep N" in said
    )
    assert "Time starts again, so no input and output are proposed" in said
