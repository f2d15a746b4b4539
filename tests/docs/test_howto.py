"""Each how-to about a log is followed, command by command, and finds the truth."""

import pytest

import howto_files
from docs_following import NUMBER, blocks_of, follow

TRUTH = {
    "Delay, pure": howto_files.DELAY,
    "Natural frequency": howto_files.NATURAL_FREQUENCY,
}


@pytest.mark.parametrize("name", howto_files.FILES)
def test_a_how_to_does_what_it_prints(name, tmp_path, monkeypatch):
    howto_files.FILES[name](tmp_path)
    monkeypatch.chdir(tmp_path)
    page = f"howto/{name}.md"
    assert {block.kind for block in blocks_of(page)} == {"console"}
    follow(page)
    for line in "".join(block.text for block in blocks_of(page)).splitlines():
        for words, truth in TRUTH.items():
            if line.startswith(words):
                figure = next(float(w) for w in line.split() if NUMBER.match(w))
                assert figure == pytest.approx(truth, rel=5e-3)
