"""Help and shell completion, the latter asked of real shells."""

import re
import shlex
import shutil
import subprocess

import pytest

from gbt_ocp.cli import main as cli
from gbt_ocp.cli.parser import SUBCOMMANDS, parser
from gbt_ocp.experiments.config.loading import load_config

NAMES = list(SUBCOMMANDS)


def subparsers():
    (action,) = (action for action in parser()._actions if getattr(action, "choices", None))
    return action.choices


def test_every_subcommand_has_examples():
    assert list(subparsers()) == NAMES
    assert all(subcommand.examples for subcommand in SUBCOMMANDS.values())


@pytest.mark.parametrize("name", NAMES)
def test_help_shows_examples_that_parse(name, capsys):
    assert cli.main([name, "--help"]) == 0
    help_text = capsys.readouterr().out
    for line in SUBCOMMANDS[name].examples:
        assert line in help_text
        words = shlex.split(line.partition(" > ")[0])
        assert words[0] == "gbt-ocp"
        found = parser().parse_args(words[1:])
        config = getattr(found, "config", None)
        for one in config if isinstance(config, list) else [config]:
            if one is not None and not one.endswith((".yaml", ".py")):
                load_config(one, overrides=found.set)
    for action in subparsers()[name]._actions:
        assert action.help, f"{name} {action.option_strings or action.dest} has no help"


def completed(shell, script, line):
    """What a shell offers for a line."""
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    if shell == "bash":
        words = line.split(" ")
        ask = (
            f"source {script}; COMP_WORDS=({' '.join(map(shlex.quote, words))}); COMP_CWORD={len(words) - 1}\n"
            'name=$(complete -p gbt-ocp | sed "s/.*-F \\([^ ]*\\).*/\\1/"); $name; printf "%s\\n" "${COMPREPLY[@]}"'
        )
        command = ["bash", "--norc", "-c", ask]
    else:
        command = ["fish", "--no-config", "-c", f"source {script}; complete -C {shlex.quote(line)}"]
    done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=script.parent)
    return [entry.split("\t")[0].strip() for entry in done.stdout.splitlines() if entry.strip()]


@pytest.mark.parametrize("shell", ["bash", "fish"])
def test_a_shell_completes_subcommands_options_configurations_and_files(shell, tmp_path, capsys):
    assert cli.main(["completion", shell]) == 0
    script = tmp_path / "script"
    script.write_text(capsys.readouterr().out)
    (tmp_path / "mine.yaml").touch()
    assert {"run", "replay", "reproduce", "report"} == set(completed(shell, script, "gbt-ocp r")) - {"r"}
    assert "--no-figures" in completed(shell, script, "gbt-ocp run --no")
    assert completed(shell, script, "gbt-ocp run case")[:6] == [f"case{number}" for number in range(1, 7)]
    assert "mine.yaml" in completed(shell, script, "gbt-ocp run mi")
    assert set(completed(shell, script, "gbt-ocp reproduce table")) == {"table2", "table3"}


def test_zsh_reads_its_script(tmp_path, capsys):
    assert cli.main(["completion", "zsh"]) == 0
    text = capsys.readouterr().out
    assert text.startswith("#compdef gbt-ocp")
    assert re.search(r"configuration:\(case1 case2 ", text)
    if shutil.which("zsh") is None:
        pytest.skip("zsh is not installed")
    (tmp_path / "_gbt-ocp").write_text(text)
    subprocess.run(["zsh", "-f", "-n", str(tmp_path / "_gbt-ocp")], check=True, capture_output=True)
