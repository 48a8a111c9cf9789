"""Benchmarks: `make bench` runs them all; figures are medians, and ratios to a reference of the same run."""
