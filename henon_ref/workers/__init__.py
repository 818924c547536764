"""Processes that do work: their start, what they hold and have used, and the machine that they run on."""
