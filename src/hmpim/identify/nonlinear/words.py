"""What is said of a nonlinearity: how much, of which kind, and what to do about it."""

from collections.abc import Sequence

from hmpim.identify.nonlinear.mechanisms import Kind, Mechanism
from hmpim.identify.result.digits import percent, plus_minus
from hmpim.identify.result.groups import MODELLED
from hmpim.identify.worth import MOST
from hmpim.record import Finding

__all__ = ["KIND_WORDS", "general", "particular"]

KIND_WORDS: dict[Kind, str] = {
    "hardening": "a hardening spring",
    "softening": "a softening spring",
    "friction": "Coulomb friction",
    "backlash": "backlash",
    "rate_limit": "a rate limit",
    "saturation": "clipping",
    "asymmetry": "an asymmetric response",
    "dead_zone": "a dead zone of the command",
    "curvature": "a scale factor that changes with the deflection",
}


def general(
    *,
    share: float,
    where: Sequence[str],
    made_of: tuple[float, float, float],
    kinds: Sequence[Mechanism],
    effect: float,
    asked: bool,
    swept: bool,
    doubt: bool,
) -> Finding:
    """Say that it is nonlinear, how much, even or odd, and what it may be.

    Parameters
    ----------
    share : float
        R.m.s. of the nonlinear part over that of the output.
    where : sequence of str
        Where it was seen, such as 'odd harmonics of the sweep'.
    made_of : tuple of float
        Shares of the residual's power: noise, linear, nonlinear.
    kinds : sequence of Mechanism
        Those left in question.
    effect : float
        R.m.s. of all that the first of them does, over that of the output.
    asked : bool
        Whether the kinds were compared at all.
    swept : bool
        Whether the input is a sweep, whose own frequency tells dynamics left out from noise.
    doubt : bool
        Whether it is so large that the linear parameters hold at this amplitude only.

    Examples
    --------
    >>> general(
    ...     share=0.021, where=["odd harmonics of the sweep"], made_of=(0.3, 0.1, 0.6),
    ...     kinds=[], effect=0.0, asked=False, swept=True, doubt=True).message[:58]
    '2.1 % of the output (r.m.s.) is nonlinear: odd harmonics o'
    """
    noise, linear, nonlinear = (100 * part for part in made_of)
    if len(kinds) == 1:
        guess = f"It looks like {KIND_WORDS[kinds[0].kind]}."
    elif kinds:
        names = " or ".join(KIND_WORDS[m.kind] for m in kinds)
        guess = f"It may be {names}; this record does not show which."
    elif asked:
        guess = "None of the kinds tried fits alone."
    else:
        guess = "Drive one input at a time to see which kind it is."
    seen = f": {' and '.join(where)}" if where else ""
    left = f"Of the residual's power {nonlinear:.0f} % is nonlinear and {noise:.0f} % noise"
    if not swept:
        left += " or dynamics left out"
    elif linear >= 0.5:
        left += f"; {linear:.0f} % still follows the input"
    whole = f" Its whole effect, most of which a linear model absorbs, is {percent(effect)} %."
    return Finding(
        code="nonlinear",
        message=f"{percent(share)} % of the output (r.m.s.) is nonlinear{seen}. {guess}"
        f"{whole if effect > (1 + MOST) * share else ''} {left}. "
        "Identify at several amplitudes to see where the linear model holds.",
        severity="doubt" if doubt else "info",
        parameters=MODELLED,
    )


def particular(found: Mechanism, unit: str) -> Finding | None:
    """Say what the kind means, with its number, and what to do about it; None where unnamed.

    Parameters
    ----------
    found : Mechanism
        The one kind that the record leaves.
    unit : str
        The output's unit.

    Examples
    --------
    >>> import numpy as np
    >>> found = Mechanism(
    ...     kind="backlash", size=0.1, size_std=0.01, gain=99.0, likelihood=0.0, rms=0.02,
    ...     effect=0.05, trace=np.zeros(0))
    >>> particular(found, "deg").message[:48]
    'There is play of 0.200 ± 0.020 deg in total. Loo'
    """
    of = f" {unit}" if unit else ""
    share = f"{plus_minus(100 * found.size, 100 * found.size_std)} %"
    size = f"{plus_minus(found.size, found.size_std)}{of}"
    match found.kind:
        case "hardening" | "softening":
            way, moves = ("above", "higher") if found.kind == "hardening" else ("below", "lower")
            # Of a cubic force beside a sinusoid three quarters act like a spring; half of a
            # spring's change goes into the frequency.
            message = (
                f"At the largest deflection the restoring force is {share} {way} that of a linear "
                f"spring, so the natural frequency there is about {percent(0.375 * found.size)} % "
                f"{moves} than for small motion. Use a smaller amplitude for the linear model."
            )
        case "friction":
            message = (
                f"Coulomb friction equals the restoring force at a deflection of {size}. "
                "Motions of that size barely show in the output; use larger ones, or put friction "
                "into the model."
            )
        case "backlash":
            message = (
                f"There is play of {plus_minus(2 * found.size, 2 * found.size_std)}{of} in total. "
                "Look at gears and couplings, or put backlash into the model."
            )
        case "rate_limit":
            message = (
                f"The speed seems limited to {size}{'/s' if unit else ' per second'}. "
                "Keep the stimulus's velocity below it."
            )
        case "saturation":
            message = (
                f"The output seems clipped {size} from its bias. Drive it less hard, or "
                "look for a stop."
            )
        case _:
            return None
    return Finding(code=found.kind, message=message, severity="info", parameters=MODELLED)
