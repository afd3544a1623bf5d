"""The raster of a registration against scipy's, which takes a quarter of a second to import."""

import numpy as np
import pytest
from scipy import ndimage

from hiproof.fit.registration import blur


@pytest.mark.parametrize(("shape", "sigma"), [((40, 23), 1.25), ((23, 40), 0.5), ((12, 12), 2.5)])
def test_a_blur_is_that_of_scipy_bit_by_bit(shape, sigma):
    raster = (np.random.default_rng(0).random(shape) > 0.5).astype(np.float32)
    expected = ndimage.gaussian_filter(raster, sigma, truncate=3.0)
    blurred = blur(raster, sigma)
    assert blurred.dtype == np.float32 and np.array_equal(blurred, expected)
