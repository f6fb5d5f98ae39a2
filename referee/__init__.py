"""The withheld-effect check.

A referee with an independent rig withholds defects, a diagnosis sees the recordings alone, and
its answers are scored.
"""
