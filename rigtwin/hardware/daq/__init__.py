"""The rig behind a data acquisition card.

Which signal is on which line, volts, the card itself, and a virtual one.
"""

from pathlib import Path

CARD = Path(__file__).parents[3] / "machines" / "cards" / "pci-6229.toml"
"""The packaged channel table."""
