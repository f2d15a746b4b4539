"""Every block of every document is executed, or stands here with the reason why it is not."""

import ast
import re
import tomllib
from functools import cache

import pytest

import howto_files
from docs_following import DOCS, FOLLOWED, ROOT, blocks_of

PAGES = [
    "README.md",
    "CONTRIBUTING.md",
    *sorted(
        path.relative_to(DOCS).as_posix()
        for path in DOCS.rglob("*.md")
        if "build" not in path.parts
    ),
]
FOLLOWED_WHOLE = {*FOLLOWED, *(f"howto/{name}.md" for name in howto_files.FILES)}
NOT_EXECUTED = {
    ("README.md", "make demo"): "`make test` runs this very test; what `make demo` runs is tested "
    "in tests/cli/test_demo.py, tests/campaign and tests/test_installed.py",
    ("tutorial.md", "python3 -m venv"): "needs an index of packages; tests/test_installed.py "
    "runs what is installed",
    ("platforms.md", "python3 -m pip wheel"): "needs an index of packages; tests/test_installed.py "
    "builds the wheel and runs it away from the clone",
    ("architecture.md", "Limits ─►"): "a drawing",
    (
        "architecture.md",
        "cli | workbench",
    ): "held against pyproject.toml by tests/docs/test_site.py",
    ("architecture.md", "records | uses"): "held against pyproject.toml by tests/docs/test_site.py",
    ("method.md", "if not question.moves"): "a function's body, held against the code line for "
    "line by tests/docs/test_method_doc.py",
    ("method.md", 'if intersample == "sampled"'): "a function's body, held against the code line "
    "for line by tests/docs/test_method_doc.py",
    ("method.md", "fitted = fitted or continue_between"): "a function's body, held against the "
    "code line for line by tests/docs/test_method_doc.py",
    ("table.md", "world ──"): "a drawing",
}
"""Page, how the block begins, and why no test executes it."""
INSTALLERS = re.compile(
    r"\b(?:apt(?:-get)?|npm|brew|conda|pipx?|uv) (?:pip )?(?:install|wheel|add)\b"
)
OURS = re.compile(r"pip install ['\"]?hmpim\[([\w,]+)\]")


@cache
def asked():
    """Blocks that tests ask for: page and beginning; None for all that prints."""
    found = []
    for file in sorted((ROOT / "tests").rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        if "docs_following" not in text:
            continue
        for node in ast.walk(ast.parse(text)):
            name = getattr(node.func, "id", "") if isinstance(node, ast.Call) else ""
            if name in ("snippet", "printing"):
                words = [each.value for each in node.args if isinstance(each, ast.Constant)]
                assert len(words) == len(node.args), f"{file}: {name} is asked for by plain words"
                found.append((words[0], words[1] if name == "snippet" else None))
    return found


def executed(page, block):
    if page in FOLLOWED_WHOLE and block.followed:
        return True
    return any(
        page == wanted
        and (block.kind in ("python", "text") if words is None else block.text.startswith(words))
        for wanted, words in asked()
    )


@pytest.mark.parametrize("page", PAGES)
def test_a_page_shows_nothing_that_is_not_executed(page):
    excused = [beginning for other, beginning in NOT_EXECUTED if other == page]
    for block in blocks_of(page):
        reasons = [words for words in excused if block.text.startswith(words)]
        first = block.text.splitlines()[0]
        assert executed(page, block) != bool(reasons), (
            f"{page}, {first!r}: follow the page (docs_following.FOLLOWED), ask for the block in a "
            "test (docs_following.snippet), or state in NOT_EXECUTED why none executes it"
        )


def test_what_is_not_executed_is_there_and_said():
    for (page, beginning), why in NOT_EXECUTED.items():
        print(f"{page}: {beginning!r}: {why}")
        assert sum(block.text.startswith(beginning) for block in blocks_of(page)) == 1, beginning
        for place in re.findall(r"tests/[\w/.]+\w", why):
            assert (ROOT / place).exists(), place


def test_the_pages_were_read():
    assert sum(len(blocks_of(page)) for page in PAGES) > 80
    assert len(asked()) > 25
    for page, words in asked():
        assert any(words is None or b.text.startswith(words) for b in blocks_of(page)), words


def test_what_is_to_be_installed_is_an_extra():
    """Anything else that a page installs needs an index of packages: it stands in NOT_EXECUTED."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras, seen = set(project["optional-dependencies"]), 0
    sources = [path.read_text(encoding="utf-8") for path in (ROOT / "src").rglob("*.py")]
    texts = [(DOCS / page if page not in ("README.md", "CONTRIBUTING.md") else ROOT / page)
             .read_text(encoding="utf-8") for page in PAGES]  # fmt: skip
    for text in (*sources, *texts):
        for names in OURS.findall(text):
            seen += 1
            assert set(names.split(",")) <= extras, names
    assert seen > 15
    for page, text in zip(PAGES, texts, strict=True):
        for other, beginning in NOT_EXECUTED:
            if other == page:
                (block,) = [b for b in blocks_of(page) if b.text.startswith(beginning)]
                text = text.replace(block.text, "")
        others = [line for line in OURS.sub("", text).splitlines() if INSTALLERS.search(line)]
        assert not others, (page, others)
