"""Saliency: held against stored maps of OpenCV's own, and against what the definitions say."""

from pathlib import Path

import numpy as np
import pytest

from motorprime import ArgumentError
from motorprime.errors import ArgumentTypeError
from motorprime.saliency import fine_grained, spectral_residual, weighted
from pictures import shapes

GOLDEN = np.load(Path(__file__).parent / "golden" / "saliency.npz")
MAPS = {"spectral_residual": spectral_residual, "fine_grained": fine_grained}


@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_maps_are_those_of_opencv(name, seed):
    """Theirs are rounded on the way, to 8 bits in the fine-grained one."""
    image = shapes(seed)
    stored = GOLDEN[f"{name}_{seed}"] / 255.0
    ours = MAPS[name](image)
    assert np.corrcoef(ours.ravel(), stored.ravel())[0, 1] > {"spectral_residual": 0.9999}.get(name, 0.9995)
    np.testing.assert_allclose(ours / ours.max(), stored, atol=0.05)


@pytest.mark.parametrize("saliency", MAPS.values())
def test_a_map_is_an_image_of_numbers_from_0_to_1_and_the_picture_stays(saliency):
    image = shapes(4, height=50, width=90)
    before = image.copy()
    found = saliency(image)
    assert found.shape == (50, 90)
    assert found.dtype == np.float32
    assert 0.0 <= found.min() < found.max() <= 1.0
    np.testing.assert_array_equal(image, before)


@pytest.mark.parametrize("saliency", MAPS.values())
def test_in_a_picture_of_one_colour_nothing_stands_out(saliency):
    assert not saliency(np.full((60, 80, 3), 90, np.uint8)).any()


@pytest.mark.parametrize("saliency", MAPS.values())
@pytest.mark.parametrize("grey", [0, 250])
def test_a_lone_spot_stands_out_whether_bright_or_dark(saliency, grey):
    image = np.full((120, 160, 3), 120, np.uint8)
    image[40:52, 100:112] = grey
    found = saliency(image)
    v, u = np.unravel_index(int(found.argmax()), found.shape)
    assert 36 <= v < 56
    assert 96 <= u < 116


def test_bright_and_dark_are_worth_the_same():
    """Each sign is scaled by itself."""
    image = np.full((200, 300, 3), 120, np.uint8)
    image[95:105, 70:80], image[95:105, 220:230] = 130, 20
    found = fine_grained(image)
    assert found[100, 75] == pytest.approx(found[100, 225], rel=0.1)


def test_a_weighted_landscape_is_the_mixture_of_itself_and_its_product():
    landscape = np.array([[0.0, 2.0], [4.0, 6.0]], np.float32)
    striking = np.array([[1.0, 0.0], [0.5, 1.0]], np.float32)
    np.testing.assert_allclose(weighted(landscape, striking, share=0.25), [[0.0, 1.5], [3.5, 6.0]])
    np.testing.assert_array_equal(weighted(landscape, striking, share=0.0), landscape)
    np.testing.assert_array_equal(weighted(landscape, striking, share=1.0), landscape * striking)
    assert weighted(landscape, striking).dtype == np.float32


def test_what_does_not_fit_is_refused():
    with pytest.raises(ArgumentError, match=r"saliency: shape .* \(2, 2\); got \(2, 3\)"):
        weighted(np.ones((2, 2)), np.ones((2, 3)))
    for share in (-0.1, 1.1, float("nan")):
        with pytest.raises(ArgumentError, match="share"):
            weighted(np.ones((2, 2)), np.ones((2, 2)), share=share)
    for saliency in MAPS.values():
        with pytest.raises(ArgumentTypeError, match="image"):
            saliency(np.zeros((5, 5, 3)))
        with pytest.raises(ArgumentError, match="image"):
            saliency(np.zeros((5, 5), np.uint8))
