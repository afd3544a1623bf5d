"""The QGIS plugin: a Processing provider for the `hiproof` command.

The command has to be installed.

`commands.py` makes the command lines and `process.py` runs them, both without QGIS; `algorithms.py`
asks for the parameters, and `results.py` loads what a run has written.
"""


def classFactory(iface):
    """Make the plugin; QGIS calls this."""
    from .plugin import Plugin

    return Plugin()
