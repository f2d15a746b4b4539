"""What the shell offers when Tab is pressed behind an option."""

import contextlib

__all__ = ["complete_rig", "completing_at_the_first_tab"]

_ZSH = """
#compdef %(prog_name)s

%(complete_func)s() {
  eval $(env _TYPER_COMPLETE_ARGS="${words[1,$CURRENT]}" %(autocomplete_var)s=complete_zsh %(prog_name)s)
}

if [[ $zsh_eval_context[-1] == loadautofunc ]]; then
  %(complete_func)s "$@"
else
  compdef %(complete_func)s %(prog_name)s
fi
"""  # noqa: E501


def completing_at_the_first_tab() -> None:
    """Give zsh a script that completes when it is first loaded, too.

    With Typer's own the first Tab of every shell only loads the function, and offers nothing.
    """
    with contextlib.suppress(ImportError, AttributeError):  # a later Typer has its own way
        from typer import _completion_shared

        _completion_shared._completion_scripts["zsh"] = _ZSH


def complete_rig(incomplete: str) -> list[tuple[str, str]]:
    """Return the rigs whose name begins with what is typed, each with a word on it.

    Nothing is said of files that are broken: a shell that completes has nowhere to say it, and
    ``hmpim rigs`` does.

    Examples
    --------
    >>> [name for name, _ in complete_rig("sens")]
    ['sensor']
    """
    from hmpim.errors import HmpimError
    from hmpim.rigs.catalogue import KINDS, named_rigs, offered_kinds

    offers = [(kind.form.partition(":")[0], kind.words) for kind in KINDS]
    try:
        offers = [(name, "described in hmpim.toml") for name in named_rigs()] + offers
        offers += [(each.name, each.value) for each in offered_kinds()]
    except (HmpimError, OSError):
        pass
    # A shell cuts words at a colon: what stands behind it is typed by hand.
    return [(name, words) for name, words in offers if name.startswith(incomplete)]
