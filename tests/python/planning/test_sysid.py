"""Parameters that ``examples/sysid.py`` finds predict another motion as well as the recorded one's noise allows."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import tightloop as tl
from conftest import REPOSITORY
from tiers import NIGHTLY

sys.path.insert(0, str(REPOSITORY / "examples"))
import sysid


@pytest.mark.filterwarnings("ignore:.*which no body has")
@NIGHTLY
def test_found_parameters_predict_another_motion_as_well_as_noise_allows(tmp_path):
    scene, rng = sysid.scene(tmp_path), np.random.default_rng(7)
    with tl.launch(scene, worlds=sysid.Model.worlds, precision="f64", params=sysid.PARAMS, fields=("joint_q",)) as sim:
        model = sysid.Model(sim)
        true, targets, others = sysid.truth(model, rng), sysid.excitation(14), sysid.excitation(15)
        recorded = model.motion(true[None], targets)[0]
        found = sysid.identify(model, targets, recorded + rng.normal(0, sysid.SIGMA, recorded.shape))
        new = model.motion(np.stack([true, np.zeros_like(true)]), others).reshape(2, -1)
        predicted, jacobian = model.linearized(found.theta, others)
    # what is left are the encoders' errors: their mean square is within five of its standard deviations
    assert abs(found.rms[-1] ** 2 / sysid.SIGMA**2 - 1) < 5 * np.sqrt(2 / recorded.size) + len(true) / recorded.size
    # errors have the covariance that H⁻¹ says: their mean square is within five of its standard deviations
    covariance = jacobian @ found.covariance @ jacobian.T
    mean, spread = np.trace(covariance), np.sqrt(2 * np.square(covariance).sum())
    assert np.square(predicted - new[0]).sum() < mean + 5 * spread
    # the bound is far below what the data sheet predicts, and below the noise of a single value
    assert mean + 5 * spread < 0.1 * np.square(new[1] - new[0]).sum()
    assert mean + 5 * spread < new[0].size * sysid.SIGMA**2
    # each entry of θ is within six of its standard deviations
    assert (np.abs(found.theta - true) < 6 * np.sqrt(np.diag(found.covariance))).all()


def test_wrong_parameters_would_be_seen(tmp_path):
    with tl.launch(
        sysid.scene(tmp_path), worlds=sysid.Model.worlds, precision="f64", params=sysid.PARAMS, fields=("joint_q",)
    ) as sim:
        model = sysid.Model(sim)
        targets = sysid.excitation(14)
        here, jacobian = model.linearized(np.zeros(len(model.names)), targets)
        # a tenth of the prior is 2 % of a mass: the joints move as the Jacobian says, but for terms of second order
        heavier = np.zeros(len(model.names))
        heavier[3] = 0.1
        moved = model.motion(heavier[None], targets).ravel() - here
    expected = jacobian[:, 3] * 0.1
    assert np.linalg.norm(moved - expected) < 0.02 * np.linalg.norm(moved)
    assert np.sqrt(np.mean(np.square(moved))) > sysid.SIGMA / 10
