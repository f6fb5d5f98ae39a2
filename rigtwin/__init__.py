"""The digital twin of a test rig, and the tool that says why the twin and the rig disagree.

    import rigtwin

    rig = rigtwin.machine("suspension-rig")
    recording = rigtwin.run(rig, "imposed", seed=1, effects={"viscous@motor": 50})
    answer = rigtwin.diagnose(recording)
    answer.report("why.html")

Names are loaded when they are first used, so that importing it costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.1.0"

if TYPE_CHECKING:
    from rigtwin.api import (
        Comparison,
        Configuration,
        Diagnosis,
        Effect,
        Experiment,
        Machine,
        Recording,
        RigtwinError,
        calibrate,
        compare,
        compare_recordings,
        diagnose,
        effects,
        experiments,
        import_data,
        load,
        machine,
        machines,
        run,
    )

__all__ = [
    "Comparison",
    "Configuration",
    "Diagnosis",
    "Effect",
    "Experiment",
    "Machine",
    "Recording",
    "RigtwinError",
    "calibrate",
    "compare",
    "compare_recordings",
    "diagnose",
    "effects",
    "experiments",
    "import_data",
    "load",
    "machine",
    "machines",
    "run",
]


def __getattr__(name: str) -> object:
    if name in __all__:
        value = getattr(import_module("rigtwin.api"), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'rigtwin' has no attribute {name!r}; it has {', '.join(__all__)}")


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
