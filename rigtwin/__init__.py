"""rigtwin: the digital twin of a hybrid suspension rig, and the tool that says why the twin and the rig disagree."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("rigtwin")
except PackageNotFoundError:
    __version__ = "0+unknown"
