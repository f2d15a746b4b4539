"""What the shell offers when Tab is pressed behind an option."""

__all__ = ["complete_rig"]


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
