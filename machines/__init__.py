"""Descriptions of machines; data only."""
