"""One clean fit of the record that tools are compared on; a test changes one thing about it."""

import numpy as np
import pytest

from hmpim.identify.fitting.joint import joint_fit
from hmpim.identify.frf.local import local_response
from hmpim.identify.judgement import Evidence
from hmpim.identify.noise.misfit import misfit
from hmpim.identify.reading.bandwidth import response_bandwidths
from hmpim.identify.reading.readings import read_parameters

FS, BAND = 200.0, (0.1, 20.0)


@pytest.fixture(scope="session")
def evidence_of():
    """Evidence on an input and an output at 200 Hz, of which nothing is known."""

    def made(u, y, *, band=BAND, structures=("static", "first_order", "second_order")):
        joint = joint_fit(u, y, structures=structures)
        fit = joint.best.fit
        readings = read_parameters(
            joint,
            fs=FS,
            highest=band[1],
            delay_correlation=None,
            units=("", ""),
        )
        response = local_response(u, y, FS, delay=max(fit.delay, 0.0) / FS, band=band)
        counted = slice(None) if joint.problem.valid is None else joint.problem.valid
        spread = float(np.sum((y[counted] - y[counted].mean()) ** 2))
        return Evidence(
            joint=joint,
            readings=readings,
            spanned=readings.parameters,
            misfit=misfit(u, fit.residual, delay=fit.delay, band=(band[0] / FS, band[1] / FS)),
            u=u,
            fs=FS,
            band=band,
            fit_percent=100 * (1 - np.sqrt(fit.cost / spread)),
            measured=response_bandwidths(
                response,
                readings.system,
                readings.parameters,
                fs=FS,
                intersample=joint.best.intersample,
            ),
        )

    return made


@pytest.fixture(scope="session")
def clean(field_record, evidence_of):
    """Second order 10 Hz, ζ 0.4, 150 ms, white noise 0.1."""
    _, u, y = field_record
    return evidence_of(u, y + 0.1 * np.random.default_rng(0).standard_normal(y.size))
