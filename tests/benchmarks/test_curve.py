"""The curve of share against parts: prices multiply what the defaults say, and a
picture comes out.
"""

import pytest

from hiproof.settings import Settings

pytest.importorskip("matplotlib", reason="the curve is drawn with matplotlib (extra `report`)")


def test_a_price_of_one_is_the_default_and_others_multiply_it():
    from benchmarks.curve import PRICE, set_price

    assert set_price(1.0) == Settings()
    for name in PRICE:
        assert getattr(set_price(4.0).compound, name) == pytest.approx(
            4.0 * getattr(Settings().compound, name)
        )


def test_the_curve_is_drawn(tmp_path):
    from benchmarks.curve import Stop, draw

    stops = [Stop(price, 0.9 - 0.02 * price, 5.0 / price, 6.0, 0.9) for price in (0.5, 1.0, 2.0)]
    draw({"delft": stops, "amsterdam_west": stops}, tmp_path / "curve.png")
    assert (tmp_path / "curve.png").read_bytes()[:4] == b"\x89PNG"
