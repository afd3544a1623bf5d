"""The QGIS plugin: a Processing provider that calls the installed `hiproof` command.

`commands.py` makes the command lines and `process.py` runs them, both without QGIS; `algorithms.py`
asks for the parameters, and `results.py` loads what a run has written.
"""


def classFactory(iface):
    """What QGIS calls to have the plugin."""
    from .plugin import Plugin

    return Plugin()
