"""Figures: axes in, curves out."""
