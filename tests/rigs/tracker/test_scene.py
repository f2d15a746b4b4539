"""The scene: exact in fractions of a pixel, and what each tracker makes of it."""

import numpy as np
import pytest
from scipy.special import ndtr

from hmpim.errors import ArgumentError
from hmpim.rigs.tracker import Scene, make_tracker

CLEAN = Scene(clutter_std=0.0, noise_std=0.0)


def test_a_pixel_is_the_mean_of_the_target_over_its_area():
    scene = Scene(clutter_std=0.0, noise_std=0.0, target_level=190.0, blur=1.3)
    frame = scene.backdrop(np.random.default_rng(0)).seen(0.037, 0.0, np.random.default_rng(0))
    centre, half = 80.0 + 0.37, 5.5
    for column in (73, 74, 75, 76, 85, 86):
        x = column + (np.arange(2000) + 0.5) / 2000
        share = ndtr((x - centre + half) / 1.3) - ndtr((x - centre - half) / 1.3)
        y = (np.arange(2000) + 0.5) / 2000  # in the middle of the target
        down = np.mean(ndtr((y + 4.5) / 1.3) - ndtr((y - 4.5) / 1.3))
        assert frame[60, column] == pytest.approx(60.0 + 190.0 * share.mean() * down, abs=0.51)


@pytest.mark.parametrize(("name", "most"), [("centroid", 0.015), ("template", 0.05)])
def test_a_clean_target_is_found_in_fractions_of_a_pixel(name, most):
    pytest.importorskip("cv2")
    backdrop, rng = CLEAN.backdrop(np.random.default_rng(0)), np.random.default_rng(0)
    follow = make_tracker(name, at=CLEAN.middle, size=(11.0, 9.0))
    for pixels in np.linspace(0.0, 6.0, 25):
        x, y = follow(backdrop.seen(CLEAN.pixel * pixels, 0.0, rng))
        assert abs(x - CLEAN.middle[0] - pixels) < most
        assert abs(y - CLEAN.middle[1]) < most


def test_csrt_follows_to_half_a_pixel():
    pytest.importorskip("cv2")
    scene = Scene()
    rng = np.random.default_rng(3)
    backdrop = scene.backdrop(rng)
    follow = make_tracker("csrt", at=scene.middle, size=(11.0, 9.0))
    off = [
        follow(backdrop.seen(scene.pixel * pixels, 0.0, rng))[0] - scene.middle[0] - pixels
        for pixels in 8.0 * np.sin(np.arange(15) / 4)
    ]
    assert np.sqrt(np.mean(np.square(off))) < 1.0


@pytest.mark.parametrize("name", ["centroid", "template"])
def test_a_target_that_is_gone_is_lost(name):
    pytest.importorskip("cv2")
    scene, rng = Scene(), np.random.default_rng(5)
    backdrop = scene.backdrop(rng)
    follow = make_tracker(name, at=scene.middle, size=(11.0, 9.0))
    assert follow(backdrop.seen(0.0, 0.0, rng)) is not None
    assert follow(backdrop.seen(50.0, 0.0, rng)) is None


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"width": 8}, "width = 8 pixels; give at least 32"),
        ({"pixel": 0.0}, r"pixel = 0\.0 must be positive"),
        ({"noise_std": -1.0}, r"noise_std = -1\.0 must be 0 or positive"),
    ],
)
def test_what_cannot_be_is_refused(wrong, words):
    with pytest.raises(ArgumentError, match=words):
        Scene(**wrong)
    with pytest.raises(ArgumentError, match="tracker = 'eye' is not known"):
        make_tracker("eye", at=(0.0, 0.0), size=(1.0, 1.0))
