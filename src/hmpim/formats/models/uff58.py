"""UFF dataset 58: the response for programs of modal analysis, written by pyuff."""

from pathlib import Path

import numpy as np

from hmpim.errors import MissingExtraError
from hmpim.formats.atomic import replacing
from hmpim.formats.models.response import response_of
from hmpim.formats.models.source import LINEAR_PART, Source, ascii_of

__all__ = ["write_uff58"]

_RESPONSE, _GENERAL = 4, 0
"""Types of function in dataset 58: frequency response, and general."""

_LINE = 80


def write_uff58(source: Source, path: Path) -> tuple[Path, ...]:
    """Write three functions: measured response, its standard deviation, the model's response.

    Raises
    ------
    MissingExtraError
        If pyuff is not installed.
    """
    try:
        import pyuff
    except ImportError:
        raise MissingExtraError(
            "UFF58 needs the package pyuff; install it with: pip install 'hmpim[uff]'"
        ) from None
    seen, pair = response_of(source), source.pair
    lacking = ascii_of(source.note).removeprefix(LINEAR_PART) or "NONE"
    said = [
        f"{pair.output} from {pair.input}",
        f"hmpim {source.version}, verdict {pair.verdict}",
        f"sha256 {source.record.sha256}",
    ]
    with replacing(path) as place:
        place.unlink()  # pyuff appends
        file = pyuff.UFF(str(place))
        for kind, values, function in (
            ("measured response", seen.measured, _RESPONSE),
            ("standard deviation of |error| of the measured response", seen.measured_std, _GENERAL),
            ("response of the model", seen.model, _RESPONSE),
        ):
            file.write_sets(
                pyuff.prepare_58(
                    binary=0,
                    func_type=function,
                    id1=said[0][:_LINE],
                    id2=kind[:_LINE],
                    id3=lacking[:_LINE],
                    id4=said[1][:_LINE],
                    id5=said[2][:_LINE],
                    rsp_ent_name=pair.output[:10],
                    ref_ent_name=pair.input[:10],
                    rsp_node=1,
                    rsp_dir=0,
                    ref_node=2,
                    ref_dir=0,
                    data=np.asarray(values),
                    x=seen.frequency,
                    ord_data_type=6 if np.iscomplexobj(values) else 4,
                    abscissa_spacing=0,
                    abscissa_spec_data_type=18,
                    abscissa_axis_units_lab="Hz",
                    ordinate_spec_data_type=0,
                    orddenom_spec_data_type=0,
                    z_axis_spec_data_type=0,
                ),
                "add",
            )
    return (path,)
