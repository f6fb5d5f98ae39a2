"""Connection of a rig to a data acquisition card: channel table, conversion, card, virtual card."""

from pathlib import Path

CARD = Path(__file__).parents[3] / "machines" / "cards" / "pci-6229.toml"
"""Path of the channel table that is shipped with the package."""
