"""Fence the examples of docstrings, which Markdown would take for quotations.

mkdocstrings loads this extension for the page of the Python API.
"""

import re
from typing import Any

import griffe


class FencedExamples(griffe.Extension):
    """Make each block that starts with `>>>` a block of code."""

    def on_object(self, *, obj: griffe.Object, **kwargs: Any) -> None:
        if obj.docstring is not None:
            fence = r"```pycon\n\g<0>\n```"
            text = re.sub(r"^>>> .*(\n.+)*", fence, obj.docstring.value, flags=re.MULTILINE)
            obj.docstring.value = text
