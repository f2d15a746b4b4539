"""What Tab offers: commands, options, and the rigs that a person described."""

import os
import shutil
import subprocess
import sys

import pytest

from hmpim.cli.main import app

RIGS = '[rigs.bench7]\nrig = "sensor"\n\n[rigs.bench9]\nrig = "table"\n'


def offered(words, monkeypatch, capsys):
    """What the shell is told when Tab is pressed at the end of the last word."""
    monkeypatch.setenv("_HMPIM_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", " ".join(words))
    monkeypatch.setenv("COMP_CWORD", str(len(words) - 1))
    with pytest.raises(SystemExit) as ended:
        app(prog_name="hmpim")
    assert ended.value.code in (0, None)
    return capsys.readouterr().out.split()


def test_tab_completes_commands_and_options(monkeypatch, capsys):
    assert offered(["hmpim", "ide"], monkeypatch, capsys) == ["identify"]
    options = offered(["hmpim", "run", "s.csv", "--ri"], monkeypatch, capsys)
    assert options == ["--rig", "--rig-file"]


def test_zsh_is_told_commands_with_their_help(monkeypatch, capsys):
    monkeypatch.setenv("_HMPIM_COMPLETE", "complete_zsh")
    monkeypatch.setenv("_TYPER_COMPLETE_ARGS", "hmpim ide")
    with pytest.raises(SystemExit) as ended:
        app(prog_name="hmpim")
    assert ended.value.code in (0, None)
    told = capsys.readouterr().out
    assert told.startswith('_arguments \'*: :(("identify"')
    assert "campaign" not in told


@pytest.mark.parametrize("command", [["run", "s.csv"], ["workbench"]])
def test_tab_completes_rigs(command, tmp_path, monkeypatch, capsys):
    (tmp_path / "hmpim.toml").write_text(RIGS)
    monkeypatch.chdir(tmp_path)
    line = ["hmpim", *command, "--rig"]
    assert offered([*line, "ben"], monkeypatch, capsys) == ["bench7", "bench9"]
    assert offered([*line, "tab"], monkeypatch, capsys) == ["table"]


def test_a_broken_file_of_rigs_says_nothing_to_the_shell(tmp_path, monkeypatch, capsys):
    (tmp_path / "hmpim.toml").write_text("[rigs.bench7")
    monkeypatch.chdir(tmp_path)
    assert offered(["hmpim", "run", "s.csv", "--rig", "sen"], monkeypatch, capsys) == ["sensor"]


@pytest.mark.skipif(sys.platform == "win32", reason="bash is not there")
def test_completion_installs_itself_for_bash(tmp_path, monkeypatch, capsys):
    """In a home of its own: the script lies there, .bashrc reads it, and bash completes by it."""
    monkeypatch.setattr(sys, "argv", ["hmpim", "--install-completion", "bash"])
    for name, value in {
        "HOME": str(tmp_path),
        "SHELL": "/bin/bash",
        "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1",
    }.items():
        monkeypatch.setenv(name, value)
    with pytest.raises(SystemExit) as ended:
        app(prog_name="hmpim")
    assert ended.value.code in (0, None)
    assert "bash completion installed" in capsys.readouterr().out
    script = tmp_path / ".bash_completions" / "hmpim.sh"
    assert str(script) in (tmp_path / ".bashrc").read_text()
    (tmp_path / "hmpim.toml").write_text(RIGS)
    hmpim = tmp_path / "hmpim"
    hmpim.write_text(f"#!{sys.executable}\nfrom hmpim.cli.main import main; main()\n")
    hmpim.chmod(0o755)
    pressed = (
        f"source '{script}'; COMP_WORDS=(hmpim run s.csv --rig bench9); COMP_CWORD=4; "
        f'_hmpim_completion {hmpim}; echo "${{COMPREPLY[@]}}"'
    )
    done = subprocess.run(
        ["bash", "-c", pressed], capture_output=True, text=True, check=True, cwd=tmp_path
    )
    assert done.stdout.split() == ["bench9"]


PRESSED = """
import os, pty, re, select, sys, time
shell, line, wanted = sys.argv[1:]
pid, fd = pty.fork()
if not pid:
    os.execvp(shell, [shell, "-i"])
end, seen, typed = time.monotonic() + 120.0, "", False
while time.monotonic() < end and wanted not in seen:
    if select.select([fd], [], [], 0.5)[0]:
        seen += re.sub(r"\\x1b\\[[\\d;?]*\\w", "", os.read(fd, 65536).decode(errors="replace"))
    elif not typed:  # the prompt is there, and nothing more comes
        os.write(fd, line.encode() + b"\\t")
        typed = True
os.kill(pid, 9)
os.waitpid(pid, 0)
sys.exit(0 if wanted in seen else repr(seen))
"""


@pytest.mark.skipif(shutil.which("zsh") is None, reason="zsh is not there")
def test_zsh_completes_at_the_first_tab(tmp_path):
    """A shell behind a pseudo terminal, in a home of its own, as a person installs it."""
    hmpim = tmp_path / "hmpim"
    hmpim.write_text(f"#!{sys.executable}\nfrom hmpim.cli.main import main; main()\n")
    hmpim.chmod(0o755)
    (tmp_path / "hmpim.toml").write_text('[rigs.bench9]\nrig = "table"\n')
    own = {
        **os.environ,
        "HOME": str(tmp_path),
        "ZDOTDIR": str(tmp_path),
        "SHELL": "/bin/zsh",
        "TERM": "xterm",
        "PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}",
        "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1",
    }
    install = [str(hmpim), "--install-completion", "zsh"]
    subprocess.run(install, env=own, cwd=tmp_path, check=True, capture_output=True)
    line, wanted = "hmpim run s.csv --rig be", "--rig bench9"
    done = subprocess.run(
        [sys.executable, "-c", PRESSED, "zsh", line, wanted],
        env=own, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=200,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
