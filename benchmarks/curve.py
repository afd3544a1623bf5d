"""Where would a draughtsman stop?

Share of points near the roof against parts, as structure gets dearer.

usage: python -m benchmarks.curve [--set delft amsterdam_west] [--prices 0.25 0.5 1 2 4 8] [--parity
even|odd]
           [--out benchmarks/figures/curve.png]

The settings PRICE of [compound], what one unit of structure must explain, are multiplied by each
price; every footprint is fitted and composed anew, and `roof_residuals.py` measures the written
models. Prints a row a price: the share of points within 0.2 m, parts and roof faces in the mean,
the named share; and draws share against parts.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from hiproof.settings import Settings

from .delft import SETS, Asked, measure, model_buildings, read_set
from .judging import measure_named_share

PRICE = ("evidence_points", "evidence_area_m2")
TITLES = {"delft": "Delft", "amsterdam_west": "Amsterdam West"}


@dataclass(frozen=True)
class Stop:
    """The result at one price.

    It has the share within 0.2 m, parts and roof faces a building, and the named share of the area.
    """

    price: float
    share: float
    parts: float
    faces: float
    named: float


def set_price(price: float) -> Settings:
    """Return default settings with structure at `price` times its cost."""
    compound = Settings().compound
    return Settings.from_dict(
        {"compound": {name: price * getattr(compound, name) for name in PRICE}}
    )


def stop_at(price: float, data_set: Asked) -> Stop:
    buildings, columns = model_buildings(data_set, set_price(price))
    share = measure(buildings, data_set)["share_within_20cm"]
    return Stop(
        price,
        share,
        columns["parts"].mean(),
        columns["faces"].mean(),
        measure_named_share(buildings),
    )


def draw(curves: dict[str, list[Stop]], path: Path) -> None:
    """Draw a panel a set: share against parts, each point with its price.

    The default is the filled one.
    """
    figure, panels = plt.subplots(1, len(curves), figsize=(5.5 * len(curves), 4.2), squeeze=False)
    for axes, (name, stops) in zip(panels[0], curves.items(), strict=True):
        axes.plot(
            [stop.parts for stop in stops],
            [stop.share for stop in stops],
            color="#b3563f",
            zorder=1,
        )
        for stop in stops:
            face = "#b3563f" if stop.price == 1 else "white"
            axes.scatter(
                stop.parts, stop.share, s=45, facecolor=face, edgecolor="#b3563f", zorder=2
            )
            axes.annotate(
                f"{stop.price:g}",
                (stop.parts, stop.share),
                (6, -10),
                textcoords="offset points",
                fontsize=9,
            )
        axes.set(
            title=TITLES[name],
            xlabel="parts a building",
            ylabel="share of points within 0.2 m of the roof",
        )
        axes.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--set", nargs="+", choices=list(SETS), default=list(SETS))
    parser.add_argument("--prices", type=float, nargs="+", default=[0.25, 0.5, 1.0, 2.0, 4.0, 8.0])
    parser.add_argument(
        "--parity", choices=("even", "odd"), help="footprints whose id is such a number"
    )
    parser.add_argument(
        "--out", type=Path, default=Path(__file__).with_name("figures") / "curve.png"
    )
    arguments = parser.parse_args()
    curves = {}
    for name in arguments.set:
        request, curves[name] = read_set(name, parity=arguments.parity), []
        for price in arguments.prices:
            stop = stop_at(price, request)
            curves[name].append(stop)
            print(
                f"{name} price {price:<5g} share {stop.share:.4f}  parts {stop.parts:.2f}  faces "
                f"{stop.faces:.2f}"
                f"  named {stop.named:.3f}",
                flush=True,
            )
    draw(curves, arguments.out)


if __name__ == "__main__":
    main()
