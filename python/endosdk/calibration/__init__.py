"""Rigs: numbers, rules, board calibration and the files they come from."""
