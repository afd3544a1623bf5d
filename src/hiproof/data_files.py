"""Files that stand beside the code: tables in `data`, and what pages are made of."""

import tomllib
from collections.abc import Iterable, Mapping
from importlib import resources
from typing import Any

Values = dict[str, Any]  # values by name: a table of TOML, an object of JSON, a row of a table


def read_data_file(name: str) -> Values:
    """Read data/NAME.toml."""
    return tomllib.loads(read_asset(f"data/{name}.toml"))


def read_asset(place: str) -> str:
    """Read a text file of the package, such as "view/assets/view.html"."""
    return (resources.files("hiproof") / place).read_text(encoding="utf-8")


def draw_rings(rings: Iterable[Any]) -> str:
    """Return closed rings of (x, y) as the data of an SVG path.

    >>> draw_rings([[(0, 0), (1.52, 0), (1, 1)]])
    'M0.0 0.0L1.5 0.0L1.0 1.0Z'
    """
    return "".join("M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in ring) + "Z" for ring in rings)


def fill_page(page: str, content: Mapping[str, str]) -> str:
    """Return a page with texts in place of its comments of their names.

    >>> fill_page("<h1><!--title--></h1>", {"title": "Delft"})
    '<h1>Delft</h1>'
    """
    for name, text in content.items():
        page = page.replace(f"<!--{name}-->", text)
    return page
